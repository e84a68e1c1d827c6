use std::path::Path;

use partpose::dataset::Dataset;
use partpose::dataset::check::{CheckOptions, CheckReport, check};
use partpose::files::{RgbImage, write_png};
use partpose::parts::PartClass;

use super::{VEHICLES, good_rows, published, vkitti1};

fn report(root: &Path, options: &CheckOptions) -> CheckReport {
    check(&Dataset::open(root).unwrap(), options, &mut |_| {})
}

fn problems(root: &Path) -> Vec<String> {
    let report = report(root, &CheckOptions::default());
    report.problems.iter().map(|problem| problem.fault.to_string()).collect()
}

/// Exchanges fields (counted from 1) of every row, or changes them, and expects one finding.
fn check_convention(change: impl Fn(&mut Vec<String>), expected: &str) {
    let rows: String = good_rows()
        .lines()
        .map(|row| {
            let mut fields: Vec<String> = row.split(' ').map(str::to_owned).collect();
            change(&mut fields);
            fields.join(" ") + "\n"
        })
        .collect();
    let (_folder, root) = vkitti1(&rows);
    let problems = problems(&root);
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].starts_with(expected), "{problems:?}");
}

fn add(field: &mut String, by: f64) {
    *field = (field.parse::<f64>().unwrap() + by).to_string();
}

#[test]
fn good_rows_are_clean_and_counted() {
    let (_folder, root) = vkitti1(&good_rows());
    let report = report(&root, &CheckOptions::default());
    assert!(report.is_clean(), "{:?}", report.problems);
    let sequence = &report.sequences[0];
    assert_eq!((sequence.frames, sequence.rows, sequence.tracks), (4, 12, 3));
    let errors = sequence.reprojection.unwrap();
    // Rounding to whole pixels is all that is wrong.
    assert!(errors.boxes == 12 && errors.max <= 0.5, "{errors:?}");
    assert_eq!(report.missing[0].what, "no part masks");
}

#[test]
fn sizes_in_the_order_of_kitti_are_recognised() {
    let swap = |fields: &mut Vec<String>| fields.swap(10, 11);
    check_convention(
        swap,
        "column `w3d` seems to hold the height; column `h3d` seems to hold the width",
    );
    // Length, width, height: the published order turned by one.
    let turn = |fields: &mut Vec<String>| fields[10..13].rotate_right(1);
    check_convention(
        turn,
        "column `w3d` seems to hold the length; column `h3d` seems to hold the width; column `l3d` seems to hold the height",
    );
}

#[test]
fn locations_at_the_centre_are_recognised() {
    // The vehicles hardly tilt, so that up in the camera is up in the vehicle.
    let lift = |fields: &mut Vec<String>| {
        let height: f64 = fields[11].parse().unwrap();
        add(&mut fields[14], -0.5 * height);
    };
    check_convention(lift, "locations seem to be centres of the boxes");
}

#[test]
fn a_yaw_that_lacks_its_quarter_turn_is_recognised() {
    let turn = |fields: &mut Vec<String>| add(&mut fields[16], std::f64::consts::FRAC_PI_2);
    check_convention(turn, "the yaw seems to lack a quarter turn");
}

#[test]
fn a_yaw_of_the_other_sign_is_recognised() {
    let turn = |fields: &mut Vec<String>| {
        let yaw: f64 = fields[16].parse().unwrap();
        fields[16] = (-yaw).to_string();
    };
    check_convention(turn, "the yaw seems to have the other sign");
}

#[test]
fn exchanged_angles_are_recognised() {
    let swap = |fields: &mut Vec<String>| fields.swap(16, 17);
    check_convention(swap, "the columns of yaw and pitch seem to be exchanged");
}

#[test]
fn edges_in_the_order_of_the_second_release_are_recognised() {
    let rows: String = VEHICLES
        .iter()
        .flat_map(|vehicle| (0..4).map(move |frame| vehicle.motgt(frame, frame)))
        .map(|row| {
            let mut fields: Vec<&str> = row.split(' ').collect();
            fields.swap(7, 8);
            fields.join(" ")
        })
        .collect();
    let (_folder, root) = vkitti1(&rows);
    let problems = problems(&root);
    let expected = "rows have edges beyond each other: the order should be `l t r b`";
    assert!(problems[0].ends_with(expected), "{problems:?}");
}

#[test]
fn one_moved_vehicle_is_named_by_line_and_track() {
    let mut moved = VEHICLES[2];
    moved.position[0] += 2.0;
    let bounds = VEHICLES[2].bounds().map(|edge| edge.to_string()).join(" ");
    let row = VEHICLES[2].motgt(1, 2);
    let wrong =
        moved.motgt(1, 2).replace(&moved.bounds().map(|e| e.to_string()).join(" "), &bounds);
    let (_folder, root) = vkitti1(&good_rows().replacen(&row, &wrong, 1));
    let report = report(&root, &CheckOptions::default());
    let problem = &report.problems[0];
    assert_eq!((report.problems.len(), problem.line, problem.frame), (1, Some(7), Some(1)));
    let text = problem.fault.to_string();
    assert!(text.starts_with("the cuboid of track 2 misses the annotated box by 2"), "{text}");
    assert!(!problem.skips_frame());
}

#[test]
fn a_track_that_changes_its_model_is_named() {
    let row = VEHICLES[0].motgt(2, 0);
    let (_folder, root) = vkitti1(&good_rows().replacen(&row, &row.replace("Sedan", "Van"), 1));
    assert_eq!(problems(&root), ["track 0 has another model here than on line 2"]);
}

