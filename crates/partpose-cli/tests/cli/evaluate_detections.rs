//! What a detector found, scored: `evaluate boxes`, `masks` and `poses` on a small data set made of the embedded models.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use partpose::dataset::{Dataset, Frame};
use partpose::detection::Detection;
use partpose::files::{RgbImage, encode_png};
use partpose::formats::{DetectionFile, write_detections};
use partpose::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Rect};
use partpose::oracle::{Oracle, OracleOptions};
use partpose::parts::PartMask;
use partpose::render::{Instance, render_labels};
use partpose::vehicle::ModelZoo;
use serde_json::Value;

use crate::run;

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

/// Model, place and yaw of the vehicles; the last is to be ignored.
const VEHICLES: [(usize, [f64; 2], f64); 3] =
    [(0, [-3.0, 14.0], -1.2), (1, [2.5, 11.0], 1.4), (2, [9.0, 30.0], 0.3)];

/// `vkitti`: world 0001, `clone` and `fog`, two frames each, in which the vehicles drive away by a metre.
fn dataset(folder: &Path) -> ModelZoo {
    let zoo = ModelZoo::embedded();
    let root = folder.join("vkitti");
    let write = |path: &str, bytes: &[u8]| {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    };
    let mut rows = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr \
                    orig_label moving model color\n"
        .to_owned();
    for frame in 0..2u32 {
        let mut instances = Vec::new();
        for (track, (model, [x, z], yaw)) in VEHICLES.into_iter().enumerate() {
            let model = &zoo.models[model];
            let (z, extent) = (z + f64::from(frame), model.extent());
            let rotation = EulerAngles { x: 0.0, y: yaw + std::f64::consts::FRAC_PI_2, z: 0.0 };
            let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation.to_rotation());
            let place = nalgebra::Translation3::new(x, 1.6, z);
            let camera_from_vehicle = Pose::from_parts(place, rotation);
            let bounds = Cuboid { camera_from_vehicle, extent }.project(&CAMERA).unwrap();
            let [l, t, r, b] =
                [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(f64::round);
            let label = if track == 2 { "DontCare" } else { "Car" };
            let Extent { width, height, length } = extent;
            writeln!(
                rows,
                "{frame} {track} {label} 0 0 0 {l} {t} {r} {b} {width} {height} {length} {x} 1.6 {z} {yaw} 0 0 0 0.9 \
                 Car 0 {} Red",
                model.name()
            )
            .unwrap();
            let scale = nalgebra::Vector3::repeat(1.0);
            instances.push(Instance {
                mesh: model.mesh(),
                scale,
                camera_from_vehicle,
                id: track as u16 + 1,
            });
        }
        let image = render_labels(&CAMERA, &instances);
        let mask = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
        let png = encode_png(&RgbImage { size: image.size, pixels: mask.to_rgb() });
        for variation in ["clone", "fog"] {
            write(&format!("parts/0001/{variation}/{frame:05}.png"), &png);
        }
    }
    for variation in ["clone", "fog"] {
        write(&format!("vkitti_1.3.1_motgt/0001_{variation}.txt"), rows.as_bytes());
    }
    zoo
}

/// The frames, and perfect detections of all vehicles of each, that to ignore included.
fn perfect(folder: &Path, zoo: &ModelZoo) -> Vec<(Frame, Vec<Detection>)> {
    let dataset = Dataset::open(&folder.join("vkitti")).unwrap();
    let ids = dataset.sequences().to_vec();
    let frames = ids.iter().flat_map(|id| dataset.frames(id).unwrap());
    frames
        .map(|frame| {
            let oracle = Oracle::new(&frame, frame.read_parts().unwrap(), zoo);
            let found = (0..3).map(|v| oracle.detection(v, &OracleOptions::default()).unwrap());
            let found = found.collect();
            (frame, found)
        })
        .collect()
}

/// All but one vehicle of the first frame, and something where nothing is.
fn detections(folder: &Path, zoo: &ModelZoo) -> DetectionFile {
    let mut file = DetectionFile { images: Vec::new(), detections: Vec::new() };
    for (index, (frame, mut found)) in perfect(folder, zoo).into_iter().enumerate() {
        if index == 0 {
            found[1].bounds = Rect::new(10.0, 10.0, 90.0, 60.0);
            found[1].score = 0.75;
        }
        file.images.push(format!("{}.png", frame.name()));
        file.detections.extend(found.into_iter().map(|found| (index, found)));
    }
    file
}

fn metrics(folder: &Path, out: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(out).join("metrics.json")).unwrap()).unwrap()
}

fn number(metrics: &Value, key: &str) -> f64 {
    metrics[key].as_f64().unwrap_or_else(|| panic!("{key}: {}", metrics[key]))
}

