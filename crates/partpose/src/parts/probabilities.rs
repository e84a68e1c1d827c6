//! The m x m grid of part probabilities of one detection, and how it becomes labels at image resolution.
//!
//! The paper compares two ways (Table II): *nearest* takes the most probable class of each cell and repeats it;
//! *bilinear* interpolates the probabilities of all classes and takes the most probable one at each pixel. Cells are
//! areas: cell `i` of `m` covers the share `i/m .. (i+1)/m` of the box, and its value belongs to its centre (the
//! convention called `align_corners = false`).

use serde::{Deserialize, Serialize};

use crate::geometry::Rect;

use super::{BACKGROUND, CHANNELS, PartMask};

/// Channels rounded up to a multiple of the vector width, so that a cell is a whole number of vectors.
const LANES: usize = 32;

/// How a kernel is brought to the size of its box.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scaling {
    /// Most probable class of each cell, repeated.
    Nearest,
    /// Probabilities interpolated, then the most probable class of each pixel.
    Bilinear,
}

/// Why a grid of probabilities is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProbabilityError {
    /// As many values as 30 channels of m x m cells are needed.
    #[error("{given} values, but {needed} are needed for 30 channels of {size} x {size} cells")]
    Count {
        /// Cells a side.
        size: usize,
        /// Values needed.
        needed: usize,
        /// Values given.
        given: usize,
    },
    /// A value that no probability has.
    #[error("{value} in channel {channel}, row {row}, column {column} is not a probability")]
    Value {
        /// The value.
        value: f32,
        /// 0 background, 1 to 29 parts.
        channel: usize,
        /// From the top.
        row: usize,
        /// From the left.
        column: usize,
    },
}

/// Probabilities of background and the 29 parts on m x m cells.
///
/// Invariant: `30 * m * m` values in `[0, 1]`, m at least 1. They are meant to sum to 1 over the channels of a cell;
/// a detector that rounds is forgiven.
#[derive(Clone, Debug, PartialEq)]
pub struct PartProbabilities {
    size: usize,
    values: Vec<f32>,
}

impl PartProbabilities {
    /// Checks the invariant; `values` is `[30, size, size]`, background first, rows top to bottom.
    pub fn new(size: usize, values: Vec<f32>) -> Result<Self, ProbabilityError> {
        let cells = size * size;
        if size == 0 || values.len() != CHANNELS * cells {
            let needed = CHANNELS * cells;
            return Err(ProbabilityError::Count { size, needed, given: values.len() });
        }
        // A little slack for soft-max in half precision.
        if let Some(at) = values.iter().position(|value| !(-1e-3..=1.001).contains(value)) {
            let (channel, cell) = (at / cells, at % cells);
            let (row, column) = (cell / size, cell % size);
            return Err(ProbabilityError::Value { value: values[at], channel, row, column });
        }
        Ok(Self { size, values })
    }

    /// Cells a side: the paper's m.
    pub fn size(&self) -> usize {
        self.size
    }

    /// `[30, m, m]`, background first.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The m x m probabilities of one channel.
    pub fn channel(&self, channel: usize) -> &[f32] {
        let cells = self.size * self.size;
        &self.values[channel * cells..(channel + 1) * cells]
    }

    /// The same grid where the share `unknown` of each cell is counted as background, as the masks of the paper do.
    ///
    /// `unknown`: `[m, m]` in `[0, 1]`.
    #[must_use]
    pub fn with_unknown_as_background(&self, unknown: &[f32]) -> Self {
        let cells = self.size * self.size;
        let mut values = self.values.clone();
        for (channel, plane) in values.chunks_exact_mut(cells).enumerate() {
            for (value, share) in plane.iter_mut().zip(unknown) {
                *value = *value * (1.0 - share) + if channel == 0 { *share } else { 0.0 };
            }
        }
        Self { size: self.size, values }
    }

    /// The most probable label of each cell, `[m, m]`; of equals the lowest.
    pub fn labels(&self) -> Vec<u8> {
        let cells = self.size * self.size;
        let mut best = self.channel(0).to_vec();
        let mut labels = vec![BACKGROUND; cells];
        for channel in 1..CHANNELS {
            // Straight-line selects, so that the compiler makes vector code of them.
            for ((label, best), value) in
                labels.iter_mut().zip(&mut best).zip(self.channel(channel))
            {
                let better = *value > *best;
                *label = if better { channel as u8 } else { *label };
                *best = if better { *value } else { *best };
            }
        }
        labels
    }

