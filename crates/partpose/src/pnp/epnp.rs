//! EPnP: the camera coordinates of four control points, from the null space of a linear system.
//!
//! Lepetit, Moreno-Noguer and Fua: *EPnP: An Accurate O(n) Solution to the PnP Problem*, IJCV 2009. The control points
//! are the centroid and one point along each principal axis. Each object point, written in their barycentric
//! coordinates, puts two linear equations on their camera coordinates; the solution is a combination of the weakest
//! N = 1..4 singular vectors whose control points keep their distances. Three control points when the points are flat.
//!
//! What differs from the public implementations:
//! - The null vectors are those of `M` in the metric of the noise. A pixel's error enters its equation times the depth
//!   of the point, so what noise adds to `M' M` is a multiple of `N = sum of alpha alpha'` on the depths of the control
//!   points and nothing on their x and y (the reasoning of Taubin, PAMI 1991). With control points at one standard
//!   deviation along the axes `N` is the identity and x and y follow from the depths in closed form, so `M x = 0` shrinks
//!   to a 4 x 4 eigenproblem, 3 x 3 for flat points. It is faster than 12 x 12, and the bias of the depth is gone.
//! - All four cases are solved, N = 4 by relinearisation, and four neighbours of case 1 are tried too.
//! - Gauss-Newton is damped and runs until it converges; a pose must have all points in front of the camera; the rotation
//!   is the nearest proper one.
//!
//! Limits: the constraints weigh distances, not pixels, so the result is not the most likely pose; with 4 or 5 points
//! the null space has several dimensions and failures are common. Refine it, or use [`super::sqpnp()`].

mod betas;

use nalgebra::{Matrix3, Vector3};

use super::{
    Correspondence, PnpError, centroid, check,
    linalg::{nearest_rotation, symmetric_eigen},
    linear::{Nine, principal_axes},
};
use crate::geometry::{Camera, Pose};
use betas::Distances;

/// Fewest correspondences.
const MIN_POINTS: usize = 4;
/// Third spread over first spread below which three control points are used alone.
const FLAT: f64 = 1e-3;
/// Third spread over first spread below which three control points are tried too.
const NEARLY_FLAT: f64 = 0.1;

/// Solves for `camera_from_object` with EPnP; at least 4 correspondences, not all on a line.
pub fn epnp(correspondences: &[Correspondence], camera: &Camera) -> Result<Pose, PnpError> {
    check(correspondences, camera, MIN_POINTS)?;
    let system = System::new(correspondences, camera)?;
    let mut best = Candidates { correspondences, camera, system: &system, best: None };
    let flatness = system.spread[2];
    if flatness > FLAT {
        let weakest = system.null_vectors::<4>();
        let (vectors, lengths) = system.for_distances(&weakest);
        let distances = Distances::<4, 6>::new(&vectors, &lengths);
        for betas in distances.minima(distances.starts_of_four()) {
            best.offer(&combine(&weakest, &betas));
        }
    }
    if flatness < NEARLY_FLAT {
        let weakest = system.null_vectors::<3>();
        let (vectors, lengths) = system.for_distances(&weakest);
        let distances = Distances::<3, 3>::new(&vectors, &lengths);
        for betas in distances.minima(distances.starts_of_three()) {
            best.offer(&combine(&weakest, &betas));
        }
    }
    let (_, pose) = best.best.ok_or(PnpError::BehindCamera)?;
    // A point within rounding of the camera's plane may have changed sides when the matrix became a quaternion.
    let in_front = correspondences.iter().all(|c| (pose * c.point_in_object).z > 0.0);
    if in_front { Ok(pose) } else { Err(PnpError::BehindCamera) }
}

/// Camera coordinates of the centroid, then of the three other control points relative to it; 3 numbers each.
type Control = [f64; 12];

/// The linear system, with the x and y coordinates of the control points eliminated.
struct System {
    /// Centroid of the object points, metres.
    center: Vector3<f64>,
    /// Principal axes as columns.
    axes: Matrix3<f64>,
    /// Standard deviations along the axes over the first.
    spread: [f64; 3],
    /// Metres in one unit of length.
    scale: f64,
    /// Mean ray.
    mean: [f64; 2],
    /// Mean of `u alpha alpha'` and of `v alpha alpha'`, relative to the mean ray.
    across: [[[f64; 4]; 4]; 2],
    /// What is left of the squared error as a form in the depths of the control points.
    depth_form: [[f64; 4]; 4],
}

