//! The right half of a mirror-symmetric mesh.

use std::collections::BTreeMap;

use crate::geometry::{Point3, Vector3};
use crate::parts::PartClass;

use super::Mesh;

/// Triangles with x >= 0 whose border lies on the mirror plane x = 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct HalfMesh {
    pub(crate) vertices: Vec<Point3>,
    /// Whether a vertex must stay on the mirror plane.
    pub(crate) on_plane: Vec<bool>,
    /// Counter-clockwise seen from outside.
    pub(crate) faces: Vec<[u32; 3]>,
}

impl HalfMesh {
    /// Both halves. The first vertices and faces are those of this half, in order; then the mirrored faces, in order;
    /// `labels` are the ids of the parts of this half's faces (1 to 29), or empty.
    pub(crate) fn mirrored(&self, labels: &[u8]) -> Mesh {
        let mut vertices = self.vertices.clone();
        let mut partner = Vec::with_capacity(vertices.len());
        for (n, vertex) in self.vertices.iter().enumerate() {
            if self.on_plane[n] {
                partner.push(n as u32);
            } else {
                partner.push(vertices.len() as u32);
                vertices.push(Point3::new(-vertex.x, vertex.y, vertex.z));
            }
        }
        let mut faces = self.faces.clone();
        faces.extend(self.faces.iter().map(|f| [f[0], f[2], f[1]].map(|n| partner[n as usize])));
        let part = |id: &u8| PartClass::from_id(*id).unwrap_or(PartClass::SideRight);
        let parts = if labels.is_empty() {
            vec![PartClass::Roof; faces.len()]
        } else {
            let right = labels.iter().map(part);
            right.chain(labels.iter().map(|id| part(id).opposite())).collect()
        };
        Mesh { vertices, faces, parts }
    }

    /// For every vertex of the mirrored mesh the vertex of this half that it moves with.
    pub(crate) fn sources(&self) -> Vec<u32> {
        let own = 0..self.vertices.len() as u32;
        let mirrored = own.clone().filter(|n| !self.on_plane[*n as usize]);
        own.chain(mirrored).collect()
    }

    /// Area-weighted normals, of unit length, within the plane for vertices on it.
    pub(crate) fn normals(&self) -> Vec<Vector3> {
        let mut normals = vec![Vector3::zeros(); self.vertices.len()];
        for face in &self.faces {
            let [a, b, c] = face.map(|n| self.vertices[n as usize]);
            let normal = (b - a).cross(&(c - a));
            for n in face {
                normals[*n as usize] += normal;
            }
        }
        for (normal, on_plane) in normals.iter_mut().zip(&self.on_plane) {
            if *on_plane {
                normal.x = 0.0;
            }
            *normal = normal.try_normalize(1e-12).unwrap_or_default();
        }
        normals
    }

    /// The neighbours of every vertex, sorted; those beyond the mirror plane are not listed.
    pub(crate) fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut near = vec![Vec::new(); self.vertices.len()];
        for face in &self.faces {
            for i in 0..3 {
                let (a, b) = (face[i], face[(i + 1) % 3]);
                near[a as usize].push(b);
                near[b as usize].push(a);
            }
        }
        for list in &mut near {
            list.sort_unstable();
            list.dedup();
        }
        near
    }
}

/// Pairs of faces that share an edge: edge, then the one or two faces.
pub(crate) fn edges(faces: &[[u32; 3]]) -> BTreeMap<[u32; 2], Vec<u32>> {
    let mut edges: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
    for (n, face) in faces.iter().enumerate() {
        for i in 0..3 {
            let (a, b) = (face[i], face[(i + 1) % 3]);
            edges.entry([a.min(b), a.max(b)]).or_default().push(n as u32);
        }
    }
    edges
}
