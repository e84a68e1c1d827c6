use std::fs;
use std::path::Path;

use partpose::eval::bop::{BopFolders, BopRecalls, parse_estimates, read_bop, score_bop};
use serde_json::Value;

/// A random test set with its recalls; written by `golden/make_bop.py` in numpy and scipy.
fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/bop.json")).unwrap()
}

/// The set as the files of BOP.
fn write(folder: &Path, golden: &Value) -> BopFolders {
    let (scene, models) = (folder.join("test/000004"), folder.join("models_eval"));
    fs::create_dir_all(&scene).unwrap();
    fs::create_dir_all(&models).unwrap();
    for name in ["scene_gt", "scene_camera", "scene_gt_info"] {
        fs::write(scene.join(format!("{name}.json")), golden[name].to_string()).unwrap();
    }
    fs::write(models.join("models_info.json"), golden["models_info"].to_string()).unwrap();
    for (id, points) in golden["models"].as_object().unwrap() {
        let points: Vec<[f64; 3]> = serde_json::from_value(points.clone()).unwrap();
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
            points.len()
        );
        for [x, y, z] in points {
            text += &format!("{x} {y} {z}\n");
        }
        fs::write(models.join(format!("obj_{:06}.ply", id.parse::<u32>().unwrap())), text).unwrap();
    }
    BopFolders { scenes: folder.join("test"), models, targets: None }
}

#[test]
fn recalls_are_those_of_the_written_out_formulas() {
    let golden = golden();
    let folder = tempfile::tempdir().unwrap();
    let set = read_bop(&write(folder.path(), &golden), golden["width"].as_f64().unwrap()).unwrap();
    assert_eq!((set.images.len(), set.images[0].scene, set.objects.len()), (12, 4, 3));
    let csv = golden["estimates"].as_str().unwrap();
    let estimates = parse_estimates(Path::new("golden.csv"), csv).unwrap();
    let scores = score_bop(&set, &estimates);
    assert_eq!(scores.targets as u64, golden["targets"].as_u64().unwrap());
    let check = |name: &str, recalls: &BopRecalls| {
        let expected: Vec<f64> = serde_json::from_value(golden[name].clone()).unwrap();
        assert_eq!(recalls.recalls.len(), expected.len());
        for ((threshold, here), there) in recalls.recalls.iter().zip(expected) {
            assert!((here - there).abs() < 1e-12, "{name} at {threshold}: {here} but {there}");
        }
    };
    check("mssd", &scores.mssd);
    check("mspd", &scores.mspd);
    check("add", &scores.add);
}

#[test]
fn a_list_of_targets_restricts_what_is_to_be_found() {
    let golden = golden();
    let folder = tempfile::tempdir().unwrap();
    let mut folders = write(folder.path(), &golden);
    let path = folder.path().join("targets.json");
    fs::write(&path, r#"[{"scene_id": 4, "im_id": 1, "obj_id": 5, "inst_count": 1}]"#).unwrap();
    folders.targets = Some(path.clone());
    let set = read_bop(&folders, 640.0).unwrap();
    assert_eq!(set.objects.keys().copied().collect::<Vec<_>>(), [5]);
    assert_eq!(set.images.iter().map(|image| image.targets.len()).sum::<usize>(), 1);
    fs::write(&path, r#"[{"scene_id": 9, "im_id": 1, "obj_id": 5, "inst_count": 1}]"#).unwrap();
    assert!(read_bop(&folders, 640.0).is_err());
}

#[test]
fn files_that_are_missing_or_wrong_are_named() {
    let golden = golden();
    for (file, text) in [
        ("test/000004/scene_camera.json", "{}"),
        (
            "test/000004/scene_gt.json",
            r#"{"0": [{"obj_id": 1, "cam_R_m2c": [1], "cam_t_m2c": []}]}"#,
        ),
        ("models_eval/models_info.json", r#"{"1": {"diameter": -1}}"#),
        ("models_eval/obj_000001.ply", "ply\n"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folders = write(folder.path(), &golden);
        fs::write(folder.path().join(file), text).unwrap();
        let said = read_bop(&folders, 640.0).unwrap_err().to_string();
        let name = Path::new(file).file_name().unwrap().to_str().unwrap();
        assert!(said.contains(name), "{said}");
    }
}
