//! Models carved from masks that were rendered from a known shape.

use std::path::Path;

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use partpose::carve::{
    CarveError, CarveOptions, Carved, QualityOptions, Skipped, carve_models, measure_quality,
};
use partpose::dataset::{Frame, SequenceId, VehicleLabel};
use partpose::files::{RgbImage, write_png};
use partpose::geometry::{Camera, Cuboid, Extent, Point3, Pose};
use partpose::parts::{PartClass, PartMask};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::{Mesh, VehicleModel};

const CAMERA: Camera = Camera::pinhole(600.0, [249.5, 99.5], [500, 260]);
const EXTENT: Extent = Extent::new(1.8, 1.5, 4.4);
/// Tracks 0 to 5 are carved from, 6 and 7 are measured.
const TRACKS: u32 = 8;
const VIEWS_PER_TRACK: u32 = 12;

/// Half the grid of the default: enough for a box of a car, and fast.
fn options() -> CarveOptions {
    CarveOptions { voxels: [48, 42, 88], max_faces: 4000, ..CarveOptions::default() }
}

/// A profile in the plane of symmetry, drawn out to both sides; one part a face of the profile.
fn box_car() -> Mesh {
    let profile: [(f64, f64, PartClass); 8] = [
        (2.2, 0.0, PartClass::ApronFront),
        (2.2, -0.7, PartClass::Hood),
        (1.1, -0.9, PartClass::WindshieldFront),
        (0.4, -1.5, PartClass::Roof),
        (-1.0, -1.5, PartClass::WindshieldRear),
        (-1.6, -0.9, PartClass::Trunk),
        (-2.2, -0.9, PartClass::ApronRear),
        (-2.2, 0.0, PartClass::ApronRear),
    ];
    let n = profile.len() as u32;
    let mut mesh = Mesh::default();
    for x in [0.9, -0.9] {
        mesh.vertices.extend(profile.iter().map(|(z, y, _)| Point3::new(x, *y, *z)));
    }
    for (i, (.., part)) in (0..n).zip(profile) {
        let next = (i + 1) % n;
        mesh.faces.extend([[i, n + i, n + next], [i, n + next, next]]);
        mesh.parts.extend([part; 2]);
    }
    // The profile is star-shaped about the middle of the floor.
    let hub = mesh.vertices.len() as u32;
    mesh.vertices.extend([Point3::new(0.9, -0.4, 0.0), Point3::new(-0.9, -0.4, 0.0)]);
    for i in 0..n {
        let next = (i + 1) % n;
        mesh.faces.extend([[hub, i, next], [hub + 1, n + next, n + i]]);
        mesh.parts.extend([PartClass::DoorFrontRight, PartClass::DoorFrontLeft]);
    }
    mesh
}

/// Vehicles of slightly different size, each seen from all around; in every third picture a pole of label 0.
fn frames(folder: &Path) -> Vec<Frame> {
    let mesh = box_car();
    let sequence = SequenceId { world: "made".to_owned(), variation: "up".to_owned() };
    let mut frames = Vec::new();
    for track in 0..TRACKS {
        let size = 0.94 + 0.02 * f64::from(track);
        let extent = Extent::new(EXTENT.width * size, EXTENT.height, EXTENT.length / size);
        for view in 0..VIEWS_PER_TRACK {
            let index = track * VIEWS_PER_TRACK + view;
            let yaw = std::f64::consts::FRAC_PI_6 * f64::from(view) + 0.07 * f64::from(track);
            let distance = 7.0 + 0.37 * f64::from(index % 11);
            let camera_from_vehicle = Pose::from_parts(
                Translation3::new(0.3 * f64::from(view % 3) - 0.3, 1.5, distance),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), yaw),
            );
            let cuboid = Cuboid { camera_from_vehicle, extent };
            let scale = extent.ratio(&EXTENT);
            let instance = Instance { mesh: &mesh, scale, camera_from_vehicle, id: 1 };
            let mut labels = render_labels(&CAMERA, &[instance]).parts;
            if index.is_multiple_of(3) {
                let left = 200 + (index as usize * 17) % 90;
                labels.chunks_exact_mut(500).for_each(|row| row[left..left + 8].fill(0));
            }
            let path = folder.join(format!("{index:05}.png"));
            let mask = PartMask { origin: [0, 0], size: CAMERA.size, labels };
            write_png(&path, &RgbImage { size: CAMERA.size, pixels: mask.to_rgb() })
                .expect("the folder is there");
            let mut frame = Frame::new(sequence.clone(), index, CAMERA);
            frame.parts = Some(path);
            frame.vehicles = vec![VehicleLabel {
                track: Some(track),
                category: "Car".to_owned(),
                dont_care: false,
                truncated: 0,
                occluded: 0,
                truncation: 0.0,
                occupancy: None,
                bounds: cuboid.project(&CAMERA).expect("it stands in front"),
                cuboid,
                model: Some("BoxSedan".to_owned()),
                color: None,
            }];
            frames.push(frame);
        }
    }
    frames
}

