//! The dense fit on made-up streets: exact masks, hidden and cut vehicles, priors, and bad input.

#[path = "common/street.rs"]
mod street;

use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::detection::Detection;
use partpose::eval::pose_deviation;
use partpose::geometry::{EulerAngles, Extent, Rect, Vector3};
use partpose::oracle::{Degradation, Oracle, OracleOptions};
use partpose::parts::{PartMask, PartProbabilities};
use partpose::pose::dense::{
    DenseFlag, DenseOptions, DensePriors, GravityPrior, GroundPrior, SizePrior,
};
use partpose::pose::ground::GroundOptions;
use partpose::pose::scene::{SceneDetection, SceneOptions, estimate_scene};
use partpose::pose::{ExtentSource, NoPose, PnpMethod, PoseEstimator, PoseOptions};
use partpose::render::render_labels;
use partpose::vehicle::{ModelZoo, ParametricVehicle};
use street::{CAMERA, vehicle};

/// The detection of the first vehicle of a street.
fn detection(zoo: &ModelZoo, vehicles: Vec<VehicleLabel>, errors: Option<f64>) -> Detection {
    let sequence = SequenceId { world: "street".to_owned(), variation: String::new() };
    let mut frame = Frame::new(sequence, 0, CAMERA);
    frame.vehicles = vehicles;
    let image = render_labels(&CAMERA, &frame.instances(zoo));
    let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
    let oracle = Oracle::new(&frame, parts, zoo);
    let degradation = errors.map(|strength| Degradation { strength, seed: 3 });
    let options = OracleOptions { degradation, ..Default::default() };
    oracle.detection(0, &options).expect("the vehicle is seen")
}

fn estimator(zoo: &ModelZoo) -> PoseEstimator {
    PoseEstimator::new(zoo, &PoseOptions { method: PnpMethod::Dense, ..Default::default() })
}

#[test]
fn exact_masks_give_model_and_pose() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let mut sum = 0.0;
    for i in 0..8 {
        let (yaw, depth) = (f64::from(i) * 0.8 + 0.1, 9.0 + f64::from(i % 5) * 5.0);
        let label = vehicle(&zoo, i as usize % 2, [f64::from(i % 3) * 2.0 - 2.0, depth], yaw);
        let detection = detection(&zoo, vec![label.clone()], None);
        let found = estimator
            .estimate(&CAMERA, &detection, &ExtentSource::Given(label.cuboid.extent))
            .unwrap();
        assert_eq!(Some(found.model.as_str()), label.model.as_deref(), "vehicle {i}");
        let deviation = pose_deviation(&found.cuboid(), &label.cuboid, true);
        assert!(deviation.angle < 0.03, "vehicle {i}: {deviation:?}");
        sum += deviation.iou3d;
        let report = found.dense.unwrap();
        assert!(report.energy < 0.1 && report.confidence > 0.5, "vehicle {i}: {report:?}");
        assert!((report.model_probabilities.iter().sum::<f64>() - 1.0).abs() < 1e-9);
        assert!(report.covariance.cholesky().is_some());
    }
    assert!(sum / 8.0 > 0.93, "{}", sum / 8.0);
}

#[test]
fn a_vehicle_that_another_hides_or_the_image_cuts_is_found() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let hidden = vehicle(&zoo, 0, [0.0, 18.0], 0.6);
    let front = vehicle(&zoo, 1, [1.6, 12.0], 0.4);
    let cut = vehicle(&zoo, 0, [-5.6, 9.0], 0.5);
    assert_eq!(cut.truncated, 1);
    for (label, others) in [(hidden, vec![front]), (cut, vec![])] {
        let street: Vec<VehicleLabel> = std::iter::once(label.clone()).chain(others).collect();
        let detection = detection(&zoo, street, None);
        let found = estimator
            .estimate(&CAMERA, &detection, &ExtentSource::Given(label.cuboid.extent))
            .unwrap();
        let deviation = pose_deviation(&found.cuboid(), &label.cuboid, true);
        assert!(deviation.iou3d > 0.8, "{deviation:?}");
    }
}

#[test]
fn the_same_detection_gives_the_same_bits() {
    let zoo = ModelZoo::embedded();
    let label = vehicle(&zoo, 1, [2.0, 15.0], 2.2);
    let detection = detection(&zoo, vec![label.clone()], Some(0.9));
    let extent = ExtentSource::Given(label.cuboid.extent);
    let once = estimator(&zoo).estimate(&CAMERA, &detection, &extent).unwrap();
    let again = estimator(&zoo).estimate(&CAMERA, &detection, &extent).unwrap();
    assert_eq!(once, again);
}

