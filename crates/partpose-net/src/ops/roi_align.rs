//! Features of regions: `RoIAlign` and TensorFlow's `crop_and_resize` on slices, forward and backward.
//!
//! `RoIAlign` (He, Gkioxari, Dollar and Girshick: *Mask R-CNN*, ICCV 2017): each bin of a region averages a grid of points,
//! each read bilinearly from the feature map. Numbers agree with torchvision's `roi_align` with `aligned=True`: boxes are
//! in pixels whose corners lie at integers, so half a cell is taken off; a point more than a cell outside reads zero, one
//! less far outside the border's value. `crop_and_resize` reads one point a bin, the outer ones on the box's edge, and zero
//! outside the map.

use std::sync::Arc;

use burn::Tensor;
use rayon::prelude::*;

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::chains;

/// How the points lie that a bin reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// `RoIAlign` with so many points along either side of a bin.
    Align(usize),
    /// TensorFlow's `crop_and_resize`: cells of the map a pixel are `scale * (cells - 1) / cells` there, so that the
    /// image's edges fall on the outer cells' centres.
    CropAndResize,
}

impl Sampling {
    /// Points of a bin along either axis.
    fn points(self) -> usize {
        match self {
            Self::Align(points) => points,
            Self::CropAndResize => 1,
        }
    }
}

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
    /// Points of a bin.
    pub sampling: Sampling,
    /// Cells of the feature map a pixel of the boxes.
    pub scale: f32,
}

/// A region: its image, the feature map it is read from, and its box as x and y of the upper left corner and of the
/// lower right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Index in the batch.
    pub image: usize,
    /// Index of the feature map.
    pub level: usize,
    /// Corners in pixels.
    pub corners: [f32; 4],
}

/// Reads regions, each of its level's map, into `[regions, channels, bins, bins]`.
///
/// `maps`: `[batch, channels, height, width]` each; `scales`: cells a pixel of the boxes, one a map.
pub fn read_regions(
    maps: &[Tensor<4>],
    scales: &[f32],
    regions: Vec<Region>,
    bins: usize,
    sampling: Sampling,
) -> Tensor<4> {
    let kernel = Read { scales: scales.to_vec(), regions, bins, sampling };
    if !chains::in_memory(&maps[0].device()) {
        return chains::read_regions(maps, &kernel);
    }
    let inputs = maps.iter().map(|map| map.clone().into_dispatch()).collect();
    apply(&Arc::new(kernel), inputs)
}

#[derive(Debug)]
pub(super) struct Read {
    pub(super) scales: Vec<f32>,
    pub(super) regions: Vec<Region>,
    pub(super) bins: usize,
    pub(super) sampling: Sampling,
}

impl Read {
    pub(super) fn shape(
        &self,
        [batch, channels, height, width]: [usize; 4],
        level: usize,
    ) -> RoiShape {
        RoiShape {
            batch,
            channels,
            size: [height, width],
            bins: self.bins,
            sampling: self.sampling,
            scale: self.scales[level],
        }
    }
}

impl Kernel for Read {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let shapes: Vec<RoiShape> =
            inputs.iter().enumerate().map(|(i, map)| self.shape(map.dims4(), i)).collect();
        let channels = shapes[0].channels;
        let mut values = vec![0.0; self.regions.len() * channels * self.bins * self.bins];
        let outputs = values.par_chunks_mut((channels * self.bins * self.bins).max(1));
        outputs.zip(&self.regions).for_each(|(output, region)| {
            read(inputs[region.level].values, region, &shapes[region.level], output);
        });
        Output {
            values,
            shape: vec![self.regions.len(), channels, self.bins, self.bins],
            saved: Vec::new(),
        }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let level = |(i, wanted): (usize, &bool)| {
            let s = self.shape(state.inputs[i].dims4(), i);
            wanted.then(|| backward(state.gradient, &self.regions, i, &s))
        };
        state.wanted.iter().enumerate().map(level).collect()
    }
}

/// One region into `[channels, bins, bins]`.
fn read(features: &[f32], region: &Region, s: &RoiShape, output: &mut [f32]) {
    let area = s.size[0] * s.size[1];
    let (taps, per_bin) = taps(region, s);
    let image = &features[region.image * s.channels * area..][..s.channels * area];
    for (plane, output) in image.chunks(area).zip(output.chunks_mut(s.bins * s.bins)) {
        for (value, taps) in output.iter_mut().zip(taps.chunks(per_bin)) {
            *value = taps.iter().map(|(at, weight)| weight * plane[*at as usize]).sum();
        }
    }
}

/// Gradient of the map at `level`, shaped like it.
fn backward(gradient: &[f32], regions: &[Region], level: usize, s: &RoiShape) -> Vec<f32> {
    let area = s.size[0] * s.size[1];
    let out_area = s.bins * s.bins;
    let mut result = vec![0.0; s.batch * s.channels * area];
    if result.is_empty() {
        return result;
    }
    let here: Vec<(usize, usize, Vec<(u32, f32)>, usize)> = regions
        .par_iter()
        .enumerate()
        .filter(|(_, region)| region.level == level)
        .map(|(r, region)| {
            let (taps, per_bin) = taps(region, s);
            (r, region.image, taps, per_bin)
        })
        .collect();
    // Planes are independent of each other, and each sums its regions in their order.
    result.par_chunks_mut(area).enumerate().for_each(|(i, plane)| {
        let [image, channel] = [i / s.channels, i % s.channels];
        for (r, _, taps, per_bin) in here.iter().filter(|entry| entry.1 == image) {
            let gradient = &gradient[(r * s.channels + channel) * out_area..][..out_area];
            for (value, taps) in gradient.iter().zip(taps.chunks(*per_bin)) {
                for (at, weight) in taps {
                    plane[*at as usize] += weight * value;
                }
            }
        }
    });
    result
}

