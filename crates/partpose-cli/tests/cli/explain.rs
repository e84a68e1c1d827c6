//! `explain`, and what `fit` says of itself, on what `demo` wrote.

use std::fs;

use crate::run;

#[test]
fn every_vehicle_has_a_picture_and_states_its_sureness() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["demo", "--out", "d", "--scenes", "1"]);
    let inputs =
        ["--detections", "d/detections.safetensors", "--camera", "d/camera.toml", "--zoo", "d/zoo"];
    let asked = ["--images", "d", "--most", "2", "--out", "why"];
    let arguments: Vec<&str> = ["explain"].into_iter().chain(inputs).chain(asked).collect();
    let said = run(folder.path(), &arguments);
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let pictures = fs::read_dir(folder.path().join("why")).unwrap().count();
    assert_eq!(pictures, 2, "{said}");

    let text = fs::read(folder.path().join("d/scene-1.json")).unwrap();
    let result: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let vehicles = result["vehicles"].as_array().unwrap();
    for vehicle in vehicles {
        let pose = &vehicle["pose"];
        let reasons = vehicle["reasons"].as_array().unwrap();
        if pose.is_null() {
            assert!(!reasons.is_empty(), "{vehicle}");
            continue;
        }
        let dense = &pose["dense"];
        let confidence = dense["confidence"].as_f64().unwrap();
        assert!((0.0..=1.0).contains(&confidence));
        let unsure = reasons.iter().any(|reason| reason["code"] == "low_confidence");
        assert_eq!(unsure, confidence < 0.5, "{vehicle}");
        // The network says sizes with deviations, so they are fitted, too.
        assert_eq!(dense["covariance"].as_array().map(Vec::len), Some(9));
        assert!(dense["depth_and_size"]["depth_sd"].as_f64().unwrap() > 0.0);
        assert!(!pose["parts"].as_array().unwrap().is_empty());
    }
}

#[test]
fn nothing_to_explain_is_told_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let said = run(folder.path(), &["explain", "--out", "why"]);
    assert!(said.ends_with("--- exit 2\n") && said.contains("--dataset"), "{said}");
    let said = run(folder.path(), &["explain", "--dataset", "none", "--oracle", "--out", "why"]);
    assert!(said.ends_with("--- exit 2\n"), "{said}");
}
