//! What a mask shows of each part against the model: intact vehicles, and such with a part removed, opened or painted.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

use std::sync::LazyLock;

use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::detection::Detection;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Pose, Vector3};
use partpose::oracle::{Oracle, OracleOptions};
use partpose::parts::{PartClass, PartMask};
use partpose::pose::{
    ExtentSource, PartState, PartVerdict, PnpMethod, PoseEstimate, PoseEstimator, PoseOptions,
    ReasonCode, reasons,
};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::{Mesh, ModelZoo};

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

fn label(zoo: &ModelZoo, depth: f64, yaw: f64) -> VehicleLabel {
    let model = &zoo.models[0];
    let rotation = EulerAngles { x: 0.01, y: yaw, z: 0.0 }.to_rotation();
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
    let camera_from_vehicle = Pose::from_parts(Vector3::new(0.4, 1.5, depth).into(), rotation);
    let cuboid = Cuboid { camera_from_vehicle, extent: model.extent() };
    VehicleLabel {
        track: Some(0),
        category: "Car".to_owned(),
        dont_care: false,
        truncated: 0,
        occluded: 0,
        truncation: 0.0,
        occupancy: None,
        bounds: cuboid.project(&CAMERA).unwrap(),
        cuboid,
        model: Some(model.name().to_owned()),
        color: None,
    }
}

/// The detection of a vehicle whose mesh was changed.
fn detection(zoo: &ModelZoo, label: &VehicleLabel, mesh: &Mesh) -> Detection {
    let sequence = SequenceId { world: "yard".to_owned(), variation: String::new() };
    let mut frame = Frame::new(sequence, 0, CAMERA);
    frame.vehicles = vec![label.clone()];
    let instance = Instance {
        mesh,
        scale: Vector3::repeat(1.0),
        camera_from_vehicle: label.cuboid.camera_from_vehicle,
        id: 1,
    };
    let image = render_labels(&CAMERA, &[instance]);
    let parts = PartMask { origin: [0, 0], size: image.size, labels: image.parts };
    Oracle::new(&frame, parts, zoo).detection(0, &OracleOptions::default()).unwrap()
}

/// The parts of a vehicle with a changed mesh, as the fit of the whole zoo sees them.
fn observed(label: &VehicleLabel, change: impl Fn(&Mesh) -> Mesh) -> PoseEstimate {
    // Getting a model ready takes longer than a fit.
    static READY: LazyLock<(ModelZoo, PoseEstimator)> = LazyLock::new(|| {
        let one = ModelZoo { models: vec![ModelZoo::embedded().models[0].clone()] };
        let options = PoseOptions { method: PnpMethod::Dense, ..Default::default() };
        let estimator = PoseEstimator::new(&one, &options);
        (one, estimator)
    });
    let (zoo, estimator) = &*READY;
    let detection = detection(zoo, label, &change(zoo.models[0].mesh()));
    let extent = ExtentSource::Given(label.cuboid.extent);
    let mut estimate = estimator.estimate(&CAMERA, &detection, &extent).unwrap();
    estimator.observe(&CAMERA, &detection, &mut estimate);
    for part in estimate.parts.iter().filter_map(|part| part.bounds) {
        let [low, high] = [(part.x_min, part.y_min), (part.x_max, part.y_max)];
        let b = &detection.bounds;
        assert!(low.0 >= b.x_min - 1.0 && low.1 >= b.y_min - 1.0);
        assert!(high.0 <= b.x_max + 1.0 && high.1 <= b.y_max + 1.0);
    }
    estimate
}

fn part(estimate: &PoseEstimate, part: PartClass) -> &PartState {
    estimate.parts.iter().find(|state| state.part == part).expect("the part is listed")
}

