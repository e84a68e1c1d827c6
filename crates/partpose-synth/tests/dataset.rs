//! Whole data sets: the same bytes on any number of threads and after an interruption, and labels that agree.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use partpose::dataset::Dataset;
use partpose::dataset::check::{CheckOptions, check};
use partpose::geometry::Camera;
use partpose::vehicle::ModelZoo;
use partpose_synth::dataset::{
    Effect, MANIFEST, Progress, Summary, SynthError, SynthOptions, statistics, statistics_beside,
    verify, write,
};
use partpose_synth::shading::RenderOptions;
use partpose_synth::world::{CameraOptions, SceneKind, Variation};

/// Small and cheap, with all that is random.
fn options() -> SynthOptions {
    SynthOptions {
        seed: 5,
        frames: 3,
        interval: 0.4,
        scenes: vec![SceneKind::Urban, SceneKind::Highway],
        variations: vec![Variation::Clone, Variation::Rain],
        camera: CameraOptions {
            camera: Camera::pinhole(150.0, [127.5, 38.5], [256, 80]),
            ..CameraOptions::default()
        },
        render: RenderOptions::cheap(),
        threads: 2,
        ..SynthOptions::default()
    }
}

fn make(out: &Path, options: &SynthOptions) -> Result<Summary, SynthError> {
    let zoo = ModelZoo::embedded();
    let few = ModelZoo { models: zoo.models.into_iter().take(4).collect() };
    write(out, &few, options, &|_| {})
}

/// All files below a folder with their bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

fn assert_same(a: &Path, b: &Path) {
    let (a, b) = (files(a), files(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in &a {
        assert!(bytes == &b[name], "`{}` differs", name.display());
    }
}

#[test]
fn a_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let [one, three] = ["one", "three"].map(|name| folder.path().join(name));
    let summary = make(&one, &SynthOptions { threads: 1, ..options() }).unwrap();
    assert_eq!(summary, Summary { sequences: 4, drawn: 12, kept: 0 });
    make(&three, &SynthOptions { threads: 3, ..options() }).unwrap();
    assert_same(&one, &three);
    // 12 frames of 4 images, 3 tables a sequence, the record, the camera, the models, closed and opened.
    assert_eq!(files(&one).len(), 12 * 4 + 4 * 3 + 2 + 4 + 3);
}

#[test]
fn another_seed_gives_another_world() {
    let folder = tempfile::tempdir().unwrap();
    let few = SynthOptions {
        frames: 1,
        scenes: vec![SceneKind::Forest],
        variations: vec![Variation::Clone],
        ..options()
    };
    let [five, six] = [5, 6].map(|seed| {
        let out = folder.path().join(seed.to_string());
        make(&out, &SynthOptions { seed, ..few.clone() }).unwrap();
        files(&out)
    });
    let motgt = Path::new("vkitti_1.3.1_motgt/3001_clone.txt");
    assert!(five[motgt] != six[motgt]);
}

#[test]
fn parts_at_the_same_time_make_the_same_bytes_as_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, parts] = ["whole", "parts"].map(|name| folder.path().join(name));
    let few = SynthOptions { frames: 1, scenes: vec![SceneKind::Highway], ..options() };
    make(&whole, &few).unwrap();
    let part = |text: &str| {
        let shard = Some(text.parse().unwrap());
        make(&parts, &SynthOptions { shard, threads: 1, ..few.clone() }).unwrap()
    };
    std::thread::scope(|scope| {
        let threads = ["1/3", "2/3", "3/3"].map(|text| scope.spawn(move || part(text)));
        let drawn: usize = threads.map(|thread| thread.join().unwrap().drawn).iter().sum();
        assert_eq!(drawn, 2);
    });
    assert_same(&whole, &parts);
    // Other settings are refused as ever.
    let other = SynthOptions { shard: Some("1/3".parse().unwrap()), seed: 6, ..few };
    assert!(matches!(make(&parts, &other), Err(SynthError::OtherOptions { .. })));
}

