//! Pictures of a made-up scene: that they show what they should, not how exactly.

mod common;

use nalgebra::UnitQuaternion;
use partpose::files::RgbImage;
use partpose::geometry::{Camera, Cuboid, Extent, Point2, Point3, Pose, Rect, Vector3};
use partpose::parts::{PartClass, PartMask};
use partpose::render::{Instance, render_labels};
use partpose::vehicle::{Mesh, VehicleModel};
use partpose::viz::{
    BirdsEyeOptions, PointPair, ScenePicture, ShadeOptions, TurntableOptions, VehiclePicture,
    birds_eye, overlay, shade, side_by_side, turntable,
};

const CAMERA: Camera = Camera::pinhole(200.0, [159.5, 59.5], [320, 120]);
const TRUTH: [u8; 3] = [60, 240, 100];
const DETECTION: [u8; 3] = [255, 214, 10];

fn pixel(image: &RgbImage, x: u32, y: u32) -> [u8; 3] {
    let start = 3 * (y * image.size[0] + x) as usize;
    [image.pixels[start], image.pixels[start + 1], image.pixels[start + 2]]
}

fn is_close(a: [u8; 3], b: [u8; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| a.abs_diff(b) < 60)
}

fn count(image: &RgbImage, color: [u8; 3]) -> usize {
    image.pixels.chunks_exact(3).filter(|p| is_close([p[0], p[1], p[2]], color)).count()
}

fn scene(vehicles: Vec<VehiclePicture>) -> ScenePicture {
    ScenePicture { camera: CAMERA, image: None, title: "made-up/00000".to_owned(), vehicles }
}

fn cuboid(z: f64) -> Cuboid {
    let camera_from_vehicle = Pose::translation(0.0, 1.2, z);
    Cuboid { camera_from_vehicle, extent: common::EXTENT }
}

#[test]
fn part_labels_of_a_made_up_car() {
    let mesh = common::car(6);
    let camera = Camera::pinhole(60.0, [23.5, 7.5], [48, 16]);
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, 0.0, 0.0))
        * UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.9, 0.0));
    let camera_from_vehicle = Pose::from_parts(Vector3::new(0.0, 0.75, 6.0).into(), rotation);
    let instance =
        Instance { mesh: &mesh, scale: Vector3::repeat(1.0), camera_from_vehicle, id: 1 };
    let image = render_labels(&camera, &[instance]);
    // Ids from 1 as a to z, then A to C.
    let letter = |part: &u8| match *part {
        0 => '.',
        id @ 1..=26 => char::from(b'a' + id - 1),
        id => char::from(b'A' + id - 27),
    };
    let rows: Vec<String> =
        image.parts.chunks(48).map(|row| row.iter().map(letter).collect()).collect();
    assert_eq!(rows, GOLDEN, "{rows:#?}");
}

/// Seen from behind on its right: r rear windscreen, z boot, d lamp, j apron, p side, n and l doors, h and f wheels,
/// x v t windows, y roof, A bonnet.
const GOLDEN: [&str; 16] = [
    ".....................yy.........................",
    "...........rrryyyyyyyyyyyyyvvtt.................",
    "..........rrrrrrrrrxxxvvvvvvvttt................",
    ".........rrrrrrrrrxxxxvvvvvvvtttt...............",
    "........rrrrrrrrrxxxxvvvvvvvvttttt..............",
    ".......rrrrrrrrrrxxxxvvvvvvvvtttttt.............",
    ".....rrrrrrrrrrrxxxxxvvvvvvvvvttttpppppAA.......",
    "....zzzzrrrrrrrxxxxxvvvvvvvvnnlllppppppppppp....",
    "..zzzzzzzzzrrrrxxxxxvppppnnnnnlllllppppppppp....",
    "zzzzzzzzzzzzzzxppppppppppnnnnnllllllpppppppp....",
    "zzzzzzzzzzzzppppppppppppnnnnnnllllllppppfppp....",
    "zzzzzzzzzzzpppppppppppppnnnnnnllllllffffpppp....",
    "zzzzzzzzzpppppppppppppppnnnnnnllllllffffppp.....",
    "zzzzzzzpppppppppppppppppnnnnnnllllllffffppp.....",
    "jzzzddppppppppppppppppphnnnnnnllllppffff........",
    "jjzzddppppppppppppphhhhhnnnnnnpppppff...........",
];

