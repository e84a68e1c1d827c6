//! SQPnP: all minima of the algebraic error over the rotations.
//!
//! Terzakis and Lourakis: *A Consistently Fast and Globally Optimal Solution to the Perspective-n-Point Problem*, ECCV
//! 2020. The squared error of the rows of the linear form, translation eliminated, is a quadratic form in the nine
//! entries of the rotation. Its minima under orthonormality are found by sequential quadratic programming from the
//! rotations nearest to plus and minus the form's weakest eigenvectors.
//!
//! Here each quadratic programme is solved in the tangent space of the rotations, which is the null space of the
//! constraints' Jacobian in closed form, with the exact second derivative and a damping that keeps every step a descent:
//! the same minima, in three unknowns instead of nine with six multipliers. Two kinds of start are added, because weak
//! eigenvectors of nearly flat points speak mostly of the normal: eigenvectors of the in-plane part alone, and each
//! minimum mirrored about its line of sight.
//!
//! Limits: the error weighs points by depth, so that the depth is biased when the noise is large; refine the result.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{
    Correspondence, PnpError, check,
    linalg::{nearest_rotation, solve_positive, symmetric_eigen},
    linear::{LinearForm, Nine},
    modes::mirror,
};
use crate::geometry::{Camera, Pose};

/// Fewest correspondences.
const MIN_POINTS: usize = 3;
/// Steps from one start; 4 to 8 are usual.
const MAX_STEPS: usize = 30;
/// Rotation, radians, below which a step ends the descent; convergence is quadratic, so the error is its square.
const CONVERGED: f64 = 1e-6;
/// A descent that comes this close (radians) to a known minimum is heading for it.
const SAME: f64 = 0.02;
/// Third spread over first spread below which the in-plane part gives starts of its own.
const NEARLY_FLAT: f64 = 0.1;
/// Most minima that are told apart; quadrics on rotations have at most 8 of practical interest.
const MAX_MINIMA: usize = 8;

/// A pose with the algebraic error at it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlgebraicMinimum {
    /// `camera_from_object`.
    pub pose: Pose,
    /// Sum of squares of `x - u z` and `y - v z`, square metres.
    pub error: f64,
}

/// All distinct minima with every point in front of the camera, least error first; never an empty list.
///
/// At least 3 correspondences; with 3 or 4, or with nearly flat points, expect several.
pub fn sqpnp(
    correspondences: &[Correspondence],
    camera: &Camera,
) -> Result<Vec<AlgebraicMinimum>, PnpError> {
    check(correspondences, camera, MIN_POINTS)?;
    let form = LinearForm::new(correspondences, camera)?;
    let minima = Minima::find(&form);
    let unit = form.scale * form.scale * correspondences.len() as f64;
    let mut result = Vec::with_capacity(minima.len);
    for minimum in &minima.found[..minima.len] {
        let pose = form.pose(&minimum.rotation);
        if correspondences.iter().all(|c| (pose * c.point_in_object).z > 0.0) {
            result.push(AlgebraicMinimum { pose, error: minimum.error * unit });
        }
    }
    result.sort_by(|a, b| a.error.total_cmp(&b.error));
    if result.is_empty() { Err(PnpError::BehindCamera) } else { Ok(result) }
}

impl LinearForm {
    /// The pose with the rotation `camera_from_axes` and the translation that suits it best.
    fn pose(&self, camera_from_axes: &Matrix3<f64>) -> Pose {
        let center = self.centroid_in_camera(&columns(camera_from_axes)) * self.scale;
        let rotation = camera_from_axes * self.axes.transpose();
        let translation = center - rotation * self.center;
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        Pose::from_parts(translation.into(), rotation)
    }
}

#[derive(Clone, Copy)]
struct Minimum {
    rotation: Matrix3<f64>,
    error: f64,
}

struct Minima {
    found: [Minimum; MAX_MINIMA],
    len: usize,
    /// Least error of those with the centroid in front of the camera.
    least: f64,
}

impl Minima {
    fn find(form: &LinearForm) -> Self {
        let nothing = Minimum { rotation: Matrix3::identity(), error: f64::INFINITY };
        let mut minima = Self { found: [nothing; MAX_MINIMA], len: 0, least: f64::INFINITY };
        if form.spread[2] < NEARLY_FLAT {
            let in_plane: [[f64; 6]; 6] =
                std::array::from_fn(|i| std::array::from_fn(|j| form.omega[i][j]));
            let (values, vectors) = symmetric_eigen(in_plane);
            for (value, v) in values.iter().zip(&vectors) {
                // Two of the unit columns: their form is at least twice the eigenvalue.
                if 2.0 * value > minima.least {
                    break;
                }
                let x = [v[0], v[1], v[2], v[3], v[4], v[5], 0.0, 0.0, 0.0];
                minima.descend_from_both_signs(form, &x);
            }
        }
        if minima.len == 0 || form.spread[2] >= NEARLY_FLAT {
            let (values, vectors) = symmetric_eigen(form.omega);
            for (value, x) in values.iter().zip(&vectors) {
                // Three unit columns: no rotation has less than three times the eigenvalue in what is left.
                if 3.0 * value > minima.least {
                    break;
                }
                minima.descend_from_both_signs(form, x);
            }
        }
        for i in 0..minima.len.min(2) {
            let first = minima.found[i].rotation;
            let center = form.centroid_in_camera(&columns(&first));
            if let Some(turn) = mirror(&first.column(2).into_owned(), &center) {
                minima.descend(form, turn.to_rotation_matrix().matrix() * first);
            }
        }
        minima
    }

