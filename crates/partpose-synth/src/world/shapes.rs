//! Surfaces put together from quadrangles, blocks, tubes and ellipsoids.
//!
//! Coordinates of textures are metres along the surface; normals are those of the face, or smooth round tubes and
//! ellipsoids. Frames are y down, so that "up" is negative y.

use std::f32::consts::TAU;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use crate::scene::SurfaceMesh;

/// A mesh in the making.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    mesh: SurfaceMesh,
}

/// A point of a shape, metres.
pub(crate) type P = Point3<f32>;
/// A direction of a shape.
pub(crate) type V = Vector3<f32>;

/// A point.
pub(crate) fn p(x: f32, y: f32, z: f32) -> P {
    P::new(x, y, z)
}

impl Shape {
    /// The mesh, to be shared.
    pub(crate) fn finish(self) -> Arc<SurfaceMesh> {
        Arc::new(self.mesh)
    }

    /// A flat quadrangle whose corners go round; it faces `out`. `uv` are the texture's coordinates of the corners.
    pub(crate) fn quad(&mut self, corners: [P; 4], uv: [[f32; 2]; 4], out: V, material: u16) {
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]))
            + (corners[2] - corners[0]).cross(&(corners[3] - corners[0]));
        let Some(normal) = normal.try_normalize(1e-12) else { return };
        let turned = normal.dot(&out) < 0.0;
        let normal = if turned { -normal } else { normal };
        let first = self.mesh.vertices.len() as u32;
        for (corner, uv) in corners.iter().zip(uv) {
            self.vertex(*corner, normal, uv);
        }
        let faces = if turned { [[0, 2, 1], [0, 3, 2]] } else { [[0, 1, 2], [0, 2, 3]] };
        for face in faces {
            self.face(face.map(|i| first + i), material);
        }
    }

    /// As [`Self::quad`], but light falls on it as on a surface that faces `normal`: leaves of a crown are lit as the crown.
    /// `open` is the share of the sky that the rest of the crown leaves it.
    pub(crate) fn leaf_card(
        &mut self,
        corners: [P; 4],
        start: [f32; 2],
        (normal, open): (V, f32),
        material: u16,
    ) {
        let first = self.mesh.vertices.len();
        self.panel(corners, start, normal, material);
        for own in &mut self.mesh.openness[first..] {
            *own = open;
        }
        for own in &mut self.mesh.normals[first..] {
            *own = (*own * 0.5 + normal).try_normalize(1e-6).unwrap_or(*own);
        }
    }

    /// A quadrangle with metric texture coordinates along its first two sides, starting at `start`.
    pub(crate) fn panel(&mut self, corners: [P; 4], start: [f32; 2], out: V, material: u16) {
        let (u, v) = ((corners[1] - corners[0]).norm(), (corners[3] - corners[0]).norm());
        let [s, t] = start;
        self.quad(corners, [[s, t], [s + u, t], [s + u, t + v], [s, t + v]], out, material);
    }

    /// A block with faces along the axes, from one corner to the opposite one; `faces` tells which of -x, +x, -y, +y, -z, +z
    /// are drawn.
    pub(crate) fn block_faces(&mut self, a: P, b: P, faces: [bool; 6], material: u16) {
        let (l, h) = (a.inf(&b), a.sup(&b));
        let all = [
            ([p(l.x, h.y, h.z), p(l.x, h.y, l.z), p(l.x, l.y, l.z), p(l.x, l.y, h.z)], -V::x()),
            ([p(h.x, h.y, l.z), p(h.x, h.y, h.z), p(h.x, l.y, h.z), p(h.x, l.y, l.z)], V::x()),
            ([p(l.x, l.y, l.z), p(h.x, l.y, l.z), p(h.x, l.y, h.z), p(l.x, l.y, h.z)], -V::y()),
            ([p(l.x, h.y, l.z), p(h.x, h.y, l.z), p(h.x, h.y, h.z), p(l.x, h.y, h.z)], V::y()),
            ([p(l.x, h.y, l.z), p(h.x, h.y, l.z), p(h.x, l.y, l.z), p(l.x, l.y, l.z)], -V::z()),
            ([p(h.x, h.y, h.z), p(l.x, h.y, h.z), p(l.x, l.y, h.z), p(h.x, l.y, h.z)], V::z()),
        ];
        for ((corners, out), wanted) in all.into_iter().zip(faces) {
            if wanted {
                self.panel(corners, [0.0, 0.0], out, material);
            }
        }
    }

    /// A block with all its faces.
    pub(crate) fn block(&mut self, a: P, b: P, material: u16) {
        self.block_faces(a, b, [true; 6], material);
    }

    /// A tube between two points with a radius at either end, and lids.
    pub(crate) fn tube(&mut self, ends: [P; 2], radii: [f32; 2], sides: u32, material: u16) {
        let [from, to] = ends;
        let Some(axis) = (to - from).try_normalize(1e-9) else { return };
        let helper = if axis.x.abs() < 0.6 { V::x() } else { V::z() };
        let (u, length) = (axis.cross(&helper).normalize(), (to - from).norm());
        let v = axis.cross(&u);
        let around = |i: u32| {
            let angle = TAU * i as f32 / sides as f32;
            u * angle.cos() + v * angle.sin()
        };
        let first = self.mesh.vertices.len() as u32;
        for i in 0..=sides {
            let out = around(i);
            let along = TAU * i as f32 / sides as f32 * radii[0].max(radii[1]);
            self.vertex(from + out * radii[0], out, [along, 0.0]);
            self.vertex(to + out * radii[1], out, [along, length]);
        }
        for i in 0..sides {
            let a = first + 2 * i;
            self.outward([a, a + 2, a + 3], around(i) + around(i + 1), material);
            self.outward([a, a + 3, a + 1], around(i) + around(i + 1), material);
        }
        for (end, radius, out) in [(from, radii[0], -axis), (to, radii[1], axis)] {
            if radius > 0.02 {
                let center = self.mesh.vertices.len() as u32;
                self.vertex(end, out, [0.0, 0.0]);
                for i in 0..=sides {
                    self.vertex(end + around(i) * radius, out, [radius, 0.0]);
                }
                for i in 0..sides {
                    self.outward([center, center + 1 + i, center + 2 + i], out, material);
                }
            }
        }
    }

    /// A smooth body through level rings: middle, half the width along x and half the depth along z of each, from the lowest
    /// up or down; closed at both ends.
    pub(crate) fn loft(&mut self, rings: &[(P, [f32; 2])], sides: u32, material: u16) {
        let (Some(start), Some(end)) = (rings.first(), rings.last()) else { return };
        let first = self.mesh.vertices.len() as u32;
        for (i, (center, half)) in rings.iter().enumerate() {
            let (before, after) = (rings[i.saturating_sub(1)], rings[(i + 1).min(rings.len() - 1)]);
            let rise = (before.0.y - after.0.y).abs().max(1e-4);
            let up = (before.0.y - after.0.y).signum();
            for side in 0..=sides {
                let (s, c) = (TAU * side as f32 / sides as f32).sin_cos();
                // Where the body grows wider upwards its side looks down.
                let grows = (after.1[0] - before.1[0]) * c * c + (after.1[1] - before.1[1]) * s * s;
                let out = V::new(c / half[0].max(1e-3), 0.0, s / half[1].max(1e-3)).normalize();
                let normal = (out + V::y() * (up * grows / rise)).normalize();
                let at = center + V::new(half[0] * c, 0.0, half[1] * s);
                self.vertex(at, normal, [half[0] * TAU * side as f32 / sides as f32, center.y]);
            }
        }
        let row = sides + 1;
        for ring in 0..rings.len() as u32 - 1 {
            for side in 0..sides {
                let a = first + ring * row + side;
                let out = self.mesh.normals[a as usize] + self.mesh.normals[(a + row + 1) as usize];
                self.outward([a, a + 1, a + row + 1], out, material);
                self.outward([a, a + row + 1, a + row], out, material);
            }
        }
        let up = (start.0.y - end.0.y).signum();
        for ((center, half), out) in [(start, V::y() * up), (end, -V::y() * up)] {
            let middle = self.mesh.vertices.len() as u32;
            self.vertex(*center, out, [0.0; 2]);
            for side in 0..=sides {
                let (s, c) = (TAU * side as f32 / sides as f32).sin_cos();
                self.vertex(center + V::new(half[0] * c, 0.0, half[1] * s), out, [half[0], 0.0]);
            }
            for side in 0..sides {
                self.outward([middle, middle + 1 + side, middle + 2 + side], out, material);
            }
        }
    }

    /// An ellipsoid with axes along those of the frame.
    pub(crate) fn ellipsoid(&mut self, center: P, radii: V, rings: u32, material: u16) {
        let sides = 2 * rings;
        let first = self.mesh.vertices.len() as u32;
        for ring in 0..=rings {
            let (sin, cos) = (0.5 * TAU * ring as f32 / rings as f32).sin_cos();
            for side in 0..=sides {
                let (s, c) = (TAU * side as f32 / sides as f32).sin_cos();
                let unit = V::new(sin * c, -cos, sin * s);
                let normal = unit.component_div(&radii).normalize();
                let at = center + unit.component_mul(&radii);
                self.vertex(at, normal, [side as f32 * 0.1, ring as f32 * 0.1]);
            }
        }
        let row = sides + 1;
        for ring in 0..rings {
            for side in 0..sides {
                let a = first + ring * row + side;
                let out = self.mesh.normals[a as usize] + self.mesh.normals[(a + row + 1) as usize];
                self.outward([a, a + 1, a + row + 1], out, material);
                self.outward([a, a + row + 1, a + row], out, material);
            }
        }
    }

    /// A strip between two lines of equally many points, smooth along its length; it faces `out`.
    pub(crate) fn strip(&mut self, lines: [&[(P, [f32; 2])]; 2], out: V, material: u16) {
        let count = lines[0].len().min(lines[1].len());
        let first = self.mesh.vertices.len() as u32;
        for i in 0..count {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(count - 1));
            let along = lines[0][after].0 - lines[0][before].0;
            let across = lines[1][i].0 - lines[0][i].0;
            let normal = along.cross(&across).try_normalize(1e-9).unwrap_or(out);
            let normal = if normal.dot(&out) < 0.0 { -normal } else { normal };
            for line in lines {
                self.vertex(line[i].0, normal, line[i].1);
            }
        }
        for i in 0..count.saturating_sub(1) as u32 {
            let a = first + 2 * i;
            self.outward([a, a + 2, a + 3], out, material);
            self.outward([a, a + 3, a + 1], out, material);
        }
    }

    fn vertex(&mut self, at: P, normal: V, uv: [f32; 2]) {
        self.mesh.vertices.push(at);
        self.mesh.normals.push(normal);
        self.mesh.coordinates.push(uv);
        self.mesh.openness.push(1.0);
    }

    fn face(&mut self, face: [u32; 3], material: u16) {
        self.mesh.faces.push(face);
        self.mesh.materials.push(material);
        self.mesh.parts.push(0);
    }

    /// A face, turned so that it faces `out`; left out where it has no area.
    fn outward(&mut self, face: [u32; 3], out: V, material: u16) {
        let [a, b, c] = face.map(|i| self.mesh.vertices[i as usize]);
        let normal = (b - a).cross(&(c - a));
        if normal.norm_squared() > 1e-14 {
            let [i, j, k] = face;
            self.face(if normal.dot(&out) < 0.0 { [i, k, j] } else { face }, material);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check_outward(shape: Shape, center: P) {
        let mesh = shape.finish();
        assert!(!mesh.faces.is_empty());
        assert_eq!(mesh.vertices.len(), mesh.normals.len());
        assert_eq!(mesh.faces.len(), mesh.materials.len());
        for face in &mesh.faces {
            let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
            let normal = (b - a).cross(&(c - a));
            assert!(normal.dot(&(a - center)) > 0.0, "{face:?}");
            let smooth = face.iter().map(|i| mesh.normals[*i as usize]).sum::<V>();
            assert!(normal.dot(&smooth) > 0.0, "{face:?}");
        }
    }

    #[test]
    fn closed_shapes_face_outwards() {
        let mut block = Shape::default();
        block.block(p(-1.0, -2.0, -3.0), p(1.0, 0.0, 3.0), 0);
        check_outward(block, p(0.0, -1.0, 0.0));
        let mut tube = Shape::default();
        tube.tube([p(0.0, 0.0, 0.0), p(0.5, -3.0, 0.2)], [0.3, 0.1], 7, 0);
        check_outward(tube, p(0.2, -1.5, 0.1));
        let mut ball = Shape::default();
        ball.ellipsoid(p(1.0, 1.0, 1.0), V::new(0.3, 0.5, 0.2), 6, 0);
        check_outward(ball, p(1.0, 1.0, 1.0));
        for turn in [-1.0, 1.0] {
            let mut body = Shape::default();
            let ring = |y: f32, half: [f32; 2]| (p(0.0, turn * y, 0.0), half);
            body.loft(
                &[ring(0.0, [0.1, 0.2]), ring(0.5, [0.3, 0.25]), ring(1.0, [0.05, 0.1])],
                8,
                0,
            );
            check_outward(body, p(0.0, 0.5 * turn, 0.0));
        }
    }
}
