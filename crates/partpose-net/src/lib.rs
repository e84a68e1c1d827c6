//! The multi-class Mask R-CNN.

pub mod ops;