    fn descend_from_both_signs(&mut self, form: &LinearForm, x: &Nine) {
        let m = Matrix3::from_column_slice(x);
        for m in [m, -m] {
            if let Some(rotation) = nearest_rotation(&m) {
                self.descend(form, *rotation.to_rotation_matrix().matrix());
            }
        }
    }

    fn descend(&mut self, form: &LinearForm, start: Matrix3<f64>) {
        // The Frobenius norm of a difference of rotations is the root of 2 times the angle between them.
        let same = |m: &Minimum, rotation: &Matrix3<f64>| {
            (m.rotation - rotation).norm_squared() < 2.0 * SAME * SAME
        };
        let known = &self.found[..self.len];
        // One that has already fallen deeper was not found yet, but where a descent ran out of steps.
        let is_known = |rotation: &Matrix3<f64>, error: f64| {
            known.iter().any(|m| same(m, rotation) && error >= m.error)
        };
        let Some((rotation, error)) = descend(&form.omega, start, is_known) else { return };
        if !error.is_finite() || !(form.centroid_in_camera(&columns(&rotation)).z > 0.0) {
            return;
        }
        self.least = self.least.min(error);
        let twin = self.found[..self.len].iter_mut().find(|m| same(m, &rotation));
        if let Some(twin) = twin {
            *twin = Minimum { rotation, error };
            return;
        }
        if self.len < MAX_MINIMA {
            self.found[self.len] = Minimum { rotation, error };
            self.len += 1;
        }
    }
}

fn columns(matrix: &Matrix3<f64>) -> Nine {
    std::array::from_fn(|i| matrix[(i % 3, i / 3)])
}

/// `omega x`, as the columns of a matrix, and `x' omega x`.
fn apply(omega: &[Nine; 9], rotation: &Matrix3<f64>) -> (Matrix3<f64>, f64) {
    let x = columns(rotation);
    let mut y = [0.0; 9];
    for (row, entry) in omega.iter().zip(&x) {
        for (sum, value) in y.iter_mut().zip(row) {
            *sum += entry * value;
        }
    }
    let error = x.iter().zip(&y).map(|(a, b)| a * b).sum();
    (Matrix3::from_column_slice(&y), error)
}

/// Follows `x' omega x` down to a minimum over the rotations by damped Newton steps; `None` if it is a known one.
fn descend(
    omega: &[Nine; 9],
    start: Matrix3<f64>,
    is_known: impl Fn(&Matrix3<f64>, f64) -> bool,
) -> Option<(Matrix3<f64>, f64)> {
    let mut rotation = start;
    let (mut image, mut error) = apply(omega, &rotation);
    let mut damping = 0.0;
    for _ in 0..MAX_STEPS {
        let (gradient, hessian) = derivatives(omega, &rotation, &image);
        let size = hessian[0][0].abs() + hessian[1][1].abs() + hessian[2][2].abs();
        let mut accepted = None;
        for _ in 0..MAX_STEPS {
            let mut matrix = hessian;
            for (k, row) in matrix.iter_mut().enumerate() {
                row[k] += damping;
            }
            if let Some(step) = solve_positive(&matrix, &gradient) {
                let step = -Vector3::from(step);
                let next = *Rotation3::new(step).matrix() * rotation;
                let (next_image, next_error) = apply(omega, &next);
                if next_error <= error {
                    accepted = Some((next, next_image, next_error, step.norm_squared()));
                    break;
                }
            }
            damping = (damping * 8.0).max(1e-3 * size);
        }
        let Some((next, next_image, next_error, step2)) = accepted else { break };
        (rotation, image, error) = (next, next_image, next_error);
        if is_known(&rotation, error) {
            return None;
        }
        damping = if damping > 1e-6 * size { damping * 0.1 } else { 0.0 };
        if step2 < CONVERGED * CONVERGED {
            break;
        }
    }
    Some((rotation, error.max(0.0)))
}

/// Half the gradient and half the second derivative of `x' omega x` by a rotation vector on the left.
fn derivatives(
    omega: &[Nine; 9],
    rotation: &Matrix3<f64>,
    image: &Matrix3<f64>,
) -> ([f64; 3], [[f64; 3]; 3]) {
    // Tangents: axis k turned into every column.
    let mut tangents = [[0.0; 9]; 3];
    for j in 0..3 {
        let (x, y, z) = (rotation[(0, j)], rotation[(1, j)], rotation[(2, j)]);
        tangents[0][3 * j..3 * j + 3].copy_from_slice(&[0.0, -z, y]);
        tangents[1][3 * j..3 * j + 3].copy_from_slice(&[z, 0.0, -x]);
        tangents[2][3 * j..3 * j + 3].copy_from_slice(&[-y, x, 0.0]);
    }
    let mut images = [[0.0; 9]; 3];
    for (tangent, image) in tangents.iter().zip(&mut images) {
        for (row, entry) in omega.iter().zip(tangent) {
            for (sum, value) in image.iter_mut().zip(row) {
                *sum += entry * value;
            }
        }
    }
    let torque = image * rotation.transpose();
    let trace = torque.trace();
    let mut gradient = [0.0; 3];
    let mut hessian = [[0.0; 3]; 3];
    for k in 0..3 {
        gradient[k] = tangents[k].iter().zip(&columns(image)).map(|(a, b)| a * b).sum();
        for l in 0..3 {
            let curvature =
                0.5 * (torque[(k, l)] + torque[(l, k)]) - if k == l { trace } else { 0.0 };
            let dot: f64 = tangents[k].iter().zip(&images[l]).map(|(a, b)| a * b).sum();
            hessian[k][l] = dot + curvature;
        }
    }
    (gradient, hessian)
}
