//! Part, instance and depth images of vehicle models.
//!
//! A z-buffer rasteriser for labels: no shading, no anti-aliasing, one sample at each pixel's centre. A picture is drawn
//! by one thread, so it never depends on their number; many pictures are drawn in parallel, each with a
//! [`LabelRenderer`] of its own. (Bands of one picture for several threads were tried: with triangles of a pixel or
//! two each band repeats most of the work, and two threads were no faster than one.)

mod clip;
mod project;
mod raster;

use crate::geometry::{Camera, Pose, Vector3};
use crate::vehicle::Mesh;

use project::{Projection, ScreenVertex};
use raster::Target;

/// Nearest depth that is drawn, in metres; what is nearer is cut off.
pub const NEAR: f64 = 0.05;

/// One vehicle to draw.
#[derive(Clone, Copy, Debug)]
pub struct Instance<'a> {
    /// Its mesh.
    pub mesh: &'a Mesh,
    /// Factors per axis that the mesh is scaled with before it is placed.
    pub scale: Vector3,
    /// Where it stands.
    pub camera_from_vehicle: Pose,
    /// What its pixels bear in [`LabelImage::instances`]; 0 is background.
    pub id: u16,
}

/// What the camera sees, pixel by pixel, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelImage {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Part ids; 0 is background.
    pub parts: Vec<u8>,
    /// Ids of the instances; 0 is background.
    pub instances: Vec<u16>,
    /// Depth along z in metres; infinite for background.
    pub depths: Vec<f32>,
}

/// How to draw; none of it changes the picture of closed meshes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RenderOptions {
    /// Leaves out faces that are seen from behind. Faster, and the same picture where meshes are closed, oriented
    /// outwards and not cut by the near plane.
    pub cull_back_faces: bool,
}

/// Draws the instances; of two equally deep surfaces the one drawn first stays.
pub fn render_labels(camera: &Camera, instances: &[Instance]) -> LabelImage {
    let mut renderer = LabelRenderer::default();
    renderer.render(camera, instances, &RenderOptions::default());
    renderer.image
}

/// Buffers that are kept from one picture to the next, for thousands of small ones.
#[derive(Clone, Debug, Default)]
pub struct LabelRenderer {
    image: LabelImage,
    vertices: Vec<ScreenVertex>,
}

impl LabelRenderer {
    /// As [`render_labels`]; the picture stays in the renderer until the next call.
    pub fn render(
        &mut self,
        camera: &Camera,
        instances: &[Instance],
        options: &RenderOptions,
    ) -> &LabelImage {
        self.clear(camera.size);
        if !self.image.parts.is_empty() {
            self.draw(camera, instances, *options);
        }
        &self.image
    }

    /// The last picture, to keep.
    pub fn into_image(self) -> LabelImage {
        self.image
    }

    fn clear(&mut self, size: [u32; 2]) {
        let count = size[0] as usize * size[1] as usize;
        self.image.size = size;
        refill(&mut self.image.parts, count, 0);
        refill(&mut self.image.instances, count, 0);
        // While drawing, `depths` holds 1 / z: it is affine on the screen, and 0 is infinitely far.
        refill(&mut self.image.depths, count, 0.0);
    }

    fn draw(&mut self, camera: &Camera, instances: &[Instance], options: RenderOptions) {
        let image = &mut self.image;
        let mut target = Target {
            size: camera.size.map(|side| side as usize),
            parts: &mut image.parts,
            instances: &mut image.instances,
            inverse_depths: &mut image.depths,
        };
        for instance in instances {
            let projection = Projection::new(camera, instance);
            projection.project(&instance.mesh.vertices, &mut self.vertices);
            raster::draw_instance(&mut target, instance, &projection, &self.vertices, options);
        }
        for value in &mut image.depths {
            *value = 1.0 / *value;
        }
    }
}

fn refill<T: Clone>(values: &mut Vec<T>, count: usize, value: T) {
    values.clear();
    values.resize(count, value);
}
