//! A piece of road being furnished.

use nalgebra::{Translation3, UnitQuaternion, Vector3};
use partpose::geometry::Pose;
use rand_chacha::ChaCha8Rng;

use super::catalog::Catalog;
use super::path::Path;
use super::random::random;
use super::street::{Strip, ribbon};
use super::stuff::{Prop, noisy, textured};
use crate::scene::{Material, Object, SegmentClass, Texture};

/// Length of the pieces that roads are furnished in, metres.
pub(crate) const PIECE: f64 = 40.0;

/// Materials of the ground, by index.
pub(crate) const ASPHALT: u16 = 0;
pub(crate) const PAINT: u16 = 1;
pub(crate) const PATCH: u16 = 2;
pub(crate) const IRON: u16 = 3;
pub(crate) const GRASS: u16 = 4;
pub(crate) const PAVEMENT: u16 = 5;
pub(crate) const KERB: u16 = 6;
pub(crate) const SOIL: u16 = 7;
pub(crate) const GRAVEL: u16 = 8;

/// The materials that the constants name.
pub(crate) fn grounds() -> [Material; 9] {
    let asphalt = |color: [f32; 3]| textured(color, Texture::Asphalt);
    [
        asphalt([0.110, 0.105, 0.098]),
        Material { roughness: 0.7, ..noisy([0.62, 0.62, 0.60], [0.24, 0.24, 0.23], 0.35) },
        asphalt([0.062, 0.059, 0.056]),
        Material {
            metallic: 0.6,
            roughness: 0.6,
            ..noisy([0.11, 0.10, 0.095], [0.05, 0.045, 0.04], 0.05)
        },
        textured([0.062, 0.082, 0.030], Texture::Grass),
        textured([0.27, 0.26, 0.25], Texture::Slabs { size: [0.4, 0.4], joint: 0.008 }),
        Material {
            roughness: 0.85,
            ..textured([0.34, 0.335, 0.32], Texture::Slabs { size: [1.0, 0.3], joint: 0.008 })
        },
        noisy([0.060, 0.050, 0.030], [0.030, 0.042, 0.018], 1.4),
        Material { dirt: 0.2, ..noisy([0.24, 0.22, 0.19], [0.15, 0.14, 0.12], 0.15) },
    ]
}

/// What a piece is furnished with, and the objects so far.
pub(crate) struct Site<'a> {
    pub(crate) path: &'a Path,
    pub(crate) catalog: &'a Catalog,
    pub(crate) seed: u64,
    /// From where to where, metres along the path.
    pub(crate) range: [f64; 2],
    pub(crate) objects: Vec<Object>,
}

impl Site<'_> {
    /// Random numbers for one purpose within the piece.
    pub(crate) fn random(&self, purpose: i64) -> ChaCha8Rng {
        random(self.seed, &[purpose, (self.range[0] / PIECE).round() as i64])
    }

    /// Puts a thing beside the path: `right` metres from it, `up` above it, turned by `turn` from the path's direction
    /// to its right.
    pub(crate) fn put(&mut self, prop: &Prop, [s, right, up]: [f64; 3], turn: f64, scale: f64) {
        self.put_scaled(prop, [s, right, up], turn, Vector3::new(scale, scale, scale));
    }

    /// The same with factors per axis.
    pub(crate) fn put_scaled(&mut self, prop: &Prop, at: [f64; 3], turn: f64, scale: Vector3<f64>) {
        let pose = upright(&self.path.beside(at[0], at[1]), at[2], turn);
        self.objects.push(prop.object(pose, scale));
    }

    /// Spans a thing that is 1 m long along z between two places, each as in [`Self::put`].
    pub(crate) fn span(&mut self, prop: &Prop, ends: [[f64; 3]; 2]) {
        let [from, to] = ends.map(|[s, right, up]| {
            self.path.beside(s, right).translation.vector - Vector3::y() * up
        });
        let way = to - from;
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &way).unwrap_or_default();
        let pose = Pose::from_parts(Translation3::from(0.5 * (from + to)), turn);
        self.objects.push(prop.object(pose, Vector3::new(1.0, 1.0, way.norm())));
    }

    /// Draws strips along a stretch.
    pub(crate) fn ground(
        &mut self,
        stretch: [f64; 2],
        step: f64,
        strips: &[Strip],
        lift: &dyn Fn(f64, f64) -> f64,
        class: SegmentClass,
    ) {
        self.objects.extend(ribbon(self.path, stretch, step, strips, lift, (&grounds(), class)));
    }

    /// The stretch of the piece outside of a gap.
    pub(crate) fn outside(&self, gap: [f64; 2]) -> Vec<[f64; 2]> {
        let [start, end] = self.range;
        let before = [start, end.min(gap[0])];
        let after = [start.max(gap[1]), end];
        [before, after].into_iter().filter(|[a, b]| b - a > 0.01).collect()
    }
}

/// A frame with y straight down at the place of one that may be sloped; `up` metres above it and turned.
pub(crate) fn upright(pose: &Pose, up: f64, turn: f64) -> Pose {
    let ahead = pose.rotation * Vector3::z();
    let heading = ahead.x.atan2(ahead.z);
    let at = pose.translation.vector - Vector3::y() * up;
    Pose::from_parts(
        Translation3::from(at),
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), heading + turn),
    )
}

/// Bumps of the ground beside roads: nothing within `edge` metres, growing to about `height` at 40 m.
pub(crate) fn hills(edge: f64, height: f64) -> impl Fn(f64, f64) -> f64 {
    move |s, right| {
        let beyond = ((right.abs() - edge) / 40.0).clamp(0.0, 4.0);
        let wave = (s / 31.0 + right / 17.0).sin() + 0.6 * (s / 13.0 - right / 23.0).cos();
        height * beyond * (0.9 + 0.7 * wave)
    }
}

/// No bumps at all.
pub(crate) fn level(_: f64, _: f64) -> f64 {
    0.0
}