fn carve(frames: &[Frame]) -> Carved {
    let left_out = |_: &SequenceId, track: u32| track >= 6;
    carve_models(frames, None, &left_out, &options(), &mut |_| {}).expect("there are masks")
}

#[test]
fn carved_model_is_the_shape_that_the_masks_show() {
    let folder = tempfile::tempdir().unwrap();
    let frames = frames(folder.path());
    let carved = carve(&frames);
    assert!(carved.skipped.is_empty(), "{:?}", carved.skipped);
    let [found] = &carved.models[..] else { panic!("{} models", carved.models.len()) };
    let model: &VehicleModel = &found.model;
    assert_eq!((model.name(), model.category(), model.body_style()), ("BoxSedan", "Car", "sedan"));
    assert_eq!(found.tracks, 6);

    let mesh = model.mesh();
    assert!(mesh.is_closed());
    assert!(mesh.faces.len() <= 4000);
    // Cuboid coordinates: the volume scales with that of the extent.
    let truth = box_car().volume() / EXTENT.volume();
    let volume = mesh.volume() / model.extent().volume();
    assert!((volume / truth - 1.0).abs() < 0.04, "{volume} instead of {truth}");

    let chosen = |_: &SequenceId, track: u32| track >= 6;
    let models = [model.clone()];
    let quality =
        measure_quality(&frames, &models, &chosen, &QualityOptions::default(), &mut |_| {});
    assert!(quality.len() >= 10, "{} views", quality.len());
    let mut ious: Vec<f64> = quality.iter().map(|view| view.iou).collect();
    ious.sort_by(f64::total_cmp);
    assert!(ious[ious.len() / 2] > 0.96, "{ious:?}");
    let labels = quality.iter().map(|view| view.label_accuracy).sum::<f64>() / quality.len() as f64;
    assert!(labels > 0.93, "{labels}");
}

#[test]
fn carved_model_is_its_own_mirror_image() {
    let folder = tempfile::tempdir().unwrap();
    let carved = carve(&frames(folder.path()));
    let mesh = carved.models[0].model.mesh();
    let (half, rest) = mesh.parts.split_at(mesh.parts.len() / 2);
    assert!(half.iter().zip(rest).all(|(right, left)| right.opposite() == *left));
    let right = mesh.vertices.iter().filter(|p| p.x > 0.0).count();
    let left = mesh.vertices.iter().filter(|p| p.x < 0.0).count();
    assert_eq!(right, left);
}

#[test]
fn number_of_threads_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let frames = frames(folder.path());
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| carve(&frames).models.remove(0).model)
    };
    assert!(with(1) == with(3));
}

#[test]
fn parts_are_together_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    let mut frames = frames(folder.path());
    for vehicle in frames.iter_mut().flat_map(|frame| &mut frame.vehicles) {
        if vehicle.track.is_some_and(|track| track % 2 == 1) {
            vehicle.model = Some("BoxCoupe".to_owned());
        }
    }
    let carve = |made| {
        let options = CarveOptions { made, voxels: [32, 28, 60], ..options() };
        let carved = carve_models(&frames, None, &|_, _| false, &options, &mut |_| {}).unwrap();
        carved.models.into_iter().map(|carved| carved.model).collect::<Vec<_>>()
    };
    let whole = carve((1, 0));
    assert_eq!(whole.len(), 2);
    assert!([carve((2, 0)), carve((2, 1))].concat() == whole);
    assert!(carve((3, 2)).is_empty());
}

#[test]
fn what_is_missing_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut frames = frames(folder.path());
    let everything = |_: &SequenceId, _: u32| true;
    let nothing = |_: &SequenceId, _: u32| false;
    let names = ["Lorry".to_owned()];
    let mut quiet = |_| {};
    let error = carve_models(&frames, Some(&names), &nothing, &options(), &mut quiet).unwrap_err();
    assert!(matches!(&error, CarveError::UnknownModel { name, .. } if name == "Lorry"), "{error}");
    let carved = carve_models(&frames, None, &everything, &options(), &mut quiet).unwrap();
    assert!(matches!(carved.skipped[..], [Skipped::TooFewViews { tracks: 0, .. }]));
    for frame in &mut frames {
        frame.parts = None;
    }
    let error = carve_models(&frames, None, &nothing, &options(), &mut quiet).unwrap_err();
    assert!(matches!(error, CarveError::NoMasks { .. }), "{error}");
    frames.iter_mut().flat_map(|f| &mut f.vehicles).for_each(|vehicle| vehicle.model = None);
    let error = carve_models(&frames, None, &nothing, &options(), &mut quiet).unwrap_err();
    assert!(matches!(error, CarveError::NoModelNames), "{error}");
}
