//! Virtual KITTI 2.0.3 (Cabon, Murray, Humenberger: *Virtual KITTI 2*, 2020).
//!
//! Differs from 1.3.1 in its folders, in the order of columns (`left right top bottom`), in two cameras, in a camera
//! matrix per frame, and in that it derives nothing: which vehicles to ignore follows from the limits below. Written
//! from the published description and sample rows; never run on the release itself.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::files::{self, FileError};
use crate::geometry::{Camera, Cuboid, Rect};

use super::collect::{self, Drafts};
use super::colors::SegmentColor;
use super::problem::{Fault, Problem, Problems};
use super::table::{self, MAX_FRAME, Row};
use super::vkitti::{self, CuboidColumns};
use super::{DatasetError, Frame, SequenceFrames, SequenceId, VehicleLabel};

/// Width and height of every image, pixels.
const SIZE: [u32; 2] = [1242, 375];
/// Less of its box visible: heavily occluded. Documented default for data without flags.
const HEAVY_OCCLUSION: f64 = 0.4;
/// More of it visible: not occluded. Between the limits that 1.3.1 uses in worlds 0001 (0.848) and 0018 (0.773).
const NO_OCCLUSION: f64 = 0.8;
/// More of it outside the image: heavily truncated. Documented default for data without flags.
const HEAVY_TRUNCATION: f64 = 0.8;
/// Lower boxes are ignored, pixels. Documented default for data without flags.
const MIN_HEIGHT: f64 = 25.0;

const EXTRINSIC: &[&str] = &[
    "frame", "cameraID", "r1,1", "r1,2", "r1,3", "t1", "r2,1", "r2,2", "r2,3", "t2", "r3,1",
    "r3,2", "r3,3", "t3", "", "", "", "",
];
const INTRINSIC: &[&str] = &["frame", "cameraID", "K[0,0]", "K[1,1]", "K[0,2]", "K[1,2]"];
const INFO: &[&str] = &["trackID", "label", "model", "color"];
const BBOX: &[&str] = &[
    "frame",
    "cameraID",
    "trackID",
    "left",
    "right",
    "top",
    "bottom",
    "number_pixels",
    "truncation_ratio",
    "occupancy_ratio",
    "isMoving",
];
const POSE: &[&str] = &[
    "frame",
    "cameraID",
    "trackID",
    "alpha",
    "width",
    "height",
    "length",
    "world_space_X",
    "world_space_Y",
    "world_space_Z",
    "rotation_world_space_y",
    "rotation_world_space_x",
    "rotation_world_space_z",
    "camera_space_X",
    "camera_space_Y",
    "camera_space_Z",
    "rotation_camera_space_y",
    "rotation_camera_space_x",
    "rotation_camera_space_z",
];
const CUBOID: CuboidColumns =
    CuboidColumns { extent: [4, 5, 6], position: [13, 14, 15], angles: [16, 17, 18] };

/// The sequences that have boxes, sorted; none if the folder has another layout.
pub(super) fn sequences(root: &Path) -> Result<Vec<SequenceId>, DatasetError> {
    let mut found = Vec::new();
    for scene in subfolders(root)? {
        let Some(world) = scene.strip_prefix("Scene").and(super::normalized_world(&scene)) else {
            continue;
        };
        for variation in subfolders(&root.join(&scene))? {
            let id = SequenceId { world: world.clone(), variation };
            if label_file(root, &id).is_file() {
                found.push(id);
            }
        }
    }
    found.sort();
    Ok(found)
}

/// The file with a sequence's boxes.
pub(super) fn label_file(root: &Path, sequence: &SequenceId) -> PathBuf {
    folder(root, sequence).join("bbox.txt")
}

/// The colours of the sequence's class images.
pub(super) fn colors(root: &Path, id: &SequenceId) -> Result<Vec<SegmentColor>, DatasetError> {
    super::colors::read(&folder(root, id).join("colors.txt"))
}

