//! One frame: which model, which vehicles, whose pixels, which annotations.

use partpose::dataset::{Dataset, Frame, VehicleLabel};
use partpose::geometry::Extent;
use partpose::labeling::{
    Categories, DontCare, FrameLabels, LabelOptions, ModelChoice, StandIn, Zoos, assign,
    instance_ids, label_frame,
};
use partpose::render::{LabelRenderer, render_labels};

use super::{dataset, zoo};

fn first_frame(dataset: &Dataset) -> Frame {
    dataset.frames(&dataset.sequences()[0]).unwrap().remove(0)
}

fn label(frame: &Frame, options: &LabelOptions) -> FrameLabels {
    let zoo = zoo();
    let mut renderer = LabelRenderer::default();
    label_frame(frame, &Zoos::single(&zoo), options, None, &mut renderer).unwrap()
}

fn rows(labels: &FrameLabels) -> Vec<usize> {
    labels.vehicles.iter().map(|vehicle| vehicle.row).collect()
}

#[test]
fn labels_are_what_drawing_all_vehicles_together_shows() {
    let (_folder, dataset) = dataset();
    let mut frame = first_frame(&dataset);
    frame.vehicles.retain(|vehicle| vehicle.category == "Car");
    let labels = label(&frame, &LabelOptions::default());
    let zoo = zoo();
    let drawn = render_labels(&frame.camera, &frame.instances(&zoo));
    let differing = drawn.parts.iter().zip(&labels.parts).filter(|(a, b)| a != b).count();
    // A window's origin is taken off the principal point, which may round an edge to the next 256th of a pixel.
    assert!(differing <= 2, "{differing} pixels");
    assert!(drawn.parts.iter().filter(|part| **part != 0).count() > 10_000);
}

#[test]
fn nearer_vehicles_hide_farther_ones_and_the_hidden_share_is_known() {
    let (_folder, dataset) = dataset();
    let labels = label(&first_frame(&dataset), &LabelOptions::default());
    let [near, far, ..] = &labels.vehicles[..] else { panic!("{:?}", labels.vehicles) };
    assert_eq!((near.row, far.row), (0, 1));
    assert_eq!(near.visible_pixels, near.total_pixels);
    assert!(far.visible_pixels < far.total_pixels && far.visible_pixels > 0);
    for vehicle in &labels.vehicles {
        let shown = labels.instances.iter().filter(|id| **id == vehicle.id).count();
        assert_eq!(shown, vehicle.visible_pixels as usize);
    }
}

#[test]
fn categories_that_the_zoo_lacks_hide_and_bear_no_label() {
    let (_folder, dataset) = dataset();
    let frame = first_frame(&dataset);
    let labels = label(&frame, &LabelOptions::default());
    assert_eq!(rows(&labels), [0, 1, 2, 4]);
    let behind = &labels.vehicles[3];
    assert!(behind.visible_pixels < behind.total_pixels, "the van stands before it");
    let all = LabelOptions { categories: Categories::All, ..LabelOptions::default() };
    let labels = label(&frame, &all);
    assert_eq!(rows(&labels), [0, 1, 2, 3, 4]);
    assert_eq!(labels.vehicles[3].stand_in, Some(StandIn::Category));
    assert_eq!(labels.vehicles[3].model, "Long", "the nearest in size of any");
    let none = LabelOptions {
        categories: Categories::Named(vec!["Truck".to_owned()]),
        ..LabelOptions::default()
    };
    assert!(label(&frame, &none).vehicles.is_empty());
}

#[test]
fn vehicles_to_ignore_are_drawn_or_hide_only() {
    let (_folder, dataset) = dataset();
    let frame = first_frame(&dataset);
    let options = LabelOptions { dont_care: DontCare::Occlude, ..LabelOptions::default() };
    assert_eq!(rows(&label(&frame, &options)), [0, 1, 4]);
}

