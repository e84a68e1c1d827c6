//! Materials of the surroundings, and things that stand about as a mesh with materials.

use std::sync::Arc;

use nalgebra::Vector3;
use partpose::geometry::Pose;

use crate::scene::{Material, Object, SegmentClass, SurfaceMesh, Texture};

/// A thing that can stand in many places.
#[derive(Clone, Debug)]
pub(crate) struct Prop {
    pub(crate) mesh: Arc<SurfaceMesh>,
    pub(crate) materials: Arc<[Material]>,
    pub(crate) class: SegmentClass,
}

impl Prop {
    /// The thing in a place, scaled along its axes.
    pub(crate) fn object(&self, world_from_object: Pose, scale: Vector3<f64>) -> Object {
        Object {
            mesh: self.mesh.clone(),
            materials: self.materials.clone(),
            world_from_object,
            scale,
            class: self.class,
            instance: 0,
            has_parts: false,
        }
    }

    /// The thing in a place, as large as it was made.
    pub(crate) fn at(&self, world_from_object: Pose) -> Object {
        self.object(world_from_object, Vector3::new(1.0, 1.0, 1.0))
    }
}

/// A matt surface of one colour, linear RGB.
pub(crate) fn matt(color: [f32; 3]) -> Material {
    Material {
        color,
        texture: Texture::Plain,
        roughness: 0.9,
        metallic: 0.0,
        clear_coat: 0.0,
        transmission: 0.0,
        emission: [0.0; 3],
        dirt: 0.0,
    }
}

/// A matt surface with a pattern.
pub(crate) fn textured(color: [f32; 3], texture: Texture) -> Material {
    Material { texture, ..matt(color) }
}

/// Blotches between two colours.
pub(crate) fn noisy(color: [f32; 3], other: [f32; 3], size: f32) -> Material {
    textured(color, Texture::Noise { other, size })
}

/// Paint or plastic.
pub(crate) fn smooth(color: [f32; 3], roughness: f32) -> Material {
    Material { roughness, ..matt(color) }
}

/// Zinc, steel, aluminium.
pub(crate) fn metal(grey: f32, roughness: f32) -> Material {
    Material { metallic: 0.9, roughness, ..matt([grey, grey, grey * 1.02]) }
}

/// Dark glass, as of the windows of buses.
pub(crate) fn dark_glass() -> Material {
    Material { roughness: 0.05, ..matt([0.02, 0.025, 0.03]) }
}

/// A colour times a factor.
pub(crate) fn shade(color: [f32; 3], factor: f32) -> [f32; 3] {
    color.map(|value| (value * factor).clamp(0.0, 0.9))
}
