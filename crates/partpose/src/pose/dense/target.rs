//! A detection as the fit sees it: class probabilities cell by cell, and how much each cell counts.

use crate::detection::Detection;
use crate::geometry::{Camera, Rect};
use crate::parts::CHANNELS;

use super::bias::{MaskBias, SampleGrid};

/// Channels of a cell rounded up, so that a cell is a whole number of vectors.
pub(super) const LANES: usize = 32;
/// Cells a side that energies are expressed in, whatever the kernel's own.
pub(super) const REFERENCE_CELLS: f64 = 28.0;

/// Probabilities and weights on m x m cells of a box.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// m.
    pub(super) cells: usize,
    /// Per cell, row by row: the probability of each label, background first.
    pub(super) probabilities: Vec<[f32; LANES]>,
    /// Per cell: how much it counts, 0 where nothing is known.
    pub(super) weights: Vec<f32>,
    /// Per cell: the sum of the squared probabilities.
    pub(super) squares: Vec<f32>,
    /// The box.
    pub(super) bounds: Rect,
}

impl Target {
    pub(super) fn new(detection: &Detection, camera: &Camera) -> Self {
        let m = detection.probabilities.size();
        let mut probabilities = vec![[0.0; LANES]; m * m];
        for channel in 0..CHANNELS {
            let plane = detection.probabilities.channel(channel);
            for (cell, value) in probabilities.iter_mut().zip(plane) {
                cell[channel] = *value;
            }
        }
        let inside = shares_inside(&detection.bounds, camera, m);
        let unit = (REFERENCE_CELLS / m as f64).powi(2) as f32;
        let weights = (0..m * m).map(|cell| {
            let unknown = detection.unknown.as_ref().and_then(|u| u.get(cell)).copied();
            let known = (1.0 - unknown.unwrap_or(0.0)).min(inside[cell]).clamp(0.0, 1.0);
            // The probabilities of a cell that is known in part speak of that part alone.
            if known >= LEAST_KNOWN { known * known * unit } else { 0.0 }
        });
        let weights = weights.collect();
        Self::with(m, probabilities, weights, detection.bounds)
    }

    fn with(
        cells: usize,
        probabilities: Vec<[f32; LANES]>,
        weights: Vec<f32>,
        bounds: Rect,
    ) -> Self {
        let square = |cell: &[f32; LANES]| cell.iter().map(|value| value * value).sum();
        let squares = probabilities.iter().map(square).collect();
        Self { cells, probabilities, weights, squares, bounds }
    }

    /// The same on fewer cells, each the weighted mean of those it covers.
    pub(super) fn pooled(&self, cells: usize) -> Self {
        let m = self.cells;
        let shares = |coarse: usize| -> Vec<(usize, f32)> {
            let (low, high) = (coarse * m, (coarse + 1) * m);
            (low / cells..high.div_ceil(cells))
                .map(|fine| {
                    let overlap = high.min((fine + 1) * cells) - low.max(fine * cells);
                    (fine, overlap as f32 / cells as f32)
                })
                .collect()
        };
        let lines: Vec<Vec<(usize, f32)>> = (0..cells).map(shares).collect();
        let mut probabilities = Vec::with_capacity(cells * cells);
        let mut weights = Vec::with_capacity(cells * cells);
        for rows in &lines {
            for columns in &lines {
                let (mut sum, mut weight) = ([0.0f32; LANES], 0.0f32);
                for (y, a) in rows {
                    for (x, b) in columns {
                        let at = y * m + x;
                        let share = a * b * self.weights[at];
                        weight += share;
                        for (sum, value) in sum.iter_mut().zip(&self.probabilities[at]) {
                            *sum += share * value;
                        }
                    }
                }
                if weight > 0.0 {
                    for value in &mut sum {
                        *value /= weight;
                    }
                } else {
                    sum[0] = 1.0;
                }
                probabilities.push(sum);
                weights.push(weight);
            }
        }
        Self::with(cells, probabilities, weights, self.bounds)
    }

    /// Weighted cells that show the vehicle, in reference cells.
    pub(super) fn foreground(&self) -> f64 {
        let cells = self.weights.iter().zip(&self.probabilities);
        cells.map(|(weight, cell)| f64::from(weight * (1.0 - cell[0]).max(0.0))).sum()
    }

    /// Whether a cell lies at the border of the box where that is cut by the image.
    pub(super) fn is_at_border(&self, camera: &Camera, x: usize, y: usize) -> bool {
        let (image, bounds, last) = (camera.image_rect(), &self.bounds, self.cells - 1);
        (x == 0 && bounds.x_min <= image.x_min + 1.0)
            || (y == 0 && bounds.y_min <= image.y_min + 1.0)
            || (x == last && bounds.x_max >= image.x_max - 1.0)
            || (y == last && bounds.y_max >= image.y_max - 1.0)
    }

    /// The box on `samples` samples a side.
    pub(super) fn grid(
        &self,
        camera: &Camera,
        samples: usize,
        bias: Option<MaskBias>,
    ) -> SampleGrid {
        let camera = camera.crop(&self.bounds, [samples as u32; 2]);
        let [width, height] = [self.bounds.width(), self.bounds.height()];
        let per_pixel = [samples as f64 / width, samples as f64 / height];
        SampleGrid { camera, per_pixel, bias }
    }
}

/// Cells of which less is known say nothing.
const LEAST_KNOWN: f32 = 0.25;

/// The share of each cell that lies inside the image.
fn shares_inside(bounds: &Rect, camera: &Camera, m: usize) -> Vec<f32> {
    let image = camera.image_rect();
    let line = |low: f64, length: f64, min: f64, max: f64| -> Vec<f64> {
        let side = length / m as f64;
        let share = |i: usize| {
            let a = low + i as f64 * side;
            ((a + side).min(max) - a.max(min)).max(0.0) / side
        };
        (0..m).map(share).collect()
    };
    let columns = line(bounds.x_min, bounds.width(), image.x_min, image.x_max);
    let rows = line(bounds.y_min, bounds.height(), image.y_min, image.y_max);
    rows.iter().flat_map(|y| columns.iter().map(move |x| (x * y) as f32)).collect()
}
