//! Scores with the paper's definitions.

pub mod pnp;

mod mask_bias;
mod poses;
mod run;
mod table;
mod tables;

pub use mask_bias::measure_mask_bias;
pub use poses::{PoseDeviation, PoseScores, Scored, pose_deviation, summarize};
pub use run::{
    Configuration, EvaluationOptions, FrameOutcome, Progress, TruthExtent, VehicleOutcome,
    calibrate, evaluate_frames,
};
pub use table::Table;
pub use tables::{Stratum, breakdown, paper_configurations, paper_tables, score_table};
