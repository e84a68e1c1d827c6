//! Our convolution beside burn's, forward and with both gradients, on layers of the network.

use burn::Tensor;
use burn::tensor::{Device, Distribution, module, ops::ConvOptions};
use partpose_net::ops::conv2d;

/// Batch, channels in and out, height, width, kernel, stride.
const LAYERS: [[usize; 7]; 6] = [
    [1, 3, 64, 192, 640, 7, 2],
    [1, 64, 64, 48, 160, 3, 1],
    [1, 128, 128, 48, 160, 3, 1],
    [1, 64, 128, 48, 160, 3, 2],
    [1, 256, 128, 48, 160, 1, 1],
    [32, 128, 128, 14, 14, 3, 1],
];

fn main() {
    divan::main();
}

fn tensors(layer: [usize; 7], device: &Device) -> [Tensor<4>; 2] {
    let [n, c, o, h, w, k, _] = layer;
    let random = |shape| Tensor::random(shape, Distribution::Default, device);
    [random([n, c, h, w]), random([o, c, k, k])]
}

fn run(layer: [usize; 7], own: bool, train: bool) {
    let device = if train { Device::flex().autodiff() } else { Device::flex() };
    let [input, weight] = tensors(layer, &device);
    let [k, s] = [layer[5], layer[6]];
    let [input, weight] =
        if train { [input.require_grad(), weight.require_grad()] } else { [input, weight] };
    let output = if own {
        conv2d(
            input,
            weight,
            None,
            None,
            partpose_net::ops::ConvOptions { stride: s, ..partpose_net::ops::ConvOptions::same(k) },
        )
    } else {
        let options = ConvOptions::new([s, s], [k / 2, k / 2], [1, 1], 1);
        module::conv2d(input, weight, None, options)
    };
    if train {
        divan::black_box(output.sum().backward());
    } else {
        divan::black_box(output.into_data());
    }
}

#[divan::bench(args = LAYERS, sample_count = 10)]
fn forward_ours(layer: [usize; 7]) {
    run(layer, true, false);
}

#[divan::bench(args = LAYERS, sample_count = 10)]
fn forward_burn(layer: [usize; 7]) {
    run(layer, false, false);
}

#[divan::bench(args = LAYERS, sample_count = 10)]
fn training_ours(layer: [usize; 7]) {
    run(layer, true, true);
}

#[divan::bench(args = LAYERS, sample_count = 10)]
fn training_burn(layer: [usize; 7]) {
    run(layer, false, true);
}
