//! The network's parts against torchvision's, whose numbers `scripts/network_fixtures.py` wrote.

use burn::Tensor;
use burn::module::{Param, RunningState};
use burn::tensor::{Device, TensorData};
use serde::Deserialize;

use crate::boxes::{Corners, decode, encode, suppress};
use crate::config::{Backbone, HeadNorm, NetConfig, NormKind};
use crate::fpn::Fpn;
use crate::heads::PartHead;
use crate::layers::{Conv, Init, Norm, Pass, to_host};
use crate::ops::roi_align::{Region, Sampling};
use crate::ops::{Normalised, batch_norm, read_regions};
use crate::resnet::{Block, StageStep};

#[derive(Deserialize)]
struct Fixtures {
    resnet18: Vec<Vec<f32>>,
    resnet50: Vec<Vec<f32>>,
    pyramid: Vec<Vec<f32>>,
    part_predictor: Vec<f32>,
    normalisation: Normalisation,
    regions: Vec<f32>,
    encoded: Vec<f32>,
    decoded: Vec<f32>,
    kept: Vec<usize>,
}

#[derive(Deserialize)]
struct Normalisation {
    result: Vec<f32>,
    mean: Vec<f32>,
    variance: Vec<f32>,
    of_input: Vec<f32>,
    of_weight: Vec<f32>,
    of_bias: Vec<f32>,
}

fn fixtures() -> Fixtures {
    serde_json::from_str(include_str!("../fixtures/torchvision.json")).unwrap()
}

/// Numbers between -1 and 1: the script's rule.
fn numbers(count: usize, seed: u64) -> Vec<f32> {
    let mixed = |i: u64| ((i + seed * 7919) * 2_654_435_761) % (1 << 32);
    (0..count as u64).map(|i| ((mixed(i) >> 8) % 2001) as f32 / 1000.0 - 1.0).collect()
}

fn tensor<const D: usize>(shape: [usize; D], seed: u64, device: &Device) -> Tensor<D> {
    let values = numbers(shape.iter().product(), seed);
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// Twenty values spread over some.
fn some(values: &[f32]) -> Vec<f32> {
    values.iter().copied().step_by((values.len() / 20).max(1)).take(20).collect()
}

fn check(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let largest = expected.iter().fold(0.0f32, |most, value| most.max(value.abs()));
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        let error = (found - expected).abs();
        assert!(error <= 1e-4 * largest, "{what} {i}: {found} {expected}");
    }
}

/// Fills parameters in the order of a `PyTorch` module's state.
struct Fill(u64);

impl Fill {
    fn values<const D: usize>(&mut self, at: &Tensor<D>, adjust: impl Fn(f32) -> f32) -> Tensor<D> {
        let values = numbers(at.dims().iter().product(), self.0).into_iter().map(adjust).collect();
        self.0 += 1;
        Tensor::from_data(TensorData::new::<f32, _>(values, at.dims()), &at.device())
    }

    fn weight<const D: usize>(&mut self, weight: &mut Param<Tensor<D>>) {
        let dims = weight.val().dims();
        let fan = dims[1..].iter().product::<usize>() as f32;
        *weight = Param::from_tensor(self.values(&weight.val(), |v| v * (6.0 / fan).sqrt()));
    }

    fn bias(&mut self, bias: &mut Param<Tensor<1>>) {
        *bias = Param::from_tensor(self.values(&bias.val(), |v| 0.1 * v));
    }

    fn conv(&mut self, conv: &mut Conv) {
        self.weight(&mut conv.weight);
        if let Some(bias) = &mut conv.bias {
            self.bias(bias);
        }
    }

    fn norm(&mut self, norm: &mut Option<Norm>) {
        let norm = norm.as_mut().unwrap();
        norm.weight = Param::from_tensor(self.values(&norm.weight.val(), |v| 0.5 + 0.1 * v));
        self.bias(&mut norm.bias);
        norm.running_mean = RunningState::new(self.values(&norm.running_mean.value(), |v| 0.1 * v));
        norm.running_var =
            RunningState::new(self.values(&norm.running_var.value(), |v| 1.0 + 0.5 * v));
    }

    fn block(&mut self, block: &mut Block) {
        self.conv(&mut block.conv1);
        self.norm(&mut block.bn1);
        self.conv(&mut block.conv2);
        self.norm(&mut block.bn2);
        if let Some(conv3) = &mut block.conv3 {
            self.conv(conv3);
            self.norm(&mut block.bn3);
        }
        if let Some((conv, norm)) = &mut block.downsample {
            self.conv(conv);
            self.norm(norm);
        }
    }
}

#[test]
fn residual_networks_agree() {
    let device = Device::flex();
    let step = StageStep { stride: 2, dilation: 1 };
    let expected = fixtures();
    for (kind, expected) in
        [(Backbone::Resnet18, expected.resnet18), (Backbone::Resnet50, expected.resnet50)]
    {
        let mut net = kind.init(&mut Init::new(&device, 1), NormKind::Batch, [step; 2]);
        let mut fill = Fill(0);
        fill.conv(&mut net.conv1);
        fill.norm(&mut net.bn1);
        for layer in [&mut net.layer1, &mut net.layer2, &mut net.layer3, &mut net.layer4] {
            for block in layer {
                fill.block(block);
            }
        }
        let image = tensor([1, 3, 64, 96], 1000, &device);
        let folded = net.clone().fold(|conv| conv);
        let prepared = net.clone().fold(Conv::prepared);
        for (net, how) in [(net, "as trained"), (folded, "folded"), (prepared, "prepared")] {
            let stages = net.forward(image.clone(), 4, Pass::Inference);
            for (i, (stage, expected)) in stages.into_iter().zip(&expected).enumerate() {
                let what = format!("{kind:?} {how}, stage {i}");
                check(&what, &some(&to_host(stage)), expected);
            }
        }
    }
}

