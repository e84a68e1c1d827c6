use partpose::dataset::{Dataset, Layout, SegmentColor};
use partpose::files::{RgbImage, write_png};

use super::{VEHICLES, good_rows, id, vkitti1, write};

#[test]
fn rows_become_vehicles_with_the_cuboids_they_describe() {
    let (_folder, root) = vkitti1(&good_rows());
    let dataset = Dataset::open(&root).unwrap();
    assert_eq!(dataset.layout(), Layout::VirtualKitti1);
    let read = dataset.read(&id("0001", "clone")).unwrap();
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    assert_eq!(read.frames.len(), 4);
    for frame in &read.frames {
        for (vehicle, invented) in frame.vehicles.iter().zip(VEHICLES) {
            let expected = invented.cuboid();
            let there = vehicle.cuboid.camera_from_vehicle;
            assert!((there.inverse() * expected.camera_from_vehicle).rotation.angle() < 1e-9);
            let apart = there.translation.vector - expected.camera_from_vehicle.translation.vector;
            assert!(apart.norm() < 1e-9);
            assert_eq!(vehicle.cuboid.extent, expected.extent);
        }
    }
    assert_eq!(read.line_of(1, 2), Some(7));
}

#[test]
fn extrinsics_are_turned_round() {
    let (_folder, root) = vkitti1(&good_rows());
    let dataset = Dataset::open(&root).unwrap();
    let frames = dataset.frames(&id("0001", "clone")).unwrap();
    let position = frames[3].world_from_camera.unwrap().translation.vector;
    assert!((position - nalgebra::Vector3::new(-0.5, -100.0, 3.0)).norm() < 1e-12);
}

#[test]
fn archives_that_are_absent_are_not_named() {
    let (_folder, root) = vkitti1(&good_rows());
    let image = RgbImage { size: [2, 1], pixels: vec![0; 6] };
    write_png(&root.join("parts/0001/clone/00002.png"), &image).unwrap();
    write_png(&root.join("vkitti_1.3.1_scenegt/0001/clone/00001.png"), &image).unwrap();
    let dataset = Dataset::open(&root).unwrap();
    let frames = dataset.frames(&id("0001", "clone")).unwrap();
    assert_eq!(frames.iter().filter(|frame| frame.parts.is_some()).count(), 1);
    assert!(frames[2].parts.is_some() && frames[1].classes.is_some());
    assert!(frames.iter().all(|frame| frame.image.is_none() && frame.depth.is_none()));
    let error = frames[2].read_parts().unwrap_err().to_string();
    assert!(error.ends_with("[2, 1] pixels, but the camera has [1242, 375]"), "{error}");
    let error = frames[0].read_parts().unwrap_err().to_string();
    assert_eq!(error, "`0001/clone/00000`: the frame has no part mask");
}

#[test]
fn frames_come_from_the_labels_where_there_are_no_extrinsics() {
    let (_folder, root) = vkitti1(&VEHICLES[0].motgt(7, 1));
    std::fs::remove_dir_all(root.join("vkitti_1.3.1_extrinsicsgt")).unwrap();
    let frames = Dataset::open(&root).unwrap().frames(&id("0001", "clone")).unwrap();
    assert_eq!(frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), [7]);
    assert_eq!(frames[0].world_from_camera, None);
}

#[test]
fn worlds_are_chosen_by_any_of_their_names() {
    let (_folder, root) = vkitti1(&good_rows());
    write(&root, "vkitti_1.3.1_motgt/0001_fog.txt", super::MOTGT_HEADER);
    write(&root, "vkitti_1.3.1_motgt/0018_clone.txt", super::MOTGT_HEADER);
    let dataset = Dataset::open(&root).unwrap();
    let select = |worlds: &[&str], variations: &[&str]| {
        let owned = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
        dataset.select(&owned(worlds), &owned(variations))
    };
    let clone = [id("0001", "clone"), id("0018", "clone")];
    assert_eq!(select(&["0018", "Scene01"], &["clone"]).unwrap(), clone);
    assert_eq!(select(&["1"], &[]).unwrap(), [id("0001", "clone"), id("0001", "fog")]);
    assert_eq!(select(&[], &[]).unwrap().len(), 3);
    let error = select(&["0001", "0002"], &["clone"]).unwrap_err().to_string();
    assert!(
        error.ends_with(
            "has no world `0002`, variation `clone`; it has 0001/clone, 0001/fog, 0018/clone"
        ),
        "{error}"
    );
}

#[test]
fn colours_of_things_name_their_track() {
    let (_folder, root) = vkitti1("");
    let path = "vkitti_1.3.1_scenegt/0001_clone_scenegt_rgb_encoding.txt";
    write(&root, path, "Category(:id) r g b\nRoad 1 2 3\nCar:12 4 5 6\n");
    let dataset = Dataset::open(&root).unwrap();
    let color = |category: &str, track, rgb| SegmentColor { category: category.into(), track, rgb };
    let expected = [color("Road", None, [1, 2, 3]), color("Car", Some(12), [4, 5, 6])];
    assert_eq!(dataset.segment_colors(&id("0001", "clone")).unwrap(), expected);
    write(&root, path, "Category r g b\nRoad 1 2 300\n");
    let error = dataset.segment_colors(&id("0001", "clone")).unwrap_err().to_string();
    assert!(error.ends_with("line 2: column `b` is 300, outside 0 to 255"), "{error}");
}
