//! What is wrong with an input is said with its file and a remedy, ends with 2, and leaves nothing half-written.

use std::fs;
use std::path::Path;

use crate::run;

/// A folder with a camera, a zoo and detections that `fit` accepts.
fn good() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["demo", "--out", ".", "--scenes", "1"]);
    folder
}

const FIT: [&str; 9] = [
    "fit",
    "--detections",
    "detections.safetensors",
    "--camera",
    "camera.toml",
    "--zoo",
    "zoo",
    "--out",
    "out",
];

fn fit(folder: &Path) -> String {
    run(folder, &FIT)
}

/// `fit` must end with 2, name the file, give a hint, and write nothing.
fn refuses(folder: &Path, file: &str) {
    let said = fit(folder);
    assert!(said.ends_with("--- exit 2\n"), "{said}");
    assert!(said.contains("error:") && said.contains(file), "{said}");
    assert!(said.contains("hint:"), "{said}");
    assert!(!folder.join("out").exists(), "something was written: {said}");
}

#[test]
fn camera_without_focal_length_is_refused() {
    let folder = good();
    for text in [
        "width = 10\nheight = 10\ncx = 1\ncy = 1\n",
        "width = 10\nheight = 10\nfx = 0\nfy = 1\ncx = 1\ncy = 1\n",
    ] {
        fs::write(folder.path().join("camera.toml"), text).unwrap();
        refuses(folder.path(), "camera.toml");
    }
}

#[test]
fn camera_that_is_missing_or_something_else_is_refused() {
    let folder = good();
    let path = folder.path().join("camera.toml");
    let image = partpose::files::RgbImage { size: [2, 1], pixels: vec![0; 6] };
    fs::write(&path, partpose::files::encode_png(&image)).unwrap();
    refuses(folder.path(), "camera.toml");
    fs::remove_file(&path).unwrap();
    refuses(folder.path(), "camera.toml");
    fs::create_dir(&path).unwrap();
    refuses(folder.path(), "camera.toml");
}

#[test]
fn empty_or_missing_zoo_is_refused() {
    let folder = good();
    fs::remove_dir_all(folder.path().join("zoo")).unwrap();
    refuses(folder.path(), "zoo");
    fs::create_dir(folder.path().join("zoo")).unwrap();
    refuses(folder.path(), "zoo");
}

#[test]
fn model_that_is_cut_off_is_refused() {
    let folder = good();
    let path = folder.path().join("zoo/sedan.glb");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    refuses(folder.path(), "sedan.glb");
}

#[test]
fn detections_that_are_cut_off_or_something_else_are_refused() {
    let folder = good();
    let path = folder.path().join("detections.safetensors");
    let bytes = fs::read(&path).unwrap();
    for broken in [&bytes[..bytes.len() / 2], &bytes[..5], b"{}".as_slice()] {
        fs::write(&path, broken).unwrap();
        refuses(folder.path(), "detections.safetensors");
    }
    fs::remove_file(&path).unwrap();
    let said = fit(folder.path());
    assert!(said.contains("detections.safetensors") && said.ends_with("--- exit 2\n"), "{said}");
}

#[test]
fn evaluation_without_a_data_set_is_refused() {
    let folder = good();
    let evaluate = |dataset: &str| {
        let arguments =
            ["evaluate", "poses", "--dataset", dataset, "--zoo", "zoo", "--oracle", "--out", "out"];
        run(folder.path(), &arguments)
    };
    for dataset in ["nowhere", "zoo"] {
        let said = evaluate(dataset);
        assert!(said.contains("error:") && said.contains(dataset), "{said}");
        assert!(said.ends_with("--- exit 2\n"), "{said}");
        assert!(!folder.path().join("out").exists());
    }
}

