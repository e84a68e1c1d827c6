use std::path::Path;

use partpose::dataset::{Dataset, MAX_PROBLEMS};

use super::{VEHICLES, good_rows, id, vkitti1, write};

/// Replaces one field (counted from 1) of track 1 in frame 2 and expects that frame, and no other, to be left out.
fn check(field: usize, text: &str, message: &str) {
    let row = VEHICLES[1].motgt(2, 1);
    let mut fields: Vec<&str> = row.split_whitespace().collect();
    fields[field - 1] = text;
    check_row(&row, &(fields.join(" ") + "\n"), message);
}

fn check_row(row: &str, replaced: &str, message: &str) {
    let (_folder, root) = vkitti1(&good_rows().replacen(row, replaced, 1));
    let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    let problems: Vec<String> = read.problems.iter().map(ToString::to_string).collect();
    let path = root.join("vkitti_1.3.1_motgt/0001_clone.txt");
    assert_eq!(problems, [format!("`{}` line 9: {message}", path.display())]);
    assert_eq!(read.skipped, [2]);
    assert_eq!(read.frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), [0, 1, 3]);
}

#[test]
fn impossible_numbers_are_named_with_their_column() {
    check(2, "-1", "column `tid` is -1, outside 0 to 4294967295");
    check(2, "1.5", "column `tid` is 1.5, outside 0 to 4294967295");
    check(4, "3", "column `truncated` is 3, outside 0 to 2");
    check(5, "x", "column `occluded` is `x`, not a finite number");
    check(6, "NaN", "column `alpha` is `NaN`, not a finite number");
    check(11, "0", "column `w3d` is 0, outside 0.01 to 100");
    check(12, "inf", "column `h3d` is `inf`, not a finite number");
    check(13, "-4.9", "column `l3d` is -4.9, outside 0.01 to 100");
    check(14, "1e300", "column `x3d` is 1e300, outside -1000000 to 1000000");
    check(14, "-20000", "column `x3d` is -20000, outside -10000 to 10000");
    check(17, "90", "column `ry` is 90, outside -7 to 7");
    check(20, "1.5", "column `truncr` is 1.5, outside 0 to 1");
    check(21, "-0.1", "column `occupr` is -0.1, outside 0 to 1");
    check(23, "2", "column `moving` is 2, outside 0 to 1");
}

#[test]
fn unknown_words_are_shown_without_their_control_characters() {
    check(3, "Boat", "column `label` is `Boat`, not one of Car, Van, Truck, DontCare");
    check(22, "\u{1b}[31m", "column `orig_label` is `\\u{1b}[31m`, not one of Car, Van, Truck");
    let long = "a".repeat(100_000);
    let shown = "a".repeat(40);
    check(
        3,
        &long,
        &format!("column `label` is `{shown}...`, not one of Car, Van, Truck, DontCare"),
    );
}

#[test]
fn boxes_that_no_image_has_are_found() {
    let [l, t, r, b] = VEHICLES[1].bounds();
    check(7, "1200", &format!("column `l` is 1200, beyond `r`, which is {r}"));
    check(10, "1", &format!("column `t` is {t}, beyond `b`, which is 1"));
    let outside = "(l, t, r, b) does not lie in the image of 1242 x 375 pixels";
    check(9, "1300", &format!("the box {:?} {outside}", [l, t, 1300.0, b]));
    check(8, "-20", &format!("the box {:?} {outside}", [l, -20.0, r, b]));
}

#[test]
fn a_vehicle_behind_the_camera_is_found() {
    check(16, "-22", "the cuboid lies behind the camera: its bottom centre has z = -22 m");
}

#[test]
fn rows_of_another_length_are_found() {
    let row = VEHICLES[1].motgt(2, 1);
    check_row(&row, "2 1 Car\n", "3 columns, but 25 are needed");
    check_row(&row, &row.replace('\n', " more\n"), "26 columns, but 25 are needed");
}

#[test]
fn a_track_that_comes_twice_in_a_frame_is_found() {
    let row = VEHICLES[1].motgt(2, 1);
    check_row(&row, &VEHICLES[1].motgt(2, 0), "track 0 is in this frame already, on line 8");
}

#[test]
fn a_row_without_a_readable_frame_is_reported_without_one() {
    let (_folder, root) = vkitti1(&good_rows().replacen("2 1 Car", "1000000 1 Car", 1));
    let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    assert_eq!(read.problems.len(), 1);
    assert_eq!(read.problems[0].frame, None);
    let text = read.problems[0].fault.to_string();
    let expected = "column `frame` is 1000000, outside 0 to 999999; \
                    the frame of this row is unknown, so the row is missing there";
    assert_eq!(text, expected);
    let counts: Vec<usize> = read.frames.iter().map(|frame| frame.vehicles.len()).collect();
    assert_eq!((counts, read.skipped.len()), (vec![3, 3, 2, 3], 0));
}

