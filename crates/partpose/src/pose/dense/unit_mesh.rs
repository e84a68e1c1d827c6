//! A mesh as the dense fit draws it.

use nalgebra::Matrix3;

use crate::geometry::{Extent, Vector3};
use crate::vehicle::Mesh;

/// Vertices in units of half the extent, from the cuboid's centre, one coordinate after the other.
#[derive(Clone, Debug, Default)]
pub(super) struct UnitMesh {
    pub(super) x: Vec<f32>,
    pub(super) y: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Part ids of the faces.
    pub(super) labels: Vec<u32>,
    /// Planes of the faces, `normal . p > offset` on the outside.
    planes: [Vec<f32>; 4],
    /// Whether faces seen from behind can be left out.
    pub(super) is_closed: bool,
}

/// Takes half-extent units to homogeneous samples: `(u, v, z)` with the sample at `(u / z, v / z)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) matrix: Matrix3<f64>,
    pub(super) offset: Vector3,
}

impl UnitMesh {
    pub(super) fn new(mesh: &Mesh, extent: &Extent) -> Self {
        let unit = |value: f64, side: f64| 2.0 * value / side;
        let vertex = |p: &crate::geometry::Point3| {
            Vector3::new(
                unit(p.x, extent.width),
                unit(p.y + 0.5 * extent.height, extent.height),
                unit(p.z, extent.length),
            )
        };
        let vertices: Vec<Vector3> = mesh.vertices.iter().map(vertex).collect();
        let plane = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|index| vertices[index as usize]);
            let normal = (b - a).cross(&(c - a));
            [normal.x, normal.y, normal.z, normal.dot(&a)]
        };
        let planes: Vec<[f64; 4]> = mesh.faces.iter().map(plane).collect();
        let line = |axis: usize| vertices.iter().map(|p| p[axis] as f32).collect();
        Self {
            x: line(0),
            y: line(1),
            z: line(2),
            faces: mesh.faces.clone(),
            labels: mesh.parts.iter().map(|part| u32::from(part.id())).collect(),
            planes: std::array::from_fn(|i| planes.iter().map(|plane| plane[i] as f32).collect()),
            is_closed: mesh.is_closed() && mesh.volume() > 0.0,
        }
    }

    /// The vertices in half-extent units.
    pub(super) fn vertices(&self) -> impl Iterator<Item = Vector3> + '_ {
        self.x
            .iter()
            .zip(&self.y)
            .zip(&self.z)
            .map(|((x, y), z)| Vector3::new(f64::from(*x), f64::from(*y), f64::from(*z)))
    }

    /// The faces whose outside the camera sees, all of them where the mesh has holes.
    #[allow(clippy::inline_always)]
    #[inline(always)]
    pub(super) fn seen(&self, projection: &Projection, seen: &mut Vec<u32>) {
        seen.clear();
        let camera = projection.matrix.try_inverse().map(|inverse| inverse * -projection.offset);
        let Some(camera) = camera.filter(|_| self.is_closed) else {
            seen.extend(0..self.faces.len() as u32);
            return;
        };
        let at = camera.map(|value| value as f32);
        let [nx, ny, nz, offset] = &self.planes;
        // Every place is written and only sometimes kept: no branch to guess.
        seen.resize(self.faces.len() + 1, 0);
        let mut count = 0;
        let planes = nx.iter().zip(ny).zip(nz).zip(offset);
        for (index, (((nx, ny), nz), offset)) in (0u32..).zip(planes) {
            seen[count] = index;
            count += usize::from(nx * at.x + ny * at.y + nz * at.z > *offset);
        }
        seen.truncate(count);
    }
}
