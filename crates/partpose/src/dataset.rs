//! Frames with their cameras and labelled vehicles, read lazily from the layouts that others publish.
//!
//! [`Dataset::open`] recognises a folder; [`Dataset::read`] gives the frames of a sequence together with what was wrong
//! with it. A bad row costs its frame, never the sequence: what stops a sequence is a file that cannot be read at all.
//! [`split`] divides frames into training, validation and test as the paper did, [`folds`] divides tracks, and
//! [`check`] looks for what a reader alone cannot see.

pub mod check;
pub mod folds;
pub mod split;

mod calibration;
mod collect;
mod colors;
mod frame;
mod kitti;
mod problem;
mod table;
mod vkitti;
mod vkitti1;
mod vkitti2;

use std::fmt;
use std::path::{Path, PathBuf};

pub use calibration::KittiCalibration;
pub use colors::SegmentColor;
pub use frame::{Frame, SequenceFrames, SequenceId, VehicleLabel};
pub use problem::{Fault, MAX_PROBLEMS, Problem};
pub use vkitti1::CAMERA_FILE;

use crate::files::FileError;

/// Why a data set could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file is wrong where nothing can be read around it.
    #[error(transparent)]
    Problem(#[from] Problem),
    /// The folder has no layout that is known.
    #[error("`{path}` is not a data set that is known")]
    UnknownLayout {
        /// The folder.
        path: PathBuf,
        /// What was looked for.
        source: LookedFor,
    },
    /// The data set lacks a sequence that was asked for.
    #[error("`{root}` has no world `{world}`, variation `{variation}`; it has {present}")]
    NoSequence {
        /// The data set's folder.
        root: PathBuf,
        /// What was asked for.
        world: String,
        /// What was asked for.
        variation: String,
        /// What is there.
        present: String,
    },
    /// The sequence has no such camera.
    #[error("`{path}` has no row of camera {camera}")]
    NoCamera {
        /// The file with the poses of the cameras.
        path: PathBuf,
        /// The camera that was asked for.
        camera: u32,
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

/// The signs by which a layout is recognised.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error(
    "there is none of `vkitti_1.3.1_motgt/<world>_<variation>.txt` (Virtual KITTI 1.3.1), \
     `Scene<nn>/<variation>/bbox.txt` (Virtual KITTI 2.0.3), `training/label_2` (KITTI object)"
)]
pub struct LookedFor;

/// Which publisher's layout a folder has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub enum Layout {
    /// Virtual KITTI 1.3.1.
    VirtualKitti1,
    /// Virtual KITTI 2.0.3.
    VirtualKitti2,
    /// KITTI object detection.
    Kitti,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::VirtualKitti1 => "Virtual KITTI 1.3.1",
            Self::VirtualKitti2 => "Virtual KITTI 2.0.3",
            Self::Kitti => "KITTI object",
        })
    }
}

/// How a data set is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DatasetOptions {
    /// Which of Virtual KITTI 2.0.3's cameras: 0, that of release 1, or 1, 0.53 m to its right.
    pub camera: u32,
}

/// A folder in a known layout; nothing is read before it is asked for.
#[derive(Clone, Debug)]
pub struct Dataset {
    root: PathBuf,
    layout: Layout,
    sequences: Vec<SequenceId>,
    options: DatasetOptions,
}

impl Dataset {
    /// Recognises the layout of a folder and lists its sequences.
    pub fn open(root: &Path) -> Result<Self, DatasetError> {
        Self::open_with(root, DatasetOptions::default())
    }

