//! The gradient of every operation against central differences.

use burn::Tensor;
use burn::tensor::{Device, TensorData};

use super::roi_align::{Region, Sampling};
use super::*;

pub(super) fn numbers(shape: [usize; 4], seed: u32) -> Tensor<4> {
    let hash = |i: u32| (i ^ seed.wrapping_mul(977)).wrapping_mul(2_654_435_761) >> 16;
    let count = shape.iter().product::<usize>() as u32;
    let values = (0..count).map(|i| (hash(i) % 2001) as f32 / 1000.0 - 1.0).collect();
    Tensor::from_data(TensorData::new(values, shape), &Device::flex().autodiff())
}

/// Compares the slope of a random sum of the results along a random direction with the gradient's.
fn check(name: &str, shapes: &[[usize; 4]], operation: &dyn Fn(&[Tensor<4>]) -> Tensor<4>) {
    let at: Vec<Tensor<4>> = (0..).zip(shapes).map(|(i, shape)| numbers(*shape, i)).collect();
    let sum = |inputs: &[Tensor<4>]| -> Tensor<1> {
        let result = operation(inputs);
        let weights = numbers(result.dims(), 99);
        (result * weights).sum()
    };
    let leaves: Vec<Tensor<4>> = at.iter().map(|input| input.clone().require_grad()).collect();
    let gradients = sum(&leaves).backward();
    for (i, leaf) in leaves.iter().enumerate() {
        let direction = numbers(shapes[i], 50 + i as u32);
        let gradient = Tensor::from_inner(leaf.grad(&gradients).expect("it was asked for"));
        let expected: f32 = (gradient * direction.clone()).sum().into_scalar();
        let step = 1e-2;
        let moved = |step: f32| -> f32 {
            let mut inputs = at.clone();
            inputs[i] = inputs[i].clone() + direction.clone() * step;
            sum(&inputs).into_scalar()
        };
        let found = (moved(step) - moved(-step)) / (2.0 * step);
        let scale = expected.abs().max(0.5);
        assert!((found - expected).abs() < 0.02 * scale, "{name}, input {i}: {found} {expected}");
    }
}

#[test]
fn convolutions() {
    let plain = ConvOptions::same(3);
    let shapes = [[2, 3, 7, 9], [4, 3, 3, 3], [4, 1, 1, 1], [2, 4, 7, 9]];
    check("bias and residual", &shapes, &|x| {
        let bias = Some(x[2].clone().reshape([4]));
        conv2d(x[0].clone(), x[1].clone(), bias, Some(x[3].clone()), plain)
    });
    for options in [
        ConvOptions { stride: 2, ..plain },
        ConvOptions { dilation: 2, padding: 2, ..plain },
        ConvOptions { padding: 0, ..plain },
    ] {
        let name = format!("{options:?}");
        check(&name, &shapes[..2], &|x| conv2d(x[0].clone(), x[1].clone(), None, None, options));
    }
    check("by Winograd's way", &[[1, 24, 32, 32], [24, 24, 3, 3]], &|x| {
        conv2d(x[0].clone(), x[1].clone(), None, None, plain)
    });
    // Far from the cut, so that no step crosses it.
    check("cut off at zero", &shapes[..2], &|x| {
        let bias = Tensor::from_data([40.0, -40.0, 40.0, -40.0], &x[0].device());
        conv2d(x[0].clone(), x[1].clone(), Some(bias), None, ConvOptions { relu: true, ..plain })
    });
}

#[test]
fn full_connections() {
    check("linear", &[[5, 7, 1, 1], [3, 7, 1, 1], [3, 1, 1, 1]], &|x| {
        let [input, weight] =
            [(0, [5, 7]), (1, [3, 7])].map(|(i, shape)| x[i].clone().reshape(shape));
        linear(input, weight, x[2].clone().reshape([3]), false).reshape([5, 3, 1, 1])
    });
}

#[test]
fn normalisation() {
    let channels = 4;
    let shapes =
        [[2, channels, 5, 7], [channels, 1, 1, 1], [channels, 1, 1, 1], [2, channels, 5, 7]];
    let of = |x: &[Tensor<4>]| Normalised {
        input: x[0].clone(),
        gamma: x[1].clone().reshape([channels]),
        beta: x[2].clone().reshape([channels]),
        residual: x.get(3).cloned(),
        relu: false,
    };
    for shapes in [&shapes[..3], &shapes[..]] {
        check("batch", shapes, &|x| batch_norm(of(x)).0);
        check("group", shapes, &|x| group_norm(of(x), 2));
        check("fixed", shapes, &|x| fixed_norm(of(x), vec![0.1; channels], &[0.5; 4]));
    }
    check("cut off at zero", &shapes[..1], &|x| {
        let [gamma, beta] = [[1.0; 4], [30.0, -30.0, 30.0, -30.0]]
            .map(|values| Tensor::from_data(values, &x[0].device()));
        batch_norm(Normalised { input: x[0].clone(), gamma, beta, residual: None, relu: true }).0
    });
}

#[test]
fn pooling_and_resizing() {
    let shape = [[2, 3, 7, 9]];
    // Values far apart, so that no step changes which is the largest.
    let spread = |x: &Tensor<4>| {
        let count = x.dims().iter().product::<usize>();
        let order: Vec<f32> = (0..count).map(|i| ((i * 37) % count) as f32).collect();
        x.clone() + Tensor::from_data(TensorData::new(order, x.dims()), &x.device()) * 3.0
    };
    check("max pool", &shape, &|x| max_pool(spread(&x[0]), 3, 2, 1) * 0.1);
    check("max pool", &shape, &|x| max_pool(spread(&x[0]), 2, 2, 0) * 0.1);
    check("average", &shape, &|x| average(x[0].clone()).reshape([2, 3, 1, 1]));
    check("resize", &shape, &|x| resize(x[0].clone(), [13, 10], true));
    check("resize", &shape, &|x| resize(x[0].clone(), [14, 18], false));
    check("upsample", &[[2, 3, 4, 5], [2, 3, 7, 9]], &|x| upsample_add(x[0].clone(), x[1].clone()));
    check("upsample", &[[1, 3, 4, 5], [1, 3, 8, 10]], &|x| {
        upsample_add(x[0].clone(), x[1].clone())
    });
}

#[test]
fn regions() {
    let regions = vec![
        Region { image: 1, level: 0, corners: [2.0, 1.0, 9.0, 8.0] },
        Region { image: 0, level: 1, corners: [-4.0, 3.0, 15.5, 40.0] },
        Region { image: 0, level: 0, corners: [0.0, 0.0, 16.0, 12.0] },
    ];
    for sampling in [Sampling::Align(2), Sampling::CropAndResize] {
        check("regions", &[[2, 3, 6, 9], [2, 3, 3, 5]], &|x| {
            read_regions(x, &[0.5, 0.25], regions.clone(), 3, sampling)
        });
    }
}

#[test]
fn known_gradients() {
    check("attach", &[[1, 2, 1, 1]], &|x| {
        // The sum of squares.
        let values: Vec<f32> = x[0].clone().into_data().try_to_vec().expect("floats");
        let gradient = values.iter().map(|value| 2.0 * value).collect();
        let value = values.iter().map(|value| value * value).sum();
        attach(value, &x[..1], vec![gradient]).reshape([1, 1, 1, 1])
    });
}
