//! Where masks have the outline of a vehicle: not quite where its model has.
//!
//! A mask may be eroded, shifted or cut by whoever made it, network or renderer, by a part of a pixel that is the same
//! near and far; a model that was made from masks has swallowed what that part of a pixel was at the distance of its
//! own views. The difference, `offset + per_distance / z` on each side, is measured on pictures with known poses and
//! given to the fit; at 40 m a pixel of height is 3 % of the distance.

use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

use crate::geometry::{Camera, Cuboid, Vector3};

/// How far the outline of a mask lies outside the drawn model's, in pixels: `offset + per_distance / z`, z the distance
/// of the vehicle's centre in metres. Sides are left, top, right, bottom; negative where the mask is smaller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MaskBias {
    /// Pixels.
    pub offset: [f64; 4],
    /// Pixels times metres.
    pub per_distance: [f64; 4],
}

impl MaskBias {
    /// The four sides at a distance, pixels; nearer than 10 m as at 10 m, since there is little to measure it on.
    pub fn at(&self, z: f64) -> [f64; 4] {
        let z = z.max(NEAREST);
        std::array::from_fn(|side| self.offset[side] + self.per_distance[side] / z)
    }

    /// The constant part alone: what a model that was carved with it leaves.
    #[must_use]
    pub fn without_distance(&self) -> Self {
        Self { offset: self.offset, per_distance: [0.0; 4] }
    }

    /// The camera that sees a vehicle's outline where masks have it: `camera`, stretched about the middle of the cuboid's
    /// picture and shifted.
    pub fn camera(&self, camera: &Camera, cuboid: &Cuboid) -> Camera {
        let rotation = cuboid.camera_from_vehicle.rotation.to_rotation_matrix();
        let half = cuboid.extent.to_vector() * 0.5;
        let arms = rotation.matrix() * Matrix3::from_diagonal(&half);
        self.stretched(camera, &cuboid.center().coords, &arms, [1.0; 2])
    }

    /// The same for a centre and half-axes (columns) in the camera frame, and a camera whose pixels are samples, so many
    /// a pixel of the image.
    pub(super) fn stretched(
        &self,
        camera: &Camera,
        center: &Vector3,
        arms: &Matrix3<f64>,
        per_pixel: [f64; 2],
    ) -> Camera {
        let sides = self.at(center.z);
        let mut moved = *camera;
        for axis in 0..2 {
            let (low, high) = (sides[axis], sides[axis + 2]);
            let ray = center[axis] / center.z;
            let middle = camera.focal[axis] * ray + camera.principal_point[axis];
            // Half the width of the cuboid: how far its three half-axes reach, seen from far away.
            let reach: f64 = (0..3).map(|i| (arms[(axis, i)] - ray * arms[(2, i)]).abs()).sum();
            let half = FILLED * reach * camera.focal[axis] / center.z;
            let stretch = 1.0 + 0.5 * (low + high) * per_pixel[axis] / half.max(1e-6);
            let stretch = stretch.clamp(0.5, 1.5);
            let constant = (1.0 - stretch) * middle + 0.5 * (high - low) * per_pixel[axis];
            if !constant.is_finite() {
                return *camera;
            }
            moved.focal[axis] *= stretch;
            moved.principal_point[axis] = stretch * camera.principal_point[axis] + constant;
        }
        moved
    }
}

/// Distance below which nothing is extrapolated, metres.
const NEAREST: f64 = 10.0;
/// Share of its cuboid's projected width that a vehicle's outline fills, about.
const FILLED: f64 = 0.93;

/// The samples that a box is drawn on.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleGrid {
    /// The camera whose pixels are the samples.
    pub(super) camera: Camera,
    /// Samples a pixel of the image, across and down.
    pub(super) per_pixel: [f64; 2],
    pub(super) bias: Option<MaskBias>,
}
