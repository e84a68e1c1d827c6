//! Models of others with a mapping: what they say of boxes and parts in their own ways becomes detections.
//!
//! The models are written here: their outputs are constants but for the scores, which are the mean of the input's first
//! channel, so that it shows how the image goes in.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]
#![expect(clippy::print_stderr, reason = "a test that is skipped says so")]

use partpose::detection::Detection;
use partpose::files::RgbImage;
use partpose::geometry::Rect;
use partpose::parts::{CHANNELS, PartClass, Scaling};
use partpose_net::onnx::{Attribute, Axis, Element, Graph, Value};
use partpose_onnx::{Mapping, OnnxDetector, OnnxError, library};

/// Red is 51, green 102, blue 204.
fn image(size: [u32; 2]) -> RgbImage {
    let pixels = [51, 102, 204].repeat(size[0] as usize * size[1] as usize);
    RgbImage { size, pixels }
}

/// A model with boxes, scores and other outputs; all scores are the mean of the first channel.
fn model(boxes: &[[f32; 4]], more: &dyn Fn(&mut Graph)) -> Vec<u8> {
    let mut g = Graph::new("test");
    let free = Axis::Free;
    let axes = [Axis::Fixed(1), Axis::Fixed(3), free("height"), free("width")];
    let image = g.input("picture", Element::Float, &axes);
    let [from, to, axis] = [0, 1, 1].map(|value| g.ints(&[value]));
    let first = g.node("Slice", &[&image, &from, &to, &axis], &[]);
    let mean = g.node("ReduceMean", &[&first], &[("keepdims", Attribute::Int(0))]);
    let ones = g.floats(&vec![1.0; boxes.len()], &[1, boxes.len()]);
    let scores = g.node("Mul", &[&ones, &mean], &[]);
    g.output(&scores, "sure", Element::Float, &[Axis::Fixed(1), Axis::Fixed(boxes.len())]);
    let boxes_ = g.floats(&boxes.concat(), &[1, boxes.len(), 4]);
    let axes = [1, boxes.len(), 4].map(Axis::Fixed);
    g.output(&boxes_, "places", Element::Float, &axes);
    more(&mut g);
    g.finish(&[])
}

fn add(g: &mut Graph, name: &str, value: &Value, shape: &[usize]) {
    let axes: Vec<Axis> = shape.iter().map(|length| Axis::Fixed(*length)).collect();
    g.output(value, name, Element::Float, &axes);
}

fn mapping(text: &str) -> Mapping {
    toml::from_str(text).unwrap()
}

/// What a model finds, or `None` where there is no library.
fn detect(model: &[u8], map: &str, image: &RgbImage) -> Option<Result<Vec<Detection>, OnnxError>> {
    if let Err(error) = library::find(None) {
        eprintln!("skipped: {error}");
        return None;
    }
    Some(OnnxDetector::new(model, mapping(map), None).and_then(|d| d.detect(image)))
}

const GRIDS: &str = r#"
classes = ["background", "light_FL", "", "hood"]

[input]
name = "picture"
resize = { kind = "stretch", size = [200, 100] }
channels = "bgr"
deviation = [255.0, 255.0, 255.0]

[output]
boxes = "places"
box_format = "centre"
scores = "sure"
parts = { kind = "boxes", name = "grids", values = "logits" }
"#;

#[test]
fn grids_of_logits_over_boxes_become_part_probabilities() {
    let known = PartClass::ALL.map(PartClass::name);
    let (light, hood) = (known[0], known[28]);
    let map = GRIDS.replace("light_FL", light).replace("hood", hood);
    // Upper cells say light, lower left the class without a name, lower right hood.
    let more = |g: &mut Graph| {
        let mut logits = [0.0; 16];
        for (class, cell) in [(1, 0), (1, 1), (2, 2), (3, 3)] {
            logits[class * 4 + cell] = 20.0;
        }
        let grids = g.floats(&logits, &[1, 4, 2, 2]);
        add(g, "grids", &grids, &[1, 4, 2, 2]);
    };
    let bytes = model(&[[100.0, 50.0, 40.0, 20.0]], &more);
    let Some(found) = detect(&bytes, &map, &image([400, 200])) else { return };
    let found = found.unwrap();
    assert_eq!(found.len(), 1);
    let detection = &found[0];
    // Twice as large as the input.
    assert_eq!(detection.bounds, Rect::new(159.5, 79.5, 239.5, 119.5));
    // Blue comes first.
    assert!((detection.score - 204.0 / 255.0).abs() < 1e-3, "{}", detection.score);
    let values = detection.probabilities.values();
    assert_eq!(values.len(), CHANNELS * 4);
    let of = |channel: usize| values[4 * channel..4 * channel + 4].to_vec();
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
    assert!(near(&of(1), &[1.0, 1.0, 0.0, 0.0]) && near(&of(29), &[0.0, 0.0, 0.0, 1.0]));
    assert!(near(&of(0), &[0.0, 0.0, 1.0, 0.0]), "{values:?}");
}

