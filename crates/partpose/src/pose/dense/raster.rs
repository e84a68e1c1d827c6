//! Labels and depths of one model on a small square grid of samples, thousands of times a second.
//!
//! [`crate::render`] draws whole scenes exactly; this one draws one convex-or-not vehicle on at most a few hundred
//! samples a side, in `f32`, and nothing else. A sample is one number: 1/z with its lowest five bits replaced by the
//! part, so that the depth test is a maximum, which vectorises. Rows of a triangle are found by walking its edges from
//! top to bottom, always from the upper vertex, so two triangles agree on the edge they share and leave no crack.

use nalgebra::Matrix3;

use crate::geometry::{Extent, Vector3};
use crate::vehicle::Mesh;

/// Nearest depth that is drawn, metres.
const NEAR: f32 = 0.1;
/// Bits of a sample that hold the part.
const LABEL_BITS: u32 = 31;

/// A mesh as it is drawn: vertices in units of half the extent, from the cuboid's centre.
#[derive(Clone, Debug, Default)]
pub(super) struct UnitMesh {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    faces: Vec<([u32; 3], u32)>,
    /// Whether faces seen from behind can be left out.
    is_closed: bool,
}

impl UnitMesh {
    pub(super) fn new(mesh: &Mesh, extent: &Extent) -> Self {
        let unit = |value: f64, side: f64| (2.0 * value / side) as f32;
        let faces = mesh.faces.iter().zip(&mesh.parts);
        Self {
            x: mesh.vertices.iter().map(|p| unit(p.x, extent.width)).collect(),
            y: mesh
                .vertices
                .iter()
                .map(|p| unit(p.y + 0.5 * extent.height, extent.height))
                .collect(),
            z: mesh.vertices.iter().map(|p| unit(p.z, extent.length)).collect(),
            faces: faces.map(|(face, part)| (*face, u32::from(part.id()))).collect(),
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
}

/// Takes half-extent units to homogeneous samples: `(u, v, z)` with the sample at `(u / z, v / z)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) matrix: Matrix3<f64>,
    pub(super) offset: Vector3,
}

/// Buffers that are kept from one picture to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Raster {
    /// Samples a side.
    pub(super) size: usize,
    /// Part ids row by row, 0 for background.
    pub(super) labels: Vec<u8>,
    keys: Vec<f32>,
    screen: Vec<Corner>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    x: f32,
    y: f32,
    /// 1 / z; 0 where the vertex is not in front of the near plane.
    w: f32,
}

impl Raster {
    /// 1 / z of a sample; 0 where nothing is.
    pub(super) fn inverse_depth(&self, at: usize) -> f32 {
        self.keys[at]
    }

    pub(super) fn draw(&mut self, mesh: &UnitMesh, projection: &Projection, size: usize) {
        self.size = size;
        self.keys.clear();
        self.keys.resize(size * size, 0.0);
        self.project(mesh, projection);
        for (face, label) in &mesh.faces {
            let corners = face.map(|at| self.screen[at as usize]);
            if corners[0].w > 0.0 && corners[1].w > 0.0 && corners[2].w > 0.0 {
                triangle(&mut self.keys, size, corners, *label, mesh.is_closed);
            } else {
                self.draw_clipped(mesh, projection, face, *label);
            }
        }
        self.labels.clear();
        self.labels.extend(self.keys.iter().map(|key| (key.to_bits() & LABEL_BITS) as u8));
    }

    fn project(&mut self, mesh: &UnitMesh, projection: &Projection) {
        let m: [f32; 9] = std::array::from_fn(|i| projection.matrix[(i / 3, i % 3)] as f32);
        let o: [f32; 3] = std::array::from_fn(|i| projection.offset[i] as f32);
        let vertices = mesh.x.iter().zip(&mesh.y).zip(&mesh.z);
        self.screen.clear();
        self.screen.extend(vertices.map(|((x, y), z)| {
            let depth = m[6] * x + m[7] * y + m[8] * z + o[2];
            let w = if depth > NEAR { 1.0 / depth } else { 0.0 };
            Corner {
                x: (m[0] * x + m[1] * y + m[2] * z + o[0]) * w,
                y: (m[3] * x + m[4] * y + m[5] * z + o[1]) * w,
                w,
            }
        }));
    }