#[test]
fn model_is_the_nearest_in_size_or_the_one_named() {
    let (_folder, dataset) = dataset();
    let frame = first_frame(&dataset);
    let zoo = zoo();
    let mut vehicle = frame.vehicles[0].clone();
    vehicle.cuboid.extent = Extent::new(1.85, 1.7, 5.3);
    let chosen = |vehicle: &VehicleLabel, models| {
        let options = LabelOptions { models, ..LabelOptions::default() };
        let found = assign(&frame, vehicle, &Zoos::single(&zoo), &options).unwrap();
        (found.model.name().to_owned(), found.stand_in)
    };
    assert_eq!(chosen(&vehicle, ModelChoice::Size), ("Long".to_owned(), None));
    assert_eq!(chosen(&vehicle, ModelChoice::Name), ("Boxy".to_owned(), None));
    vehicle.model = Some("Unheard".to_owned());
    assert_eq!(chosen(&vehicle, ModelChoice::Name), ("Long".to_owned(), Some(StandIn::Name)));
}

#[test]
fn ids_are_tracks_unless_one_of_them_does_not_fit() {
    let (_folder, dataset) = dataset();
    let mut frame = first_frame(&dataset);
    assert_eq!(instance_ids(&frame), [4, 8, 9, 10, 12]);
    for track in [None, Some(65_534), Some(u32::MAX)] {
        frame.vehicles[1].track = track;
        assert_eq!(instance_ids(&frame), [1, 2, 3, 4, 5]);
    }
}

#[test]
fn masks_of_a_vehicle_are_its_pixels_part_by_part() {
    let (_folder, dataset) = dataset();
    let labels = label(&first_frame(&dataset), &LabelOptions::default());
    for vehicle in &labels.vehicles {
        let masks = labels.masks(vehicle).unwrap();
        let inside = masks.vehicle.decode();
        let expected: Vec<bool> = labels.instances.iter().map(|id| *id == vehicle.id).collect();
        assert!(inside == expected);
        let mut sum = 0;
        for (part, mask) in masks.parts.iter() {
            let own = |(part_id, id): (&u8, &u16)| *part_id == part.id() && *id == vehicle.id;
            let pixels: Vec<bool> = labels.parts.iter().zip(&labels.instances).map(own).collect();
            assert!(mask.decode() == pixels, "{}", part.name());
            sum += mask.area();
        }
        assert_eq!(sum, masks.vehicle.area());
    }
}

#[test]
fn vehicle_beside_and_behind_the_camera_is_drawn_as_far_as_it_is_seen() {
    let (_folder, dataset) = dataset();
    let mut frame = first_frame(&dataset);
    frame.vehicles.truncate(1);
    let place = &mut frame.vehicles[0].cuboid.camera_from_vehicle.translation;
    (place.x, place.z) = (-1.6, 1.0);
    let labels = label(&frame, &LabelOptions::default());
    assert!(labels.vehicles[0].visible_pixels > 1000);
    frame.vehicles[0].cuboid.camera_from_vehicle.translation.x = 900.0;
    assert!(label(&frame, &LabelOptions::default()).vehicles.is_empty());
}

#[test]
fn frame_with_more_vehicles_than_memory_is_refused() {
    let (_folder, dataset) = dataset();
    let mut frame = first_frame(&dataset);
    let mut near = frame.vehicles[0].clone();
    near.cuboid.camera_from_vehicle.translation.z = 0.5;
    near.track = None;
    // Each fills the image; nothing of that is ever drawn.
    frame.camera.size = [9_000, 12_000];
    frame.vehicles = vec![near; 3];
    let zoo = zoo();
    let mut renderer = LabelRenderer::default();
    let options = LabelOptions::default();
    let error = label_frame(&frame, &Zoos::single(&zoo), &options, None, &mut renderer);
    assert_eq!(
        error.unwrap_err().to_string(),
        "3 vehicles in an image of [9000, 12000] pixels are too many or too large to be drawn"
    );
}
