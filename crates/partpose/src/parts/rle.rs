//! Run-length encoding of masks as COCO has it.
//!
//! Pixels are counted column by column, top to bottom, in runs that alternate between outside and inside and start
//! outside. COCO writes the counts as text (Lin et al.: *Microsoft COCO*, ECCV 2014; `maskApi.c` of its tools): from
//! the fourth on as the difference from the one two before, five bits a character, least first, with a bit that says
//! whether more follow, from `0` on.

use serde::{Deserialize, Serialize};

/// Most pixels of a mask that is read from text.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Why a text is no mask.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RleError {
    /// A character outside `0` to `o`.
    #[error("character {at} is not one of a run-length encoding")]
    Character {
        /// Its place in bytes, from 0.
        at: usize,
    },
    /// The text ends within a number.
    #[error("the text ends within a number")]
    Unfinished,
    /// A run that is negative or longer than any mask.
    #[error("run {run} has {length} pixels")]
    Run {
        /// Which run, from 0.
        run: usize,
        /// Its length.
        length: i64,
    },
    /// The runs do not fill the mask.
    #[error("the runs hold {pixels} pixels, but the mask has {width} x {height}")]
    Total {
        /// Their sum.
        pixels: u64,
        /// Width of the mask.
        width: u32,
        /// Height of the mask.
        height: u32,
    },
    /// A mask of more than [`MAX_PIXELS`].
    #[error("a mask of {width} x {height} pixels is larger than any that is read")]
    TooLarge {
        /// Width of the mask.
        width: u32,
        /// Height of the mask.
        height: u32,
    },
}

/// A mask as runs.
///
/// Invariant, which is why the fields are private: the runs fill the mask, and none but the first is empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rle {
    size: [u32; 2],
    counts: Vec<u32>,
}

/// A mask as COCO's JSON has it: height before width, runs as text.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CocoRle {
    /// Height and width in pixels.
    pub size: [u32; 2],
    /// The runs.
    pub counts: String,
}

impl Rle {
    /// Encodes `width * height` pixels that are given row by row.
    pub fn encode(size: [u32; 2], inside: &[bool]) -> Self {
        let [width, height] = size.map(|side| side as usize);
        let mut builder = RleBuilder::new(size);
        for x in 0..width {
            for y in 0..height {
                if inside.get(y * width + x).copied().unwrap_or(false) {
                    builder.push(x as u32, y as u32, 1);
                }
            }
        }
        builder.finish()
    }

    /// The pixels row by row.
    pub fn decode(&self) -> Vec<bool> {
        let [width, height] = self.size.map(|side| side as usize);
        let mut inside = vec![false; width * height];
        for (start, length) in self.runs() {
            for at in start..start + length {
                inside[(at as usize % height) * width + at as usize / height] = true;
            }
        }
        inside
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Lengths of the runs, the first of them outside.
    pub fn counts(&self) -> &[u32] {
        &self.counts
    }

    /// Pixels inside.
    pub fn area(&self) -> u64 {
        self.counts.iter().skip(1).step_by(2).map(|count| u64::from(*count)).sum()
    }

    /// `x, y, width, height` of the smallest box, in whole pixels; zeros for an empty mask.
    pub fn bounds(&self) -> [u32; 4] {
        let height = self.size[1];
        let (mut low, mut high) = ([u32::MAX; 2], [0; 2]);
        for (start, length) in self.runs() {
            let last = start + length - 1;
            let columns = [start / height, last / height];
            // A run that goes on in the next column touches the lower and the upper border.
            let rows = if columns[0] == columns[1] {
                [start % height, last % height]
            } else {
                [0, height - 1]
            };
            low = [low[0].min(columns[0]), low[1].min(rows[0])];
            high = [high[0].max(columns[1]), high[1].max(rows[1])];
        }
        if low[0] == u32::MAX {
            return [0; 4];
        }
        [low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1]
    }

    /// The pixels that are inside one mask or the other; `None` where sizes differ.
    pub fn union(&self, other: &Self) -> Option<Self> {
        self.combine(other, |a, b| a || b)
    }

    /// The pixels that are inside both masks; `None` where sizes differ.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        self.combine(other, |a, b| a && b)
    }

