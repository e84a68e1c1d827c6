//! Convolution of images on slices, forward and backward.
//!
//! Patches of a few rows of the output are copied into a matrix small enough for the caches (im2col, Chellapilla, Puri
//! and Simard, 2006) and multiplied with the weights. The gradient of the weights is the product of the output's
//! gradient with the same patches, that of the input, for stride 1, the convolution of the output's gradient with the
//! weights turned round. Work is cut into pieces whose number and order do not depend on the number of threads, so
//! neither do the results.

use partpose_kernels::{Matrix, MatrixMut, multiply};
use rayon::prelude::*;

use super::winograd;

/// Columns of a tile, about.
const TILE: usize = 768;
/// Pieces that the gradient of the weights is summed in.
const WEIGHT_PIECES: usize = 4;

/// Sizes of a convolution. Tensors are `[batch, channels, height, width]`, weights
/// `[out_channels, in_channels, kernel height, kernel width]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConvShape {
    /// Images.
    pub batch: usize,
    /// Channels of the input.
    pub in_channels: usize,
    /// Channels of the output.
    pub out_channels: usize,
    /// Height and width of the input.
    pub in_size: [usize; 2],
    /// Height and width of the kernel.
    pub kernel: [usize; 2],
    /// Step down and to the right.
    pub stride: [usize; 2],
    /// Zeros above and below, left and right.
    pub padding: [usize; 2],
    /// Distance of a kernel's elements (atrous convolution); 1 is the usual one.
    pub dilation: usize,
}

/// What is done to a product before it leaves the caches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Finish<'a> {
    /// Added to each channel.
    pub bias: Option<&'a [f32]>,
    /// Added to the product, shaped like it.
    pub residual: Option<&'a [f32]>,
    /// Whether negative values become zero at the end.
    pub relu: bool,
}

impl ConvShape {
    /// Height and width of the output.
    pub fn out_size(&self) -> [usize; 2] {
        [0, 1].map(|i| {
            let padded = self.in_size[i] + 2 * self.padding[i];
            (padded + self.stride[i]).saturating_sub(self.reach(i)) / self.stride[i]
        })
    }

    /// Extent of the kernel on the input along an axis.
    fn reach(&self, axis: usize) -> usize {
        (self.kernel[axis] - 1) * self.dilation + 1
    }

    /// Elements of a patch.
    fn depth(&self) -> usize {
        self.in_channels * self.kernel[0] * self.kernel[1]
    }

    /// Elements of one image of input and output.
    fn areas(&self) -> [usize; 2] {
        let out = self.out_size();
        [self.in_size[0] * self.in_size[1], out[0] * out[1]]
    }

    /// Whether patches are the input itself.
    fn is_pointwise(&self) -> bool {
        self.kernel == [1, 1] && self.stride == [1, 1] && self.padding == [0, 0]
    }

    /// Rows of the output in a tile.
    fn tile_rows(&self) -> usize {
        let [height, width] = self.out_size();
        (TILE / width.max(1)).clamp(1, height.max(1))
    }
}

/// `[batch, out_channels, out height, out width]`.
pub fn forward(input: &[f32], weight: &[f32], finish: Finish<'_>, s: &ConvShape) -> Vec<f32> {
    if winograd::suits(s) {
        winograd::forward(input, weight, finish, s)
    } else {
        forward_plain(input, weight, finish, s)
    }
}

/// Gradient of the weights, shaped like them.
pub fn backward_weight(input: &[f32], gradient: &[f32], s: &ConvShape) -> Vec<f32> {
    if winograd::suits(s) {
        winograd::backward_weight(input, gradient, s)
    } else {
        backward_weight_plain(input, gradient, s)
    }
}