#[test]
fn a_run_that_was_killed_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, cut] = ["whole", "cut"].map(|name| folder.path().join(name));
    make(&whole, &options()).unwrap();
    // As a kill leaves it: the first world is whole but for one sequence, of which one frame has its rows, one its
    // images and one nothing; the second has not been begun; a file was being written.
    make(&cut, &SynthOptions { scenes: vec![SceneKind::Urban], ..options() }).unwrap();
    fs::copy(whole.join(MANIFEST), cut.join(MANIFEST)).unwrap();
    let rows = |kind: &str, frame: &str| -> String {
        let path = cut.join(format!("vkitti_1.3.1_{kind}/1001_rain.txt"));
        let text = fs::read_to_string(path).unwrap();
        let own = |line: &&str| line.split(' ').next() == Some(frame);
        text.lines().filter(own).flat_map(|line| [line, "\n"]).collect()
    };
    let fragments = cut.join(".unfinished/1001_rain");
    fs::create_dir_all(&fragments).unwrap();
    let text = rows("extrinsicsgt", "0") + &rows("motgt", "0");
    fs::write(fragments.join("00000.txt"), text).unwrap();
    for kind in ["extrinsicsgt", "motgt"] {
        fs::remove_file(cut.join(format!("vkitti_1.3.1_{kind}/1001_rain.txt"))).unwrap();
    }
    for archive in ["vkitti_1.3.1_rgb", "vkitti_1.3.1_depthgt", "vkitti_1.3.1_scenegt", "parts"] {
        fs::remove_file(cut.join(archive).join("1001/rain/00002.png")).unwrap();
    }
    fs::write(cut.join("parts/1001/rain/.tmpAb3xY9"), b"half").unwrap();
    let summary = make(&cut, &SynthOptions { resume: true, ..options() }).unwrap();
    assert_eq!(summary, Summary { sequences: 4, drawn: 8, kept: 4 });
    assert_same(&whole, &cut);
    // Nothing is left to do.
    let summary = make(&cut, &SynthOptions { resume: true, ..options() }).unwrap();
    assert_eq!(summary, Summary { sequences: 4, drawn: 0, kept: 12 });
    assert_same(&whole, &cut);
}

#[test]
fn labels_agree_with_each_other_and_with_the_labelling_pipeline() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = SceneKind::ALL.to_vec();
    let camera = Camera::pinhole(362.5, [310.25, 93.5], [621, 188]);
    let options = SynthOptions {
        scenes,
        frames: 2,
        interval: 2.0,
        variations: vec![Variation::Left15, Variation::Clone],
        camera: CameraOptions { camera, ..CameraOptions::default() },
        effects: Vec::new(),
        ..options()
    };
    make(folder.path(), &options).unwrap();
    let every_mask = CheckOptions { masks: None, ..CheckOptions::default() };
    let report = check(&Dataset::open(folder.path()).unwrap(), &every_mask, &mut |_| {});
    assert!(report.is_clean(), "{:?}", report.problems);
    for sequence in &report.sequences {
        let archives = &sequence.archives;
        assert!(archives.mask_pixels > 0);
        assert_eq!(archives.mask_pixels_outside, 0, "mirrors lie in their boxes, too");
    }
    let mut seen = 0;
    for (sequence, counts) in verify(folder.path()).unwrap() {
        assert_eq!(counts.frames, 2);
        assert!(counts.is_clean(), "{sequence}: {counts:?}");
        seen += counts.vehicle;
    }
    assert!(seen > 20_000, "{seen} pixels of vehicles");
}

