//! From a scene to linear light and exact labels.
//!
//! The way of a picture: objects are placed and projected (`visible.rs`), a visibility buffer says which triangle each
//! sample sees (`raster.rs`), light is computed once for each surface in each pixel (`surface.rs`) under a sky
//! (`sky.rs`, `environment.rs`) with shadows (`shadow.rs`, `contact.rs`), and samples are mixed to pixels. Labels come
//! from the label renderer of `partpose` and are never mixed.

mod contact;
pub(crate) mod depth_map;
mod environment;
mod labels;
pub(crate) mod noise;
mod pixels;
mod raster;
mod shadow;
mod sky;
mod surface;
mod texture;
mod visible;

use nalgebra::{Matrix3, Vector3};

use crate::scene::Scene;

use environment::Environment;
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
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self { anti_aliasing: true, shadows: 1024 }
    }
}

impl RenderOptions {
    /// Fast rather than fine.
    pub fn cheap() -> Self {
        Self { anti_aliasing: false, shadows: 512 }
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
    let triangles = visible::triangles(camera, &seen);
    let rate = if options.anti_aliasing { 2 } else { 1 };
    let visibility = raster::draw(camera.size, rate, &seen, &triangles);
    let sky = Sky::new(&scene.light);
    let world_from_camera: Matrix3<f32> =
        scene.world_from_camera.rotation.to_rotation_matrix().matrix().cast();
    let environment = surroundings(&sky);
    let shadows = if options.shadows > 0 && sky.sun.max() > 1e-3 {
        Shadows::new(scene, &bounds, camera, &sky.to_sun, options.shadows)
    } else {
        Shadows::none()
    };
    let blocks = contact::blocks(&seen, &world_from_camera);
    let horizon = [Vector3::x(), Vector3::z(), -Vector3::x(), -Vector3::z()]
        .map(|d: Vector3<f32>| environment.reflected(&(d - Vector3::y() * 0.1).normalize(), 0.6))
        .iter()
        .sum::<Vector3<f32>>()
        / 4.0;
    let lighting = Lighting {
        sky: &sky,
        environment: &environment,
        shadows: &shadows,
        blocks: &blocks,
        air: scene.air,
        world_from_camera,
        pixel: 1.0 / camera.focal[0].abs().max(1e-3) as f32,
        airlight: horizon,
    };
    let color = pixels::shade(camera, &seen, &triangles, &visibility, &lighting);
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

/// Sky above, road below, and something dark between.
fn surroundings(sky: &Sky) -> Environment {
    let up = -Vector3::y();
    let above = Environment::new(|d| sky.radiance(&Vector3::new(d.x, d.y.min(0.0), d.z)));
    let light = above.irradiance(&up) + sky.sun * (-sky.to_sun.y).max(0.0);
    let ground = light.component_mul(&Vector3::new(0.13, 0.128, 0.12));
    let band = light.component_mul(&Vector3::new(0.055, 0.06, 0.045));
    Environment::new(|d| {
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
