//! The tables of a sequence, kept in one small file a frame until the sequence is whole.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use partpose::dataset::SequenceId;
use partpose::files::{self, FileError};

use super::rows::{self, FrameRows};

/// Folder of the fragments; hidden, so that nobody takes it for an archive.
const FOLDER: &str = ".unfinished";

/// Whether all of a sequence has been written; its labels come last.
pub(super) fn is_complete(out: &Path, id: &SequenceId) -> bool {
    table(out, "motgt", id).is_file()
}

/// Whether a frame has been written.
pub(super) fn exists(out: &Path, id: &SequenceId, index: u32) -> bool {
    path(out, id, index).is_file()
}

/// Keeps the rows of a frame whose images have been written.
pub(super) fn keep(
    out: &Path,
    id: &SequenceId,
    index: u32,
    rows: &FrameRows,
) -> Result<(), FileError> {
    let mut text = String::new();
    let _ = writeln!(text, "{}", rows.extrinsics);
    for vehicle in &rows.vehicles {
        let _ = writeln!(text, "{vehicle}");
    }
    files::write(&path(out, id, index), text.as_bytes())
}

/// Writes the tables of a sequence from the rows of its frames.
pub(super) fn assemble(out: &Path, id: &SequenceId, frames: &[u32]) -> Result<(), FileError> {
    let mut extrinsics = rows::EXTRINSICS_HEADER.to_owned();
    let mut motgt = rows::MOTGT_HEADER.to_owned();
    let mut tracks = std::collections::BTreeMap::new();
    for index in frames {
        let text = files::read_text(&path(out, id, *index))?;
        let mut lines = text.lines();
        if let Some(line) = lines.next() {
            extrinsics += line;
            extrinsics.push('\n');
        }
        for line in lines {
            motgt += line;
            motgt.push('\n');
            tracks.extend(rows::track_of(line));
        }
    }
    files::write(&table(out, "extrinsicsgt", id), extrinsics.as_bytes())?;
    let encoding = out
        .join("vkitti_1.3.1_scenegt")
        .join(format!("{}_{}_scenegt_rgb_encoding.txt", id.world, id.variation));
    files::write(&encoding, rows::encoding(&tracks).as_bytes())?;
    files::write(&table(out, "motgt", id), motgt.as_bytes())?;
    remove(&folder(out, id))
}

/// Removes the folder of the fragments when nothing is unfinished; other parts of a data set that are at it may have
/// theirs there.
pub(super) fn clean(out: &Path, shares: bool) -> Result<(), FileError> {
    if shares {
        // It is removed by the last.
        let _ = fs::remove_dir(out.join(FOLDER));
        return Ok(());
    }
    remove(&out.join(FOLDER))
}

fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_dir_all(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(FileError::write(path, error))
        }
        _ => Ok(()),
    }
}

fn table(out: &Path, kind: &str, id: &SequenceId) -> PathBuf {
    out.join(format!("vkitti_1.3.1_{kind}")).join(format!("{}_{}.txt", id.world, id.variation))
}

fn folder(out: &Path, id: &SequenceId) -> PathBuf {
    out.join(FOLDER).join(format!("{}_{}", id.world, id.variation))
}

fn path(out: &Path, id: &SequenceId, index: u32) -> PathBuf {
    folder(out, id).join(format!("{index:05}.txt"))
}