    fn combine(&self, other: &Self, keep: fn(bool, bool) -> bool) -> Option<Self> {
        if self.size != other.size {
            return None;
        }
        let mut merged = RleBuilder::new(self.size);
        let (mut next, mut left) = ([0, 0], [0, 0]);
        let mut inside = [true, true];
        let mut at = 0;
        let total = self.size[0] * self.size[1];
        while at < total {
            for (n, counts) in [&self.counts, &other.counts].into_iter().enumerate() {
                while left[n] == 0 {
                    left[n] = *counts.get(next[n])?;
                    next[n] += 1;
                    inside[n] = !inside[n];
                }
            }
            let step = left[0].min(left[1]);
            if keep(inside[0], inside[1]) {
                merged.push_at(at, step);
            }
            left = left.map(|left| left - step);
            at += step;
        }
        Some(merged.finish())
    }

    /// As COCO's JSON has it.
    pub fn to_coco(&self) -> CocoRle {
        let mut text = String::new();
        for (n, count) in self.counts.iter().enumerate() {
            let before = if n > 2 { i64::from(self.counts[n - 2]) } else { 0 };
            let mut value = i64::from(*count) - before;
            loop {
                let bits = (value & 0x1f) as u8;
                value >>= 5;
                let more = if bits & 0x10 == 0 { value != 0 } else { value != -1 };
                text.push(char::from(48 + bits + if more { 0x20 } else { 0 }));
                if !more {
                    break;
                }
            }
        }
        CocoRle { size: [self.size[1], self.size[0]], counts: text }
    }

    /// Reads a mask from COCO's JSON; anything that is no mask of up to [`MAX_PIXELS`] is an error.
    pub fn from_coco(coco: &CocoRle) -> Result<Self, RleError> {
        let [height, width] = coco.size;
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(RleError::TooLarge { width, height });
        }
        let numbers = numbers(&coco.counts)?;
        let mut counts: Vec<u32> = Vec::with_capacity(numbers.len());
        let mut pixels = 0;
        for (run, number) in numbers.into_iter().enumerate() {
            let before = if run > 2 { i64::from(counts[run - 2]) } else { 0 };
            let length = number + before;
            if !(0..=MAX_PIXELS as i64).contains(&length) {
                return Err(RleError::Run { run, length });
            }
            counts.push(length as u32);
            pixels += length as u64;
            if pixels > MAX_PIXELS {
                return Err(RleError::Total { pixels, width, height });
            }
        }
        if pixels != u64::from(width) * u64::from(height) {
            return Err(RleError::Total { pixels, width, height });
        }
        Ok(Self::from_counts([width, height], &counts))
    }

    /// Merges what empty runs separate; the counts must fill the mask.
    fn from_counts(size: [u32; 2], counts: &[u32]) -> Self {
        let mut builder = RleBuilder::new(size);
        let mut at = 0;
        for (run, count) in counts.iter().enumerate() {
            if run % 2 == 1 {
                builder.push_at(at, *count);
            }
            at += count;
        }
        builder.finish()
    }

    /// Start and length of the runs inside, in the order of columns.
    fn runs(&self) -> impl Iterator<Item = (u32, u32)> {
        let mut at = 0;
        self.counts.iter().enumerate().filter_map(move |(n, count)| {
            let start = at;
            at += count;
            (n % 2 == 1).then_some((start, *count))
        })
    }
}

/// The numbers of a text, before they are added to those two before.
fn numbers(text: &str) -> Result<Vec<i64>, RleError> {
    // Thirty bits are more than any run needs.
    const LONGEST: u32 = 6;
    let mut numbers = Vec::new();
    let (mut value, mut digits) = (0, 0);
    for (at, byte) in text.bytes().enumerate() {
        let bits = i64::from(byte) - 48;
        if !(0..64).contains(&bits) || digits > LONGEST {
            return Err(RleError::Character { at });
        }
        value |= (bits & 0x1f) << (5 * digits);
        digits += 1;
        if bits & 0x20 == 0 {
            if bits & 0x10 != 0 {
                value |= -1 << (5 * digits);
            }
            numbers.push(value);
            (value, digits) = (0, 0);
        }
    }
    if digits == 0 { Ok(numbers) } else { Err(RleError::Unfinished) }
}

/// A mask that is put together from runs in the order of columns, without ever holding its pixels.
#[derive(Clone, Debug)]
pub struct RleBuilder {
    size: [u32; 2],
    counts: Vec<u32>,
    /// Where the last run inside ends, in pixels by columns.
    end: u32,
}

