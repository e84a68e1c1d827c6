//! Our network and its export say the same, to a thousandth.
//!
//! Without ONNX Runtime's library there is nothing to compare with; the tests then say so.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use partpose::detection::Detection;
use partpose::files::{RgbImage, read_rgb};
use partpose::geometry::Rect;
use partpose_net::config::{
    Backbone, Neck, NetConfig, NormKind, PartUpscale, RegionConfig, RegionKind,
};
use partpose_net::{Detector, MaskRcnn, onnx, weights};
use partpose_onnx::mapping::Resize;
use partpose_onnx::{Mapping, OnnxDetector, library};

const TOLERANCE: f64 = 1e-3;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn sample(world: &str) -> RgbImage {
    let folder = repository().join("examples/world/vkitti_1.3.1_rgb").join(world);
    read_rgb(&folder.join("clone/00000.png")).unwrap()
}

/// Whether there is a library; says so where not.
fn has_library() -> bool {
    let found = library::find(None);
    if let Err(error) = &found {
        eprintln!("skipped: {error}");
    }
    found.is_ok()
}

/// Both engines on some images; returns how many vehicles they found.
fn check(net: &MaskRcnn, images: &[RgbImage]) -> usize {
    let config = net.config();
    let mut mapping = Mapping::default();
    let [shorter, longer] = [config.input.min_side, config.input.max_side];
    mapping.input.resize = Resize::Keep { shorter, longer };
    if config.extents {
        onnx::EXTENTS.clone_into(&mut mapping.output.extents);
        onnx::EXTENT_SIGMAS.clone_into(&mut mapping.output.extent_sigmas);
    }
    if !config.models.is_empty() {
        onnx::MODELS.clone_into(&mut mapping.output.models);
        mapping.models.clone_from(&config.models);
    }
    let model = onnx::export(net, None).unwrap();
    let theirs = OnnxDetector::new(&model, mapping, None).unwrap();
    let ours = Detector::new(net);
    let mut count = 0;
    for image in images {
        let (ours, theirs) = (ours.detect(image).unwrap(), theirs.detect(image).unwrap());
        assert_eq!(ours.len(), theirs.len(), "{config:?}");
        count += ours.len();
        for (x, y) in ours.iter().zip(&theirs) {
            let near = |a: f64, b: f64, scale: f64| {
                assert!((a - b).abs() <= TOLERANCE * scale, "{a} {b}: {config:?}");
            };
            near(x.score, y.score, 1.0);
            let corners = |r: &Rect| [r.x_min, r.y_min, r.x_max, r.y_max];
            // Relative to the box.
            let size = x.bounds.width().max(x.bounds.height()).max(10.0);
            corners(&x.bounds)
                .into_iter()
                .zip(corners(&y.bounds))
                .for_each(|(a, b)| near(a, b, size));
            let values = |d: &Detection| d.probabilities.values().to_vec();
            for (a, b) in values(x).into_iter().zip(values(y)) {
                near(a.into(), b.into(), 1.0);
            }
            assert_eq!([x.size.is_some(), y.size.is_some()], [config.extents; 2]);
            if let (Some(a), Some(b)) = (x.size, y.size) {
                near(a.extent.width, b.extent.width, 1.0);
                near(a.extent.length, b.extent.length, 5.0);
                near(a.sigma[1], b.sigma[1], 1.0);
            }
            let models = |d: &Detection| d.models.as_ref().map(|m| m.values.clone());
            let (a, b) = (models(x).unwrap_or_default(), models(y).unwrap_or_default());
            assert_eq!([a.len(), b.len()], [config.models.len(); 2]);
            for (a, b) in a.into_iter().zip(b) {
                near(a.into(), b.into(), 1.0);
            }
        }
    }
    count
}

#[test]
fn the_shipped_network_is_the_same_in_both_engines() {
    let path = repository().join("weights/partpose-r18.safetensors");
    if !has_library() || !path.is_file() {
        return;
    }
    let net = weights::load(&path, &Device::flex()).unwrap();
    let images = ["1001", "2001", "3001", "4001"].map(sample);
    assert!(check(&net, &images) >= 20);
}

#[test]
fn an_image_that_shows_nothing_has_nothing_in_both() {
    let path = repository().join("weights/partpose-r18.safetensors");
    if !has_library() || !path.is_file() {
        return;
    }
    let net = weights::load(&path, &Device::flex()).unwrap();
    let grey = RgbImage { size: [100, 70], pixels: vec![128; 3 * 100 * 70] };
    assert_eq!(check(&net, &[grey]), 0);
}

#[test]
fn every_configuration_is_exported() {
    if !has_library() {
        return;
    }
    let small = || {
        let neck = Neck::Fpn { channels: 32, finest: 3, coarsest: 7 };
        let mut config = NetConfig { neck, ..NetConfig::default() };
        config.parts.channels = 32;
        config.boxes.width = 64;
        config.boxes.max_detections = 5;
        config
    };
    let fine = NetConfig { neck: Neck::Fpn { channels: 32, finest: 2, coarsest: 6 }, ..small() };
    let crop = RegionConfig { kind: RegionKind::CropAndResize, ..RegionConfig::default() };
    let [c4, atrous] = [16, 8].map(|stride| {
        let mut config = NetConfig { neck: Neck::C4 { stride }, regions: crop, ..small() };
        config.parts.upscale = PartUpscale::First;
        config.parts.kernel = 14;
        config
    });
    let heads = NetConfig { models: vec!["a".into(), "b".into()], extents: true, ..small() };
    let deep = NetConfig { backbone: Backbone::Resnet50, norm: NormKind::Frozen, ..small() };
    let mut large = small();
    large.parts.kernel = 42;
    let whole = sample("3001");
    // A part, so that sides are no multiples of 32.
    let part: Vec<u8> =
        (60..151).flat_map(|y| whole.pixels[3 * (y * 621 + 20)..][..3 * 197].to_vec()).collect();
    let image = RgbImage { size: [197, 91], pixels: part };
    for config in [fine, c4, atrous, heads, deep, large] {
        let net = config.init(&Device::flex(), 3);
        assert!(check(&net, std::slice::from_ref(&image)) > 0, "{config:?}");
    }
}

#[test]
fn group_normalisation_is_refused() {
    let config = NetConfig { norm: NormKind::Group, ..NetConfig::default() };
    let error = onnx::export(&config.init(&Device::flex(), 1), None).unwrap_err();
    assert!(error.to_string().contains("group normalisation"), "{error}");
}
