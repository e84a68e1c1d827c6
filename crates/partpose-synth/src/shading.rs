//! From a scene to linear light and exact labels.
//!
//! The way of a picture: objects are placed and projected (`visible.rs`), a visibility buffer says which triangle each
//! sample sees (`raster.rs`), light is computed once for each surface in each pixel (`surface.rs`) under a sky
//! (`sky.rs`, `environment.rs`) with shadows (`shadow.rs`, `contact.rs`), and samples are mixed to pixels. Labels come
//! from the label renderer of `partpose` and are never mixed.

mod contact;
pub(crate) mod depth_map;
mod environment;
mod hidden;
mod labels;
mod leaves;
mod mirror;
pub(crate) mod noise;
mod pixels;
mod raster;
mod shadow;
mod sky;
mod surface;
mod surroundings;
mod texture;
mod visible;

use nalgebra::{Matrix3, Vector3};

use crate::scene::Scene;

use shadow::Shadows;
use sky::Sky;
use surface::Lighting;

/// How to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderOptions {
    /// Mixes 2 x 2 samples a pixel with their neighbours; else one sample a pixel is drawn.
    pub anti_aliasing: bool,
    /// Side of the shadow maps in texels; 0 for none.
    pub shadows: usize,
    /// Whether surfaces mirror what stands around; else a sky over a dark band. Wet roads mirror what the picture shows
    /// either way.
    pub surroundings: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { anti_aliasing: true, shadows: 1024, surroundings: true }
    }
}

impl RenderOptions {
    /// Fast rather than fine.
    pub fn cheap() -> Self {
        Self { anti_aliasing: false, shadows: 512, surroundings: false }
    }
}

/// A picture in linear light with its labels, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendered {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear RGB; 1 is a white surface in full sun.
    pub color: Vec<[f32; 3]>,
    /// Part ids; 0 for everything that is no vehicle with parts.
    pub parts: Vec<u8>,
    /// [`crate::scene::Object::instance`]; 0 for everything else.
    pub instances: Vec<u16>,
    /// Depth along z in metres at the pixel's centre; infinite for the sky. Glass counts as opaque on vehicles with
    /// parts.
    pub depths: Vec<f32>,
    /// What is seen: [`crate::scene::SegmentClass`] as its number.
    pub classes: Vec<u8>,
}

/// Draws a scene; the same bytes on any number of threads.
pub fn render(scene: &Scene, options: &RenderOptions) -> Rendered {
    let camera = &scene.camera;
    let bounds = visible::mesh_bounds(scene);
    let seen = visible::seen(scene, &bounds, camera, &scene.world_from_camera, |_| true);
    let rate = if options.anti_aliasing { 2 } else { 1 };
    let triangles = visible::triangles(camera, &seen, visible::STEPS / rate as i32);
    let visibility = raster::draw(camera.size, rate, &seen, &triangles);
    let sky = Sky::new(&scene.light);
    let world_from_camera: Matrix3<f32> =
        scene.world_from_camera.rotation.to_rotation_matrix().matrix().cast();
    let plain = surroundings::plain(&scene.light, &sky);
    let shadows = if options.shadows > 0 && sky.sun.max() > 1e-3 {
        Shadows::new(scene, &bounds, camera, &sky.to_sun, options.shadows)
    } else {
        Shadows::none()
    };
    let blocks = contact::blocks(&seen, &world_from_camera);
    let mut lighting = Lighting {
        sky: &sky,
        environment: &plain,
        shadows: &shadows,
        blocks: &blocks,
        air: scene.air,
        world_from_camera,
        shift: Vector3::zeros(),
        pixel: 1.0 / camera.focal[0].abs().max(1e-3) as f32,
        airlight: airlight(&sky),
    };
    let environment =
        options.surroundings.then(|| surroundings::of_scene(scene, &bounds, &lighting));
    lighting.environment = environment.as_ref().unwrap_or(&plain);
    let (mut color, water) = pixels::shade(camera, &seen, &triangles, &visibility, &lighting);
    if scene.air.wetness > 0.0 {
        let step = if options.surroundings { 1 } else { 2 };
        mirror::add(camera, &lighting, &visibility, (step, &water), &mut color);
    }

    let labels = labels::draw(scene, &seen, &triangles, &visibility);
    Rendered {
        size: camera.size,
        color,
        parts: labels.parts,
        instances: labels.instances,
        depths: labels.depths,
        classes: labels.classes,
    }
}

/// Light that air sends from all around the horizon.
fn airlight(sky: &Sky) -> Vector3<f32> {
    let directions = [Vector3::x(), Vector3::z(), -Vector3::x(), -Vector3::z()];
    let low = directions.map(|d: Vector3<f32>| sky.radiance(&(d - Vector3::y() * 0.1).normalize()));
    low.iter().sum::<Vector3<f32>>() * 0.25
}
