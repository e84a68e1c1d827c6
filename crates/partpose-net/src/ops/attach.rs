//! A loss whose value and gradient are already known.
//!
//! Losses of a detector choose samples, match boxes and mask pixels: easy on slices, awkward on tensors. They are computed
//! there, together with their gradients, and attached to the tensors that they were computed from.

use std::sync::Arc;

use burn::Tensor;

use super::apply::{Backwards, Kernel, MOST_INPUTS, Output, View, apply};
use super::chains;

/// A tensor of one element with the given value, whose gradients by `tensors` are the given ones.
///
/// `gradients`: one a tensor, with as many values as it has.
///
/// # Panics
///
/// If sizes differ: a bug of the caller.
pub fn attach<const D: usize>(
    value: f32,
    tensors: &[Tensor<D>],
    gradients: Vec<Vec<f32>>,
) -> Tensor<1> {
    assert_eq!(tensors.len(), gradients.len(), "one gradient a tensor");
    if !chains::in_memory(&tensors[0].device()) {
        return chains::attach(value, tensors, gradients);
    }
    let mut parts = Vec::new();
    let mut value = value;
    let mut gradients = gradients.into_iter();
    for group in tensors.chunks(MOST_INPUTS) {
        let kernel = Attach { value, gradients: gradients.by_ref().take(group.len()).collect() };
        parts.push(apply(
            &Arc::new(kernel),
            group.iter().map(|t| t.clone().into_dispatch()).collect(),
        ));
        value = 0.0;
    }
    parts.into_iter().reduce(|sum: Tensor<1>, part| sum + part).expect("at least one tensor")
}

#[derive(Debug)]
struct Attach {
    value: f32,
    gradients: Vec<Vec<f32>>,
}

impl Kernel for Attach {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        for (input, gradient) in inputs.iter().zip(&self.gradients) {
            assert_eq!(input.values.len(), gradient.len(), "a gradient for {:?}", input.shape);
        }
        Output { values: vec![self.value], shape: vec![1], saved: Vec::new() }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let factor = state.gradient[0];
        let scaled = |values: &Vec<f32>| values.iter().map(|value| value * factor).collect();
        let wanted = self.gradients.iter().zip(&state.wanted);
        wanted.map(|(gradient, wanted)| wanted.then(|| scaled(gradient))).collect()
    }
}
