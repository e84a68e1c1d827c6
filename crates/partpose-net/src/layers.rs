//! Layers with parameters, named and laid out as `PyTorch`'s: convolution, normalisation, full connection.

use burn::Tensor;
use burn::module::{Module, Param, RunningState};
use burn::tensor::{Device, TensorData};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::config::{HeadNorm, NormKind};
use crate::ops::{self, ConvOptions, Normalised, Prepared};

/// Share of the newest batch in the running statistics.
const MOMENTUM: f32 = 0.05;
/// Groups of channels of group normalisation.
const GROUPS: usize = 32;

/// Whether statistics of the batch are taken and kept, or the kept ones used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pass {
    Training,
    Inference,
}

/// A source of parameters.
pub(crate) struct Init<'a> {
    device: &'a Device,
    rng: ChaCha8Rng,
}

/// A convolution.
#[derive(Module, Debug)]
pub struct Conv {
    /// `[out_channels, in_channels, size, size]`.
    pub weight: Param<Tensor<4>>,
    /// `[out_channels]`.
    pub bias: Option<Param<Tensor<1>>>,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
    pub(crate) dilation: usize,
    /// The weights in a faster form, in a [`crate::mask_rcnn::PreparedNet`] only, whose weights cannot change.
    #[module(skip)]
    prepared: Option<Prepared>,
}

/// Sizes of a convolution's parameters and steps; sizes are kept but for the stride.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ConvSizes {
    pub(crate) channels: [usize; 2],
    pub(crate) size: usize,
    pub(crate) stride: usize,
    pub(crate) dilation: usize,
    pub(crate) bias: bool,
}

/// Normalisation of channels.
#[derive(Module, Debug)]
pub struct Norm {
    /// Factors, `[channels]`.
    pub weight: Param<Tensor<1>>,
    /// Summands, `[channels]`.
    pub bias: Param<Tensor<1>>,
    /// `[channels]`.
    pub running_mean: RunningState<Tensor<1>>,
    /// `[channels]`.
    pub running_var: RunningState<Tensor<1>>,
    #[module(skip)]
    kind: NormKind,
}

/// A fully connected layer.
#[derive(Module, Debug)]
pub struct Linear {
    /// `[out, in]`.
    pub weight: Param<Tensor<2>>,
    /// `[out]`.
    pub bias: Param<Tensor<1>>,
}

