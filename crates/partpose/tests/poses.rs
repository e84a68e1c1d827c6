//! The way of one frame on made-up streets: masks of the embedded models, the oracle, the pose stage, the scores.

#[path = "common/street.rs"]
mod street;

use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::eval::{PoseScores, pose_deviation, summarize};
use partpose::geometry::{Rect, Vector3};
use partpose::oracle::{Oracle, OracleBox, OracleOptions};
use partpose::parts::{BACKGROUND, PartMask};
use partpose::pose::{
    Center2d, Center3d, ExtentSource, NoPose, PartFilters, PnpMethod, PoseEstimator, PoseOptions,
};
use partpose::render::render_labels;
use partpose::vehicle::ModelZoo;
use street::{CAMERA, vehicle};

/// A frame with its part mask.
fn street(zoo: &ModelZoo, vehicles: Vec<VehicleLabel>) -> (Frame, PartMask) {
    let sequence = SequenceId { world: "street".to_owned(), variation: String::new() };
    let mut frame = Frame::new(sequence, 0, CAMERA);
    frame.vehicles = vehicles;
    let image = render_labels(&CAMERA, &frame.instances(zoo));
    (frame, PartMask { origin: [0, 0], size: image.size, labels: image.parts })
}

#[test]
fn only_vehicles_of_the_zoo_become_instances() {
    let zoo = ModelZoo::embedded();
    let unknown = |model: Option<&str>| VehicleLabel {
        model: model.map(str::to_owned),
        ..vehicle(&zoo, 0, [0.0, 15.0], 0.3)
    };
    let known = vehicle(&zoo, 1, [3.0, 20.0], 0.1);
    let (frame, _) = street(&zoo, vec![unknown(None), unknown(Some("tank")), known]);
    let [instance] = frame.instances(&zoo)[..] else { panic!("one is known") };
    assert_eq!(instance.id, 3);
    let stretch = instance.scale - Vector3::new(0.97, 1.0, 1.04);
    assert!(stretch.amax() < 1e-12, "{:?}", instance.scale);
}

/// Sixteen free-standing vehicles, one a frame, from all sides and at several distances.
fn scores(options: &PoseOptions, kernel: usize) -> PoseScores {
    let zoo = ModelZoo::embedded();
    let estimator = PoseEstimator::new(&zoo, options);
    let scored = (0..16).map(|i| {
        let (yaw, depth) = (f64::from(i) * 0.4 + 0.1, 9.0 + f64::from(i % 5) * 5.0);
        let label = vehicle(&zoo, i as usize % 2, [f64::from(i % 3) * 2.0 - 2.0, depth], yaw);
        let (frame, parts) = street(&zoo, vec![label]);
        let oracle = Oracle::new(&frame, parts, &zoo);
        let label = &frame.vehicles[0];
        let detection = oracle
            .detection(0, &OracleOptions { kernel, ..Default::default() })
            .expect("it is seen");
        let extent = ExtentSource::Given(label.cuboid.extent);
        let estimate = estimator.estimate(&CAMERA, &detection, &extent).ok()?;
        let right = label.model.as_deref() == Some(estimate.model.as_str());
        Some(pose_deviation(&estimate.cuboid(), &label.cuboid, right))
    });
    summarize(scored)
}

#[test]
fn visible_centres_find_pose_and_model() {
    let options = PoseOptions {
        center_2d: Center2d::Mass,
        center_3d: Center3d::Visible,
        method: PnpMethod::Sqpnp,
        refine: true,
        ..Default::default()
    };
    let found = scores(&options, 56);
    // What is fitted is what was drawn: only the kernel's cells and the drawing's samples are between.
    assert!(found.mean_iou3d_all > 0.85, "{found:?}");
    assert!(found.model_precision > 0.9 && found.delta_r < 0.1, "{found:?}");
}

#[test]
fn paper_setting_finds_most_and_visible_centres_more() {
    let paper = scores(
        &PoseOptions { center_2d: Center2d::Mass, center_3d: Center3d::Mass, ..Default::default() },
        28,
    );
    let visible = scores(
        &PoseOptions {
            center_2d: Center2d::Mass,
            center_3d: Center3d::Visible,
            ..Default::default()
        },
        28,
    );
    assert!(paper.unfittable < 0.01 && paper.mean_iou3d > 0.2, "{paper:?}");
    assert!(visible.mean_iou3d > paper.mean_iou3d + 0.1, "{paper:?} {visible:?}");
}

