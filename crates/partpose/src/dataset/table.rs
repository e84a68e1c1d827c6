//! Tables of fields between spaces, with a header line, as the Virtual KITTI releases use them.

use std::path::Path;

use super::problem::{Fault, Problem, Problems, shown};

/// Largest magnitude of any number in these files: metres, pixels, radians.
const ABSURD: f64 = 1e6;
/// Largest index of a frame; file names have five digits in Virtual KITTI and six in KITTI.
pub(super) const MAX_FRAME: u32 = 999_999;

/// A line of a table.
#[derive(Debug)]
pub(super) struct Row<'a> {
    path: &'a Path,
    columns: &'static [&'static str],
    fields: Vec<&'a str>,
    /// The frame that its faults belong to.
    frame: Option<u32>,
    /// Counted from 1.
    pub(super) line: usize,
}

/// The rows of a table that has `columns`, bad ones turned into problems.
///
/// The header is compared with the columns: a file whose columns are swapped often says so. A table without header is
/// read from its first line.
pub(super) fn rows<'a>(
    path: &'a Path,
    text: &'a str,
    columns: &'static [&'static str],
    problems: &mut Problems,
) -> Result<Vec<Row<'a>>, Problem> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).peekable();
    let Some((_, first)) = lines.peek() else {
        return Err(Problem::of_file(path, None, Fault::Empty));
    };
    let header: Vec<&str> = first.split_ascii_whitespace().collect();
    if header[0] == columns[0] {
        for (i, (expected, found)) in columns.iter().zip(&header).enumerate() {
            // `0 0 0 1` at the end of the extrinsics' header varies between copies; such columns have no name here.
            if expected != found && !expected.is_empty() {
                let fault = Fault::Header { number: i + 1, expected, found: shown(found) };
                problems.push(Problem { path: path.into(), line: Some(1), frame: None, fault });
            }
        }
        lines.next();
    }
    let mut rows = Vec::new();
    for (i, line) in lines {
        // A fault belongs to the frame in the first column if that can be read.
        let frame = line.split_ascii_whitespace().next().and_then(|field| field.parse().ok());
        let frame = frame.filter(|frame| *frame <= MAX_FRAME && columns[0] == "frame");
        rows.extend(problems.keep(Row::new(path, columns, (i + 1, line), frame)));
    }
    Ok(rows)
}

impl<'a> Row<'a> {
    /// Splits a line, given with its number, into fields.
    pub(super) fn new(
        path: &'a Path,
        columns: &'static [&'static str],
        (line, text): (usize, &'a str),
        frame: Option<u32>,
    ) -> Result<Self, Problem> {
        let fields: Vec<&str> = text.split_ascii_whitespace().collect();
        let row = Self { path, columns, fields, frame, line };
        if row.fields.len() == columns.len() {
            return Ok(row);
        }
        let fault = Fault::Columns { given: row.fields.len(), needed: columns.len() };
        Err(row.problem(fault))
    }

    /// A fault in this row.
    pub(super) fn problem(&self, fault: Fault) -> Problem {
        // KITTI's rows and those about whole tracks have no column for it.
        let fault = match self.frame {
            None if self.columns[0] == "frame" => Fault::UnknownFrame { fault: Box::new(fault) },
            _ => fault,
        };
        Problem { path: self.path.to_owned(), line: Some(self.line), frame: self.frame, fault }
    }

    /// A field as it stands.
    pub(super) fn text(&self, column: usize) -> &str {
        self.fields[column]
    }

    /// A finite number of sensible size.
    pub(super) fn number(&self, column: usize) -> Result<f64, Problem> {
        let name = self.columns[column];
        let value: f64 = match self.fields[column].parse() {
            Ok(value) if f64::is_finite(value) => value,
            _ => {
                let text = shown(self.fields[column]);
                return Err(self.problem(Fault::NotANumber { column: name, text }));
            }
        };
        self.in_range(column, value, -ABSURD, ABSURD)
    }

    /// A number within limits.
    pub(super) fn number_in(&self, column: usize, low: f64, high: f64) -> Result<f64, Problem> {
        self.in_range(column, self.number(column)?, low, high)
    }

    /// A whole number up to `max`.
    pub(super) fn integer(&self, column: usize, max: u32) -> Result<u32, Problem> {
        match self.fields[column].parse() {
            Ok(value) if value <= max => Ok(value),
            _ => {
                // What is no number at all is said so; the rest is a number that is negative, broken or too large.
                let value = self.number(column)?;
                let name = self.columns[column];
                let high = f64::from(max);
                Err(self.problem(Fault::OutOfRange { column: name, value, low: 0.0, high }))
            }
        }
    }

    /// A word out of a short list.
    pub(super) fn word(
        &self,
        column: usize,
        allowed: &[&'static str],
        expected: &'static str,
    ) -> Result<&'static str, Problem> {
        let text = self.fields[column];
        allowed.iter().find(|word| **word == text).copied().ok_or_else(|| {
            let column = self.columns[column];
            self.problem(Fault::Unexpected { column, text: shown(text), expected })
        })
    }

    /// Checks that the first of two columns holds the smaller value.
    pub(super) fn ordered(&self, low: usize, high: usize) -> Result<(f64, f64), Problem> {
        let (low_value, high_value) = (self.number(low)?, self.number(high)?);
        if low_value <= high_value {
            return Ok((low_value, high_value));
        }
        let (low, high) = (self.columns[low], self.columns[high]);
        Err(self.problem(Fault::SwappedEdges { low, low_value, high, high_value }))
    }

    fn in_range(&self, column: usize, value: f64, low: f64, high: f64) -> Result<f64, Problem> {
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        let column = self.columns[column];
        Err(self.problem(Fault::OutOfRange { column, value, low, high }))
    }
}
