//! Colour tables of the segmentation images.

use std::path::Path;

use crate::files;

use super::DatasetError;
use super::problem::{Fault, Problems, shown};
use super::table;

/// What a colour of a segmentation image stands for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SegmentColor {
    /// `Car`, `Road`, ...
    pub category: String,
    /// The track, where the colour is that of one vehicle.
    pub track: Option<u32>,
    /// Red, green, blue.
    pub rgb: [u8; 3],
}

/// A table `Category[:tid] r g b`; the first bad row is the error, since a table with a hole would mislabel pixels.
pub(super) fn read(path: &Path) -> Result<Vec<SegmentColor>, DatasetError> {
    const COLUMNS: &[&str] = &["Category", "r", "g", "b"];
    let text = files::read_text(path)?;
    let mut problems = Problems::default();
    // The header's first word differs between copies.
    let text = match text.split_once('\n') {
        Some((first, rest)) if !first.bytes().any(|byte| byte.is_ascii_digit()) => {
            format!("Category r g b\n{rest}")
        }
        _ => text,
    };
    let mut colors = Vec::new();
    for row in table::rows(path, &text, COLUMNS, &mut problems)? {
        let (category, track) = match row.text(0).split_once(':') {
            Some((category, track)) => (category, Some(track)),
            None => (row.text(0), None),
        };
        let track = track.map(|track| {
            track.parse().map_err(|_| {
                row.problem(Fault::NotANumber { column: "Category", text: shown(track) })
            })
        });
        let mut rgb = [0; 3];
        for (i, channel) in rgb.iter_mut().enumerate() {
            *channel = row.integer(1 + i, 255)? as u8;
        }
        let (category, track) = (category.to_owned(), track.transpose()?);
        colors.push(SegmentColor { category, track, rgb });
    }
    match problems.list.into_iter().next() {
        Some(problem) => Err(problem.into()),
        None => Ok(colors),
    }
}
