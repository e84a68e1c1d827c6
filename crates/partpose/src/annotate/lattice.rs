//! A smooth field of displacements: values at the nodes of a lattice, linear in between.
//!
//! The field minimises the sum over pulls of `w [ (n . (u(p) - d))² + k |u(p) - d|² ]`, which draws points to planes
//! and a little to points, plus a stiffness times the squared second differences of the nodes, which bend nothing
//! that a shear or a stretch can do, plus a trace of the first differences, which keeps nodes without points in
//! place. This is the elastic sheet of Terzopoulos (*Regularization of inverse visual problems involving
//! discontinuities*, PAMI 1986) in space; the normal equations are solved by conjugate gradients.

use crate::geometry::{Point3, Vector3};

/// What draws the field at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    pub(super) point: Point3,
    /// The displacement that is wanted there.
    pub(super) wanted: Vector3,
    /// Unit vector along which it counts fully.
    pub(super) normal: Vector3,
    /// Share that counts across `normal`.
    pub(super) across: f64,
    pub(super) weight: f64,
}

/// The field.
#[derive(Clone, Debug)]
pub(super) struct Lattice {
    low: Point3,
    spacing: f64,
    counts: [usize; 3],
    values: Vec<Vector3>,
}

/// Conjugate gradients stop after this many rounds or when the residual has shrunk by [`SHRINK`].
const ROUNDS: usize = 400;
const SHRINK: f64 = 1e-6;
/// Weight of first differences, as a share of the stiffness.
const SHEAR: f64 = 0.02;
/// Keeps the system regular.
const TRACE: f64 = 1e-6;

impl Lattice {
    /// No displacement, over a box.
    pub(super) fn new(low: Point3, high: Point3, spacing: f64) -> Self {
        let count = |axis: usize| ((high[axis] - low[axis]) / spacing).ceil() as usize + 2;
        let counts = [count(0), count(1), count(2)];
        let values = vec![Vector3::zeros(); counts.iter().product()];
        Self { low, spacing, counts, values }
    }

    /// The displacement at a point; beyond the border, that of the border.
    pub(super) fn at(&self, point: &Point3) -> Vector3 {
        self.shares(point).iter().map(|(node, share)| self.values[*node] * *share).sum()
    }

    /// The nodes around a point with their shares.
    fn shares(&self, point: &Point3) -> [(usize, f64); 8] {
        let mut base = [0usize; 3];
        let mut share = [0.0; 3];
        for axis in 0..3 {
            let last = (self.counts[axis] - 2) as f64;
            let at = ((point[axis] - self.low[axis]) / self.spacing).clamp(0.0, last + 1.0);
            base[axis] = at.floor().min(last) as usize;
            share[axis] = at - base[axis] as f64;
        }
        std::array::from_fn(|corner| {
            let mut node = 0;
            let mut product = 1.0;
            for axis in 0..3 {
                let bit = corner >> axis & 1;
                node = node * self.counts[axis] + base[axis] + bit;
                product *= if bit == 1 { share[axis] } else { 1.0 - share[axis] };
            }
            (node, product)
        })
    }

    /// Finds the field anew, starting from the present one.
    pub(super) fn solve(&mut self, pulls: &[Pull], stiffness: f64) {
        let rows: Vec<_> = pulls.iter().map(|pull| (self.shares(&pull.point), *pull)).collect();
        let bends = self.differences();
        let apply = |values: &[Vector3]| -> Vec<Vector3> {
            let mut result: Vec<Vector3> = values.iter().map(|v| v * TRACE).collect();
            for (shares, pull) in &rows {
                let u: Vector3 = shares.iter().map(|(node, share)| values[*node] * *share).sum();
                let force = force(pull, &u);
                for (node, share) in shares {
                    result[*node] += force * *share;
                }
            }
            for (nodes, factors, weight) in &bends {
                let bend: Vector3 = nodes.iter().zip(factors).map(|(n, f)| values[*n] * *f).sum();
                for (node, factor) in nodes.iter().zip(factors) {
                    result[*node] += bend * (stiffness * weight * factor);
                }
            }
            result
        };
        let mut wanted = vec![Vector3::zeros(); self.values.len()];
        for (shares, pull) in &rows {
            let force = force(pull, &pull.wanted);
            for (node, share) in shares {
                wanted[*node] += force * *share;
            }
        }
        conjugate_gradients(&apply, &wanted, &mut self.values);
    }

    /// Second differences along each axis and, weakly, first ones: nodes, factors, weight.
    fn differences(&self) -> Vec<([usize; 3], [f64; 3], f64)> {
        let [nx, ny, nz] = self.counts;
        let strides = [ny * nz, nz, 1];
        let mut rows = Vec::new();
        for node in 0..self.values.len() {
            let at = [node / strides[0], node / nz % ny, node % nz];
            for axis in 0..3 {
                let (step, count) = (strides[axis], [nx, ny, nz][axis]);
                if at[axis] + 2 < count {
                    rows.push(([node, node + step, node + 2 * step], [1.0, -2.0, 1.0], 1.0));
                }
                if at[axis] + 1 < count {
                    rows.push(([node, node + step, node], [0.5, -1.0, 0.5], SHEAR));
                }
            }
        }
        rows
    }
}

fn force(pull: &Pull, u: &Vector3) -> Vector3 {
    (pull.normal * pull.normal.dot(u) + u * pull.across) * pull.weight
}

fn conjugate_gradients(
    apply: &dyn Fn(&[Vector3]) -> Vec<Vector3>,
    wanted: &[Vector3],
    values: &mut [Vector3],
) {
    let dot = |a: &[Vector3], b: &[Vector3]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
    let first = apply(values);
    let mut residual: Vec<Vector3> = wanted.iter().zip(&first).map(|(w, a)| w - a).collect();
    let mut direction = residual.clone();
    let mut square = dot(&residual, &residual);
    let enough = SHRINK * SHRINK * dot(wanted, wanted);
    for _ in 0..ROUNDS {
        if !(square > enough) {
            break;
        }
        let moved = apply(&direction);
        let length = square / dot(&direction, &moved);
        for i in 0..values.len() {
            values[i] += direction[i] * length;
            residual[i] -= moved[i] * length;
        }
        let next = dot(&residual, &residual);
        for (d, r) in direction.iter_mut().zip(&residual) {
            *d = r + *d * (next / square);
        }
        square = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_is_found_from_planes_alone() {
        let mut lattice =
            Lattice::new(Point3::new(0.0, -1.5, -2.0), Point3::new(1.0, 0.0, 2.0), 0.4);
        let shift = Vector3::new(0.03, -0.05, 0.1);
        let mut pulls = Vec::new();
        for i in 0..300 {
            let t = f64::from(i);
            let point = Point3::new(
                0.5 + 0.5 * (1.3 * t).sin(),
                -0.75 + 0.75 * (2.1 * t).sin(),
                2.0 * (0.7 * t).sin(),
            );
            let normal = [Vector3::x(), Vector3::y(), Vector3::z()][i as usize % 3];
            pulls.push(Pull { point, wanted: shift, normal, across: 0.0, weight: 1.0 });
        }
        lattice.solve(&pulls, 0.1);
        let found = lattice.at(&Point3::new(0.4, -0.6, 0.9));
        assert!((found - shift).norm() < 2e-3, "{found}");
    }
}
