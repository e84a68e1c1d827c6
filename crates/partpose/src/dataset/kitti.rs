//! KITTI's object detection set (Geiger, Lenz, Urtasun: *Are We Ready for Autonomous Driving?*, CVPR 2012).
//!
//! One sequence, `training`, whose frames have nothing to do with each other. Cars, vans and trucks become vehicles;
//! `DontCare` rows become areas to ignore; people, cyclists, trams and the rest are passed over. Locations are moved
//! from the frame of the labels to that of the camera of `image_2`. Boxes are continuous coordinates here, taken as
//! they are; vehicles have a yaw only.

use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;

use crate::files::{self, FileError};
use crate::geometry::{Cuboid, EulerAngles, Extent, Pose, Rect, Vector3};
use crate::vehicle::{MAX_SIDE, MIN_SIDE};

use super::calibration::KittiCalibration;
use super::collect::{self, Drafts};
use super::problem::{Fault, Problem};
use super::table::{MAX_FRAME, Row};
use super::vkitti::{MAX_ANGLE, MAX_POSITION};
use super::{DatasetError, Frame, SequenceFrames, SequenceId, VehicleLabel};

/// Size of most images, taken where the image is missing, pixels.
const USUAL_SIZE: [u32; 2] = [1242, 375];
/// More of it outside the image: heavily truncated; KITTI's limit for hard examples.
const HEAVY_TRUNCATION: f64 = 0.5;

const COLUMNS: &[&str] = &[
    "type",
    "truncated",
    "occluded",
    "alpha",
    "x1",
    "y1",
    "x2",
    "y2",
    "h",
    "w",
    "l",
    "x",
    "y",
    "z",
    "rotation_y",
    "score",
];
const TYPES: &[&str] =
    &["Car", "Van", "Truck", "Pedestrian", "Person_sitting", "Cyclist", "Tram", "Misc", "DontCare"];

/// The one sequence; none if the folder has another layout.
pub(super) fn sequences(root: &Path) -> Vec<SequenceId> {
    let id = SequenceId { world: "training".to_owned(), variation: String::new() };
    if root.join("training/label_2").is_dir() { vec![id] } else { Vec::new() }
}

/// The file with a frame's labels.
pub(super) fn label_file(root: &Path, index: u32) -> PathBuf {
    root.join(format!("training/label_2/{index:06}.txt"))
}

/// One frame for every file of labels.
pub(super) fn read(root: &Path, sequence: &SequenceId) -> Result<SequenceFrames, DatasetError> {
    let mut drafts = Drafts::default();
    for index in indices(&root.join("training/label_2"))? {
        if let Err(mut problem) = frame(root, sequence, index, &mut drafts) {
            problem.frame = Some(index);
            drafts.problems.push(problem);
        }
    }
    Ok(drafts.finish())
}

fn indices(folder: &Path) -> Result<Vec<u32>, DatasetError> {
    let failed = |source| FileError::read(folder, source);
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        let index = name.to_str().and_then(|name| name.strip_suffix(".txt")?.parse().ok());
        found.extend(index.filter(|index: &u32| *index <= MAX_FRAME));
    }
    found.sort_unstable();
    Ok(found)
}

