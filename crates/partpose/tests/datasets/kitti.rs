use std::path::{Path, PathBuf};

use partpose::dataset::{Dataset, KittiCalibration, Layout};
use partpose::files::{RgbImage, write_png};
use partpose::geometry::{EulerAngles, Point3};

use super::{id, write};

const P2: &str = "P2: 700 0 600 35 0 700 180 0.7 0 0 1 0.001\n";
const CAR: &str = "Car 0.6 1 -1.5 100.5 120.25 300 250 1.5 1.7 4.1 -2 1.6 12 -1.57\n";

/// One frame; the image has 1000 x 300 pixels.
fn kitti(labels: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_owned();
    write(&root, "training/label_2/000007.txt", labels);
    write(&root, "training/calib/000007.txt", &format!("P0: 1 2 3\n{P2}\n"));
    let image = RgbImage { size: [1000, 300], pixels: vec![0; 900_000] };
    write_png(&root.join("training/image_2/000007.png"), &image).unwrap();
    (folder, root)
}

fn read(root: &Path) -> partpose::dataset::SequenceFrames {
    let dataset = Dataset::open(root).unwrap();
    assert_eq!(dataset.layout(), Layout::Kitti);
    dataset.read(&id("training", "")).unwrap()
}

#[test]
fn labels_are_moved_to_the_colour_camera() {
    let (_folder, root) = kitti(CAR);
    let read = read(&root);
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    let frame = &read.frames[0];
    assert_eq!((frame.index, frame.camera.size), (7, [1000, 300]));
    let vehicle = &frame.vehicles[0];
    // Projecting with the whole P2 and with K after moving must agree.
    let point = Point3::new(-2.0, 1.6, 12.0);
    let homogeneous = [700.0 * point.x + 600.0 * point.z + 35.0, point.z + 0.001];
    let moved = Point3::from(vehicle.cuboid.camera_from_vehicle.translation.vector);
    let pixel = frame.camera.project(&moved).unwrap();
    assert!((pixel.x - homogeneous[0] / homogeneous[1]).abs() < 1e-9);
    assert_eq!(vehicle.cuboid.extent.to_vector().as_slice(), [1.7, 1.5, 4.1]);
    let yaw = EulerAngles::from_rotation(
        &vehicle.cuboid.camera_from_vehicle.rotation.to_rotation_matrix(),
    );
    // rotation_y = -90 degrees drives away from the camera: along z.
    assert!((yaw.y - (std::f64::consts::FRAC_PI_2 - 1.57)).abs() < 1e-9);
    assert_eq!((vehicle.truncated, vehicle.occluded, vehicle.dont_care), (2, 1, false));
    assert!((vehicle.bounds.x_min - 100.5).abs() < 1e-12);
}

#[test]
fn other_types_are_passed_over_and_dont_care_is_an_area() {
    let labels = format!(
        "Cyclist 0 0 0 10 10 20 20 1.7 0.6 1.8 0 1.6 20 0\n\
         DontCare -1 -1 -10 5 6 7 8 -1 -1 -1 -1000 -1000 -1000 -10\n{CAR}"
    );
    let (_folder, root) = kitti(&labels);
    let read = read(&root);
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    let frame = &read.frames[0];
    assert_eq!((frame.vehicles.len(), frame.ignored.len()), (1, 1));
    assert!((frame.ignored[0].x_max - 7.0).abs() < 1e-12);
    assert_eq!(read.line_of(0, 0), Some(3));
}

#[test]
fn results_with_scores_are_read_too() {
    let (_folder, root) = kitti(&CAR.replace("0.6 1", "-1 -1").replace("-1.57\n", "-1.57 0.93\n"));
    let read = read(&root);
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    assert_eq!(read.frames[0].vehicles[0].truncated, 0);
}

#[test]
fn a_missing_image_leaves_the_usual_size_and_a_note() {
    let (_folder, root) = kitti(CAR);
    std::fs::remove_dir_all(root.join("training/image_2")).unwrap();
    let read = read(&root);
    assert_eq!(read.frames[0].camera.size, [1242, 375]);
    let note = read.problems[0].to_string();
    assert!(note.ends_with("the image is missing, so its size is taken to be 1242 x 375"));
    assert!(read.skipped.is_empty());
}

#[test]
fn a_frame_without_calibration_is_skipped() {
    let (_folder, root) = kitti(CAR);
    std::fs::remove_file(root.join("training/calib/000007.txt")).unwrap();
    let read = read(&root);
    assert_eq!(read.skipped, [7]);
    assert!(read.problems[0].to_string().ends_with("calib/000007.txt`: the file is missing"));
}

#[test]
fn a_damaged_image_costs_its_frame() {
    let (_folder, root) = kitti(CAR);
    write(&root, "training/image_2/000007.png", "\u{89}PNG");
    let read = read(&root);
    assert_eq!(read.skipped, [7]);
}

#[test]
fn calibrations_without_a_pinhole_camera_are_refused() {
    let parse = |text: &str| {
        KittiCalibration::parse(Path::new("c.txt"), text).map_err(|problem| problem.to_string())
    };
    let check = |text: &str, message: &str| assert_eq!(parse(text).unwrap_err(), message);
    check("", "`c.txt`: there is no row `P2:`");
    check("P1: 1\nP2: 1 2 3\n", "`c.txt` line 2: 3 columns, but 12 are needed");
    check("P2: 1 2 x\n", "`c.txt` line 1: column `P2` is `x`, not a finite number");
    check("P2: NaN\n", "`c.txt` line 1: column `P2` is `NaN`, not a finite number");
    check(
        "P2: 0 0 600 35 0 700 180 0 0 0 1 0\n",
        "`c.txt` line 1: `P2` is not the projection of a pinhole camera with a focal length",
    );
    check(
        "P2: 700 9 600 35 0 700 180 0 0 0 1 0\n",
        "`c.txt` line 1: `P2` is not the projection of a pinhole camera with a focal length",
    );
    let good = parse(P2).unwrap();
    assert!((good.offset.x - (35.0 - 600.0 * 0.001) / 700.0).abs() < 1e-12);
}
