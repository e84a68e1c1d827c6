//! Folders of KITTI label text, 15 columns a line, and of results, which have the score as a 16th.

use std::path::{Path, PathBuf};

use crate::eval::input::{InputError, files_with_ending, number};
use crate::files;
use crate::geometry::Rect;

use super::{KittiFrame, KittiObject};

/// Columns of a label; a result has one more.
const COLUMNS: usize = 15;
/// Largest magnitude of any number but the score: metres, pixels, radians.
const ABSURD: f64 = 1e6;

/// All images of a set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KittiFiles {
    /// In the order of their names.
    pub frames: Vec<KittiFrame>,
    /// Label files without a result file, which are left out if results may cover a part of the labels.
    pub without_results: usize,
    /// Result files without a label file, which are not read.
    pub without_labels: usize,
}

/// Reads the label files of a folder and, for each, the result file of the same name.
///
/// An image without detections has an empty file. A missing one is an error, unless `subset` says that only the
/// images with results are to be scored.
pub fn read_kitti(labels: &Path, results: &Path, subset: bool) -> Result<KittiFiles, InputError> {
    let label_files = files_with_ending(labels, "txt")?;
    let result_files = files_with_ending(results, "txt")?;
    if label_files.is_empty() {
        return Err(InputError::content(labels, "holds no label file `*.txt`"));
    }
    if result_files.is_empty() {
        return Err(InputError::content(results, "holds no result file `*.txt`"));
    }
    let mut found = KittiFiles::default();
    for path in &label_files {
        let result = results.join(path.file_name().unwrap_or_default());
        if !result.is_file() {
            if !subset {
                let reason = "is missing: an image without detections has an empty file of results";
                return Err(InputError::content(&result, reason));
            }
            found.without_results += 1;
            continue;
        }
        let read = |path: &PathBuf, scored| parse_kitti(path, &files::read_text(path)?, scored);
        let (labels, detections) = (read(path, false)?, read(&result, true)?);
        found.frames.push(KittiFrame { labels, detections });
    }
    if found.frames.is_empty() {
        return Err(InputError::content(results, "holds no file of the name of a label file"));
    }
    found.without_labels = result_files.len().saturating_sub(found.frames.len());
    Ok(found)
}

/// Reads the lines of one file; `scored` says that each has a score.
///
/// `path` is for messages only. Labels may carry a score, which is passed over.
pub fn parse_kitti(path: &Path, text: &str, scored: bool) -> Result<Vec<KittiObject>, InputError> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(i, line)| {
            object(line, scored).map_err(|reason| InputError::line(path, i + 1, reason))
        })
        .collect()
}

fn object(line: &str, scored: bool) -> Result<KittiObject, String> {
    let fields: Vec<&str> = line.split_ascii_whitespace().collect();
    if fields.len() != COLUMNS + 1 && (scored || fields.len() != COLUMNS) {
        let needed = if scored { COLUMNS + 1 } else { COLUMNS };
        return Err(format!("{} columns, but {needed} are needed", fields.len()));
    }
    let mut values = [0.0; COLUMNS];
    for (i, value) in values.iter_mut().enumerate().skip(1) {
        *value =
            number(fields[i], ABSURD).map_err(|reason| format!("column {} {reason}", i + 1))?;
    }
    let [_, truncation, occlusion, alpha, x1, y1, x2, y2, h, w, l, x, y, z, rotation_y] = values;
    let score = if scored {
        number(fields[COLUMNS], f64::MAX)
            .map_err(|reason| format!("column {} {reason}", COLUMNS + 1))?
    } else {
        0.0
    };
    Ok(KittiObject {
        category: fields[0].to_owned(),
        truncation,
        occlusion,
        alpha,
        bounds: Rect::new(x1, y1, x2, y2),
        size: [h, w, l],
        location: [x, y, z],
        rotation_y,
        score,
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const ROW: &str =
        "Car 0.00 1 1.60 343.67 175.63 444.64 271.99 1.60 1.65 3.62 -4.11 1.66 14.06 1.32";

    fn parse(text: &str, scored: bool) -> Result<Vec<KittiObject>, String> {
        parse_kitti(Path::new("a.txt"), text, scored).map_err(|error| error.to_string())
    }

    #[test]
    fn a_line_becomes_an_object() {
        let object = &parse(&format!("\n{ROW} 0.5\r\n"), true).unwrap()[0];
        assert_eq!((object.size, object.location), ([1.6, 1.65, 3.62], [-4.11, 1.66, 14.06]));
        assert_eq!((object.score, object.rotation_y, object.occlusion), (0.5, 1.32, 1.0));
        assert_eq!(parse(ROW, false).unwrap().len(), 1);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line_and_column() {
        let message = |text: &str, scored| parse(text, scored).unwrap_err();
        assert_eq!(message(ROW, true), "`a.txt` line 1: 15 columns, but 16 are needed");
        assert_eq!(message("\nCar 1", false), "`a.txt` line 2: 2 columns, but 15 are needed");
        let bad = ROW.replace("1.66", "nan");
        assert_eq!(
            message(&bad, false),
            "`a.txt` line 1: column 13 `nan` is not a number of sensible size"
        );
        let bad = format!("{ROW} high");
        assert_eq!(message(&bad, true), "`a.txt` line 1: column 16 `high` is not a number");
    }

    proptest! {
        #[test]
        fn damaged_text_is_read_or_refused(at in 0usize..90, byte in any::<u8>(), cut in 0usize..120) {
            let mut bytes = format!("{ROW} 0.5\n").into_bytes();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut);
            let _ = parse(&String::from_utf8_lossy(&bytes), true);
        }
    }
}
