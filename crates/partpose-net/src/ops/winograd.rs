//! 3 x 3 convolutions of stride 1 with a quarter of the multiplications.
//!
//! Winograd's minimal filtering F(4x4, 3x3): Lavin and Gray: *Fast Algorithms for Convolutional Neural Networks*, CVPR 2016.
//! The input is cut into tiles of 6 x 6 that overlap by 2; tiles and kernels are transformed, multiplied element by
//! element and summed over channels (36 matrix products), and transformed back to 4 x 4 of the output. The gradient of the
//! weights is the transpose of these steps. Rounding errors are some ten times those of the plain sum, about 1e-5 of the
//! largest value.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use partpose_kernels::{Matrix, MatrixMut, multiply};
use pulp::{Simd, WithSimd};
use rayon::prelude::*;

use super::conv::{ConvShape, Finish};
use super::vector;

/// Sides of a tile of the output, and of the input.
const OUT: usize = 4;
const IN: usize = 6;
/// Elements of a transformed tile.
const POINTS: usize = IN * IN;
/// Tiles of a block at most, about: its matrices stay in the second cache.
const BLOCK: usize = 128;
/// Tiles of a block at least, about, where there are few.
const LEAST_BLOCK: usize = 32;
/// Tiles are padded to a multiple of this: the widest vectors.
const LANES: usize = 16;
/// Gap between matrices, so that they do not compete for the same lines of the caches.
const GAP: usize = 16;
/// Pieces that the gradient of the weights is summed in.
const PIECES: usize = 4;
/// Tiles from which transforming the weights pays.
const LEAST_TILES: usize = 40;
/// Channels from which transforming tiles pays.
const LEAST_CHANNELS: usize = 24;

/// Whether this way suits a convolution.
pub(super) fn suits(s: &ConvShape) -> bool {
    let [rows, columns] = tiles(s);
    s.kernel == [3, 3]
        && s.stride == [1, 1]
        && s.dilation == 1
        && s.batch * rows * columns >= LEAST_TILES
        && s.in_channels.min(s.out_channels) >= LEAST_CHANNELS
}