#[test]
fn open_doors_and_boots_lie_in_their_boxes_and_are_labelled_by_their_models() {
    let folder = tempfile::tempdir().unwrap();
    let camera = Camera::pinhole(362.5, [310.25, 93.5], [621, 188]);
    let options = SynthOptions {
        scenes: vec![SceneKind::Urban],
        frames: 4,
        interval: 2.0,
        variations: vec![Variation::Clone],
        camera: CameraOptions { camera, ..CameraOptions::default() },
        effects: Vec::new(),
        open: 1.0,
        ..options()
    };
    make(folder.path(), &options).unwrap();
    let open_dataset = || Dataset::open(folder.path()).unwrap();
    let report = check(&open_dataset(), &CheckOptions { masks: None, worst: 10 }, &mut |_| {});
    assert!(report.is_clean(), "{:?}", report.problems);
    let counts = verify(folder.path()).unwrap()[0].1;
    assert!(counts.is_clean() && counts.open > 1_000, "{counts:?}");
    let dataset = open_dataset();
    let frames = dataset.frames(&dataset.sequences()[0]).unwrap();
    let vehicles = || frames.iter().flat_map(|frame| &frame.vehicles);
    for opening in ["-open-door-left", "-open-boot", "-open-door-right"] {
        let of =
            |model: &Option<String>| model.as_ref().is_some_and(|name| name.ends_with(opening));
        let count = vehicles().filter(|vehicle| of(&vehicle.model)).count();
        assert!(count >= 2, "{count} vehicles with {opening}");
    }
    // Called by the closed models, the same pixels are wrong.
    let rows = folder.path().join("vkitti_1.3.1_motgt/1001_clone.txt");
    let text = fs::read_to_string(&rows).unwrap();
    let closed: String = text
        .split_inclusive('\n')
        .map(|line| {
            let mut fields: Vec<&str> = line.split(' ').collect();
            fields[23] = fields[23].split("-open-").next().unwrap();
            fields.join(" ")
        })
        .collect();
    assert!(closed != text);
    fs::write(&rows, closed).unwrap();
    let counts = verify(folder.path()).unwrap()[0].1;
    assert!(counts.outside > 100 && counts.relabelled > 1_000, "{counts:?}");
}

#[test]
fn without_open_vehicles_there_are_no_opened_models() {
    let folder = tempfile::tempdir().unwrap();
    let few = SynthOptions {
        frames: 1,
        scenes: vec![SceneKind::Urban],
        variations: vec![Variation::Clone],
        open: 0.0,
        ..options()
    };
    make(folder.path(), &few).unwrap();
    assert_eq!(fs::read_dir(folder.path().join("zoo")).unwrap().count(), 4);
    let refused = make(&folder.path().join("other"), &SynthOptions { open: 1.5, ..few });
    assert!(matches!(refused, Err(SynthError::Options(_))));
}

#[test]
fn a_layout_gives_the_cameras_and_vehicles_of_its_data_set() {
    let folder = tempfile::tempdir().unwrap();
    let [real, like] = ["real", "like"].map(|name| folder.path().join(name));
    let few =
        SynthOptions { frames: 4, interval: 0.1, scenes: vec![SceneKind::Urban], ..options() };
    make(&real, &SynthOptions { variations: vec![Variation::Clone], ..few.clone() }).unwrap();
    let layout = SynthOptions {
        layout: Some(real.clone()),
        interval: 0.2,
        variations: vec![Variation::Clone],
        seed: 77,
        ..few
    };
    let summary = make(&like, &layout).unwrap();
    // Every other frame of the four.
    assert_eq!(summary.drawn, 2);
    let [real, like] = [&real, &like].map(|path| Dataset::open(path).unwrap());
    let id = &like.sequences()[0];
    let (frames, originals) = (like.frames(id).unwrap(), real.frames(id).unwrap());
    assert_eq!(frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), [0, 2]);
    let mut compared = 0;
    for frame in &frames {
        let original = originals.iter().find(|other| other.index == frame.index).unwrap();
        assert_eq!(frame.camera, original.camera);
        for vehicle in &frame.vehicles {
            let other = original.vehicles.iter().find(|other| other.track == vehicle.track);
            let [a, b] = [&vehicle.cuboid, &other.unwrap().cuboid]
                .map(|cuboid| cuboid.camera_from_vehicle.translation.vector);
            assert!((a - b).norm() < 1e-6, "{a} {b}");
            compared += 1;
        }
    }
    assert!(compared > 3, "{compared} vehicles");
    let [own, other] = statistics_beside(&like, &real).unwrap();
    assert_eq!([own.frames, other.frames], [2, 2]);
    assert_eq!(statistics(&real).unwrap().frames, 4);
}