#[test]
fn an_intact_vehicle_agrees_with_its_model_part_by_part() {
    let zoo = ModelZoo::embedded();
    for (depth, yaw) in [(9.0, 0.6), (14.0, 2.4), (11.0, -1.2)] {
        let label = label(&zoo, depth, yaw);
        let estimate = observed(&label, Clone::clone);
        let wrong =
            |p: &&PartState| !matches!(p.verdict, PartVerdict::Agrees | PartVerdict::TooSmall);
        let wrong: Vec<_> = estimate.parts.iter().filter(wrong).collect();
        assert!(wrong.is_empty(), "{wrong:?}");
        let seen: Vec<_> =
            estimate.parts.iter().filter(|p| p.verdict == PartVerdict::Agrees).collect();
        assert!(seen.len() >= 6, "{} parts", seen.len());
        let wheels = seen.iter().filter(|p| p.part.name().starts_with("wheel"));
        let mut count = 0;
        for wheel in wheels {
            let place = wheel.point_in_vehicle.unwrap();
            let half = label.cuboid.extent;
            assert!(place.y > -0.5 * half.height && place.x.abs() > 0.25 * half.width, "{wheel:?}");
            let pixel = CAMERA.project(&wheel.point_in_camera.unwrap()).unwrap();
            let away = (pixel - wheel.point_in_image.unwrap()).norm();
            assert!(away < 4.0, "{away:.1} px");
            count += 1;
        }
        assert!(count >= 1, "no wheel at yaw {yaw}");
    }
}

#[test]
#[expect(clippy::print_stdout, reason = "docs/dense-fit.md quotes the rates")]
fn a_torn_off_mirror_is_told_and_whole_cars_raise_few_alarms() {
    let zoo = ModelZoo::embedded();
    let is_mirror = |part: PartClass| part.name().starts_with("mirror");
    let (mut judged, mut alarms, mut shown, mut told, mut wrong) = (0, 0, 0, 0, 0);
    for depth in [6.0, 9.0] {
        for step in 0..8 {
            let label = label(&zoo, depth, 0.15 + f64::from(step) * 0.785);
            let intact = observed(&label, Clone::clone);
            let is_false =
                |p: &&PartState| !matches!(p.verdict, PartVerdict::Agrees | PartVerdict::TooSmall);
            judged += intact.parts.len();
            alarms += intact.parts.iter().filter(is_false).count();
            let agree = intact.parts.iter().filter(|p| p.verdict == PartVerdict::Agrees);
            for mirror in agree.map(|p| p.part).filter(|part| is_mirror(*part)) {
                let torn = observed(&label, |mesh| without(mesh, mirror));
                let verdict = |part| torn.parts.iter().find(|p| p.part == part).map(|p| p.verdict);
                shown += 1;
                told += usize::from(verdict(mirror) == Some(PartVerdict::Missing));
                let other = verdict(mirror.opposite());
                wrong += usize::from(other == Some(PartVerdict::Missing));
            }
        }
    }
    println!("{alarms} alarms of {judged} parts; {told} of {shown} mirrors told, {wrong} others");
    assert!(shown >= 12, "{shown} mirrors are large enough to be judged");
    assert!(told * 10 >= shown * 8, "{told} of {shown} are told");
    assert!(alarms * 100 <= judged, "{alarms} alarms of {judged}");
    assert_eq!(wrong, 0, "mirrors that are there");
}

fn without(mesh: &Mesh, part: PartClass) -> Mesh {
    let keep = |i: &usize| mesh.parts[*i] != part;
    let kept: Vec<usize> = (0..mesh.faces.len()).filter(keep).collect();
    Mesh {
        vertices: mesh.vertices.clone(),
        faces: kept.iter().map(|i| mesh.faces[*i]).collect(),
        parts: kept.iter().map(|i| mesh.parts[*i]).collect(),
    }
}