/// `[batch, out_channels, out height, out width]`.
pub(super) fn forward(
    input: &[f32],
    weight: &[f32],
    finish: Finish<'_>,
    s: &ConvShape,
) -> Vec<f32> {
    let weights = transform_weights(weight, s);
    let [height, width] = s.out_size();
    let area = height * width;
    let mut output = vec![0.0; s.batch * s.out_channels * area];
    let rows = rows_of_piece(s);
    let mut targets: Vec<MatrixMut<'_>> = output
        .chunks_mut(s.out_channels * area)
        .flat_map(|image| {
            MatrixMut::dense(image, [s.out_channels, area]).split_columns(rows * OUT * width)
        })
        .collect();
    let blocks = blocks(s);
    let mut work: Vec<(&Block, Vec<MatrixMut<'_>>)> = Vec::new();
    for block in blocks.iter().rev() {
        work.push((block, targets.split_off(targets.len() - block.pieces.len())));
    }
    work.into_par_iter().for_each_init(Scratch::default, |scratch, (block, mut targets)| {
        let columns = block.columns();
        let Scratch { tiles, inputs, outputs } = scratch;
        transform_tiles::<true>(input, s, block, tiles, inputs);
        let step = s.out_channels * columns + GAP;
        outputs.resize(POINTS * step, 0.0);
        for (point, product) in outputs.chunks_mut(step).enumerate() {
            let weights = Matrix {
                data: &weights[point * s.in_channels..],
                size: [s.out_channels, s.in_channels],
                strides: [POINTS * s.in_channels, 1],
            };
            let from = &inputs[point * (s.in_channels * columns + GAP)..];
            let inputs = Matrix::dense(from, [s.in_channels, columns]);
            let product = &mut product[..s.out_channels * columns];
            let mut product = MatrixMut::dense(product, [s.out_channels, columns]);
            multiply(&mut product, weights, inputs, false);
        }
        vector::dispatch(Back { outputs, targets: &mut targets, block, finish, s, tiles });
    });
    output
}

/// Gradient of the weights, shaped like them.
pub(super) fn backward_weight(input: &[f32], gradient: &[f32], s: &ConvShape) -> Vec<f32> {
    let blocks = blocks(s);
    let count = s.out_channels * s.in_channels;
    let pieces: Vec<Vec<f32>> = blocks
        .par_chunks(blocks.len().div_ceil(PIECES).max(1))
        .map(|blocks| {
            let mut sums = vec![0.0; POINTS * count];
            let mut scratch = Scratch::default();
            for (i, block) in blocks.iter().enumerate() {
                let columns = block.columns();
                let Scratch { tiles, inputs, outputs } = &mut scratch;
                transform_tiles::<true>(input, s, block, tiles, inputs);
                transform_tiles::<false>(gradient, s, block, tiles, outputs);
                for (point, sum) in sums.chunks_mut(count).enumerate() {
                    let from = &inputs[point * (s.in_channels * columns + GAP)..];
                    let inputs = Matrix::dense(from, [s.in_channels, columns]);
                    let from = &outputs[point * (s.out_channels * columns + GAP)..];
                    let outputs = Matrix::dense(from, [s.out_channels, columns]);
                    let mut sum = MatrixMut::dense(sum, [s.out_channels, s.in_channels]);
                    multiply(&mut sum, outputs, inputs.transposed(), i > 0);
                }
            }
            sums
        })
        .collect();
    let mut result = vec![0.0; count * 9];
    result.par_chunks_mut(s.in_channels * 9).enumerate().for_each(|(o, kernels)| {
        vector::dispatch(KernelsBack { pieces: &pieces, first: o * s.in_channels, kernels });
    });
    result
}

/// Rows of tiles of one image.
#[derive(Clone, Copy, Debug)]
struct Piece {
    image: usize,
    first: usize,
    rows: usize,
}

/// Tiles that are worked on together.
#[derive(Debug)]
struct Block {
    pieces: Vec<Piece>,
    /// Tiles along a row.
    across: usize,
}

/// Memory that blocks use one after the other.
#[derive(Default)]
struct Scratch {
    /// The tiles of one channel, element by element.
    tiles: Vec<f32>,
    /// `[36, channels, tiles]` of the input, with gaps.
    inputs: Vec<f32>,
    /// `[36, channels, tiles]` of the output, with gaps.
    outputs: Vec<f32>,
}

impl Block {
    fn tiles(&self) -> usize {
        self.pieces.iter().map(|piece| piece.rows * self.across).sum()
    }

    /// Tiles with padding.
    fn columns(&self) -> usize {
        self.tiles().next_multiple_of(LANES)
    }

    /// Rows of tiles: index of the piece, image, row.
    fn rows(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        self.pieces.iter().enumerate().flat_map(|(i, piece)| {
            (0..piece.rows).map(move |row| (i, piece.image, piece.first + row))
        })
    }
}

/// Rows and columns of tiles of an image.
fn tiles(s: &ConvShape) -> [usize; 2] {
    s.out_size().map(|side| side.div_ceil(OUT))
}

/// Tiles of a block: few enough that there are several blocks for the threads, whose number does not matter.
fn block_size(s: &ConvShape) -> usize {
    let [down, across] = tiles(s);
    (s.batch * down * across).div_ceil(PIECES).clamp(LEAST_BLOCK, BLOCK)
}

fn rows_of_piece(s: &ConvShape) -> usize {
    let [down, across] = tiles(s);
    (block_size(s) / across.max(1)).clamp(1, down.max(1))
}

/// Shares out an operation's tiles; the order is that of the pieces in memory.
fn blocks(s: &ConvShape) -> Vec<Block> {
    let [down, across] = tiles(s);
    let step = rows_of_piece(s);
    let pieces: Vec<Piece> = (0..s.batch)
        .flat_map(|image| {
            let starts = (0..down).step_by(step);
            starts.map(move |first| Piece { image, first, rows: step.min(down - first) })
        })
        .collect();
    let of_block = (block_size(s) / (step * across).max(1)).max(1);
    pieces.chunks(of_block).map(|pieces| Block { pieces: pieces.to_vec(), across }).collect()
}

/// `[out_channels, 36, in_channels]`.
fn transform_weights(weight: &[f32], s: &ConvShape) -> Vec<f32> {
    let channels = s.in_channels;
    let mut result = vec![0.0; s.out_channels * POINTS * channels];
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
struct KernelsBack<'a> {
    pieces: &'a [Vec<f32>],
    first: usize,
    kernels: &'a mut [f32],
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

/// Transforms the tiles of a block: 6 x 6 tiles of the input if `INPUT`, otherwise 4 x 4 tiles of the output's gradient.
fn transform_tiles<const INPUT: bool>(
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

// What follows is written without closures: only plain functions are sure to be compiled for the chosen vectors.

/// A vector from the beginning of a slice.
#[inline(always)]
fn load<S: Simd>(_: S, from: &[f32]) -> S::f32s {
    S::as_simd_f32s(&from[..S::F32_LANES]).0[0]
}

#[inline(always)]
fn store<S: Simd>(_: S, to: &mut [f32], value: S::f32s) {
    S::as_mut_simd_f32s(&mut to[..S::F32_LANES]).0[0] = value;
}

/// `factor * value + plus`.
#[inline(always)]
fn times<S: Simd>(simd: S, factor: f32, value: S::f32s, plus: S::f32s) -> S::f32s {
    simd.mul_add_f32s(simd.splat_f32s(factor), value, plus)
}

/// Transforms as many tiles as a vector holds; elements lie `columns` apart, points `step`.
#[inline(always)]
fn tile_of_input<S: Simd>(simd: S, from: &[f32], columns: usize, to: &mut [f32], step: usize) {
    let mut half = [[simd.splat_f32s(0.0); IN]; IN];
    for x in 0..IN {
        let mut column = [simd.splat_f32s(0.0); IN];
        for y in 0..IN {
            column[y] = load(simd, &from[(y * IN + x) * columns..]);
        }
        let points = points_from_input(simd, column);
        for y in 0..IN {
            half[y][x] = points[y];
        }
    }
    for y in 0..IN {
        let points = points_from_input(simd, half[y]);
        for x in 0..IN {
            store(simd, &mut to[(y * IN + x) * step..], points[x]);
        }
    }
}

/// The same for tiles of the output's gradient.
#[inline(always)]
fn tile_of_output<S: Simd>(simd: S, from: &[f32], columns: usize, to: &mut [f32], step: usize) {
    let mut half = [[simd.splat_f32s(0.0); OUT]; IN];
    for x in 0..OUT {
        let mut column = [simd.splat_f32s(0.0); OUT];
        for y in 0..OUT {
            column[y] = load(simd, &from[(y * OUT + x) * columns..]);
        }
        let points = points_from_output(simd, column);
        for y in 0..IN {
            half[y][x] = points[y];
        }
    }
    for y in 0..IN {
        let points = points_from_output(simd, half[y]);
        for x in 0..IN {
            store(simd, &mut to[(y * IN + x) * step..], points[x]);
        }
    }
}

/// Back from points, `step` apart, to elements, `columns` apart.
#[inline(always)]
fn tile_from_points<S: Simd>(
    simd: S,
    (from, step): (&[f32], usize),
    bias: S::f32s,
    (to, columns): (&mut [f32], usize),
) {
    let mut half = [[simd.splat_f32s(0.0); IN]; OUT];
    for x in 0..IN {
        let mut column = [simd.splat_f32s(0.0); IN];
        for y in 0..IN {
            column[y] = load(simd, &from[(y * IN + x) * step..]);
        }
        let values = output_from_points(simd, column);
        for y in 0..OUT {
            half[y][x] = values[y];
        }
    }
    for y in 0..OUT {
        let values = output_from_points(simd, half[y]);
        for x in 0..OUT {
            let value = simd.add_f32s(values[x], bias);
            store(simd, &mut to[(y * OUT + x) * columns..], value);
        }
    }
}

#[inline(always)]
fn points_from_input<S: Simd>(simd: S, d: [S::f32s; IN]) -> [S::f32s; IN] {
    let a = times(simd, -4.0, d[2], d[4]);
    let b = times(simd, -4.0, d[1], d[3]);
    let c = simd.sub_f32s(d[4], d[2]);
    let e = simd.sub_f32s(d[3], d[1]);
    [
        times(simd, 4.0, d[0], times(simd, -5.0, d[2], d[4])),
        simd.add_f32s(a, b),
        simd.sub_f32s(a, b),
        times(simd, 2.0, e, c),
        times(simd, -2.0, e, c),
        times(simd, 4.0, d[1], times(simd, -5.0, d[3], d[5])),
    ]
}

/// The transpose of [`output_from_points`].
#[inline(always)]
fn points_from_output<S: Simd>(simd: S, y: [S::f32s; OUT]) -> [S::f32s; IN] {
    let even = simd.add_f32s(y[0], y[2]);
    let odd = simd.add_f32s(y[1], y[3]);
    let far_even = times(simd, 4.0, y[2], y[0]);
    let far_odd = times(simd, 4.0, y[3], y[1]);
    [
        y[0],
        simd.add_f32s(even, odd),
        simd.sub_f32s(even, odd),
        times(simd, 2.0, far_odd, far_even),
        times(simd, -2.0, far_odd, far_even),
        y[3],
    ]
}

#[inline(always)]
fn output_from_points<S: Simd>(simd: S, m: [S::f32s; IN]) -> [S::f32s; OUT] {
    let sum = simd.add_f32s(m[1], m[2]);
    let difference = simd.sub_f32s(m[1], m[2]);
    let far_sum = simd.add_f32s(m[3], m[4]);
    let far_difference = simd.sub_f32s(m[3], m[4]);
    [
        simd.add_f32s(m[0], simd.add_f32s(sum, far_sum)),
        times(simd, 2.0, far_difference, difference),
        times(simd, 4.0, far_sum, sum),
        times(simd, 8.0, far_difference, simd.add_f32s(difference, m[5])),
    ]
}

/// From products to the output.
struct Back<'a, 'b> {
    outputs: &'a [f32],
    targets: &'a mut [MatrixMut<'b>],
    block: &'a Block,
    finish: Finish<'a>,
    s: &'a ConvShape,
    tiles: &'a mut Vec<f32>,
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

#[cfg(test)]
mod tests {
    use super::super::conv;
    use super::*;

    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let hash = |i: u32| (i ^ seed.wrapping_mul(97)).wrapping_mul(2_654_435_761) >> 16;
        (0..count as u32).map(|i| (hash(i) % 1001) as f32 / 500.0 - 1.0).collect()
    }

    fn check(found: &[f32], expected: &[f32]) {
        let largest = expected.iter().fold(0.0f32, |most, value| most.max(value.abs()));
        assert_eq!(found.len(), expected.len());
        for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
            let error = (found - expected).abs();
            assert!(error < 2e-5 * largest, "{i}: {found} {expected}");
        }
    }

    #[test]
    fn it_agrees_with_the_plain_sum() {
        let base = ConvShape {
            batch: 2,
            in_channels: 24,
            out_channels: 32,
            in_size: [29, 33],
            kernel: [3, 3],
            stride: [1, 1],
            padding: [1, 1],
            dilation: 1,
        };
        let shapes = [
            base,
            ConvShape { in_size: [14, 14], batch: 11, ..base },
            ConvShape { in_size: [40, 600], batch: 1, ..base },
            ConvShape { padding: [2, 0], ..base },
        ];
        for s in shapes {
            assert!(suits(&s), "{s:?}");
            let [height, width] = s.out_size();
            let input = numbers(s.batch * s.in_channels * s.in_size[0] * s.in_size[1], 1);
            let weight = numbers(s.out_channels * s.in_channels * 9, 2);
            let gradient = numbers(s.batch * s.out_channels * height * width, 3);
            let bias = numbers(s.out_channels, 4);
            let finish = Finish { bias: Some(&bias), residual: Some(&gradient), relu: true };
            let expected = conv::forward_plain(&input, &weight, finish, &s);
            check(&forward(&input, &weight, finish, &s), &expected);
            let expected = conv::backward_weight_plain(&input, &gradient, &s);
            check(&backward_weight(&input, &gradient, &s), &expected);
        }
    }
}
