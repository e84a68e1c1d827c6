//! Blocks: the frames whose annotations are written together, and from which a run resumes.
//!
//! A block's file is written last, after the images of all its frames; where it is there and whole, and the images
//! have the sizes it tells, the block is done. Its first line says what it holds; then come the images' records and
//! the annotations', one a line, as they go into the sequence's file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::files;

use super::LabelError;

/// Frames of a block.
pub(super) const BLOCK: usize = 16;

/// The first line of a block's file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct BlockHeader {
    /// The frames with labels.
    pub(super) frames: Vec<BlockFrame>,
    /// Indices of frames that could not be labelled.
    pub(super) skipped: Vec<u32>,
    /// Number of annotations.
    pub(super) annotations: usize,
}

/// A frame with labels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct BlockFrame {
    /// Its index.
    pub(super) index: u32,
    /// Sizes of its part and its instance image, bytes.
    pub(super) bytes: [u64; 2],
    /// Labelled vehicles that are seen.
    pub(super) vehicles: usize,
    /// Labelled vehicles that are hidden altogether.
    pub(super) hidden: usize,
    /// Vehicles whose model stands in for one that the zoo lacks.
    pub(super) stand_ins: usize,
    /// Vehicles whose name the zoo has a model of, drawn by another.
    pub(super) named_otherwise: usize,
    /// Whether a segmentation was used.
    pub(super) segmented: bool,
}

/// A block in memory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) header: BlockHeader,
    /// One record a frame.
    pub(super) images: Vec<String>,
    /// In the order of frames, vehicles and parts.
    pub(super) annotations: Vec<String>,
}

impl Block {
    /// Writes the file.
    pub(super) fn write(&self, path: &Path) -> Result<(), LabelError> {
        let header = serde_json::to_string(&self.header).map_err(|error| LabelError::Damaged {
            path: path.to_owned(),
            reason: error.to_string(),
        })?;
        let lines = std::iter::once(&header).chain(&self.images).chain(&self.annotations);
        let text: String = lines.flat_map(|line| [line.as_str(), "\n"]).collect();
        Ok(files::write(path, text.as_bytes())?)
    }

    /// Reads the file; an error where it is not as [`Self::write`] leaves it.
    pub(super) fn read(path: &Path) -> Result<Self, LabelError> {
        let text = files::read_text(path)?;
        let damaged =
            |reason: &str| LabelError::Damaged { path: path.to_owned(), reason: reason.to_owned() };
        let mut lines = text.lines();
        let header: BlockHeader = lines
            .next()
            .and_then(|line| serde_json::from_str(line).ok())
            .ok_or_else(|| damaged("its first line does not say what it holds"))?;
        let mut take = |count: usize| lines.by_ref().take(count).map(str::to_owned).collect();
        let images: Vec<String> = take(header.frames.len());
        let annotations: Vec<String> = take(header.annotations);
        let whole = images.len() == header.frames.len()
            && annotations.len() == header.annotations
            && lines.next().is_none()
            && text.ends_with('\n');
        if !whole {
            return Err(damaged("its lines are not those that the first one tells of"));
        }
        Ok(Self { header, images, annotations })
    }
}

/// The header of a finished block of these frames; `None` where anything of it is missing or other.
///
/// A block with skipped frames is never finished: what was wrong may have been mended.
pub(super) fn finished(
    path: &Path,
    frames: &[crate::dataset::Frame],
    store: &super::LabelStore,
) -> Option<BlockHeader> {
    let header = Block::read(path).ok()?.header;
    let expected = frames.iter().map(|frame| frame.index);
    if !header.skipped.is_empty() || !header.frames.iter().map(|f| f.index).eq(expected) {
        return None;
    }
    let size = |path: String| Some(std::fs::metadata(store.path(&path)).ok()?.len());
    let whole = header.frames.iter().zip(frames).all(|(written, frame)| {
        size(super::store::parts_file(frame)) == Some(written.bytes[0])
            && size(super::store::instances_file(frame)) == Some(written.bytes[1])
    });
    whole.then_some(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_blocks_are_told_from_whole_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("00000.jsonl");
        let frame = BlockFrame {
            index: 3,
            bytes: [70, 80],
            vehicles: 1,
            hidden: 0,
            stand_ins: 0,
            named_otherwise: 0,
            segmented: false,
        };
        let header = BlockHeader { frames: vec![frame], skipped: vec![4], annotations: 2 };
        let lines = |lines: &[&str]| lines.iter().map(|line| (*line).to_owned()).collect();
        let block =
            Block { header, images: lines(&["{}"]), annotations: lines(&["{\"a\":1}", "{}"]) };
        block.write(&path).unwrap();
        assert_eq!(Block::read(&path).unwrap(), block);
        let text = files::read_text(&path).unwrap();
        for cut in [0, 10, text.len() - 4, text.len() - 1] {
            files::write(&path, &text.as_bytes()[..cut]).unwrap();
            assert!(matches!(Block::read(&path), Err(LabelError::Damaged { .. })), "{cut}");
        }
    }
}
