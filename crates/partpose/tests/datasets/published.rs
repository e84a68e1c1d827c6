//! Facts that were verified on the published data; skipped where these are absent.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;

use partpose::dataset::folds::{Fold, Folds};
use partpose::dataset::split::{SplitOptions, split_like_paper, test_stretch};
use partpose::dataset::{Dataset, Frame, VehicleLabel};
use partpose::geometry::{EulerAngles, Point2, Rect, wrap_angle};

use super::{id, published};

const WORLDS: [(&str, usize, usize, usize); 2] =
    [("0001", 447, 5835, 1789), ("0018", 339, 1413, 1164)];

fn open() -> Option<Dataset> {
    Some(Dataset::open(&published("vkitti-1.3.1")?).unwrap())
}

fn frames(dataset: &Dataset, world: &str) -> Vec<Frame> {
    let read = dataset.read(&id(world, "clone")).unwrap();
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    read.frames
}

fn vehicles(frames: &[Frame]) -> impl Iterator<Item = (&Frame, &VehicleLabel)> {
    frames.iter().flat_map(|frame| frame.vehicles.iter().map(move |vehicle| (frame, vehicle)))
}

#[test]
fn rows_and_cars_are_as_many_as_published() {
    let Some(dataset) = open() else { return };
    for (world, frame_count, rows, cars) in WORLDS {
        let frames = frames(&dataset, world);
        assert_eq!(frames.len(), frame_count);
        assert!(frames.iter().all(|frame| frame.parts.is_some() && frame.image.is_none()));
        assert_eq!(vehicles(&frames).count(), rows);
        assert_eq!(vehicles(&frames).filter(|(_, vehicle)| !vehicle.dont_care).count(), cars);
    }
}

#[test]
fn dont_care_follows_its_rule() {
    let Some(dataset) = open() else { return };
    for (world, ..) in WORLDS {
        for (_, vehicle) in vehicles(&frames(&dataset, world)) {
            // The rule speaks of b - t of inclusive edges: one less than the height that they cover.
            let rule = vehicle.truncated == 2
                || vehicle.occluded == 2
                || vehicle.bounds.height() - 1.0 < 25.0
                || vehicle.category != "Car";
            assert_eq!(vehicle.dont_care, rule, "{vehicle:?}");
        }
    }
}

#[test]
fn parked_vehicles_stand_still_in_the_world() {
    /// Angles of the file have 7 digits; measured 1.3e-6.
    const YAW: f64 = 2e-6;
    /// Measured 1.3e-4 m.
    const POSITION: f64 = 2e-4;
    let Some(dataset) = open() else { return };
    let mut tracks: BTreeMap<u32, Vec<(f64, nalgebra::Vector3<f64>)>> = BTreeMap::new();
    for (frame, vehicle) in vehicles(&frames(&dataset, "0001")) {
        let world_from_vehicle =
            frame.world_from_camera.unwrap() * vehicle.cuboid.camera_from_vehicle;
        let rotation = world_from_vehicle.rotation.to_rotation_matrix();
        // The world is y-down as the camera is, so that its yaw has the same axis.
        let yaw = EulerAngles::from_rotation(&rotation).y;
        let place = world_from_vehicle.translation.vector;
        tracks.entry(vehicle.track.unwrap()).or_default().push((yaw, place));
    }
    let mut parked = 0;
    for places in tracks.values() {
        let (yaw, place) = places[0];
        if places.iter().any(|(_, other)| (other - place).norm() > 0.05) {
            continue;
        }
        parked += 1;
        for (other_yaw, other) in places {
            assert!((other - place).norm() < POSITION);
            assert!(wrap_angle(other_yaw - yaw).abs() < YAW, "{}", wrap_angle(other_yaw - yaw));
        }
    }
    assert_eq!(parked, 82);
}

#[test]
fn vehicles_never_tilt_in_the_world() {
    /// Measured 4e-4 rad.
    const TILT: f64 = 5e-4;
    let Some(dataset) = open() else { return };
    for (world, ..) in WORLDS {
        for (frame, vehicle) in vehicles(&frames(&dataset, world)) {
            let down = nalgebra::Vector3::y();
            let turned = frame.world_from_camera.unwrap().rotation
                * vehicle.cuboid.camera_from_vehicle.rotation
                * down;
            assert!(turned.angle(&down) < TILT);
        }
    }
}

/// Mean of the four sides' distances from the annotated edges, as integers, to the projected ones.
fn side_error(annotated: &Rect, projected: &Rect) -> f64 {
    let a = [annotated.x_min, annotated.y_min, annotated.x_max, annotated.y_max];
    let p = [projected.x_min, projected.y_min, projected.x_max, projected.y_max];
    // Readers widen inclusive edges by half a pixel.
    let edge = [a[0] + 0.5, a[1] + 0.5, a[2] - 0.5, a[3] - 0.5];
    edge.iter().zip(p).map(|(a, p)| (a - p).abs()).sum::<f64>() / 4.0
}

