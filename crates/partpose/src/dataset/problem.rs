//! What is wrong with a place in a data set, as data: many frames are read, and none stops the others.

use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::ser::{Serialize, SerializeStruct, Serializer};

/// Most problems of one sequence that are kept; a file that is wrong throughout is not worth a list of all its lines.
pub const MAX_PROBLEMS: usize = 1000;

/// What can be wrong with a row or an image.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// A row is cut off or has too many fields.
    #[error("{given} columns, but {needed} are needed")]
    Columns {
        /// Fields of the row.
        given: usize,
        /// Fields it should have.
        needed: usize,
    },
    /// The header names another column than the one that is read there.
    #[error("column {number} is headed `{found}`, but `{expected}` is expected there")]
    Header {
        /// Counted from 1.
        number: usize,
        /// What the layout has there.
        expected: &'static str,
        /// What the file has there.
        found: String,
    },
    /// A row that cannot be read, not even its frame, which therefore is kept without what the row says.
    #[error("{fault}; the frame of this row is unknown, so the row is missing there")]
    UnknownFrame {
        /// What is wrong with the row.
        fault: Box<Fault>,
    },
    /// More vehicles than instance ids.
    #[error("the frame has more than the {limit} vehicles that can be told apart")]
    TooManyVehicles {
        /// How many are allowed.
        limit: usize,
    },
    /// A file without a single line.
    #[error("the file is empty")]
    Empty,
    /// Text, NaN or an infinite value where a number should be.
    #[error("column `{column}` is `{text}`, not a finite number")]
    NotANumber {
        /// Name of the column.
        column: &'static str,
        /// What stands there, shortened.
        text: String,
    },
    /// A number that the quantity cannot have.
    #[error("column `{column}` is {}, outside {low} to {high}", brief(*value))]
    OutOfRange {
        /// Name of the column.
        column: &'static str,
        /// What stands there.
        value: f64,
        /// Least sensible value.
        low: f64,
        /// Greatest sensible value.
        high: f64,
    },
    /// A word that the column does not know.
    #[error("column `{column}` is `{text}`, not one of {expected}")]
    Unexpected {
        /// Name of the column.
        column: &'static str,
        /// What stands there, shortened.
        text: String,
        /// What may stand there.
        expected: &'static str,
    },
    /// Left and right or top and bottom are exchanged, or the columns have another order.
    #[error("column `{low}` is {low_value}, beyond `{high}`, which is {high_value}")]
    SwappedEdges {
        /// Name of the column that should hold the smaller value.
        low: &'static str,
        /// Its value.
        low_value: f64,
        /// Name of the column that should hold the larger value.
        high: &'static str,
        /// Its value.
        high_value: f64,
    },
    /// A 2D box that reaches out of the image.
    #[error("the box {bounds:?} (l, t, r, b) does not lie in the image of {} x {} pixels", size[0], size[1])]
    OutsideImage {
        /// Left, top, right, bottom as in the file, pixels.
        bounds: [f64; 4],
        /// Width and height of the image, pixels.
        size: [u32; 2],
    },
    /// A 3D box that the camera cannot see.
    #[error("the cuboid lies behind the camera: its bottom centre has z = {z} m")]
    BehindCamera {
        /// Depth of the bottom-face centre, metres.
        z: f64,
    },
    /// A track that a frame lists twice.
    #[error("track {track} is in this frame already, on line {first_line}")]
    DuplicateTrack {
        /// The track.
        track: u32,
        /// Where it was first.
        first_line: usize,
    },
    /// A frame with two cameras.
    #[error("the frame has a row already, on line {first_line}")]
    DuplicateFrame {
        /// Where it was first.
        first_line: usize,
    },
    /// A matrix that should rotate does not.
    #[error("the matrix is not a rotation: it misses by {deviation}")]
    NotARotation {
        /// Largest entry of `R Rᵀ - I`, or 2 for a reflection.
        deviation: f64,
    },
    /// A row that needs a row of another file.
    #[error("`{file}` has no row for this frame{}", track.map(|track| format!(" and track {track}")).unwrap_or_default())]
    NoPartner {
        /// The other file.
        file: &'static str,
        /// The track, where the row is that of a vehicle.
        track: Option<u32>,
    },
    /// A file that should lie beside another.
    #[error("the file is missing")]
    Missing,
    /// A file that cannot be read; the reason.
    #[error("{reason}")]
    Unreadable {
        /// What the reader says.
        reason: String,
    },
    /// A named matrix that a calibration lacks.
    #[error("there is no row `{name}`")]
    NoMatrix {
        /// Name of the row.
        name: &'static str,
    },
    /// A projection that no pinhole camera has.
    #[error("`{name}` is not the projection of a pinhole camera with a focal length")]
    NotAProjection {
        /// Name of the row.
        name: &'static str,
    },
    /// Size of the image unknown because the image is absent; not a reason to skip the frame.
    #[error("the image is missing, so its size is taken to be {} x {}", assumed[0], assumed[1])]
    SizeUnknown {
        /// Width and height that are assumed, pixels.
        assumed: [u32; 2],
    },
    /// An image of another size than its camera.
    #[error("the image has {} x {} pixels, but the camera {} x {}", found[0], found[1], expected[0], expected[1])]
    ImageSize {
        /// Width and height of the image, pixels.
        found: [u32; 2],
        /// Those of the camera.
        expected: [u32; 2],
    },
    /// Rows that were read but contradict each other or their image, found by a check.
    #[error("{finding}")]
    Contradiction {
        /// What was found.
        finding: String,
    },
}

