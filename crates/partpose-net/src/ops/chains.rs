//! The same operations as chains of burn's own, for devices whose memory our kernels cannot reach: graphics processors.
//!
//! Gradients are burn's. Resizing and reading regions work along either axis by itself, so they become products with
//! matrices of weights, which such devices are fast at.

use burn::Tensor;
use burn::backend::DispatchDevice;
use burn::tensor::ops::{ConvOptions as Steps, MaxPoolOptions};
use burn::tensor::{Device, Int, TensorData, activation, module};

use super::conv2d::ConvOptions;
use super::norm::{EPSILON, Normalised};
use super::resize::Resize;
use super::roi_align::{Read, Region, RoiShape, axis_taps};

/// Whether tensors of a device lie in memory, where our kernels can work on them.
pub(crate) fn in_memory(device: &Device) -> bool {
    fn is_flex(device: &DispatchDevice) -> bool {
        if let DispatchDevice::Autodiff(inner) = device {
            return is_flex(inner);
        }
        matches!(device, DispatchDevice::Flex(_))
    }
    is_flex(device.as_dispatch())
}

/// [`super::conv2d()`].
pub(super) fn conv2d(
    input: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    residual: Option<Tensor<4>>,
    of: ConvOptions,
) -> Tensor<4> {
    let steps = Steps::new([of.stride; 2], [of.padding; 2], [of.dilation; 2], 1);
    finish(module::conv2d(input, weight, bias, steps), residual, of.relu)
}

/// [`super::linear()`].
pub(super) fn linear(
    input: Tensor<2>,
    weight: Tensor<2>,
    bias: Tensor<1>,
    relu: bool,
) -> Tensor<2> {
    let result = input.matmul(weight.transpose()) + bias.unsqueeze();
    if relu { activation::relu(result) } else { result }
}

/// [`super::max_pool`].
pub(super) fn max_pool(input: Tensor<4>, size: usize, stride: usize, padding: usize) -> Tensor<4> {
    let options = MaxPoolOptions {
        stride: [stride; 2],
        padding: [(padding, padding); 2],
        ..MaxPoolOptions::new([size; 2])
    };
    module::max_pool2d(input, options)
}

/// [`super::average`].
pub(super) fn average(input: Tensor<4>) -> Tensor<2> {
    let [batch, channels, _, _] = input.dims();
    input.mean_dims(&[2, 3]).reshape([batch, channels])
}

/// [`super::batch_norm`], with mean and variance as tensors, `[channels]`.
pub(super) fn batch_norm(of: Normalised) -> (Tensor<4>, [Tensor<1>; 2]) {
    let [batch, channels, height, width] = of.input.dims();
    let count = (batch * height * width) as f32;
    let mean = of.input.clone().mean_dims(&[0, 2, 3]);
    let off = of.input.clone() - mean.clone();
    let variance = off.clone().powi_scalar(2).mean_dims(&[0, 2, 3]);
    let result = off / (variance.clone() + EPSILON).sqrt();
    let unbiased = variance * (count / (count - 1.0).max(1.0));
    let statistics = [mean, unbiased].map(|value| value.detach().reshape([channels]));
    (scaled(result, of), statistics)
}

/// [`super::fixed_norm`].
pub(super) fn fixed_norm(of: Normalised, mean: Vec<f32>, variance: &[f32]) -> Tensor<4> {
    let device = of.input.device();
    let scale = variance.iter().map(|variance| 1.0 / (variance + EPSILON).sqrt()).collect();
    let [mean, scale] = [mean, scale].map(|values: Vec<f32>| channelwise(values, &device));
    scaled((of.input.clone() - mean) * scale, of)
}

/// [`super::group_norm`].
pub(super) fn group_norm(of: Normalised, groups: usize) -> Tensor<4> {
    let shape = of.input.dims();
    let [batch, channels, height, width] = shape;
    let grouped = of.input.clone().reshape([batch, groups, channels / groups * height * width]);
    let off = grouped.clone() - grouped.mean_dim(2);
    let variance = off.clone().powi_scalar(2).mean_dim(2);
    scaled((off / (variance + EPSILON).sqrt()).reshape(shape), of)
}

/// The normalised values times gamma plus beta, and what follows.
fn scaled(values: Tensor<4>, of: Normalised) -> Tensor<4> {
    let channels = values.dims()[1];
    let [gamma, beta] = [of.gamma, of.beta].map(|one| one.reshape([1, channels, 1, 1]));
    finish(values * gamma + beta, of.residual, of.relu)
}

fn finish(result: Tensor<4>, residual: Option<Tensor<4>>, relu: bool) -> Tensor<4> {
    let result = match residual {
        Some(residual) => result + residual,
        None => result,
    };
    if relu { activation::relu(result) } else { result }
}

fn channelwise(values: Vec<f32>, device: &Device) -> Tensor<4> {
    let count = values.len();
    Tensor::from_data(TensorData::new(values, [1, count, 1, 1]), device)
}

