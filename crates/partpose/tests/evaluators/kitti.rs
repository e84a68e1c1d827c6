use partpose::eval::kitti::{Curve, KittiOptions, KittiScores, read_kitti, score_kitti};

use super::shared;

/// The evaluator prints 41 values with six decimals.
const TOLERANCE: f64 = 2e-4;

fn value(scores: &KittiScores, metric: &str, points: &str, level: usize) -> f64 {
    let curve: &Curve = match metric {
        "2d" | "aos" => &scores.curves[0][level],
        "bev" => &scores.curves[1][level],
        _ => &scores.curves[2][level],
    };
    match (metric, points) {
        ("aos", "R11") => curve.orientation_r11(),
        ("aos", _) => curve.orientation_r40(),
        (_, "R11") => curve.r11(),
        _ => curve.r40(),
    }
    .unwrap()
}

#[test]
fn average_precision_is_that_of_the_development_kit() {
    let Some(folder) = shared("kitti-ap") else { return };
    let files = read_kitti(&folder.join("label_2"), &folder.join("results"), false).unwrap();
    assert_eq!(files.frames.len(), 150);
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut compared = 0;
    for scores in score_kitti(&files.frames, &KittiOptions::default()) {
        for metric in ["2d", "aos", "bev", "3d"] {
            for points in ["R11", "R40"] {
                for (level, name) in ["easy", "moderate", "hard"].into_iter().enumerate() {
                    let there = &expected[scores.class.name()][metric][points][name];
                    let here = value(&scores, metric, points, level);
                    let miss = (here - there.as_f64().unwrap()).abs();
                    let place = [scores.class.name(), metric, points, name].join(" ");
                    assert!(miss < TOLERANCE, "{place}: {here} but {there}");
                    compared += 1;
                }
            }
        }
    }
    assert_eq!(compared, 72);
}
