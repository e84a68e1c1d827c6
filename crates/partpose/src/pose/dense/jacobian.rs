//! The derivative of the class fractions from one picture.
//!
//! Fractions of samples are piecewise constant in the pose, but the area that a label covers in a fixed cell is not, and
//! its derivative is the flux of the label's boundary: `A df/dtheta = closed integral of (v . n) ds`, with v the image
//! velocity of the boundary and `v . n ds = v_x dy - v_y dx`. So every pair of neighbouring samples with different
//! labels is an edge that carries `v_x` times a sample's height (side by side) or `v_y` times its width (one above the
//! other). The nearer sample owns the edge; background is infinitely far. One loop covers outlines, self-occlusion and
//! the seams between parts; the borders of cells carry nothing, they do not move.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use nalgebra::{SMatrix, SVector};
use pulp::{Simd, WithSimd};

use crate::geometry::{Camera, Vector3};

use super::cell::{self, Packed};
use super::raster::Raster;
use super::state::{PARAMETERS, State};
use super::target::{LANES, Target};
use super::vector;

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
    /// Change of the label's share of the cell with each increment.
    pub(super) by: [f32; PARAMETERS],
}

const NONE: u32 = u32::MAX;
/// Increments rounded up to whole vectors: without and with sizes.
const WIDTHS: [usize; 2] = [8, 16];

/// Buffers that are kept from one picture to the next. Slopes of a cell are a list that begins at its head.
#[derive(Clone, Debug, Default)]
pub(super) struct Flux {
    heads: Vec<u32>,
    /// Of each slope its label and the next one of its cell.
    links: Vec<(u8, u32)>,
    /// Of each slope `width` numbers.
    values: Vec<f32>,
    width: usize,
    /// The cell of each sample of a row.
    columns: Vec<u32>,
}

impl Flux {
    /// The slopes of one cell.
    pub(super) fn of_cell(&self, cell: usize) -> impl Iterator<Item = Slope> + '_ {
        let mut at = self.heads[cell];
        std::iter::from_fn(move || {
            let (label, next) = *self.links.get(at as usize)?;
            let values = &self.values[at as usize * self.width..];
            at = next;
            let by = std::array::from_fn(|i| if i < self.width { values[i] } else { 0.0 });
            Some(Slope { label, by })
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
        let s = cell::side(raster, target.cells);
        self.heads.clear();
        self.heads.resize(target.cells * target.cells, NONE);
        self.links.clear();
        self.values.clear();
        self.columns.clear();
        self.columns.extend((0..raster.size).map(|x| (x / s) as u32));
        let velocity = Velocity::new(camera, state, s);
        self.width = WIDTHS[usize::from(count > 6)];
        if count > 6 {
            vector::dispatch(Walk::<16> { flux: self, target, raster, velocity });
        } else {
            vector::dispatch(Walk::<8> { flux: self, target, raster, velocity });
        }
    }

    #[inline(always)]
    fn add<const W: usize>(&mut self, cell: usize, label: u8, j: &[f32; W], share: f32) {
        let mut at = self.heads[cell];
        while let Some((other, next)) = self.links.get(at as usize) {
            if *other == label {
                let values = &mut self.values[at as usize * W..][..W];
                for (value, j) in values.iter_mut().zip(j) {
                    *value += share * j;
                }
                return;
            }
            at = *next;
        }
        let at = self.links.len() as u32;
        self.links.push((label, self.heads[cell]));
        let mut values = *j;
        for value in &mut values {
            *value *= share;
        }
        self.values.extend_from_slice(&values);
        self.heads[cell] = at;
    }

    /// Sums `w J J'` and `w J (f - q)` over cells and labels. A label without an edge in a cell has no slope there.
    pub(super) fn normal_equations(&self, target: &Target, raster: &Raster) -> NormalEquations {
        match (self.width, cell::side(raster, target.cells)) {
            (8, 2) => vector::dispatch(Sum::<8, 2> { flux: self, target, raster }),
            (8, 4) => vector::dispatch(Sum::<8, 4> { flux: self, target, raster }),
            (8, _) => vector::dispatch(Sum::<8, 0> { flux: self, target, raster }),
            (_, 2) => vector::dispatch(Sum::<16, 2> { flux: self, target, raster }),
            (_, 4) => vector::dispatch(Sum::<16, 4> { flux: self, target, raster }),
            _ => vector::dispatch(Sum::<16, 0> { flux: self, target, raster }),
        }
    }
}

/// The walk over all edges, with `W` numbers each.
struct Walk<'a, const W: usize> {
    flux: &'a mut Flux,
    target: &'a Target,
    raster: &'a Raster,
    velocity: Velocity,
}

