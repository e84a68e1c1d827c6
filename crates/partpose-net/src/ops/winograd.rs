//! 3 x 3 convolutions of stride 1 with a quarter of the multiplications.
//!
//! Winograd's minimal filtering F(4x4, 3x3): Lavin and Gray: *Fast Algorithms for Convolutional Neural Networks*, CVPR 2016.
//! The input is cut into tiles of 6 x 6 that overlap by 2; tiles and kernels are transformed, multiplied element by
//! element and summed over channels (36 matrix products), and transformed back to 4 x 4 of the output. The gradient of the
//! weights is the transpose of these steps. Rounding errors are some ten times those of the plain sum, about 1e-5 of the
//! largest value.

use std::sync::Arc;

use partpose_kernels::{Matrix, MatrixMut, multiply};
use rayon::prelude::*;

use super::conv::{ConvShape, Finish};
use super::vector;
use kernels::{KernelsBack, transform_weights};
use tiles::{Back, transform_tiles};

mod kernels;
mod points;
mod tiles;

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
/// Blocks that a convolution is cut into at least, if it has tiles enough.
const PIECES: usize = 4;
/// Weights from which their gradient is summed in two pieces instead of four: clearing and adding them costs time too.
const MANY_WEIGHTS: usize = 16_000;
/// Tiles from which transforming the weights pays, and from which using transformed ones does.
const LEAST_TILES: usize = 40;
const LEAST_TILES_PREPARED: usize = 12;
/// Channels from which transforming tiles pays.
const LEAST_CHANNELS: usize = 24;

/// Weights of a convolution in the form that products are taken in, `[out_channels, 36, in_channels]`, for networks whose
/// weights stay: making them takes longer than using them where there are few tiles.
#[derive(Clone, Debug)]
pub struct Prepared(Arc<Vec<f32>>);

impl Prepared {
    /// `weight`: `[out_channels, in_channels, 3, 3]`, used with stride and dilation 1; `None` where this way does not pay.
    pub fn new(weight: &[f32], [out_channels, in_channels]: [usize; 2]) -> Option<Self> {
        let pays = has_channels([out_channels, in_channels])
            && weight.len() == 9 * in_channels * out_channels;
        pays.then(|| Self(Arc::new(transform_weights(weight, in_channels))))
    }
}

/// Whether this way suits a convolution.
pub(super) fn suits(s: &ConvShape) -> bool {
    is_possible(s) && count(s) >= LEAST_TILES
}

/// Whether it does with weights that are prepared.
pub(super) fn suits_prepared(s: &ConvShape) -> bool {
    is_possible(s) && count(s) >= LEAST_TILES_PREPARED
}

fn is_possible(s: &ConvShape) -> bool {
    s.kernel == [3, 3]
        && s.stride == [1, 1]
        && s.dilation == 1
        && has_channels([s.out_channels, s.in_channels])
}

fn has_channels(channels: [usize; 2]) -> bool {
    channels.iter().all(|count| *count >= LEAST_CHANNELS)
}

/// Tiles of all images.
fn count(s: &ConvShape) -> usize {
    let [rows, columns] = tiles(s);
    s.batch * rows * columns
}

/// `[batch, out_channels, out height, out width]`.
pub(super) fn forward(
    input: &[f32],
    weight: &[f32],
    finish: Finish<'_>,
    s: &ConvShape,
) -> Vec<f32> {
    multiplied(input, &transform_weights(weight, s.in_channels), finish, s)
}

/// The same with weights that are prepared.
pub(super) fn forward_prepared(
    input: &[f32],
    weights: &Prepared,
    finish: Finish<'_>,
    s: &ConvShape,
) -> Vec<f32> {
    multiplied(input, &weights.0, finish, s)
}

fn multiplied(input: &[f32], weights: &[f32], finish: Finish<'_>, s: &ConvShape) -> Vec<f32> {
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
    // Where blocks are few, threads share the points of each instead.
    let are_few = blocks.len() < PIECES;
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
        let product = |(point, product): (usize, &mut [f32])| {
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
        };
        if are_few {
            outputs.par_chunks_mut(step).enumerate().for_each(product);
        } else {
            outputs.chunks_mut(step).enumerate().for_each(product);
        }
        vector::dispatch(Back { outputs, targets: &mut targets, block, finish, s, tiles });
    });
    output
}

/// Gradient of the weights, shaped like them.
pub(super) fn backward_weight(input: &[f32], gradient: &[f32], s: &ConvShape) -> Vec<f32> {
    let blocks = blocks(s);
    let count = s.out_channels * s.in_channels;
    let pieces = if count < MANY_WEIGHTS { PIECES } else { 2 };
    let pieces: Vec<Vec<f32>> = blocks
        .par_chunks(blocks.len().div_ceil(pieces).max(1))
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
            let prepared = Prepared::new(&weight, [s.out_channels, s.in_channels]).unwrap();
            check(&forward_prepared(&input, &prepared, finish, &s), &expected);
            let expected = conv::backward_weight_plain(&input, &gradient, &s);
            check(&backward_weight(&input, &gradient, &s), &expected);
        }
    }
}
