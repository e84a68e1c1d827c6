//! Blur by the camera's own motion while the shutter is open.
//!
//! Each pixel is the mean along the way that its surface moves on the screen, from its depth and the two poses (Rosado:
//! *Motion Blur as a Post-Processing Effect*, GPU Gems 3, 2007). What moves by itself is not blurred for it.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::scene::Scene;
use crate::shading::Rendered;

use super::Frame;
use super::lens::between;

/// Samples along the way.
const TAPS: usize = 7;
/// Longest way, pixels.
const LONGEST: f32 = 40.0;

pub(super) fn blur(frame: &mut Frame, scene: &Scene, rendered: &Rendered, share: f32) {
    let after_from_before = scene.world_from_camera_after.inverse() * scene.world_from_camera;
    let rotation: Matrix3<f32> = after_from_before.rotation.to_rotation_matrix().matrix().cast();
    let shift: Vector3<f32> = after_from_before.translation.vector.cast();
    let camera = &scene.camera;
    let [fx, fy] = camera.focal.map(|f| f as f32);
    let [cx, cy] = camera.principal_point.map(|c| c as f32);
    let [width, _] = frame.size;
    let size = frame.size;
    let old = frame.pixels.clone();
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, value) in row.iter_mut().enumerate() {
            let ray = Vector3::new((x as f32 - cx) / fx, (y as f32 - cy) / fy, 1.0);
            let depth = rendered.depths[y * width + x];
            let moved =
                rotation * ray + if depth.is_finite() { shift / depth } else { Vector3::zeros() };
            if !(moved.z > 0.05) {
                continue;
            }
            let to = [fx * moved.x / moved.z + cx, fy * moved.y / moved.z + cy];
            let mut way = [share * (to[0] - x as f32), share * (to[1] - y as f32)];
            let length = way[0].hypot(way[1]);
            if !(length > 0.6) {
                continue;
            }
            if length > LONGEST {
                way = way.map(|v| v * LONGEST / length);
            }
            let mut sum = [0.0; 3];
            for tap in 0..TAPS {
                let share = tap as f32 / (TAPS - 1) as f32 - 0.5;
                let at = [x as f32 + share * way[0], y as f32 + share * way[1]];
                for (i, sum) in sum.iter_mut().enumerate() {
                    *sum += between(&old, size, at, i);
                }
            }
            *value = sum.map(|v: f32| v / TAPS as f32);
        }
    });
}
