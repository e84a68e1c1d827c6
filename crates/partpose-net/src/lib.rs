//! The multi-class Mask R-CNN.

pub mod anchors;
pub mod boxes;
pub mod config;
pub mod detector;
pub mod fpn;
pub mod heads;
pub mod input;
pub mod layers;
pub mod loss;
pub mod mask_rcnn;
pub mod ops;
pub mod resnet;
pub mod rpn;
pub mod sampling;
pub mod target;

mod second_stage;
#[cfg(test)]
mod torchvision;

pub use config::NetConfig;
pub use detector::{Detector, VehicleDetection};
pub use mask_rcnn::{Losses, MaskRcnn, RawDetection};
pub use target::Target;
