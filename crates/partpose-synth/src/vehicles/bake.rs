//! How much of its surroundings an object hides from each of its own vertices.
//!
//! The object is drawn into depth maps from directions all round; a vertex is open towards those in whose maps nothing
//! lies before it. The mean over directions, weighted by their cosine, is what shading multiplies the light of sky and
//! ground with: dark wheel arches, sills and joints between bumper and road come from here. (Obscurances of Zhukov et
//! al. 1998, by depth maps.)

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::scene::SurfaceMesh;
use crate::shading::depth_map::DepthMap;

use super::slots::Slot;

/// Directions; a multiple of two threads.
const DIRECTIONS: usize = 48;
/// Pixels along a side of the maps.
const SIZE: usize = 160;
/// What lies nearer than this hides nothing, metres.
const BIAS: f32 = 0.035;

type V = Vector3<f32>;

/// The open share at every vertex.
pub(super) fn openness(surface: &SurfaceMesh) -> Vec<f32> {
    let Some(radius) = surface.vertices.iter().map(|p| p.coords.norm()).max_by(f32::total_cmp)
    else {
        return Vec::new();
    };
    let seen: Vec<(V, Vec<bool>)> = (0..DIRECTIONS)
        .into_par_iter()
        .map(|i| {
            let direction = direction(i);
            (direction, open_towards(surface, &direction, radius))
        })
        .collect();
    let share = |vertex: usize| {
        let normal = surface.normals[vertex];
        let [mut open, mut all] = [0.0, 1e-6];
        for (direction, seen) in &seen {
            let weight = normal.dot(direction).max(0.0);
            all += weight;
            open += weight * f32::from(u8::from(seen[vertex]));
        }
        open / all
    };
    (0..surface.vertices.len()).map(share).collect()
}

/// Spread evenly over the sphere along a spiral.
fn direction(i: usize) -> V {
    let y = 1.0 - (2.0 * i as f32 + 1.0) / DIRECTIONS as f32;
    let radius = (1.0 - y * y).sqrt();
    let (sin, cos) = (2.399_963_2 * i as f32).sin_cos();
    V::new(radius * cos, y, radius * sin)
}

fn open_towards(surface: &SurfaceMesh, direction: &V, radius: f32) -> Vec<bool> {
    let helper = if direction.x.abs() < 0.7 { V::x() } else { V::y() };
    let right = direction.cross(&helper).normalize();
    let up = direction.cross(&right);
    let scale = 0.5 * SIZE as f32 / radius;
    let project = |p: &V| {
        V::new((right.dot(p) + radius) * scale, (up.dot(p) + radius) * scale, direction.dot(p))
    };
    let projected: Vec<V> = surface.vertices.iter().map(|p| project(&p.coords)).collect();
    let mut map = DepthMap::new([SIZE, SIZE]);
    // Light comes in through the windows, and people may not be there.
    let hides = |slot: u16| {
        slot != Slot::Glass as u16 && slot != Slot::RearGlass as u16 && !Slot::is_somebody(slot)
    };
    for (face, slot) in surface.faces.iter().zip(&surface.materials) {
        if hides(*slot) {
            map.draw(face.map(|i| projected[i as usize]));
        }
    }
    let is_open = |(p, normal): (&nalgebra::Point3<f32>, &V)| {
        // What looks away has no weight.
        normal.dot(direction) > 0.0 && {
            let p = project(&(p.coords + normal * 0.015));
            map.at(p.x, p.y) < p.z + BIAS
        }
    };
    surface.vertices.iter().zip(&surface.normals).map(is_open).collect()
}
