//! The network as a whole: every configuration runs, learns, and says the same twice.

mod scenes;

use burn::Tensor;
use burn::module::Module;
use burn::optim::momentum::MomentumConfig;
use burn::optim::{GradientsParams, SgdConfig};
use burn::tensor::Device;
use partpose_net::config::{
    Backbone, HeadNorm, Neck, NetConfig, NormKind, PartUpscale, RegionConfig, RegionKind,
};
use partpose_net::{Losses, MaskRcnn, PreparedNet, Target, boxes, weights};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn losses_of(net: &MaskRcnn, images: &Tensor<4>, targets: &[Target]) -> Losses {
    net.losses(images.clone(), targets, &mut ChaCha8Rng::seed_from_u64(7))
}

fn value(loss: &Tensor<1>) -> f32 {
    loss.clone().into_scalar()
}

/// One step and one detection of a configuration.
fn check(config: &NetConfig) {
    let device = Device::flex().autodiff();
    let net = config.init(&device, 1);
    let (images, targets) = scenes::batch(1, &device);
    let losses = losses_of(&net, &images, &targets);
    let total = losses.total(&config.loss);
    assert!(value(&total).is_finite() && value(&losses.mask) > 0.5, "{config:?}: {losses:?}");
    assert_eq!(losses.model.is_some(), !config.models.is_empty());
    assert_eq!(losses.extent.is_some(), config.extents);
    let gradients = GradientsParams::from_grads(total.backward(), &net);
    assert!(gradients.len() > 20, "{} gradients", gradients.len());
    let plain = net.valid();
    let image = images.without_autodiff();
    let found = plain.detect(image.clone(), scenes::SIZE);
    let prepared = PreparedNet::new(&net).detect(image.clone(), scenes::SIZE);
    let folded = plain.fold().detect(image, scenes::SIZE);
    assert_eq!([found.len(); 2], [folded.len(), prepared.len()]);
    let cells = config.parts.kernel * config.parts.kernel;
    for (a, b) in found.iter().zip(&folded).chain(found.iter().zip(&prepared)) {
        assert!((a.score - b.score).abs() < 1e-3, "{} {}", a.score, b.score);
        assert_eq!(a.probabilities.len(), 30 * cells);
        let sum: f32 = (0..30).map(|k| a.probabilities[k * cells]).sum();
        assert!((sum - 1.0).abs() < 1e-4);
        assert_eq!(a.models.as_ref().map(Vec::len), (!config.models.is_empty()).then_some(2));
    }
}

/// The default, so small that a test can run many of it.
fn small() -> NetConfig {
    let neck = Neck::Fpn { channels: 32, finest: 3, coarsest: 7 };
    let mut config = NetConfig { neck, ..NetConfig::default() };
    config.parts.channels = 32;
    config.boxes.width = 64;
    config.boxes.max_detections = 5;
    config
}

#[test]
fn every_kernel_runs() {
    for (kernel, part_cells) in [(14, 14), (28, 14), (42, 21), (42, 14), (56, 28)] {
        let mut config = small();
        config.parts.kernel = kernel;
        config.regions.part_cells = part_cells;
        check(&config);
    }
}

#[test]
fn every_neck_norm_and_head_runs() {
    let fine = NetConfig { neck: Neck::Fpn { channels: 32, finest: 2, coarsest: 6 }, ..small() };
    let crop = RegionConfig { kind: RegionKind::CropAndResize, ..RegionConfig::default() };
    let [c4, atrous] = [16, 8].map(|stride| {
        let mut config = NetConfig { neck: Neck::C4 { stride }, regions: crop, ..small() };
        config.parts.upscale = PartUpscale::First;
        config.parts.kernel = 14;
        config
    });
    let group = NetConfig { norm: NormKind::Group, head_norm: HeadNorm::Group, ..small() };
    let frozen = NetConfig { norm: NormKind::Frozen, head_norm: HeadNorm::None, ..small() };
    let heads = NetConfig { models: vec!["a".into(), "b".into()], extents: true, ..small() };
    let deep = NetConfig { backbone: Backbone::Resnet50, regions: crop, ..small() };
    for config in [fine, c4, atrous, group, frozen, heads, deep] {
        check(&config);
    }
}

