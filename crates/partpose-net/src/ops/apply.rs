//! Operations on slices as differentiable functions of burn's tensors.
//!
//! An extension of burn's backends for its CPU backend: an operation implements [`Kernel`] on slices, forward and
//! backward, and [`apply`] registers it, so that training sees one step for what may be a whole chain of arithmetic.

use std::fmt::Debug;
use std::sync::Arc;

use burn::Tensor;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::flex::FlexTensor;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::TensorData;

/// Most tensors that an operation takes.
pub(crate) const MOST_INPUTS: usize = 6;

/// A tensor's values, row by row, and its shape.
#[derive(Clone, Debug)]
pub(crate) struct View<'a> {
    pub(crate) values: &'a [f32],
    pub(crate) shape: Vec<usize>,
}

impl View<'_> {
    /// The shape of a tensor of four axes; another number of axes is a bug of the network.
    pub(crate) fn dims4(&self) -> [usize; 4] {
        self.shape
            .as_slice()
            .try_into()
            .unwrap_or_else(|_| panic!("not four axes: {:?}", self.shape))
    }
}

/// What an operation computes.
#[derive(Debug, Default)]
pub(crate) struct Output {
    pub(crate) values: Vec<f32>,
    pub(crate) shape: Vec<usize>,
    /// What its gradient needs besides inputs and output.
    pub(crate) saved: Vec<f32>,
}

/// What the gradient of an operation is computed from.
#[derive(Debug)]
pub(crate) struct Backwards<'a> {
    pub(crate) inputs: Vec<View<'a>>,
    pub(crate) output: &'a [f32],
    pub(crate) saved: &'a [f32],
    /// Of the loss by the output.
    pub(crate) gradient: &'a [f32],
    /// Which inputs' gradients are asked for.
    pub(crate) wanted: Vec<bool>,
}

