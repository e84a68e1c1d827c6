//! The operations as differentiable functions of burn's tensors.
//!
//! An extension of burn's backends with kernels of our own for its CPU backend. Gradients are registered here, so that
//! training sees one operation each.

use burn::Tensor;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::TensorData;

use super::conv::{self, ConvShape};
use super::roi_align::{self, Region, RoiShape};

/// Convolves `input`, `[batch, in_channels, height, width]`, with `weight`,
/// `[out_channels, in_channels, kernel height, kernel width]`, and adds `bias`, `[out_channels]`.
pub fn conv2d(
    input: Tensor<4>,
    weight: Tensor<4>,
    bias: Option<Tensor<1>>,
    stride: [usize; 2],
    padding: [usize; 2],
) -> Tensor<4> {
    let [input, weight] = [input, weight].map(Tensor::into_dispatch);
    let product = match bias {
        Some(bias) => {
            let bias = bias.into_dispatch();
            <Dispatch as Operations>::convolve_and_add(input, weight, bias, stride, padding)
        }
        None => <Dispatch as Operations>::convolve(input, weight, stride, padding),
    };
    Tensor::from_dispatch(product)
}

/// Reads regions of `features`, `[batch, channels, height, width]`, into `[regions, channels, bins, bins]`.
///
/// `points` are averaged along either side of a bin; `scale` is cells of the feature map a pixel of the boxes.
pub fn roi_align(
    features: Tensor<4>,
    regions: Vec<Region>,
    bins: usize,
    points: usize,
    scale: f32,
) -> Tensor<4> {
    let features = features.into_dispatch();
    Tensor::from_dispatch(<Dispatch as Operations>::align(features, regions, bins, points, scale))
}

