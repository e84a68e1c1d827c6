use std::path::Path;

use partpose::eval::coco::{CocoOverlap, parse_coco, rasterize, score_coco};
use partpose::parts::rle::{CocoRle, Rle};
use serde_json::Value;

/// Sums run in another order than numpy's.
const TOLERANCE: f64 = 1e-12;

/// Random sets with what pycocotools 2.0.11 makes of them; written by `golden/make_coco.py`.
fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/coco.json")).unwrap()
}

fn rle(value: &Value) -> Rle {
    let coco: CocoRle = serde_json::from_value(value.clone()).unwrap();
    Rle::from_coco(&coco).unwrap()
}

#[test]
fn figures_are_those_of_pycocotools() {
    for (number, set) in golden()["sets"].as_array().unwrap().iter().enumerate() {
        let [labels, results] = ["labels", "results"].map(|name| set[name].to_string());
        let path = Path::new("golden");
        let parsed = parse_coco((path, labels.as_bytes()), (path, results.as_bytes())).unwrap();
        for (kind, overlap) in [("bbox", CocoOverlap::Boxes), ("segm", CocoOverlap::Masks)] {
            assert!(parsed.has(overlap));
            let scores = score_coco(&parsed, overlap);
            for ((name, here), there) in scores.figures.iter().zip(set[kind].as_array().unwrap()) {
                let there = there.as_f64().unwrap();
                let miss = (here.unwrap_or(-1.0) - there).abs();
                assert!(miss < TOLERANCE, "set {number} {kind} {name}: {here:?} but {there}");
            }
        }
    }
}

#[test]
fn polygons_are_drawn_as_pycocotools_draws_them() {
    let golden = golden();
    let size: [u32; 2] = serde_json::from_value(golden["size"].clone()).unwrap();
    for shape in golden["polygons"].as_array().unwrap() {
        let polygons: Vec<Vec<f64>> = serde_json::from_value(shape["polygons"].clone()).unwrap();
        let masks = polygons.iter().map(|polygon| rasterize(polygon, size).unwrap());
        let mask = masks.reduce(|a, b| a.union(&b).unwrap()).unwrap();
        assert_eq!(mask.to_coco().counts, shape["counts"].as_str().unwrap());
        assert_eq!(mask.area(), shape["area"].as_u64().unwrap());
        let bounds: [f64; 4] = serde_json::from_value(shape["bbox"].clone()).unwrap();
        assert_eq!(mask.bounds().map(f64::from), bounds);
    }
}

#[test]
fn runs_unions_and_overlaps_are_those_of_pycocotools() {
    for pair in golden()["pairs"].as_array().unwrap() {
        let [a, b] = ["a", "b"].map(|name| rle(&pair[name]));
        assert_eq!(a.to_coco().counts, pair["a"]["counts"].as_str().unwrap());
        let lengths: Vec<u32> = serde_json::from_value(pair["lengths"]["counts"].clone()).unwrap();
        assert_eq!(a.counts(), lengths);
        assert_eq!(a.union(&b).unwrap().to_coco().counts, pair["union"].as_str().unwrap());
        let shared = a.intersection(&b).unwrap().area() as f64;
        let whole = a.union(&b).unwrap().area() as f64;
        let overlaps = [shared / whole, shared / a.area() as f64];
        for (here, there) in overlaps.iter().zip(pair["iou"].as_array().unwrap()) {
            assert!((here - there.as_f64().unwrap()).abs() < TOLERANCE);
        }
    }
}