#[test]
fn the_papers_network_runs() {
    let mut config = NetConfig::paper();
    config.boxes.samples = 4;
    config.rpn.training.after = 8;
    config.rpn.inference.after = 2;
    config.parts.channels = 16;
    check(&config);
}

#[test]
fn the_papers_configuration_survives_its_file() {
    for config in [NetConfig::paper(), NetConfig::default()] {
        let text = serde_json::to_string(&config).unwrap();
        assert_eq!(serde_json::from_str::<NetConfig>(&text).unwrap(), config);
    }
    assert!(serde_json::from_str::<NetConfig>(r#"{"backbon": "resnet18"}"#).is_err());
}

#[test]
fn images_without_vehicles_teach_background_only() {
    let device = Device::flex().autodiff();
    let config = small();
    let net = config.init(&device, 1);
    let (images, _) = scenes::batch(1, &device);
    let whole = [0.0, 0.0, scenes::SIZE[0] as f32, scenes::SIZE[1] as f32];
    for ignore in [vec![], vec![whole]] {
        let all_ignored = !ignore.is_empty();
        let target = Target { ignore, ..scenes::empty() };
        let losses = losses_of(&net, &images, &[target]);
        let zero = |loss: &Tensor<1>| value(loss).abs() == 0.0;
        assert!([&losses.rpn_box, &losses.boxes, &losses.mask].into_iter().all(zero));
        assert_eq!(zero(&losses.class), all_ignored);
        let _ = losses.total(&config.loss).backward();
    }
}

#[test]
fn the_same_seed_gives_the_same_losses_on_any_number_of_threads() {
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let device = Device::flex().autodiff();
            let config = small();
            let mut net = config.init(&device, 5);
            let (images, targets) = scenes::batch(2, &device);
            let mut optimizer = SgdConfig::new().init();
            let mut totals = Vec::new();
            for _ in 0..3 {
                let total = losses_of(&net, &images, &targets).total(&config.loss);
                totals.push(value(&total));
                let gradients = GradientsParams::from_grads(total.backward(), &net);
                net = optimizer.step(0.01, net, gradients);
            }
            totals
        })
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn weights_that_are_put_into_a_folded_network_are_used() {
    let device = Device::flex();
    let config = small();
    let [one, other] = [1, 2].map(|seed| config.init(&device, seed).fold());
    let (images, _) = scenes::batch(1, &device);
    let expected = other.detect(images.clone(), scenes::SIZE);
    let values = weights::read_out(&other);
    let one = weights::put_in(one, |i| Some(&values[i].values));
    assert_eq!(one.detect(images, scenes::SIZE), expected);
}

#[test]
fn two_images_are_learnt_by_heart() {
    let device = Device::flex().autodiff();
    let mut config = small();
    config.boxes.score_threshold = 0.5;
    let mut net = config.init(&device, 1);
    let (images, targets) = scenes::batch(2, &device);
    let mut optimizer = SgdConfig::new().with_momentum(Some(MomentumConfig::new())).init();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for step in 0..90 {
        let total = net.losses(images.clone(), &targets, &mut rng).total(&config.loss);
        let gradients = GradientsParams::from_grads(total.backward(), &net);
        net = optimizer.step(if step < 60 { 0.01 } else { 0.002 }, net, gradients);
    }
    let net = PreparedNet::new(&net);
    for (n, target) in targets.iter().enumerate() {
        let image = images.clone().without_autodiff().narrow(0, n, 1);
        let found = net.detect(image, scenes::SIZE);
        assert_eq!(
            found.len(),
            2,
            "{:?}",
            found.iter().map(|d| (d.corners, d.score)).collect::<Vec<_>>()
        );
        for vehicle in &target.boxes {
            let best = found
                .iter()
                .max_by(|a, b| {
                    boxes::iou(a.corners, *vehicle).total_cmp(&boxes::iou(b.corners, *vehicle))
                })
                .unwrap();
            assert!(boxes::iou(best.corners, *vehicle) > 0.8, "{:?} {vehicle:?}", best.corners);
            // The cells in the middle of the four parts.
            for (part, [y, x]) in [(1, [7, 7]), (2, [7, 20]), (3, [20, 7]), (4, [20, 20])] {
                let probability = best.probabilities[part * 784 + y * 28 + x];
                assert!(probability > 0.5, "part {part}: {probability}");
            }
        }
    }
}
