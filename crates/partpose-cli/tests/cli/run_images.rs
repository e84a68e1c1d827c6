//! `run` on the pictures that the repository ships and on such as people have: every kind becomes RGB, bad ones are told.

use std::fs;
use std::path::{Path, PathBuf};

use crate::run;

/// An image of the sample, 621 x 187.
fn sample(world: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world");
    root.join("vkitti_1.3.1_rgb").join(world).join("clone/00000.png")
}

fn write_png(path: &Path, size: [u32; 2], color: image::ColorType, bytes: &[u8]) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::save_buffer(path, bytes, size[0], size[1], color).unwrap();
}

#[test]
fn pictures_of_every_kind_are_looked_at_and_bad_ones_told() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let picture = image::open(sample("1001")).unwrap();
    let save = |name: &str, picture: image::DynamicImage| {
        let path = root.join("images").join(name);
        write_png(&path, [621, 187], picture.color(), picture.as_bytes());
    };
    save("plain.png", picture.clone());
    save("alpha.png", picture.to_rgba8().into());
    save("deep.png", picture.to_rgb16().into());
    save("grey.png", picture.to_luma8().into());
    let cmyk = include_bytes!("../../../partpose/tests/data/cmyk.jpg");
    fs::write(root.join("images/cmyk.jpg"), cmyk).unwrap();
    let said = run(
        root,
        &["run", "images", "--fit", "sqpnp", "--filters", "none", "--no-pictures", "--out", "good"],
    );
    assert!(said.contains("in 5 images") && said.ends_with("--- exit 0\n"), "{said}");
    let text = |out: &str| fs::read_to_string(root.join("good").join(out)).unwrap();
    // The same pixels are the same vehicles.
    assert!(text("plain.txt").lines().count() >= 4, "{said}");
    assert_eq!(text("plain.txt"), text("alpha.txt"));
    assert_eq!(text("plain.txt"), text("deep.txt"));
    assert!(text("grey.txt").lines().count() >= 2);
    assert_eq!(text("cmyk.txt"), "");

    let bytes = fs::read(sample("1001")).unwrap();
    fs::write(root.join("images/half.png"), &bytes[..bytes.len() / 2]).unwrap();
    let mut huge = bytes;
    huge[16..24].copy_from_slice(&[0, 0, 234, 96, 0, 0, 234, 96]);
    fs::write(root.join("images/huge.png"), huge).unwrap();
    fs::write(root.join("images/text.jpg"), "no picture").unwrap();
    let bad = ["run", "images/half.png", "images/huge.png", "images/text.jpg"];
    let arguments = [&bad[..], &["images/cmyk.jpg", "--out", "bad"]].concat();
    let said = run(root, &arguments);
    for name in ["half.png", "huge.png", "text.jpg"] {
        assert!(said.contains(&format!("images/{name}`: cannot decode the image")), "{said}");
        assert!(!root.join("bad").join(name).with_extension("json").exists());
    }
    assert!(said.contains("skipped 3") && said.ends_with("--- exit 1\n"), "{said}");
}

#[test]
fn weights_that_do_not_fit_are_named_with_tensor_and_shape() {
    use partpose_net::weights::{self, Precision};
    let folder = tempfile::tempdir().unwrap();
    let mut config = partpose_net::NetConfig::default();
    let net = config.init(&burn::tensor::Device::flex(), 1);
    config.rpn.channels = 64;
    let bytes = weights::encode(&weights::read_out(&net), &config, Precision::Half);
    fs::write(folder.path().join("w.safetensors"), &bytes).unwrap();
    let image = sample("3001").display().to_string();
    let refused = |told: &str| {
        let said =
            run(folder.path(), &["run", &image, "--weights", "w.safetensors", "--out", "out"]);
        assert!(said.contains(told) && said.ends_with("--- exit 2\n"), "{said}");
        assert!(!folder.path().join("out").exists());
    };
    refused(
        "`w.safetensors`: tensor `rpn.conv.weight` is [128, 128, 3, 3], but the network's is [64, 128, 3, 3]",
    );
    fs::write(folder.path().join("w.safetensors"), &bytes[..1000]).unwrap();
    refused("`w.safetensors` is not a safetensors file");
}