    /// The part mask of the pixels of `bounds` that lie in an image of `size` pixels.
    pub fn upscale(&self, bounds: &Rect, size: [u32; 2], scaling: Scaling) -> PartMask {
        match scaling {
            Scaling::Nearest => upscale_labels(&self.labels(), self.size, bounds, size),
            Scaling::Bilinear => self.upscale_bilinear(bounds, size),
        }
    }

    fn upscale_bilinear(&self, bounds: &Rect, size: [u32; 2]) -> PartMask {
        let mut mask = empty_mask(bounds, size);
        let [width, height] = mask.size.map(|side| side as usize);
        if width == 0 || height == 0 {
            return mask;
        }
        let m = self.size;
        let cells = self.cells_of_lanes();
        let winners = self.labels();
        let columns = taps(bounds.x_min, bounds.width(), mask.origin[0], width, m);
        let rows = taps(bounds.y_min, bounds.height(), mask.origin[1], height, m);
        let mut blended = vec![[0.0f32; LANES]; m];
        for (tap, out) in rows.iter().zip(mask.labels.chunks_exact_mut(width)) {
            let (upper, lower) = (tap.first * m, tap.second * m);
            for (x, cell) in blended.iter_mut().enumerate() {
                *cell = lerp(&cells[upper + x], &cells[lower + x], tap.weight);
            }
            for (column, label) in columns.iter().zip(out) {
                // A class that wins in all four cells wins in every mean of them.
                let winner = winners[upper + column.first];
                *label = if winner == winners[upper + column.second]
                    && winner == winners[lower + column.first]
                    && winner == winners[lower + column.second]
                {
                    winner
                } else {
                    let (left, right) = (&blended[column.first], &blended[column.second]);
                    argmax(&lerp(left, right, column.weight))
                };
            }
        }
        mask
    }

    /// Transposed to cells of channels; the lanes beyond the channels can never win.
    fn cells_of_lanes(&self) -> Vec<[f32; LANES]> {
        let mut cells = vec![[-1.0f32; LANES]; self.size * self.size];
        for channel in 0..CHANNELS {
            for (cell, value) in cells.iter_mut().zip(self.channel(channel)) {
                cell[channel] = *value;
            }
        }
        cells
    }
}

/// The part mask of nearest scaling: `labels` is `[m, m]`.
pub fn upscale_labels(labels: &[u8], m: usize, bounds: &Rect, size: [u32; 2]) -> PartMask {
    let mut mask = empty_mask(bounds, size);
    let [width, height] = mask.size.map(|side| side as usize);
    if width == 0 || height == 0 {
        return mask;
    }
    let cell = |low: f64, length: f64, pixel: f64| {
        (((pixel - low) / length * m as f64).floor().max(0.0) as usize).min(m - 1)
    };
    let columns: Vec<usize> = (0..width)
        .map(|x| cell(bounds.x_min, bounds.width(), f64::from(mask.origin[0]) + x as f64))
        .collect();
    let mut last = None;
    for y in 0..height {
        let row = cell(bounds.y_min, bounds.height(), f64::from(mask.origin[1]) + y as f64);
        let start = y * width;
        if last == Some(row) {
            // Several image rows show the same row of cells.
            mask.labels.copy_within(start - width..start, start);
        } else {
            let source = &labels[row * m..(row + 1) * m];
            for (label, column) in mask.labels[start..start + width].iter_mut().zip(&columns) {
                *label = source[*column];
            }
            last = Some(row);
        }
    }
    mask
}

fn empty_mask(bounds: &Rect, size: [u32; 2]) -> PartMask {
    let (x0, y0, x1, y1) = bounds.pixels(size);
    PartMask::background([x0 as i32, y0 as i32], [x1 - x0, y1 - y0])
}

/// Where a pixel lies between two neighbouring cells.
struct Tap {
    first: usize,
    second: usize,
    weight: f32,
}

fn taps(low: f64, length: f64, origin: i32, count: usize, m: usize) -> Vec<Tap> {
    let scale = m as f64 / length;
    (0..count)
        .map(|i| {
            let at = (f64::from(origin) + i as f64 - low) * scale - 0.5;
            let at = at.clamp(0.0, (m - 1) as f64);
            let first = at as usize;
            Tap { first, second: (first + 1).min(m - 1), weight: (at - first as f64) as f32 }
        })
        .collect()
}

#[inline]
fn lerp(a: &[f32; LANES], b: &[f32; LANES], weight: f32) -> [f32; LANES] {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * weight)
}

