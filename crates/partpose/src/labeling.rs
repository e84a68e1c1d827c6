//! Part labels for boxed data sets (paper, § III-A): from 3D boxes and annotated models to part and instance masks.
//!
//! For each box a model of the zoo is chosen by category and size, scaled to the box per axis, placed and drawn; nearer
//! vehicles hide farther ones. What else may stand before a vehicle only a segmentation of the image can tell: where
//! the data set has one, pixels that it gives to something else are cut out, and where it tells vehicles apart it
//! decides whose pixel it is. Without one, other occluders are unknown, and the output says so.
//!
//! [`label_frame`] labels one frame; [`label_dataset`] writes whole data sets, in shards and resumably; [`Agreement`]
//! compares labels with reference masks.

mod agreement;
mod annotation;
mod assign;
mod block;
mod coco_file;
mod compare;
mod frame;
mod layers;
mod manifest;
mod options;
mod run;
mod segmentation;
mod sequence;
mod store;

pub use agreement::{Agreement, ClassAgreement, Tally};
pub use annotation::VehicleMasks;
pub use assign::{Assignment, StandIn, Zoos, assign};
pub use compare::{Compared, comparison_picture};
pub use frame::{FrameLabels, LabeledVehicle, instance_ids, label_frame};
pub use layers::Layer;
pub use options::{Categories, DontCare, LabelOptions, ModelChoice, Shard, ShardError};
pub use run::{Event, LabelJob, LabelReport, SequenceReport, Skipped, label_dataset};
pub use segmentation::Segmentation;
pub use store::LabelStore;

use std::path::PathBuf;

use crate::dataset::DatasetError;
use crate::files::{FileError, LabelImageError};

/// Why a frame or a data set could not be labelled.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabelError {
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The data set could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A label image could not be read.
    #[error(transparent)]
    Image(#[from] LabelImageError),
    /// A segmentation image of another size than the camera's.
    #[error("`{path}` has {found:?} pixels, but the camera has {expected:?}")]
    Size {
        /// The image.
        path: PathBuf,
        /// Its width and height.
        found: [u32; 2],
        /// The camera's.
        expected: [u32; 2],
    },
    /// A segmentation image with a colour that its table lacks.
    #[error("`{path}`: the colour {color:?} at ({x}, {y}) is not in the data set's table")]
    Color {
        /// The image.
        path: PathBuf,
        /// Red, green, blue.
        color: [u8; 3],
        /// Column.
        x: u32,
        /// Row.
        y: u32,
    },
    /// A frame without the segmentation that others of its sequence have.
    #[error("the frame has no class segmentation, but others of its sequence have one")]
    NoSegmentation,
    /// A frame whose vehicles would fill the memory.
    #[error(
        "{vehicles} vehicles in an image of {size:?} pixels are too many or too large to be drawn"
    )]
    TooCrowded {
        /// How many there are.
        vehicles: usize,
        /// Width and height of the image in pixels.
        size: [u32; 2],
    },
    /// A sequence whose name cannot be that of folders.
    #[error("the sequence `{name}` cannot name folders")]
    Name {
        /// The name.
        name: String,
    },
    /// A folder that holds something else.
    #[error("the folder `{path}` is not empty")]
    Occupied {
        /// The folder.
        path: PathBuf,
    },
    /// A folder with the labels of a run with other settings.
    #[error("`{path}` holds the labels of another run: {}", differences.join("; "))]
    OtherRun {
        /// The folder.
        path: PathBuf,
        /// Which settings differ, and how.
        differences: Vec<String>,
    },
    /// A file of an earlier run that is not as this version writes it.
    #[error("`{path}` is damaged: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}
