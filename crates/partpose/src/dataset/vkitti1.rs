//! Virtual KITTI 1.3.1 (Gaidon, Wang, Cabon, Vig: *Virtual Worlds as Proxy for Multi-Object Tracking Analysis*, CVPR 2016).

use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Translation3, UnitQuaternion};

use crate::files::{self, FileError};
use crate::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Rect, Rotation3, Vector3};

use super::{DatasetError, Frame, SequenceId, VehicleLabel};

/// The one camera of all worlds.
const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
const MOTGT: &str = "vkitti_1.3.1_motgt";
const EXTRINSICS: &str = "vkitti_1.3.1_extrinsicsgt";
const RGB: &str = "vkitti_1.3.1_rgb";

/// The sequences that have ground truth, sorted; none if the folder has another layout.
pub(super) fn sequences(root: &Path) -> Result<Vec<SequenceId>, DatasetError> {
    let folder = root.join(MOTGT);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let mut found = Vec::new();
    for entry in fs::read_dir(&folder).map_err(|source| FileError::io(&folder, source))? {
        let name = entry.map_err(|source| FileError::io(&folder, source))?.file_name();
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

/// One frame for every row of the extrinsics, or for every frame with vehicles where there are none.
pub(super) fn frames(root: &Path, sequence: &SequenceId) -> Result<Vec<Frame>, DatasetError> {
    let stem = format!("{}_{}.txt", sequence.world, sequence.variation);
    let mut frames: Vec<Frame> = Vec::new();
    let extrinsics = root.join(EXTRINSICS).join(&stem);
    if extrinsics.is_file() {
        let text = files::read_text(&extrinsics)?;
        for (line, row) in rows(&extrinsics, &text, 17) {
            let row = row?;
            let numbers = row.numbers(&extrinsics, line, 0..17)?;
            let m = |r: usize, c: usize| numbers[1 + 4 * r + c];
            let rotation = Matrix3::from_fn(m);
            let camera_from_world = Pose::from_parts(
                Translation3::new(m(0, 3), m(1, 3), m(2, 3)),
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation)),
            );
            let mut frame = empty_frame(root, sequence, numbers[0] as u32);
            frame.world_from_camera = Some(camera_from_world.inverse());
            frames.push(frame);
        }
    }
    let motgt = root.join(MOTGT).join(&stem);
    let text = files::read_text(&motgt)?;
    for (line, row) in rows(&motgt, &text, 25) {
        let (index, vehicle) = parse_vehicle(&motgt, line, &row?)?;
        match frames.binary_search_by_key(&index, |frame| frame.index) {
            Ok(at) => frames[at].vehicles.push(vehicle),
            Err(at) => {
                let mut frame = empty_frame(root, sequence, index);
                frame.vehicles.push(vehicle);
                frames.insert(at, frame);
            }
        }
    }
    Ok(frames)
}

fn empty_frame(root: &Path, sequence: &SequenceId, index: u32) -> Frame {
    let file = |folder: &str| -> Option<PathBuf> {
        let path = root.join(folder).join(&sequence.world).join(&sequence.variation);
        let path = path.join(format!("{index:05}.png"));
        path.is_file().then_some(path)
    };
    Frame {
        sequence: sequence.clone(),
        index,
        camera: CAMERA,
        world_from_camera: None,
        vehicles: Vec::new(),
        image: file(RGB),
        parts: file("parts"),
    }
}

struct Row<'a>(Vec<&'a str>);

/// The lines after the header, with their number, split into `columns` fields.
fn rows<'a>(
    path: &'a Path,
    text: &'a str,
    columns: usize,
) -> impl Iterator<Item = (usize, Result<Row<'a>, DatasetError>)> {
    let lines = text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty());
    lines.map(move |(i, line)| {
        let fields: Vec<&str> = line.split_ascii_whitespace().collect();
        let row = if fields.len() == columns {
            Ok(Row(fields))
        } else {
            let reason = format!("{} columns, but {columns} are needed", fields.len());
            Err(DatasetError::Line { path: path.to_owned(), line: i + 1, reason })
        };
        (i + 1, row)
    })
}

impl Row<'_> {
    fn numbers(
        &self,
        path: &Path,
        line: usize,
        range: std::ops::Range<usize>,
    ) -> Result<Vec<f64>, DatasetError> {
        range
            .map(|i| match self.0[i].parse::<f64>() {
                Ok(value) if value.is_finite() && value.abs() < 1e6 => Ok(value),
                _ => Err(DatasetError::Line {
                    path: path.to_owned(),
                    line,
                    reason: format!("column {} is `{}`, not a sensible number", i + 1, self.0[i]),
                }),
            })
            .collect()
    }
}

fn parse_vehicle(path: &Path, line: usize, row: &Row) -> Result<(u32, VehicleLabel), DatasetError> {
    let ids = row.numbers(path, line, 0..2)?;
    let n = row.numbers(path, line, 3..21)?;
    // The angles come as ry, rx, rz; ry = 0 faces right, our vehicles face along z.
    let angles = EulerAngles { x: n[14], y: n[13] + FRAC_PI_2, z: n[15] };
    let camera_from_vehicle = Pose::from_parts(
        Vector3::new(n[10], n[11], n[12]).into(),
        UnitQuaternion::from_rotation_matrix(&angles.to_rotation()),
    );
    let vehicle = VehicleLabel {
        track: Some(ids[1] as u32),
        category: row.0[21].to_owned(),
        dont_care: row.0[2] == "DontCare",
        truncated: n[0] as u8,
        occluded: n[1] as u8,
        truncation: n[16],
        occupancy: Some(n[17]),
        bounds: Rect::from_inclusive(n[3], n[4], n[5], n[6]),
        cuboid: Cuboid { camera_from_vehicle, extent: Extent::new(n[7], n[8], n[9]) },
        model: Some(row.0[23].to_owned()),
        color: Some(row.0[24].to_owned()),
    };
    Ok((ids[0] as u32, vehicle))
}