#[test]
fn pyramids_agree() {
    let device = Device::flex();
    let mut fpn = Fpn::init(&mut Init::new(&device, 1), &[8, 16, 32], 8, HeadNorm::None, 0);
    let mut fill = Fill(0);
    for blocks in [&mut fpn.inner_blocks, &mut fpn.layer_blocks] {
        for (conv, _) in blocks {
            fill.conv(conv);
        }
    }
    let sizes = [[8, 12, 20], [16, 6, 10], [32, 3, 5]];
    let maps = (1000..).zip(sizes).map(|(seed, [c, h, w])| tensor([1, c, h, w], seed, &device));
    let levels = fpn.forward(maps.collect(), Pass::Inference);
    for (level, expected) in levels.into_iter().zip(fixtures().pyramid) {
        check("pyramid", &some(&to_host(level)), &expected);
    }
}

#[test]
fn part_predictors_agree() {
    let device = Device::flex();
    let mut config = NetConfig::default();
    config.parts.convs = 0;
    config.parts.kernel = 10;
    config.parts.channels = 16;
    let mut head = PartHead::init(&mut Init::new(&device, 1), &config, 8, 5);
    let mut fill = Fill(0);
    let doubling = head.conv5_mask.as_mut().unwrap();
    fill.weight(&mut doubling.weight);
    fill.bias(&mut doubling.bias);
    fill.conv(&mut head.mask_fcn_logits);
    let hidden = head.hidden(tensor([2, 8, 5, 5], 1000, &device), Pass::Inference);
    let logits = head.logits(hidden);
    check("parts", &some(&to_host(logits)), &fixtures().part_predictor);
}

#[test]
fn normalisation_and_its_gradients_agree() {
    let device = Device::flex().autodiff();
    let expected = fixtures().normalisation;
    let shape = [2, 6, 5, 7];
    let input = tensor(shape, 1000, &device).require_grad();
    let gamma = (tensor([6], 0, &device) * 0.1 + 0.5).require_grad();
    let beta = (tensor([6], 1, &device) * 0.1).require_grad();
    let of = Normalised {
        input: input.clone(),
        gamma: gamma.clone(),
        beta: beta.clone(),
        residual: Some(tensor(shape, 1001, &device)),
        relu: true,
    };
    let (result, [mean, variance]) = batch_norm(of);
    let gradients = (result.clone() * tensor(shape, 1002, &device)).sum().backward();
    check("result", &some(&to_host(result)), &expected.result);
    check("mean", &some(&mean), &expected.mean);
    check("variance", &some(&variance), &expected.variance);
    let of_input = to_host(input.grad(&gradients).unwrap());
    check("gradient of the input", &some(&of_input), &expected.of_input);
    let [of_weight, of_bias] = [gamma, beta].map(|t| to_host(t.grad(&gradients).unwrap()));
    check("gradient of the factors", &some(&of_weight), &expected.of_weight);
    check("gradient of the summands", &some(&of_bias), &expected.of_bias);
}

#[test]
fn regions_agree() {
    let regions = [(1, [2.0, 1.0, 9.0, 8.0]), (0, [-4.0, 3.0, 15.5, 40.0]), (0, [3.0; 4])]
        .map(|(image, corners)| Region { image, level: 0, corners })
        .to_vec();
    let maps = [tensor([2, 3, 6, 9], 1000, &Device::flex())];
    let found = to_host(read_regions(&maps, &[0.5], regions, 3, Sampling::Align(2)));
    check("regions", &some(&found), &fixtures().regions);
}

fn boxes(count: usize, seed: u64) -> Vec<Corners> {
    let corners = |v: &[f32]| {
        let [x, y] = [30.0 * v[0] + 30.0, 30.0 * v[1] + 30.0];
        [x, y, x + 15.0 * v[2] + 20.0, y + 15.0 * v[3] + 20.0]
    };
    numbers(4 * count, seed).chunks(4).map(corners).collect()
}

#[test]
fn boxes_agree() {
    let factors = [10.0, 10.0, 5.0, 5.0];
    let expected = fixtures();
    let pairs = || boxes(20, 1).into_iter().zip(boxes(20, 2));
    let encoded: Vec<f32> = pairs().flat_map(|(a, b)| encode(a, b, factors)).collect();
    check("encoded", &encoded, &expected.encoded);
    let deltas = numbers(80, 3);
    let deltas = deltas.chunks(4).map(|d| [0, 1, 2, 3].map(|k| 5.0 * d[k]));
    let decoded: Vec<f32> =
        deltas.zip(boxes(20, 2)).flat_map(|(d, from)| decode(d, from, factors)).collect();
    check("decoded", &decoded, &expected.decoded);
    assert_eq!(suppress(&boxes(60, 4), 0.4, 60), expected.kept);
}