/// Along an axis of the map (0 down, 1 across), the two cells that each point of a region reads, which reaches from one
/// end to the other.
fn axis_points([from, to]: [f32; 2], s: &RoiShape, axis: usize) -> Vec<[(usize, f32); 2]> {
    let size = s.size[axis];
    let point = |i: usize| match s.sampling {
        Sampling::Align(points) => {
            let [from, to] = [from, to].map(|value| value * s.scale - 0.5);
            let step = (to - from) / s.bins as f32;
            linear(from + step * (i as f32 + 0.5) / points as f32, size, 1.0)
        }
        Sampling::CropAndResize => {
            let scale = s.scale * (size - 1) as f32 / size as f32;
            let share = if s.bins > 1 { i as f32 / (s.bins - 1) as f32 } else { 0.5 };
            linear((from + (to - from) * share) * scale, size, 0.0)
        }
    };
    (0..s.bins * s.sampling.points()).map(point).collect()
}

/// The same by bins, weights summing up to one where all points lie on the map.
pub(super) fn axis_taps(ends: [f32; 2], s: &RoiShape, axis: usize) -> Vec<Vec<(usize, f32)>> {
    let points = s.sampling.points();
    let of_bin = |points: &[[(usize, f32); 2]]| {
        let share = 1.0 / points.len() as f32;
        points.iter().flatten().map(|(at, weight)| (*at, weight * share)).collect()
    };
    axis_points(ends, s, axis).chunks(points).map(of_bin).collect()
}

/// For every bin, row by row, the cells that it reads and their weights; and how many they are a bin.
fn taps(region: &Region, s: &RoiShape) -> (Vec<(u32, f32)>, usize) {
    let points = s.sampling.points();
    let [x0, y0, x1, y1] = region.corners;
    let rows = axis_points([y0, y1], s, 0);
    let columns = axis_points([x0, x1], s, 1);
    let share = 1.0 / (points * points) as f32;
    let mut taps = Vec::with_capacity(4 * rows.len() * columns.len());
    for rows in rows.chunks(points) {
        for columns in columns.chunks(points) {
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
    (taps, 4 * points * points)
}

/// The two cells that a position lies between, with their weights; none if it lies more than `margin` cells outside.
fn linear(at: f32, size: usize, margin: f32) -> [(usize, f32); 2] {
    // Written so that what is no number reads nothing.
    if !(at >= -margin && at <= (size - 1) as f32 + margin) {
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

    const SHAPE: RoiShape = RoiShape {
        batch: 2,
        channels: 3,
        size: [6, 9],
        bins: 2,
        sampling: Sampling::Align(2),
        scale: 0.5,
    };

    fn regions() -> Vec<Region> {
        [(1, [2.0, 1.0, 9.0, 8.0]), (0, [-4.0, 3.0, 5.5, 40.0]), (1, [3.0, 3.0, 3.0, 3.0])]
            .map(|(image, corners)| Region { image, level: 0, corners })
            .to_vec()
    }

    fn forward(features: &[f32], regions: &[Region], s: &RoiShape) -> Vec<f32> {
        let count = s.channels * s.bins * s.bins;
        let mut output = vec![0.0; regions.len() * count];
        for (region, output) in regions.iter().zip(output.chunks_mut(count)) {
            read(features, region, s, output);
        }
        output
    }

    #[test]
    fn a_plane_that_rises_evenly_is_read_at_the_bins_centres() {
        let s = RoiShape { batch: 1, channels: 1, ..SHAPE };
        let features: Vec<f32> = (0..54).map(|i| (i % 9) as f32 + 10.0 * (i / 9) as f32).collect();
        let region = Region { image: 0, level: 0, corners: [4.0, 2.0, 12.0, 10.0] };
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
        let back = backward(&gradient, &regions(), 0, &s);
        let dot =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let [forth, back] = [dot(&output, &gradient), dot(&features, &back)];
        assert!((forth - back).abs() < 1e-4 * forth.abs(), "{forth} {back}");
    }

    #[test]
    fn regions_outside_or_without_number_read_zero() {
        let features = vec![1.0; 2 * 3 * 54];
        for corners in [[900.0, 900.0, 950.0, 950.0], [f32::NAN; 4]] {
            let region = Region { image: 0, level: 0, corners };
            assert_eq!(forward(&features, &[region], &SHAPE), [0.0; 12]);
        }
    }

    #[test]
    fn crop_and_resize_reads_corners_at_the_boxs_corners() {
        let s = RoiShape { batch: 1, channels: 1, sampling: Sampling::CropAndResize, ..SHAPE };
        let features: Vec<f32> = (0..54).map(|i| (i % 9) as f32 + 10.0 * (i / 9) as f32).collect();
        // The image is 18 x 12 pixels; its whole width is 8 cells, its whole height 5.
        let region = Region { image: 0, level: 0, corners: [0.0, 0.0, 18.0, 12.0] };
        assert_eq!(forward(&features, &[region], &s), [0.0, 8.0, 50.0, 58.0]);
    }
}
