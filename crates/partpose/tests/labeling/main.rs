//! Labels for invented data sets: what is drawn, what hides what, and that runs write the same bytes however they go.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

#[path = "../common/mod.rs"]
mod common;
mod hostile;
mod rle;
mod runs;
mod segmentation;
mod single;

use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use partpose::dataset::{Dataset, SequenceId};
use partpose::geometry::Extent;
use partpose::labeling::{LabelJob, LabelOptions, LabelReport, LabelStore, Zoos, label_dataset};
use partpose::vehicle::{ModelZoo, VehicleModel};

/// Frames of an invented sequence: two blocks and a bit.
const FRAMES: u32 = 35;

/// A row of `motgt`: track, label, category, model, width, height, length, x, z, yaw.
#[derive(Clone, Copy)]
struct Row {
    track: u32,
    label: &'static str,
    category: &'static str,
    model: &'static str,
    extent: [f64; 3],
    x: f64,
    z: f64,
    yaw: f64,
}

const fn car(track: u32, x: f64, z: f64, yaw: f64) -> Row {
    let (label, category, model) = ("Car", "Car", "Boxy");
    Row { track, label, category, model, extent: [1.8, 1.45, 4.4], x, z, yaw }
}

/// A car before another, one to ignore, and a van before a car.
const ROWS: [Row; 5] = [
    car(3, -2.0, 11.0, 0.3),
    car(7, -3.4, 17.0, 1.4),
    Row { label: "DontCare", ..car(8, 9.0, 24.0, -0.8) },
    Row {
        label: "DontCare",
        category: "Van",
        model: "Bus",
        extent: [2.1, 2.4, 5.2],
        ..car(9, 4.0, 15.0, 0.1)
    },
    car(11, 13.0, 30.0, 0.0),
];

const MOTGT: &str = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr orig_label moving model color\n";
const EXTRINSICS: &str =
    "frame r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0.1 0.2 1\n";

fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().expect("a file lies in a folder")).unwrap();
    fs::write(path, text).unwrap();
}

/// A Virtual KITTI 1 sequence in which the cars drive off slowly.
fn add_sequence(root: &Path, world: &str, frames: u32, rows: &[Row]) {
    let (mut motgt, mut extrinsics) = (MOTGT.to_owned(), EXTRINSICS.to_owned());
    for frame in 0..frames {
        writeln!(extrinsics, "{frame} 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1").unwrap();
        for row in rows {
            let [w, h, l] = row.extent;
            let z = row.z + 0.1 * f64::from(frame);
            writeln!(
                motgt,
                "{frame} {} {} 0 0 0 10 10 50 60 {w} {h} {l} {} 1.6 {z} {} 0 0 0 0.7 {} 1 {} Red",
                row.track, row.label, row.x, row.yaw, row.category, row.model
            )
            .unwrap();
        }
    }
    write(root, &format!("vkitti_1.3.1_motgt/{world}_clone.txt"), &motgt);
    write(root, &format!("vkitti_1.3.1_extrinsicsgt/{world}_clone.txt"), &extrinsics);
}

/// The invented rows in world 0001, and fewer frames of them in 0002.
fn dataset() -> (tempfile::TempDir, Dataset) {
    let folder = tempfile::tempdir().unwrap();
    add_sequence(folder.path(), "0001", FRAMES, &ROWS);
    add_sequence(folder.path(), "0002", 5, &ROWS);
    let dataset = Dataset::open(folder.path()).unwrap();
    (folder, dataset)
}

fn model(name: &str, extent: Extent) -> VehicleModel {
    let mut mesh = common::car(12);
    let scale = extent.ratio(&common::EXTENT);
    for vertex in &mut mesh.vertices {
        vertex.coords.component_mul_assign(&scale);
    }
    VehicleModel::new(name, "Car", "sedan", extent, mesh).unwrap()
}

/// A car of the usual size, and a long one.
fn zoo() -> ModelZoo {
    ModelZoo {
        models: vec![model("Boxy", common::EXTENT), model("Long", Extent::new(1.9, 1.7, 5.5))],
    }
}

fn job<'a>(sequences: &'a [SequenceId], zoo: &'a ModelZoo) -> LabelJob<'a> {
    LabelJob {
        sequences,
        stride: 1,
        zoos: Zoos::single(zoo),
        options: LabelOptions::default(),
        shard: None,
        resume: false,
        reference: None,
    }
}

/// Labels into a folder without a word.
fn run(dataset: &Dataset, job: &LabelJob, out: &Path) -> LabelReport {
    label_dataset(dataset, job, &LabelStore::new(out), &|_| {}).unwrap()
}

/// All files below a folder by their path.
fn files(root: &Path) -> BTreeMap<String, Vec<u8>> {
    fn collect(root: &Path, folder: &Path, into: &mut BTreeMap<String, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(root, &path, into);
            } else {
                let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
                into.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    collect(root, root, &mut found);
    found
}

/// Names first, so that a failure does not print images.
fn assert_same_files(a: &BTreeMap<String, Vec<u8>>, b: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    let differing: Vec<_> = a.iter().filter(|(name, bytes)| b[*name] != **bytes).collect();
    assert!(differing.is_empty(), "{:?}", differing.iter().map(|(name, _)| name));
}