/// One frame for every row of the extrinsics of one of the two cameras.
pub(super) fn read(
    root: &Path,
    sequence: &SequenceId,
    camera: u32,
) -> Result<SequenceFrames, DatasetError> {
    let folder = folder(root, sequence);
    let mut drafts = Drafts::default();
    let extrinsic = folder.join("extrinsic.txt");
    let poses = vkitti::extrinsics(&extrinsic, EXTRINSIC, Some(camera), &mut drafts.problems)?;
    if poses.is_empty() {
        return Err(DatasetError::NoCamera { path: extrinsic, camera });
    }
    let intrinsic = folder.join("intrinsic.txt");
    let cameras = cameras(&intrinsic, camera, &mut drafts.problems)?;
    let archives = Archives::new(root, &folder, sequence, camera);
    for (index, pose) in poses {
        let Some(camera) = cameras.get(&index) else {
            let fault = Fault::NoPartner { file: "intrinsic.txt", track: None };
            drafts.problems.push(Problem::of_file(&extrinsic, Some(index), fault));
            continue;
        };
        let draft = drafts.frame(index, || archives.frame(sequence, index, *camera));
        draft.frame.world_from_camera = Some(pose);
    }
    let tracks = tracks(&folder.join("info.txt"), &mut drafts.problems)?;
    let cuboids = cuboids(&folder.join("pose.txt"), camera, &mut drafts.problems)?;
    let bbox = folder.join("bbox.txt");
    let text = files::read_text(&bbox)?;
    for row in table::rows(&bbox, &text, BBOX, &mut drafts.problems)? {
        if drafts.problems.keep(row.integer(1, u32::MAX)) != Some(camera) {
            continue;
        }
        let parsed = vehicle(&row, &tracks, &cuboids);
        let Some((index, vehicle)) = drafts.problems.keep(parsed) else { continue };
        let Some(camera) = cameras.get(&index) else {
            let fault = Fault::NoPartner { file: "intrinsic.txt", track: None };
            drafts.problems.push(row.problem(fault));
            continue;
        };
        drafts.add(&row, index, vehicle, || archives.frame(sequence, index, *camera));
    }
    Ok(drafts.finish())
}

fn folder(root: &Path, sequence: &SequenceId) -> PathBuf {
    let number: u32 = sequence.world.parse().unwrap_or_default();
    root.join(format!("Scene{number:02}")).join(&sequence.variation)
}

fn subfolders(path: &Path) -> Result<Vec<String>, DatasetError> {
    let failed = |source| FileError::read(path, source);
    let mut names = Vec::new();
    for entry in fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if entry.path().is_dir() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    Ok(names)
}

fn cameras(
    path: &Path,
    camera: u32,
    problems: &mut Problems,
) -> Result<BTreeMap<u32, Camera>, DatasetError> {
    const MAX: f64 = 1e5;
    let text = files::read_text(path)?;
    let mut found = BTreeMap::new();
    for row in table::rows(path, &text, INTRINSIC, problems)? {
        if problems.keep(row.integer(1, u32::MAX)) != Some(camera) {
            continue;
        }
        let parsed = (|| {
            let focal = [row.number_in(2, 1.0, MAX)?, row.number_in(3, 1.0, MAX)?];
            let principal_point = [row.number_in(4, -MAX, MAX)?, row.number_in(5, -MAX, MAX)?];
            Ok((row.integer(0, MAX_FRAME)?, Camera { focal, principal_point, size: SIZE }))
        })();
        found.extend(problems.keep(parsed));
    }
    Ok(found)
}

/// What `info.txt` says of a track.
struct Track {
    category: &'static str,
    model: String,
    color: String,
}

fn tracks(path: &Path, problems: &mut Problems) -> Result<BTreeMap<u32, Track>, DatasetError> {
    let text = files::read_text(path)?;
    let mut found = BTreeMap::new();
    for row in table::rows(path, &text, INFO, problems)? {
        let parsed = (|| {
            let category = row.word(1, &["Car", "Van", "Truck"], "Car, Van, Truck")?;
            let (model, color) = (row.text(2).to_owned(), row.text(3).to_owned());
            Ok((row.integer(0, u32::MAX)?, Track { category, model, color }))
        })();
        found.extend(problems.keep(parsed));
    }
    Ok(found)
}