    /// Cuts a face at the near plane.
    #[cold]
    fn draw_clipped(
        &mut self,
        mesh: &UnitMesh,
        projection: &Projection,
        face: &[u32; 3],
        label: u32,
    ) {
        let near = f64::from(NEAR) * 1.001;
        let corners = face.map(|index| {
            let at = index as usize;
            let point =
                Vector3::new(f64::from(mesh.x[at]), f64::from(mesh.y[at]), f64::from(mesh.z[at]));
            projection.matrix * point + projection.offset
        });
        let mut kept: Vec<Vector3> = Vec::with_capacity(4);
        for i in 0..3 {
            let (a, b) = (corners[i], corners[(i + 1) % 3]);
            if a.z >= near {
                kept.push(a);
            }
            if (a.z >= near) != (b.z >= near) {
                kept.push(a + (b - a) * ((near - a.z) / (b.z - a.z)));
            }
        }
        let corner = |p: &Vector3| Corner {
            x: (p.x / p.z) as f32,
            y: (p.y / p.z) as f32,
            w: (1.0 / p.z) as f32,
        };
        for i in 2..kept.len() {
            let corners = [corner(&kept[0]), corner(&kept[i - 1]), corner(&kept[i])];
            triangle(&mut self.keys, self.size, corners, label, mesh.is_closed);
        }
    }
}

/// The first whole number at or after `value`, within `0..=limit`; the same for all triangles.
#[inline]
fn first_at_or_after(value: f32, limit: f32) -> usize {
    // Adding 1.5 * 2^23 leaves the rounded number in the low bits: `ceil` is a call on plain x86-64.
    const SHIFT: f32 = 12_582_912.0;
    let value = value + 0.5;
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < limit { value } else { limit };
    ((value + SHIFT).to_bits() - SHIFT.to_bits()) as usize
}

#[inline]
fn triangle(keys: &mut [f32], size: usize, corners: [Corner; 3], label: u32, cull: bool) {
    let [a, b, c] = corners;
    let (abx, aby) = (b.x - a.x, b.y - a.y);
    let (acx, acy) = (c.x - a.x, c.y - a.y);
    let area = abx * acy - aby * acx;
    // Seen from outside a face runs counter-clockwise, which is a negative area where y points down. What is not a
    // number is left out too.
    if !(area < 0.0 || (area > 0.0 && !cull)) {
        return;
    }
    let limit = size as f32;
    let (mut top, mut middle, mut bottom) = (a, b, c);
    if middle.y < top.y {
        std::mem::swap(&mut top, &mut middle);
    }
    if bottom.y < middle.y {
        std::mem::swap(&mut middle, &mut bottom);
        if middle.y < top.y {
            std::mem::swap(&mut top, &mut middle);
        }
    }
    let first = first_at_or_after(top.y, limit);
    let last = first_at_or_after(bottom.y, limit);
    if first >= last {
        return;
    }
    let x_min = a.x.min(b.x).min(c.x);
    let x_max = a.x.max(b.x).max(c.x);
    if first_at_or_after(x_min, limit) >= first_at_or_after(x_max, limit) {
        return;
    }
    let turn = first_at_or_after(middle.y, limit);
    let scale = 1.0 / area;
    let (abw, acw) = ((b.w - a.w) * scale, (c.w - a.w) * scale);
    let slope_x = abw * acy - acw * aby;
    let slope_y = acw * abx - abw * acx;
    let range = [a.w.min(b.w).min(c.w), a.w.max(b.w).max(c.w)];
    let long = Side::new(&top, &bottom);
    for (from, to, side) in
        [(first, turn, Side::new(&top, &middle)), (turn, last, Side::new(&middle, &bottom))]
    {
        for y in from..to {
            let (p, q) = (long.at(y as f32), side.at(y as f32));
            let (left, right) = if p < q { (p, q) } else { (q, p) };
            let (left, right) = (first_at_or_after(left, limit), first_at_or_after(right, limit));
            if left >= right {
                continue;
            }
            let of_row = a.w + slope_y * (y as f32 - a.y) - slope_x * a.x;
            let row = &mut keys[y * size + left..y * size + right];
            for (i, key) in row.iter_mut().enumerate() {
                let w = of_row + slope_x * (left + i) as f32;
                let w = if w > range[0] { w } else { range[0] };
                let w = if w < range[1] { w } else { range[1] };
                let candidate = f32::from_bits((w.to_bits() & !LABEL_BITS) | label);
                *key = if candidate > *key { candidate } else { *key };
            }
        }
    }
}

/// An edge from its upper to its lower end.
struct Side {
    x: f32,
    y: f32,
    slope: f32,
}

impl Side {
    fn new(upper: &Corner, lower: &Corner) -> Self {
        let height = lower.y - upper.y;
        let slope = if height > 0.0 { (lower.x - upper.x) / height } else { 0.0 };
        Self { x: upper.x, y: upper.y, slope }
    }

    fn at(&self, y: f32) -> f32 {
        self.x + (y - self.y) * self.slope
    }
}
