//! Larger feature maps from smaller ones.

use std::sync::Arc;

use burn::Tensor;
use rayon::prelude::*;

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::chains;

/// `fine`, `[batch, channels, height, width]`, plus `coarse` with its cells repeated to the same size: the way down of a
/// feature pyramid.
pub fn upsample_add(coarse: Tensor<4>, fine: Tensor<4>) -> Tensor<4> {
    if !chains::in_memory(&coarse.device()) {
        return chains::upsample_add(coarse, fine);
    }
    apply(&Arc::new(UpsampleAdd), vec![coarse.into_dispatch(), fine.into_dispatch()])
}

/// Bilinear resize of `[batch, channels, height, width]` to `size`, height and width.
///
/// With `aligned` corners the outer cells' centres fall on each other, otherwise their outer edges.
pub fn resize(input: Tensor<4>, size: [usize; 2], aligned: bool) -> Tensor<4> {
    let kernel = Resize { size, aligned };
    if !chains::in_memory(&input.device()) {
        return chains::resize(input, &kernel);
    }
    apply(&Arc::new(kernel), vec![input.into_dispatch()])
}

#[derive(Debug)]
struct UpsampleAdd;

impl Kernel for UpsampleAdd {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let [_, _, from_height, from_width] = inputs[0].dims4();
        let [_, _, height, width] = inputs[1].dims4();
        let mut values = inputs[1].values.to_vec();
        let planes = values.par_chunks_mut(height * width);
        planes.zip(inputs[0].values.par_chunks(from_height * from_width)).for_each(
            |(fine, coarse)| {
                for (y, row) in fine.chunks_mut(width).enumerate() {
                    let source = &coarse[y * from_height / height * from_width..][..from_width];
                    if width == 2 * from_width {
                        for (pair, value) in row.chunks_exact_mut(2).zip(source) {
                            for fine in pair {
                                *fine += value;
                            }
                        }
                    } else {
                        for (x, value) in row.iter_mut().enumerate() {
                            *value += source[x * from_width / width];
                        }
                    }
                }
            },
        );
        Output { values, shape: inputs[1].shape.clone(), saved: Vec::new() }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [_, _, to_height, to_width] = state.inputs[0].dims4();
        let [_, _, height, width] = state.inputs[1].dims4();
        let of_coarse = state.wanted[0].then(|| {
            let mut result = vec![0.0; state.inputs[0].values.len()];
            let planes = result.par_chunks_mut(to_height * to_width);
            planes.zip(state.gradient.par_chunks(height * width)).for_each(|(coarse, fine)| {
                for (y, row) in fine.chunks(width).enumerate() {
                    let target = &mut coarse[y * to_height / height * to_width..][..to_width];
                    for (x, value) in row.iter().enumerate() {
                        target[x * to_width / width] += value;
                    }
                }
            });
            result
        });
        vec![of_coarse, state.wanted[1].then(|| state.gradient.to_vec())]
    }
}

#[derive(Debug)]
pub(super) struct Resize {
    pub(super) size: [usize; 2],
    pub(super) aligned: bool,
}

impl Resize {
    /// For each place of the larger axis the two it lies between and the share of the second.
    pub(super) fn axis(&self, from: usize, to: usize) -> Vec<(usize, usize, f32)> {
        let place = |i: usize| {
            let at = if self.aligned {
                i as f32 * (from - 1) as f32 / (to - 1).max(1) as f32
            } else {
                (i as f32 + 0.5) * from as f32 / to as f32 - 0.5
            };
            let at = at.clamp(0.0, (from - 1) as f32);
            let low = (at as usize).min(from - 1);
            (low, (low + 1).min(from - 1), at - low as f32)
        };
        (0..to).map(place).collect()
    }

    /// Places and weights of the four cells that each cell of the result reads.
    fn taps(&self, [height, width]: [usize; 2]) -> Vec<[(usize, f32); 4]> {
        let rows = self.axis(height, self.size[0]);
        let columns = self.axis(width, self.size[1]);
        let mut taps = Vec::with_capacity(rows.len() * columns.len());
        for (top, bottom, down) in &rows {
            for (left, right, along) in &columns {
                taps.push([
                    (top * width + left, (1.0 - down) * (1.0 - along)),
                    (top * width + right, (1.0 - down) * along),
                    (bottom * width + left, down * (1.0 - along)),
                    (bottom * width + right, down * along),
                ]);
            }
        }
        taps
    }
}

impl Kernel for Resize {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let [batch, channels, height, width] = inputs[0].dims4();
        let [out_height, out_width] = self.size;
        let taps = self.taps([height, width]);
        let mut values = vec![0.0; batch * channels * taps.len()];
        let planes = values.par_chunks_mut(taps.len().max(1));
        planes.zip(inputs[0].values.par_chunks(height * width)).for_each(|(out, plane)| {
            for (value, taps) in out.iter_mut().zip(&taps) {
                *value = taps.iter().map(|(at, weight)| plane[*at] * weight).sum();
            }
        });
        Output { values, shape: vec![batch, channels, out_height, out_width], saved: Vec::new() }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [_, _, height, width] = state.inputs[0].dims4();
        let taps = self.taps([height, width]);
        let mut result = vec![0.0; state.inputs[0].values.len()];
        let planes = result.par_chunks_mut(height * width);
        planes.zip(state.gradient.par_chunks(taps.len().max(1))).for_each(|(plane, gradient)| {
            for (value, taps) in gradient.iter().zip(&taps) {
                for (at, weight) in taps {
                    plane[*at] += weight * value;
                }
            }
        });
        vec![Some(result)]
    }
}
