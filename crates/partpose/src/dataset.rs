//! Frames with their cameras and labelled vehicles, read lazily from the layouts that others publish.

mod frame;
mod vkitti1;

use std::path::{Path, PathBuf};

pub use frame::{Frame, SequenceId, VehicleLabel};

use crate::files::FileError;

/// Why a data set could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A line does not have the columns it should have.
    #[error("`{path}` line {line}: {reason}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// The folder has no layout that is known.
    #[error("`{path}` is not a data set that is known")]
    UnknownLayout {
        /// The folder.
        path: PathBuf,
    },
    /// The data set lacks a sequence that was asked for.
    #[error("`{root}` has no world `{world}`, variation `{variation}`")]
    NoSequence {
        /// The data set's folder.
        root: PathBuf,
        /// What was asked for.
        world: String,
        /// What was asked for.
        variation: String,
    },
    /// An image does not fit its frame.
    #[error("`{path}`: {reason}")]
    Image {
        /// The image.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// Which publisher's layout a folder has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Virtual KITTI 1.3.1.
    VirtualKitti1,
}

/// A folder in a known layout; nothing is read before it is asked for.
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
    layout: Layout,
    sequences: Vec<SequenceId>,
}

impl Dataset {
    /// Recognises the layout of a folder and lists its sequences.
    pub fn open(root: &Path) -> Result<Self, DatasetError> {
        let sequences = vkitti1::sequences(root)?;
        if sequences.is_empty() {
            return Err(DatasetError::UnknownLayout { path: root.to_owned() });
        }
        Ok(Self { root: root.to_owned(), layout: Layout::VirtualKitti1, sequences })
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The layout that was recognised.
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// All sequences, sorted.
    pub fn sequences(&self) -> &[SequenceId] {
        &self.sequences
    }

    /// The frames of a sequence in the order of their index, with labels; images are named, not read.
    pub fn frames(&self, sequence: &SequenceId) -> Result<Vec<Frame>, DatasetError> {
        if !self.sequences.contains(sequence) {
            return Err(DatasetError::NoSequence {
                root: self.root.clone(),
                world: sequence.world.clone(),
                variation: sequence.variation.clone(),
            });
        }
        match self.layout {
            Layout::VirtualKitti1 => vkitti1::frames(&self.root, sequence),
        }
    }
}