/// `vkitti`: two frames with a car; the second frame's mask is cut off.
fn two_frames(folder: &Path) {
    let root = folder.join("vkitti");
    let write = |path: &str, text: &[u8]| {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    let header = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr \
                  orig_label moving model color\n";
    let row = |frame: u32| {
        format!(
            "{frame} 3 Car 0 0 -1.6 560 170 690 260 1.8 1.5 4.5 0.2 1.6 15 -1.6 0 0 0 0.9 Car 1 sedan Red\n"
        )
    };
    write("vkitti_1.3.1_motgt/0001_clone.txt", format!("{header}{}{}", row(0), row(1)).as_bytes());
    let black = vec![0; 1242 * 375 * 3];
    let image = partpose::files::RgbImage { size: [1242, 375], pixels: black };
    let png = partpose::files::encode_png(&image);
    write("parts/0001/clone/00000.png", &png);
    write("parts/0001/clone/00001.png", &png[..png.len() / 2]);
}

#[test]
fn images_that_share_a_file_are_refused() {
    let folder = good();
    let path = folder.path().join("detections.safetensors");
    let mut file = partpose::formats::read_detections(&path).unwrap();
    file.images = vec!["x/scene.png".to_owned(), "x_scene.jpg".to_owned()];
    partpose::formats::write_detections(&path, &file).unwrap();
    let said = fit(folder.path());
    assert!(said.contains("x/scene.png") && said.contains("x_scene.jpg"), "{said}");
    assert!(said.ends_with("--- exit 2\n") && !folder.path().join("out").exists(), "{said}");
}

#[test]
fn flags_that_make_no_sense_are_refused() {
    let folder = good();
    for more in [
        ["--min-score", "nan"],
        ["--extent", "1e300,1,1"],
        ["--extent", "1,2"],
        ["--filters", "none,sp"],
        ["--small-part", "2"],
        ["--border", "4294967295"],
    ] {
        let said = run(folder.path(), &[&FIT[..], &more[..]].concat());
        assert!(said.contains("error:") && said.ends_with("--- exit 2\n"), "{more:?}: {said}");
    }
}

#[test]
fn folder_that_is_a_file_is_told_before_the_work() {
    let folder = good();
    fs::write(folder.path().join("out"), "a file").unwrap();
    let said = fit(folder.path());
    assert!(said.contains("`out`") && said.ends_with("--- exit 2\n"), "{said}");
}

#[test]
fn one_bad_frame_is_reported_and_the_rest_is_done() {
    let folder = good();
    two_frames(folder.path());
    let arguments =
        ["evaluate", "poses", "--dataset", "vkitti", "--zoo", "zoo", "--oracle", "--out", "out"];
    let said = run(folder.path(), &arguments);
    assert!(said.contains("0001/clone/00001") && said.ends_with("--- exit 1\n"), "{said}");
    // With errors asked for, the bad frame does not stop the search for their strength either.
    let said = run(folder.path(), &[&arguments[..], &["--degrade", "90"]].concat());
    assert!(said.ends_with("--- exit 1\n"), "{said}");
    let metrics = fs::read_to_string(folder.path().join("out/metrics.json")).unwrap();
    assert!(metrics.contains("\"skipped_frames\": 1"), "{metrics}");
}

#[test]
fn folds_need_a_zoo_each() {
    let folder = good();
    let arguments = [
        "evaluate",
        "poses",
        "--dataset",
        "d",
        "--zoo",
        "zoo",
        "--oracle",
        "--fold",
        "all/4",
        "--out",
        "out",
    ];
    let said = run(folder.path(), &arguments);
    assert!(said.contains("{fold}") && said.ends_with("--- exit 2\n"), "{said}");
}

#[test]
fn carve_tells_of_a_folder_it_cannot_write_before_the_work() {
    let folder = good();
    two_frames(folder.path());
    for (out, report) in [("file", "report"), ("models", "file")] {
        fs::write(folder.path().join("file"), "a file").unwrap();
        let arguments = ["zoo", "carve", "--dataset", "vkitti", "--worlds", "0001"];
        let said =
            run(folder.path(), &[&arguments[..], &["--out", out, "--report", report]].concat());
        assert!(said.contains("`file` is a file, not a folder"), "{said}");
        assert!(said.ends_with("--- exit 2\n"), "{said}");
    }
}