impl RleBuilder {
    /// An empty mask of up to [`MAX_PIXELS`] pixels; a larger size is cut to one without pixels.
    pub fn new(size: [u32; 2]) -> Self {
        let fits = u64::from(size[0]) * u64::from(size[1]) <= MAX_PIXELS;
        Self { size: if fits { size } else { [0, 0] }, counts: Vec::new(), end: 0 }
    }

    /// Adds `length` pixels of column `x` from row `y` down.
    ///
    /// Runs come in the order of columns, then rows; what lies outside the mask or before the last run is left out.
    pub fn push(&mut self, x: u32, y: u32, length: u32) {
        let [width, height] = self.size;
        if x < width && y < height {
            self.push_at(x * height + y, length.min(height - y));
        }
    }

    fn push_at(&mut self, start: u32, length: u32) {
        if length == 0 || start < self.end {
            return;
        }
        match self.counts.last_mut() {
            Some(last) if start == self.end => *last += length,
            _ => self.counts.extend([start - self.end, length]),
        }
        self.end = start + length;
    }

    /// The mask.
    pub fn finish(mut self) -> Rle {
        let rest = self.size[0] * self.size[1] - self.end;
        if rest > 0 || self.counts.is_empty() {
            self.counts.push(rest);
        }
        Rle { size: self.size, counts: self.counts }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Rle {
        let inside: Vec<bool> =
            rows.iter().flat_map(|row| row.bytes().map(|b| b == b'#')).collect();
        Rle::encode([rows[0].len() as u32, rows.len() as u32], &inside)
    }

    fn read(size: [u32; 2], counts: &str) -> Result<Rle, RleError> {
        Rle::from_coco(&CocoRle { size, counts: counts.to_owned() })
    }

    #[test]
    fn columns_are_counted_top_to_bottom_and_start_outside() {
        let rle = mask(&["#..", "##.", ".#."]);
        assert_eq!(rle.counts(), [0, 2, 2, 2, 3]);
        assert_eq!((rle.area(), rle.bounds()), (4, [0, 0, 2, 3]));
        assert_eq!(mask(&["...", "..."]).counts(), [6]);
        assert_eq!(mask(&["...", "..."]).bounds(), [0; 4]);
        assert_eq!(mask(&["##", "##"]).counts(), [0, 4]);
    }

    #[test]
    fn runs_over_the_end_of_a_column_are_one() {
        let rle = mask(&[".#", "#.", "#."]);
        assert_eq!(rle.counts(), [1, 3, 2]);
        assert_eq!(rle.bounds(), [0, 0, 2, 3]);
    }

    #[test]
    fn union_and_intersection_are_those_of_the_pixels() {
        let (a, b) = (mask(&["##.", ".#.", "..."]), mask(&[".##", ".#.", "#.."]));
        assert_eq!(a.union(&b), Some(mask(&["###", ".#.", "#.."])));
        assert_eq!(a.intersection(&b), Some(mask(&[".#.", ".#.", "..."])));
        assert_eq!(a.union(&mask(&["."])), None);
    }

    #[test]
    fn what_is_no_mask_is_an_error() {
        assert_eq!(read([2, 2], "4"), Ok(mask(&["..", ".."])));
        assert_eq!(read([2, 2], "4!"), Err(RleError::Character { at: 1 }));
        assert_eq!(read([2, 2], "T"), Err(RleError::Unfinished));
        let total = |pixels| Err(RleError::Total { pixels, width: 2, height: 2 });
        assert_eq!(read([2, 2], "5"), total(5));
        assert_eq!(read([2, 2], ""), total(0));
        // -16.
        assert_eq!(read([2, 2], "@"), Err(RleError::Run { run: 0, length: -16 }));
        assert!(matches!(read([2, 2], "oooooooooooooooo0"), Err(RleError::Character { .. })));
        assert!(matches!(read([1 << 20, 1 << 20], "0"), Err(RleError::TooLarge { .. })));
    }

    #[test]
    fn empty_runs_vanish_when_read() {
        assert_eq!(read([2, 2], "112").unwrap().counts(), [1, 1, 2]);
        // 1 outside, 1 inside, none outside, 2 more inside: the fourth count is one more than the second.
        assert_eq!(read([2, 2], "1101").unwrap().counts(), [1, 3]);
    }
}