impl Fault {
    /// A file that cannot be read, with all that the error and its causes say.
    pub(super) fn unreadable(error: &dyn std::error::Error) -> Self {
        let mut reason = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            let text = error.to_string();
            // Some errors write their cause behind their own words.
            if !reason.ends_with(&text) {
                reason = format!("{reason}: {text}");
            }
            cause = error.source();
        }
        Self::Unreadable { reason }
    }
}

/// A fault and its place.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub struct Problem {
    /// The file.
    pub path: PathBuf,
    /// Counted from 1; `None` for a whole file.
    pub line: Option<usize>,
    /// The frame it belongs to, where that is known.
    pub frame: Option<u32>,
    /// What is wrong.
    pub fault: Fault,
}

impl Problem {
    /// A problem with a file as a whole.
    pub fn of_file(path: &Path, frame: Option<u32>, fault: Fault) -> Self {
        Self { path: path.to_owned(), line: None, frame, fault }
    }

    /// Whether the frame is left out because of it.
    pub fn skips_frame(&self) -> bool {
        let kept = matches!(
            self.fault,
            Fault::Header { .. }
                | Fault::SizeUnknown { .. }
                | Fault::ImageSize { .. }
                | Fault::Contradiction { .. }
        );
        self.frame.is_some() && !kept
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}`", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, " line {line}")?;
        }
        write!(f, ": {}", self.fault)
    }
}

impl Serialize for Problem {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut fields = serializer.serialize_struct("Problem", 5)?;
        fields.serialize_field("path", &self.path.display().to_string())?;
        fields.serialize_field("line", &self.line)?;
        fields.serialize_field("frame", &self.frame)?;
        fields.serialize_field("message", &self.fault.to_string())?;
        fields.serialize_field("skips_frame", &self.skips_frame())?;
        fields.end()
    }
}

/// The problems of a sequence while it is read.
#[derive(Debug, Default)]
pub(super) struct Problems {
    /// The first [`MAX_PROBLEMS`].
    pub(super) list: Vec<Problem>,
    /// How many more there were.
    pub(super) omitted: usize,
    /// Frames that are left out.
    pub(super) bad_frames: BTreeSet<u32>,
}

impl Problems {
    pub(super) fn push(&mut self, problem: Problem) {
        if let Some(frame) = problem.frame.filter(|_| problem.skips_frame()) {
            self.bad_frames.insert(frame);
        }
        if self.list.len() < MAX_PROBLEMS {
            self.list.push(problem);
        } else {
            self.omitted += 1;
        }
    }

    /// The value of a result, or nothing and one problem more.
    pub(super) fn keep<T>(&mut self, result: Result<T, Problem>) -> Option<T> {
        result.map_err(|problem| self.push(problem)).ok()
    }
}

/// A number without the hundreds of zeros that an absurd one would have.
fn brief(value: f64) -> String {
    const LARGE: f64 = 1e10;
    if value.abs() < LARGE { value.to_string() } else { format!("{value:e}") }
}

/// Text from a file, short and without control characters, fit for a message.
pub(super) fn shown(text: &str) -> String {
    const LONGEST: usize = 40;
    let mut shown: String = text.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push_str("...");
    }
    shown
}