#[inline]
fn argmax(values: &[f32; LANES]) -> u8 {
    let mut best = [f32::MIN; 8];
    for chunk in values.chunks_exact(8) {
        for (best, value) in best.iter_mut().zip(chunk) {
            *best = if *value > *best { *value } else { *best };
        }
    }
    let best = best.iter().fold(f32::MIN, |a, b| if *b > a { *b } else { a });
    values.iter().position(|value| *value >= best).unwrap_or(0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn random(size: usize, seed: u64) -> PartProbabilities {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let cells = size * size;
        let mut values: Vec<f32> = (0..CHANNELS * cells).map(|_| rng.random::<f32>()).collect();
        for cell in 0..cells {
            let sum: f32 = (0..CHANNELS).map(|channel| values[channel * cells + cell]).sum();
            (0..CHANNELS).for_each(|channel| values[channel * cells + cell] /= sum);
        }
        PartProbabilities::new(size, values).unwrap()
    }

    /// Bilinear interpolation written down as it is defined: one pixel and one class at a time.
    fn bilinear_by_definition(p: &PartProbabilities, bounds: &Rect, x: i32, y: i32) -> Vec<f64> {
        let m = p.size() as f64;
        let at = |pixel: i32, low: f64, length: f64| {
            ((f64::from(pixel) - low) / length * m - 0.5).clamp(0.0, m - 1.0)
        };
        let u = at(x, bounds.x_min, bounds.width());
        let v = at(y, bounds.y_min, bounds.height());
        let value = |channel: usize| {
            let cell = |i: f64, j: f64| {
                let (i, j) = (i.min(m - 1.0) as usize, j.min(m - 1.0) as usize);
                f64::from(p.channel(channel)[j * p.size() + i])
            };
            let (i, j) = (u.floor(), v.floor());
            let (a, b) = (u - i, v - j);
            (1.0 - b) * ((1.0 - a) * cell(i, j) + a * cell(i + 1.0, j))
                + b * ((1.0 - a) * cell(i, j + 1.0) + a * cell(i + 1.0, j + 1.0))
        };
        (0..CHANNELS).map(value).collect()
    }

    /// Single precision, and the weights rounded to it, may decide a tie either way.
    const TIE: f64 = 1e-5;

    proptest! {
        #[test]
        fn bilinear_scaling_is_its_definition(seed in 0..1000u64, m in 1..9usize, x in -5.0..20.0f64, w in 3.0..40.0f64) {
            let p = random(m, seed);
            let bounds = Rect::new(x, 2.5, x + w, 30.1);
            let mask = p.upscale(&bounds, [50, 40], Scaling::Bilinear);
            for (j, row) in mask.rows().enumerate() {
                for (i, label) in row.iter().enumerate() {
                    let (x, y) = (mask.origin[0] + i as i32, mask.origin[1] + j as i32);
                    let values = bilinear_by_definition(&p, &bounds, x, y);
                    let best = values.iter().copied().fold(0.0, f64::max);
                    prop_assert!(values[usize::from(*label)] > best - TIE);
                }
            }
        }

        #[test]
        fn nearest_scaling_repeats_cells(seed in 0..1000u64, m in 1..9usize, x in -5.0..20.0f64, w in 3.0..40.0f64) {
            let p = random(m, seed);
            let bounds = Rect::new(x, 2.5, x + w, 30.1);
            let mask = p.upscale(&bounds, [50, 40], Scaling::Nearest);
            let labels = p.labels();
            for (j, row) in mask.rows().enumerate() {
                for (i, label) in row.iter().enumerate() {
                    let u = (f64::from(mask.origin[0]) + i as f64 - x) / w * m as f64;
                    let v = (f64::from(mask.origin[1]) + j as f64 - 2.5) / (30.1 - 2.5) * m as f64;
                    prop_assert_eq!(*label, labels[v as usize * m + u as usize]);
                }
            }
        }
    }

    #[test]
    fn values_that_are_no_probabilities_are_named() {
        let mut values = vec![0.0; CHANNELS * 4];
        values[4 * 3 + 2] = f32::NAN;
        let error = PartProbabilities::new(2, values).unwrap_err();
        assert_eq!(error.to_string(), "NaN in channel 3, row 1, column 0 is not a probability");
        assert!(PartProbabilities::new(2, vec![0.0; 7]).is_err());
    }

    #[test]
    fn unknown_share_becomes_background() {
        let mut values = vec![0.0; CHANNELS];
        values[5] = 1.0;
        let p = PartProbabilities::new(1, values).unwrap().with_unknown_as_background(&[0.75]);
        assert_eq!((p.channel(0)[0], p.channel(5)[0]), (0.75, 0.25));
    }
}