impl System {
    fn new(correspondences: &[Correspondence], camera: &Camera) -> Result<Self, PnpError> {
        let n = correspondences.len() as f64;
        let center = centroid(correspondences);
        let (axes, spread) = principal_axes(correspondences, &center)?;
        let scale = spread[0];
        // Control point j lies at one standard deviation along axis j, so that the coordinates are uncorrelated.
        let inverse = spread.map(|s| if s > FLAT * scale { 1.0 / s } else { 0.0 });
        let to_alpha = Matrix3::from_diagonal(&Vector3::from(inverse)) * axes.transpose();
        let inverse_focal = [1.0 / camera.focal[0], 1.0 / camera.focal[1]];
        let ray = |c: &Correspondence| {
            let pixel = c.point_in_image;
            let [cx, cy] = camera.principal_point;
            [(pixel.x - cx) * inverse_focal[0], (pixel.y - cy) * inverse_focal[1]]
        };
        let mut mean = [0.0; 2];
        for c in correspondences {
            let [u, v] = ray(c);
            mean[0] += u / n;
            mean[1] += v / n;
        }
        let mut across = [[[0.0; 4]; 4]; 2];
        let mut squares = [[0.0; 4]; 4];
        for c in correspondences {
            let a = to_alpha * (c.point_in_object.coords - center);
            let alpha = [1.0, a.x, a.y, a.z];
            let [u, v] = ray(c);
            let (u, v) = (u - mean[0], v - mean[1]);
            let r = u * u + v * v;
            for i in 0..4 {
                for j in 0..=i {
                    let product = alpha[i] * alpha[j];
                    across[0][i][j] += product * u;
                    across[1][i][j] += product * v;
                    squares[i][j] += product * r;
                }
            }
        }
        for matrix in across.iter_mut().chain([&mut squares]) {
            for i in 0..4 {
                for j in 0..=i {
                    matrix[i][j] /= n;
                    matrix[j][i] = matrix[i][j];
                }
            }
        }
        let mut depth_form = squares;
        for (i, row) in depth_form.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                for k in 0..4 {
                    *entry -= across[0][i][k] * across[0][k][j] + across[1][i][k] * across[1][k][j];
                }
            }
        }
        let spread = spread.map(|s| s / scale);
        let usable = depth_form.iter().flatten().all(|value| value.is_finite());
        let system = Self { center, axes, spread, scale, mean, across, depth_form };
        if usable { Ok(system) } else { Err(PnpError::Degenerate) }
    }

    /// The weakest combinations of the first `K` control points, weakest first.
    fn null_vectors<const K: usize>(&self) -> [Control; K] {
        let form: [[f64; K]; K] =
            std::array::from_fn(|i| std::array::from_fn(|j| self.depth_form[i][j]));
        let (_, vectors) = symmetric_eigen(form);
        vectors.map(|depths| {
            let mut control = [0.0; 12];
            for i in 0..K {
                let z = depths[i];
                let (mut x, mut y) = (self.mean[0] * z, self.mean[1] * z);
                for k in 0..K {
                    x += self.across[0][i][k] * depths[k];
                    y += self.across[1][i][k] * depths[k];
                }
                control[3 * i..3 * i + 3].copy_from_slice(&[x, y, z]);
            }
            control
        })
    }

    /// Control points relative to the centroid and their distances from it, as the constraints weigh them.
    ///
    /// Each axis counts by the root of its spread: plain distances neglect the short axes, whose control points the
    /// null vectors fix just as well, and equal ones overrate them.
    fn for_distances<const K: usize>(&self, vectors: &[Control; K]) -> ([Nine; K], [f64; 3]) {
        let lengths = self.spread.map(|s| s.max(FLAT).sqrt());
        let inverse = lengths.map(|length| 1.0 / length);
        (vectors.map(|v| std::array::from_fn(|i| v[3 + i] * inverse[i / 3])), lengths)
    }
}

fn combine<const K: usize>(vectors: &[Control; K], betas: &[f64; K]) -> Control {
    let mut x = [0.0; 12];
    for (vector, beta) in vectors.iter().zip(betas) {
        for (sum, entry) in x.iter_mut().zip(vector) {
            *sum += beta * entry;
        }
    }
    x
}

/// The best pose so far.
struct Candidates<'a> {
    correspondences: &'a [Correspondence],
    camera: &'a Camera,
    system: &'a System,
    best: Option<(f64, Pose)>,
}

impl Candidates<'_> {
    /// Turns control points into a pose and keeps it if it reprojects best.
    fn offer(&mut self, control: &Control) {
        let system = self.system;
        // The null vectors' sign is arbitrary; the depth of the centroid is the mean of all depths.
        let sign = if control[2] < 0.0 { -1.0 } else { 1.0 };
        // The alignment of all points depends on the control points alone: axis j counts by its spread.
        let column = |j: usize| {
            let c = Vector3::new(control[3 * j], control[3 * j + 1], control[3 * j + 2]);
            c * (sign * if j == 0 { system.scale } else { system.spread[j - 1] })
        };
        let correlation = Matrix3::from_columns(&[column(1), column(2), column(3)]);
        let Some(camera_from_axes) = nearest_rotation(&correlation) else { return };
        let rotation = camera_from_axes.to_rotation_matrix();
        let camera_from_object = rotation.matrix() * system.axes.transpose();
        let translation = column(0) - camera_from_object * system.center;
        let limit = self.best.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        let cost = self.cost(&camera_from_object, &translation, limit);
        if cost < limit {
            let rotation = nalgebra::Rotation3::from_matrix_unchecked(camera_from_object);
            let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
            self.best = Some((cost, Pose::from_parts(translation.into(), rotation)));
        }
    }

    /// Sum of squared pixel distances; infinite for a point behind the camera, anything above `limit` beyond it.
    fn cost(&self, rotation: &Matrix3<f64>, translation: &Vector3<f64>, limit: f64) -> f64 {
        let camera = self.camera;
        let mut cost = 0.0;
        for c in self.correspondences {
            let p = rotation * c.point_in_object.coords + translation;
            if !(p.z > 0.0) {
                return f64::INFINITY;
            }
            let inverse = 1.0 / p.z;
            let dx =
                camera.focal[0] * p.x * inverse + camera.principal_point[0] - c.point_in_image.x;
            let dy =
                camera.focal[1] * p.y * inverse + camera.principal_point[1] - c.point_in_image.y;
            cost += dx * dx + dy * dy;
            if !(cost < limit) {
                return f64::INFINITY;
            }
        }
        cost
    }
}
