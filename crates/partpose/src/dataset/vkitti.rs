//! What both releases of Virtual KITTI write alike: camera poses, and cuboids with three angles.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use nalgebra::{Matrix3, Translation3, UnitQuaternion};

use crate::files;
use crate::geometry::{Cuboid, EulerAngles, Extent, Pose, Rotation3, Vector3};
use crate::vehicle::{MAX_SIDE, MIN_SIDE};

use super::DatasetError;
use super::problem::{Fault, Problem, Problems};
use super::table::{self, MAX_FRAME, Row};

/// How far an extrinsic matrix may be from a rotation; the published ones miss by 6e-7.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Largest distance along an axis, metres.
pub(super) const MAX_POSITION: f64 = 1e4;
/// Largest angle; files stay within a turn.
pub(super) const MAX_ANGLE: f64 = 7.0;

/// Where the columns of a cuboid are.
pub(super) struct CuboidColumns {
    /// Width, height, length.
    pub(super) extent: [usize; 3],
    /// Camera-space x, y, z of the bottom face's centre.
    pub(super) position: [usize; 3],
    /// Camera-space rotation about y, x, z.
    pub(super) angles: [usize; 3],
}

/// The cuboid of a row: `R_y(ry + 90°) R_x(rx) R_z(rz)`, since `ry = 0` faces right and our vehicles face along z.
pub(super) fn cuboid(row: &Row, columns: &CuboidColumns) -> Result<Cuboid, Problem> {
    let mut extent = [0.0; 3];
    let mut position = [0.0; 3];
    let mut angles = [0.0; 3];
    for i in 0..3 {
        extent[i] = row.number_in(columns.extent[i], MIN_SIDE, MAX_SIDE)?;
        position[i] = row.number_in(columns.position[i], -MAX_POSITION, MAX_POSITION)?;
        angles[i] = row.number_in(columns.angles[i], -MAX_ANGLE, MAX_ANGLE)?;
    }
    let angles = EulerAngles { x: angles[1], y: angles[0] + FRAC_PI_2, z: angles[2] };
    Ok(Cuboid {
        camera_from_vehicle: Pose::from_parts(
            Vector3::from(position).into(),
            UnitQuaternion::from_rotation_matrix(&angles.to_rotation()),
        ),
        extent: Extent::new(extent[0], extent[1], extent[2]),
    })
}

/// The poses `world_from_camera` of a file of world-to-camera matrices, by frame; of `camera` only, where the second
/// column names one.
pub(super) fn extrinsics(
    path: &Path,
    columns: &'static [&'static str],
    camera: Option<u32>,
    problems: &mut Problems,
) -> Result<BTreeMap<u32, Pose>, DatasetError> {
    let text = files::read_text(path)?;
    let first = columns.len() - 16;
    let mut found: BTreeMap<u32, (Pose, usize)> = BTreeMap::new();
    for row in table::rows(path, &text, columns, problems)? {
        if camera.is_some() && problems.keep(row.integer(1, u32::MAX)) != camera {
            continue;
        }
        let parsed = row.integer(0, MAX_FRAME).and_then(|index| Ok((index, pose(&row, first)?)));
        let Some((index, pose)) = problems.keep(parsed) else { continue };
        if let Some((_, first_line)) = found.get(&index) {
            problems.push(row.problem(Fault::DuplicateFrame { first_line: *first_line }));
            continue;
        }
        found.insert(index, (pose.inverse(), row.line));
    }
    Ok(found.into_iter().map(|(index, (pose, _))| (index, pose)).collect())
}

/// The matrix whose 16 entries, row by row, start at a column.
fn pose(row: &Row, first: usize) -> Result<Pose, Problem> {
    let mut m = [[0.0; 4]; 4];
    for (i, entry) in m.as_flattened_mut().iter_mut().enumerate() {
        *entry = row.number(first + i)?;
    }
    let rotation = Matrix3::from_fn(|r, c| m[r][c]);
    let mut deviation = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    if rotation.determinant() < 0.0 {
        deviation = deviation.max(2.0);
    }
    for (entry, expected) in m[3].iter().zip([0.0, 0.0, 0.0, 1.0]) {
        deviation = deviation.max((entry - expected).abs());
    }
    if deviation > ROTATION_TOLERANCE {
        return Err(row.problem(Fault::NotARotation { deviation }));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&rotation));
    Ok(Pose::from_parts(Translation3::new(m[0][3], m[1][3], m[2][3]), rotation))
}
