//! Virtual KITTI 1.3.1 (Gaidon, Wang, Cabon, Vig: *Virtual Worlds as Proxy for Multi-Object Tracking Analysis*, CVPR 2016).
//!
//! Only the archive `motgt` is needed. Frames come from `extrinsicsgt` where that is present (every frame has a row
//! there), else from `motgt`, where frames without vehicles have none. RGB, depth, segmentation and part masks are
//! named where they exist and never opened here.

use std::fs;
use std::path::{Path, PathBuf};

use crate::files::{self, FileError};
use crate::geometry::{Camera, Rect};

use super::collect::{self, Drafts, VKITTI_CAMERA};
use super::colors::SegmentColor;
use super::problem::{Fault, Problem};
use super::table::{self, MAX_FRAME, Row};
use super::vkitti::{self, CuboidColumns};
use super::{DatasetError, Frame, SequenceFrames, SequenceId, VehicleLabel};

pub(super) const MOTGT: &str = "vkitti_1.3.1_motgt";
pub(super) const EXTRINSICS: &str = "vkitti_1.3.1_extrinsicsgt";
pub(super) const RGB: &str = "vkitti_1.3.1_rgb";
pub(super) const DEPTH: &str = "vkitti_1.3.1_depthgt";
pub(super) const SCENE: &str = "vkitti_1.3.1_scenegt";
pub(super) const PARTS: &str = "parts";
/// Name of the file that describes the camera of a data set in this layout where it is not Virtual KITTI's.
pub const CAMERA_FILE: &str = "camera.json";

const MOTGT_COLUMNS: &[&str] = &[
    "frame",
    "tid",
    "label",
    "truncated",
    "occluded",
    "alpha",
    "l",
    "t",
    "r",
    "b",
    "w3d",
    "h3d",
    "l3d",
    "x3d",
    "y3d",
    "z3d",
    "ry",
    "rx",
    "rz",
    "truncr",
    "occupr",
    "orig_label",
    "moving",
    "model",
    "color",
];
/// The published header ends in `0 0.1 0.2 1` or `0 0 0 1`: columns without a name.
const EXTRINSICS_COLUMNS: &[&str] = &[
    "frame", "r1,1", "r1,2", "r1,3", "t1", "r2,1", "r2,2", "r2,3", "t2", "r3,1", "r3,2", "r3,3",
    "t3", "", "", "", "",
];
const CUBOID: CuboidColumns =
    CuboidColumns { extent: [10, 11, 12], position: [13, 14, 15], angles: [16, 17, 18] };

/// The sequences that have ground truth, sorted; none if the folder has another layout.
pub(super) fn sequences(root: &Path) -> Result<Vec<SequenceId>, DatasetError> {
    let folder = root.join(MOTGT);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut found = Vec::new();
    for entry in fs::read_dir(&folder).map_err(|source| FileError::read(&folder, source))? {
        let name = entry.map_err(|source| FileError::read(&folder, source))?.file_name();
        let name = name.to_string_lossy();
        if let Some((world, variation)) =
            name.strip_suffix(".txt").and_then(|stem| stem.split_once('_'))
        {
            found.push(SequenceId { world: world.to_owned(), variation: variation.to_owned() });
        }
    }
    found.sort();
    Ok(found)
}

/// The file with a sequence's labels.
pub(super) fn label_file(root: &Path, sequence: &SequenceId) -> PathBuf {
    root.join(MOTGT).join(format!("{}_{}.txt", sequence.world, sequence.variation))
}

/// One frame for every row of the extrinsics, or for every frame with vehicles where there are none.
pub(super) fn read(root: &Path, sequence: &SequenceId) -> Result<SequenceFrames, DatasetError> {
    let archives = Archives::new(root, sequence)?;
    let mut drafts = Drafts::default();
    let motgt = label_file(root, sequence);
    let extrinsics =
        root.join(EXTRINSICS).join(motgt.file_name().expect("a label file has a name"));
    if extrinsics.is_file() {
        let poses =
            vkitti::extrinsics(&extrinsics, EXTRINSICS_COLUMNS, None, &mut drafts.problems)?;
        for (index, pose) in poses {
            let draft = drafts.frame(index, || archives.frame(sequence, index));
            draft.frame.world_from_camera = Some(pose);
        }
    }
    let text = files::read_text(&motgt)?;
    for row in table::rows(&motgt, &text, MOTGT_COLUMNS, &mut drafts.problems)? {
        let parsed = vehicle(&row, archives.camera.size);
        if let Some((index, vehicle)) = drafts.problems.keep(parsed) {
            drafts.add(&row, index, vehicle, || archives.frame(sequence, index));
        }
    }
    Ok(drafts.finish())
}