/// For each place along the axis of a result, the places along that of the input that it reads, and their weights.
type Taps = Vec<Vec<(usize, f32)>>;

/// [`super::upsample_add`].
pub(super) fn upsample_add(coarse: Tensor<4>, fine: Tensor<4>) -> Tensor<4> {
    let [_, _, from_height, from_width] = coarse.dims();
    let [_, _, height, width] = fine.dims();
    let repeated = |from, to| (0..to).map(|i| vec![(i * from / to, 1.0)]).collect();
    resample(coarse, &repeated(from_height, height), &repeated(from_width, width)) + fine
}

/// [`super::resize()`].
pub(super) fn resize(input: Tensor<4>, of: &Resize) -> Tensor<4> {
    let [_, _, height, width] = input.dims();
    let [rows, columns] = [[height, of.size[0]], [width, of.size[1]]].map(|[from, to]| {
        let between = |(low, high, share)| vec![(low, 1.0 - share), (high, share)];
        of.axis(from, to).into_iter().map(between).collect()
    });
    resample(input, &rows, &columns)
}

/// The sums that `rows` and `columns` tell of, along either axis.
fn resample(input: Tensor<4>, rows: &Taps, columns: &Taps) -> Tensor<4> {
    let [batch, channels, height, width] = input.dims();
    let device = input.device();
    let across = matrix(columns, width, &device).transpose();
    let down = matrix(rows, height, &device).unsqueeze::<3>();
    let wide = input.reshape([batch * channels * height, width]).matmul(across);
    let wide = wide.reshape([batch * channels, height, columns.len()]);
    down.matmul(wide).reshape([batch, channels, rows.len(), columns.len()])
}

/// `[taps, size]`.
fn matrix(taps: &Taps, size: usize, device: &Device) -> Tensor<2> {
    let mut values = vec![0.0; taps.len() * size];
    for (row, taps) in values.chunks_mut(size).zip(taps) {
        for (at, weight) in taps {
            row[*at] += weight;
        }
    }
    Tensor::from_data(TensorData::new(values, [taps.len(), size]), device)
}

/// [`super::read_regions`].
pub(super) fn read_regions(maps: &[Tensor<4>], of: &Read) -> Tensor<4> {
    let device = maps[0].device();
    let Read { regions, bins, .. } = of;
    let channels = maps[0].dims()[1];
    let mut groups = Vec::new();
    let mut order = Vec::new();
    for (level, map) in maps.iter().enumerate() {
        let s = of.shape(map.dims(), level);
        for image in 0..s.batch {
            let here = |at: &usize| regions[*at].level == level && regions[*at].image == image;
            let chosen: Vec<usize> = (0..regions.len()).filter(here).collect();
            if !chosen.is_empty() {
                let read: Vec<Region> = chosen.iter().map(|at| regions[*at]).collect();
                groups.push(read_of_image(map.clone().narrow(0, image, 1), &s, &read));
                order.extend(chosen);
            }
        }
    }
    if groups.is_empty() {
        return Tensor::zeros([0, channels, *bins, *bins], &device);
    }
    let mut places = vec![0i64; order.len()];
    for (place, region) in order.into_iter().enumerate() {
        places[region] = place as i64;
    }
    let count = places.len();
    let places = Tensor::<1, Int>::from_data(TensorData::new(places, [count]), &device);
    Tensor::cat(groups, 0).select(0, places)
}

/// Regions of one image and map, `[1, channels, height, width]`.
fn read_of_image(map: Tensor<4>, s: &RoiShape, regions: &[Region]) -> Tensor<4> {
    let [_, channels, height, width] = map.dims();
    let device = map.device();
    let (count, bins) = (regions.len(), s.bins);
    let taps = |axis: usize| -> Taps {
        let of = |region: &Region| {
            let ends = [region.corners[axis], region.corners[axis + 2]];
            axis_taps(ends, s, 1 - axis)
        };
        regions.iter().flat_map(of).collect()
    };
    let columns = matrix(&taps(0), width, &device).transpose();
    let rows = matrix(&taps(1), height, &device).reshape([count, bins, height]);
    let across = map.reshape([channels * height, width]).matmul(columns);
    let across = across.reshape([channels, height, count, bins]).permute([2, 1, 0, 3]);
    let read = rows.matmul(across.reshape([count, height, channels * bins]));
    read.reshape([count, bins, channels, bins]).permute([0, 2, 1, 3])
}

/// [`super::attach()`].
pub(super) fn attach<const D: usize>(
    value: f32,
    tensors: &[Tensor<D>],
    gradients: Vec<Vec<f32>>,
) -> Tensor<1> {
    let device = tensors[0].device();
    let known = Tensor::from_data([value], &device);
    tensors.iter().zip(gradients).fold(known, |sum, (tensor, gradient)| {
        let gradient = Tensor::from_data(TensorData::new(gradient, tensor.dims()), &device);
        // Nothing is added but the gradient.
        sum + ((tensor.clone() - tensor.clone().detach()) * gradient).sum()
    })
}

#[cfg(test)]
mod tests;