pub(super) fn forward_plain(
    input: &[f32],
    weight: &[f32],
    finish: Finish<'_>,
    s: &ConvShape,
) -> Vec<f32> {
    let [in_area, out_area] = s.areas();
    let depth = s.depth();
    let mut output = vec![0.0; s.batch * s.out_channels * out_area];
    if output.is_empty() {
        return output;
    }
    let width = s.out_size()[1];
    let rows = s.tile_rows();
    let weights = Matrix::dense(weight, [s.out_channels, depth]);
    let images = output.chunks_mut(s.out_channels * out_area).enumerate();
    let tiles: Vec<(usize, usize, MatrixMut<'_>)> = images
        .flat_map(|(n, image)| {
            let blocks = MatrixMut::dense(image, [s.out_channels, out_area]);
            let blocks = blocks.split_columns(rows * width).into_iter().enumerate();
            blocks.map(move |(i, block)| (n, i * rows, block))
        })
        .collect();
    tiles.into_par_iter().for_each_init(Vec::new, |patches, (n, first, mut block)| {
        let image = &input[n * s.in_channels * in_area..][..s.in_channels * in_area];
        let columns = block.size()[1];
        if let Some(bias) = finish.bias {
            (0..s.out_channels).for_each(|o| block.row_mut(o).fill(bias[o]));
        }
        let patches = if s.is_pointwise() {
            let data = &image[first * width..];
            Matrix { data, size: [depth, columns], strides: [in_area, 1] }
        } else {
            im2col(image, s, first, columns / width, patches);
            Matrix::dense(patches, [depth, columns])
        };
        multiply(&mut block, weights, patches, finish.bias.is_some());
        for o in 0..s.out_channels {
            let row = block.row_mut(o);
            if let Some(residual) = finish.residual {
                let residual = &residual[(n * s.out_channels + o) * out_area + first * width..];
                row.iter_mut().zip(residual).for_each(|(value, residual)| *value += residual);
            }
            if finish.relu {
                for value in row {
                    *value = value.max(0.0);
                }
            }
        }
    });
    output
}

pub(super) fn backward_weight_plain(input: &[f32], gradient: &[f32], s: &ConvShape) -> Vec<f32> {
    let [in_area, out_area] = s.areas();
    let (depth, width, rows) = (s.depth(), s.out_size()[1], s.tile_rows());
    if out_area == 0 {
        return vec![0.0; s.out_channels * depth];
    }
    let starts = (0..s.out_size()[0]).step_by(rows.max(1));
    let tiles: Vec<(usize, usize)> =
        (0..s.batch).flat_map(|n| starts.clone().map(move |first| (n, first))).collect();
    let pieces: Vec<Vec<f32>> = tiles
        .par_chunks(tiles.len().div_ceil(WEIGHT_PIECES).max(1))
        .map(|tiles| {
            let mut sum = vec![0.0; s.out_channels * depth];
            let mut patches = Vec::new();
            for &(n, first) in tiles {
                let image = &input[n * s.in_channels * in_area..][..s.in_channels * in_area];
                let gradient = &gradient[n * s.out_channels * out_area..];
                let columns = rows.min(s.out_size()[0] - first) * width;
                let gradient = Matrix {
                    data: &gradient[first * width..],
                    size: [s.out_channels, columns],
                    strides: [out_area, 1],
                };
                let patches = if s.is_pointwise() {
                    let data = &image[first * width..];
                    Matrix { data, size: [depth, columns], strides: [in_area, 1] }
                } else {
                    im2col(image, s, first, columns / width, &mut patches);
                    Matrix::dense(&patches, [depth, columns])
                };
                let mut sum = MatrixMut::dense(&mut sum, [s.out_channels, depth]);
                multiply(&mut sum, gradient, patches.transposed(), true);
            }
            sum
        })
        .collect();
    let mut pieces = pieces.into_iter();
    let mut total = pieces.next().unwrap_or_else(|| vec![0.0; s.out_channels * depth]);
    for piece in pieces {
        total.iter_mut().zip(piece).for_each(|(total, value)| *total += value);
    }
    total
}

/// Gradient of the input, shaped like it.
pub fn backward_input(gradient: &[f32], weight: &[f32], s: &ConvShape) -> Vec<f32> {
    let fits = (0..2).all(|i| s.padding[i] < s.reach(i));
    if s.stride == [1, 1] && fits {
        let turned = turned_round(weight, s);
        let back = ConvShape {
            in_channels: s.out_channels,
            out_channels: s.in_channels,
            in_size: s.out_size(),
            padding: [0, 1].map(|i| s.reach(i) - 1 - s.padding[i]),
            ..*s
        };
        return forward(gradient, &turned, Finish::default(), &back);
    }
    let [in_area, out_area] = s.areas();
    let taps = s.kernel[0] * s.kernel[1];
    let (rows, width) = (s.tile_rows(), s.out_size()[1]);
    let mut result = vec![0.0; s.batch * s.in_channels * in_area];
    if result.is_empty() || out_area == 0 {
        return result;
    }
    // Channels of the input are independent of each other: each group adds to its own.
    let group = s.in_channels.div_ceil(4);
    let tasks: Vec<(usize, usize, &mut [f32])> = result
        .chunks_mut(s.in_channels * in_area)
        .enumerate()
        .flat_map(|(n, image)| {
            let groups = image.chunks_mut(group * in_area).enumerate();
            groups.map(move |(g, planes)| (n, g * group, planes))
        })
        .collect();
    tasks.into_par_iter().for_each_init(Vec::new, |patches: &mut Vec<f32>, (n, first, planes)| {
        let channels = planes.len() / in_area;
        let depth = channels * taps;
        let gradient = &gradient[n * s.out_channels * out_area..][..s.out_channels * out_area];
        let weights = Matrix {
            data: &weight[first * taps..],
            size: [s.out_channels, depth],
            strides: [s.depth(), 1],
        };
        for row in (0..s.out_size()[0]).step_by(rows) {
            let columns = rows.min(s.out_size()[0] - row) * width;
            let gradient = Matrix {
                data: &gradient[row * width..],
                size: [s.out_channels, columns],
                strides: [out_area, 1],
            };
            patches.resize(depth * columns, 0.0);
            let mut product = MatrixMut::dense(patches, [depth, columns]);
            multiply(&mut product, weights.transposed(), gradient, false);
            col2im(patches, s, row, columns / width, planes);
        }
    });
    result
}

/// Gradient of the bias: the sum of the output's gradient over images and places.
pub fn backward_bias(gradient: &[f32], s: &ConvShape) -> Vec<f32> {
    let out_area = s.areas()[1];
    let mut sums = vec![0.0; s.out_channels];
    for (i, plane) in gradient.chunks(out_area.max(1)).enumerate() {
        sums[i % s.out_channels] += plane.iter().sum::<f32>();
    }
    sums
}

/// Copies the patches under some rows of the output into the columns of a matrix: row (channel, tap), column place.
fn im2col(image: &[f32], s: &ConvShape, first: usize, rows: usize, patches: &mut Vec<f32>) {
    let [height, width] = s.in_size;
    let out_width = s.out_size()[1];
    patches.resize(s.depth() * rows * out_width, 0.0);
    let lines = patches.chunks_mut(rows * out_width);
    for (line, tap) in lines.zip(0..) {
        let (channel, dy, dx) = taps(s, tap);
        let plane = &image[channel * height * width..][..height * width];
        for (y, out) in line.chunks_mut(out_width).enumerate() {
            let y = ((first + y) * s.stride[0] + dy).wrapping_sub(s.padding[0]);
            if y >= height {
                out.fill(0.0);
                continue;
            }
            let row = &plane[y * width..][..width];
            let [from, to] = inside(s, dx);
            out[..from].fill(0.0);
            out[to..].fill(0.0);
            if from >= to {
                continue;
            }
            let start = from * s.stride[1] + dx - s.padding[1];
            if s.stride[1] == 1 {
                out[from..to].copy_from_slice(&row[start..start + to - from]);
            } else {
                let source = row[start..].iter().step_by(s.stride[1]);
                out[from..to].iter_mut().zip(source).for_each(|(out, value)| *out = *value);
            }
        }
    }
}

/// Adds the columns of a matrix of patches to the places they came from.
fn col2im(patches: &[f32], s: &ConvShape, first: usize, rows: usize, planes: &mut [f32]) {
    let [height, width] = s.in_size;
    let out_width = s.out_size()[1];
    for (line, tap) in patches.chunks(rows * out_width).zip(0..) {
        let (channel, dy, dx) = taps(s, tap);
        let plane = &mut planes[channel * height * width..][..height * width];
        for (y, values) in line.chunks(out_width).enumerate() {
            let y = ((first + y) * s.stride[0] + dy).wrapping_sub(s.padding[0]);
            let [from, to] = inside(s, dx);
            if y >= height || from >= to {
                continue;
            }
            let start = from * s.stride[1] + dx - s.padding[1];
            let target = plane[y * width..][..width][start..].iter_mut().step_by(s.stride[1]);
            target.zip(&values[from..to]).for_each(|(target, value)| *target += *value);
        }
    }
}

/// Channel, row and column of a tap.
fn taps(s: &ConvShape, tap: usize) -> (usize, usize, usize) {
    let [height, width] = s.kernel;
    (tap / (height * width), tap / width % height * s.dilation, tap % width * s.dilation)
}

/// First column of the output, and the one behind the last, whose tap `dx` lies inside the image.
fn inside(s: &ConvShape, dx: usize) -> [usize; 2] {
    let (stride, padding) = (s.stride[1], s.padding[1]);
    let from = padding.saturating_sub(dx).div_ceil(stride);
    let to = (s.in_size[1] + padding).saturating_sub(dx).div_ceil(stride);
    let out_width = s.out_size()[1];
    [from.min(out_width), to.min(out_width)]
}

/// `[in_channels, out_channels, ...]` with each kernel turned by half a turn.
fn turned_round(weight: &[f32], s: &ConvShape) -> Vec<f32> {
    let taps = s.kernel[0] * s.kernel[1];
    let mut turned = Vec::with_capacity(weight.len());
    for channel in 0..s.in_channels {
        for out in 0..s.out_channels {
            let kernel = &weight[(out * s.in_channels + channel) * taps..][..taps];
            turned.extend(kernel.iter().rev());
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(count: usize, seed: u32) -> Vec<f32> {
        let hash = |i: u32| (i ^ seed.wrapping_mul(97)).wrapping_mul(2_654_435_761) >> 16;
        (0..count as u32).map(|i| (hash(i) % 11) as f32 - 5.0).collect()
    }

    /// By the definition, calling `visit` with the places in output, input and weight of every product.
    fn each_product(s: &ConvShape, mut visit: impl FnMut(usize, usize, usize)) {
        let [oh, ow] = s.out_size();
        let [kh, kw] = s.kernel;
        for n in 0..s.batch {
            for o in 0..s.out_channels {
                for y in 0..oh {
                    for x in 0..ow {
                        for tap in 0..s.depth() {
                            let (c, dy, dx) = taps(s, tap);
                            let [iy, ix] = [
                                (y * s.stride[0] + dy).wrapping_sub(s.padding[0]),
                                (x * s.stride[1] + dx).wrapping_sub(s.padding[1]),
                            ];
                            if iy < s.in_size[0] && ix < s.in_size[1] {
                                visit(
                                    ((n * s.out_channels + o) * oh + y) * ow + x,
                                    ((n * s.in_channels + c) * s.in_size[0] + iy) * s.in_size[1]
                                        + ix,
                                    (o * s.in_channels + c) * kh * kw + tap % (kh * kw),
                                );
                            }
                        }
                    }
                }
            }
        }
    }

    fn shapes() -> Vec<ConvShape> {
        let base = ConvShape {
            batch: 2,
            in_channels: 3,
            out_channels: 5,
            in_size: [9, 13],
            kernel: [3, 3],
            stride: [1, 1],
            padding: [1, 1],
            dilation: 1,
        };
        vec![
            base,
            ConvShape { kernel: [1, 1], padding: [0, 0], ..base },
            ConvShape { stride: [2, 2], ..base },
            ConvShape { kernel: [7, 7], stride: [2, 2], padding: [3, 3], in_channels: 4, ..base },
            ConvShape { kernel: [1, 1], stride: [2, 2], padding: [0, 0], ..base },
            ConvShape { kernel: [2, 3], padding: [0, 2], batch: 1, ..base },
            ConvShape { in_size: [40, 200], batch: 1, ..base },
            ConvShape { kernel: [1, 1], padding: [2, 0], ..base },
            ConvShape { dilation: 2, padding: [2, 2], ..base },
            ConvShape { dilation: 2, stride: [2, 1], ..base },
        ]
    }

    #[test]
    fn small_integers_give_exactly_what_the_definition_says() {
        for s in shapes() {
            let [in_area, out_area] = s.areas();
            let input = numbers(s.batch * s.in_channels * in_area, 1);
            let weight = numbers(s.out_channels * s.depth(), 2);
            let bias = numbers(s.out_channels, 3);
            let gradient = numbers(s.batch * s.out_channels * out_area, 4);
            let mut output: Vec<f32> =
                (0..gradient.len()).map(|i| bias[i / out_area % s.out_channels]).collect();
            let mut of_input = vec![0.0; input.len()];
            let mut of_weight = vec![0.0; weight.len()];
            each_product(&s, |o, i, w| {
                output[o] += input[i] * weight[w];
                of_input[i] += gradient[o] * weight[w];
                of_weight[w] += gradient[o] * input[i];
            });
            let finish = Finish { bias: Some(&bias), ..Finish::default() };
            assert_eq!(forward(&input, &weight, finish, &s), output, "{s:?}");
            let residual: Vec<f32> = output.iter().map(|value| 3.0 - 2.0 * value).collect();
            let finish = Finish { bias: Some(&bias), residual: Some(&residual), relu: true };
            let clipped: Vec<f32> = output.iter().map(|value| (3.0 - value).max(0.0)).collect();
            assert_eq!(forward(&input, &weight, finish, &s), clipped, "{s:?}");
            assert_eq!(backward_input(&gradient, &weight, &s), of_input, "{s:?}");
            assert_eq!(backward_weight(&input, &gradient, &s), of_weight, "{s:?}");
        }
    }

    #[test]
    fn an_empty_batch_gives_nothing() {
        let s = ConvShape { batch: 0, ..shapes()[0] };
        assert!(forward(&[], &numbers(135, 1), Finish::default(), &s).is_empty());
        assert!(backward_input(&[], &numbers(135, 1), &s).is_empty());
        assert_eq!(backward_weight(&[], &[], &s), vec![0.0; 135]);
    }
}
