//! What of a surface can be seen from outside, and which way is out.
//!
//! Foreign meshes have seats and engines, open edges and faces that are turned the wrong way. The mesh is drawn from
//! all around; a point is seen where nothing lies nearer, and its normal is turned to those who see it.

use nalgebra::{Rotation3, Translation3, UnitQuaternion};

use crate::geometry::{Camera, Point3, Pose, Vector3};
use crate::parts::PartClass;
use crate::render::{Instance, LabelRenderer, RenderOptions};
use crate::vehicle::Mesh;

/// From where a point can be seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Seen {
    /// From nowhere.
    Hidden,
    /// Only from below the horizon, as no camera on a road does.
    FromBelow,
    /// From the horizon or above.
    FromAbove,
}

/// A point of a surface with the side that was seen more.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    pub(super) seen: Seen,
    /// -1 where the normal has to be turned to point outwards.
    pub(super) turn: f64,
}

/// Sides of the pictures, pixels.
const SIDE: u32 = 480;
/// Views around the vehicle at each elevation.
const AROUND: u32 = 10;
/// Degrees above the horizon.
const ELEVATIONS: [f64; 4] = [-35.0, 2.0, 22.0, 50.0];
/// Distance of the cameras in diagonals: far, so that the pictures show little perspective.
const DISTANCE: f64 = 5.0;
/// Depth by which a point may lie behind what was drawn, metres.
const TOLERANCE: f64 = 0.01;

/// How points of a mesh are seen; `points` come with a unit normal each.
pub(super) fn sights(
    vertices: &[Point3],
    faces: &[[u32; 3]],
    points: &[(Point3, Vector3)],
) -> Vec<Sight> {
    let unseen = Sight { seen: Seen::Hidden, turn: 0.0 };
    let mut sights = vec![unseen; points.len()];
    let parts = vec![PartClass::Hood; faces.len()];
    let mesh = Mesh { vertices: vertices.to_vec(), faces: faces.to_vec(), parts };
    let Some((low, high)) = mesh.bounds() else { return sights };
    let (middle, diagonal) = (nalgebra::center(&low, &high), (high - low).norm().max(1e-6));
    // The diagonal fills the picture.
    let focal = DISTANCE * f64::from(SIDE) * 0.98;
    let center = 0.5 * (f64::from(SIDE) - 1.0);
    let camera = Camera::pinhole(focal, [center, center], [SIDE, SIDE]);
    let mut renderer = LabelRenderer::default();
    for (rotation, is_above) in views() {
        let offset = Vector3::new(0.0, 0.0, DISTANCE * diagonal) - rotation * middle.coords;
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
        let camera_from_vehicle = Pose::from_parts(Translation3::from(offset), rotation);
        let scale = Vector3::repeat(1.0);
        let instance = Instance { mesh: &mesh, scale, camera_from_vehicle, id: 1 };
        let image = renderer.render(&camera, &[instance], &RenderOptions::default());
        let step = diagonal / f64::from(SIDE);
        for ((point, normal), sight) in points.iter().zip(&mut sights) {
            let point = camera_from_vehicle * point;
            let normal = camera_from_vehicle * normal;
            let Some(pixel) = camera.project(&point) else { continue };
            let [x, y] = [pixel.x, pixel.y].map(|v| v.round().clamp(0.0, f64::from(SIDE - 1)));
            let depth = f64::from(image.depths[y as usize * SIDE as usize + x as usize]);
            let facing = -normal.dot(&point.coords.normalize());
            // Within a pixel a steep surface runs through many depths.
            let slope = (1.0 / facing.abs().max(0.2)).min(4.0);
            if !depth.is_finite() || point.z > depth + TOLERANCE + 0.5 * step * slope {
                continue;
            }
            sight.turn += facing;
            sight.seen = sight.seen.max(if is_above { Seen::FromAbove } else { Seen::FromBelow });
        }
    }
    for sight in &mut sights {
        sight.turn = if sight.turn < 0.0 { -1.0 } else { 1.0 };
    }
    sights
}

/// Rotations of the camera from the vehicle, and whether it stands above the horizon.
fn views() -> Vec<(Rotation3<f64>, bool)> {
    let upright = |elevation: f64, turn: f64| {
        Rotation3::from_axis_angle(&Vector3::x_axis(), elevation.to_radians())
            * Rotation3::from_axis_angle(&Vector3::y_axis(), turn)
    };
    let mut views = vec![(upright(90.0, 0.0), true), (upright(-90.0, 0.0), false)];
    for elevation in ELEVATIONS {
        for i in 0..AROUND {
            let turn = std::f64::consts::TAU * (f64::from(i) + 0.1) / f64::from(AROUND);
            views.push((upright(elevation, turn), elevation > 0.0));
        }
    }
    views
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_in_a_box_is_hidden_and_its_floor_is_seen_from_below() {
        let (vertices, faces) = cube(1.0);
        let (inner, _) = cube(0.5);
        let mut all = vertices.clone();
        all.extend(inner);
        let mut both = faces.clone();
        // The inner box is inside out on top of it.
        both.extend(faces.iter().map(|f| [f[0] + 8, f[2] + 8, f[1] + 8]));
        let up = Vector3::new(0.0, -1.0, 0.0);
        let points = [
            (Point3::new(0.1, -0.5, 0.2), up),
            (Point3::new(0.1, -0.5, 0.2), -up),
            (Point3::new(0.1, 0.5, 0.2), -up),
            (Point3::new(0.1, -0.25, 0.2), up),
        ];
        let sights = sights(&all, &both, &points);
        assert_eq!((sights[0].seen, sights[0].turn), (Seen::FromAbove, 1.0));
        assert_eq!((sights[1].seen, sights[1].turn), (Seen::FromAbove, -1.0));
        assert_eq!((sights[2].seen, sights[2].turn), (Seen::FromBelow, 1.0));
        assert_eq!(sights[3].seen, Seen::Hidden);
    }

    fn cube(side: f64) -> (Vec<Point3>, Vec<[u32; 3]>) {
        let corner = |i: u32, bit: u32| if i >> bit & 1 == 1 { 0.5 * side } else { -0.5 * side };
        let vertices = (0..8).map(|i| Point3::new(corner(i, 0), corner(i, 1), corner(i, 2)));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let split = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
        (vertices.collect(), quads.into_iter().flat_map(split).collect())
    }
}
