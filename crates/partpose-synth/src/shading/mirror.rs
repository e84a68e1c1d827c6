//! Wet roads that mirror what stands on them.
//!
//! From every wet pixel of the ground the mirrored ray is followed through the picture's own depths until it passes
//! behind something; what is seen there takes the place of the surroundings that the surface mirrored at first
//! (`McGuire` and Mara: *Efficient GPU Screen-Space Ray Tracing*, JCGT 2014, without its thickness of surfaces). What the
//! picture does not show cannot be mirrored.

use nalgebra::{Matrix3, Vector3};
use partpose::geometry::Camera;
use rayon::prelude::*;

use super::raster::Visibility;
use super::surface::Lighting;

type V = Vector3<f32>;

/// Steps along a ray; they grow with the distance.
const STEPS: usize = 28;

/// Exchanges, in `color`, the mirrored surroundings of wet pixels by what stands behind them.
///
/// `water`: how much of each pixel mirrors, `None` for what is no ground; of blocks of `step` x `step` pixels the first
/// counts for all.
pub(super) fn add(
    camera: &Camera,
    lighting: &Lighting,
    visibility: &Visibility,
    (step, water): (usize, &[Option<f32>]),
    color: &mut [[f32; 3]],
) {
    let width = camera.size[0] as usize;
    let old = color.to_vec();
    let view = View {
        camera_from_world: lighting.world_from_camera.transpose(),
        size: camera.size.map(|side| side as f32),
        focal: camera.focal.map(|f| f as f32),
        center: camera.principal_point.map(|c| c as f32),
        visibility,
    };
    let change = |i: usize| {
        let share = water[i].filter(|share| *share > 0.0)?;
        let inverse_depth = view.inverse_depth(i % width, i / width);
        let ray = view.ray((i % width) as f32, (i / width) as f32);
        let from = ray / inverse_depth;
        let to_eye = lighting.world_from_camera * -ray.normalize();
        let cos = (-to_eye.y).clamp(0.02, 1.0);
        let share = share * (0.02 + 0.98 * (1.0 - cos).powi(5));
        let mirrored = V::new(-to_eye.x, to_eye.y, -to_eye.z);
        let hit = view.follow(&from, &(view.camera_from_world * mirrored))?;
        let instead = lighting.environment.reflected(&mirrored, 0.08);
        Some((view.softened(&old, hit) - instead) * share)
    };
    color.par_chunks_mut((width * step).max(1)).enumerate().for_each(|(block, rows)| {
        let start = block * step * width;
        for x in (0..width).step_by(step) {
            let Some(change) = change(start + x) else { continue };
            for row in (0..rows.len()).step_by(width) {
                for i in row + x..row + (x + step).min(width) {
                    if water[start + i].is_some() {
                        for (value, change) in rows[i].iter_mut().zip(change.iter()) {
                            *value = (*value + change).max(0.0);
                        }
                    }
                }
            }
        }
    });
}

struct View<'a> {
    camera_from_world: Matrix3<f32>,
    size: [f32; 2],
    focal: [f32; 2],
    center: [f32; 2],
    visibility: &'a Visibility,
}

impl View<'_> {
    /// At a pixel's centre.
    fn inverse_depth(&self, x: usize, y: usize) -> f32 {
        let v = self.visibility;
        v.inverse_depths[(y * v.size[0] + x) * v.rate]
    }

    fn ray(&self, x: f32, y: f32) -> V {
        V::new((x - self.center[0]) / self.focal[0], (y - self.center[1]) / self.focal[1], 1.0)
    }

    /// The mean round a pixel: water is never quite still.
    fn softened(&self, color: &[[f32; 3]], at: usize) -> V {
        let width = self.size[0] as usize;
        let places =
            [at, at + 2, at.saturating_sub(2), at + 2 * width, at.saturating_sub(3 * width)];
        let mut sum = V::zeros();
        for place in places {
            sum += V::from(color[place.min(color.len() - 1)]).map(|value| value.min(6.0));
        }
        sum * 0.2
    }

    /// The pixel at which a ray passes behind what is seen.
    fn follow(&self, from: &V, direction: &V) -> Option<usize> {
        let mut length = 0.012 * from.z + 0.05;
        let mut reach = 0.0;
        for _ in 0..STEPS {
            reach += length;
            length *= 1.16;
            let p = from + direction * reach;
            if p.z < 0.1 {
                return None;
            }
            let x = self.focal[0] * p.x / p.z + self.center[0] + 0.5;
            let y = self.focal[1] * p.y / p.z + self.center[1] + 0.5;
            if !(x >= 0.0 && y >= 0.0 && x < self.size[0] && y < self.size[1]) {
                return None;
            }
            let [x, y] = [x as usize, y as usize];
            let seen = self.inverse_depth(x, y);
            if seen <= 0.0 {
                continue;
            }
            let behind = p.z - 1.0 / seen;
            if behind > 0.0 {
                // Far behind means that the ray passes there unseen.
                return (behind < 2.5 * length + 0.3).then_some(y * self.size[0] as usize + x);
            }
        }
        None
    }
}