/// The colours of the sequence's `scenegt` images.
pub(super) fn colors(root: &Path, id: &SequenceId) -> Result<Vec<SegmentColor>, DatasetError> {
    let name = format!("{}_{}_scenegt_rgb_encoding.txt", id.world, id.variation);
    super::colors::read(&root.join(SCENE).join(name))
}

/// Folders of a sequence that exist; what is absent costs nothing per frame.
struct Archives {
    camera: Camera,
    rgb: Option<PathBuf>,
    parts: Option<PathBuf>,
    depth: Option<PathBuf>,
    scene: Option<PathBuf>,
}

impl Archives {
    fn new(root: &Path, sequence: &SequenceId) -> Result<Self, DatasetError> {
        let folder = |name: &str| {
            let path = root.join(name).join(&sequence.world).join(&sequence.variation);
            path.is_dir().then_some(path)
        };
        Ok(Self {
            camera: camera(root)?,
            rgb: folder(RGB),
            parts: folder(PARTS),
            depth: folder(DEPTH),
            scene: folder(SCENE),
        })
    }

    fn frame(&self, sequence: &SequenceId, index: u32) -> Frame {
        let file = |folder: &Option<PathBuf>| {
            let path = folder.as_ref()?.join(format!("{index:05}.png"));
            path.is_file().then_some(path)
        };
        let mut frame = Frame::new(sequence.clone(), index, self.camera);
        frame.image = file(&self.rgb);
        frame.parts = file(&self.parts);
        frame.depth = file(&self.depth);
        frame.classes = file(&self.scene);
        frame.instances.clone_from(&frame.classes);
        frame
    }
}

/// The camera of a data set: Virtual KITTI's, unless a file names another.
fn camera(root: &Path) -> Result<Camera, DatasetError> {
    let path = root.join(CAMERA_FILE);
    if !path.is_file() {
        return Ok(VKITTI_CAMERA);
    }
    let failed = |reason: String| Problem::of_file(&path, None, Fault::Unreadable { reason });
    let camera: Camera = serde_json::from_slice(&files::read(&path)?)
        .map_err(|error| failed(format!("no camera can be read from it: {error}")))?;
    let sizes = camera.size.iter().all(|side| (1..=files::MAX_IMAGE_SIDE).contains(side));
    let focal = camera.focal.iter().all(|focal| (1.0..=1e6).contains(focal));
    let center = camera.principal_point.iter().all(|center| center.abs() <= 1e6);
    if sizes && focal && center {
        return Ok(camera);
    }
    Err(failed("its camera has an impossible size, focal length or principal point".to_owned())
        .into())
}

/// Frame and label of a row of `motgt`.
fn vehicle(row: &Row, size: [u32; 2]) -> Result<(u32, VehicleLabel), Problem> {
    const CATEGORIES: &[&str] = &["Car", "Van", "Truck"];
    const LABELS: &[&str] = &["Car", "Van", "Truck", "DontCare"];
    let index = row.integer(0, MAX_FRAME)?;
    let label = row.word(2, LABELS, "Car, Van, Truck, DontCare")?;
    let category = row.word(21, CATEGORIES, "Car, Van, Truck")?;
    row.number_in(5, -vkitti::MAX_ANGLE, vkitti::MAX_ANGLE)?;
    row.integer(22, 1)?;
    let (left, right) = row.ordered(6, 8)?;
    let (top, bottom) = row.ordered(7, 9)?;
    collect::inside_image(row, [left, top, right, bottom], size)?;
    let cuboid = vkitti::cuboid(row, &CUBOID)?;
    collect::in_front(row, &cuboid)?;
    let vehicle = VehicleLabel {
        track: Some(row.integer(1, u32::MAX)?),
        category: category.to_owned(),
        dont_care: label == "DontCare",
        truncated: row.integer(3, 2)? as u8,
        occluded: row.integer(4, 2)? as u8,
        truncation: row.number_in(19, 0.0, 1.0)?,
        occupancy: Some(row.number_in(20, 0.0, 1.0)?),
        bounds: Rect::from_inclusive(left, top, right, bottom),
        cuboid,
        model: Some(row.text(23).to_owned()),
        color: Some(row.text(24).to_owned()),
    };
    Ok((index, vehicle))
}
