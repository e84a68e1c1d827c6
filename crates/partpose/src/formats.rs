//! What other programs write for us and read from us; described in `docs/formats.md`.

pub mod bop;
pub mod coco;
mod coco_results;
mod detections;
mod import;
mod kitti;
pub mod nuscenes;
mod openlabel;
mod read_results;
mod results;
mod tensor_file;
mod tracks;
mod upright;

pub use coco_results::{CocoDetection, CocoIds, coco_results, read_coco_ids};
pub use detections::{DetectionFile, DetectionFileError, read_detections, write_detections};
pub use import::{ImportOptions, import_bop, import_kitti, import_nuscenes, import_openlabel};
pub use kitti::{KittiRow, kitti_text};
pub use openlabel::{openlabel, openlabel_cuboids};
pub use read_results::{
    PosedImage, PosedTrack, PosedVehicle, ResultFileError, parse_result, read_result, result_json,
};
pub use results::{ImageResult, ResultSettings, VehicleResult, image_result};
pub use tensor_file::safetensors_bytes;
pub use tracks::{kitti_tracking_text, observations, with_tracks};
