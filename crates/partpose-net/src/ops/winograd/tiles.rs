//! Images to transformed tiles, and products back to images.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use partpose_kernels::MatrixMut;
use pulp::{Simd, WithSimd};

use super::super::conv::{ConvShape, Finish};
use super::super::vector;
use super::points::{tile_from_points, tile_of_input, tile_of_output};
use super::{Block, GAP, IN, OUT, POINTS};

/// Transforms the tiles of a block: 6 x 6 tiles of the input if `INPUT`, otherwise 4 x 4 tiles of the output's gradient.
pub(super) fn transform_tiles<const INPUT: bool>(
    values: &[f32],
    s: &ConvShape,
    block: &Block,
    tiles: &mut Vec<f32>,
    result: &mut Vec<f32>,
) {
    vector::dispatch(Forth::<INPUT> { values, s, block, tiles, result });
}

struct Forth<'a, const INPUT: bool> {
    values: &'a [f32],
    s: &'a ConvShape,
    block: &'a Block,
    tiles: &'a mut Vec<f32>,
    result: &'a mut Vec<f32>,
}

impl<const INPUT: bool> WithSimd for Forth<'_, INPUT> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { values, s, block, tiles, result } = self;
        let (channels, size, padding, side) = if INPUT {
            (s.in_channels, s.in_size, s.padding, IN)
        } else {
            (s.out_channels, s.out_size(), [0, 0], OUT)
        };
        let columns = block.columns();
        let step = channels * columns + GAP;
        result.resize(POINTS * step, 0.0);
        tiles.clear();
        tiles.resize(side * side * columns, 0.0);
        let area = size[0] * size[1];
        for channel in 0..channels {
            for (i, (_, image, row)) in block.rows().enumerate() {
                let plane = &values[(image * channels + channel) * area..][..area];
                for dy in 0..side {
                    let y = (row * OUT + dy).wrapping_sub(padding[0]);
                    let line = if y < size[0] { &plane[y * size[1]..][..size[1]] } else { &[][..] };
                    let out = &mut tiles[dy * side * columns..][..side * columns];
                    spread(line, padding[1], [i * block.across, block.across], columns, out);
                }
            }
            for first in (0..columns).step_by(S::F32_LANES) {
                let to = &mut result[channel * columns + first..];
                let from = &tiles[first..];
                if INPUT {
                    tile_of_input(simd, from, columns, to, step);
                } else {
                    tile_of_output(simd, from, columns, to, step);
                }
            }
        }
    }
}

/// Copies a line of an image to the tiles' elements: column `x` of tile `t` to `out[x * columns + t]`.
///
/// `first` and `across` are the place of the line's tiles among the columns, and their number.
#[inline(always)]
fn spread(
    line: &[f32],
    padding: usize,
    [first, across]: [usize; 2],
    columns: usize,
    out: &mut [f32],
) {
    for (x, out) in out.chunks_exact_mut(columns).enumerate() {
        let out = &mut out[first..first + across];
        if line.is_empty() {
            out.fill(0.0);
            continue;
        }
        // Tiles whose element lies inside the line.
        let from = padding.saturating_sub(x).div_ceil(OUT).min(across);
        let to = (line.len() + padding).saturating_sub(x).div_ceil(OUT).clamp(from, across);
        out[..from].fill(0.0);
        out[to..].fill(0.0);
        if from < to {
            let line = &line[from * OUT + x - padding..];
            let out = &mut out[from..to];
            let count = out.len().min(line.len() / OUT);
            for (out, chunk) in out[..count].iter_mut().zip(line.chunks_exact(OUT)) {
                *out = chunk[0];
            }
            if count < out.len() {
                out[count] = line[count * OUT];
            }
        }
    }
}

/// From products to the output.
pub(super) struct Back<'a, 'b> {
    pub(super) outputs: &'a [f32],
    pub(super) targets: &'a mut [MatrixMut<'b>],
    pub(super) block: &'a Block,
    pub(super) finish: Finish<'a>,
    pub(super) s: &'a ConvShape,
    pub(super) tiles: &'a mut Vec<f32>,
}

impl WithSimd for Back<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { outputs, targets, block, finish, s, tiles } = self;
        let columns = block.columns();
        let step = s.out_channels * columns + GAP;
        let [height, width] = s.out_size();
        tiles.resize(OUT * OUT * columns, 0.0);
        for channel in 0..s.out_channels {
            let bias = simd.splat_f32s(finish.bias.map_or(0.0, |bias| bias[channel]));
            for first in (0..columns).step_by(S::F32_LANES) {
                let from = &outputs[channel * columns + first..];
                let to = &mut tiles[first..];
                tile_from_points(simd, (from, step), bias, (to, columns));
            }
            for (i, (piece, image, row)) in block.rows().enumerate() {
                let start = block.pieces[piece].first * OUT;
                let target = targets[piece].row_mut(channel);
                for dy in 0..OUT.min(height - row * OUT) {
                    let y = row * OUT + dy;
                    let out = &mut target[(y - start) * width..][..width];
                    gather(
                        &tiles[dy * OUT * columns..],
                        columns,
                        [i * block.across, block.across],
                        out,
                    );
                    if let Some(residual) = finish.residual {
                        let at = ((image * s.out_channels + channel) * height + y) * width;
                        for (out, value) in out.iter_mut().zip(&residual[at..][..width]) {
                            *out += value;
                        }
                    }
                    if finish.relu {
                        for out in out {
                            *out = if *out > 0.0 { *out } else { 0.0 };
                        }
                    }
                }
            }
        }
    }
}

/// Columns of tiles side by side: element `x` of tile `t`, at `from[x * columns + t]`, to `out[4 * t + x]`.
#[inline(always)]
fn gather(from: &[f32], columns: usize, [first, across]: [usize; 2], out: &mut [f32]) {
    let a = &from[first..][..across];
    let b = &from[columns + first..][..across];
    let c = &from[2 * columns + first..][..across];
    let d = &from[3 * columns + first..][..across];
    let whole = out.len() / OUT;
    for (t, out) in out[..whole * OUT].chunks_exact_mut(OUT).enumerate() {
        out[0] = a[t];
        out[1] = b[t];
        out[2] = c[t];
        out[3] = d[t];
    }
    for (x, out) in out[whole * OUT..].iter_mut().enumerate() {
        *out = from[x * columns + first + whole];
    }
}
