//! A mesh cut into small triangles, so that seams between parts can run through its large ones.
//!
//! Every edge longer than the limit is halved, in all triangles that share it, until none is left: the decision
//! depends on the edge alone, so no crack opens between neighbours. Vertices at one place are joined first; files
//! often repeat them where normals or textures change.

use std::collections::BTreeMap;

use crate::geometry::{Point3, Vector3};
use crate::parts::PartClass;

/// Vertices nearer than this are one, metres.
const WELD: f64 = 1e-4;
/// Rounds of halving: enough for an edge of 100 m and a limit of 1 mm.
const ROUNDS: usize = 17;
/// Most triangles after cutting; larger meshes keep longer edges.
const MAX_FACES: usize = 400_000;

/// Small triangles and where they come from.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// In the vehicle frame, metres.
    pub(super) vertices: Vec<Point3>,
    /// Indices into `vertices`.
    pub(super) faces: Vec<[u32; 3]>,
    /// The given part of each face.
    pub(super) parts: Vec<Option<PartClass>>,
    /// The face of the mesh that each comes from.
    pub(super) origins: Vec<u32>,
}

impl Surface {
    /// The mesh as it is, with vertices at one place joined.
    pub(super) fn welded(
        vertices: &[Point3],
        faces: &[[u32; 3]],
        parts: &[Option<PartClass>],
    ) -> Self {
        let mut places = BTreeMap::new();
        let mut welded = Self::default();
        let joined: Vec<u32> = vertices
            .iter()
            .map(|vertex| {
                let place = [vertex.x, vertex.y, vertex.z].map(|v| (v / WELD).round() as i64);
                *places.entry(place).or_insert_with(|| {
                    welded.vertices.push(*vertex);
                    welded.vertices.len() as u32 - 1
                })
            })
            .collect();
        welded.faces = faces.iter().map(|face| face.map(|index| joined[index as usize])).collect();
        welded.parts = parts.to_vec();
        welded.origins = (0..faces.len() as u32).collect();
        welded
    }

    /// With every edge longer than `limit` halved, again and again.
    pub(super) fn refined(mut self, limit: f64) -> Self {
        for _ in 0..ROUNDS {
            if self.faces.len() > MAX_FACES || !self.halve(limit, &|_| true) {
                break;
            }
        }
        self
    }

