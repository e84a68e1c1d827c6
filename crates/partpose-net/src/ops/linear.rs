//! Fully connected layers on slices.

use std::sync::Arc;

use burn::Tensor;
use partpose_kernels::{Matrix, MatrixMut, multiply};
use rayon::prelude::*;

use super::apply::{Backwards, Kernel, Output, View, apply};
use super::chains;
use super::conv2d::masked;

/// Columns that one task computes.
const BLOCK: usize = 128;

/// `input`, `[rows, in]`, times `weight`, `[out, in]`, plus `bias`, `[out]`; negative values cut off if `relu`.
pub fn linear(input: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>, relu: bool) -> Tensor<2> {
    if !chains::in_memory(&input.device()) {
        return chains::linear(input, weight, bias, relu);
    }
    let inputs = vec![input.into_dispatch(), weight.into_dispatch(), bias.into_dispatch()];
    apply(&Arc::new(Linear { relu }), inputs)
}

#[derive(Debug)]
struct Linear {
    relu: bool,
}

impl Kernel for Linear {
    fn forward(&self, inputs: &[View<'_>], _: bool) -> Output {
        let [rows, depth] = [inputs[0].shape[0], inputs[0].shape[1]];
        let columns = inputs[1].shape[0];
        let mut values: Vec<f32> =
            inputs[2].values.iter().copied().cycle().take(rows * columns).collect();
        let left = Matrix::dense(inputs[0].values, [rows, depth]);
        let right = Matrix::dense(inputs[1].values, [columns, depth]).transposed();
        product(&mut values, left, right, true);
        if self.relu {
            for value in &mut values {
                *value = value.max(0.0);
            }
        }
        Output { values, shape: vec![rows, columns], saved: Vec::new() }
    }

    fn backward(&self, state: &Backwards<'_>) -> Vec<Option<Vec<f32>>> {
        let [input, weight] = [&state.inputs[0], &state.inputs[1]];
        let [rows, depth] = [input.shape[0], input.shape[1]];
        let columns = weight.shape[0];
        let gradient = masked(state.gradient, state.output, self.relu);
        let gradient = Matrix::dense(&gradient, [rows, columns]);
        let of_input = state.wanted[0].then(|| {
            let mut values = vec![0.0; rows * depth];
            product(&mut values, gradient, Matrix::dense(weight.values, [columns, depth]), false);
            values
        });
        let of_weight = state.wanted[1].then(|| {
            let mut values = vec![0.0; columns * depth];
            let input = Matrix::dense(input.values, [rows, depth]);
            product(&mut values, gradient.transposed(), input, false);
            values
        });
        let of_bias = state.wanted[2].then(|| {
            let mut sums = vec![0.0; columns];
            for row in gradient.data.chunks(columns) {
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
            }
            sums
        });
        vec![of_input, of_weight, of_bias]
    }
}

/// Writes a product to a dense matrix, or adds it, blocks of columns by different threads.
fn product(out: &mut [f32], left: Matrix<'_>, right: Matrix<'_>, add: bool) {
    let [rows, columns] = [left.size[0], right.size[1]];
    let blocks = MatrixMut::dense(out, [rows, columns]).split_columns(BLOCK);
    blocks.into_par_iter().enumerate().for_each(|(i, mut block)| {
        let size = [right.size[0], block.size()[1]];
        let data = &right.data[i * BLOCK * right.strides[1]..];
        multiply(&mut block, left, Matrix { data, size, strides: right.strides }, add);
    });
}
