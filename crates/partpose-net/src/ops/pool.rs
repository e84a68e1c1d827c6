//! Pooling on slices.

use std::sync::Arc;

use burn::Tensor;
use rayon::prelude::*;

use super::apply::{Backwards, Kernel, Output, View, apply};

/// The largest value of each `size` x `size` window, every `stride` cells, with `padding` cells that never win.
///
/// `input`: `[batch, channels, height, width]`.
pub fn max_pool(input: Tensor<4>, size: usize, stride: usize, padding: usize) -> Tensor<4> {
    apply(&Arc::new(MaxPool { size, stride, padding }), vec![input.into_dispatch()])
}

/// Means over height and width: `[batch, channels, height, width]` to `[batch, channels]`.
pub fn average(input: Tensor<4>) -> Tensor<2> {
    apply(&Arc::new(Average), vec![input.into_dispatch()])
}

#[derive(Debug)]
struct MaxPool {
    size: usize,
    stride: usize,
    padding: usize,
}

impl MaxPool {
    fn out_size(&self, [height, width]: [usize; 2]) -> [usize; 2] {
        [height, width]
            .map(|side| (side + 2 * self.padding).saturating_sub(self.size) / self.stride + 1)
    }

    /// Pools a plane, and says of each result which element of its window it is.
    fn plane(&self, plane: &[f32], [height, width]: [usize; 2], out: &mut [f32], taps: &mut [f32]) {
        let [_, out_width] = self.out_size([height, width]);
        out.fill(f32::NEG_INFINITY);
        for (y, (out, taps)) in
            out.chunks_mut(out_width).zip(taps.chunks_mut(out_width)).enumerate()
        {
            for dy in 0..self.size {
                let row = (y * self.stride + dy).wrapping_sub(self.padding);
                if row >= height {
                    continue;
                }
                let row = &plane[row * width..][..width];
                for dx in 0..self.size {
                    let tap = (dy * self.size + dx) as f32;
                    let from = self.padding.saturating_sub(dx).div_ceil(self.stride);
                    let to = (width + self.padding - dx).div_ceil(self.stride).min(out_width);
                    let start = from * self.stride + dx - self.padding;
                    let values = row[start..].iter().step_by(self.stride);
                    let places = out[from..to].iter_mut().zip(&mut taps[from..to]);
                    for ((best, best_tap), value) in places.zip(values) {
                        let better = value > best;
                        *best = if better { *value } else { *best };
                        *best_tap = if better { tap } else { *best_tap };
                    }
                }
            }
        }
    }
}

impl Kernel for MaxPool {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let [batch, channels, height, width] = inputs[0].dims4();
        let [out_height, out_width] = self.out_size([height, width]);
        let area = out_height * out_width;
        let mut values = vec![0.0; batch * channels * area];
        let mut saved = vec![0.0; values.len()];
        let planes = values.par_chunks_mut(area).zip(saved.par_chunks_mut(area));
        planes.zip(inputs[0].values.par_chunks(height * width)).for_each(|((out, taps), plane)| {
            self.plane(plane, [height, width], out, taps);
        });
        Output { values, shape: vec![batch, channels, out_height, out_width], saved }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [_, _, height, width] = state.inputs[0].dims4();
        let [out_height, out_width] = self.out_size([height, width]);
        let area = out_height * out_width;
        let mut result = vec![0.0; state.inputs[0].values.len()];
        let outputs = state.gradient.par_chunks(area).zip(state.saved.par_chunks(area));
        result.par_chunks_mut(height * width).zip(outputs).for_each(|(plane, (gradient, taps))| {
            for (i, (value, tap)) in gradient.iter().zip(taps).enumerate() {
                let tap = *tap as usize;
                let y = i / out_width * self.stride + tap / self.size - self.padding;
                let x = i % out_width * self.stride + tap % self.size - self.padding;
                plane[y * width + x] += value;
            }
        });
        vec![Some(result)]
    }
}

#[derive(Debug)]
struct Average;

impl Kernel for Average {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let [batch, channels, height, width] = inputs[0].dims4();
        let area = height * width;
        let mean = |plane: &[f32]| plane.iter().sum::<f32>() / area as f32;
        let values = inputs[0].values.chunks(area).map(mean).collect();
        Output { values, shape: vec![batch, channels], saved: Vec::new() }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [_, _, height, width] = state.inputs[0].dims4();
        let area = height * width;
        let spread = |value: &f32| std::iter::repeat_n(value / area as f32, area);
        vec![Some(state.gradient.iter().flat_map(spread).collect())]
    }
}