#[test]
fn perfect_detections_have_perfect_boxes_and_kernels_that_grow_better() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let evaluate = |what: &str| {
        let arguments = ["evaluate", what, "--dataset", "vkitti", "--oracle", "--out", what];
        let said = run(folder.path(), &arguments);
        assert!(said.ends_with("--- exit 0\n"), "{said}");
        metrics(folder.path(), what)
    };
    let boxes = evaluate("boxes");
    for key in ["precision", "recall", "mean_iou", "ap"] {
        assert!((number(&boxes, key) - 1.0).abs() < 1e-9, "{key} {boxes}");
    }
    // Two frames of `clone` alone: to the oracle all weathers look the same.
    assert_eq!(number(&boxes, "vehicles") as u32, 4);
    let masks = evaluate("masks");
    let rows = masks["rows"].as_array().unwrap();
    let mpa = |row: &Value, scaling: &str| number(&row["scalings"][scaling], "mpa");
    let bilinear: Vec<f64> = rows.iter().map(|row| mpa(row, "bilinear")).collect();
    assert!(bilinear.len() == 4 && bilinear.is_sorted() && bilinear[0] > 0.85, "{bilinear:?}");
    assert!(rows.iter().all(|row| mpa(row, "nearest") < mpa(row, "bilinear")), "{masks}");
    assert!((number(&masks, "mpa") - bilinear[0]).abs() < 1e-12);
    for file in ["table.md", "table-1.csv", "confusion.png", "confusion.csv", "figure-4.png"] {
        assert!(folder.path().join("masks").join(file).is_file(), "{file}");
    }
}

#[test]
fn detections_of_a_file_are_scored_in_all_three_ways() {
    let folder = tempfile::tempdir().unwrap();
    let zoo = dataset(folder.path());
    let path = folder.path().join("found.safetensors");
    write_detections(&path, &detections(folder.path(), &zoo)).unwrap();
    let evaluate = |what: &str| {
        let arguments = [
            "evaluate",
            what,
            "--dataset",
            "vkitti",
            "--detections",
            "found.safetensors",
            "--out",
            what,
        ];
        let said = run(folder.path(), &arguments);
        assert!(said.ends_with("--- exit 0\n"), "{said}");
        (metrics(folder.path(), what), said)
    };
    // Four frames, eight vehicles: one missed, one detection wrong, four on the vehicle to ignore.
    let (boxes, said) = evaluate("boxes");
    let counts = ["vehicles", "assigned", "wrong", "ignored"].map(|key| number(&boxes, key) as u32);
    assert_eq!(counts, [8, 7, 1, 4], "{said}");
    assert!((number(&boxes, "precision") - 7.0 / 8.0).abs() < 1e-12);
    assert!((number(&boxes, "recall") - 7.0 / 8.0).abs() < 1e-12);
    // The wrong one comes last: precision is 1 up to recall 7/8, 88 of 101 points.
    assert!((number(&boxes, "ap") - 88.0 / 101.0).abs() < 1e-9, "{}", boxes["ap"]);
    assert!(said.contains("found: clone") && said.contains("found: fog"), "{said}");
    let (masks, said) = evaluate("masks");
    assert_eq!(number(&masks, "count") as u32, 7);
    assert!(number(&masks, "mpa") > 0.9 && said.contains("perfect, 28 x 28"), "{said}");
    let (poses, said) = evaluate("poses");
    assert_eq!(number(&poses, "count") as u32, 7, "{said}");
    assert!(number(&poses, "mean_iou3d") > 0.3 && poses["model_precision"].is_f64(), "{poses}");
}

#[test]
fn parts_of_a_fit_are_together_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let zoo = dataset(folder.path());
    write_detections(&folder.path().join("found.safetensors"), &detections(folder.path(), &zoo))
        .unwrap();
    let fit = |more: &[&str]| {
        let arguments =
            ["fit", "--detections", "found.safetensors", "--camera", "vkitti", "--fit", "epnp"];
        let said = run(folder.path(), &[&arguments[..], &["--no-pictures"], more].concat());
        assert!(said.ends_with("--- exit 0\n"), "{said}");
    };
    fit(&["--out", "whole"]);
    for shard in ["1/3", "2/3", "3/3"] {
        fit(&["--out", "parts", "--shard", shard]);
    }
    let files = |name: &str| {
        let entries = fs::read_dir(folder.path().join(name)).unwrap();
        let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        let named = |path: std::path::PathBuf| {
            (path.file_name().unwrap().to_owned(), fs::read(&path).unwrap())
        };
        files.into_iter().map(named).collect::<Vec<_>>()
    };
    assert_eq!(files("whole").len(), 8);
    assert_eq!(files("whole"), files("parts"));
}

