//! Kernels to points, and sums of points back to kernels, channels side by side.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::super::vector;
use super::{IN, LANES, POINTS};

/// `[out_channels, 36, in_channels]`.
pub(super) fn transform_weights(weight: &[f32], channels: usize) -> Vec<f32> {
    let mut result = vec![0.0; weight.len() / 9 * POINTS];
    let outs = result.par_chunks_mut(POINTS * channels).zip(weight.par_chunks(9 * channels));
    outs.for_each_init(Vec::new, |taps, (points, kernels)| {
        vector::dispatch(KernelsForth { kernels, taps, points });
    });
    result
}

/// Kernels of one output channel, `[channels, 9]`, to points, `[36, channels]`.
struct KernelsForth<'a> {
    kernels: &'a [f32],
    taps: &'a mut Vec<f32>,
    points: &'a mut [f32],
}

impl WithSimd for KernelsForth<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { kernels, taps, points } = self;
        let channels = kernels.len() / 9;
        // Tap by tap, so that neighbours in memory are channels.
        taps.resize(9 * channels, 0.0);
        for (c, kernel) in kernels.chunks_exact(9).enumerate() {
            for k in 0..9 {
                taps[k * channels + c] = kernel[k];
            }
        }
        let mut half = [[[0.0f32; LANES]; 3]; IN];
        for first in (0..channels).step_by(LANES) {
            let count = LANES.min(channels - first);
            for x in 0..3 {
                let mut column = [[0.0f32; LANES]; 3];
                for y in 0..3 {
                    let from = &taps[(y * 3 + x) * channels + first..][..count];
                    column[y][..count].copy_from_slice(from);
                }
                for lane in 0..LANES {
                    let values =
                        points_from_kernel([column[0][lane], column[1][lane], column[2][lane]]);
                    for y in 0..IN {
                        half[y][x][lane] = values[y];
                    }
                }
            }
            for y in 0..IN {
                let mut row = [[0.0f32; LANES]; IN];
                for lane in 0..LANES {
                    let values =
                        points_from_kernel([half[y][0][lane], half[y][1][lane], half[y][2][lane]]);
                    for x in 0..IN {
                        row[x][lane] = values[x];
                    }
                }
                for x in 0..IN {
                    let to = &mut points[(y * IN + x) * channels + first..][..count];
                    to.copy_from_slice(&row[x][..count]);
                }
            }
        }
    }
}

/// Sums of points over pieces, `[36, out_channels, channels]` each, to kernels of one output channel, `[channels, 9]`.
pub(super) struct KernelsBack<'a> {
    pub(super) pieces: &'a [Vec<f32>],
    pub(super) first: usize,
    pub(super) kernels: &'a mut [f32],
}

impl WithSimd for KernelsBack<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { pieces, first, kernels } = self;
        let channels = kernels.len() / 9;
        for begin in (0..channels).step_by(LANES) {
            let count = LANES.min(channels - begin);
            let mut points = [[0.0f32; LANES]; POINTS];
            for piece in pieces {
                let step = piece.len() / POINTS;
                for (point, sums) in points.iter_mut().enumerate() {
                    let from = &piece[point * step + first + begin..][..count];
                    for lane in 0..count {
                        sums[lane] += from[lane];
                    }
                }
            }
            let mut half = [[[0.0f32; LANES]; IN]; 3];
            for x in 0..IN {
                for lane in 0..LANES {
                    let mut column = [0.0; IN];
                    for y in 0..IN {
                        column[y] = points[y * IN + x][lane];
                    }
                    let values = kernel_from_points(column);
                    for y in 0..3 {
                        half[y][x][lane] = values[y];
                    }
                }
            }
            for y in 0..3 {
                let mut row = [[0.0f32; LANES]; 3];
                for lane in 0..LANES {
                    let mut line = [0.0; IN];
                    for x in 0..IN {
                        line[x] = half[y][x][lane];
                    }
                    let values = kernel_from_points(line);
                    for x in 0..3 {
                        row[x][lane] = values[x];
                    }
                }
                for lane in 0..count {
                    for x in 0..3 {
                        kernels[(begin + lane) * 9 + y * 3 + x] = row[x][lane];
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn points_from_kernel([a, b, c]: [f32; 3]) -> [f32; IN] {
    let (even, odd) = ((a + c) * (-1.0 / 6.0), b * (-1.0 / 6.0));
    let (low, middle) = (a * (1.0 / 24.0) + c * (1.0 / 6.0), b * (1.0 / 12.0));
    [a * 0.25, even + odd, even - odd, low + middle, low - middle, c]
}

/// The transpose of [`points_from_kernel`].
#[inline(always)]
fn kernel_from_points(m: [f32; IN]) -> [f32; 3] {
    let (first, second) = (m[1] + m[2], m[3] + m[4]);
    [
        m[0] * 0.25 - first * (1.0 / 6.0) + second * (1.0 / 24.0),
        (m[2] - m[1]) * (1.0 / 6.0) + (m[3] - m[4]) * (1.0 / 12.0),
        (second - first) * (1.0 / 6.0) + m[5],
    ]
}
