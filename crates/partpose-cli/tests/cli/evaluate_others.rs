//! The evaluators of the public benchmarks, and `export`, on invented sets.

use std::fs;
use std::path::Path;

use expect_test::expect;

use super::{check, run};

const CAR: &str =
    "Car 0.00 0 1.60 300.00 170.00 420.00 260.00 1.60 1.65 3.62 -4.11 1.66 14.06 1.32";

fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn evaluate(folder: &Path, what: &str, more: &[&str]) -> String {
    let arguments =
        ["evaluate", what, "--labels", "labels", "--results", "results", "--out", "out"];
    run(folder, &[&arguments[..], more].concat())
}

fn metrics(folder: &Path) -> serde_json::Value {
    let text = fs::read_to_string(folder.join("out/metrics.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Must end with 2, say all of these, and write nothing.
fn refuses(folder: &Path, said: &str, words: &[&str]) {
    assert!(said.ends_with("--- exit 2\n") && said.contains("error:"), "{said}");
    for word in words {
        assert!(said.contains(word), "{word} in {said}");
    }
    assert!(!folder.join("out").exists(), "something was written: {said}");
}

fn kitti() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(root, "labels/000000.txt", &format!("{CAR}\n"));
    write(root, "labels/000001.txt", &format!("{CAR}\n"));
    write(root, "results/000000.txt", &format!("{CAR} 0.9\n"));
    write(root, "results/000001.txt", "");
    folder
}

#[test]
fn kitti_metrics_have_classes_metrics_points_and_difficulties() {
    let folder = kitti();
    let said = evaluate(folder.path(), "kitti", &[]);
    assert!(said.ends_with("tables and curves to `out`\n--- exit 0\n"), "{said}");
    let metrics = metrics(folder.path());
    // Half of two: one point of recall, 0, is reached by the one score that there is.
    let r11 = metrics["car"]["3d"]["R11"]["easy"].as_f64().unwrap();
    assert!((r11 - 100.0 / 11.0).abs() < 1e-9, "{r11}");
    assert!(metrics["pedestrian"]["aos"]["R40"]["hard"].is_null());
    for file in ["table.md", "table-1.csv", "curves.png", "curves.json"] {
        assert!(folder.path().join("out").join(file).is_file(), "{file}");
    }
}

#[test]
fn kitti_names_the_line_that_is_wrong() {
    let folder = kitti();
    write(folder.path(), "results/000000.txt", &format!("{CAR} 0.9\n{CAR}\n"));
    check(
        folder.path(),
        &["evaluate", "kitti", "--labels", "labels", "--results", "results", "--out", "out"],
        &expect![[r#"
            --- stderr
            error: `results/000000.txt` line 2: 15 columns, but 16 are needed
            --- exit 2
        "#]],
    );
}

#[test]
fn kitti_results_that_are_missing_must_be_allowed() {
    let folder = kitti();
    fs::remove_file(folder.path().join("results/000001.txt")).unwrap();
    let said = evaluate(folder.path(), "kitti", &[]);
    refuses(folder.path(), &said, &["000001.txt", "--subset"]);
    let said = evaluate(folder.path(), "kitti", &["--subset"]);
    assert!(said.contains("left out 1 label files") && said.ends_with("--- exit 1\n"), "{said}");
    fs::remove_dir_all(folder.path().join("results")).unwrap();
    fs::remove_dir_all(folder.path().join("out")).unwrap();
    refuses(folder.path(), &evaluate(folder.path(), "kitti", &[]), &["results"]);
}

fn coco() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    write(
        root,
        "labels/instances.json",
        r#"{"images": [{"id": 3, "width": 20, "height": 10}], "categories": [{"id": 2, "name": "car"}],
            "annotations": [{"id": 1, "image_id": 3, "category_id": 2, "bbox": [1, 1, 4, 5], "area": 20,
            "iscrowd": 0, "segmentation": [[1, 1, 5, 1, 5, 6, 1, 6]]}]}"#,
    );
    write(
        root,
        "results/found.json",
        r#"[{"image_id": 3, "category_id": 2, "bbox": [1, 1, 4, 5], "score": 0.5}]"#,
    );
    folder
}

#[test]
fn coco_scores_what_both_files_have() {
    let folder = coco();
    let said = evaluate(folder.path(), "coco", &[]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let metrics = metrics(folder.path());
    assert!((metrics["bbox"]["AP"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    assert!(metrics["bbox"]["AP_large"].is_null() && metrics["segm"].is_null());
    assert_eq!(metrics["bbox"]["categories"][0]["name"], "car");
}

#[test]
fn coco_refuses_masks_that_are_not_there_and_files_that_are_cut_off() {
    let folder = coco();
    let said = evaluate(folder.path(), "coco", &["--overlap", "segm"]);
    refuses(folder.path(), &said, &["masks missing", "hint:"]);
    write(folder.path(), "results/second.json", "[]");
    let said = evaluate(folder.path(), "coco", &[]);
    refuses(folder.path(), &said, &["`results` holds 2 files", "--results"]);
    fs::remove_file(folder.path().join("results/second.json")).unwrap();
    write(folder.path(), "results/found.json", "[{\"image_id\": 3");
    let said = evaluate(folder.path(), "coco", &[]);
    refuses(folder.path(), &said, &["found.json", "line 1"]);
}

fn a3dp() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let car = |score: &str| {
        format!(r#"[{{"area": 9000, "car_id": 1, "pose": [0.1, 0, 3, 1, 2, 9]{score}}}]"#)
    };
    write(folder.path(), "labels/a.json", &car(""));
    write(folder.path(), "results/a.json", &car(r#", "score": 0.5"#));
    write(folder.path(), "sim_mat.txt", "1 0.5\n0.5 1\n");
    folder
}

#[test]
fn a3dp_writes_what_the_evaluator_prints() {
    let folder = a3dp();
    let said = evaluate(folder.path(), "a3dp", &[]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let text = fs::read_to_string(folder.path().join("out/res.txt")).unwrap();
    assert!(text.starts_with("AP 1.0000\nAP_c0 1.0000\n") && text.contains("AP_s -1.0000\n"));
    assert!((metrics(folder.path())["rel_fresh"]["AR_m"].as_f64().unwrap() - 1.0).abs() < 1e-9);
}

#[test]
fn a3dp_refuses_cars_and_similarities_that_make_no_sense() {
    let folder = a3dp();
    write(folder.path(), "sim_mat.txt", "1\n");
    refuses(folder.path(), &evaluate(folder.path(), "a3dp", &[]), &["a.json", "car_id"]);
    write(folder.path(), "sim_mat.txt", "1 2\n");
    refuses(folder.path(), &evaluate(folder.path(), "a3dp", &[]), &["sim_mat.txt", "square"]);
    fs::remove_file(folder.path().join("sim_mat.txt")).unwrap();
    refuses(folder.path(), &evaluate(folder.path(), "a3dp", &[]), &["--similarity"]);
}

fn bop() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let pose = r#""cam_R_m2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_m2c": [10, 20, 900]"#;
    let gt = format!(r#"{{"7": [{{"obj_id": 1, {pose}}}]}}"#);
    write(root, "labels/000002/scene_gt.json", &gt);
    let camera = r#"{"7": {"cam_K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "depth_scale": 1}}"#;
    write(root, "labels/000002/scene_camera.json", camera);
    write(root, "models/models_info.json", r#"{"1": {"diameter": 100}}"#);
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n\
               property float z\nend_header\n50 0 0\n-50 0 0\n";
    write(root, "models/obj_000001.ply", ply);
    write(root, "camera.json", r#"{"width": 640, "height": 480}"#);
    write(root, "results/found.csv", "2,7,1,0.5,1 0 0 0 1 0 0 0 1,10 20 908,-1\n");
    folder
}

#[test]
fn bop_recalls_follow_the_thresholds() {
    let folder = bop();
    let said = evaluate(folder.path(), "bop", &[]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let metrics = metrics(folder.path());
    // 8 mm of 100: right from a threshold of 0.1 on.
    assert!((metrics["bop19_average_recall_mssd"].as_f64().unwrap() - 0.9).abs() < 1e-9);
    assert!((metrics["recall_add_0.1d"].as_f64().unwrap() - 1.0).abs() < 1e-9);
}

#[test]
fn bop_says_what_is_missing() {
    let folder = bop();
    fs::remove_file(folder.path().join("camera.json")).unwrap();
    refuses(folder.path(), &evaluate(folder.path(), "bop", &[]), &["camera.json", "--image-width"]);
    let more = ["--image-width", "640"];
    write(folder.path(), "results/found.csv", "2,7,1\n");
    refuses(folder.path(), &evaluate(folder.path(), "bop", &more), &["found.csv` line 1"]);
    fs::remove_file(folder.path().join("models/obj_000001.ply")).unwrap();
    refuses(folder.path(), &evaluate(folder.path(), "bop", &more), &["obj_000001.ply"]);
    fs::remove_dir_all(folder.path().join("models")).unwrap();
    refuses(folder.path(), &evaluate(folder.path(), "bop", &more), &["--models"]);
}

#[test]
fn exported_results_are_read_by_the_evaluators() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["demo", "--out", ".", "--scenes", "1"]);
    for format in ["kitti", "coco", "bop", "nuscenes", "openlabel"] {
        let out = format!("exported/{format}");
        let arguments =
            ["export", "--results", "scene-1.json", "--to", format, "--zoo", "zoo", "--out", &out];
        let said = run(folder.path(), &arguments);
        assert!(said.contains("exported ") && said.ends_with("--- exit 0\n"), "{said}");
    }
    let exported = fs::read_to_string(folder.path().join("exported/kitti/scene-1.txt")).unwrap();
    let fitted = fs::read_to_string(folder.path().join("scene-1.txt")).unwrap();
    assert_eq!(exported, fitted);
    let said = run(
        folder.path(),
        &[
            "evaluate",
            "kitti",
            "--labels",
            "exported/kitti",
            "--results",
            "exported/kitti",
            "--out",
            "out",
        ],
    );
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    assert!((metrics(folder.path())["car"]["3d"]["R40"]["hard"].as_f64().unwrap()) > 0.0);
    for file in ["bop/results.csv", "bop/models/models_info.json", "coco/images.json"] {
        assert!(folder.path().join("exported").join(file).is_file(), "{file}");
    }
}

/// Every format that has poses is read again; the pitch and roll that KITTI loses the demo does not have.
#[test]
fn what_is_exported_is_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    run(root, &["demo", "--out", ".", "--scenes", "1"]);
    let count = fs::read_to_string(root.join("scene-1.txt")).unwrap().lines().count();
    for (format, file) in [
        ("results", ""),
        ("kitti", ""),
        ("bop", "/results.csv"),
        ("nuscenes", "/results.json"),
        ("openlabel", "/openlabel.json"),
    ] {
        let (there, back) = (format!("there/{format}"), format!("back/{format}"));
        let export = |arguments: &[&str]| {
            let said = run(root, &[&["export"], arguments].concat());
            assert!(said.contains(&format!("exported {count} vehicles of 1 images")), "{said}");
        };
        let to = ["--to", format, "--zoo", "zoo", "--out", &there];
        export(&[&["--results", "scene-1.json"], &to[..]].concat());
        let file = format!("{there}{file}");
        let from = ["--from", format, "--camera", "camera.toml", "--zoo", "zoo"];
        export(&[&["--results", &file, "--to", "kitti", "--out", &back], &from[..]].concat());
    }
    // Places and angles are written with four digits.
    let numbers = |format: &str| -> Vec<f64> {
        let folder = fs::read_dir(root.join("back").join(format)).unwrap();
        let path = folder.map(|entry| entry.unwrap().path()).next().unwrap();
        let text = fs::read_to_string(path).unwrap();
        let line =
            |line: &str| line.split(' ').skip(11).map(|n| n.parse().unwrap()).collect::<Vec<_>>();
        text.lines().flat_map(line).collect()
    };
    let expected = numbers("results");
    for format in ["kitti", "bop", "nuscenes", "openlabel"] {
        let found = numbers(format);
        let apart = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(found.len() == expected.len() && apart < 2e-3, "{format}: {apart}");
    }
}

#[test]
fn results_of_fit_are_scored_by_coco_by_the_names_of_their_images() {
    let folder = coco();
    let root = folder.path();
    let labels = fs::read_to_string(root.join("labels/instances.json")).unwrap();
    let labels = labels.replace(r#""id": 3,"#, r#""id": 3, "file_name": "frames/a.png","#);
    write(root, "labels/instances.json", &labels);
    fs::remove_file(root.join("results/found.json")).unwrap();
    let result = r#"{"image": "a.png", "camera": {"focal": [700, 700], "principal_point": [10, 5], "size": [20, 10]},
        "vehicles": [{"bounds": [0.5, 0.5, 4.5, 5.5], "score": 0.7, "pose": {"model": "x", "translation": [1, 2, 9],
        "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "extent": {"width": 1.8, "height": 1.5, "length": 4.4}}}]}"#;
    write(root, "results/a.json", result);
    let said = evaluate(root, "coco", &[]);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    assert!((metrics(root)["bbox"]["AP"].as_f64().unwrap() - 1.0).abs() < 1e-9);
    fs::remove_dir_all(root.join("out")).unwrap();
    write(root, "results/a.json", &result.replace("a.png", "b.png"));
    refuses(root, &evaluate(root, "coco", &[]), &["`b.png`", "file_name"]);
}

#[test]
fn formats_without_camera_or_sizes_ask_for_them() {
    let folder = kitti();
    let export = |more: &[&str]| {
        let arguments = ["export", "--results", "labels", "--to", "results", "--out", "out"];
        run(folder.path(), &[&arguments[..], more].concat())
    };
    refuses(folder.path(), &export(&["--from", "kitti"]), &["camera", "--camera"]);
    let camera = "width = 1242\nheight = 375\nfx = 700.0\nfy = 700.0\ncx = 600.0\ncy = 180.0\n";
    write(folder.path(), "camera.toml", camera);
    let more = ["--from", "bop", "--camera", "camera.toml"];
    refuses(folder.path(), &export(&more), &["sizes", "--zoo"]);
    write(folder.path(), "labels/000000.txt", "Car 0 0\n");
    let more = ["--from", "kitti", "--camera", "camera.toml"];
    refuses(folder.path(), &export(&more), &["000000.txt` line 1: 3 columns"]);
    write(folder.path(), "label.json", "{\"openlabel\": 3}");
    let arguments = ["export", "--from", "openlabel", "--results", "label.json", "--to", "kitti"];
    let said = run(folder.path(), &[&arguments[..], &["--out", "out"]].concat());
    refuses(folder.path(), &said, &["label.json` has no `openlabel.frames`"]);
}

#[test]
fn export_of_what_is_no_result_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "results/a.json", "{}");
    let export =
        || run(folder.path(), &["export", "--results", "results", "--to", "bop", "--out", "out"]);
    refuses(folder.path(), &export(), &["a.json", "missing field"]);
    fs::remove_file(folder.path().join("results/a.json")).unwrap();
    refuses(folder.path(), &export(), &["results", "hint:"]);
}