impl<const W: usize> WithSimd for Walk<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) {
        let raster = self.raster;
        let (n, m) = (raster.size, self.target.cells);
        let s = n / m;
        let labels = &raster.labels;
        for y in 0..n {
            let row = &labels[y * n..(y + 1) * n];
            let line = (y / s) * m;
            different(&row[..n - 1], &row[1..], |x| {
                let columns = &self.flux.columns[x..x + 2];
                let cells = [line + columns[0] as usize, line + columns[1] as usize];
                self.edge::<0>([x, y], [x + 1, y], cells, [row[x], row[x + 1]]);
            });
            if y + 1 < n {
                let below = &labels[(y + 1) * n..(y + 2) * n];
                let next = ((y + 1) / s) * m;
                different(row, below, |x| {
                    let column = self.flux.columns[x] as usize;
                    let cells = [line + column, next + column];
                    self.edge::<1>([x, y], [x, y + 1], cells, [row[x], below[x]]);
                });
            }
        }
    }
}

impl<const W: usize> Walk<'_, W> {
    /// The edge belongs half to each sample's cell; the first label gains what the second loses.
    #[inline(always)]
    fn edge<const AXIS: usize>(
        &mut self,
        a: [usize; 2],
        b: [usize; 2],
        cells: [usize; 2],
        labels: [u8; 2],
    ) {
        let weights = [self.target.weights[cells[0]], self.target.weights[cells[1]]];
        if weights[0] == 0.0 && weights[1] == 0.0 {
            return;
        }
        let keys = [self.raster.inverse_depth(a[0], a[1]), self.raster.inverse_depth(b[0], b[1])];
        let (owner, inverse) = if keys[0] >= keys[1] { (a, keys[0]) } else { (b, keys[1]) };
        let j = self.velocity.along::<AXIS, W>(owner, inverse);
        if cells[0] == cells[1] {
            self.flux.add(cells[0], labels[0], &j, 1.0);
            self.flux.add(cells[0], labels[1], &j, -1.0);
            return;
        }
        for (cell, weight) in cells.into_iter().zip(weights) {
            if weight != 0.0 {
                self.flux.add(cell, labels[0], &j, 0.5);
                self.flux.add(cell, labels[1], &j, -0.5);
            }
        }
    }
}

/// The sum over cells of S x S samples, any number if S is 0, of slopes of W numbers.
struct Sum<'a, const W: usize, const S: usize> {
    flux: &'a Flux,
    target: &'a Target,
    raster: &'a Raster,
}

impl<const W: usize, const S: usize> WithSimd for Sum<'_, W, S> {
    type Output = NormalEquations;

    #[inline(always)]
    fn with_simd<V: Simd>(self, _: V) -> NormalEquations {
        let Self { flux, target, raster } = self;
        let m = target.cells;
        let mut hessian = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
        let mut gradient = SVector::<f64, PARAMETERS>::zeros();
        let most = PARAMETERS.min(W);
        for line in 0..m {
            // Single precision within a row of cells.
            let (mut squares, mut products) = ([[0.0f32; W]; PARAMETERS], [0.0f32; W]);
            let mut any = false;
            for cell in line * m..(line + 1) * m {
                let mut at = flux.heads[cell];
                if at == NONE {
                    continue;
                }
                any = true;
                let weight = target.weights[cell];
                let start = cell::start(raster, m, cell);
                while let Some((label, next)) = flux.links.get(at as usize) {
                    let share = match S {
                        2 => share::<2>(raster, start, *label),
                        4 => share::<4>(raster, start, *label),
                        _ => fraction(raster, m, cell, *label),
                    };
                    let q = target.probabilities[cell][usize::from(*label) & (LANES - 1)];
                    let residual = weight * (share - q);
                    let mut by = [0.0f32; W];
                    by.copy_from_slice(&flux.values[at as usize * W..][..W]);
                    for i in 0..most {
                        let weighted = weight * by[i];
                        for k in 0..W {
                            squares[i][k] += weighted * by[k];
                        }
                    }
                    for k in 0..W {
                        products[k] += residual * by[k];
                    }
                    at = *next;
                }
            }
            if any {
                for i in 0..most {
                    gradient[i] += f64::from(products[i]);
                    for k in 0..=i {
                        hessian[(i, k)] += f64::from(squares[i][k]);
                    }
                }
            }
        }
        hessian.fill_upper_triangle_with_lower_triangle();
        NormalEquations { hessian, gradient }
    }
}

