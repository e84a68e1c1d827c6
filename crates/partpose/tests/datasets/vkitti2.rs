use std::fmt::Write;
use std::path::{Path, PathBuf};

use partpose::dataset::{Dataset, DatasetOptions, Layout};

use partpose::geometry::Camera;

use super::{CAMERA, VEHICLES, id, write};

const BBOX: &str = "Scene18/clone/bbox.txt";
const BBOX_HEADER: &str = "frame cameraID trackID left right top bottom number_pixels truncation_ratio occupancy_ratio isMoving\n";

/// Two frames and two cameras; camera 1 has a focal length of its own and no vehicles.
fn vkitti2() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_owned();
    let at = |name: &str| format!("Scene18/clone/{name}.txt");
    let mut extrinsic =
        "frame cameraID r1,1 r1,2 r1,3 t1 r2,1 r2,2 r2,3 t2 r3,1 r3,2 r3,3 t3 0 0 0 1\n".to_owned();
    let mut intrinsic = "frame cameraID K[0,0] K[1,1] K[0,2] K[1,2]\n".to_owned();
    let mut pose = "frame cameraID trackID alpha width height length world_space_X world_space_Y world_space_Z rotation_world_space_y rotation_world_space_x rotation_world_space_z camera_space_X camera_space_Y camera_space_Z rotation_camera_space_y rotation_camera_space_x rotation_camera_space_z\n".to_owned();
    let mut bbox = BBOX_HEADER.to_owned();
    for frame in 0..2 {
        for (camera, focal) in [(0, 725.0), (1, 600.0)] {
            writeln!(extrinsic, "{frame} {camera} 1 0 0 {camera} 0 1 0 0 0 0 1 0 0 0 0 1").unwrap();
            writeln!(intrinsic, "{frame} {camera} {focal} {focal} 620.5 187").unwrap();
        }
        for (track, vehicle) in VEHICLES.iter().enumerate() {
            let ([w, h, d], [x, y, z]) = (vehicle.extent, vehicle.position);
            let [ry, rx, rz] = vehicle.angles;
            let [l, t, r, b] = vehicle.bounds();
            writeln!(
                pose,
                "{frame} 0 {track} 0 {w} {h} {d} 0 0 0 0 0 0 {x} {y} {z} {ry} {rx} {rz}"
            )
            .unwrap();
            let occupancy = [0.9, 0.5, 0.3][track];
            writeln!(bbox, "{frame} 0 {track} {l} {r} {t} {b} 900 0 {occupancy} False").unwrap();
        }
    }
    let info = "trackID label model color\n0 Car Sedan Red\n1 Van Box Blue\n2 Car Sedan Grey\n";
    for (name, text) in [
        ("extrinsic", extrinsic.as_str()),
        ("intrinsic", &intrinsic),
        ("pose", &pose),
        ("bbox", &bbox),
        ("info", info),
        ("colors", "Category r g b\nTerrain 210 0 200\n"),
    ] {
        write(&root, &at(name), text);
    }
    (folder, root)
}

fn replace(root: &Path, path: &str, from: &str, to: &str) {
    let text = std::fs::read_to_string(root.join(path)).unwrap();
    assert!(text.contains(from), "{path} has no `{from}`");
    std::fs::write(root.join(path), text.replacen(from, to, 1)).unwrap();
}