#[test]
fn parts_of_an_evaluation_are_together_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let evaluate = |more: &[&str]| {
        let arguments = ["evaluate", "poses", "--dataset", "vkitti", "--oracle"];
        run(folder.path(), &[&arguments[..], &["--variations", "clone,fog"], more].concat())
    };
    let whole = evaluate(&["--out", "whole"]);
    assert!(whole.ends_with("--- exit 0\n"), "{whole}");
    for shard in ["3/3", "1/3"] {
        let said = evaluate(&["--out", "parts", "--shard", shard]);
        assert!(said.contains("; missing: ") && said.ends_with("--- exit 0\n"), "{said}");
    }
    assert!(!folder.path().join("parts/metrics.json").exists());
    fs::write(folder.path().join("names.toml"), "Other = [\"sedan\"]\n").unwrap();
    let others = [
        ["--box", "tight"],
        ["--size-head", "5"],
        ["--model-head", "80"],
        ["--model-names", "names.toml"],
        ["--ground", "--joint"],
    ];
    for other in others {
        let said = evaluate(&[&["--out", "parts", "--shard", "2/3"], &other[..]].concat());
        assert!(said.contains("other settings") && said.ends_with("--- exit 2\n"), "{said}");
    }
    let last = evaluate(&["--out", "parts", "--shard", "2/3"]);
    assert_eq!(last.replace("`parts`", "`whole`"), whole);
    for file in ["metrics.json", "tables.md", "vehicles.csv", "table-1.csv"] {
        let read = |out: &str| fs::read(folder.path().join(out).join(file)).unwrap();
        assert!(read("parts") == read("whole"), "{file}");
    }
    fs::write(folder.path().join("parts/shards/1-of-3.json"), "{").unwrap();
    let damaged = evaluate(&["--out", "parts", "--shard", "2/3"]);
    assert!(damaged.contains("1-of-3.json") && damaged.ends_with("--- exit 2\n"), "{damaged}");
}

#[test]
fn vehicles_of_a_sequence_keep_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let zoo = dataset(folder.path());
    let mut file = DetectionFile { images: Vec::new(), detections: Vec::new() };
    for (index, (frame, mut found)) in perfect(folder.path(), &zoo).into_iter().enumerate() {
        // The second frame of each sequence has them in another order.
        found.rotate_left(index % 2);
        file.images.push(format!("{}.png", frame.name()));
        file.detections.extend(found.into_iter().map(|found| (index, found)));
    }
    write_detections(&folder.path().join("found.safetensors"), &file).unwrap();
    for how in ["--track", "--track=filter"] {
        let said = run(
            folder.path(),
            &[
                "fit",
                "--detections",
                "found.safetensors",
                "--camera",
                "vkitti",
                how,
                "--no-pictures",
                "--out",
                "fit",
            ],
        );
        assert!(said.contains("followed 6 vehicles through 12 sightings in 2 sequences"), "{said}");
        let said = run(
            folder.path(),
            &["evaluate", "tracks", "--dataset", "vkitti", "--results", "fit", "--out", "tracks"],
        );
        assert!(said.contains("0 changes of number, 0 tracks of more than one vehicle"), "{said}");
        let scores = metrics(folder.path(), "tracks");
        assert_eq!((number(&scores, "tracked"), number(&scores, "sightings")), (8.0, 8.0));
    }
    let text = fs::read_to_string(folder.path().join("fit/tracks/0001_clone.txt")).unwrap();
    let numbers: Vec<Vec<&str>> =
        text.lines().map(|line| line.split(' ').take(3).collect()).collect();
    assert_eq!(numbers.len(), 6, "{text}");
    assert_eq!(numbers[0], ["0", "1", "Car"]);
    assert_eq!(text.lines().next().unwrap().split(' ').count(), 18);
    // Others are told that there is nothing to score.
    run(
        folder.path(),
        &["fit", "--detections", "found.safetensors", "--camera", "vkitti", "--out", "fit"],
    );
    let said = run(
        folder.path(),
        &["evaluate", "tracks", "--dataset", "vkitti", "--results", "fit", "--out", "t"],
    );
    assert!(
        said.contains("no labelled vehicle has a track") && said.ends_with("--- exit 2\n"),
        "{said}"
    );
}

#[test]
fn detections_that_do_not_fit_the_frames_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let zoo = dataset(folder.path());
    let path = folder.path().join("found.safetensors");
    let mut file = detections(folder.path(), &zoo);
    file.images[3] = "elsewhere/00001.png".to_owned();
    write_detections(&path, &file).unwrap();
    let arguments = [
        "evaluate",
        "boxes",
        "--dataset",
        "vkitti",
        "--detections",
        "found.safetensors",
        "--out",
        "out",
    ];
    let said = run(folder.path(), &arguments);
    assert!(said.contains("left out 1 frames that `found` does not name"), "{said}");
    assert!(said.ends_with("--- exit 1\n"), "{said}");
    for (index, name) in file.images.iter_mut().enumerate() {
        *name = format!("photo-{index}.png");
    }
    write_detections(&path, &file).unwrap();
    let said = run(folder.path(), &arguments);
    assert!(said.contains("names none of the frames") && said.contains("photo-0.png"), "{said}");
    assert!(said.ends_with("--- exit 2\n"), "{said}");
}

#[test]
fn run_says_what_is_no_image() {
    let folder = tempfile::tempdir().unwrap();
    for (wanted, told) in [("nowhere.png", "nowhere.png"), ("*.png", "matches"), (".", "no image")]
    {
        let said = run(folder.path(), &["run", wanted, "--out", "out"]);
        assert!(said.contains(told) && said.ends_with("--- exit 2\n"), "{said}");
        assert!(!folder.path().join("out").exists());
    }
}
