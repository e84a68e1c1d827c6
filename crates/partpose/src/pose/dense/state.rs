//! What is optimised: rotation, centre and size, and the nine increments that change them.

use nalgebra::{Matrix3, UnitQuaternion};

use crate::geometry::{Extent, Pose, Vector3};

use super::bias::SampleGrid;
use super::unit_mesh::Projection;

/// Increments: a rotation vector in camera axes about the centre (radians), the centre to the right and down (metres),
/// the logarithm of the distance along the viewing ray, and the logarithms of the half-extents.
pub(super) const PARAMETERS: usize = 9;

/// A vehicle's cuboid: where its centre is and half its sides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    pub(super) rotation: UnitQuaternion<f64>,
    /// Camera frame, metres.
    pub(super) center: Vector3,
    /// Metres along the vehicle's axes.
    pub(super) half: Vector3,
}

impl State {
    /// The pose of the centre of the bottom face.
    pub(super) fn pose(&self) -> Pose {
        let bottom = self.center + self.rotation * Vector3::new(0.0, self.half.y, 0.0);
        Pose::from_parts(bottom.into(), self.rotation)
    }

    pub(super) fn extent(&self) -> Extent {
        Extent::new(2.0 * self.half.x, 2.0 * self.half.y, 2.0 * self.half.z)
    }

    /// The increments applied; scaling the distance along the ray keeps the direction, which the image fixes well, apart
    /// from the distance, which it fixes badly.
    pub(super) fn updated(&self, step: &[f64; PARAMETERS]) -> Self {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(step[0], step[1], step[2]));
        let moved = self.center + Vector3::new(step[3], step[4], 0.0);
        let mut rotation = turn * self.rotation;
        rotation.renormalize();
        Self {
            rotation,
            center: moved * step[5].exp(),
            half: self.half.component_mul(&Vector3::new(
                step[6].exp(),
                step[7].exp(),
                step[8].exp(),
            )),
        }
    }

    /// The projection of half-extent units to samples, with the outline where masks have it.
    pub(super) fn projection(&self, grid: &SampleGrid) -> Projection {
        let rotation = self.rotation.to_rotation_matrix();
        let arms = rotation.matrix() * Matrix3::from_diagonal(&self.half);
        let camera = match &grid.bias {
            Some(bias) => bias.stretched(&grid.camera, &self.center, &arms, grid.per_pixel),
            None => grid.camera,
        };
        let ([fx, fy], [cx, cy]) = (camera.focal, camera.principal_point);
        let image_from_camera = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
        Projection { matrix: image_from_camera * arms, offset: image_from_camera * self.center }
    }

    /// Whether another is turned alike and at about the same place.
    pub(super) fn is_near(&self, other: &Self) -> bool {
        self.rotation.angle_to(&other.rotation) < 0.1
            && (self.center - other.center).norm() < 0.05 * self.center.norm()
    }

    /// Depth of the cuboid's nearest corner, metres.
    pub(super) fn nearest(&self) -> f64 {
        let rotation = self.rotation.to_rotation_matrix();
        let reach = (0..3).map(|i| (rotation[(2, i)] * self.half[i]).abs()).sum::<f64>();
        self.center.z - reach
    }

    /// Whether all numbers are finite and the centre lies at least a metre ahead.
    pub(super) fn is_usable(&self) -> bool {
        let finite = |v: &Vector3| v.iter().all(|value| value.is_finite() && value.abs() < 1e6);
        finite(&self.center)
            && finite(&self.half)
            && self.rotation.coords.iter().all(|value| value.is_finite())
            && self.center.z >= 1.0
            && self.half.min() > 0.01
    }
}
