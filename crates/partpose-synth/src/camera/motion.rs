//! Blur by the motion of camera and vehicles while the shutter is open.
//!
//! Each pixel is the mean along the way that its surface moves on the screen, from its depth and the poses before and
//! after (Rosado: *Motion Blur as a Post-Processing Effect*, GPU Gems 3, 2007). Vehicles with a row move by themselves;
//! lorries, buses and people are blurred as if they stood, and what lies behind a vehicle stays sharp beside it.

use nalgebra::{Matrix3, Vector3};
use partpose::geometry::Pose;
use rayon::prelude::*;

use crate::scene::Scene;
use crate::shading::Rendered;

use super::Frame;
use super::lens::{between, between_four};

/// Samples along the way.
const TAPS: usize = 7;
/// Longest way, pixels.
const LONGEST: f32 = 40.0;

/// How the places of one thing move in camera coordinates.
struct Motion {
    rotation: Matrix3<f32>,
    shift: Vector3<f32>,
}

pub(super) fn blur(frame: &mut Frame, scene: &Scene, rendered: &Rendered, share: f32) {
    let motions = motions(scene);
    let camera = &scene.camera;
    let [fx, fy] = camera.focal.map(|f| f as f32);
    let [cx, cy] = camera.principal_point.map(|c| c as f32);
    let [width, _] = frame.size;
    let size = frame.size;
    frame.old.clone_from(&frame.pixels);
    let old = &frame.old;
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, value) in row.iter_mut().enumerate() {
            let ray = Vector3::new((x as f32 - cx) / fx, (y as f32 - cy) / fy, 1.0);
            let depth = rendered.depths[y * width + x];
            let instance = usize::from(rendered.instances[y * width + x]);
            let Some(motion) = motions.get(instance).or(motions.first()) else { continue };
            let mut moved = motion.rotation * ray;
            if depth.is_finite() {
                moved += motion.shift / depth;
            }
            if !(moved.z > 0.05) {
                continue;
            }
            let to = [fx * moved.x / moved.z + cx, fy * moved.y / moved.z + cy];
            let mut way = [share * (to[0] - x as f32), share * (to[1] - y as f32)];
            let length = (way[0] * way[0] + way[1] * way[1]).sqrt();
            if !(length > 0.6) {
                continue;
            }
            if length > LONGEST {
                way = way.map(|v| v * LONGEST / length);
            }
            let mut sum = [0.0; 3];
            let at = |share: f32| [x as f32 + share * way[0], y as f32 + share * way[1]];
            let is_within = is_within(size, at(-0.5)) && is_within(size, at(0.5));
            for tap in 0..TAPS {
                let at = at(tap as f32 / (TAPS - 1) as f32 - 0.5);
                let value =
                    if is_within { between_four(old, width, at) } else { between(old, size, at) };
                for (sum, value) in sum.iter_mut().zip(value) {
                    *sum += value;
                }
            }
            *value = sum.map(|v: f32| v / TAPS as f32);
        }
    });
}

/// Whether a place has pixels on all sides.
fn is_within(size: [usize; 2], at: [f32; 2]) -> bool {
    (0..2).all(|i| at[i] >= 0.0 && at[i] <= size[i] as f32 - 1.001)
}

/// How what stands moves before the camera, and then how each vehicle does, by its instance.
fn motions(scene: &Scene) -> Vec<Motion> {
    let after_from_world = scene.world_from_camera_after.inverse();
    let motion = |after_from_before: Pose| Motion {
        rotation: after_from_before.rotation.to_rotation_matrix().matrix().cast(),
        shift: after_from_before.translation.vector.cast(),
    };
    let still = motion(after_from_world * scene.world_from_camera);
    let mut motions = vec![still];
    let before = scene.objects.iter().filter(|object| object.instance > 0);
    let mut before: Vec<_> =
        before.map(|object| (object.instance, object.world_from_object)).collect();
    before.sort_by_key(|(instance, _)| *instance);
    for ((_, before), after) in before.iter().zip(&scene.world_from_vehicles_after) {
        let moved = after * before.inverse();
        motions.push(motion(after_from_world * moved * scene.world_from_camera));
    }
    motions
}
