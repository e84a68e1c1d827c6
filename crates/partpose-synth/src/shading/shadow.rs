//! Which places the sun reaches.
//!
//! Depth maps seen from the sun, finer near the camera: the cascades of Engel (*Cascaded Shadow Maps*, `ShaderX5`, 2006),
//! each a square around a slice of what the camera sees. Between texels shares are mixed (Reeves, Salesin and Cook:
//! *Rendering Antialiased Shadows with Depth Maps*, SIGGRAPH 1987).

use nalgebra::{Matrix3, Vector3};
use partpose::geometry::Camera;
use rayon::prelude::*;

use crate::scene::{Object, Scene, SegmentClass, Texture};

use super::depth_map::DepthMap;
use super::leaves;
use super::noise::{ceil, floor};
use super::visible::{Bounds, is_glass};

type V = Vector3<f32>;

/// Texels a metre below which meshes with fewer faces are drawn, and bodies by halves; at half as many texels meshes
/// with still fewer faces.
const COARSE: f32 = 22.0;

/// Distances at which a cascade ends, metres.
const ENDS: [f32; 3] = [14.0, 42.0, 130.0];

/// Depth maps around the camera.
#[derive(Debug)]
pub(super) struct Shadows {
    cascades: Vec<Cascade>,
    /// Rows: two directions across and the one towards the sun, in axes of the world.
    sun_from_world: Matrix3<f32>,
}

#[derive(Debug)]
struct Cascade {
    /// Corner of the map in the sun's axes, relative to the camera.
    low: [f32; 2],
    /// Texels a metre.
    scale: f32,
    map: DepthMap,
    /// Depth along the camera's axis up to which it is used.
    end: f32,
}

impl Shadows {
    /// No shadow anywhere.
    pub(super) fn none() -> Self {
        Self { cascades: Vec::new(), sun_from_world: Matrix3::identity() }
    }

    /// Draws maps of `size` texels a side.
    pub(super) fn new(
        scene: &Scene,
        bounds: &[Bounds],
        camera: &Camera,
        to_sun: &V,
        size: usize,
    ) -> Self {
        let helper = if to_sun.x.abs() < 0.7 { V::x() } else { V::z() };
        let right = to_sun.cross(&helper).normalize();
        let up = to_sun.cross(&right);
        let sun_from_world =
            Matrix3::from_rows(&[right.transpose(), up.transpose(), to_sun.transpose()]);
        let rotation: Matrix3<f32> =
            scene.world_from_camera.rotation.to_rotation_matrix().matrix().cast();
        let squares: Vec<([f32; 2], f32, f32)> = ENDS
            .iter()
            .zip([0.0].iter().chain(&ENDS))
            .map(|(end, start)| {
                let corners = slice_corners(camera, *start * 0.9, *end);
                let places = corners.map(|p| sun_from_world * (rotation * p));
                let low = places.iter().fold(places[0], |low, p| low.inf(p));
                let high = places.iter().fold(places[0], |high, p| high.sup(p));
                let side = (high - low).xy().max() + 0.5;
                let middle = 0.5 * (low + high);
                ([middle.x - 0.5 * side, middle.y - 0.5 * side], side, *end)
            })
            .collect();
        let camera_position = scene.world_from_camera.translation.vector;
        let mut placed: Vec<Placed> = scene
            .objects
            .par_iter()
            .zip(bounds)
            // What lies flat hides the sun from nothing.
            .filter(|(object, _)| {
                !matches!(object.class, SegmentClass::Road | SegmentClass::Terrain)
            })
            .filter_map(|(object, bounds)| {
                place(object, bounds, &camera_position, &sun_from_world, &squares)
            })
            .collect();
        // What is high hides what is low, which then costs no more than a comparison.
        placed.sort_by(|a, b| b.offset.z.total_cmp(&a.offset.z));
        let cascades = squares
            .par_iter()
            .map(|(low, side, end)| {
                let scale = size as f32 / side;
                let mut map = DepthMap::new([size, size]);
                for placed in &placed {
                    if placed.touches(*low, *side) {
                        draw_object(&mut map, placed, *low, scale);
                    }
                }
                Cascade { low: *low, scale, map, end: *end }
            })
            .collect();
        Self { cascades, sun_from_world }
    }

    /// Share of the sun at a place, given relative to the camera in axes of the world, at a depth.
    pub(super) fn lit(&self, place: &V, normal: &V, depth: f32) -> f32 {
        let Some(cascade) = self.cascades.iter().find(|cascade| depth < cascade.end) else {
            return 1.0;
        };
        let texel = 1.0 / cascade.scale;
        let p = self.sun_from_world * (place + normal * (1.3 * texel + 0.008));
        let bias = 0.6 * texel + 0.01;
        let x = (p.x - cascade.low[0]) * cascade.scale - 1.0;
        let y = (p.y - cascade.low[1]) * cascade.scale - 1.0;
        let size = cascade.map.size[0];
        if !(x >= 1.0 && y >= 1.0 && x < size as f32 - 3.0 && y < size as f32 - 3.0) {
            return 1.0;
        }
        let [ix, iy] = [x as usize, y as usize];
        let [fx, fy] = [x - ix as f32, y - iy as f32];
        let weights = |f: f32| [1.0 - f, 1.0, f];
        let [wx, wy] = [weights(fx), weights(fy)];
        let mut sum = 0.0;
        for (dy, wy) in wy.into_iter().enumerate() {
            let row = (iy + dy) * size + ix;
            for (dx, wx) in wx.into_iter().enumerate() {
                if cascade.map.heights[row + dx] < p.z + bias {
                    sum += wx * wy;
                }
            }
        }
        0.25 * sum
    }
}

