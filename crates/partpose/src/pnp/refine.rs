//! Levenberg-Marquardt on the reprojection error: from a start to the most likely pose near it.
//!
//! The cost is minus twice the logarithm of the likelihood: the sum over the points of `rho(|L (pi(R p + t) - u)|^2)`,
//! `L' L` the inverse of the point's pixel covariance, and of the squared priors. Updates turn the object about the
//! centroid of its points (`R <- exp(w) R`) and move the centroid `c` along the ray form `c + dx e1 + dy e2 + dl c`,
//! which separates what the image fixes well (direction) from what it fixes badly (distance); with the plain translation
//! both depend on where the object's origin happens to be.
//!
//! Levenberg 1944, Marquardt 1963; robust weights as iteratively reweighted least squares (Triggs et al.: *Bundle
//! Adjustment, A Modern Synthesis*, 1999, without its second-order correction).

use nalgebra::{Matrix2, Matrix3, Matrix6, UnitQuaternion, Vector3};

use super::{
    Correspondence, Loss, PnpError, Priors,
    buffer::{Buffer, is_finite},
    centroid, check,
    linalg::{cholesky, solve_positive},
};
use crate::geometry::{Camera, Pose};

/// A point nearer to the camera's plane than this (metres) makes the cost infinite.
const NEAREST: f64 = 0.1;
/// Factors on the damping after a success and after a failure, and its start.
const DAMPING: [f64; 3] = [0.2, 5.0, 1e-4];
/// Damping at which no step helps.
const MAX_DAMPING: f64 = 1e10;

/// A correspondence and how well its pixel is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WeightedCorrespondence {
    /// The point and its pixel.
    pub correspondence: Correspondence,
    /// Covariance of the pixel, square pixels; symmetric and positive definite.
    pub covariance: Matrix2<f64>,
}

/// How [`refine`] weighs and when it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefineOptions {
    /// Standard deviation of a pixel coordinate for points without a covariance, pixels.
    pub sigma: f64,
    /// Loss on each point's squared residual, in standard deviations.
    pub loss: Loss,
    /// What is known beforehand.
    pub priors: Priors,
    /// Most steps, taken or refused.
    pub max_iterations: u32,
    /// Relative decrease of the cost below which the descent has converged.
    pub tolerance: f64,
}

impl Default for RefineOptions {
    fn default() -> Self {
        let priors = Priors::default();
        Self { sigma: 1.0, loss: Loss::None, priors, max_iterations: 50, tolerance: 1e-8 }
    }
}

/// A refined pose with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// `camera_from_object`.
    pub pose: Pose,
    /// Minus twice the log-likelihood, but for a constant: losses of the points and squares of the priors.
    pub cost: f64,
    /// Covariance of the pose: rows 0 to 2 a rotation vector in camera axes, radians, with the true rotation
    /// `exp(w) R`; rows 3 to 5 the translation in the camera frame, metres. Infinite where the points fix nothing.
    pub covariance: Matrix6<f64>,
    /// Steps, taken or refused.
    pub iterations: u32,
    /// Whether the descent ended because it had arrived.
    pub converged: bool,
}

/// Refines `start` by the pixels of points that are all equally well known.
pub fn refine(
    correspondences: &[Correspondence],
    camera: &Camera,
    start: &Pose,
    options: &RefineOptions,
) -> Result<Refinement, PnpError> {
    check(correspondences, camera, 1)?;
    if !(options.sigma > 0.0 && options.sigma.is_finite()) {
        return Err(PnpError::NotPositive);
    }
    let inverse = 1.0 / options.sigma;
    let center = centroid(correspondences);
    let terms = Buffer::from_fn(correspondences.len(), Term::BLANK, |i| {
        Term::new(&correspondences[i], &center, [inverse, 0.0, inverse])
    });
    descend(&Problem { terms: &terms, center, camera, options }, start)
}

/// Refines `start` by the pixels of points with a covariance each; `sigma` of the options is not used.
pub fn refine_weighted(
    correspondences: &[WeightedCorrespondence],
    camera: &Camera,
    start: &Pose,
    options: &RefineOptions,
) -> Result<Refinement, PnpError> {
    let plain: Buffer<Correspondence> = {
        let blank = Correspondence {
            point_in_image: nalgebra::Point2::origin(),
            point_in_object: nalgebra::Point3::origin(),
        };
        Buffer::from_fn(correspondences.len(), blank, |i| correspondences[i].correspondence)
    };
    check(&plain, camera, 1)?;
    if correspondences.iter().any(|c| whitening(&c.covariance).is_none()) {
        return Err(PnpError::NotPositive);
    }
    let center = centroid(&plain);
    let terms = Buffer::from_fn(correspondences.len(), Term::BLANK, |i| {
        let whitening = whitening(&correspondences[i].covariance).unwrap_or_default();
        Term::new(&plain[i], &center, whitening)
    });
    descend(&Problem { terms: &terms, center, camera, options }, start)
}

