//! `train` and `weights` as a user runs them, on the sample that the repository ships and with a network that is tiny.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::run;

/// A network and a training that take a second.
const TINY: &str = r#"
[net]
neck = { kind = "fpn", channels = 32, finest = 3, coarsest = 6 }
rpn.channels = 32
boxes.width = 32
parts = { channels = 32, convs = 1 }

[schedule]
steps = 8
warmup = 2

[[phases]]
until = 1.0
size = [128, 96]
batch = 2
scales = [0.7, 1.2]

[report]
every = 2
checkpoint_every = 3
validate_every = 0
"#;

fn sample() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world");
    root.display().to_string()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("tiny.toml"), TINY).unwrap();
    folder
}

fn train(folder: &Path, out: &str, more: &[&str]) -> String {
    let sample = sample();
    let arguments = ["train", "--dataset", &sample, "--config", "tiny.toml", "--out", out];
    run(folder, &[&arguments[..], more].concat())
}

fn checkpoints(run: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(run) else { return Vec::new() };
    let paths = entries.map(|entry| entry.unwrap().path());
    paths.filter(|path| path.display().to_string().contains("checkpoint-")).collect()
}

#[test]
fn a_killed_training_goes_on_to_the_same_weights_which_can_be_shown_and_exported() {
    let folder = folder();
    let root = folder.path();
    let said = train(root, "whole", &["--seed", "5"]);
    assert!(said.contains("trained 8 steps") && said.ends_with("--- exit 0\n"), "{said}");
    for file in ["config.toml", "losses.csv", "curves.png", "weights.safetensors"] {
        assert!(root.join("whole").join(file).is_file(), "{file}");
    }
    let config = fs::read_to_string(root.join("whole/config.toml")).unwrap();
    assert!(config.contains("seed = 5") && config.contains("channels = 32"), "{config}");

    let sample = sample();
    let mut child = Command::new(env!("CARGO_BIN_EXE_partpose"))
        .args(["train", "--dataset", &sample, "--config", "tiny.toml", "--seed", "5"])
        .args(["--out", "killed"])
        .current_dir(root)
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while checkpoints(&root.join("killed")).is_empty() {
        assert!(began.elapsed() < Duration::from_mins(5), "no checkpoint came");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // The run's own configuration is used: neither the file nor the seed is told again.
    let said = run(root, &["train", "--dataset", &sample, "--out", "killed", "--resume"]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let weights = |run: &str| fs::read(root.join(run).join("weights.safetensors")).unwrap();
    assert!(weights("whole") == weights("killed"), "the weights differ");

    let file = "whole/weights.safetensors";
    let said = run(root, &["weights", "show", file]);
    assert!(said.contains("channels = 32") && said.contains("# rpn.conv.weight [32, 32, 3, 3]"));
    let said = run(root, &["weights", "export", file, "single.safetensors"]);
    assert!(said.contains("wrote `single.safetensors`"), "{said}");
    let size = |name: &str| fs::metadata(root.join(name)).unwrap().len();
    assert!(size("single.safetensors") > 18 * size(file) / 10);
    // As initial weights of another training they fit, but for what has another size.
    let said = train(root, "next", &["--steps", "1", "--kernel", "14", "--init", file]);
    assert!(said.contains("not taken") && said.contains("part_head"), "{said}");
    assert!(said.contains("trained 1 steps") && said.ends_with("--- exit 0\n"), "{said}");
}

#[test]
fn a_training_that_explodes_keeps_what_was_good_and_names_the_images() {
    let folder = folder();
    let said = train(folder.path(), "run", &["--rate", "1e30"]);
    assert!(said.contains("is no finite number") && said.contains("/clone/00000"), "{said}");
    assert!(said.contains("hint: ") && said.ends_with("--- exit 2\n"), "{said}");
    assert!(!folder.path().join("run/weights.safetensors").exists());
}

#[test]
fn the_configuration_of_a_run_is_that_of_its_weights() {
    let folder = folder();
    let root = folder.path();
    let config = || fs::read_to_string(root.join("run/config.toml")).unwrap();
    // What an attempt left that did not come to a checkpoint.
    fs::create_dir(root.join("run")).unwrap();
    fs::write(root.join("run/config.toml"), "seed = 77\n").unwrap();
    let said = train(root, "run", &["--steps", "1", "--seed", "5"]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    assert!(config().contains("seed = 5"), "{}", config());
    // A run is not gone on with under another configuration, and keeps its own.
    let own = config();
    for other in [&["--resume", "--seed", "6"][..], &["--resume", "--kernel", "14"], &[]] {
        let said = train(root, "run", other);
        assert!(said.contains("hint: ") && said.ends_with("--- exit 2\n"), "{said}");
        assert_eq!(config(), own);
    }
    let said = run(root, &["train", "--dataset", &sample(), "--out", "run", "--resume"]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
}

#[test]
fn what_cannot_be_trained_is_told_before_anything_is_written() {
    let folder = folder();
    let root = folder.path();
    fs::create_dir(root.join("empty")).unwrap();
    let refused = |arguments: &[&str], told: &[&str]| {
        let said = run(root, &[&["train", "--out", "run"], arguments].concat());
        assert!(said.ends_with("--- exit 2\n"), "{said}");
        assert!(told.iter().all(|told| said.contains(told)), "{said}");
        assert!(!root.join("run").exists(), "{said}");
    };
    refused(&["--dataset", "empty"], &["`empty`", "error:"]);
    // Frames without a vehicle: images alone.
    let sample = sample();
    for name in ["vkitti_1.3.1_extrinsicsgt/3001_clone.txt", "vkitti_1.3.1_motgt/3001_clone.txt"] {
        let text = fs::read_to_string(Path::new(&sample).join(name)).unwrap();
        let lines = if name.contains("motgt") { 1 } else { usize::MAX };
        let kept: Vec<&str> = text.lines().take(lines).collect();
        let path = root.join("bare").join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, kept.join("\n") + "\n").unwrap();
    }
    let told = ["has no frame with an image, a part mask and vehicles", "hint: `partpose label`"];
    refused(&["--dataset", "bare"], &told);
    refused(&["--dataset", &sample, "--device", "cuda:99"], &["`cuda`"]);
    fs::write(root.join("wrong.toml"), "[net.parts]\nkernels = 14\n").unwrap();
    refused(&["--dataset", &sample, "--config", "wrong.toml"], &["wrong.toml", "kernels"]);
    refused(&["--dataset", &sample, "--init", "none.pth"], &["none.pth"]);
}

#[test]
fn weights_of_something_else_are_refused() {
    let folder = folder();
    fs::write(folder.path().join("a.safetensors"), "nonsense").unwrap();
    for arguments in [&["weights", "show", "a.safetensors"][..], &["weights", "show", "b"]] {
        let said = run(folder.path(), arguments);
        assert!(said.contains("error:") && said.ends_with("--- exit 2\n"), "{said}");
    }
}