#[test]
fn vehicles_are_joined_from_three_files() {
    let (_folder, root) = vkitti2();
    let dataset = Dataset::open(&root).unwrap();
    assert_eq!(dataset.layout(), Layout::VirtualKitti2);
    assert_eq!(dataset.sequences(), [id("0018", "clone")]);
    let read = dataset.read(&id("0018", "clone")).unwrap();
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    let vehicles = &read.frames[1].vehicles;
    for (vehicle, invented) in vehicles.iter().zip(VEHICLES) {
        assert!(vehicle.cuboid.iou(&invented.cuboid()) > 1.0 - 1e-9);
        let rect = vehicle.cuboid.project(&CAMERA).unwrap();
        // Edges were rounded to whole pixels and then cover them whole.
        assert!((vehicle.bounds.x_min - rect.x_min).abs() <= 1.0);
        assert!((vehicle.bounds.y_max - rect.y_max).abs() <= 1.0);
    }
    assert_eq!(vehicles[0].color.as_deref(), Some("Red"));
    assert_eq!(dataset.segment_colors(&id("0018", "clone")).unwrap()[0].rgb, [210, 0, 200]);
}

#[test]
fn what_to_ignore_follows_from_the_ratios() {
    let (_folder, root) = vkitti2();
    let frames = Dataset::open(&root).unwrap().frames(&id("0018", "clone")).unwrap();
    let flags = |i: usize| (frames[0].vehicles[i].occluded, frames[0].vehicles[i].dont_care);
    assert_eq!(flags(0), (0, false));
    assert_eq!(flags(1), (1, true), "a van");
    assert_eq!(flags(2), (2, true), "0.3 of the box visible");
}

#[test]
fn the_other_camera_has_its_own_matrix_and_place() {
    let (_folder, root) = vkitti2();
    let open = |camera| Dataset::open_with(&root, DatasetOptions { camera }).unwrap();
    let frames = open(1).frames(&id("0018", "clone")).unwrap();
    assert_eq!(frames[0].camera, Camera { focal: [600.0; 2], ..CAMERA });
    assert!((frames[0].world_from_camera.unwrap().translation.x + 1.0).abs() < 1e-12);
    assert!(frames.iter().all(|frame| frame.vehicles.is_empty()));
    let error = open(2).read(&id("0018", "clone")).unwrap_err().to_string();
    assert!(error.ends_with("extrinsic.txt` has no row of camera 2"), "{error}");
}

#[test]
fn files_are_named_by_camera() {
    let (_folder, root) = vkitti2();
    write(&root, "Scene18/clone/frames/rgb/Camera_0/rgb_00001.jpg", "");
    write(&root, "Scene18/clone/frames/classSegmentation/Camera_1/classgt_00000.png", "");
    let frames = Dataset::open(&root).unwrap().frames(&id("0018", "clone")).unwrap();
    assert!(frames[0].image.is_none() && frames[1].image.is_some());
    assert!(frames[0].classes.is_none());
}

#[test]
fn a_vehicle_without_a_pose_costs_its_frame_only() {
    let (_folder, root) = vkitti2();
    replace(&root, "Scene18/clone/pose.txt", "\n0 0 2 ", "\n0 0 9 ");
    let read = Dataset::open(&root).unwrap().read(&id("0018", "clone")).unwrap();
    assert_eq!(read.skipped, [0]);
    assert_eq!(read.frames.len(), 1);
    let problem = read.problems[0].to_string();
    assert!(
        problem.ends_with("bbox.txt` line 4: `pose.txt` has no row for this frame and track 2"),
        "{problem}"
    );
}

#[test]
fn columns_in_the_order_of_the_first_release_are_found() {
    let (_folder, root) = vkitti2();
    let [l, t, r, b] = VEHICLES[0].bounds();
    replace(&root, BBOX, &format!("{l} {r} {t} {b}"), &format!("{l} {t} {r} {b}"));
    replace(&root, BBOX, "left right top", "left top right");
    let read = Dataset::open(&root).unwrap().read(&id("0018", "clone")).unwrap();
    let problems: Vec<String> = read.problems.iter().map(ToString::to_string).collect();
    assert!(
        problems[0].ends_with("line 1: column 5 is headed `top`, but `right` is expected there"),
        "{problems:?}"
    );
    let swapped = format!("column `left` is {l}, beyond `right`, which is {t}");
    assert!(problems.iter().any(|problem| problem.ends_with(&swapped)), "{problems:?}");
}
