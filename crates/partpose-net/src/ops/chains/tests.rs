//! Chains of burn's operations against our own kernels: results and gradients.

use super::*;
use crate::ops;
use crate::ops::gradients::numbers;
use crate::ops::roi_align::Sampling;

type Operation<'a> = &'a dyn Fn(&[Tensor<4>]) -> Tensor<4>;

fn assert_close(name: &str, found: &Tensor<4>, expected: &Tensor<4>) {
    assert_eq!(found.dims(), expected.dims(), "{name}");
    let most = expected.clone().abs().max().into_scalar::<f32>().max(1.0);
    let off = (found.clone() - expected.clone()).abs().max().into_scalar::<f32>();
    assert!(off < 2e-5 * most, "{name}: off by {off} of {most}");
}

/// Compares results, and the gradients of a random sum of them.
fn compare(name: &str, shapes: &[[usize; 4]], own: Operation<'_>, chain: Operation<'_>) {
    let leaves = || -> Vec<Tensor<4>> {
        (0..).zip(shapes).map(|(i, shape)| numbers(*shape, i).require_grad()).collect()
    };
    let run = |operation: Operation<'_>| {
        let inputs = leaves();
        let result = operation(&inputs);
        let gradients = (result.clone() * numbers(result.dims(), 99)).sum().backward();
        let of = |input: &Tensor<4>| input.grad(&gradients).expect("it was asked for");
        (result, inputs.iter().map(of).collect::<Vec<_>>())
    };
    let [(result, gradients), (expected, expected_gradients)] = [run(chain), run(own)];
    assert_close(name, &result, &expected);
    for (i, (found, expected)) in gradients.iter().zip(&expected_gradients).enumerate() {
        assert_close(&format!("{name}, gradient {i}"), found, expected);
    }
}

#[test]
fn processors_are_told_from_other_devices() {
    assert!(in_memory(&Device::flex()) && in_memory(&Device::flex().autodiff()));
}

#[test]
fn convolutions_and_full_connections() {
    let shapes = [[2, 3, 7, 9], [4, 3, 3, 3], [4, 1, 1, 1], [2, 4, 7, 9]];
    let plain = ConvOptions { relu: true, ..ConvOptions::same(3) };
    let conv = |x: &[Tensor<4>]| {
        (x[0].clone(), x[1].clone(), Some(x[2].clone().reshape([4])), Some(x[3].clone()))
    };
    compare(
        "convolution",
        &shapes,
        &|x| {
            let (input, weight, bias, residual) = conv(x);
            ops::conv2d(input, weight, bias, residual, plain)
        },
        &|x| {
            let (input, weight, bias, residual) = conv(x);
            conv2d(input, weight, bias, residual, plain)
        },
    );
    for of in [
        ConvOptions { stride: 2, ..plain },
        ConvOptions { dilation: 2, padding: 2, ..plain },
        ConvOptions { padding: 0, ..plain },
    ] {
        compare(
            &format!("{of:?}"),
            &shapes[..2],
            &|x| ops::conv2d(x[0].clone(), x[1].clone(), None, None, of),
            &|x| conv2d(x[0].clone(), x[1].clone(), None, None, of),
        );
    }
    let full = |x: &[Tensor<4>]| {
        let [input, weight] =
            [(0, [5, 7]), (1, [3, 7])].map(|(i, shape)| x[i].clone().reshape(shape));
        (input, weight, x[2].clone().reshape([3]))
    };
    compare(
        "full connection",
        &[[5, 7, 1, 1], [3, 7, 1, 1], [3, 1, 1, 1]],
        &|x| {
            let (input, weight, bias) = full(x);
            ops::linear(input, weight, bias, true).reshape([5, 3, 1, 1])
        },
        &|x| {
            let (input, weight, bias) = full(x);
            linear(input, weight, bias, true).reshape([5, 3, 1, 1])
        },
    );
}