#[test]
fn a_frame_with_more_vehicles_than_ids_is_left_out() {
    const MOST: u32 = 65_534;
    let rows = |count: u32| (0..count).map(|track| VEHICLES[1].motgt(2, track)).collect::<String>();
    let (_folder, root) = vkitti1(&rows(MOST));
    let full = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    assert!(full.problems.is_empty() && full.frames[2].vehicles.len() == MOST as usize);
    let (_folder, root) = vkitti1(&rows(MOST + 2));
    let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    let problems: Vec<String> = read.problems.iter().map(ToString::to_string).collect();
    assert_eq!(problems.len(), 1, "{problems:?}");
    let end = "line 65536: the frame has more than the 65534 vehicles that can be told apart";
    assert!(problems[0].ends_with(end), "{problems:?}");
    assert_eq!((read.skipped, read.frames.len()), (vec![2], 3));
}

#[test]
fn a_camera_pose_that_is_none_costs_its_frame() {
    for (bad, message) in [
        (
            "1 2 0 0 0.5 0 1 0 100 0 0 1 0 0 0 0 1",
            "line 3: the matrix is not a rotation: it misses by 3",
        ),
        (
            "1 1 0 0 0.5 0 1 0 100 0 0 -1 0 0 0 0 1",
            "line 3: the matrix is not a rotation: it misses by 2",
        ),
        (
            "1 1 0 0 0.5 0 1 0 100 0 0 1 0 0 0 7 1",
            "line 3: the matrix is not a rotation: it misses by 7",
        ),
        (
            "1 1 0 0 nan 0 1 0 100 0 0 1 0 0 0 0 1",
            "line 3: column `t1` is `nan`, not a finite number",
        ),
        ("0 1 0 0 0.5 0 1 0 100 0 0 1 0 0 0 0 1", "line 3: the frame has a row already, on line 2"),
    ] {
        let (_folder, root) = vkitti1(&good_rows());
        let path = root.join("vkitti_1.3.1_extrinsicsgt/0001_clone.txt");
        let text = std::fs::read_to_string(&path).unwrap();
        let line = text.lines().nth(2).unwrap().to_owned();
        std::fs::write(&path, text.replace(&line, bad)).unwrap();
        let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
        let problem = read.problems[0].to_string();
        assert!(problem.ends_with(message), "{problem}");
        assert_eq!(read.skipped.len(), 1, "{bad}");
    }
}

#[test]
fn a_file_cut_anywhere_loses_no_more_than_its_last_frame() {
    let (_folder, root) = vkitti1(&good_rows());
    let path = root.join("vkitti_1.3.1_motgt/0001_clone.txt");
    let whole = std::fs::read(&path).unwrap();
    for cut in (0..whole.len()).step_by(97) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        if let Ok(read) = Dataset::open(&root).unwrap().read(&id("0001", "clone")) {
            assert!(read.skipped.len() <= 1, "cut at {cut}: {:?}", read.problems);
        } else {
            assert_eq!(cut, 0, "only the empty file is hopeless");
        }
    }
}

#[test]
fn a_file_that_is_wrong_throughout_does_not_fill_memory_with_problems() {
    let (_folder, root) = vkitti1(&"x\n".repeat(MAX_PROBLEMS + 500));
    let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    assert_eq!((read.problems.len(), read.problems_omitted), (MAX_PROBLEMS, 500));
}

#[test]
fn bytes_that_are_not_text_are_an_error_with_their_place() {
    let (_folder, root) = vkitti1(&good_rows());
    let path = root.join("vkitti_1.3.1_motgt/0001_clone.txt");
    std::fs::write(&path, b"frame\xff\xfe").unwrap();
    let error = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap_err();
    assert!(error.to_string().ends_with("is not text: byte 5 is not UTF-8"), "{error}");
}

#[test]
fn a_header_with_swapped_columns_is_reported() {
    let (_folder, root) = vkitti1(&good_rows());
    let path = root.join("vkitti_1.3.1_motgt/0001_clone.txt");
    let text = std::fs::read_to_string(&path).unwrap().replace("w3d h3d", "h3d w3d");
    std::fs::write(&path, text).unwrap();
    let read = Dataset::open(&root).unwrap().read(&id("0001", "clone")).unwrap();
    let problem = read.problems[0].to_string();
    assert!(problem.ends_with("line 1: column 11 is headed `h3d`, but `w3d` is expected there"));
    assert!(read.skipped.is_empty());
}

#[test]
fn a_folder_without_a_layout_says_what_was_looked_for() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "readme.txt", "nothing");
    let error = Dataset::open(folder.path()).unwrap_err();
    let cause = std::error::Error::source(&error).unwrap().to_string();
    for sign in ["vkitti_1.3.1_motgt", "Scene<nn>", "training/label_2"] {
        assert!(cause.contains(sign), "{cause}");
    }
    let error = Dataset::open(Path::new("/nowhere")).unwrap_err();
    assert_eq!(error.to_string(), "cannot read `/nowhere`");
}