/// The cuboids by frame and track.
fn cuboids(
    path: &Path,
    camera: u32,
    problems: &mut Problems,
) -> Result<BTreeMap<(u32, u32), Cuboid>, DatasetError> {
    let text = files::read_text(path)?;
    let mut found: BTreeMap<(u32, u32), (Cuboid, usize)> = BTreeMap::new();
    for row in table::rows(path, &text, POSE, problems)? {
        if problems.keep(row.integer(1, u32::MAX)) != Some(camera) {
            continue;
        }
        let parsed = (|| {
            let key = (row.integer(0, MAX_FRAME)?, row.integer(2, u32::MAX)?);
            Ok((key, vkitti::cuboid(&row, &CUBOID)?))
        })();
        let Some((key, cuboid)) = problems.keep(parsed) else { continue };
        if let Some((_, first_line)) = found.get(&key) {
            let fault = Fault::DuplicateTrack { track: key.1, first_line: *first_line };
            problems.push(row.problem(fault));
            continue;
        }
        found.insert(key, (cuboid, row.line));
    }
    Ok(found.into_iter().map(|(key, (cuboid, _))| (key, cuboid)).collect())
}

/// Frame and label of a row of `bbox.txt`.
fn vehicle(
    row: &Row,
    tracks: &BTreeMap<u32, Track>,
    cuboids: &BTreeMap<(u32, u32), Cuboid>,
) -> Result<(u32, VehicleLabel), Problem> {
    let (index, track) = (row.integer(0, MAX_FRAME)?, row.integer(2, u32::MAX)?);
    let missing = |file| row.problem(Fault::NoPartner { file, track: Some(track) });
    let (left, right) = row.ordered(3, 4)?;
    let (top, bottom) = row.ordered(5, 6)?;
    collect::inside_image(row, [left, top, right, bottom], SIZE)?;
    row.integer(7, SIZE[0] * SIZE[1])?;
    let truncation = row.number_in(8, 0.0, 1.0)?;
    let occupancy = row.number_in(9, 0.0, 1.0)?;
    row.word(10, &["True", "False"], "True, False")?;
    let info = tracks.get(&track).ok_or_else(|| missing("info.txt"))?;
    let cuboid = *cuboids.get(&(index, track)).ok_or_else(|| missing("pose.txt"))?;
    collect::in_front(row, &cuboid)?;
    let truncated = u8::from(truncation > 0.0) + u8::from(truncation > HEAVY_TRUNCATION);
    let occluded = u8::from(occupancy < NO_OCCLUSION) + u8::from(occupancy < HEAVY_OCCLUSION);
    let dont_care = truncated == 2
        || occluded == 2
        || bottom - top < MIN_HEIGHT
        // As in 1.3.1, where everything but cars is labelled `DontCare`.
        || info.category != "Car";
    let vehicle = VehicleLabel {
        track: Some(track),
        category: info.category.to_owned(),
        dont_care,
        truncated,
        occluded,
        truncation,
        occupancy: Some(occupancy),
        bounds: Rect::from_inclusive(left, top, right, bottom),
        cuboid,
        model: Some(info.model.clone()),
        color: Some(info.color.clone()),
    };
    Ok((index, vehicle))
}

/// Folders of a sequence that exist, with the stem of their files.
struct Archives {
    rgb: Option<PathBuf>,
    depth: Option<PathBuf>,
    classes: Option<PathBuf>,
    instances: Option<PathBuf>,
    parts: Option<PathBuf>,
}

impl Archives {
    fn new(root: &Path, folder: &Path, sequence: &SequenceId, camera: u32) -> Self {
        let existing = |path: PathBuf| path.is_dir().then_some(path);
        let frames = |name: &str| {
            existing(folder.join("frames").join(name).join(format!("Camera_{camera}")))
        };
        let parts = root.join("parts").join(&sequence.world).join(&sequence.variation);
        Self {
            rgb: frames("rgb"),
            depth: frames("depth"),
            classes: frames("classSegmentation"),
            instances: frames("instanceSegmentation"),
            // Not part of the release; masks for its first camera may be put there as for 1.3.1.
            parts: existing(parts).filter(|_| camera == 0),
        }
    }

    fn frame(&self, sequence: &SequenceId, index: u32, camera: Camera) -> Frame {
        let file = |folder: &Option<PathBuf>, stem: &str, ending: &str| {
            let path = folder.as_ref()?.join(format!("{stem}{index:05}.{ending}"));
            path.is_file().then_some(path)
        };
        let mut frame = Frame::new(sequence.clone(), index, camera);
        frame.image = file(&self.rgb, "rgb_", "jpg");
        frame.depth = file(&self.depth, "depth_", "png");
        frame.classes = file(&self.classes, "classgt_", "png");
        frame.instances = file(&self.instances, "instancegt_", "png");
        frame.parts = file(&self.parts, "", "png");
        frame
    }
}