#[test]
fn an_open_door_is_elsewhere() {
    let zoo = ModelZoo::embedded();
    let label = label(&zoo, 9.0, 1.2);
    let intact = observed(&label, Clone::clone);
    let doors = [PartClass::DoorFrontLeft, PartClass::DoorFrontRight];
    let agrees = |door: &PartClass| {
        intact.parts.iter().any(|p| p.part == *door && p.verdict == PartVerdict::Agrees)
    };
    let door = doors.into_iter().find(agrees).expect("one side is seen");
    let estimate = observed(&label, |mesh| opened(mesh, door));
    let state = part(&estimate, door);
    assert!(matches!(state.verdict, PartVerdict::Displaced | PartVerdict::Missing), "{state:?}");
    assert!(state.agreement < part(&intact, door).agreement - 0.3);
}

/// A door swung by 70 degrees about its front edge; behind it is what does not belong to any part of the outside.
fn opened(mesh: &Mesh, door: PartClass) -> Mesh {
    let mut open = mesh.clone();
    let own = mesh.part_vertices(door);
    let at = |i: u32| mesh.vertices[i as usize];
    let hinge = own.iter().map(|i| at(*i)).max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    let side = hinge.x.signum();
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), side * 70f64.to_radians());
    let first = open.vertices.len() as u32;
    open.vertices.extend(own.iter().map(|i| hinge + turn * (at(*i) - hinge)));
    let swung = |i: u32| first + own.binary_search(&i).unwrap() as u32;
    let moved: Vec<usize> = (0..mesh.faces.len()).filter(|i| mesh.parts[*i] == door).collect();
    for face in moved {
        let [a, b, c] = mesh.faces[face].map(swung);
        // Seen from both sides.
        open.faces.extend([[a, b, c], [a, c, b]]);
        open.parts.extend([door; 2]);
        open.parts[face] = PartClass::Hood;
    }
    open
}

#[test]
fn a_lamp_that_was_painted_over_is_missing() {
    let zoo = ModelZoo::embedded();
    let label = label(&zoo, 8.0, 0.3);
    let intact = observed(&label, Clone::clone);
    let lamps = [PartClass::LightRearLeft, PartClass::LightRearRight];
    for lamp in lamps {
        assert_eq!(part(&intact, lamp).verdict, PartVerdict::Agrees);
        let estimate = observed(&label, |mesh| {
            let mut painted = mesh.clone();
            for part in painted.parts.iter_mut().filter(|part| **part == lamp) {
                *part = PartClass::ApronRear;
            }
            painted
        });
        assert_eq!(part(&estimate, lamp).verdict, PartVerdict::Missing);
        let other = part(&estimate, lamp.opposite());
        assert_eq!(other.verdict, PartVerdict::Agrees);
    }
}

#[test]
fn reasons_name_what_is_wrong() {
    let zoo = ModelZoo::embedded();
    let label = label(&zoo, 12.0, 0.4);
    let detection = detection(&zoo, &label, zoo.models[0].mesh());
    let options = PoseOptions { method: PnpMethod::Dense, ..Default::default() };
    let estimator = PoseEstimator::new(&zoo, &options);
    let codes = |extent: &ExtentSource, detection: &Detection| -> Vec<ReasonCode> {
        let outcome = estimator.estimate(&CAMERA, detection, extent);
        let all = reasons(&outcome);
        assert!(all.iter().all(|reason| !reason.words.is_empty()));
        all.into_iter().map(|reason| reason.code).collect()
    };
    let given = ExtentSource::Given(label.cuboid.extent);
    assert!(!codes(&given, &detection).contains(&ReasonCode::PoorFit));
    assert!(codes(&ExtentSource::Model, &detection).contains(&ReasonCode::SizeUnknown));
    let mut hidden = detection.clone();
    hidden.unknown = Some(vec![1.0; 28 * 28]);
    assert_eq!(codes(&given, &hidden), [ReasonCode::TooFewParts]);
    let mut empty = detection;
    empty.bounds.x_max = empty.bounds.x_min;
    assert_eq!(codes(&given, &empty), [ReasonCode::EmptyBox]);
}