/// A differentiable operation on slices.
pub(crate) trait Kernel: Debug + Send + Sync + 'static {
    /// The result; `tracked` says that its gradient will be asked for.
    fn forward(&self, inputs: &[View<'_>], tracked: bool) -> Output;

    /// Gradients by the inputs, each shaped like it, `None` where not wanted.
    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>>;
}

/// Applies an operation to one to [`MOST_INPUTS`] tensors.
pub(crate) fn apply<const D: usize>(
    kernel: &Arc<impl Kernel>,
    inputs: Vec<FloatTensor<Dispatch>>,
) -> Tensor<D> {
    let count = inputs.len();
    assert!((1..=MOST_INPUTS).contains(&count), "an operation on {count} tensors");
    let mut all = inputs;
    all.resize(MOST_INPUTS, all[0].clone());
    let [a, b, c, d, e, f] = all.try_into().expect("it was resized");
    let kernel: Arc<dyn Kernel> = kernel.clone();
    Tensor::from_dispatch(<Dispatch as Operations>::operate(kernel, count, a, b, c, d, e, f))
}

/// What networks are built from: a kernel on the first `count` of some tensors.
#[backend_extension(Flex, Autodiff)]
pub(crate) trait Operations: Backend {
    #[allow(clippy::too_many_arguments)]
    fn operate(
        kernel: Arc<dyn Kernel>,
        count: usize,
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        d: FloatTensor<Self>,
        e: FloatTensor<Self>,
        f: FloatTensor<Self>,
    ) -> FloatTensor<Self>;
}

/// Backends whose tensors lie in memory.
pub(crate) trait InMemory: Operations {
    fn forward(
        kernel: &dyn Kernel,
        inputs: &[FloatTensor<Self>],
        tracked: bool,
    ) -> (FloatTensor<Self>, Vec<f32>);

    fn backward(
        kernel: &dyn Kernel,
        saved: &Saved<Self>,
        gradient: &FloatTensor<Self>,
        wanted: Vec<bool>,
    ) -> Vec<Option<FloatTensor<Self>>>;
}

/// What the backward step keeps.
#[derive(Clone, Debug)]
pub(crate) struct Saved<B: Backend> {
    inputs: Vec<FloatTensor<B>>,
    output: FloatTensor<B>,
    values: Arc<Vec<f32>>,
}

impl Operations for Flex {
    fn operate(
        kernel: Arc<dyn Kernel>,
        count: usize,
        a: FlexTensor,
        b: FlexTensor,
        c: FlexTensor,
        d: FlexTensor,
        e: FlexTensor,
        f: FlexTensor,
    ) -> FlexTensor {
        <Flex as InMemory>::forward(&*kernel, &[a, b, c, d, e, f][..count], false).0
    }
}

impl InMemory for Flex {
    fn forward(
        kernel: &dyn Kernel,
        inputs: &[FlexTensor],
        tracked: bool,
    ) -> (FlexTensor, Vec<f32>) {
        let dense: Vec<FlexTensor> = inputs.iter().map(without_gaps).collect();
        let views: Vec<View<'_>> = dense.iter().map(view).collect();
        let output = kernel.forward(&views, tracked);
        (tensor(output.values, &output.shape), output.saved)
    }

    fn backward(
        kernel: &dyn Kernel,
        saved: &Saved<Self>,
        gradient: &FlexTensor,
        wanted: Vec<bool>,
    ) -> Vec<Option<FlexTensor>> {
        let dense: Vec<FlexTensor> = saved.inputs.iter().map(without_gaps).collect();
        let [output, gradient] = [&saved.output, gradient].map(without_gaps);
        let inputs: Vec<View<'_>> = dense.iter().map(view).collect();
        let state = Backwards {
            inputs,
            output: view(&output).values,
            saved: &saved.values,
            gradient: view(&gradient).values,
            wanted,
        };
        let gradients = kernel.backward(&state);
        let shaped = gradients.into_iter().zip(&state.inputs);
        shaped.map(|(values, input)| Some(tensor(values?, &input.shape))).collect()
    }
}

impl<B: InMemory, C: CheckpointStrategy> Operations for Autodiff<B, C> {
    fn operate(
        kernel: Arc<dyn Kernel>,
        count: usize,
        a: FloatTensor<Self>,
        b: FloatTensor<Self>,
        c: FloatTensor<Self>,
        d: FloatTensor<Self>,
        e: FloatTensor<Self>,
        f: FloatTensor<Self>,
    ) -> FloatTensor<Self> {
        match count {
            1 => register::<B, C, 1>(kernel, [a]),
            2 => register::<B, C, 2>(kernel, [a, b]),
            3 => register::<B, C, 3>(kernel, [a, b, c]),
            4 => register::<B, C, 4>(kernel, [a, b, c, d]),
            5 => register::<B, C, 5>(kernel, [a, b, c, d, e]),
            _ => register::<B, C, 6>(kernel, [a, b, c, d, e, f]),
        }
    }
}

/// The backward step of a kernel.
#[derive(Debug)]
struct Step;

impl<B: InMemory, const N: usize> Backward<B, N> for Step {
    type State = (Arc<dyn Kernel>, Saved<B>);

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let (kernel, saved) = ops.state;
        let gradient = grads.consume::<B>(&ops.node);
        let wanted = ops.parents.iter().map(Option::is_some).collect();
        let gradients = B::backward(&*kernel, &saved, &gradient, wanted);
        for (node, gradient) in ops.parents.into_iter().zip(gradients) {
            if let (Some(node), Some(gradient)) = (node, gradient) {
                grads.register::<B>(node.id, gradient);
            }
        }
    }
}

// The methods' type is private to burn.
#[allow(clippy::redundant_closure_for_method_calls)]
fn register<B: InMemory, C: CheckpointStrategy, const N: usize>(
    kernel: Arc<dyn Kernel>,
    inputs: [FloatTensor<Autodiff<B, C>>; N],
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    match Backward::<B, N>::prepare::<C>(Step, nodes).compute_bound().stateful() {
        OpsKind::Tracked(prep) => {
            let (output, values) = B::forward(&*kernel, &inputs, true);
            let (inputs, values) = (inputs.to_vec(), Arc::new(values));
            let saved = Saved { inputs, output: output.clone(), values };
            prep.finish((kernel, saved), output)
        }
        OpsKind::UnTracked(prep) => prep.finish(B::forward(&*kernel, &inputs, false).0),
    }
}

fn without_gaps(tensor: &FlexTensor) -> FlexTensor {
    if tensor.as_slice::<f32>().is_some() { tensor.clone() } else { tensor.to_contiguous() }
}

fn view(tensor: &FlexTensor) -> View<'_> {
    let values = tensor.as_slice().expect("32-bit floats without gaps");
    View { values, shape: tensor.shape().to_vec() }
}

fn tensor(values: Vec<f32>, shape: &[usize]) -> FlexTensor {
    FlexTensor::from_data(TensorData::new(values, shape.to_vec()))
}
