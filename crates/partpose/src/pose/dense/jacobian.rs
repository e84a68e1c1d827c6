//! The derivative of the class fractions from one picture.
//!
//! Fractions of samples are piecewise constant in the pose, but the area that a label covers in a fixed cell is not, and
//! its derivative is the flux of the label's boundary: `A df/dtheta = closed integral of (v . n) ds`, with v the image
//! velocity of the boundary and `v . n ds = v_x dy - v_y dx`. So every pair of neighbouring samples with different
//! labels is an edge that carries `v_x` times a sample's height (side by side) or `v_y` times its width (one above the
//! other). The nearer sample owns the edge; background is infinitely far. One loop covers outlines, self-occlusion and
//! the seams between parts; the borders of cells carry nothing, they do not move.

use nalgebra::{SMatrix, SVector};

use crate::geometry::{Camera, Vector3};

use super::raster::Raster;
use super::state::{PARAMETERS, State};
use super::target::Target;

/// Second derivative (Gauss-Newton) and gradient of the data term.
#[derive(Clone, Copy, Debug)]
pub(super) struct NormalEquations {
    pub(super) hessian: SMatrix<f64, PARAMETERS, PARAMETERS>,
    pub(super) gradient: SVector<f64, PARAMETERS>,
}

/// One label's derivative in one cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slope {
    pub(super) label: u8,
    next: u32,
    /// Change of the label's share of the cell with each increment.
    pub(super) by: [f32; PARAMETERS],
}

const NONE: u32 = u32::MAX;

/// Buffers that are kept from one picture to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct Flux {
    heads: Vec<u32>,
    slopes: Vec<Slope>,
}

impl Flux {
    /// The slopes of one cell.
    pub(super) fn of_cell(&self, cell: usize) -> impl Iterator<Item = &Slope> {
        let mut at = self.heads[cell];
        std::iter::from_fn(move || {
            let slope = self.slopes.get(at as usize)?;
            at = slope.next;
            Some(slope)
        })
    }

    /// Walks the edges of the last picture of `raster`. `camera` is that of the samples; `count` is how many of the
    /// increments matter, 6 or 9.
    pub(super) fn collect(
        &mut self,
        target: &Target,
        raster: &Raster,
        camera: &Camera,
        state: &State,
        count: usize,
    ) {
        let (n, m) = (raster.size, target.cells);
        let s = n / m;
        self.heads.clear();
        self.heads.resize(m * m, NONE);
        self.slopes.clear();
        let velocity = Velocity::new(camera, state, s, count);
        let cell_of = |x: usize, y: usize| (y / s) * m + x / s;
        let labels = &raster.labels;
        for y in 0..n {
            let row = &labels[y * n..(y + 1) * n];
            different(&row[..n - 1], &row[1..], |x| {
                let j = velocity.edge::<0>(raster, [x, y], [x + 1, y]);
                let (a, b) = (row[x], row[x + 1]);
                self.add(target, [cell_of(x, y), cell_of(x + 1, y)], [a, b], &j);
            });
            if y + 1 < n {
                let below = &labels[(y + 1) * n..(y + 2) * n];
                different(row, below, |x| {
                    let j = velocity.edge::<1>(raster, [x, y], [x, y + 1]);
                    let (a, b) = (row[x], below[x]);
                    self.add(target, [cell_of(x, y), cell_of(x, y + 1)], [a, b], &j);
                });
            }
        }
    }

    /// The edge belongs half to each sample's cell; the first label gains what the second loses.
    fn add(&mut self, target: &Target, cells: [usize; 2], labels: [u8; 2], j: &[f32; PARAMETERS]) {
        let (counted, share) =
            if cells[0] == cells[1] { (&cells[..1], 1.0) } else { (&cells[..], 0.5) };
        for cell in counted {
            if target.weights[*cell] == 0.0 {
                continue;
            }
            for (label, sign) in [(labels[0], share), (labels[1], -share)] {
                let slope = self.slope(*cell, label);
                for (by, j) in slope.by.iter_mut().zip(j) {
                    *by += sign * j;
                }
            }
        }
    }

    fn slope(&mut self, cell: usize, label: u8) -> &mut Slope {
        let mut at = self.heads[cell];
        while at != NONE && self.slopes[at as usize].label != label {
            at = self.slopes[at as usize].next;
        }
        if at == NONE {
            at = self.slopes.len() as u32;
            let next = self.heads[cell];
            self.slopes.push(Slope { label, next, by: [0.0; PARAMETERS] });
            self.heads[cell] = at;
        }
        &mut self.slopes[at as usize]
    }

