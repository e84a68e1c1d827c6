//! What segmentation images cut out and decide, in the layouts of both releases.

use std::fs;

use partpose::dataset::{Dataset, Frame, SegmentColor};
use partpose::files::{RgbImage, encode_indexed_png, read_gray16, read_indices, write, write_png};
use partpose::labeling::{FrameLabels, LabelOptions, Segmentation, Zoos, label_frame};
use partpose::render::LabelRenderer;

use super::{ROWS, add_sequence, job, run, zoo};

const CAR: [u8; 3] = [200, 200, 10];
const OTHER: [u8; 3] = [200, 10, 200];
const POLE: [u8; 3] = [255, 130, 0];
const SIZE: [u32; 2] = [1242, 375];
const TABLE: &str = "Category(:id) r g b\nPole 255 130 0\nCar:3 200 200 10\nCar:7 200 10 200\n";

fn colors(tracks: bool) -> Vec<SegmentColor> {
    let color = |category: &str, track: Option<u32>, rgb| SegmentColor {
        category: category.to_owned(),
        track: track.filter(|_| tracks),
        rgb,
    };
    vec![color("Pole", None, POLE), color("Car", Some(3), CAR), color("Car", Some(7), OTHER)]
}

fn paint(color: impl Fn(u32) -> [u8; 3]) -> RgbImage {
    let row: Vec<u8> = (0..SIZE[0]).flat_map(color).collect();
    RgbImage { size: SIZE, pixels: row.repeat(SIZE[1] as usize) }
}

/// A frame with the two first cars, and a folder for its images.
fn frame() -> (tempfile::TempDir, Frame) {
    let folder = tempfile::tempdir().unwrap();
    add_sequence(folder.path(), "0001", 1, &ROWS[..2]);
    let dataset = Dataset::open(folder.path()).unwrap();
    let frame = dataset.frames(&dataset.sequences()[0]).unwrap().remove(0);
    (folder, frame)
}

fn label(frame: &Frame, segmentation: Option<&Segmentation>) -> FrameLabels {
    let zoo = zoo();
    let options = LabelOptions::default();
    let mut renderer = LabelRenderer::default();
    label_frame(frame, &Zoos::single(&zoo), &options, segmentation, &mut renderer).unwrap()
}

#[test]
fn pixels_of_another_class_are_cut_out() {
    let (folder, mut frame) = frame();
    let path = folder.path().join("classes.png");
    let cut = |x: u32| (400..420).contains(&x);
    write_png(&path, &paint(|x| if cut(x) { POLE } else { CAR })).unwrap();
    let free = label(&frame, None);
    frame.classes = Some(path);
    let segmentation = Segmentation::read(&frame, &colors(false)).unwrap().unwrap();
    assert!(!segmentation.tells_vehicles_apart());
    let seen = label(&frame, Some(&segmentation));
    assert!(seen.segmented && !free.segmented);
    let mut lost = 0;
    for (at, (free, seen)) in free.parts.iter().zip(&seen.parts).enumerate() {
        let expected = if cut(at as u32 % SIZE[0]) { 0 } else { *free };
        assert_eq!(*seen, expected);
        lost += u32::from(*seen != *free);
    }
    assert!(lost > 500, "{lost}");
}

/// All pixels are given to the car behind: where both models reach, its parts are seen and not those of the nearer.
fn check_owner(frame: &Frame, colors: &[SegmentColor]) {
    let segmentation = Segmentation::read(frame, colors).unwrap().unwrap();
    assert!(segmentation.tells_vehicles_apart());
    let labels = label(frame, Some(&segmentation));
    let [near, far] = &labels.vehicles[..] else { panic!("{:?}", labels.vehicles) };
    assert_eq!((near.visible_pixels, far.visible_pixels), (0, far.total_pixels));
    let mut alone = frame.clone();
    alone.vehicles.remove(0);
    assert!(labels.parts == label(&alone, None).parts);
}

#[test]
fn the_first_release_tells_whose_pixel_it_is_by_colour() {
    let (folder, mut frame) = frame();
    let path = folder.path().join("scene.png");
    write_png(&path, &paint(|_| OTHER)).unwrap();
    frame.classes = Some(path.clone());
    frame.instances = Some(path);
    check_owner(&frame, &colors(true));
}

#[test]
fn the_second_release_tells_whose_pixel_it_is_by_index() {
    let (folder, mut frame) = frame();
    let path = folder.path().join("instances.png");
    let palette: Vec<[u8; 3]> = (0..=255).map(|value| [value, 0, 255 - value]).collect();
    let indices = vec![8; (SIZE[0] * SIZE[1]) as usize];
    write(&path, &encode_indexed_png(SIZE, &indices, &palette)).unwrap();
    frame.instances = Some(path);
    check_owner(&frame, &[]);
    // And with classes beside.
    let classes = folder.path().join("classes.png");
    write_png(&classes, &paint(|_| CAR)).unwrap();
    frame.classes = Some(classes);
    check_owner(&frame, &colors(false));
}

#[test]
fn frames_without_the_segmentation_of_their_sequence_are_skipped_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    add_sequence(folder.path(), "0001", 4, &ROWS[..2]);
    let scene = folder.path().join("vkitti_1.3.1_scenegt");
    let image = |at: u32| scene.join(format!("0001/clone/{at:05}.png"));
    fs::create_dir_all(scene.join("0001/clone")).unwrap();
    fs::write(scene.join("0001_clone_scenegt_rgb_encoding.txt"), TABLE).unwrap();
    let png = |color| partpose::files::encode_png(&paint(move |_| color));
    write(&image(0), &png(CAR)).unwrap();
    write(&image(1), &png([1, 2, 3])).unwrap();
    write(&image(2), &png(CAR)[..500]).unwrap();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let open = || Dataset::open(folder.path()).unwrap();
    let dataset = open();
    let mut job = job(dataset.sequences(), &zoo);
    let report = run(&dataset, &job, out.path());
    let reasons: Vec<String> =
        report.skipped.iter().map(|s| format!("{}: {}", s.name, s.error)).collect();
    assert_eq!(reasons.len(), 3, "{reasons:?}");
    assert!(
        reasons[0].starts_with("0001/clone/00001: ") && reasons[0].contains("[1, 2, 3] at (0, 0)")
    );
    assert!(reasons[1].contains("cannot decode the image"), "{reasons:?}");
    assert!(reasons[2].contains("no class segmentation"), "{reasons:?}");
    let coco = fs::read_to_string(out.path().join("coco/0001_clone.json")).unwrap();
    assert!(coco.contains("\"skipped_frames\":[1,2,3]"), "{coco}");
    assert!(coco.contains("everything else by the data set's segmentation"), "{coco}");
    let instances = read_gray16(&out.path().join("instances/0001/clone/00000.png")).unwrap();
    assert!(instances.values.iter().all(|id| [0, 4].contains(id)), "all pixels are car 3's");
    // Mended frames are labelled when the run is resumed.
    (1..4).for_each(|at| write(&image(at), &png(OTHER)).unwrap());
    job.resume = true;
    let report = run(&open(), &job, out.path());
    assert_eq!((report.skipped.len(), report.sequences[0].written), (0, 4));
    let parts = read_indices(&out.path().join("parts/0001/clone/00003.png")).unwrap();
    assert!(parts.values.iter().any(|part| *part != 0));
}
