//! The rows of `motgt`, `extrinsicsgt` and the colour table.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fmt::Write;

use partpose::geometry::{Camera, Cuboid, EulerAngles, Pose, wrap_angle};

use super::boxes::{clipped_box, truncation};
use crate::scene::SegmentClass;
use crate::world::PlacedVehicle;

pub(super) const MOTGT_HEADER: &str = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr orig_label moving model color\n";
pub(super) const EXTRINSICS_HEADER: &str =
    "frame r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0 0 1\n";

/// Below this share of visible pixels in the box a vehicle counts as heavily occluded; the documented default.
const HEAVILY_OCCLUDED: f64 = 0.4;
/// Below this share it counts as occluded; between the limits of the published worlds.
const OCCLUDED: f64 = 0.8;
/// Above this truncation a vehicle counts as heavily truncated; the documented default.
const HEAVILY_TRUNCATED: f64 = 0.8;
/// Boxes less high are not to be judged, pixels.
const LEAST_HEIGHT: i64 = 25;

/// The rows of a frame.
pub(super) struct FrameRows {
    pub(super) extrinsics: String,
    pub(super) vehicles: Vec<String>,
}

/// The row of a frame in `extrinsicsgt`.
pub(super) fn extrinsics(index: u32, world_from_camera: &Pose) -> String {
    let camera_from_world = world_from_camera.inverse();
    let rotation = camera_from_world.rotation.to_rotation_matrix();
    let mut text = index.to_string();
    for row in 0..3 {
        for column in 0..3 {
            let _ = write!(text, " {}", rotation[(row, column)]);
        }
        let _ = write!(text, " {}", camera_from_world.translation.vector[row]);
    }
    text + " 0 0 0 1"
}

/// The row of a vehicle of which `pixels` are seen. Numbers have all their digits, so that who reads them gets the
/// pose that was drawn.
pub(super) fn vehicle(
    index: u32,
    vehicle: &PlacedVehicle,
    world_from_camera: &Pose,
    camera: &Camera,
    pixels: usize,
) -> Option<String> {
    let camera_from_vehicle = world_from_camera.inverse() * vehicle.world_from_vehicle;
    let cuboid = Cuboid { camera_from_vehicle, extent: vehicle.extent };
    let [l, t, r, b] = clipped_box(&cuboid, &vehicle.beyond, camera)?;
    // Pixels of the box as the published figures count them: without its last row and column.
    let area = ((r - l) * (b - t)).max(1) as f64;
    let occupancy = (pixels as f64 / area).min(1.0);
    let truncation = truncation(&cuboid, camera);
    let truncated = level(truncation > 0.0, truncation > HEAVILY_TRUNCATED);
    let occluded = level(occupancy < OCCLUDED, occupancy < HEAVILY_OCCLUDED);
    let dont_care =
        truncated == 2 || occluded == 2 || b - t < LEAST_HEIGHT || vehicle.category != "Car";
    let label = if dont_care { "DontCare" } else { &vehicle.category };
    let rotation = camera_from_vehicle.rotation.to_rotation_matrix();
    let EulerAngles { x: rx, y, z: rz } = EulerAngles::from_rotation(&rotation);
    let ry = wrap_angle(y - FRAC_PI_2);
    let at = camera_from_vehicle.translation.vector;
    let alpha = wrap_angle(ry - at.x.atan2(at.z));
    let side = vehicle.extent;
    Some(format!(
        "{index} {} {label} {truncated} {occluded} {alpha} {l} {t} {r} {b} {} {} {} {} {} {} {ry} {rx} {rz} {truncation} {occupancy} {} {} {} {}",
        vehicle.track,
        side.width,
        side.height,
        side.length,
        at.x,
        at.y,
        at.z,
        vehicle.category,
        u8::from(vehicle.moving),
        vehicle.model,
        vehicle.color,
    ))
}

fn level(some: bool, heavily: bool) -> u8 {
    u8::from(some) + u8::from(some && heavily)
}

/// Track and category of a row of `motgt`.
pub(super) fn track_of(row: &str) -> Option<(u32, String)> {
    let mut fields = row.split(' ');
    let track = fields.nth(1)?.parse().ok()?;
    Some((track, fields.nth(19)?.to_owned()))
}

/// The colour table of a sequence: things with their tracks, then everything else.
pub(super) fn encoding(tracks: &BTreeMap<u32, String>) -> String {
    let mut text = "Category(:id) r g b\n".to_owned();
    for (track, category) in tracks {
        let [r, g, b] = track_color(*track);
        let _ = writeln!(text, "{category}:{track} {r} {g} {b}");
    }
    for (class, name, [r, g, b]) in CLASSES {
        // Vehicles that have a row are coloured by it; these are the others, such as toys on a sign.
        let _ = class;
        let _ = writeln!(text, "{name} {r} {g} {b}");
    }
    text
}

