//! Every vehicle of a frame drawn by itself, and the frame put together from them.
//!
//! A layer holds the window of the image that a vehicle can be seen in, so that drawing costs what the window costs. The
//! layers also tell what the frame alone cannot: how much of a vehicle is hidden, and what it shows where a
//! segmentation gives it a pixel for which the models would name another.

use crate::geometry::{Camera, Cuboid, Point3};
use crate::render::{Instance, LabelRenderer, NEAR, RenderOptions};
use crate::vehicle::VehicleModel;

/// A vehicle alone, in a window of the image.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Upper left pixel of the window.
    pub origin: [u32; 2],
    /// Width and height of the window in pixels.
    pub size: [u32; 2],
    /// Part ids row by row; 0 is background.
    pub parts: Vec<u8>,
    /// Depth along z in metres; infinite for background.
    pub depths: Vec<f32>,
}

impl Layer {
    /// Part and depth at a pixel of the image, if the vehicle covers it.
    pub fn at(&self, x: u32, y: u32) -> Option<(u8, f32)> {
        let (i, j) = (x.checked_sub(self.origin[0])?, y.checked_sub(self.origin[1])?);
        if i >= self.size[0] || j >= self.size[1] {
            return None;
        }
        let at = j as usize * self.size[0] as usize + i as usize;
        (self.parts[at] != 0).then_some((self.parts[at], self.depths[at]))
    }

    /// Pixels that the vehicle would cover if nothing stood before it.
    pub fn pixels(&self) -> u32 {
        self.parts.iter().filter(|part| **part != 0).count() as u32
    }
}

/// Origin and size of a window of the image.
pub(super) type Window = ([u32; 2], [u32; 2]);

/// A model, scaled to a cuboid per axis, at its place.
pub(super) fn place<'a>(model: &'a VehicleModel, cuboid: &Cuboid) -> Instance<'a> {
    Instance {
        mesh: model.mesh(),
        scale: cuboid.extent.ratio(&model.extent()),
        camera_from_vehicle: cuboid.camera_from_vehicle,
        id: 1,
    }
}

/// Draws a vehicle in its window; `None` where nothing of it is seen there.
pub(super) fn draw(
    renderer: &mut LabelRenderer,
    camera: &Camera,
    instance: &Instance,
    (origin, size): Window,
) -> Option<Layer> {
    let mut part_of_camera = *camera;
    for axis in 0..2 {
        part_of_camera.principal_point[axis] -= f64::from(origin[axis]);
    }
    part_of_camera.size = size;
    let image = renderer.render(&part_of_camera, &[*instance], &RenderOptions::default());
    let seen = image.parts.iter().any(|part| *part != 0);
    seen.then(|| Layer { origin, size, parts: image.parts.clone(), depths: image.depths.clone() })
}

/// The pixels that a vehicle can cover; `None` where it lies outside the image.
pub(super) fn window(camera: &Camera, instance: &Instance) -> Option<Window> {
    let (low, high) = instance.mesh.bounds()?;
    let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for corner in 0..8 {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { high[axis] } else { low[axis] };
        let point = Point3::new(pick(0), pick(1), pick(2));
        let scaled = Point3::from(point.coords.component_mul(&instance.scale));
        let there = instance.camera_from_vehicle * scaled;
        if there.z <= NEAR {
            // What passes beside the camera can reach anywhere.
            return (camera.size[0] > 0 && camera.size[1] > 0).then_some(([0, 0], camera.size));
        }
        let pixel = camera.project_unchecked(&there);
        for axis in 0..2 {
            bounds[0][axis] = bounds[0][axis].min(pixel[axis]);
            bounds[1][axis] = bounds[1][axis].max(pixel[axis]);
        }
    }
    let mut origin = [0; 2];
    let mut size = [0; 2];
    for axis in 0..2 {
        let limit = f64::from(camera.size[axis]);
        let first = (bounds[0][axis].floor() - 1.0).clamp(0.0, limit) as u32;
        let end = (bounds[1][axis].ceil() + 2.0).clamp(0.0, limit) as u32;
        origin[axis] = first;
        size[axis] = end.checked_sub(first).filter(|side| *side > 0)?;
    }
    Some((origin, size))
}

/// Which layer is seen at each pixel, row by row: 0 for none, else 1 + its index.
///
/// The nearest is seen; of two equally deep ones the first.
pub(super) fn compose(size: [u32; 2], layers: &[Option<Layer>]) -> Vec<u16> {
    let width = size[0] as usize;
    let mut owners = vec![0; width * size[1] as usize];
    let mut depths = vec![f32::INFINITY; owners.len()];
    for (owner, layer) in (1..).zip(layers) {
        let Some(layer) = layer else { continue };
        let side = layer.size[0] as usize;
        let rows = layer.parts.chunks_exact(side).zip(layer.depths.chunks_exact(side));
        for (j, (parts, near)) in rows.enumerate() {
            let start = (layer.origin[1] as usize + j) * width + layer.origin[0] as usize;
            let seen = owners[start..start + side].iter_mut().zip(&mut depths[start..start + side]);
            for ((part, depth), (seen, nearest)) in parts.iter().zip(near).zip(seen) {
                if *part != 0 && *depth < *nearest {
                    *nearest = *depth;
                    *seen = owner;
                }
            }
        }
    }
    owners
}