/// A part mask with the boxes of the vehicles filled, and one pixel more.
fn write_mask(path: &Path, pixel: usize, color: [u8; 3]) {
    let mut image = RgbImage { size: [1242, 375], pixels: vec![0; 1242 * 375 * 3] };
    for vehicle in VEHICLES {
        let [l, t, r, b] = vehicle.bounds().map(|edge| edge as usize);
        for (y, x) in (t..=b).flat_map(|y| (l..=r).map(move |x| (y, x))) {
            let at = 3 * (y * 1242 + x);
            image.pixels[at..at + 3].copy_from_slice(&PartClass::Roof.color());
        }
    }
    image.pixels[3 * pixel..3 * pixel + 3].copy_from_slice(&color);
    write_png(path, &image).unwrap();
}

#[test]
fn masks_are_compared_with_the_labels() {
    let (_folder, root) = vkitti1(&good_rows());
    let mask = |frame: u32| root.join(format!("parts/0001/clone/{frame:05}.png"));
    for frame in 0..4 {
        write_mask(&mask(frame), 0, PartClass::Hood.color());
    }
    let clean = report(&root, &CheckOptions::default());
    assert!(clean.is_clean(), "{:?}", clean.problems);
    let archives = &clean.sequences[0].archives;
    assert_eq!((archives.masks_read, archives.mask_pixels_outside), (4, 4));

    write_mask(&mask(1), 1243, [1, 2, 3]);
    assert_eq!(problems(&root), ["the colour [1, 2, 3] at (1, 1) is not that of a part"]);
    let none = report(&root, &CheckOptions { masks: Some(0), ..CheckOptions::default() });
    assert!(none.is_clean());

    let small = RgbImage { size: [10, 5], pixels: vec![0; 150] };
    write_png(&mask(1), &small).unwrap();
    assert_eq!(problems(&root), ["the image has 10 x 5 pixels, but the camera 1242 x 375"]);

    // Cut behind the header, whose size is right, and within it.
    write_mask(&mask(1), 0, [0; 3]);
    let whole = std::fs::read(mask(1)).unwrap();
    for cut in [whole.len() / 2, 20] {
        std::fs::write(mask(1), &whole[..cut]).unwrap();
        let [problem] = &problems(&root)[..] else { panic!("one problem at {cut}") };
        let start = format!("cannot decode the image `{}`: ", mask(1).display());
        let cause = problem.strip_prefix(&start).unwrap();
        assert!(cause.contains("unexpected"), "{problem}");
        assert_eq!(cause.matches("unexpected").count(), 1, "{problem}");
    }

    std::fs::remove_file(mask(1)).unwrap();
    assert_eq!(problems(&root), ["1 of 4 frames have no file here, the first of them frame 1"]);
}

#[test]
fn masks_of_other_frames_are_noticed() {
    let (_folder, root) = vkitti1(&VEHICLES[0].motgt(0, 0));
    write_mask(&root.join("parts/0001/clone/00000.png"), 0, [0; 3]);
    let found = problems(&root);
    assert!(found.iter().any(|text| text.contains("lie outside of all boxes")), "{found:?}");
}

/// Rewrites the published rows and expects to be told what was done to them, in both worlds.
fn check_published(change: impl Fn(&mut Vec<String>), expected: &str) {
    let Some(root) = published("vkitti-1.3.1") else { return };
    let folder = tempfile::tempdir().unwrap();
    for world in ["0001", "0018"] {
        let name = format!("vkitti_1.3.1_motgt/{world}_clone.txt");
        let text = std::fs::read_to_string(root.join(&name)).unwrap();
        let changed: String = text
            .lines()
            .enumerate()
            .map(|(i, row)| {
                let mut fields: Vec<String> = row.split(' ').map(str::to_owned).collect();
                if i > 0 {
                    change(&mut fields);
                }
                fields.join(" ") + "\n"
            })
            .collect();
        super::write(folder.path(), &name, &changed);
    }
    let problems = problems(folder.path());
    let found = problems.iter().filter(|problem| problem.starts_with(expected)).count();
    assert_eq!(found, 2, "{expected}: {:?}", &problems[..problems.len().min(5)]);
}

#[test]
fn mistakes_in_published_rows_are_recognised() {
    let turn = |fields: &mut Vec<String>, by: f64| add(&mut fields[16], by);
    check_published(|fields| fields.swap(10, 11), "column `w3d` seems to hold the height");
    check_published(|fields| fields[10..13].rotate_right(1), "column `w3d` seems to hold the le");
    check_published(|fields| turn(fields, std::f64::consts::FRAC_PI_2), "the yaw seems to lack");
    check_published(
        |fields| {
            let yaw: f64 = fields[16].parse().unwrap();
            turn(fields, -2.0 * yaw);
        },
        "the yaw seems to have the other sign",
    );
    check_published(|fields| fields.swap(16, 17), "the columns of yaw and pitch");
    check_published(
        |fields| {
            let height: f64 = fields[11].parse().unwrap();
            add(&mut fields[14], -0.5 * height);
            fields.swap(10, 11);
        },
        "column `w3d` seems to hold the height; column `h3d` seems to hold the width; locations",
    );
}

#[test]
fn published_data_are_clean() {
    for name in ["vkitti-1.3.1", "kitti"] {
        let Some(root) = published(name) else { continue };
        let report = report(&root, &CheckOptions::default());
        assert!(report.is_clean(), "{:?}", report.problems);
    }
}
