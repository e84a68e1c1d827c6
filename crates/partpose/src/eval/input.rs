//! What can be wrong with the files that the public evaluators read, and what their readers share.
//!
//! A score over the part of a set that could be read is not comparable with any other, so the first fault ends the
//! reading: nothing is left out in silence.

use std::fs;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;

use crate::files::{self, FileError};

/// Most characters of a field that a message repeats.
const SHOWN: usize = 40;

/// Why labels or results could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A line of a text file.
    #[error("`{path}` line {line}: {reason}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// Not JSON, or JSON of another shape.
    #[error("`{path}` is not the JSON that is expected here")]
    Json {
        /// The file.
        path: PathBuf,
        /// What the parser says, with its place.
        source: serde_json::Error,
    },
    /// An entry of a file.
    #[error("`{path}`: {entry} {reason}")]
    Entry {
        /// The file.
        path: PathBuf,
        /// Which one.
        entry: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Something that no line or entry is to blame for.
    #[error("`{path}` {reason}")]
    Content {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

impl InputError {
    pub(crate) fn line(path: &Path, line: usize, reason: impl Into<String>) -> Self {
        Self::Line { path: path.to_owned(), line, reason: reason.into() }
    }

    pub(crate) fn entry(path: &Path, entry: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Entry { path: path.to_owned(), entry: entry.into(), reason: reason.into() }
    }

    pub(crate) fn content(path: &Path, reason: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), reason: reason.into() }
    }
}

/// Reads a file as JSON of a known shape.
pub(crate) fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, InputError> {
    let bytes = files::read(path)?;
    serde_json::from_slice(&bytes)
        .map_err(|source| InputError::Json { path: path.to_owned(), source })
}

/// The files of a folder with this ending, sorted by name.
pub fn files_with_ending(folder: &Path, ending: &str) -> Result<Vec<PathBuf>, InputError> {
    let failed = |source| FileError::read(folder, source);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending)) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// A finite number up to `limit` in magnitude.
pub(crate) fn number(text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.abs() <= limit => Ok(value),
        Ok(_) => Err(format!("`{}` is not a number of sensible size", shown(text))),
        Err(_) => Err(format!("`{}` is not a number", shown(text))),
    }
}

/// A text shortened and without control characters.
pub(crate) fn shown(text: &str) -> String {
    let short: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if text.chars().nth(SHOWN).is_some() { short + "..." } else { short }
}
