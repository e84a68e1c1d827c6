//! Stage II of the paper: from a detection's part mask to pose, size and model.
//!
//! 2D centres of the parts ([`part_evidence`]), filters ([`PartFilters`]), 3D centres of each model, PnP for every model
//! of the zoo, and the model with the lowest reprojection error wins ([`PoseEstimator`]).
//!
//! [`dense`] goes past the paper: no centres, every probability of the kernel against the drawn model.

mod centers;
pub mod dense;
mod estimator;
mod filters;
mod fit;
pub mod ground;
mod observed;
mod ranking;
mod reasons;
pub mod scene;
mod visible;

pub use centers::{Center2d, Center3d, PartEvidence, model_centers, part_evidence};
pub use estimator::{
    Alternative, Candidate, ExtentSource, NoPose, PartCorrespondence, PnpMethod, PoseEstimate,
    PoseEstimator, PoseOptions,
};
pub use filters::{DEFAULT_SMALL_PART, PartFilters};
pub use observed::{PartState, PartVerdict};
pub use ranking::Ranking;
pub use reasons::{Reason, ReasonCode, reasons};
