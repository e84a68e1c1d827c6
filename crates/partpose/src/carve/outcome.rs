//! What carving tells while it runs, gives back, and leaves out.

use crate::dataset::{DatasetError, SequenceId};
use crate::vehicle::{ModelError, VehicleModel};

/// What is being done.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Part masks are read: so many of so many.
    Reading {
        /// Masks read.
        done: usize,
        /// Masks to read.
        total: usize,
    },
    /// A model is carved.
    Carving {
        /// Its name.
        model: String,
        /// What is done with it.
        step: &'static str,
    },
}

/// Why nothing could be carved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CarveError {
    /// No row names a mesh.
    #[error("no vehicle of the chosen frames has a model name")]
    NoModelNames,
    /// A model was asked for that no row shows.
    #[error("no vehicle shows the model `{name}`; there are {known:?}")]
    UnknownModel {
        /// What was asked for.
        name: String,
        /// The names that occur.
        known: Vec<String>,
    },
    /// No frame has a part mask.
    #[error("none of the {frames} chosen frames has a part mask")]
    NoMasks {
        /// How many frames there are.
        frames: usize,
    },
}

/// Why one model was left out, or one frame.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Skipped {
    /// Too few vehicles show it.
    #[error(
        "model `{name}`: {tracks} tracks with {views} usable views, but {needed} tracks are needed"
    )]
    TooFewViews {
        /// The model.
        name: String,
        /// Tracks that show it.
        tracks: usize,
        /// Views of them.
        views: usize,
        /// Tracks that are needed.
        needed: usize,
    },
    /// The views leave nothing over.
    #[error("model `{name}`: the {views} views have no volume in common")]
    Empty {
        /// The model.
        name: String,
        /// Views of it.
        views: usize,
    },
    /// The carved mesh is no model.
    #[error("model `{name}`")]
    Model {
        /// The model.
        name: String,
        /// What is wrong with it.
        source: ModelError,
    },
    /// A mask could not be read.
    #[error("frame {sequence} {index} is left out")]
    Frame {
        /// Its sequence.
        sequence: SequenceId,
        /// Its index.
        index: u32,
        /// What is wrong with it.
        source: Box<DatasetError>,
    },
}

/// A carved model and how it came about.
#[derive(Clone, Debug)]
pub struct CarvedModel {
    /// The model; its extent is the median over the tracks used.
    pub model: VehicleModel,
    /// Tracks that were used.
    pub tracks: usize,
    /// Views that were used.
    pub views: usize,
    /// Mean absolute distance of the outlines before each round of the fit, pixels.
    pub outline_error: Vec<f64>,
}

/// What came of it.
#[derive(Debug, Default)]
pub struct Carved {
    /// The models, in the order asked for.
    pub models: Vec<CarvedModel>,
    /// What was left out.
    pub skipped: Vec<Skipped>,
}