#[test]
fn an_unknown_size_is_bought_back_by_the_ground() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let mut label = vehicle(&zoo, 0, [1.0, 16.0], 0.5);
    let e = zoo.models[0].extent();
    label.cuboid.extent = Extent::new(1.07 * e.width, 1.07 * e.height, 1.07 * e.length);
    label.bounds = label.cuboid.project(&CAMERA).unwrap();
    let detection = detection(&zoo, vec![label.clone()], None);
    let free = ExtentSource::Free(SizePrior::around(None));
    let z = |priors: &DensePriors| {
        let found = estimator.estimate_with(&CAMERA, &detection, &free, priors).unwrap();
        let report = found.dense.as_ref().unwrap();
        assert!(report.covariance_with_size.is_some());
        found.camera_from_vehicle.translation.z
    };
    let down = Vector3::y();
    let ground = DensePriors {
        gravity: Some(GravityPrior { down_in_camera: down, sigma: 0.03 }),
        ground: Some(GroundPrior { normal_in_camera: down, offset: 1.6, sigma: 0.02 }),
    };
    let (without, with) = (z(&DensePriors::default()), z(&ground));
    assert!((with - 16.0).abs() < 0.35, "{with}");
    assert!((without - 16.0).abs() > 2.0 * (with - 16.0).abs(), "{without} {with}");
}

/// The detections of all vehicles of a street, without what a network does not say.
fn detections(zoo: &ModelZoo, vehicles: &[VehicleLabel]) -> Vec<Detection> {
    let rotated = (0..vehicles.len()).map(|first| {
        let mut street = vehicles.to_vec();
        street.swap(0, first);
        Detection { unknown: None, ..detection(zoo, street, None) }
    });
    rotated.collect()
}

#[test]
fn a_nearer_vehicle_tells_what_it_hides() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let street = [vehicle(&zoo, 0, [0.0, 18.0], 0.6), vehicle(&zoo, 1, [1.7, 12.0], 0.4)];
    let detections = detections(&zoo, &street);
    let iou = |occlusion: bool| {
        let given: Vec<SceneDetection> = detections
            .iter()
            .zip(&street)
            .map(|(detection, label)| SceneDetection {
                detection,
                extent: ExtentSource::Given(label.cuboid.extent),
            })
            .collect();
        let options = SceneOptions { occlusion, ..Default::default() };
        let found = estimate_scene(&estimator, &zoo, &CAMERA, &given, &options);
        let hidden = found.vehicles[0].as_ref().unwrap();
        pose_deviation(&hidden.cuboid(), &street[0].cuboid, true).iou3d
    };
    let (alone, together) = (iou(false), iou(true));
    assert!(together > 0.8 && together > alone, "{alone} {together}");
}

#[test]
fn a_street_of_unknown_sizes_finds_its_road() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let places = [[-3.0, 9.0], [2.5, 13.0], [-5.0, 19.0], [4.0, 24.0], [0.0, 31.0]];
    let scales = [1.05, 0.95, 1.03, 0.97, 1.0];
    let mut street: Vec<VehicleLabel> = Vec::new();
    for ((place, scale), yaw) in places.into_iter().zip(scales).zip([0.2, 1.0, 2.0, 2.8, 4.0]) {
        let mut label = vehicle(&zoo, 0, place, yaw);
        let e = zoo.models[0].extent();
        label.cuboid.extent = Extent::new(scale * e.width, scale * e.height, scale * e.length);
        let upright = EulerAngles { x: 0.0, y: yaw, z: 0.0 }.to_rotation();
        label.cuboid.camera_from_vehicle.rotation =
            nalgebra::UnitQuaternion::from_rotation_matrix(&upright);
        label.bounds = label.cuboid.project(&CAMERA).unwrap();
        street.push(label);
    }
    let detections = detections(&zoo, &street);
    let given: Vec<SceneDetection> = detections
        .iter()
        .map(|detection| SceneDetection {
            detection,
            extent: ExtentSource::Free(SizePrior::around(None)),
        })
        .collect();
    let mean = |ground: Option<GroundOptions>| {
        let options = SceneOptions { occlusion: true, gravity: None, ground };
        let found = estimate_scene(&estimator, &zoo, &CAMERA, &given, &options);
        let iou = found.vehicles.iter().zip(&street).map(|(found, label)| {
            pose_deviation(&found.as_ref().unwrap().cuboid(), &label.cuboid, true).iou3d
        });
        iou.sum::<f64>() / street.len() as f64
    };
    let known = GroundOptions { camera_height: Some([1.6, 0.01]), ..Default::default() };
    let (without, with) = (mean(None), mean(Some(known)));
    assert!(with > 0.6 && with > without, "{without} {with}");
}

