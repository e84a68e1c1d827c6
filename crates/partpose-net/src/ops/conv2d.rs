//! Convolution as an operation on tensors.

use std::borrow::Cow;
use std::sync::Arc;

use burn::Tensor;

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::chains;
use super::conv::{ConvShape, Finish, backward_bias, backward_input, backward_weight, forward};
use super::winograd::{self, Prepared};

/// How a convolution steps over its input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConvOptions {
    /// Step down and to the right.
    pub stride: usize,
    /// Zeros on all sides.
    pub padding: usize,
    /// Distance of a kernel's elements; 1 is the usual one.
    pub dilation: usize,
    /// Whether negative values become zero at the end.
    pub relu: bool,
}

impl ConvOptions {
    /// A convolution that keeps sizes, for kernels of an odd `size`.
    pub const fn same(size: usize) -> Self {
        Self { stride: 1, padding: size / 2, dilation: 1, relu: false }
    }
}

/// Convolves `input`, `[batch, in_channels, height, width]`, with `weight`,
/// `[out_channels, in_channels, kernel height, kernel width]`, and adds `bias`, `[out_channels]`, and `residual`, shaped
/// like the result; a residual needs a bias.
pub fn conv2d(
    input: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    residual: Option<Tensor<4>>,
    options: ConvOptions,
) -> Tensor<4> {
    conv2d_prepared(input, (weight, None), bias, residual, options)
}

/// The same with weights that may have been prepared, which must be those of `weight`; no gradient may be asked for then.
pub fn conv2d_prepared(
    input: Tensor<4>,
    (weight, prepared): (Tensor<4>, Option<Prepared>),
    bias: Option<Tensor<1>>,
    residual: Option<Tensor<4>>,
    options: ConvOptions,
) -> Tensor<4> {
    assert!(bias.is_some() || residual.is_none(), "a residual without a bias");
    if !chains::in_memory(&input.device()) {
        return chains::conv2d(input, weight, bias, residual, options);
    }
    let mut inputs = vec![input.into_dispatch(), weight.into_dispatch()];
    inputs.extend(bias.map(Tensor::into_dispatch));
    inputs.extend(residual.map(Tensor::into_dispatch));
    apply(&Arc::new(Convolution { options, prepared }), inputs)
}

#[derive(Debug)]
struct Convolution {
    options: ConvOptions,
    prepared: Option<Prepared>,
}

impl Convolution {
    /// Sizes; wrong ones are a bug of the network.
    fn shape(&self, inputs: &[View<'_>]) -> ConvShape {
        let [batch, in_channels, height, width] = inputs[0].dims4();
        let [out_channels, depth, kernel_height, kernel_width] = inputs[1].dims4();
        assert_eq!(in_channels, depth, "input {:?}, weight {:?}", inputs[0].shape, inputs[1].shape);
        ConvShape {
            batch,
            in_channels,
            out_channels,
            in_size: [height, width],
            kernel: [kernel_height, kernel_width],
            stride: [self.options.stride; 2],
            padding: [self.options.padding; 2],
            dilation: self.options.dilation,
        }
    }
}

impl Kernel for Convolution {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let s = self.shape(inputs);
        let finish = Finish {
            bias: inputs.get(2).map(|bias| bias.values),
            residual: inputs.get(3).map(|residual| residual.values),
            relu: self.options.relu,
        };
        let [height, width] = s.out_size();
        Output {
            values: match &self.prepared {
                Some(weights) if winograd::suits_prepared(&s) => {
                    winograd::forward_prepared(inputs[0].values, weights, finish, &s)
                }
                _ => forward(inputs[0].values, inputs[1].values, finish, &s),
            },
            shape: vec![s.batch, s.out_channels, height, width],
            saved: Vec::new(),
        }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let s = self.shape(&state.inputs);
        let [input, weight] = [&state.inputs[0], &state.inputs[1]].map(|view| view.values);
        let gradient = masked(state.gradient, state.output, self.options.relu);
        let wanted = |i: usize| state.wanted.get(i) == Some(&true);
        let mut gradients = vec![
            wanted(0).then(|| backward_input(&gradient, weight, &s)),
            wanted(1).then(|| backward_weight(input, &gradient, &s)),
            wanted(2).then(|| backward_bias(&gradient, &s)),
            wanted(3).then(|| gradient.to_vec()),
        ];
        gradients.truncate(state.inputs.len());
        gradients
    }
}

/// The gradient before the cut at zero: none where the output was cut off.
pub(super) fn masked<'a>(gradient: &'a [f32], output: &[f32], relu: bool) -> Cow<'a, [f32]> {
    if !relu {
        return Cow::Borrowed(gradient);
    }
    let pairs = gradient.iter().zip(output);
    Cow::Owned(pairs.map(|(value, output)| if *output > 0.0 { *value } else { 0.0 }).collect())
}
