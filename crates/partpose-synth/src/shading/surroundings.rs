//! What stands around the camera, for reflections and for the light it takes and gives back.
//!
//! Four small pictures to all sides are drawn of everything but vehicles, from a place some metres ahead, since what
//! reflects stands there; above them is the sky, below them the road. Everything in the picture shares this one
//! environment (Blinn and Newell 1976), as if what it shows were far away.

use std::cell::RefCell;
use std::rc::Rc;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use partpose::geometry::{Camera, Pose};

use crate::scene::{Light, Object, Scene, SegmentClass};

use super::contact::Blocks;
use super::environment::Environment;
use super::noise;
use super::raster::{self, NOTHING};
use super::sky::Sky;
use super::surface::{Lighting, Spot};
use super::visible::{self, Bounds};

type V = Vector3<f32>;

/// Pixels along a side of each of the four pictures.
const SIDE: u32 = 64;
/// How far ahead of the camera they are taken, metres.
const AHEAD: f64 = 7.0;
/// What stands further away is left out, metres.
const REACH: f64 = 75.0;

thread_local! {
    /// The last of [`plain`]'s on this thread: frames of a sequence have the same light.
    static LAST: RefCell<Option<(Light, Rc<Environment>)>> = const { RefCell::new(None) };
}

/// Sky above, road below, and something dark between.
pub(super) fn plain(light: &Light, sky: &Sky) -> Rc<Environment> {
    let last = LAST.with_borrow(|last| {
        last.as_ref().filter(|(known, _)| known == light).map(|(_, plain)| Rc::clone(plain))
    });
    last.unwrap_or_else(|| {
        let plain = Rc::new(new_plain(sky));
        LAST.set(Some((*light, Rc::clone(&plain))));
        plain
    })
}

fn new_plain(sky: &Sky) -> Environment {
    let up = -V::y();
    let above = Environment::new(32, |d| sky.radiance(&V::new(d.x, d.y.min(0.0), d.z)));
    let light = above.irradiance(&up) + sky.sun * (-sky.to_sun.y).max(0.0);
    let ground = light.component_mul(&V::new(0.13, 0.128, 0.12));
    let band = light.component_mul(&V::new(0.055, 0.06, 0.045));
    Environment::new(128, |d| {
        let height = -d.y;
        if height < -0.01 {
            return ground;
        }
        let turn = d.z.atan2(d.x);
        let top = 0.03 + 0.16 * noise::fractal(6.0 * turn, 0.0, 4, 0.0, 77);
        let share = ((height - top) * 60.0).clamp(0.0, 1.0);
        band.lerp(&sky.radiance_with_clouds(d), share)
    })
}

/// The scene's own surroundings, lit by `lighting`.
pub(super) fn of_scene(scene: &Scene, bounds: &[Bounds], lighting: &Lighting) -> Environment {
    let forward = scene.world_from_camera.rotation * Vector3::z();
    let flat = Vector3::new(forward.x, 0.0, forward.z);
    let ahead = flat.try_normalize(1e-6).unwrap_or_else(Vector3::z) * AHEAD;
    let origin = scene.world_from_camera.translation.vector + ahead;
    let side = f64::from(SIDE);
    let camera = Camera::pinhole(0.5 * side, [0.5 * side - 0.5; 2], [SIDE; 2]);
    let concerns = |object: &Object| {
        let distance = (object.world_from_object.translation.vector - origin).norm();
        let is_vehicle =
            matches!(object.class, SegmentClass::Car | SegmentClass::Van | SegmentClass::Truck);
        // Roads and terrain may have their origin anywhere.
        let is_ground = matches!(object.class, SegmentClass::Road | SegmentClass::Terrain);
        !is_vehicle && (is_ground || distance < REACH)
    };
    let no_blocks = Blocks::default();
    let pictures: Vec<Vec<Option<V>>> = (0..4)
        .map(|turn| {
            let rotation = turned(turn);
            let pose =
                Pose::from_parts(origin.into(), UnitQuaternion::from_rotation_matrix(&rotation));
            let seen = visible::seen(scene, bounds, &camera, &pose, concerns);
            let triangles = visible::triangles(&camera, &seen, visible::STEPS);
            let visibility = raster::draw(camera.size, 1, &seen, &triangles);
            let lighting = Lighting {
                world_from_camera: rotation.matrix().cast(),
                shift: ahead.cast(),
                pixel: 2.0 / SIDE as f32,
                blocks: &no_blocks,
                ..*lighting
            };
            let radiance = |(i, id): (usize, &u32)| {
                if *id == NOTHING {
                    return None;
                }
                let triangle = &triangles.opaque[*id as usize];
                let [x, y] = [i as u32 % SIDE, i as u32 / SIDE].map(|i| i as f32);
                let ray = ray(x, y);
                let seen = &seen[triangle.seen as usize];
                let spot = Spot::new(&lighting, seen, triangle.face, &ray)?;
                // Highlights of single pixels would shine from everywhere.
                Some(spot.light(&lighting).color.map(|value| value.min(4.0)))
            };
            visibility.ids.iter().enumerate().map(radiance).collect()
        })
        .collect();
    let below = ground(&pictures).unwrap_or_else(|| lighting.environment.reflected(&V::y(), 1.0));
    let turns: [Matrix3<f32>; 4] =
        [0, 1, 2, 3].map(|turn| turned(turn).matrix().cast::<f32>().transpose());
    let sky = lighting.sky;
    Environment::new(128, |d| {
        let turn = match (d.x.abs() > d.z.abs(), d.x > 0.0, d.z > 0.0) {
            (false, _, true) => 0,
            (true, true, _) => 1,
            (false, _, false) => 2,
            (true, false, _) => 3,
        };
        let p = turns[turn] * d;
        let half = 0.5 * SIDE as f32;
        let [x, y] = [half * p.x / p.z + half, half * p.y / p.z + half];
        if y >= SIDE as f32 {
            return below;
        }
        let seen = if y >= 0.0 {
            let x = (x.max(0.0) as usize).min(SIDE as usize - 1);
            pictures[turn][y as usize * SIDE as usize + x]
        } else {
            None
        };
        match seen {
            Some(color) => color,
            None if d.y > 0.02 => below,
            None => sky.radiance_with_clouds(d),
        }
    })
}

/// To the front, right, back and left along the axes of the world.
fn turned(turn: usize) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::FRAC_PI_2 * turn as f64)
}

fn ray(x: f32, y: f32) -> V {
    let half = 0.5 * SIDE as f32;
    V::new((x + 0.5) / half - 1.0, (y + 0.5) / half - 1.0, 1.0)
}

/// The mean of the lowest rows.
fn ground(pictures: &[Vec<Option<V>>]) -> Option<V> {
    let from = (SIDE * (SIDE - 12)) as usize;
    let [mut sum, mut count] = [V::zeros(), V::zeros()];
    for color in pictures.iter().flat_map(|picture| &picture[from..]).flatten() {
        sum += color;
        count += V::repeat(1.0);
    }
    (count.x > 0.0).then(|| sum.component_div(&count))
}