#[test]
fn masks_of_parts_as_instances_become_part_probabilities_of_the_vehicles() {
    let part = PartClass::ALL[4];
    let map = format!(
        r#"
        classes = ["background", "{}", "vehicle"]
        [input]
        deviation = [255.0, 255.0, 255.0]
        [output]
        boxes = "places"
        scores = "sure"
        labels = "what"
        parts = {{ kind = "instances", masks = "masks", kernel = 4 }}
        "#,
        part.name()
    );
    let more = |g: &mut Graph| {
        // The part fills the left half of the vehicle, 8 x 8 pixels at (4, 2).
        let mut masks = vec![0.0; 2 * 16 * 12];
        for (y, x) in (2..10).flat_map(|y| (4..8).map(move |x| (y, x))) {
            masks[y * 16 + x] = 0.9;
        }
        let masks = g.floats(&masks, &[2, 1, 12, 16]);
        add(g, "masks", &masks, &[2, 1, 12, 16]);
        let labels = g.ints(&[1, 2]);
        g.output(&labels, "what", Element::Int, &[Axis::Fixed(2)]);
    };
    let bytes = model(&[[4.0, 2.0, 8.0, 10.0], [4.0, 2.0, 12.0, 10.0]], &more);
    let Some(found) = detect(&bytes, &map, &image([16, 12])) else { return };
    let found = found.unwrap();
    assert_eq!(found.len(), 1);
    let detection = &found[0];
    assert!((detection.score - 0.2).abs() < 1e-5);
    let mask = detection.part_mask([16, 12], Scaling::Nearest);
    let right = |x: i32, y: i32| {
        let inside = (4..8).contains(&x) && (2..10).contains(&y);
        mask.at(x, y) == if inside { part.id() } else { 0 }
    };
    assert!((0..12).all(|y| (0..16).all(|x| right(x, y))), "{mask:?}");
}

#[test]
fn classes_of_the_whole_image_become_part_probabilities() {
    let map = r#"
        [input]
        deviation = [255.0, 255.0, 255.0]
        [output]
        boxes = "places"
        box_shares = true
        box_format = "corners-yx"
        scores = "sure"
        parts = { kind = "image", name = "classes", kernel = 2 }
        "#;
    let more = |g: &mut Graph| {
        // Half the resolution: the lower half is part 7.
        let classes: Vec<f32> = (0..48).map(|i| if i >= 24 { 7.0 } else { 0.0 }).collect();
        let classes = g.floats(&classes, &[1, 6, 8]);
        add(g, "classes", &classes, &[1, 6, 8]);
    };
    let bytes = model(&[[0.0, 0.0, 1.0, 1.0]], &more);
    let Some(found) = detect(&bytes, map, &image([16, 12])) else { return };
    let detection = &found.unwrap()[0];
    assert_eq!(detection.bounds, Rect::new(-0.5, -0.5, 15.5, 11.5));
    let values = detection.probabilities.values();
    assert_eq!(values[4 * 7..4 * 8], [0.0, 0.0, 1.0, 1.0]);
}

#[test]
fn what_does_not_fit_is_told_by_name() {
    let more = |g: &mut Graph| {
        let grids = g.floats(&[0.25; 16], &[1, 4, 2, 2]);
        add(g, "grids", &grids, &[1, 4, 2, 2]);
    };
    let bytes = model(&[[0.0, 0.0, 9.0, 9.0]], &more);
    let hood = PartClass::ALL[28].name();
    let good = GRIDS.replace("light_FL", hood).replace("hood", hood);
    let cases = [
        (good.replace("\"picture\"", "\"pixels\""), vec!["input `pixels`", "`picture`"]),
        (good.replace("\"places\"", "\"boxes\""), vec!["output `boxes`", "`places`"]),
        (good.replace("\"sure\"", "\"places\""), vec!["`places`", "[1], one a box"]),
        (good.replace("\"\", ", ""), vec!["`grids`", "[1, 4, 2, 2]", "[n, 3, m, m]"]),
        (good.replace("\"\"", "\"wing\""), vec!["`wing`, which is no part", hood]),
        (good.replace("[200, 100]", "[0, 100]"), vec!["size` holds a zero"]),
    ];
    for (map, told) in cases {
        let Some(found) = detect(&bytes, &map, &image([40, 20])) else { return };
        let said = found.unwrap_err().to_string();
        assert!(told.iter().all(|told| said.contains(told)), "{said}\n{map}");
    }
    let Some(found) = detect(b"no model", &good, &image([40, 20])) else { return };
    assert!(found.unwrap_err().to_string().contains("refuses the model"));
}
