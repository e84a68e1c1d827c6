//! The left half of a vehicle while it is being made.

use std::collections::HashMap;

use crate::geometry::Point3;
use crate::parts::PartClass;
use crate::vehicle::Mesh;

/// A vertex of the left half.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    /// Distance from the plane of symmetry, not negative.
    pub(super) lateral: f64,
    /// Height above the ground.
    pub(super) h: f64,
    /// Forward position.
    pub(super) z: f64,
    /// Parameter of the ring along the upper curve, see `loft.rs`.
    pub(super) t: f64,
}

impl Vertex {
    pub(super) fn lerp(&self, other: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            lateral: mix(self.lateral, other.lateral),
            h: mix(self.h, other.h),
            z: mix(self.z, other.z),
            t: mix(self.t, other.t),
        }
    }

    fn key(&self) -> [u64; 3] {
        [self.lateral, self.h, self.z].map(|value| (value + 0.0).to_bits())
    }
}

/// Which strip of the loft a face belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Zone {
    /// Floor and sill's edge.
    Bottom,
    /// The side, from the sill to the edge of hood, roof and trunk.
    Side,
    /// The rounded edge between side and top.
    Corner,
    /// The outer strip of the top, which is pillar beside a windscreen.
    Rim,
    /// Hood, windscreens, roof, trunk and the faces of the bumpers.
    Top,
    /// No body.
    Fitting,
}

/// Faces with zones and parts; counter-clockwise seen from outside in (lateral, h, z).
#[derive(Default)]
pub(super) struct Half {
    pub(super) vertices: Vec<Vertex>,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) zones: Vec<Zone>,
    pub(super) parts: Vec<PartClass>,
}

impl Half {
    pub(super) fn push(&mut self, face: [u32; 3], zone: Zone, part: PartClass) {
        if face[0] != face[1] && face[1] != face[2] && face[2] != face[0] {
            self.faces.push(face);
            self.zones.push(zone);
            self.parts.push(part);
        }
    }

    /// Pushes the quadrangles of a grid of vertices, given row by row; `round` joins the last column to the first.
    pub(super) fn push_grid(&mut self, rows: &[Vec<Vertex>], round: bool, part: PartClass) {
        let start = self.vertices.len() as u32;
        let columns = rows.first().map_or(0, Vec::len) as u32;
        self.vertices.extend(rows.iter().flatten());
        let last = if round { columns } else { columns.saturating_sub(1) };
        for i in 0..rows.len().saturating_sub(1) as u32 {
            for j in 0..last {
                let index = |i: u32, j: u32| start + i * columns + j % columns;
                let [a, b] = [index(i, j), index(i, j + 1)];
                let [c, d] = [index(i + 1, j + 1), index(i + 1, j)];
                self.push([a, b, c], Zone::Fitting, part);
                self.push([a, c, d], Zone::Fitting, part);
            }
        }
    }

    /// Makes vertices at identical positions one and drops faces that lose their area by it.
    pub(super) fn merge(&mut self) {
        let mut vertices: Vec<Vertex> = Vec::new();
        let mut seen = HashMap::new();
        let map: Vec<u32> = self
            .vertices
            .iter()
            .map(|vertex| {
                *seen.entry(vertex.key()).or_insert_with(|| {
                    vertices.push(*vertex);
                    vertices.len() as u32 - 1
                })
            })
            .collect();
        let old = std::mem::replace(self, Self { vertices, ..Self::default() });
        for ((face, zone), part) in old.faces.iter().zip(old.zones).zip(old.parts) {
            self.push(face.map(|index| map[index as usize]), zone, part);
        }
    }

    /// Both halves in the vehicle frame, sharing the vertices of the plane of symmetry.
    pub(super) fn mirrored_together(mut self) -> Mesh {
        self.merge();
        // (lateral, h, z) is (-x, -y, z): a half turn, so that faces keep their sense.
        let point = |v: &Vertex| Point3::new(-v.lateral + 0.0, -v.h + 0.0, v.z);
        let left = Mesh {
            vertices: self.vertices.iter().map(point).collect(),
            faces: self.faces,
            parts: self.parts,
        };
        let right = left.mirrored();
        let mut whole = left;
        let mut map = Vec::with_capacity(right.vertices.len());
        for (index, vertex) in right.vertices.iter().enumerate() {
            if whole.vertices[index].x == 0.0 {
                map.push(index as u32);
            } else {
                map.push(whole.vertices.len() as u32);
                whole.vertices.push(*vertex);
            }
        }
        whole.faces.extend(right.faces.iter().map(|face| face.map(|index| map[index as usize])));
        whole.parts.extend(right.parts);
        whole
    }
}
