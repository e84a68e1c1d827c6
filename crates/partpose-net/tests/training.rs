//! A training as a whole, of a tiny network on the sample that the repository ships: the same weights whether it is cut
//! off or not, and nothing lost when it goes wrong.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

use std::fs;
use std::path::Path;
use std::sync::Arc;

use burn::tensor::Device;
use partpose::dataset::Dataset;
use partpose_net::checkpoint;
use partpose_net::config::{Neck, NetConfig};
use partpose_net::sample;
use partpose_net::train::{self, Begin, Event, LAST, Outcome, TrainData, TrainError, Wish};
use partpose_net::training::{Phase, TrainConfig};

/// Four frames with vehicles.
fn data() -> TrainData {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world");
    let (items, _) = sample::items(&Dataset::open(&sample).unwrap()).unwrap();
    assert_eq!(items.len(), 4);
    TrainData { training: Arc::new(items), validation: Vec::new() }
}

/// Six steps of two small crops.
fn config() -> TrainConfig {
    let mut config = TrainConfig {
        net: NetConfig {
            neck: Neck::Fpn { channels: 32, finest: 3, coarsest: 6 },
            ..NetConfig::default()
        },
        phases: vec![Phase { until: 1.0, size: [128, 96], batch: 2, scales: [0.7, 1.2] }],
        ..TrainConfig::default()
    };
    config.net.rpn.channels = 32;
    config.net.boxes.width = 32;
    config.net.parts.channels = 32;
    config.net.parts.convs = 1;
    config.schedule.steps = 6;
    config.schedule.warmup = 2;
    config.report.every = 2;
    config.report.checkpoint_every = 4;
    config.report.keep = 9;
    config.report.validate_every = 0;
    config
}

/// Trains until the end or, if it comes first, until so many steps are done.
fn run(
    data: &TrainData,
    config: &TrainConfig,
    folder: &Path,
    begin: Begin,
    until: u64,
) -> Result<Outcome, TrainError> {
    let device = Device::flex().autodiff();
    let mut resumed = 0;
    let end = train::train(data, config, folder, (begin, &device), &mut |event| match event {
        Event::Resumed { step } => {
            resumed = step;
            Wish::GoOn
        }
        Event::Step { step, .. } if step >= until => Wish::Stop,
        _ => Wish::GoOn,
    });
    if let Ok(end) = &end {
        assert!(end.step > resumed);
    }
    end
}