#[test]
fn turntable_shows_left_and_right_parts_on_their_sides() {
    let model =
        VehicleModel::new("made-up", "Car", "sedan", common::EXTENT, common::car(10)).unwrap();
    let options = TurntableOptions { tile: [120, 80], ..TurntableOptions::default() };
    let image = turntable(&model, &options);
    let tile = |column: u32, row: u32| {
        let mut pixels = Vec::new();
        for y in 0..80 {
            for x in 0..120 {
                pixels.extend(pixel(&image, column * 120 + x, image.size[1] - (3 - row) * 80 + y));
            }
        }
        RgbImage { size: [120, 80], pixels }
    };
    // Hues survive shading: the left doors are pink and violet, the hood green, the front apron red.
    let reds = |image: &RgbImage| {
        image.pixels.chunks_exact(3).filter(|p| p[0] > 100 && p[1] < 40 && p[2] < 40).count()
    };
    let (front, rear) = (tile(1, 0), tile(1, 2));
    assert!(reds(&front) > 100, "the front apron shows from the front");
    assert_eq!(reds(&rear), 0, "and not from the rear");
    // Seen from the right the front is on the right.
    let right = tile(0, 1);
    let mean_x = |image: &RgbImage, keep: fn(&[u8]) -> bool| {
        let hits: Vec<usize> =
            (0..9600).filter(|i| keep(&image.pixels[3 * i..3 * i + 3])).collect();
        hits.iter().map(|i| (i % 120) as f64).sum::<f64>() / hits.len() as f64
    };
    let is_trunk = |p: &[u8]| p[1] > 120 && p[0] < 60 && p[2] < 60;
    assert!(mean_x(&right, is_trunk) < 60.0);
    assert!(mean_x(&tile(2, 1), is_trunk) > 60.0);
}

#[test]
fn shaded_surface_is_brighter_towards_the_lamp() {
    let plate = |top: f64| {
        // Tilted about the x axis: its normal points up or down.
        let corners = [
            (-1.0, 1.0, 5.0 - top),
            (1.0, 1.0, 5.0 - top),
            (1.0, -1.0, 5.0 + top),
            (-1.0, -1.0, 5.0 + top),
        ];
        Mesh {
            vertices: corners.iter().map(|(x, y, z)| Point3::new(*x, *y, *z)).collect(),
            faces: vec![[0, 1, 2], [0, 2, 3]],
            parts: vec![PartClass::DoorFrontLeft; 2],
        }
    };
    let brightness = |mesh: &Mesh| {
        let instance = Instance {
            mesh,
            scale: Vector3::repeat(1.0),
            camera_from_vehicle: Pose::identity(),
            id: 1,
        };
        let image = shade(&CAMERA, &[instance], &ShadeOptions::default());
        u32::from(pixel(&image, 160, 60)[0])
    };
    assert!(brightness(&plate(0.9)) > brightness(&plate(-0.9)) + 20);
}

#[test]
fn overlay_shows_what_it_is_given_and_explains_only_that() {
    let nothing = overlay(&scene(vec![]));
    assert_eq!(nothing.size[0], 320);
    assert_eq!((count(&nothing, TRUTH), count(&nothing, DETECTION)), (0, 0));
    let bounds = Some(Rect::new(100.0, 40.0, 200.0, 90.0));
    let boxed = overlay(&scene(vec![VehiclePicture { bounds, ..VehiclePicture::default() }]));
    assert!(count(&boxed, DETECTION) > 250 && count(&boxed, TRUTH) == 0);
    assert!(is_close(pixel(&boxed, 150, 40), DETECTION));
    let truth = Some(cuboid(8.0));
    let labelled = overlay(&scene(vec![VehiclePicture { truth, ..VehiclePicture::default() }]));
    assert!(count(&labelled, TRUTH) > 100 && count(&labelled, DETECTION) == 0);
}