/// Corners of the part of the view between two depths, camera coordinates.
fn slice_corners(camera: &Camera, near: f32, far: f32) -> [V; 8] {
    let [width, height] = camera.size.map(|side| side as f32);
    let corner = |x: f32, y: f32, depth: f32| {
        V::new(
            (x - camera.principal_point[0] as f32) / camera.focal[0] as f32 * depth,
            // What is high above the road needs no shadow as fine.
            ((y - camera.principal_point[1] as f32) / camera.focal[1] as f32 * depth)
                .clamp(-3.5, 3.0),
            depth,
        )
    };
    [
        corner(0.0, 0.0, near),
        corner(width, 0.0, near),
        corner(0.0, height, near),
        corner(width, height, near),
        corner(0.0, 0.0, far),
        corner(width, 0.0, far),
        corner(0.0, height, far),
        corner(width, height, far),
    ]
}

/// An object in the sun's axes.
struct Placed<'a> {
    object: &'a Object,
    /// Takes places in its frame to the sun's axes.
    matrix: Matrix3<f32>,
    offset: V,
    center: [f32; 2],
    radius: f32,
}

impl Placed<'_> {
    fn touches(&self, low: [f32; 2], side: f32) -> bool {
        touches(self.center, self.radius, low, side)
    }
}

fn touches(center: [f32; 2], radius: f32, low: [f32; 2], side: f32) -> bool {
    (0..2).all(|i| center[i] + radius > low[i] && center[i] - radius < low[i] + side)
}

fn place<'a>(
    object: &'a Object,
    (center, radius): &Bounds,
    camera_position: &Vector3<f64>,
    sun_from_world: &Matrix3<f32>,
    squares: &[([f32; 2], f32, f32)],
) -> Option<Placed<'a>> {
    let rotation = object.world_from_object.rotation.to_rotation_matrix();
    let matrix =
        sun_from_world * (*rotation.matrix() * Matrix3::from_diagonal(&object.scale)).cast::<f32>();
    let offset = object.world_from_object.translation.vector - camera_position;
    let offset = sun_from_world * offset.cast::<f32>();
    let middle = matrix * center + offset;
    let center = [middle.x, middle.y];
    let radius = radius * object.scale.abs().max() as f32;
    let is_near = squares.iter().any(|(low, side, _)| touches(center, radius, *low, *side));
    is_near.then_some(Placed { object, matrix, offset, center, radius })
}

fn draw_object(map: &mut DepthMap, placed: &Placed, low: [f32; 2], scale: f32) {
    let is_far = scale < COARSE;
    // The coarse form of vehicles is finer than texels that ask for one.
    let level = if placed.object.has_parts { 2.0 * COARSE / scale } else { COARSE / scale };
    let mesh = placed.object.mesh.for_level(f64::from(level));
    let vertices = mesh.vertices.iter();
    let positions: Vec<V> = vertices
        .map(|p| {
            let p = placed.matrix * p.coords + placed.offset;
            V::new((p.x - low[0]) * scale, (p.y - low[1]) * scale, p.z)
        })
        .collect();
    for (i, face) in mesh.faces.iter().enumerate() {
        let [Some(a), Some(b), Some(c)] = face.map(|vertex| positions.get(vertex as usize)) else {
            continue;
        };
        let corners = [*a, *b, *c];
        let [low, high] = [a.inf(b).inf(c), a.sup(b).sup(c)];
        let misses = |low: f32, high: f32| {
            ceil(low - 0.5) > floor(high - 0.5) || high < 0.0 || low > map.size[0] as f32
        };
        if misses(low.x, high.x) || misses(low.y, high.y) {
            continue;
        }
        if placed.object.has_parts {
            // Of a far body the side away from the sun does; near, light falls in through the windows, and both count.
            let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
            if (is_far && area >= 0.0) || mesh.parts.get(i).is_none_or(|part| *part == 0) {
                continue;
            }
        }
        let slot = mesh.materials.get(i).copied().unwrap_or(0);
        let Some(material) = placed.object.materials.get(usize::from(slot)) else { continue };
        if is_glass(material) {
            continue;
        }
        if let Texture::Leaves { cover, size } = material.texture {
            let scale = leaves::texels(size);
            let coordinates = face.map(|vertex| {
                let own = mesh.coordinates.get(vertex as usize).copied().unwrap_or_default();
                own.map(|value| value * scale)
            });
            let mask = leaves::Mask::of(cover);
            map.draw_where(corners, coordinates, |place| mask.is_leaf(place));
        } else {
            map.draw(corners);
        }
    }
}
