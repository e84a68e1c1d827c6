//! The network through ONNX Runtime, and a detector of one's own; where there is no library, that this is told.

use std::fs;
use std::path::Path;

use crate::run;

fn sample() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world");
    root.join("vkitti_1.3.1_rgb/1001/clone/00000.png").display().to_string()
}

/// Boxes of the vehicles of an image, rounded to pixels, and scores to hundredths.
fn found(folder: &Path, out: &str) -> Vec<String> {
    let text = fs::read_to_string(folder.join(out).join("00000.txt")).unwrap();
    let line = |line: &str| -> String {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |at: usize| words[at].parse::<f64>().unwrap();
        format!("{:.0?} {:.2}", [4, 5, 6, 7].map(number), number(15))
    };
    text.lines().map(line).collect()
}

#[test]
#[expect(clippy::print_stderr, reason = "a test that is skipped says so")]
fn the_exported_network_finds_what_our_engine_finds() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let said = run(root, &["export", "onnx", "--out", "net.onnx"]);
    assert!(said.contains("wrote the network `partpose-r18`"), "{said}");
    let mapping = fs::read_to_string(root.join("net.toml")).unwrap();
    assert!(mapping.contains("part_probabilities"), "{mapping}");
    let sample = sample();
    let look = |out: &str, more: &[&str]| {
        let arguments =
            ["run", &sample, "--fit", "sqpnp", "--filters", "none", "--no-pictures", "--out", out];
        run(root, &[&arguments[..], more].concat())
    };
    let said = look("engine", &["--engine", "onnx"]);
    if said.contains("library was not found") {
        assert!(said.contains("pip install onnxruntime") && said.ends_with("exit 2\n"), "{said}");
        eprintln!("skipped: there is no ONNX Runtime");
        return;
    }
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    look("model", &["--onnx-model", "net.onnx", "--mapping", "net.toml"]);
    look("ours", &[]);
    assert!(found(root, "ours").len() >= 4);
    assert_eq!(found(root, "ours"), found(root, "engine"));
    assert_eq!(found(root, "ours"), found(root, "model"));
}

#[test]
fn what_is_no_library_no_model_and_no_mapping_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let sample = sample();
    fs::write(root.join("lib.so"), "no library").unwrap();
    fs::write(root.join("model.onnx"), "no model").unwrap();
    fs::write(root.join("map.toml"), "[output]\nboxs = 3\n").unwrap();
    let refused = |more: &[&str], told: &[&str]| {
        let said = run(root, &[&["run", &sample, "--out", "out"], more].concat());
        assert!(said.ends_with("--- exit 2\n"), "{said}");
        assert!(told.iter().all(|told| said.contains(told)), "{said}");
        assert!(!root.join("out").exists());
    };
    refused(
        &["--engine", "onnx", "--onnxruntime", "lib.so"],
        &["cannot use the library `lib.so`", "hint: "],
    );
    refused(&["--onnx-model", "nowhere.onnx"], &["nowhere.onnx"]);
    let model = ["--onnx-model", "model.onnx"];
    refused(&[&model[..], &["--mapping", "map.toml"]].concat(), &["map.toml", "boxs", "hint: "]);
    refused(&["--mapping", "map.toml"], &["--onnx-model"]);
    refused(&["--device", "tpu"], &["no such device", "`cpu`"]);
    if !cfg!(feature = "cuda") {
        refused(&["--device", "cuda:1"], &["has no `cuda`", "--features cuda"]);
    }
}

#[test]
fn a_fixed_size_and_wrong_weights_are_checked() {
    let folder = tempfile::tempdir().unwrap();
    let said = run(folder.path(), &["export", "onnx", "--size", "8", "--out", "a.onnx"]);
    assert!(said.contains("a width and a height") && said.ends_with("--- exit 2\n"), "{said}");
    let said = run(folder.path(), &["export", "onnx", "--weights", "none", "--out", "a.onnx"]);
    assert!(said.contains("`none`") && said.ends_with("--- exit 2\n"), "{said}");
    let said = run(folder.path(), &["export"]);
    assert!(said.ends_with("--- exit 2\n"), "{said}");
}
