//! `label`: what it says, what it writes, and how it ends.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use expect_test::expect;
use partpose::vehicle::ModelZoo;

use crate::{check, run};

const MOTGT: &str = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr orig_label moving model color\n";

/// A data set of three frames, and a zoo that comes with the library.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = MOTGT.to_owned();
    for frame in 0..3 {
        for (track, x, model) in [(0, -3.0, "sedan"), (1, 3.0, "Odd")] {
            writeln!(
                rows,
                "{frame} {track} Car 0 0 0 10 10 50 60 1.8 1.5 4.4 {x} 1.6 {} 0.4 0 0 0 0.7 Car 1 {model} Red",
                14 + frame
            )
            .unwrap();
        }
    }
    let labels = folder.path().join("data/vkitti_1.3.1_motgt");
    fs::create_dir_all(&labels).unwrap();
    fs::write(labels.join("0001_clone.txt"), rows).unwrap();
    ModelZoo::embedded().save(&folder.path().join("zoo")).unwrap();
    folder
}

fn label(folder: &Path, more: &[&str]) -> String {
    let base = ["label", "--dataset", "data", "--zoo", "zoo", "--out", "out"];
    run(folder, &[&base, more].concat())
}

#[test]
fn labels_are_written_and_counted() {
    let folder = folder();
    check(
        folder.path(),
        &["label", "--dataset", "data", "--zoo", "zoo", "--out", "out"],
        &expect![[r#"
            --- stderr
            labelled 6 vehicles in 3 frames, kept 0 frames, skipped 0
            3 of them by the model nearest in size, though the zoo has the one that the data set names: `--models name` goes by names
            vehicles hide each other by depth; other occluders are unknown in 3 frames, which have no segmentation
            --- exit 0
        "#]],
    );
    for file in [
        "label.json",
        "parts/0001/clone/00002.png",
        "instances/0001/clone/00000.png",
        "coco/0001_clone.json",
    ] {
        assert!(folder.path().join("out").join(file).is_file(), "{file}");
    }
    let coco = fs::read(folder.path().join("out/coco/0001_clone.json")).unwrap();
    let coco: serde_json::Value = serde_json::from_slice(&coco).unwrap();
    assert_eq!(coco["images"].as_array().unwrap().len(), 3);
    let annotations = coco["annotations"].as_array().unwrap();
    let vehicles: Vec<_> = annotations.iter().filter(|a| a["category_id"] == 30).collect();
    assert_eq!(vehicles.len(), 6);
    assert!(annotations.iter().all(|a| a["category_id"] == 30 || a["parent_id"].is_u64()));
}

#[test]
fn folder_of_other_settings_is_refused_with_what_differs() {
    let folder = folder();
    label(folder.path(), &[]);
    let again = label(folder.path(), &[]);
    assert!(
        again.contains(
            "error: the folder `out` is not empty\nhint: choose another folder, or add `--resume`"
        ),
        "{again}"
    );
    let other = label(folder.path(), &["--resume", "--stride", "2"]);
    assert!(
        other.contains("`stride` was 1 and is now 2") && other.ends_with("exit 2\n"),
        "{other}"
    );
    let resumed = label(folder.path(), &["--resume", "--threads", "1"]);
    assert!(resumed.contains("kept 3 frames") && resumed.ends_with("exit 0\n"), "{resumed}");
}

#[test]
fn comparison_with_oneself_is_perfect_and_drawn() {
    let folder = folder();
    label(folder.path(), &[]);
    let arguments = ["--resume", "--compare", "out/parts", "--pictures", "1"];
    let said = label(folder.path(), &arguments);
    assert!(said.contains("| right part, where both see a vehicle          | 100.00 |"), "{said}");
    let compare = folder.path().join("out/compare");
    for file in ["tables.md", "confusion.csv", "confusion.png", "metrics.json"] {
        assert!(compare.join(file).is_file(), "{file}");
    }
    assert_eq!(fs::read_dir(compare.join("pictures")).unwrap().count(), 3);
    let metrics = fs::read(compare.join("metrics.json")).unwrap();
    let metrics: serde_json::Value = serde_json::from_slice(&metrics).unwrap();
    assert_eq!((&metrics["accuracy_inside"], &metrics["frames"]), (&1.0.into(), &3.into()));
}

#[test]
fn shards_end_where_the_last_one_finishes() {
    let folder = folder();
    let first = label(folder.path(), &["--shard", "2/2"]);
    assert!(first.contains("1 blocks of frames are left to other shards"), "{first}");
    let second = label(folder.path(), &["--shard", "1/2"]);
    assert!(second.ends_with("exit 0\n") && !second.contains("left to other"), "{second}");
    assert!(folder.path().join("out/coco/0001_clone.json").is_file());
}

#[test]
fn what_cannot_be_meant_is_refused_before_anything_is_written() {
    let folder = folder();
    for (more, expected) in [
        (&["--shard", "3/2"][..], "is not a shard"),
        (&["--fold", "all/4"], "all folds would be labelled with one zoo"),
        (&["--fold", "1/4"], "write `all/K`"),
        (&["--compare", "nowhere"], "no folder `nowhere` to compare with"),
        (&["--shard", "1/2", "--compare", "out"], "cannot be used with"),
        (&["--worlds", "0009"], "has no world `0009`"),
        (&["--stride", "0"], "0 is not in"),
    ] {
        let said = label(folder.path(), more);
        assert!(said.contains(expected) && said.ends_with("exit 2\n"), "{more:?}: {said}");
        assert!(!folder.path().join("out").exists(), "{more:?}");
    }
}

#[test]
fn a_bad_row_costs_its_frame_and_the_exit_code() {
    let folder = folder();
    let path = folder.path().join("data/vkitti_1.3.1_motgt/0001_clone.txt");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, text.replacen("1.8 1.5 4.4", "1.8 x 4.4", 1)).unwrap();
    let said = label(folder.path(), &[]);
    assert!(said.contains("warning: skipped 0001/clone: "), "{said}");
    assert!(
        said.contains("labelled 4 vehicles in 2 frames") && said.ends_with("exit 1\n"),
        "{said}"
    );
}