fn file(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn a_training_that_was_cut_off_ends_with_the_same_weights() {
    let (data, mut config) = (data(), config());
    let folder = tempfile::tempdir().unwrap();
    let [whole, stopped, killed] = ["whole", "stopped", "killed"].map(|n| folder.path().join(n));
    let end = run(&data, &config, &whole, Begin::Scratch, u64::MAX).unwrap();
    assert_eq!(end, Outcome { step: 6, finished: true });
    // Asked to stop between two checkpoints.
    let end = run(&data, &config, &stopped, Begin::Scratch, 3).unwrap();
    assert_eq!(end, Outcome { step: 3, finished: false });
    // Killed after the fifth step: the checkpoint of the fourth is left, with curves that may reach further, and with
    // another number of threads when it goes on.
    fs::create_dir(&killed).unwrap();
    let left = format!("checkpoint-{:08}.safetensors", 4);
    for name in [left.as_str(), "losses.csv", "validation.csv"] {
        fs::copy(whole.join(name), killed.join(name)).unwrap();
    }
    config.data.threads = 1;
    for folder in [&stopped, &killed] {
        let end = run(&data, &config, folder, Begin::Resume, u64::MAX).unwrap();
        assert!(end.finished);
        assert!(file(&whole, LAST) == file(folder, LAST), "{}", folder.display());
        let rows = |folder: &Path| {
            let text = String::from_utf8(file(folder, "losses.csv")).unwrap();
            text.lines().map(|line| line.split(',').next().unwrap_or("").to_owned()).collect()
        };
        let [of_whole, of_resumed]: [Vec<String>; 2] = [rows(&whole), rows(folder)];
        assert_eq!(of_whole, of_resumed);
        let state = |folder: &Path| {
            let path = checkpoint::list(folder).unwrap().pop().unwrap();
            checkpoint::load(&path).unwrap()
        };
        let [whole, resumed] = [state(&whole), state(folder)];
        assert!(whole.weights == resumed.weights && whole.moments == resumed.moments);
        assert!(whole.average == resumed.average && whole.step == resumed.step);
    }
}

#[test]
fn a_loss_that_is_no_number_names_its_images_and_leaves_the_last_good_checkpoint() {
    let (data, mut config) = (data(), config());
    let folder = tempfile::tempdir().unwrap();
    config.schedule.warmup = 0;
    run(&data, &config, folder.path(), Begin::Scratch, 2).unwrap();
    let good = checkpoint::list(folder.path()).unwrap();
    config.optimizer.rate = 1e30;
    config.report.checkpoint_every = 1000;
    let error = run(&data, &config, folder.path(), Begin::Resume, u64::MAX).unwrap_err();
    let TrainError::NotFinite { step, names, .. } = &error else { panic!("{error}") };
    assert!(*step == 3 && names.contains("/clone/00000"), "{error}");
    assert!(error.to_string().contains("is no finite number"), "{error}");
    assert_eq!(checkpoint::list(folder.path()).unwrap(), good);
    config.optimizer.rate = 1e-4;
    let end = run(&data, &config, folder.path(), Begin::Resume, u64::MAX).unwrap();
    assert!(end.finished);
}

#[test]
fn what_a_folder_holds_is_neither_overwritten_nor_mixed() {
    let (data, mut config) = (data(), config());
    let folder = tempfile::tempdir().unwrap();
    run(&data, &config, folder.path(), Begin::Scratch, 1).unwrap();
    let again = run(&data, &config, folder.path(), Begin::Scratch, 1).unwrap_err();
    assert!(matches!(again, TrainError::Exists { .. }), "{again}");
    config.net.parts.kernel = 14;
    let other = run(&data, &config, folder.path(), Begin::Resume, 2).unwrap_err();
    assert!(other.to_string().contains("`net` differs"), "{other}");
}

#[test]
fn only_the_last_checkpoints_are_kept() {
    let (data, mut config) = (data(), config());
    let folder = tempfile::tempdir().unwrap();
    config.report.keep = 2;
    config.report.checkpoint_every = 1;
    config.schedule.steps = 3;
    run(&data, &config, folder.path(), Begin::Scratch, u64::MAX).unwrap();
    let names: Vec<String> = checkpoint::list(folder.path())
        .unwrap()
        .iter()
        .map(|path| path.file_name().unwrap().to_string_lossy().into_owned())
        .collect();
    assert_eq!(names, [2, 3].map(|step| format!("checkpoint-{step:08}.safetensors")));
}

#[test]
fn nothing_to_learn_from_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let none = TrainData { training: Arc::new(Vec::new()), validation: Vec::new() };
    let error = run(&none, &config(), folder.path(), Begin::Scratch, 1).unwrap_err();
    assert!(matches!(error, TrainError::NoFrames), "{error}");
}

#[test]
fn a_frame_that_cannot_be_read_is_told_and_another_stands_in() {
    let mut data = data();
    let items = Arc::get_mut(&mut data.training).unwrap();
    items[1].frame.image = Some("nowhere.png".into());
    let folder = tempfile::tempdir().unwrap();
    let device = Device::flex().autodiff();
    let mut problems = Vec::new();
    let begin = (Begin::Scratch, &device);
    let end = train::train(&data, &config(), folder.path(), begin, &mut |event| {
        if let Event::Skipped { problem } = event {
            problems.push(problem.to_string());
        }
        Wish::GoOn
    });
    assert!(end.unwrap().finished);
    assert!(!problems.is_empty() && problems.iter().all(|text| text.contains("nowhere.png")));
}
