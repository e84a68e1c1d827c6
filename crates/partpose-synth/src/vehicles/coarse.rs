//! A surface with fewer faces, for shadows that fall far from the camera.
//!
//! Vertices that share a cell of a grid become one (Rossignac and Borrel: *Multi-Resolution 3D Approximations for
//! Rendering Complex Scenes*, 1993); faces that lose an edge by it are dropped. Places are off by up to a cell, which is
//! about a texel of the shadow maps that use it.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use crate::scene::SurfaceMesh;

/// Side of a cell, metres.
const CELL: f32 = 0.07;

/// The faces with parts, with fewer vertices.
pub(super) fn coarse(surface: &SurfaceMesh) -> SurfaceMesh {
    let mut cells: BTreeMap<[i32; 3], (u32, Vector3<f32>, f32)> = BTreeMap::new();
    let mut place = |vertex: u32| {
        let p = surface.vertices[vertex as usize].coords;
        let key = [p.x, p.y, p.z].map(|x| (x / CELL).floor() as i32);
        let next = cells.len() as u32;
        let cell = cells.entry(key).or_insert((next, Vector3::zeros(), 0.0));
        cell.1 += p;
        cell.2 += 1.0;
        cell.0
    };
    let mut coarse = SurfaceMesh::default();
    let mut known = BTreeSet::new();
    for (i, face) in surface.faces.iter().enumerate() {
        let part = surface.parts.get(i).copied().unwrap_or(0);
        if part == 0 {
            continue;
        }
        let [a, b, c] = face.map(&mut place);
        if a == b || b == c || c == a || !known.insert([a, b, c]) {
            continue;
        }
        coarse.faces.push([a, b, c]);
        coarse.parts.push(part);
        coarse.materials.push(surface.materials.get(i).copied().unwrap_or(0));
    }
    coarse.vertices.resize(cells.len(), nalgebra::Point3::origin());
    for (index, sum, count) in cells.values() {
        coarse.vertices[*index as usize] = (sum / *count).into();
    }
    coarse
}