/// The lower triangular `L` with `L' L` the inverse of the covariance, as `l00, l10, l11`.
fn whitening(covariance: &Matrix2<f64>) -> Option<[f64; 3]> {
    let (a, b, d) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
    let symmetric = (b - covariance[(1, 0)]).abs() <= 1e-9 * (a.abs() + d.abs());
    let determinant = a * d - b * b;
    if !(symmetric && a > 0.0 && d > 0.0 && determinant > 0.0) {
        return None;
    }
    // With L11 = 1/sqrt(d), L10 chosen so that L' L has the inverse's off-diagonal entry.
    let l11 = (a / determinant).sqrt();
    let l10 = -b / (determinant * l11);
    let l00 = (1.0 / a).sqrt();
    [l00, l10, l11].iter().all(|value| value.is_finite()).then_some([l00, l10, l11])
}

/// A point relative to the centroid, its pixel, and the whitening matrix.
#[derive(Clone, Copy)]
struct Term {
    point: Vector3<f64>,
    pixel: [f64; 2],
    whitening: [f64; 3],
}

impl Term {
    const BLANK: Self =
        Self { point: Vector3::new(0.0, 0.0, 0.0), pixel: [0.0; 2], whitening: [0.0; 3] };

    fn new(correspondence: &Correspondence, center: &Vector3<f64>, whitening: [f64; 3]) -> Self {
        let pixel = correspondence.point_in_image;
        let point = correspondence.point_in_object.coords - center;
        Self { point, pixel: [pixel.x, pixel.y], whitening }
    }
}

struct Problem<'a> {
    terms: &'a [Term],
    center: Vector3<f64>,
    camera: &'a Camera,
    options: &'a RefineOptions,
}

/// A rotation and the centroid in the camera frame.
#[derive(Clone, Copy)]
struct State {
    rotation: UnitQuaternion<f64>,
    center: Vector3<f64>,
}

/// Approximate second derivative (lower triangle) and gradient, halved both, of the cost.
#[derive(Clone, Copy)]
struct Normal {
    matrix: [[f64; 6]; 6],
    gradient: [f64; 6],
    cost: f64,
}

fn descend(problem: &Problem<'_>, start: &Pose) -> Result<Refinement, PnpError> {
    let options = problem.options;
    if !(options.loss.is_valid() && options.priors.is_valid()) {
        return Err(PnpError::NotPositive);
    }
    let mut state = State {
        rotation: UnitQuaternion::new_normalize(start.rotation.into_inner()),
        center: start.rotation * problem.center + start.translation.vector,
    };
    if !(is_finite(&state.center) && state.rotation.coords.iter().all(|x| x.is_finite())) {
        return Err(PnpError::NotFinite);
    }
    let mut normal = problem.linearise(&state).ok_or(PnpError::BehindCamera)?;
    let mut damping = DAMPING[2];
    let (mut iterations, mut converged) = (0, false);
    while iterations < options.max_iterations && !converged && damping < MAX_DAMPING {
        iterations += 1;
        let mut matrix = normal.matrix;
        for (k, row) in matrix.iter_mut().enumerate() {
            row[k] += damping * row[k] + f64::MIN_POSITIVE;
        }
        let step = solve_positive(&matrix, &normal.gradient);
        let next = step.map(|step| state.moved(&step));
        match next.and_then(|next| Some((next, problem.linearise(&next)?))) {
            Some((next, candidate)) if candidate.cost <= normal.cost => {
                let decrease = normal.cost - candidate.cost;
                converged = decrease <= options.tolerance * normal.cost + f64::MIN_POSITIVE;
                (state, normal) = (next, candidate);
                damping *= DAMPING[0];
            }
            other => {
                // A refused step of no consequence means that rounding is all that is left.
                let excess = other.map_or(f64::INFINITY, |(_, c)| c.cost - normal.cost);
                converged = excess <= options.tolerance * normal.cost;
                damping *= DAMPING[1];
            }
        }
    }
    let rotation = state.rotation;
    let translation = state.center - rotation * problem.center;
    let pose = Pose::from_parts(translation.into(), rotation);
    let covariance = problem.covariance(&state, &normal);
    Ok(Refinement { pose, cost: normal.cost, covariance, iterations, converged })
}