#[inline(always)]
fn share<const S: usize>(raster: &Raster, start: usize, label: u8) -> f32 {
    Packed::<S>::new(&raster.labels, raster.size, start).count(label) as f32 / (S * S) as f32
}

/// The share of a cell's samples that bear a label.
pub(super) fn fraction(raster: &Raster, cells: usize, cell: usize, label: u8) -> f32 {
    let s = cell::side(raster, cells);
    let start = cell::start(raster, cells, cell);
    let mut count = 0u32;
    for y in 0..s {
        let row = &raster.labels[start + y * raster.size..][..s];
        count += row.iter().map(|other| u32::from(*other == label)).sum::<u32>();
    }
    count as f32 / (s * s) as f32
}

/// Calls `found` with every index at which two rows differ; eight at a time are compared, the last eight again.
#[inline(always)]
fn different(a: &[u8], b: &[u8], mut found: impl FnMut(usize)) {
    let length = a.len().min(b.len());
    let word = |row: &[u8], at: usize| {
        row.get(at..at + 8).and_then(|row| row.try_into().ok()).map_or(0, u64::from_le_bytes)
    };
    for from in (0..length).step_by(8) {
        let at = from.min(length.saturating_sub(8));
        let mut difference = (word(a, at) ^ word(b, at)) & (u64::MAX << (8 * (from - at)));
        while difference != 0 {
            let byte = difference.trailing_zeros() as usize / 8;
            found(at + byte);
            difference &= !(0xff << (8 * byte));
        }
    }
}

/// Image velocities of points of the vehicle, by the increments.
struct Velocity {
    focal: [f32; 2],
    inverse_focal: [f32; 2],
    principal_point: [f32; 2],
    center: [f32; 3],
    /// Columns of the rotation matrix.
    axes: [[f32; 3]; 3],
    /// A sample's side over a cell's area, samples.
    per_cell: f32,
}

impl Velocity {
    fn new(camera: &Camera, state: &State, s: usize) -> Self {
        let rotation = state.rotation.to_rotation_matrix();
        let column = |i: usize| {
            let axis: Vector3 = rotation.matrix().column(i).into();
            [axis.x as f32, axis.y as f32, axis.z as f32]
        };
        Self {
            focal: camera.focal.map(|f| f as f32),
            inverse_focal: camera.focal.map(|f| (1.0 / f) as f32),
            principal_point: camera.principal_point.map(|c| c as f32),
            center: [state.center.x as f32, state.center.y as f32, state.center.z as f32],
            axes: [column(0), column(1), column(2)],
            per_cell: 1.0 / (s * s) as f32,
        }
    }

    /// What an edge between two neighbouring samples carries, if the nearer of them is `owner` with this 1 / z; `AXIS`
    /// is 0 for one beside the other, 1 for one above it.
    #[inline(always)]
    fn along<const AXIS: usize, const W: usize>(
        &self,
        owner: [usize; 2],
        inverse: f32,
    ) -> [f32; W] {
        let z = 1.0 / inverse;
        let ray = [
            (owner[0] as f32 - self.principal_point[0]) * self.inverse_focal[0],
            (owner[1] as f32 - self.principal_point[1]) * self.inverse_focal[1],
        ];
        let c = &self.center;
        let y = [z * ray[0] - c[0], z * ray[1] - c[1], z - c[2]];
        let scale = self.focal[AXIS] * inverse * self.per_cell;
        // The velocity along the axis of a displacement d: focal (d_axis - ray_axis d_z) / z.
        let r = ray[AXIS];
        let mut j = [0.0; W];
        if AXIS == 0 {
            j[0] = -r * y[1];
            j[1] = y[2] + r * y[0];
            j[2] = -y[1];
            j[3] = 1.0;
        } else {
            j[0] = -y[2] - r * y[1];
            j[1] = r * y[0];
            j[2] = y[0];
            j[4] = 1.0;
        }
        j[5] = c[AXIS] - r * c[2];
        if W > 8 {
            for (i, axis) in self.axes.iter().enumerate() {
                let height = axis[0] * y[0] + axis[1] * y[1] + axis[2] * y[2];
                j[6 + i] = (axis[AXIS] - r * axis[2]) * height;
            }
        }
        for value in &mut j {
            *value *= scale;
        }
        j
    }
}
