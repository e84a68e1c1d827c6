//! Labels and depths of one model on a small square grid of samples, thousands of times a second.
//!
//! [`crate::render`] draws whole scenes exactly; this one draws one convex-or-not vehicle on at most a few hundred
//! samples a side, in `f32`, and nothing else. A sample is one number: 1/z with its lowest five bits replaced by the
//! part, so that the depth test is a maximum, which vectorises (`triangles`).

use pulp::{Simd, WithSimd};

use crate::geometry::Vector3;

use super::triangles::{Batch, MARGIN};
use super::unit_mesh::{Projection, UnitMesh};
use super::vector;

/// Nearest depth that is drawn, metres.
const NEAR: f32 = 0.1;
/// Bits of a sample that hold the part.
pub(super) const LABEL_BITS: u32 = 31;

/// Buffers that are kept from one picture to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Raster {
    /// Samples a side.
    pub(super) size: usize,
    /// Part ids row by row, 0 for background.
    pub(super) labels: Vec<u8>,
    /// Samples row by row; a row is [`MARGIN`] longer than the picture.
    keys: Vec<f32>,
    /// The vertices: x and y in samples, and 1 / z, which is 0 where a vertex is not in front of the near plane.
    screen: [Vec<f32>; 3],
    seen: Vec<u32>,
    batch: Batch,
}

impl Raster {
    /// 1 / z of a sample; 0 where nothing is.
    pub(super) fn inverse_depth(&self, x: usize, y: usize) -> f32 {
        self.keys[y * (self.size + MARGIN) + x]
    }

    pub(super) fn draw(&mut self, mesh: &UnitMesh, projection: &Projection, size: usize) {
        self.size = size;
        self.keys.clear();
        self.keys.resize((size + MARGIN) * size, 0.0);
        vector::dispatch(Draw { raster: self, mesh, projection });
    }
}

struct Draw<'a> {
    raster: &'a mut Raster,
    mesh: &'a UnitMesh,
    projection: &'a Projection,
}

// Only what is inlined is compiled for the chosen vectors.
#[allow(clippy::inline_always)]
impl WithSimd for Draw<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { raster, mesh, projection } = self;
        mesh.seen(projection, &mut raster.seen);
        project(mesh, projection, &mut raster.screen);
        let Raster { screen, seen, batch, keys, labels, size, .. } = raster;
        let [x, y, w] = &*screen;
        let stride = *size + MARGIN;
        for face in &*seen {
            let corners = mesh.faces[*face as usize].map(|at| {
                let at = at as usize;
                [x[at], y[at], w[at]]
            });
            let label = mesh.labels[*face as usize];
            if corners[0][2] > 0.0 && corners[1][2] > 0.0 && corners[2][2] > 0.0 {
                batch.push(corners, label);
            } else {
                clip(mesh, projection, *face as usize, batch);
            }
            if batch.is_full() {
                batch.draw(simd, keys, *size, mesh.is_closed);
            }
        }
        batch.draw(simd, keys, *size, mesh.is_closed);
        labels.resize(*size * *size, 0);
        for (keys, labels) in keys.chunks_exact(stride).zip(labels.chunks_exact_mut(*size)) {
            for (key, label) in keys.iter().zip(labels) {
                *label = (key.to_bits() & LABEL_BITS) as u8;
            }
        }
    }
}

#[allow(clippy::inline_always)]
#[inline(always)]
fn project(mesh: &UnitMesh, projection: &Projection, screen: &mut [Vec<f32>; 3]) {
    let m: [f32; 9] = std::array::from_fn(|i| projection.matrix[(i / 3, i % 3)] as f32);
    let o: [f32; 3] = std::array::from_fn(|i| projection.offset[i] as f32);
    let count = mesh.x.len();
    for line in &mut *screen {
        line.resize(count, 0.0);
    }
    let [sx, sy, sw] = screen;
    let (sx, sy, sw) = (&mut sx[..count], &mut sy[..count], &mut sw[..count]);
    let (x, y, z) = (&mesh.x[..count], &mesh.y[..count], &mesh.z[..count]);
    for i in 0..count {
        let depth = m[6] * x[i] + m[7] * y[i] + m[8] * z[i] + o[2];
        let w = 1.0 / depth;
        let w = if depth > NEAR { w } else { 0.0 };
        sx[i] = (m[0] * x[i] + m[1] * y[i] + m[2] * z[i] + o[0]) * w;
        sy[i] = (m[3] * x[i] + m[4] * y[i] + m[5] * z[i] + o[1]) * w;
        sw[i] = w;
    }
}

/// Cuts a face at the near plane.
#[cold]
#[inline(never)]
fn clip(mesh: &UnitMesh, projection: &Projection, face: usize, batch: &mut Batch) {
    let near = f64::from(NEAR) * 1.001;
    let corners = mesh.faces[face].map(|index| {
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
    let corner = |p: &Vector3| [(p.x / p.z) as f32, (p.y / p.z) as f32, (1.0 / p.z) as f32];
    for i in 2..kept.len() {
        let corners = [corner(&kept[0]), corner(&kept[i - 1]), corner(&kept[i])];
        batch.push(corners, mesh.labels[face]);
    }
}
