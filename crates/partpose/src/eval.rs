//! Scores with the paper's definitions, and with those of the public benchmarks.

pub mod a3dp;
pub mod bop;
pub mod boxes;
pub mod coco;
pub mod kernel_size;
pub mod kitti;
pub mod masks;
pub mod matching;
pub mod model_names;
pub mod pnp;
pub mod tracks;
pub mod uncertainty;

mod input;
mod mask_bias;
mod part_states;
mod poses;
pub mod ranking;
mod run;
mod scene;
mod table;
mod tables;

pub use input::{InputError, files_with_ending};
pub use mask_bias::measure_mask_bias;
pub use part_states::part_table;
pub use poses::{PoseDeviation, PoseScores, Scored, pose_deviation, summarize};
pub use run::{
    Configuration, EvaluationOptions, FrameOutcome, Progress, TruthExtent, VehicleOutcome,
    calibrate, evaluate_detections, evaluate_frames,
};
pub use scene::{SceneProtocol, measure_camera_height};
pub use table::Table;
pub use tables::{Stratum, breakdown, paper_configurations, paper_tables, score_table};
