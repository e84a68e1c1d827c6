//! What other programs write for us and read from us; described in `docs/formats.md`.

pub mod coco;
mod detections;
mod kitti;
mod results;

pub use detections::{DetectionFile, DetectionFileError, read_detections, write_detections};
pub use kitti::{KittiRow, kitti_text};
pub use results::{ImageResult, ResultSettings, VehicleResult, image_result};
