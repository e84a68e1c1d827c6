//! A surface with fewer faces, for where it is far away and for shadows that fall there.
//!
//! Vertices that share a cell of a grid become one (Rossignac and Borrel: *Multi-Resolution 3D Approximations for
//! Rendering Complex Scenes*, 1993); faces that lose an edge by it are dropped. Places are off by up to a cell, which is
//! about a texel of the shadow maps and a pixel of the pictures that use it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Vector3;

use crate::scene::SurfaceMesh;

/// Sides of cells, metres: of the coarse form and of the coarser one.
const CELLS: [f32; 2] = [0.035, 0.07];

/// Vertices of a cell: its number, and sums over them.
#[derive(Default)]
struct Cell {
    number: u32,
    count: f32,
    place: Vector3<f32>,
    normal: Vector3<f32>,
    coordinates: [f32; 2],
    open: f32,
}

/// The faces with parts, with fewer vertices, and the same with still fewer.
pub(super) fn coarse(surface: &SurfaceMesh) -> SurfaceMesh {
    let [near, far] = CELLS.map(|cell| clustered(surface, cell));
    SurfaceMesh { coarse: Some(Arc::new(far)), ..near }
}

fn clustered(surface: &SurfaceMesh, side: f32) -> SurfaceMesh {
    let mut cells: BTreeMap<[i32; 3], Cell> = BTreeMap::new();
    let mut place = |vertex: u32| {
        let vertex = vertex as usize;
        let p = surface.vertices[vertex].coords;
        let key = [p.x, p.y, p.z].map(|x| (x / side).floor() as i32);
        let number = cells.len() as u32;
        let cell = cells.entry(key).or_insert_with(|| Cell { number, ..Cell::default() });
        cell.count += 1.0;
        cell.place += p;
        cell.normal += surface.normals.get(vertex).copied().unwrap_or_default();
        cell.open += surface.openness.get(vertex).copied().unwrap_or(1.0);
        let own = surface.coordinates.get(vertex).copied().unwrap_or_default();
        for (sum, value) in cell.coordinates.iter_mut().zip(own) {
            *sum += value;
        }
        cell.number
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
    let mut cells: Vec<Cell> = cells.into_values().collect();
    cells.sort_by_key(|cell| cell.number);
    for cell in &cells {
        coarse.vertices.push((cell.place / cell.count).into());
        coarse.normals.push(cell.normal.try_normalize(1e-3).unwrap_or_default());
        coarse.coordinates.push(cell.coordinates.map(|sum| sum / cell.count));
        coarse.openness.push(cell.open / cell.count);
    }
    coarse
}