    /// Halves the long edges of the wanted faces once; `false` if there was none.
    pub(super) fn halve(&mut self, limit: f64, wanted: &dyn Fn(usize) -> bool) -> bool {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for i in 0..self.faces.len() {
            if !wanted(i) {
                continue;
            }
            for [a, b] in edges(self.faces[i]) {
                let (p, q) = (self.vertices[a as usize], self.vertices[b as usize]);
                if (p - q).norm() > limit {
                    middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                        self.vertices.push(nalgebra::center(&p, &q));
                        self.vertices.len() as u32 - 1
                    });
                }
            }
        }
        if middles.is_empty() {
            return false;
        }
        let (mut faces, mut origins, mut parts) = (Vec::new(), Vec::new(), Vec::new());
        for (i, face) in self.faces.iter().enumerate() {
            let middle = edges(*face).map(|[a, b]| middles.get(&[a.min(b), a.max(b)]).copied());
            for piece in self.pieces(*face, middle) {
                faces.push(piece);
                origins.push(self.origins[i]);
                parts.push(self.parts[i]);
            }
        }
        (self.faces, self.origins, self.parts) = (faces, origins, parts);
        true
    }

    /// A triangle with some of its edges halved, as triangles.
    fn pieces(&self, [a, b, c]: [u32; 3], middle: [Option<u32>; 3]) -> Vec<[u32; 3]> {
        match middle {
            [None, None, None] => vec![[a, b, c]],
            [Some(m), None, None] => vec![[a, m, c], [m, b, c]],
            [None, Some(m), None] => vec![[b, m, a], [m, c, a]],
            [None, None, Some(m)] => vec![[c, m, b], [m, a, b]],
            [Some(m), Some(n), None] => self.two(b, [c, n], [a, m]),
            [None, Some(m), Some(n)] => self.two(c, [a, n], [b, m]),
            [Some(n), None, Some(m)] => self.two(a, [b, n], [c, m]),
            [Some(m), Some(n), Some(o)] => vec![[a, m, o], [m, b, n], [o, n, c], [m, n, o]],
        }
    }

    /// A triangle whose two edges at `tip` are halved: `next` and `last` are the other corners, each with the middle
    /// of its edge to the tip.
    fn two(&self, tip: u32, next: [u32; 2], last: [u32; 2]) -> Vec<[u32; 3]> {
        let at = |index: u32| self.vertices[index as usize];
        let ([p, pm], [q, qm]) = (next, last);
        // The shorter diagonal of the quadrilateral that is left makes the rounder triangles.
        if (at(p) - at(qm)).norm() <= (at(q) - at(pm)).norm() {
            vec![[tip, pm, qm], [pm, p, qm], [p, q, qm]]
        } else {
            vec![[tip, pm, qm], [pm, p, q], [pm, q, qm]]
        }
    }

    pub(super) fn corners(&self, face: usize) -> [Point3; 3] {
        self.faces[face].map(|index| self.vertices[index as usize])
    }

    pub(super) fn center(&self, face: usize) -> Point3 {
        let [a, b, c] = self.corners(face);
        Point3::from((a.coords + b.coords + c.coords) / 3.0)
    }

    /// Twice the area, along the normal.
    pub(super) fn cross(&self, face: usize) -> Vector3 {
        let [a, b, c] = self.corners(face);
        (b - a).cross(&(c - a))
    }

    pub(super) fn area(&self, face: usize) -> f64 {
        0.5 * self.cross(face).norm()
    }

    /// The pairs of faces that share an edge, with the edge's length.
    pub(super) fn neighbours(&self) -> Vec<([u32; 2], f64)> {
        let mut users: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * self.faces.len());
        for (i, face) in self.faces.iter().enumerate() {
            for [a, b] in edges(*face) {
                users.push(([a.min(b), a.max(b)], i as u32));
            }
        }
        users.sort_unstable();
        let mut pairs = Vec::new();
        for group in users.chunk_by(|a, b| a.0 == b.0) {
            let [a, b] = group[0].0.map(|index| self.vertices[index as usize]);
            for two in group.windows(2) {
                pairs.push(([two[0].1, two[1].1], (a - b).norm()));
            }
        }
        pairs
    }
}

fn edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cutting_keeps_area_orientation_and_closure() {
        let mesh = crate::vehicle::ParametricVehicle::sedan().build().unwrap();
        let mesh = mesh.mesh();
        let parts: Vec<_> = mesh.parts.iter().copied().map(Some).collect();
        let surface = Surface::welded(&mesh.vertices, &mesh.faces, &parts);
        let area =
            |surface: &Surface| (0..surface.faces.len()).map(|i| surface.area(i)).sum::<f64>();
        let before = area(&surface);
        let fine = surface.refined(0.05);
        assert!((area(&fine) - before).abs() < 1e-9 * before);
        let parts = fine.parts.iter().flatten().copied().collect();
        let cut = crate::vehicle::Mesh { vertices: fine.vertices, faces: fine.faces, parts };
        assert!((cut.volume() - mesh.volume()).abs() < 1e-9);
        assert_eq!(cut.is_closed(), mesh.is_closed());
    }

    #[test]
    fn pieces_of_every_kind_face_as_the_whole() {
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.7, 0.0]].map(Point3::from);
        for limit in [0.6, 0.8, 1.1, 1.3] {
            let mut surface = Surface::welded(&vertices, &[[0, 1, 2]], &[None]);
            surface.halve(limit, &|_| true);
            assert!((0..surface.faces.len()).all(|i| surface.cross(i).z > 0.0), "{limit}");
            let area: f64 = (0..surface.faces.len()).map(|i| surface.area(i)).sum();
            assert!((area - 0.35).abs() < 1e-12);
        }
    }
}