impl<'a> Init<'a> {
    pub(crate) fn new(device: &'a Device, seed: u64) -> Self {
        Self { device, rng: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// Normally distributed around zero.
    pub(crate) fn normal<const D: usize>(
        &mut self,
        shape: [usize; D],
        deviation: f32,
    ) -> Param<Tensor<D>> {
        let count = shape.iter().product();
        let values = (0..count).map(|_| deviation * normal(&mut self.rng)).collect();
        self.values(values, shape)
    }

    /// The same value everywhere.
    pub(crate) fn constant(&self, count: usize, value: f32) -> Param<Tensor<1>> {
        self.values(vec![value; count], [count])
    }

    fn values<const D: usize>(&self, values: Vec<f32>, shape: [usize; D]) -> Param<Tensor<D>> {
        Param::from_tensor(Tensor::from_data(TensorData::new(values, shape), self.device))
    }

    /// A convolution for what is cut off at zero: He et al., *Delving Deep into Rectifiers*, ICCV 2015.
    pub(crate) fn conv(&mut self, sizes: ConvSizes) -> Conv {
        let [_, out] = sizes.channels;
        let deviation = (2.0 / (out * sizes.size * sizes.size) as f32).sqrt();
        self.conv_with(sizes, deviation)
    }

    /// A convolution whose weights have a given deviation.
    pub(crate) fn conv_with(&mut self, sizes: ConvSizes, deviation: f32) -> Conv {
        let [channels, out] = sizes.channels;
        Conv {
            weight: self.normal([out, channels, sizes.size, sizes.size], deviation),
            bias: sizes.bias.then(|| self.constant(out, 0.0)),
            stride: sizes.stride,
            padding: sizes.size / 2 * sizes.dilation,
            dilation: sizes.dilation,
            prepared: None,
        }
    }

    /// Normalisation whose factors begin with `weight`.
    pub(crate) fn norm(&self, channels: usize, kind: NormKind, weight: f32) -> Norm {
        let fixed = |param: Param<Tensor<1>>| match kind {
            NormKind::Frozen => param.set_require_grad(false),
            _ => param,
        };
        let state = |value: f32| RunningState::new(Tensor::full([channels], value, self.device));
        Norm {
            weight: fixed(self.constant(channels, weight)),
            bias: fixed(self.constant(channels, 0.0)),
            running_mean: state(0.0),
            running_var: state(1.0),
            kind,
        }
    }

    /// Normalisation in the heads, if any; its factors are trained even where its statistics are fixed.
    pub(crate) fn head_norm(&self, channels: usize, kind: HeadNorm) -> Option<Norm> {
        let norm = |kind| self.norm(channels, kind, 1.0);
        match kind {
            HeadNorm::None => None,
            HeadNorm::Batch => Some(norm(NormKind::Batch)),
            HeadNorm::Frozen => Some(Norm { kind: NormKind::Frozen, ..norm(NormKind::Batch) }),
            HeadNorm::Group => Some(norm(NormKind::Group)),
        }
    }

    /// A full connection whose weights have a given deviation.
    pub(crate) fn linear(&mut self, inputs: usize, outputs: usize, deviation: f32) -> Linear {
        Linear {
            weight: self.normal([outputs, inputs], deviation),
            bias: self.constant(outputs, 0.0),
        }
    }
}

impl ConvSizes {
    /// One step a cell, no gaps.
    pub(crate) const fn new(channels: [usize; 2], size: usize, bias: bool) -> Self {
        Self { channels, size, stride: 1, dilation: 1, bias }
    }
}

impl Conv {
    /// `[batch, in_channels, height, width]` to `[batch, out_channels, out height, out width]`; a residual is added only
    /// if there is a bias.
    pub(crate) fn forward(
        &self,
        input: Tensor<4>,
        residual: Option<Tensor<4>>,
        relu: bool,
    ) -> Tensor<4> {
        let options = ConvOptions {
            stride: self.stride,
            padding: self.padding,
            dilation: self.dilation,
            relu,
        };
        let bias = self.bias.as_ref().map(Param::val);
        let weight = (self.weight.val(), self.prepared.clone());
        ops::conv2d_prepared(input, weight, bias, residual, options)
    }

    /// With its weights in a faster form as well: they must not change any more, since that form would not change with
    /// them. So nothing but [`crate::mask_rcnn::PreparedNet`], which lets nobody change them, may hold it.
    pub(crate) fn prepared(self) -> Self {
        let [out, channels, height, width] = self.weight.val().dims();
        let steps = ([height, width], self.stride, self.dilation);
        let is_used = steps == ([3, 3], 1, 1) && ops::in_memory(&self.weight.val().device());
        let prepared = is_used.then(|| {
            let weight = to_host(self.weight.val());
            Prepared::new(&weight, [out, channels])
        });
        Self { prepared: prepared.flatten(), ..self }
    }
}

impl Norm {
    fn forward(
        &self,
        input: Tensor<4>,
        residual: Option<Tensor<4>>,
        relu: bool,
        pass: Pass,
    ) -> Tensor<4> {
        let [gamma, beta] = [&self.weight, &self.bias].map(Param::val);
        let of = Normalised { input, gamma, beta, residual, relu };
        match (self.kind, pass) {
            (NormKind::Group, _) => ops::group_norm(of, GROUPS),
            (NormKind::Batch, Pass::Training) => {
                let (result, [mean, variance]) = ops::batch_norm(of);
                update(&self.running_mean, &mean);
                update(&self.running_var, &variance);
                result
            }
            _ => {
                let [mean, variance] = [&self.running_mean, &self.running_var].map(values);
                ops::fixed_norm(of, mean, &variance)
            }
        }
    }
}

impl Linear {
    /// `[rows, in]` to `[rows, out]`.
    pub(crate) fn forward(&self, input: Tensor<2>, relu: bool) -> Tensor<2> {
        ops::linear(input, self.weight.val(), self.bias.val(), relu)
    }
}

/// A convolution, its normalisation if there is one, a residual, and the cut at zero.
pub(crate) fn conv_norm(
    (conv, norm): (&Conv, Option<&Norm>),
    input: Tensor<4>,
    residual: Option<Tensor<4>>,
    relu: bool,
    pass: Pass,
) -> Tensor<4> {
    match norm {
        Some(norm) => norm.forward(conv.forward(input, None, false), residual, relu, pass),
        None => conv.forward(input, residual, relu),
    }
}

/// What is done with a convolution whose normalisation has become part of it: nothing, or [`Conv::prepared`].
pub(crate) type Finish = fn(Conv) -> Conv;

/// The convolution that does what it and its normalisation do in inference; group normalisation stays.
pub(crate) fn fold(conv: Conv, norm: Option<Norm>, finish: Finish) -> (Conv, Option<Norm>) {
    let norm = match norm {
        Some(norm) if norm.kind != NormKind::Group => norm,
        other => return (finish(conv), other),
    };
    let device = conv.weight.val().device();
    let [out, channels, height, width] = conv.weight.val().dims();
    let [mean, variance] = [&norm.running_mean, &norm.running_var].map(values);
    let [gamma, beta] = [&norm.weight, &norm.bias].map(|param| to_host(param.val()));
    let bias = conv.bias.as_ref().map_or_else(|| vec![0.0; out], |bias| to_host(bias.val()));
    let factor: Vec<f32> =
        (0..out).map(|o| gamma[o] / (variance[o] + ops::norm::EPSILON).sqrt()).collect();
    let bias = (0..out).map(|o| (bias[o] - mean[o]) * factor[o] + beta[o]).collect();
    let mut weight = to_host(conv.weight.val());
    for (weights, factor) in weight.chunks_mut(channels * height * width).zip(&factor) {
        for weight in weights {
            *weight *= factor;
        }
    }
    let init = Init::new(&device, 0);
    let weight = init.values(weight, [out, channels, height, width]);
    (finish(Conv { weight, bias: Some(init.values(bias, [out])), ..conv }), None)
}

/// A tensor's values.
pub(crate) fn to_host<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_to_vec().expect("32-bit floats")
}

fn values(state: &RunningState<Tensor<1>>) -> Vec<f32> {
    to_host(state.value_sync())
}

fn update(state: &RunningState<Tensor<1>>, newest: &[f32]) {
    let device = state.value().device();
    let old = values(state);
    let mixed = old.iter().zip(newest).map(|(old, new)| old + MOMENTUM * (new - old));
    state.update(Tensor::from_data(TensorData::new(mixed.collect(), [newest.len()]), &device));
}

/// A normally distributed number (Box and Muller, 1958).
fn normal(rng: &mut ChaCha8Rng) -> f32 {
    use rand::RngExt;
    let radius = (-2.0 * (1.0 - rng.random::<f32>()).ln()).sqrt();
    radius * (std::f32::consts::TAU * rng.random::<f32>()).cos()
}