impl State {
    /// The columns of the centroid's motion: right, down, and away along the ray.
    fn directions(&self) -> Matrix3<f64> {
        let away = if self.center.z > NEAREST { self.center } else { Vector3::z() };
        Matrix3::from_columns(&[Vector3::x(), Vector3::y(), away])
    }

    fn moved(&self, step: &[f64; 6]) -> Self {
        let rotation =
            UnitQuaternion::new(-Vector3::new(step[0], step[1], step[2])) * self.rotation;
        let motion = self.directions() * Vector3::new(step[3], step[4], step[5]);
        Self { rotation, center: self.center - motion }
    }
}

impl Problem<'_> {
    /// Cost and normal equations; `None` if a point is too near or behind, or if the cost is not finite.
    fn linearise(&self, state: &State) -> Option<Normal> {
        let rotation = *state.rotation.to_rotation_matrix().matrix();
        let directions = state.directions();
        let away = directions.column(2).into_owned();
        let [fx, fy] = self.camera.focal;
        let [cx, cy] = self.camera.principal_point;
        let mut normal = Normal { matrix: [[0.0; 6]; 6], gradient: [0.0; 6], cost: 0.0 };
        for term in self.terms {
            let y = rotation * term.point;
            let p = y + state.center;
            if !(p.z > NEAREST) {
                return None;
            }
            let inverse = 1.0 / p.z;
            let (px, py) = (p.x * inverse, p.y * inverse);
            let [l00, l10, l11] = term.whitening;
            let residual = [fx * px + cx - term.pixel[0], fy * py + cy - term.pixel[1]];
            let residual = [l00 * residual[0], l10 * residual[0] + l11 * residual[1]];
            let (loss, weight) =
                self.options.loss.evaluate(residual[0] * residual[0] + residual[1] * residual[1]);
            normal.cost += loss;
            // Whitened rows of the projection's derivative by the point in the camera.
            let (gx, gy) = (fx * inverse, fy * inverse);
            let row0 = Vector3::new(l00 * gx, 0.0, -l00 * gx * px);
            let row1 = Vector3::new(l10 * gx, l11 * gy, -l10 * gx * px - l11 * gy * py);
            for (row, residual) in [(row0, residual[0]), (row1, residual[1])] {
                let turn = y.cross(&row);
                normal.add(
                    &[turn.x, turn.y, turn.z, row.x, row.y, row.dot(&away)],
                    residual,
                    weight,
                );
            }
        }
        self.add_priors(state, &rotation, &directions, &mut normal);
        normal.cost.is_finite().then_some(normal)
    }

    fn add_priors(
        &self,
        state: &State,
        rotation: &Matrix3<f64>,
        directions: &Matrix3<f64>,
        normal: &mut Normal,
    ) {
        let priors = &self.options.priors;
        if priors.tilt.is_none() && priors.height.is_none() {
            return;
        }
        let arm = rotation * self.center;
        for term in priors.terms(rotation, &(state.center - arm)).into_iter().flatten() {
            // Turning about the centroid moves the origin: t = c - R p, so dt = -w x (R p).
            let turn = term.by_rotation - arm.cross(&term.by_translation);
            let shift = directions.transpose() * term.by_translation;
            let row = [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z];
            normal.add(&row, term.residual, 1.0);
            normal.cost += term.residual * term.residual;
        }
    }

    /// The inverse of the normal matrix in the documented parameters.
    fn covariance(&self, state: &State, normal: &Normal) -> Matrix6<f64> {
        let infinite = Matrix6::from_diagonal_element(f64::INFINITY);
        let Some((l, _)) = cholesky(&normal.matrix) else { return infinite };
        let l = Matrix6::from_fn(|i, j| l[i][j]);
        let Some(half) = l.solve_lower_triangular(&Matrix6::identity()) else { return infinite };
        // Local parameters (w, dx, dy, dl) to (w, dt): dt = D d + [R p]x w.
        let mut change = Matrix6::identity();
        let arm = state.rotation * self.center;
        change.fixed_view_mut::<3, 3>(3, 0).copy_from(&arm.cross_matrix());
        change.fixed_view_mut::<3, 3>(3, 3).copy_from(&state.directions());
        let root = half * change.transpose();
        let covariance = root.transpose() * root;
        if covariance.iter().all(|value| value.is_finite()) { covariance } else { infinite }
    }
}

impl Normal {
    fn add(&mut self, row: &[f64; 6], residual: f64, weight: f64) {
        for i in 0..6 {
            let entry = weight * row[i];
            self.gradient[i] += entry * residual;
            for j in 0..=i {
                self.matrix[i][j] += entry * row[j];
            }
        }
    }
}