#[test]
fn masks_and_points_lie_on_their_pixels() {
    let mut mask = PartMask::background([50, 30], [20, 10]);
    mask.labels.fill(PartClass::Trunk.id());
    let pair = PointPair {
        observed: Point2::new(250.0, 60.0),
        reprojected: Point2::new(280.0, 60.0),
        class: PartClass::ApronFront,
        inlier: true,
    };
    let vehicle =
        VehiclePicture { mask: Some(&mask), points: vec![pair], ..VehiclePicture::default() };
    let image = overlay(&scene(vec![vehicle]));
    assert!(is_close(pixel(&image, 60, 35), [0, 190, 5]));
    assert!(!is_close(pixel(&image, 49, 35), [0, 190, 5]));
    assert!(is_close(pixel(&image, 250, 60), PartClass::ApronFront.color()));
    assert!(is_close(pixel(&image, 268, 60), [255, 64, 64]));
}

#[test]
fn photograph_shows_through_and_one_of_another_size_is_left_out() {
    let photo = RgbImage { size: [320, 120], pixels: vec![90; 320 * 120 * 3] };
    let picture = overlay(&ScenePicture { image: Some(&photo), ..scene(vec![]) });
    assert_eq!(pixel(&picture, 10, 10), [90; 3]);
    let small = RgbImage { size: [2, 2], pixels: vec![90; 12] };
    let picture = overlay(&ScenePicture { image: Some(&small), ..scene(vec![]) });
    assert_ne!(pixel(&picture, 0, 0), [90; 3]);
}

#[test]
fn birds_eye_puts_far_vehicles_further_up_and_right_ones_right() {
    let at = |x: f64, z: f64| Cuboid {
        camera_from_vehicle: Pose::translation(x, 1.0, z),
        extent: common::EXTENT,
    };
    let options = BirdsEyeOptions { size: [200, 218], range: Some(40.0) };
    let empty = birds_eye(&scene(vec![]), &options);
    let place = |cuboid: Cuboid| {
        let vehicle = VehiclePicture { predicted: Some(cuboid), ..VehiclePicture::default() };
        let image = birds_eye(&scene(vec![vehicle]), &options);
        // What the vehicle changed above the legend.
        let hits: Vec<[f64; 2]> = (0..200 * 190)
            .filter(|i| pixel(&image, i % 200, i / 200) != pixel(&empty, i % 200, i / 200))
            .map(|i| [f64::from(i % 200), f64::from(i / 200)])
            .collect();
        [0, 1].map(|k| hits.iter().map(|hit| hit[k]).sum::<f64>() / hits.len() as f64)
    };
    let (near, far, right) = (place(at(0.0, 10.0)), place(at(0.0, 30.0)), place(at(8.0, 20.0)));
    assert!(far[1] + 60.0 < near[1], "{near:?} {far:?}");
    assert!((near[0] - 100.0).abs() < 6.0 && right[0] > 125.0, "{near:?} {right:?}");
}

#[test]
fn vehicles_around_and_behind_the_camera_do_not_panic() {
    let mesh = common::car(3);
    let mut vehicles = Vec::new();
    for z in [-5.0, 0.0, 0.5, 2.0, 1e7, f64::NAN] {
        let camera_from_vehicle = Pose::translation(0.3, 1.0, z);
        let cuboid = Cuboid { camera_from_vehicle, extent: Extent::new(2.0, 1.5, 4.0) };
        let scale = Vector3::repeat(1.0);
        vehicles.push(VehiclePicture {
            id: "7".to_owned(),
            bounds: Some(Rect::new(z, z, f64::NAN, 1e12)),
            model: Some(Instance { mesh: &mesh, scale, camera_from_vehicle, id: 3 }),
            truth: Some(cuboid),
            predicted: Some(cuboid),
            text: "text".repeat(100),
            ..VehiclePicture::default()
        });
    }
    let picture = side_by_side(&scene(vehicles), &BirdsEyeOptions::default());
    assert_eq!(picture.size[0], 320 + BirdsEyeOptions::default().size[0]);
    assert_eq!(picture.pixels.len(), (3 * picture.size[0] * picture.size[1]) as usize);
}