    /// The same with options.
    pub fn open_with(root: &Path, options: DatasetOptions) -> Result<Self, DatasetError> {
        // A folder that cannot be listed is said to be so, rather than to have no known layout.
        std::fs::read_dir(root).map_err(|source| FileError::read(root, source))?;
        let known = |layout, sequences: Vec<SequenceId>| {
            (!sequences.is_empty()).then(|| Self { root: root.into(), layout, sequences, options })
        };
        known(Layout::VirtualKitti1, vkitti1::sequences(root)?)
            .or(known(Layout::VirtualKitti2, vkitti2::sequences(root)?))
            .or(known(Layout::Kitti, kitti::sequences(root)))
            .ok_or_else(|| DatasetError::UnknownLayout { path: root.into(), source: LookedFor })
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

    /// The sequences of some worlds in some variations; an empty list stands for all there are.
    ///
    /// `1`, `0001` and `Scene01` are the same world.
    pub fn select(
        &self,
        worlds: &[String],
        variations: &[String],
    ) -> Result<Vec<SequenceId>, DatasetError> {
        let worlds: Vec<String> = worlds
            .iter()
            .map(|world| normalized_world(world).unwrap_or_else(|| world.clone()))
            .collect();
        let chosen = |id: &SequenceId, world: Option<&String>, variation: Option<&String>| {
            world.is_none_or(|world| *world == id.world)
                && variation.is_none_or(|variation| *variation == id.variation)
        };
        let or_any = |list: &[String]| -> Vec<Option<String>> {
            if list.is_empty() { vec![None] } else { list.iter().cloned().map(Some).collect() }
        };
        let mut found = Vec::new();
        for world in or_any(&worlds) {
            for variation in or_any(variations) {
                let before = found.len();
                let matching = |id: &&SequenceId| chosen(id, world.as_ref(), variation.as_ref());
                found.extend(self.sequences.iter().filter(matching).cloned());
                if found.len() == before {
                    let any = || "(any)".to_owned();
                    let id = SequenceId {
                        world: world.clone().unwrap_or_else(any),
                        variation: variation.clone().unwrap_or_else(any),
                    };
                    return Err(self.no_sequence(&id));
                }
            }
        }
        found.sort();
        found.dedup();
        Ok(found)
    }

    /// The frames of a sequence in the order of their index, with labels; images are named, not read.
    ///
    /// Frames with faults are left out without a word: call [`Self::read`] where somebody should hear of them.
    pub fn frames(&self, sequence: &SequenceId) -> Result<Vec<Frame>, DatasetError> {
        Ok(self.read(sequence)?.frames)
    }

    /// The frames of a sequence and what was wrong with it.
    pub fn read(&self, sequence: &SequenceId) -> Result<SequenceFrames, DatasetError> {
        if !self.sequences.contains(sequence) {
            return Err(self.no_sequence(sequence));
        }
        match self.layout {
            Layout::VirtualKitti1 => vkitti1::read(&self.root, sequence),
            Layout::VirtualKitti2 => vkitti2::read(&self.root, sequence, self.options.camera),
            Layout::Kitti => kitti::read(&self.root, sequence),
        }
    }

    /// The file that labels the vehicles of a frame, for messages.
    pub fn label_file(&self, sequence: &SequenceId, index: u32) -> PathBuf {
        match self.layout {
            Layout::VirtualKitti1 => vkitti1::label_file(&self.root, sequence),
            Layout::VirtualKitti2 => vkitti2::label_file(&self.root, sequence),
            Layout::Kitti => kitti::label_file(&self.root, index),
        }
    }

    /// What the colours of a sequence's segmentation images stand for; empty for KITTI, which has none.
    pub fn segment_colors(&self, id: &SequenceId) -> Result<Vec<SegmentColor>, DatasetError> {
        match self.layout {
            Layout::VirtualKitti1 => vkitti1::colors(&self.root, id),
            Layout::VirtualKitti2 => vkitti2::colors(&self.root, id),
            Layout::Kitti => Ok(Vec::new()),
        }
    }

    fn no_sequence(&self, id: &SequenceId) -> DatasetError {
        let present: Vec<String> = self.sequences.iter().map(ToString::to_string).collect();
        DatasetError::NoSequence {
            root: self.root.clone(),
            world: id.world.clone(),
            variation: id.variation.clone(),
            present: present.join(", "),
        }
    }
}

/// The name of a numbered world as release 1 writes it; `None` for a name without a number.
fn normalized_world(name: &str) -> Option<String> {
    let number: u32 = name.strip_prefix("Scene").unwrap_or(name).parse().ok()?;
    Some(format!("{number:04}"))
}