#[test]
fn bad_detections_have_reasons_and_no_panic() {
    let zoo = ModelZoo::embedded();
    let estimator = estimator(&zoo);
    let label = vehicle(&zoo, 0, [0.0, 15.0], 0.3);
    let good = detection(&zoo, vec![label.clone()], None);
    let extent = ExtentSource::Given(label.cuboid.extent);
    let fit = |detection: &Detection| estimator.estimate(&CAMERA, detection, &extent);
    let mut background = vec![0.0; 30 * 28 * 28];
    background[..28 * 28].fill(1.0);
    let empty = Detection {
        probabilities: PartProbabilities::new(28, background).unwrap(),
        ..good.clone()
    };
    assert!(matches!(fit(&empty), Err(NoPose::TooLittleEvidence { .. })));
    let blind = Detection { unknown: Some(vec![1.0; 28 * 28]), ..good.clone() };
    assert!(matches!(fit(&blind), Err(NoPose::TooLittleEvidence { .. })));
    for bounds in [
        Rect::new(f64::NAN, 0.0, 10.0, 10.0),
        Rect::new(10.0, 10.0, 10.0, 20.0),
        Rect::new(-500.0, -500.0, -400.0, -400.0),
    ] {
        assert!(fit(&Detection { bounds, ..good.clone() }).is_err());
    }
    let odd = Detection { unknown: Some(vec![f32::NAN; 28 * 28]), ..good.clone() };
    drop(fit(&odd));
    // One part everywhere: some pose comes out, and says that it is not to be trusted.
    let mut hood = vec![0.0; 30 * 28 * 28];
    hood[27 * 28 * 28..28 * 28 * 28].fill(1.0);
    let hood =
        Detection { probabilities: PartProbabilities::new(28, hood).unwrap(), ..good.clone() };
    let found = fit(&hood).unwrap().dense.unwrap();
    assert!(found.flags.contains(&DenseFlag::PoorFit), "{found:?}");
    assert!(found.confidence < 0.5);
}

#[test]
fn measures_of_a_vehicle_that_the_zoo_lacks_are_fitted() {
    let between = ParametricVehicle::sedan().lerp(&ParametricVehicle::estate(), 0.4);
    let foreign = ModelZoo { models: vec![between.build().unwrap()] };
    let zoo = ModelZoo { models: vec![ParametricVehicle::sedan().build().unwrap()] };
    let mut found = [false, true].map(|fit_shape| {
        let dense = DenseOptions { fit_shape, ..Default::default() };
        let method = PnpMethod::Dense;
        let estimator =
            PoseEstimator::new(&zoo, &PoseOptions { method, dense, ..Default::default() });
        let label = vehicle(&foreign, 0, [0.5, 11.0], 1.9);
        let detection = detection(&foreign, vec![label.clone()], None);
        let extent = ExtentSource::Given(label.cuboid.extent);
        let found = estimator.estimate(&CAMERA, &detection, &extent).unwrap();
        (pose_deviation(&found.cuboid(), &label.cuboid, true).iou3d, found.dense.unwrap())
    });
    let [(plain_iou, plain), (iou, shaped)] = &mut found;
    assert!(plain.shape.is_empty() && shaped.shape.len() > 4);
    assert!(shaped.energy < 0.9 * plain.energy, "{} {}", plain.energy, shaped.energy);
    assert!(*iou > *plain_iou - 0.02, "{plain_iou} {iou}");
    assert!(shaped.shape.iter().all(|m| (m.value - m.of_model).abs() <= 3.01 * m.spread));
    assert!(shaped.covariance.cholesky().is_some());
}

#[test]
fn wheels_behind_a_guard_rail_do_not_move_the_vehicle() {
    let zoo = ModelZoo { models: vec![ModelZoo::embedded().models.swap_remove(2)] };
    let label = vehicle(&zoo, 0, [-6.0, 21.0], 2.7);
    let mut frame =
        Frame::new(SequenceId { world: "road".into(), variation: String::new() }, 0, CAMERA);
    frame.vehicles = vec![label.clone()];
    let mut image = render_labels(&CAMERA, &frame.instances(&zoo));
    let width = image.size[0] as usize;
    let rail = (label.bounds.y_max - 0.22 * label.bounds.height()) as usize;
    image.parts[rail * width..].fill(0);
    let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
    let detection =
        Oracle::new(&frame, parts, &zoo).detection(0, &OracleOptions::default()).unwrap();
    let extent = ExtentSource::Given(label.cuboid.extent);
    let found = estimator(&zoo).estimate(&CAMERA, &detection, &extent).unwrap();
    let deviation = pose_deviation(&found.cuboid(), &label.cuboid, true);
    assert!(deviation.iou3d > 0.85, "{deviation:?}");
}

#[test]
fn a_van_owns_its_pixels_whether_masks_label_it_or_not() {
    let zoo = ModelZoo { models: ModelZoo::embedded().models.into_iter().take(2).collect() };
    let mut van = vehicle(&zoo, 1, [1.5, 13.0], 0.3);
    van.category = "Van".to_owned();
    let mut frame =
        Frame::new(SequenceId { world: "road".into(), variation: String::new() }, 0, CAMERA);
    frame.vehicles = vec![vehicle(&zoo, 0, [0.0, 9.0], 0.5), van];
    let image = render_labels(&CAMERA, &frame.instances(&zoo));
    for labelled in [true, false] {
        let own = image.parts.iter().zip(&image.instances);
        let labels = own.map(|(part, id)| if *id == 2 && !labelled { 0 } else { *part });
        let parts = PartMask { origin: [0, 0], size: image.size, labels: labels.collect() };
        assert_eq!(Oracle::new(&frame, parts, &zoo).owners(), image.instances, "{labelled}");
    }
}