#[test]
fn cuboids_project_onto_their_boxes() {
    let Some(dataset) = open() else { return };
    let mut errors = Vec::new();
    for (world, ..) in WORLDS {
        for (frame, vehicle) in vehicles(&frames(&dataset, world)) {
            if vehicle.truncation == 0.0 {
                let projected = vehicle.cuboid.project(&frame.camera).unwrap();
                errors.push(side_error(&vehicle.bounds, &projected));
            }
        }
    }
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert_eq!(errors.len(), 6453);
    assert!((mean - 0.83).abs() < 0.02, "{mean}");
}

#[test]
fn part_masks_lie_in_the_boxes() {
    let Some(dataset) = open() else { return };
    let (mut inside, mut all) = (0.0, 0.0);
    for frame in frames(&dataset, "0018").iter().step_by(20) {
        let mask = frame.read_parts().unwrap();
        for (i, _) in mask.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
            let (x, y) = (i as u32 % mask.size[0], i as u32 / mask.size[0]);
            let pixel = Point2::new(f64::from(x), f64::from(y));
            all += 1.0;
            inside += f64::from(frame.vehicles.iter().any(|v| v.bounds.contains(&pixel)));
        }
    }
    assert!(all > 1e4 && inside >= 0.999 * all, "{inside} of {all}");
}

#[test]
fn four_folds_of_both_worlds_have_each_of_the_four_models() {
    let Some(dataset) = open() else { return };
    let folds = Folds::of(&dataset, dataset.sequences(), 4).unwrap();
    let mut count: BTreeMap<(String, usize), usize> = BTreeMap::new();
    for (world, ..) in WORLDS {
        for (frame, vehicle) in vehicles(&frames(&dataset, world)) {
            let track = vehicle.track.unwrap();
            let fold = folds.fold_of(&frame.sequence, track);
            let key = (vehicle.model.clone().unwrap(), fold);
            *count.entry(key).or_default() += usize::from(!vehicle.dont_care);
        }
    }
    for model in ["Hatchback", "Sedan4Door", "SUV", "Hybrid"] {
        for fold in 1..=4 {
            assert!(count.get(&(model.to_owned(), fold)).is_some_and(|rows| *rows > 50));
        }
    }
    let fold = Fold { index: 1, count: 4 };
    let sequence = id("0001", "clone");
    assert_eq!(folds.contains(fold, &sequence, 0), folds.fold_of(&sequence, 0) == 1);
}

#[test]
fn the_split_of_the_two_worlds_counts_frames_with_vehicle_pixels() {
    let Some(dataset) = open() else { return };
    let mut counts = BTreeMap::new();
    let mut empty = BTreeSet::new();
    for (world, count, ..) in WORLDS {
        let sequence = id(world, "clone");
        for frame in frames(&dataset, world) {
            let (start, end) = test_stretch(count as u32);
            // Decoding all 786 masks takes long; what is known to be empty lies outside of the test stretch.
            if !(start..end).contains(&frame.index)
                && frame.read_parts().unwrap().labels.iter().all(|label| *label == 0)
            {
                empty.insert((sequence.clone(), frame.index));
            }
        }
        counts.insert(sequence, count as u32);
    }
    let split = split_like_paper(&counts, &SplitOptions::default(), |id, index| {
        !empty.contains(&(id.clone(), index))
    });
    // Frames without a vehicle pixel: 426 to 446 of world 0001, 0 to 24 and 41 to 53 of world 0018.
    assert_eq!(empty.len(), 21 + 25 + 13);
    assert_eq!((split.test.len(), split.guard.len()), (96 + 72, 4));
    assert_eq!(split.train.len() + split.validation.len(), 447 + 339 - 59 - 168 - 4);
}

#[test]
fn kitti_frames_are_read_with_their_own_sizes() {
    let Some(root) = published("kitti") else { return };
    let dataset = Dataset::open(&root).unwrap();
    let read = dataset.read(&id("training", "")).unwrap();
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    let sizes: Vec<[u32; 2]> = read.frames.iter().map(|frame| frame.camera.size).collect();
    assert_eq!(sizes, [[1224, 370], [1242, 375], [1242, 375]]);
    let count: Vec<(usize, usize)> =
        read.frames.iter().map(|frame| (frame.vehicles.len(), frame.ignored.len())).collect();
    assert_eq!(count, [(0, 0), (2, 4), (1, 0)]);
    for (frame, vehicle) in vehicles(&read.frames) {
        let projected = vehicle.cuboid.project(&frame.camera).unwrap();
        // Measured 0.5 px at most; without the offset of P2 the nearest is 5 px off.
        let (a, b) = (projected, vehicle.bounds);
        assert!((a.x_min - b.x_min).abs() < 1.5 && (a.x_max - b.x_max).abs() < 1.5, "{a:?} {b:?}");
    }
    let car = &read.frames[1].vehicles[1];
    let yaw =
        EulerAngles::from_rotation(&car.cuboid.camera_from_vehicle.rotation.to_rotation_matrix());
    assert!((wrap_angle(yaw.y - 1.57 - FRAC_PI_2)).abs() < 1e-9);
}