#[test]
fn what_a_nearer_vehicle_hides_is_unknown() {
    let zoo = ModelZoo::embedded();
    let near = vehicle(&zoo, 0, [-0.5, 12.0], 0.2);
    let far = vehicle(&zoo, 1, [0.8, 20.0], 0.1);
    let (frame, parts) = street(&zoo, vec![near, far]);
    let oracle = Oracle::new(&frame, parts, &zoo);
    let detection = oracle.detection(1, &OracleOptions::default()).expect("part of it is seen");
    let unknown = detection.unknown.expect("part of it is hidden");
    let share = unknown.iter().sum::<f32>() / unknown.len() as f32;
    assert!((0.1..0.9).contains(&share), "{share}");
    // Its own mask holds nothing of the nearer vehicle.
    let own = oracle.vehicle_mask(1, &detection.bounds);
    let both = own.labels.iter().filter(|label| **label != BACKGROUND).count();
    assert!((both as f64) < (1.0 - f64::from(share)) * own.labels.len() as f64);
}

#[test]
fn tight_box_lies_within_the_annotated_one() {
    let zoo = ModelZoo::embedded();
    let (frame, parts) = street(&zoo, vec![vehicle(&zoo, 0, [1.0, 15.0], 0.7)]);
    let oracle = Oracle::new(&frame, parts, &zoo);
    let annotated = oracle.detection(0, &OracleOptions::default()).expect("it is seen").bounds;
    let options = OracleOptions { bounds: OracleBox::Tight, ..Default::default() };
    let tight = oracle.detection(0, &options).expect("it is seen").bounds;
    let grown = Rect::new(
        annotated.x_min - 1.0,
        annotated.y_min - 1.0,
        annotated.x_max + 1.0,
        annotated.y_max + 1.0,
    );
    assert_eq!(tight.intersection(&grown), Some(tight));
    assert!((0.6..1.0).contains(&tight.iou(&annotated)), "{tight:?} {annotated:?}");
}

#[test]
fn too_few_parts_have_a_reason() {
    let zoo = ModelZoo::embedded();
    let (frame, parts) = street(&zoo, vec![vehicle(&zoo, 0, [0.0, 15.0], 0.0)]);
    let oracle = Oracle::new(&frame, parts, &zoo);
    let detection = oracle.detection(0, &OracleOptions::default()).expect("it is seen");
    // Parts must fill half of the box: none does.
    let filters = PartFilters { small_parts: Some(0.5), ..Default::default() };
    let estimator = PoseEstimator::new(&zoo, &PoseOptions { filters, ..Default::default() });
    let outcome = estimator.estimate(&CAMERA, &detection, &ExtentSource::Model);
    let Err(NoPose::TooFewCorrespondences { found: 0, seen }) = outcome else {
        panic!("{outcome:?}");
    };
    assert!(seen > 10, "{seen}");
}

#[test]
fn sizes_come_from_where_they_are_asked_from() {
    let zoo = ModelZoo::embedded();
    let label = vehicle(&zoo, 0, [1.0, 15.0], 0.7);
    let truth = label.cuboid.extent;
    let (frame, parts) = street(&zoo, vec![label]);
    let oracle = Oracle::new(&frame, parts, &zoo);
    let detection = oracle.detection(0, &OracleOptions::default()).expect("it is seen");
    let estimator = PoseEstimator::new(&zoo, &PoseOptions::default());
    let extent = |source| {
        let estimate = estimator.estimate(&CAMERA, &detection, &source).expect("it is fitted");
        (estimate.extent, zoo.models[estimate.model_index].extent())
    };
    let (given, _) = extent(ExtentSource::Given(truth));
    assert!(given.l1_distance(&truth) < 1e-9);
    let (own, model) = extent(ExtentSource::Model);
    assert!(own.l1_distance(&model) < 1e-9);
    let (uniform, model) = extent(ExtentSource::GivenUniform(truth));
    assert!((uniform.volume() - truth.volume()).abs() < 1e-9);
    let ratio = uniform.ratio(&model);
    assert!((ratio.x - ratio.y).abs() < 1e-9 && (ratio.x - ratio.z).abs() < 1e-9);
}
