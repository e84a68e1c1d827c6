//! Triangles with a part each, and what can be said about them.

use std::collections::BTreeMap;

use crate::geometry::{Point3, Vector3};
use crate::parts::{PartClass, PartMap};

/// Triangles with a part each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// V, in metres in the vehicle frame (x right, y down, z forward, origin at the cuboid's bottom-face centre).
    ///
    /// A vertex on a seam belongs to several parts and is held once.
    pub vertices: Vec<Point3>,
    /// F, counter-clockwise seen from outside; indices into `vertices`.
    pub faces: Vec<[u32; 3]>,
    /// Z, one part a face.
    pub parts: Vec<PartClass>,
}

impl Mesh {
    /// The mirror image at the plane x = 0, with left and right parts exchanged and faces still facing outwards.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        Self {
            vertices: self.vertices.iter().map(|p| Point3::new(-p.x, p.y, p.z)).collect(),
            faces: self.faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect(),
            parts: self.parts.iter().map(|part| part.opposite()).collect(),
        }
    }

    /// The smallest and the largest coordinates of the vertices; `None` without vertices.
    pub fn bounds(&self) -> Option<(Point3, Point3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p))))
    }

    /// The vertices of the faces of one part, as ascending indices: those whose mean is the part's centre.
    pub fn part_vertices(&self, part: PartClass) -> Vec<u32> {
        let faces = self.faces.iter().zip(&self.parts).filter(|(_, of)| **of == part);
        let mut indices: Vec<u32> = faces.flat_map(|(face, _)| *face).collect();
        indices.sort_unstable();
        indices.dedup();
        indices
    }

    /// Surface area of every part that has a face, in square metres.
    pub fn areas(&self) -> PartMap<f64> {
        let mut areas = PartMap::default();
        for (face, part) in self.faces.iter().zip(&self.parts) {
            let [a, b, c] = self.corners(*face);
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            match areas.get_mut(*part) {
                Some(sum) => *sum += area,
                None => drop(areas.insert(*part, area)),
            }
        }
        areas
    }

    /// The volume inside in cubic metres, if the mesh is closed; negative if it is inside out.
    pub fn volume(&self) -> f64 {
        let signed = |face: &[u32; 3]| {
            let [a, b, c] = self.corners(*face);
            a.coords.dot(&b.coords.cross(&c.coords)) / 6.0
        };
        self.faces.iter().map(signed).sum()
    }

    /// Whether every edge belongs to two faces that run along it in opposite directions.
    pub fn is_closed(&self) -> bool {
        // Per undirected edge: how often it is run along upwards and downwards.
        let mut uses: BTreeMap<[u32; 2], [u32; 2]> = BTreeMap::new();
        for [a, b, c] in &self.faces {
            for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
                let edge = [from.min(to), from.max(to)];
                uses.entry(edge).or_default()[usize::from(from > to)] += 1;
            }
        }
        uses.values().all(|count| *count == [1, 1])
    }

    /// The unit normal of a face, pointing outwards; `None` if the face has no area.
    pub fn normal(&self, face: usize) -> Option<Vector3> {
        let [a, b, c] = self.corners(self.faces[face]);
        (b - a).cross(&(c - a)).try_normalize(0.0)
    }

    fn corners(&self, face: [u32; 3]) -> [Point3; 3] {
        face.map(|index| self.vertices[index as usize])
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A closed tetrahedron of four parts, facing outwards.
    pub(crate) fn tetrahedron() -> Mesh {
        Mesh {
            vertices: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 2.0]]
                .map(Point3::from)
                .to_vec(),
            faces: vec![[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]],
            parts: vec![
                PartClass::Trunk,
                PartClass::SideLeft,
                PartClass::DoorFrontLeft,
                PartClass::Hood,
            ],
        }
    }

    #[test]
    fn a_tetrahedron_is_closed_and_faces_outwards() {
        let mesh = tetrahedron();
        assert!(mesh.is_closed());
        assert!((mesh.volume() - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(mesh.areas().get(PartClass::Trunk), Some(&0.5));
        assert_eq!(mesh.part_vertices(PartClass::Hood), [1, 2, 3]);
    }

    #[test]
    fn a_mesh_with_a_hole_or_a_turned_face_is_not_closed() {
        let mut mesh = tetrahedron();
        mesh.faces[0].reverse();
        assert!(!mesh.is_closed());
        mesh.faces.remove(0);
        assert!(!mesh.is_closed());
    }

    #[test]
    fn the_mirror_image_of_the_mirror_image_is_the_mesh() {
        let mesh = tetrahedron();
        let mirrored = mesh.mirrored();
        assert_eq!(mirrored.parts[2], PartClass::DoorFrontRight);
        assert!((mirrored.volume() - mesh.volume()).abs() < 1e-12);
        assert_eq!(mirrored.mirrored(), mesh);
    }
}