    /// Sums `w J J'` and `w J (f - q)` over cells and labels. A label without an edge in a cell has no slope there.
    pub(super) fn normal_equations(
        &self,
        target: &Target,
        raster: &Raster,
        count: usize,
    ) -> NormalEquations {
        let mut hessian = [[0.0f64; PARAMETERS]; PARAMETERS];
        let mut gradient = [0.0f64; PARAMETERS];
        for cell in 0..target.cells * target.cells {
            if self.heads[cell] == NONE {
                continue;
            }
            let weight = f64::from(target.weights[cell]);
            for slope in self.of_cell(cell) {
                let q = target.probabilities[cell][usize::from(slope.label)];
                let residual = f64::from(fraction(raster, target.cells, cell, slope.label) - q);
                let by = slope.by.map(f64::from);
                for i in 0..count {
                    let weighted = weight * by[i];
                    gradient[i] += weighted * residual;
                    for j in 0..=i {
                        hessian[i][j] += weighted * by[j];
                    }
                }
            }
        }
        let at = |i: usize, j: usize| if j <= i { hessian[i][j] } else { hessian[j][i] };
        NormalEquations { hessian: SMatrix::from_fn(at), gradient: SVector::from(gradient) }
    }
}

/// The share of a cell's samples that bear a label.
pub(super) fn fraction(raster: &Raster, cells: usize, cell: usize, label: u8) -> f32 {
    let s = raster.size / cells;
    let start = (cell / cells) * s * raster.size + (cell % cells) * s;
    let mut count = 0u32;
    for y in 0..s {
        let row = &raster.labels[start + y * raster.size..][..s];
        count += row.iter().map(|other| u32::from(*other == label)).sum::<u32>();
    }
    count as f32 / (s * s) as f32
}

/// Calls `found` with every index at which two rows differ; eight at a time are compared.
#[inline]
fn different(a: &[u8], b: &[u8], mut found: impl FnMut(usize)) {
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (i, (a, b)) in a8.iter().zip(b8).enumerate() {
        let mut difference = u64::from_le_bytes(*a) ^ u64::from_le_bytes(*b);
        while difference != 0 {
            let at = difference.trailing_zeros() as usize / 8;
            found(8 * i + at);
            difference &= !(0xff << (8 * at));
        }
    }
    let done = 8 * a8.len();
    for (i, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        if a != b {
            found(done + i);
        }
    }
}

/// Image velocities of points of the vehicle, by the increments.
struct Velocity {
    focal: [f32; 2],
    principal_point: [f32; 2],
    center: [f32; 3],
    /// Columns of the rotation matrix.
    axes: [[f32; 3]; 3],
    /// A sample's side over a cell's area, samples.
    per_cell: f32,
    with_size: bool,
}

impl Velocity {
    fn new(camera: &Camera, state: &State, s: usize, count: usize) -> Self {
        let rotation = state.rotation.to_rotation_matrix();
        let column = |i: usize| {
            let axis: Vector3 = rotation.matrix().column(i).into();
            [axis.x as f32, axis.y as f32, axis.z as f32]
        };
        Self {
            focal: camera.focal.map(|f| f as f32),
            principal_point: camera.principal_point.map(|c| c as f32),
            center: [state.center.x as f32, state.center.y as f32, state.center.z as f32],
            axes: [column(0), column(1), column(2)],
            per_cell: 1.0 / (s * s) as f32,
            with_size: count > 6,
        }
    }

    /// What an edge between two neighbouring samples carries; `AXIS` is 0 for one beside the other, 1 for one above it.
    #[inline]
    fn edge<const AXIS: usize>(
        &self,
        raster: &Raster,
        a: [usize; 2],
        b: [usize; 2],
    ) -> [f32; PARAMETERS] {
        let key = |p: [usize; 2]| raster.inverse_depth(p[1] * raster.size + p[0]);
        let (key_a, key_b) = (key(a), key(b));
        let (owner, inverse) = if key_a >= key_b { (a, key_a) } else { (b, key_b) };
        let z = 1.0 / inverse;
        let ray = [
            (owner[0] as f32 - self.principal_point[0]) / self.focal[0],
            (owner[1] as f32 - self.principal_point[1]) / self.focal[1],
        ];
        let point = [z * ray[0], z * ray[1], z];
        let y = [0, 1, 2].map(|i| point[i] - self.center[i]);
        let scale = self.focal[AXIS] * inverse * self.per_cell;
        // The velocity along the axis of a displacement d: focal (d_axis - ray_axis d_z) / z.
        let along = |d: [f32; 3]| scale * (d[AXIS] - ray[AXIS] * d[2]);
        let mut j = [0.0; PARAMETERS];
        j[0] = along([0.0, -y[2], y[1]]);
        j[1] = along([y[2], 0.0, -y[0]]);
        j[2] = along([-y[1], y[0], 0.0]);
        j[3] = along([1.0, 0.0, 0.0]);
        j[4] = along([0.0, 1.0, 0.0]);
        j[5] = along(self.center);
        if self.with_size {
            for (i, axis) in self.axes.iter().enumerate() {
                let height = axis[0] * y[0] + axis[1] * y[1] + axis[2] * y[2];
                j[6 + i] = along([axis[0] * height, axis[1] * height, axis[2] * height]);
            }
        }
        j
    }
}