#[test]
fn effects_change_pictures_and_never_labels() {
    let folder = tempfile::tempdir().unwrap();
    let few = SynthOptions {
        frames: 1,
        scenes: vec![SceneKind::Urban],
        variations: vec![Variation::Rain],
        ..options()
    };
    let with = |name: &str, effects: &[Effect]| {
        let out = folder.path().join(name);
        make(&out, &SynthOptions { effects: effects.to_vec(), ..few.clone() }).unwrap();
        files(&out)
    };
    let [all, none, noise] =
        [with("all", &Effect::ALL), with("none", &[]), with("noise", &[Effect::Noise])];
    let file = |archive: &str| PathBuf::from(archive).join("1001/rain/00000.png");
    for other in [&none, &noise] {
        assert!(all[&file("vkitti_1.3.1_rgb")] != other[&file("vkitti_1.3.1_rgb")]);
        for archive in ["vkitti_1.3.1_scenegt", "vkitti_1.3.1_depthgt", "parts"] {
            assert!(all[&file(archive)] == other[&file(archive)], "{archive}");
        }
    }
    assert!(none[&file("vkitti_1.3.1_rgb")] != noise[&file("vkitti_1.3.1_rgb")]);
}

#[test]
fn progress_reaches_its_total_with_and_without_frames_that_are_there() {
    let folder = tempfile::tempdir().unwrap();
    let few = SynthOptions { scenes: vec![SceneKind::Highway], frames: 2, ..options() };
    for resume in [false, true] {
        let told = std::sync::Mutex::new([0, 0]);
        let zoo = ModelZoo { models: ModelZoo::embedded().models.into_iter().take(2).collect() };
        write(folder.path(), &zoo, &SynthOptions { resume, ..few.clone() }, &|progress| {
            let mut told = told.lock().unwrap();
            match progress {
                Progress::Total(frames) => told[0] = frames,
                Progress::Done(frames) => told[1] += frames,
            }
        })
        .unwrap();
        assert_eq!(told.into_inner().unwrap(), [4, 4]);
    }
}

#[test]
fn the_shipped_sample_is_small_and_its_labels_agree() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world");
    let bytes: usize = files(&sample).values().map(Vec::len).sum();
    assert!(bytes < 3_000_000, "{bytes} bytes");
    let record = fs::read_to_string(sample.join(MANIFEST)).unwrap();
    assert!(record.contains("\"layout\": null"), "the sample follows no real layout");
    let dataset = Dataset::open(&sample).unwrap();
    let report = check(&dataset, &CheckOptions::default(), &mut |_| {});
    assert!(report.is_clean(), "{:?}", report.problems);
    let counts = verify(&sample).unwrap();
    assert!(counts.iter().all(|(_, counts)| counts.is_clean()), "{counts:?}");
    let found = statistics(&dataset).unwrap();
    assert!(found.frames >= 4 && found.rows > 20, "{found:?}");
    let frames = dataset.sequences().iter().flat_map(|id| dataset.frames(id).unwrap());
    let cars = frames.flat_map(|frame| frame.vehicles).filter(|vehicle| vehicle.category == "Car");
    let lengths: Vec<f64> = cars.map(|vehicle| vehicle.cuboid.extent.length).collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    assert!((found.mean_size()[2] - mean).abs() < 1e-3, "{found:?}");
}
