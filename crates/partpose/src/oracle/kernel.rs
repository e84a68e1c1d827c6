//! Class fractions on the cells of a box: what a perfect network would answer.

use crate::detection::Detection;
use crate::geometry::Rect;
use crate::parts::{CHANNELS, PartMask, PartProbabilities};

/// Areas per channel and cell, before they are made probabilities.
pub(super) struct Kernel {
    /// Cells a side.
    pub size: usize,
    /// `[30, m, m]`: area of the cell that shows the channel, any unit.
    pub areas: Vec<f32>,
    /// `[m, m]`: share of the cell that nothing is known of.
    pub unknown: Vec<f32>,
}

impl Kernel {
    pub(super) fn empty(size: usize) -> Self {
        let cells = size * size;
        Self { size, areas: vec![0.0; CHANNELS * cells], unknown: vec![0.0; cells] }
    }

    /// Normalises over the known share; a cell of which nothing is known says background.
    pub(super) fn into_detection(mut self, bounds: Rect) -> Detection {
        let cells = self.size * self.size;
        for cell in 0..cells {
            let sum: f32 = (0..CHANNELS).map(|channel| self.areas[channel * cells + cell]).sum();
            for channel in 0..CHANNELS {
                let value = &mut self.areas[channel * cells + cell];
                // Rounding must not carry a share beyond 1.
                *value = if sum > 1e-6 {
                    (*value / sum).min(1.0)
                } else {
                    f32::from(u8::from(channel == 0))
                };
            }
        }
        let probabilities = PartProbabilities::new(self.size, self.areas)
            .expect("shares of a sum are probabilities");
        let unknown = self.unknown.iter().any(|share| *share > 0.0).then_some(self.unknown);
        Detection { unknown, ..Detection::new(bounds, 1.0, probabilities) }
    }
}

/// Exact areas: every pixel is a unit square, split over the cells that it touches.
///
/// `owners` has one value a pixel of `parts`; pixels of another vehicle, and area outside the image, are unknown.
pub(super) fn fractions(
    parts: &PartMask,
    owners: &[u16],
    id: u16,
    bounds: &Rect,
    size: usize,
) -> Kernel {
    let mut kernel = Kernel::empty(size);
    let cells = size * size;
    let columns = overlaps(bounds.x_min, bounds.width(), size, parts.size[0]);
    let rows = overlaps(bounds.y_min, bounds.height(), size, parts.size[1]);
    let mut known = vec![0.0f32; cells];
    for (y, row_cells) in &rows {
        for (x, column_cells) in &columns {
            let at = *y as usize * parts.size[0] as usize + *x as usize;
            let owner = owners[at];
            let channel = match owner {
                0 => 0,
                _ if owner == id => parts.labels[at] as usize,
                _ => continue,
            };
            for (j, share_y) in row_cells {
                for (i, share_x) in column_cells {
                    let (cell, share) = (j * size + i, share_x * share_y);
                    kernel.areas[channel * cells + cell] += share;
                    known[cell] += share;
                }
            }
        }
    }
    for (unknown, known) in kernel.unknown.iter_mut().zip(known) {
        // What neither a pixel of the vehicle nor background covers; sums of f32 shares miss 1 by rounding.
        let share = 1.0 - known;
        *unknown = if share > 1e-4 { share.min(1.0) } else { 0.0 };
    }
    kernel
}

/// For each pixel of a line that touches the box: the cells it touches, with the share of the cell that it covers.
fn overlaps(low: f64, length: f64, cells: usize, pixels: u32) -> Vec<(u32, Vec<(usize, f32)>)> {
    let cell = length / cells as f64;
    let first = (low - 0.5).floor().max(0.0) as u32;
    let last = ((low + length + 0.5).ceil().max(0.0) as u32).min(pixels.saturating_sub(1));
    let mut found = Vec::new();
    for pixel in first..=last {
        let (a, b) = (f64::from(pixel) - 0.5, f64::from(pixel) + 0.5);
        let start = ((a - low) / cell).floor().max(0.0) as usize;
        let end = (((b - low) / cell).ceil().max(0.0) as usize).min(cells);
        let shares: Vec<(usize, f32)> = (start..end)
            .filter_map(|i| {
                let (left, right) = (low + i as f64 * cell, low + (i + 1) as f64 * cell);
                let shared = b.min(right) - a.max(left);
                (shared > 0.0).then_some((i, (shared / cell) as f32))
            })
            .collect();
        if !shares.is_empty() {
            found.push((pixel, shares));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_holds_the_shares_of_its_pixels() {
        // Four pixels in a row: wheel, wheel, another vehicle, background; two cells a side over a box one pixel high.
        let parts = PartMask { origin: [0, 0], size: [4, 1], labels: vec![5, 5, 6, 0] };
        let owners = [1, 1, 2, 0];
        let bounds = Rect::new(-0.5, -0.5, 3.5, 0.5);
        let detection = fractions(&parts, &owners, 1, &bounds, 2).into_detection(bounds);
        assert_eq!(detection.probabilities.channel(5), [1.0, 0.0, 1.0, 0.0]);
        assert_eq!(detection.probabilities.channel(0), [0.0, 1.0, 0.0, 1.0]);
        assert_eq!(detection.unknown, Some(vec![0.0, 0.5, 0.0, 0.5]));
    }

    #[test]
    fn what_lies_outside_the_image_is_unknown() {
        let parts = PartMask { origin: [0, 0], size: [2, 2], labels: vec![27; 4] };
        let bounds = Rect::new(-2.5, -0.5, 1.5, 1.5);
        let detection = fractions(&parts, &[1; 4], 1, &bounds, 2).into_detection(bounds);
        assert_eq!(detection.unknown, Some(vec![1.0, 0.0, 1.0, 0.0]));
        assert_eq!(detection.probabilities.channel(27), [0.0, 1.0, 0.0, 1.0]);
    }
}
