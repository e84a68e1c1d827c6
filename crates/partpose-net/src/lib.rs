//! The multi-class Mask R-CNN.

pub mod anchors;
pub mod augment;
pub mod balance;
pub mod boxes;
pub mod checkpoint;
pub mod config;
pub mod curves;
pub mod detector;
pub mod fpn;
pub mod heads;
pub mod import;
pub mod input;
pub mod layers;
pub mod loader;
pub mod loss;
pub mod mask_rcnn;
pub mod onnx;
pub mod ops;
pub mod optimizer;
pub mod resnet;
pub mod rpn;
pub mod sample;
pub mod sampling;
pub mod schedule;
pub mod target;
pub mod train;
pub mod training;
pub mod validation;
pub mod vehicle_head;
pub mod weights;

mod second_stage;
#[cfg(test)]
mod torchvision;

pub use config::NetConfig;
pub use detector::Detector;
pub use mask_rcnn::{LikelyExtents, Losses, MaskRcnn, PreparedNet, RawDetection};
pub use target::Target;
