//! The multi-class Mask R-CNN.

pub mod config;
pub mod detector;
pub mod input;
pub mod mask_rcnn;
pub mod ops;
pub mod target;

pub use config::NetConfig;
pub use detector::{Detector, VehicleDetection};
pub use mask_rcnn::{Losses, MaskRcnn, RawDetection};
pub use target::Target;