#[test]
fn normalisation() {
    let shapes = [[2, 4, 5, 7], [4, 1, 1, 1], [4, 1, 1, 1], [2, 4, 5, 7]];
    let of = |x: &[Tensor<4>]| Normalised {
        input: x[0].clone(),
        gamma: x[1].clone().reshape([4]),
        beta: x[2].clone().reshape([4]),
        residual: x.get(3).cloned(),
        relu: true,
    };
    for shapes in [&shapes[..3], &shapes[..]] {
        compare("batch", shapes, &|x| ops::batch_norm(of(x)).0, &|x| batch_norm(of(x)).0);
        compare("group", shapes, &|x| ops::group_norm(of(x), 2), &|x| group_norm(of(x), 2));
        let given = || (vec![0.1, -0.2, 0.3, 0.4], [0.5, 1.5, 1.0, 0.2]);
        compare("fixed", shapes, &|x| ops::fixed_norm(of(x), given().0, &given().1), &|x| {
            fixed_norm(of(x), given().0, &given().1)
        });
    }
    let x: Vec<Tensor<4>> = (0..).zip(&shapes).map(|(i, shape)| numbers(*shape, i)).collect();
    let [(_, own), (_, chain)] = [ops::batch_norm(of(&x)), {
        let (result, statistics) = batch_norm(of(&x));
        (result, statistics.map(crate::layers::to_host))
    }];
    for (own, chain) in own.iter().flatten().zip(chain.iter().flatten()) {
        assert!((own - chain).abs() < 1e-5, "{own} {chain}");
    }
}

#[test]
fn pooling_and_resizing() {
    let shape = [[2, 3, 7, 9]];
    for [size, stride, padding] in [[3, 2, 1], [2, 2, 0], [1, 2, 0]] {
        compare(
            "max pool",
            &shape,
            &|x| ops::max_pool(x[0].clone(), size, stride, padding),
            &|x| max_pool(x[0].clone(), size, stride, padding),
        );
    }
    compare("average", &shape, &|x| ops::average(x[0].clone()).reshape([2, 3, 1, 1]), &|x| {
        average(x[0].clone()).reshape([2, 3, 1, 1])
    });
    for (size, aligned) in [([13, 10], true), ([14, 18], false), ([3, 4], false)] {
        compare("resize", &shape, &|x| ops::resize(x[0].clone(), size, aligned), &|x| {
            resize(x[0].clone(), &Resize { size, aligned })
        });
    }
    for shapes in [[[2, 3, 4, 5], [2, 3, 7, 9]], [[1, 3, 4, 5], [1, 3, 8, 10]]] {
        compare("upsample", &shapes, &|x| ops::upsample_add(x[0].clone(), x[1].clone()), &|x| {
            upsample_add(x[0].clone(), x[1].clone())
        });
    }
}

#[test]
fn regions() {
    let regions = [
        (1, 0, [2.0, 1.0, 9.0, 8.0]),
        (0, 1, [-4.0, 3.0, 15.5, 40.0]),
        (0, 0, [0.0, 0.0, 16.0, 12.0]),
        (1, 1, [900.0, 900.0, 950.0, 950.0]),
        (0, 1, [1.0, 2.0, 20.0, 9.0]),
    ]
    .map(|(image, level, corners)| Region { image, level, corners });
    for sampling in [Sampling::Align(2), Sampling::CropAndResize] {
        for count in [regions.len(), 1] {
            let of = Read {
                scales: vec![0.5, 0.25],
                regions: regions[..count].to_vec(),
                bins: 3,
                sampling,
            };
            let all = |x: &[Tensor<4>]| {
                // So that the map that nothing is read from has a gradient too.
                let [a, b] = [0, 1].map(|i| x[i].clone().mean().reshape([1, 1, 1, 1]));
                a + b
            };
            compare(
                "regions",
                &[[2, 3, 6, 9], [2, 3, 3, 5]],
                &|x| ops::read_regions(x, &of.scales, of.regions.clone(), 3, sampling) + all(x),
                &|x| read_regions(x, &of) + all(x),
            );
        }
    }
    let none =
        Read { scales: vec![0.5], regions: Vec::new(), bins: 2, sampling: Sampling::Align(2) };
    assert_eq!(read_regions(&[numbers([1, 3, 4, 4], 1)], &none).dims(), [0, 3, 2, 2]);
}

#[test]
fn known_gradients() {
    let known = |x: &[Tensor<4>], own: bool| {
        let gradients = vec![vec![1.0, -2.0], vec![0.5, 3.0, 4.0]];
        let result = if own { ops::attach(7.0, x, gradients) } else { attach(7.0, x, gradients) };
        result.reshape([1, 1, 1, 1])
    };
    let shapes = [[1, 2, 1, 1], [1, 3, 1, 1]];
    compare("attach", &shapes, &|x| known(x, true), &|x| known(x, false));
}