/// Virtual KITTI's classes with their colours.
const CLASSES: [(SegmentClass, &str, [u8; 3]); 14] = [
    (SegmentClass::Sky, "Sky", [90, 200, 255]),
    (SegmentClass::Terrain, "Terrain", [210, 0, 200]),
    (SegmentClass::Tree, "Tree", [0, 199, 0]),
    (SegmentClass::Vegetation, "Vegetation", [90, 240, 0]),
    (SegmentClass::Building, "Building", [140, 140, 140]),
    (SegmentClass::Road, "Road", [100, 60, 100]),
    (SegmentClass::GuardRail, "GuardRail", [250, 100, 255]),
    (SegmentClass::TrafficSign, "TrafficSign", [255, 255, 0]),
    (SegmentClass::TrafficLight, "TrafficLight", [200, 200, 0]),
    (SegmentClass::Pole, "Pole", [255, 130, 0]),
    (SegmentClass::Misc, "Misc", [80, 80, 80]),
    (SegmentClass::Truck, "Truck", [160, 60, 60]),
    (SegmentClass::Car, "Car", [255, 127, 80]),
    (SegmentClass::Van, "Van", [0, 139, 139]),
];

/// The colour of a class by its number.
pub(super) fn class_color(class: u8) -> [u8; 3] {
    let found = CLASSES.iter().find(|(known, ..)| *known as u8 == class);
    found.map_or([0, 0, 0], |(.., color)| *color)
}

/// The colour of a track: different for different tracks below 2^22, and for none that of a class.
pub(super) fn track_color(track: u32) -> [u8; 3] {
    // An odd factor permutes the 24-bit numbers; tracks use the first quarter, so that a number that meets the colour
    // of a class can go to the second, of which no track comes.
    let color = |number: u32| {
        let [_, r, g, b] =
            (number.wrapping_mul(0x9e_3779).wrapping_add(0x12_3457) & 0xff_ffff).to_be_bytes();
        [r, g, b]
    };
    let taken =
        |color: &[u8; 3]| *color == [0; 3] || CLASSES.iter().any(|(.., class)| class == color);
    let track = track & 0x3f_ffff;
    let own = color(track);
    if !taken(&own) {
        return own;
    }
    let second = color(track + (1 << 22));
    if taken(&second) { color(track + (2 << 22)) } else { second }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn colours_of_tracks_are_unique_and_none_is_that_of_a_class() {
        let colors: BTreeSet<[u8; 3]> = (0..40_000).map(|i| track_color(i * 97)).collect();
        assert_eq!(colors.len(), 40_000);
        assert!(CLASSES.iter().all(|(.., class)| !colors.contains(class)));
    }

    #[test]
    fn a_row_holds_the_pose_to_the_last_digit() {
        let world_from_camera = Pose::rotation(partpose::geometry::Vector3::new(0.02, 0.7, -0.01));
        let placed = PlacedVehicle {
            track: 7,
            category: "Car".to_owned(),
            model: "sedan".to_owned(),
            color: "Red",
            extent: partpose::geometry::Extent::new(1.8, 1.5, 4.3),
            beyond: Vec::new(),
            world_from_vehicle: world_from_camera
                * Pose::new(
                    partpose::geometry::Vector3::new(2.0, 1.6, 14.0),
                    partpose::geometry::Vector3::new(0.03, 2.0, 0.02),
                ),
            moving: true,
        };
        let camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
        let row = vehicle(3, &placed, &world_from_camera, &camera, 12_000).unwrap();
        let fields: Vec<&str> = row.split(' ').collect();
        assert_eq!(fields.len(), 25);
        assert_eq!(fields[..4], ["3", "7", "Car", "0"]);
        let number = |i: usize| fields[i].parse::<f64>().unwrap();
        let angles = EulerAngles { x: number(17), y: number(16) + FRAC_PI_2, z: number(18) };
        let expected = world_from_camera.inverse() * placed.world_from_vehicle;
        // By elements: an angle near zero is only known to the root of the precision.
        let (read, drawn) = (angles.to_rotation(), expected.rotation.to_rotation_matrix());
        let difference = (read.matrix() - drawn.matrix()).abs().max();
        assert!(difference < 1e-14, "{difference}");
        assert_eq!(track_of(&row), Some((7, "Car".to_owned())));
    }

    #[test]
    fn small_hidden_cut_and_other_vehicles_are_dont_care() {
        let camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
        let check = |x: f64, z: f64, category: &str, share: f64| {
            let placed = PlacedVehicle {
                track: 1,
                category: category.to_owned(),
                model: "m".to_owned(),
                color: "Red",
                extent: partpose::geometry::Extent::new(1.8, 1.5, 4.3),
                beyond: Vec::new(),
                world_from_vehicle: Pose::translation(x, 1.6, z),
                moving: false,
            };
            let full = vehicle(0, &placed, &Pose::identity(), &camera, 1).unwrap();
            let at = |i: usize| full.split(' ').nth(i).unwrap().parse::<f64>().unwrap();
            let pixels = share * (at(8) - at(6)) * (at(9) - at(7));
            let row = vehicle(0, &placed, &Pose::identity(), &camera, pixels as usize).unwrap();
            row.split(' ').nth(2).unwrap().to_owned()
        };
        assert_eq!(check(0.0, 20.0, "Car", 0.7), "Car");
        assert_eq!(check(0.0, 20.0, "Car", 0.3), "DontCare");
        assert_eq!(check(0.0, 60.0, "Car", 0.7), "DontCare");
        assert_eq!(check(6.5, 5.0, "Car", 0.7), "DontCare");
        assert_eq!(check(0.0, 20.0, "Van", 0.7), "DontCare");
    }
}