/// What networks are built from.
#[backend_extension(Flex, Autodiff)]
pub(crate) trait Operations: Backend {
    fn convolve(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FloatTensor<Self>;

    fn convolve_and_add(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FloatTensor<Self>;

    fn align(
        features: FloatTensor<Self>,
        regions: Vec<Region>,
        bins: usize,
        points: usize,
        scale: f32,
    ) -> FloatTensor<Self>;
}

/// The gradients of [`Operations`].
pub(crate) trait Kernels: Operations {
    fn input_gradient(
        gradient: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        s: &ConvShape,
    ) -> FloatTensor<Self>;

    fn weight_gradient(
        gradient: FloatTensor<Self>,
        input: FloatTensor<Self>,
        s: &ConvShape,
    ) -> FloatTensor<Self>;

    fn bias_gradient(gradient: FloatTensor<Self>, s: &ConvShape) -> FloatTensor<Self>;

    fn align_gradient(
        gradient: FloatTensor<Self>,
        regions: &[Region],
        s: &RoiShape,
    ) -> FloatTensor<Self>;
}

impl Operations for Flex {
    fn convolve(
        input: FlexTensor,
        weight: FlexTensor,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FlexTensor {
        let s = conv_shape(&input, &weight, stride, padding);
        let values = with_slice(&input, |input| {
            with_slice(&weight, |weight| conv::forward(input, weight, None, &s))
        });
        output(values, &s)
    }

    fn convolve_and_add(
        input: FlexTensor,
        weight: FlexTensor,
        bias: FlexTensor,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FlexTensor {
        let s = conv_shape(&input, &weight, stride, padding);
        let values = with_slice(&input, |input| {
            with_slice(&weight, |weight| {
                with_slice(&bias, |bias| conv::forward(input, weight, Some(bias), &s))
            })
        });
        output(values, &s)
    }

    fn align(
        features: FlexTensor,
        regions: Vec<Region>,
        bins: usize,
        points: usize,
        scale: f32,
    ) -> FlexTensor {
        let s = roi_shape(&features, bins, points, scale);
        let values = with_slice(&features, |features| roi_align::forward(features, &regions, &s));
        tensor(values, &[regions.len(), s.channels, bins, bins])
    }
}

impl Kernels for Flex {
    fn input_gradient(gradient: FlexTensor, weight: FlexTensor, s: &ConvShape) -> FlexTensor {
        let values = with_slice(&gradient, |gradient| {
            with_slice(&weight, |weight| conv::backward_input(gradient, weight, s))
        });
        tensor(values, &[s.batch, s.in_channels, s.in_size[0], s.in_size[1]])
    }

    fn weight_gradient(gradient: FlexTensor, input: FlexTensor, s: &ConvShape) -> FlexTensor {
        let values = with_slice(&gradient, |gradient| {
            with_slice(&input, |input| conv::backward_weight(input, gradient, s))
        });
        tensor(values, &[s.out_channels, s.in_channels, s.kernel[0], s.kernel[1]])
    }

    fn bias_gradient(gradient: FlexTensor, s: &ConvShape) -> FlexTensor {
        let values = with_slice(&gradient, |gradient| conv::backward_bias(gradient, s));
        tensor(values, &[s.out_channels])
    }

    fn align_gradient(gradient: FlexTensor, regions: &[Region], s: &RoiShape) -> FlexTensor {
        let values = with_slice(&gradient, |gradient| roi_align::backward(gradient, regions, s));
        tensor(values, &[s.batch, s.channels, s.size[0], s.size[1]])
    }
}

impl<B: Kernels, C: CheckpointStrategy> Operations for Autodiff<B, C> {
    fn convolve(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Convolve;

        impl<B: Kernels> Backward<B, 2> for Convolve {
            type State = (FloatTensor<B>, FloatTensor<B>, ConvShape);

            fn backward(
                self,
                ops: Ops<Self::State, 2>,
                grads: &mut Gradients,
                _: &mut Checkpointer,
            ) {
                let (input, weight, s) = ops.state;
                let [of_input, of_weight] = ops.parents;
                let gradient = grads.consume::<B>(&ops.node);
                if let Some(node) = of_input {
                    grads.register::<B>(node.id, B::input_gradient(gradient.clone(), weight, &s));
                }
                if let Some(node) = of_weight {
                    grads.register::<B>(node.id, B::weight_gradient(gradient, input, &s));
                }
            }
        }

        let s = conv_shape(input.primitive(), weight.primitive(), stride, padding);
        let nodes = [input.node(), weight.node()];
        let [input, weight] = [input.into_primitive(), weight.into_primitive()];
        match Convolve.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let state = (input.clone(), weight.clone(), s);
                prep.finish(state, B::convolve(input, weight, stride, padding))
            }
            OpsKind::UnTracked(prep) => prep.finish(B::convolve(input, weight, stride, padding)),
        }
    }

    fn convolve_and_add(
        input: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        stride: [usize; 2],
        padding: [usize; 2],
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct ConvolveAndAdd;

        impl<B: Kernels> Backward<B, 3> for ConvolveAndAdd {
            type State = (FloatTensor<B>, FloatTensor<B>, ConvShape);

            fn backward(
                self,
                ops: Ops<Self::State, 3>,
                grads: &mut Gradients,
                _: &mut Checkpointer,
            ) {
                let (input, weight, s) = ops.state;
                let [of_input, of_weight, of_bias] = ops.parents;
                let gradient = grads.consume::<B>(&ops.node);
                if let Some(node) = of_input {
                    grads.register::<B>(node.id, B::input_gradient(gradient.clone(), weight, &s));
                }
                if let Some(node) = of_weight {
                    grads.register::<B>(node.id, B::weight_gradient(gradient.clone(), input, &s));
                }
                if let Some(node) = of_bias {
                    grads.register::<B>(node.id, B::bias_gradient(gradient, &s));
                }
            }
        }

        let s = conv_shape(input.primitive(), weight.primitive(), stride, padding);
        let nodes = [input.node(), weight.node(), bias.node()];
        let [input, weight, bias] =
            [input.into_primitive(), weight.into_primitive(), bias.into_primitive()];
        match ConvolveAndAdd.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => {
                let state = (input.clone(), weight.clone(), s);
                prep.finish(state, B::convolve_and_add(input, weight, bias, stride, padding))
            }
            OpsKind::UnTracked(prep) => {
                prep.finish(B::convolve_and_add(input, weight, bias, stride, padding))
            }
        }
    }

    fn align(
        features: FloatTensor<Self>,
        regions: Vec<Region>,
        bins: usize,
        points: usize,
        scale: f32,
    ) -> FloatTensor<Self> {
        #[derive(Debug)]
        struct Align;

        impl<B: Kernels> Backward<B, 1> for Align {
            type State = (Vec<Region>, RoiShape);

            fn backward(
                self,
                ops: Ops<Self::State, 1>,
                grads: &mut Gradients,
                _: &mut Checkpointer,
            ) {
                let (regions, s) = ops.state;
                let [of_features] = ops.parents;
                let gradient = grads.consume::<B>(&ops.node);
                if let Some(node) = of_features {
                    grads.register::<B>(node.id, B::align_gradient(gradient, &regions, &s));
                }
            }
        }

        let s = roi_shape(features.primitive(), bins, points, scale);
        let nodes = [features.node()];
        let aligned = B::align(features.into_primitive(), regions.clone(), bins, points, scale);
        match Align.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish((regions, s), aligned),
            OpsKind::UnTracked(prep) => prep.finish(aligned),
        }
    }
}

/// Sizes of a convolution; wrong ones are a bug of the network.
fn conv_shape(
    input: &impl TensorMetadata,
    weight: &impl TensorMetadata,
    stride: [usize; 2],
    padding: [usize; 2],
) -> ConvShape {
    let [batch, in_channels, height, width] = input.shape().dims::<4>();
    let [out_channels, depth, kernel_height, kernel_width] = weight.shape().dims::<4>();
    assert_eq!(in_channels, depth, "input {:?}, weight {:?}", input.shape(), weight.shape());
    ConvShape {
        batch,
        in_channels,
        out_channels,
        in_size: [height, width],
        kernel: [kernel_height, kernel_width],
        stride,
        padding,
    }
}

fn roi_shape(features: &impl TensorMetadata, bins: usize, points: usize, scale: f32) -> RoiShape {
    let [batch, channels, height, width] = features.shape().dims::<4>();
    RoiShape { batch, channels, size: [height, width], bins, points, scale }
}

fn with_slice<T>(tensor: &FlexTensor, use_it: impl FnOnce(&[f32]) -> T) -> T {
    match tensor.as_slice::<f32>() {
        Some(values) => use_it(values),
        None => use_it(tensor.to_contiguous().as_slice().expect("32-bit floats without gaps")),
    }
}

fn output(values: Vec<f32>, s: &ConvShape) -> FlexTensor {
    let [height, width] = s.out_size();
    tensor(values, &[s.batch, s.out_channels, height, width])
}

fn tensor(values: Vec<f32>, shape: &[usize]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape.to_vec()))
}