/// Reads a frame; a bad row is noted and the rest read on, so that all faults of a file are seen at once.
fn frame(
    root: &Path,
    sequence: &SequenceId,
    index: u32,
    drafts: &mut Drafts,
) -> Result<(), Problem> {
    let labels = label_file(root, index);
    let unreadable = |path: &Path, error: &dyn std::error::Error| {
        Problem::of_file(path, None, Fault::unreadable(error))
    };
    let calib = root.join(format!("training/calib/{index:06}.txt"));
    if !calib.is_file() {
        return Err(Problem::of_file(&calib, None, Fault::Missing));
    }
    let text = files::read_text(&calib).map_err(|error| unreadable(&calib, &error))?;
    let calibration = KittiCalibration::parse(&calib, &text)?;
    let image =
        ["png", "jpg"].map(|ending| root.join(format!("training/image_2/{index:06}.{ending}")));
    let image = image.into_iter().find(|path| path.is_file());
    let size = match &image {
        Some(path) => files::image_size(path).map_err(|error| unreadable(path, &error))?,
        None => USUAL_SIZE,
    };
    if image.is_none() {
        let fault = Fault::SizeUnknown { assumed: USUAL_SIZE };
        drafts.problems.push(Problem::of_file(&labels, Some(index), fault));
    }
    let camera = calibration.camera(size);
    let text = files::read_text(&labels).map_err(|error| unreadable(&labels, &error))?;
    let make = || Frame { image: image.clone(), ..Frame::new(sequence.clone(), index, camera) };
    drafts.frame(index, make);
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        // Results carry a score, labels do not.
        let fields = line.split_ascii_whitespace().count();
        let columns = if fields == COLUMNS.len() { COLUMNS } else { &COLUMNS[..COLUMNS.len() - 1] };
        let parsed = Row::new(&labels, columns, (i + 1, line), Some(index)).and_then(|row| {
            let size = image.as_ref().map(|_| camera.size);
            Ok((label(&row, &calibration.offset, size)?, row))
        });
        match drafts.problems.keep(parsed) {
            Some((Label::Vehicle(vehicle), row)) => drafts.add(&row, index, vehicle, make),
            Some((Label::Ignored(rect), _)) => drafts.frame(index, make).frame.ignored.push(rect),
            Some((Label::Other, _)) | None => {}
        }
    }
    Ok(())
}

enum Label {
    Vehicle(VehicleLabel),
    Ignored(Rect),
    Other,
}

/// What a row labels; the image's size is `None` where it is not known.
fn label(row: &Row, offset: &Vector3, size: Option<[u32; 2]>) -> Result<Label, Problem> {
    const EXPECTED: &str =
        "Car, Van, Truck, Pedestrian, Person_sitting, Cyclist, Tram, Misc, DontCare";
    let category = row.word(0, TYPES, EXPECTED)?;
    let (left, right) = row.ordered(4, 6)?;
    let (top, bottom) = row.ordered(5, 7)?;
    if let Some(size) = size {
        collect::inside_image(row, [left, top, right, bottom], size)?;
    }
    let bounds = Rect::new(left, top, right, bottom);
    match category {
        "DontCare" => return Ok(Label::Ignored(bounds)),
        "Car" | "Van" | "Truck" => {}
        _ => return Ok(Label::Other),
    }
    let side = |column| row.number_in(column, MIN_SIDE, MAX_SIDE);
    let along = |column| row.number_in(column, -MAX_POSITION, MAX_POSITION);
    let extent = Extent::new(side(9)?, side(8)?, side(10)?);
    let position = Vector3::new(along(11)?, along(12)?, along(13)?) + offset;
    let yaw = row.number_in(14, -MAX_ANGLE, MAX_ANGLE)? + FRAC_PI_2;
    let rotation = EulerAngles { x: 0.0, y: yaw, z: 0.0 }.to_rotation();
    let camera_from_vehicle =
        Pose::from_parts(position.into(), UnitQuaternion::from_rotation_matrix(&rotation));
    let cuboid = Cuboid { camera_from_vehicle, extent };
    collect::in_front(row, &cuboid)?;
    // -1 stands for unknown in results.
    let truncation = row.number_in(1, -1.0, 1.0)?.max(0.0);
    let occluded = row.number_in(2, -1.0, 3.0)?;
    row.number_in(3, -10.0, 10.0)?;
    Ok(Label::Vehicle(VehicleLabel {
        track: None,
        category: category.to_owned(),
        dont_care: false,
        truncated: u8::from(truncation > 0.0) + u8::from(truncation > HEAVY_TRUNCATION),
        // 3 is "unknown": treated as the worst that is known.
        occluded: occluded.clamp(0.0, 2.0) as u8,
        truncation,
        occupancy: None,
        bounds,
        cuboid,
        model: None,
        color: None,
    }))
}
