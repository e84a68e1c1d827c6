//! Where labels lie in their folder.
//!
//! ```text
//! label.json                                    settings of the run
//! parts/<world>/<variation>/%05d.png            parts, 8-bit indices with the author's colours
//! instances/<world>/<variation>/%05d.png        vehicles, 16-bit grey
//! coco/<world>_<variation>.json                 annotations of a sequence
//! coco/blocks/<world>/<variation>/%05d.jsonl    the same for every 16 frames: what a run resumes from
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use crate::dataset::{Frame, SequenceId};
use crate::files;
use crate::parts::PartClass;

use super::{FrameLabels, LabelError};

/// A folder of labels.
#[derive(Clone, Debug)]
pub struct LabelStore {
    root: PathBuf,
}

impl LabelStore {
    /// A folder that need not exist yet.
    pub fn new(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// A path relative to the folder.
    pub fn path(&self, relative: &str) -> PathBuf {
        self.root.join(relative)
    }

    /// The settings.
    pub fn manifest(&self) -> PathBuf {
        self.path("label.json")
    }

    /// The annotations of a sequence.
    pub fn coco(&self, sequence: &SequenceId) -> PathBuf {
        let SequenceId { world, variation } = sequence;
        let separator = if variation.is_empty() { "" } else { "_" };
        self.path(&format!("coco/{world}{separator}{variation}.json"))
    }

    /// The annotations of a block of frames.
    pub(super) fn block(&self, sequence: &SequenceId, block: usize) -> PathBuf {
        self.path(&format!("coco/blocks/{}/{block:05}.jsonl", folders(sequence)))
    }

    /// Writes the images of a frame; returns their sizes in bytes.
    pub(super) fn write_images(
        &self,
        frame: &Frame,
        labels: &FrameLabels,
    ) -> Result<[u64; 2], LabelError> {
        let mut palette = [[0; 3]; PartClass::COUNT + 1];
        for class in PartClass::ALL {
            palette[usize::from(class.id())] = class.color();
        }
        let parts = files::encode_indexed_png(labels.size, &labels.parts, &palette);
        let instances = files::encode_gray16_png(labels.size, &labels.instances);
        files::write(&self.path(&parts_file(frame)), &parts)?;
        files::write(&self.path(&instances_file(frame)), &instances)?;
        Ok([parts.len() as u64, instances.len() as u64])
    }

    /// Removes what an earlier run wrote for a frame that cannot be labelled any more.
    pub(super) fn remove_images(&self, frame: &Frame) {
        for path in [parts_file(frame), instances_file(frame)] {
            // What is not there need not be removed; what cannot be removed is named by no annotation.
            let _ = fs::remove_file(self.path(&path));
        }
    }

    /// Removes the unfinished files that a killed run left in a sequence's folders; nobody else may be writing there.
    pub(super) fn clean(&self, sequence: &SequenceId) {
        let name = folders(sequence);
        let blocks = format!("coco/blocks/{name}");
        for folder in [format!("parts/{name}"), format!("instances/{name}"), blocks, "coco".into()]
        {
            let Ok(entries) = fs::read_dir(self.path(&folder)) else { continue };
            for entry in entries.flatten() {
                if entry.file_name().to_string_lossy().starts_with(".tmp") {
                    let _ = fs::remove_file(entry.path());
                }
            }
        }
    }
}

/// The part mask of a frame, relative to the folder.
pub(super) fn parts_file(frame: &Frame) -> String {
    format!("parts/{}/{:05}.png", folders(&frame.sequence), frame.index)
}

/// The instance mask of a frame, relative to the folder.
pub(super) fn instances_file(frame: &Frame) -> String {
    format!("instances/{}/{:05}.png", folders(&frame.sequence), frame.index)
}

/// World and variation as folders.
fn folders(sequence: &SequenceId) -> String {
    let SequenceId { world, variation } = sequence;
    if variation.is_empty() { world.clone() } else { format!("{world}/{variation}") }
}

/// Refuses sequences whose names would lead out of the folder: names come from a data set's files.
pub(super) fn check_name(sequence: &SequenceId) -> Result<(), LabelError> {
    let plain = |name: &str| {
        let fits = |c: char| !c.is_control() && !"/\\:".contains(c);
        name.len() <= 100 && !name.starts_with('.') && name.chars().all(fits)
    };
    let SequenceId { world, variation } = sequence;
    if plain(world) && plain(variation) && !world.is_empty() {
        return Ok(());
    }
    Err(LabelError::Name { name: sequence.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_out_of_the_folder_are_refused() {
        let id = |world: &str, variation: &str| SequenceId {
            world: world.to_owned(),
            variation: variation.to_owned(),
        };
        assert!(check_name(&id("0001", "15-deg-left")).is_ok());
        assert!(check_name(&id("training", "")).is_ok());
        for (world, variation) in
            [("..", "clone"), ("0001", ".."), ("a/b", "c"), ("", "x"), ("0001", "a\\b"), ("C:", "")]
        {
            assert!(check_name(&id(world, variation)).is_err(), "{world} {variation}");
        }
    }
}
