//! Where masks have the outline of a vehicle: not quite where its model has.
//!
//! A mask may be eroded, shifted or cut by whoever made it, network or renderer, by a part of a pixel that is the same
//! near and far; a model that was made from masks has swallowed what that part of a pixel was at the distance of its
//! own views. The difference, `offset + per_distance / z` on each side, is measured on pictures with known poses and
//! given to the fit; at 40 m a pixel of height is 3 % of the distance.

use serde::{Deserialize, Serialize};

use crate::geometry::{Camera, Vector3};

use super::raster::Projection;

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

    /// Stretches a projection about its middle and shifts it.
    pub(super) fn apply(&self, projection: &mut Projection, grid: &SampleGrid, z: f64) {
        let sides = self.at(z);
        for axis in 0..2 {
            let (low, high) = (sides[axis], sides[axis + 2]);
            let (row, depth) = (projection.matrix.row(axis), projection.matrix.row(2));
            let center = projection.offset[axis] / projection.offset[2];
            // Half the width of the cuboid: how far its three half-axes reach, seen from far away.
            let reach: f64 = (0..3).map(|i| (row[i] - center * depth[i]).abs()).sum();
            let half = FILLED * reach / projection.offset[2];
            let stretch = 0.5 * (low + high) * grid.per_pixel[axis] / half.max(1e-6);
            let stretch = (1.0 + stretch).clamp(0.5, 1.5);
            let shift = 0.5 * (high - low) * grid.per_pixel[axis];
            let constant = (1.0 - stretch) * center + shift;
            if !constant.is_finite() {
                return;
            }
            for i in 0..3 {
                projection.matrix[(axis, i)] =
                    stretch * projection.matrix[(axis, i)] + constant * projection.matrix[(2, i)];
            }
            let offset: &mut Vector3 = &mut projection.offset;
            offset[axis] = stretch * offset[axis] + constant * offset[2];
        }
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
