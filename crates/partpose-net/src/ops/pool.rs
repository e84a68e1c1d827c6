//! Pooling on slices.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use std::sync::Arc;

use burn::Tensor;
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::chains;
use super::vector;

/// The largest value of each `size` x `size` window, every `stride` cells, with `padding` cells that never win.
///
/// `input`: `[batch, channels, height, width]`.
pub fn max_pool(input: Tensor<4>, size: usize, stride: usize, padding: usize) -> Tensor<4> {
    if !chains::in_memory(&input.device()) {
        return chains::max_pool(input, size, stride, padding);
    }
    apply(&Arc::new(MaxPool { size, stride, padding }), vec![input.into_dispatch()])
}

/// Means over height and width: `[batch, channels, height, width]` to `[batch, channels]`.
pub fn average(input: Tensor<4>) -> Tensor<2> {
    if !chains::in_memory(&input.device()) {
        return chains::average(input);
    }
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
        let planes = planes.zip(inputs[0].values.par_chunks(height * width));
        planes.for_each_init(Vec::new, |lines, ((out, taps), plane)| {
            if [self.size, self.stride, self.padding] == [3, 2, 1] {
                vector::dispatch(ThreeByTwo { plane, size: [height, width], lines, out, taps });
            } else {
                self.plane(plane, [height, width], out, taps);
            }
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
                let y = (i / out_width * self.stride + tap / self.size).wrapping_sub(self.padding);
                let x = (i % out_width * self.stride + tap % self.size).wrapping_sub(self.padding);
                // A window of no numbers has no largest one.
                if y < height && x < width {
                    plane[y * width + x] += value;
                }
            }
        });
        vec![Some(result)]
    }
}

/// Windows of 3 x 3 that step by 2, one cell of padding: the residual networks'.
struct ThreeByTwo<'a> {
    plane: &'a [f32],
    size: [usize; 2],
    lines: &'a mut Vec<f32>,
    out: &'a mut [f32],
    taps: &'a mut [f32],
}

impl WithSimd for ThreeByTwo<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { plane, size: [height, width], lines, out, taps } = self;
        let across = width.div_ceil(2);
        // Columns left of, at and right of each window's middle.
        lines.clear();
        lines.resize(3 * across, f32::NEG_INFINITY);
        let (left, rest) = lines.split_at_mut(across);
        let (middle, right) = rest.split_at_mut(across);
        out.fill(f32::NEG_INFINITY);
        for (y, (out, taps)) in
            out.chunks_exact_mut(across).zip(taps.chunks_exact_mut(across)).enumerate()
        {
            for dy in 0..3 {
                let row = (2 * y + dy).wrapping_sub(1);
                if row >= height {
                    continue;
                }
                let row = &plane[row * width..][..width];
                for (x, pair) in row.chunks_exact(2).enumerate() {
                    middle[x] = pair[0];
                    right[x] = pair[1];
                }
                if width % 2 == 1 {
                    middle[across - 1] = row[width - 1];
                }
                left[1..].copy_from_slice(&right[..across - 1]);
                let first = (3 * dy) as f32;
                for x in 0..across {
                    let mut best = out[x];
                    let mut tap = taps[x];
                    if left[x] > best {
                        best = left[x];
                        tap = first;
                    }
                    if middle[x] > best {
                        best = middle[x];
                        tap = first + 1.0;
                    }
                    if right[x] > best {
                        best = right[x];
                        tap = first + 2.0;
                    }
                    out[x] = best;
                    taps[x] = tap;
                }
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_special_way_finds_what_the_general_one_does() {
        for [height, width] in [[7, 10], [6, 9], [1, 1], [5, 2]] {
            let pool = MaxPool { size: 3, stride: 2, padding: 1 };
            let plane: Vec<f32> = (0..height * width).map(|i| ((i * 37) % 23) as f32).collect();
            let [down, across] = pool.out_size([height, width]);
            let (mut out, mut taps) = (vec![0.0; down * across], vec![0.0; down * across]);
            let (mut found, mut found_taps) = (out.clone(), taps.clone());
            pool.plane(&plane, [height, width], &mut out, &mut taps);
            let lines = &mut Vec::new();
            vector::dispatch(ThreeByTwo {
                plane: &plane,
                size: [height, width],
                lines,
                out: &mut found,
                taps: &mut found_taps,
            });
            assert_eq!((found, found_taps), (out, taps));
        }
    }
}
