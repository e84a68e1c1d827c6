//! RoIAlign on slices, forward and backward.
//!
//! He, Gkioxari, Dollar and Girshick: *Mask R-CNN*, ICCV 2017: each bin of a region averages a grid of points, each read
//! bilinearly from the feature map. Numbers agree with torchvision's `roi_align` with `aligned=True`: boxes are in pixels
//! whose corners lie at integers, so half a cell is taken off; a point more than a cell outside reads zero, one less far
//! outside the border's value.

use rayon::prelude::*;

/// Sizes of the operation. Features are `[batch, channels, height, width]`, the result
/// `[regions, channels, bins, bins]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoiShape {
    /// Images.
    pub batch: usize,
    /// Channels of the features.
    pub channels: usize,
    /// Height and width of the features.
    pub size: [usize; 2],
    /// Bins along either side of a region.
    pub bins: usize,
    /// Points along either side of a bin.
    pub points: usize,
    /// Cells of the feature map a pixel of the boxes.
    pub scale: f32,
}

/// A region: its image, and its box as x and y of the upper left corner and of the lower right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Index in the batch.
    pub image: usize,
    /// Corners in pixels.
    pub corners: [f32; 4],
}

/// `[regions, channels, bins, bins]`.
pub fn forward(features: &[f32], regions: &[Region], s: &RoiShape) -> Vec<f32> {
    let area = s.size[0] * s.size[1];
    let out_area = s.bins * s.bins;
    let mut result = vec![0.0; regions.len() * s.channels * out_area];
    if result.is_empty() {
        return result;
    }
    let outputs = result.par_chunks_mut(s.channels * out_area);
    outputs.zip(regions).for_each(|(output, region)| {
        let taps = taps(region, s);
        let image = &features[region.image * s.channels * area..][..s.channels * area];
        for (plane, output) in image.chunks(area).zip(output.chunks_mut(out_area)) {
            for (value, taps) in output.iter_mut().zip(taps.chunks(4 * s.points * s.points)) {
                *value = taps.iter().map(|(at, weight)| weight * plane[*at as usize]).sum();
            }
        }
    });
    result
}

/// Gradient of the features, shaped like them.
pub fn backward(gradient: &[f32], regions: &[Region], s: &RoiShape) -> Vec<f32> {
    let area = s.size[0] * s.size[1];
    let out_area = s.bins * s.bins;
    let mut result = vec![0.0; s.batch * s.channels * area];
    if result.is_empty() {
        return result;
    }
    let taps: Vec<Vec<(u32, f32)>> = regions.iter().map(|region| taps(region, s)).collect();
    // Planes are independent of each other, and each sums its regions in their order.
    result.par_chunks_mut(area).enumerate().for_each(|(i, plane)| {
        let [image, channel] = [i / s.channels, i % s.channels];
        for (r, region) in regions.iter().enumerate().filter(|(_, region)| region.image == image) {
            debug_assert_eq!(region.image, image);
            let gradient = &gradient[(r * s.channels + channel) * out_area..][..out_area];
            for (value, taps) in gradient.iter().zip(taps[r].chunks(4 * s.points * s.points)) {
                taps.iter().for_each(|(at, weight)| plane[*at as usize] += weight * value);
            }
        }
    });
    result
}

/// For every bin, row by row, the cells that it reads, four a point, and their weights.
fn taps(region: &Region, s: &RoiShape) -> Vec<(u32, f32)> {
    let [x0, y0, x1, y1] = region.corners.map(|value| value * s.scale - 0.5);
    let step = [(y1 - y0) / s.bins as f32, (x1 - x0) / s.bins as f32];
    let axis = |start: f32, step: f32, size: usize| -> Vec<[(usize, f32); 2]> {
        let points = s.bins * s.points;
        (0..points)
            .map(|i| {
                let at = start + step * (i as f32 + 0.5) / s.points as f32;
                linear(at, size)
            })
            .collect()
    };
    let rows = axis(y0, step[0], s.size[0]);
    let columns = axis(x0, step[1], s.size[1]);
    let share = 1.0 / (s.points * s.points) as f32;
    let mut taps = Vec::with_capacity(4 * rows.len() * columns.len());
    for rows in rows.chunks(s.points) {
        for columns in columns.chunks(s.points) {
            for row in rows {
                for column in columns {
                    for (y, in_y) in row {
                        for (x, in_x) in column {
                            taps.push(((y * s.size[1] + x) as u32, in_y * in_x * share));
                        }
                    }
                }
            }
        }
    }
    taps
}

/// The two cells that a position lies between, with their weights; none if it lies outside.
fn linear(at: f32, size: usize) -> [(usize, f32); 2] {
    // Written so that what is no number reads nothing.
    if !(at >= -1.0 && at <= size as f32) {
        return [(0, 0.0); 2];
    }
    let at = at.max(0.0);
    let low = (at as usize).min(size - 1);
    let high = (low + 1).min(size - 1);
    let share = if low == high { 0.0 } else { at - low as f32 };
    [(low, 1.0 - share), (high, share)]
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: RoiShape =
        RoiShape { batch: 2, channels: 3, size: [6, 9], bins: 2, points: 2, scale: 0.5 };

    fn regions() -> Vec<Region> {
        [(1, [2.0, 1.0, 9.0, 8.0]), (0, [-4.0, 3.0, 5.5, 40.0]), (1, [3.0, 3.0, 3.0, 3.0])]
            .map(|(image, corners)| Region { image, corners })
            .to_vec()
    }

    #[test]
    fn a_plane_that_rises_evenly_is_read_at_the_bins_centres() {
        let s = RoiShape { batch: 1, channels: 1, ..SHAPE };
        let features: Vec<f32> = (0..54).map(|i| (i % 9) as f32 + 10.0 * (i / 9) as f32).collect();
        let region = Region { image: 0, corners: [4.0, 2.0, 12.0, 10.0] };
        // In cells the box is 1.5..5.5 by 0.5..4.5: centres of its bins at 2.5, 4.5 and 1.5, 3.5.
        assert_eq!(forward(&features, &[region], &s), [17.5, 19.5, 37.5, 39.5]);
    }

    #[test]
    fn backward_is_the_transpose_of_forward() {
        let s = SHAPE;
        let count = s.batch * s.channels * s.size[0] * s.size[1];
        let value = |i: usize, k: usize| ((i * k) % 23) as f32 / 7.0 - 1.5;
        let features: Vec<f32> = (0..count).map(|i| value(i, 31)).collect();
        let output = forward(&features, &regions(), &s);
        let gradient: Vec<f32> = (0..output.len()).map(|i| value(i, 17)).collect();
        let back = backward(&gradient, &regions(), &s);
        let dot =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let [forth, back] = [dot(&output, &gradient), dot(&features, &back)];
        assert!((forth - back).abs() < 1e-4 * forth.abs(), "{forth} {back}");
    }

    #[test]
    fn regions_outside_or_without_number_read_zero() {
        let features = vec![1.0; 2 * 3 * 54];
        for corners in [[900.0, 900.0, 950.0, 950.0], [f32::NAN; 4]] {
            let region = Region { image: 0, corners };
            assert_eq!(forward(&features, &[region], &SHAPE), [0.0; 12]);
        }
    }
}
