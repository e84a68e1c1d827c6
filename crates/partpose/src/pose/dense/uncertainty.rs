//! How sure the fit is: covariance, probabilities of models and of a second mode, and what speaks against it.
//!
//! Cells are no independent witnesses: where a mask is wrong it is wrong over several cells. The covariance is therefore
//! the sandwich `H^-1 (B + P) H^-1` with `B = sum rho(|c - d|) g_c g_d^T` over pairs of cells, `g_c` a cell's part of
//! the gradient and rho an exponential (after Huber 1967; White 1980). Errors that all cells share, of the model's shape and of the
//! mask's outline, do not show in residuals at all: they enter as a floor.

use nalgebra::{Matrix6, SMatrix, SVector, SymmetricEigen};

use crate::geometry::{Extent, Pose};

use super::jacobian::fraction;
use super::lm::{Scored, View, Workspace};
use super::models::Hypothesis;
use super::state::{PARAMETERS, State};

/// Cells of a 28-cell kernel over which errors of masks are correlated.
const CORRELATION: f64 = 4.0;
/// Factor on the sandwich, found on world 0001 (`docs/dense-fit.md`).
const INFLATION: f64 = 15.0;
/// Noise of a cell that is there however well the model fits, as a share of [`NOISE`]: what no edge tells is unsure, not
/// sure for want of residuals.
const LEAST_NOISE: f64 = 1e-3;
/// Standard deviations that no mask takes away: turn (radians), sideways and up as a share of the distance, distance
/// (logarithm). Found on world 0001 like [`INFLATION`].
const FLOOR: [f64; 3] = [0.005, 0.0005, 0.003];
/// Variance of a reference cell's term where priors are weighed against it.
pub(super) const NOISE: f64 = 0.05;
/// How much more energy, as a share of the best, makes a hypothesis e times less likely.
const TEMPER: f64 = 0.04;
/// Energy per foreground cell of a fit that is as likely bad as good.
const EVEN: f64 = 0.25;
/// The same for how far the vehicle reaches beyond the mask's own outline, as a share of it.
const EVEN_OVERSHOOT: f64 = 0.25;

/// Another pose that explains the mask, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SecondMode {
    /// Its model's place in the zoo.
    pub model_index: usize,
    /// The pose.
    pub camera_from_vehicle: Pose,
    /// The size.
    pub extent: Extent,
    /// As [`DenseReport::energy`], from the level at which it was given up.
    pub energy: f64,
    /// Its probability against the first.
    pub probability: f64,
}

/// What speaks against a fit, or limits what may be made of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum DenseFlag {
    /// Fewer than 12 cells of a 28 x 28 kernel show the vehicle.
    LittleEvidence,
    /// The drawn model explains the mask badly: energy per foreground cell above 0.25, or it reaches beyond the mask's
    /// own outline by more than a quarter of that.
    PoorFit,
    /// The descent had not arrived when it was stopped.
    NotConverged,
    /// A second pose has a probability above 0.1.
    AmbiguousPose,
    /// The best model has a probability below 0.5.
    AmbiguousModel,
    /// A part of the vehicle is nearer than a metre or behind the camera.
    TooNear,
    /// A side differs from the likely size by more than 3 standard deviations.
    SizeAtPriorLimit,
    /// The bottom lies more than 4 standard deviations off the given ground.
    OffGround,
    /// Background deep inside the vehicle was taken for something unlabelled in front of it.
    HiddenByUnlabelled,
}

/// What the dense fit knows besides pose, size and model.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseReport {
    /// The data term per cell that shows the vehicle: 0 for a perfect fit, 1 for none.
    pub energy: f64,
    /// Cells of a 28 x 28 kernel that show the vehicle.
    pub foreground: f64,
    /// Covariance of a rotation vector in camera axes about the cuboid's centre (radians, the true rotation is
    /// `exp(w) R`) and of the centre's place in the camera frame (metres).
    pub covariance: Matrix6<f64>,
    /// The same with the logarithms of width, height and length as rows 6 to 8, where they were free.
    pub covariance_with_size: Option<SMatrix<f64, 9, 9>>,
    /// Probability of each model of the zoo, in its order.
    pub model_probabilities: Vec<f64>,
    /// The best pose that is not the first.
    pub second_mode: Option<SecondMode>,
    /// 0 to 1: how much the fit trusts itself, from its energy, its model and its mode.
    pub confidence: f64,
    /// What speaks against it.
    pub flags: Vec<DenseFlag>,
    /// Pictures that were drawn to find it.
    pub pictures: usize,
}

/// Covariance of the nine increments in metric form; the last three rows are 0 where the size is fixed.
pub(super) fn covariance(work: &mut Workspace, view: &View, end: &Scored) -> SMatrix<f64, 9, 9> {
    let state = &end.state;
    work.score(view, state);
    let equations = work.equations(view, state);
    let count = view.terms.count();
    let mut spread = correlated_gradients(work, view) * INFLATION;
    let mut priors =
        super::jacobian::NormalEquations { hessian: SMatrix::zeros(), gradient: SVector::zeros() };
    view.terms.add(state, &mut priors);
    // `terms.add` scales by the noise once; a prior's own spread is its information, times the noise squared.
    spread += priors.hessian * view.terms.noise;
    let mut hessian = equations.hessian;
    let largest = hessian.diagonal().max().max(1e-12);
    for i in 0..PARAMETERS {
        hessian[(i, i)] += 1e-9 * largest;
        if i >= count {
            hessian[(i, i)] = 1.0;
        }
    }
    spread += hessian * (LEAST_NOISE * view.terms.noise);
    let inverse = hessian.cholesky().map(|c| c.inverse());
    let (Some(inverse), Some(spread)) = (inverse, without_negative(spread)) else {
        return SMatrix::from_diagonal_element(f64::INFINITY);
    };
    let mut increments = inverse * spread * inverse;
    let z = state.center.z;
    for i in 0..3 {
        increments[(i, i)] += FLOOR[0].powi(2);
        increments[(3 + i, 3 + i)] += if i < 2 { (FLOOR[1] * z).powi(2) } else { FLOOR[2].powi(2) };
    }
    let mut metric = SMatrix::<f64, 9, 9>::identity();
    metric.fixed_view_mut::<3, 1>(3, 5).copy_from(&state.center);
    let mut covariance = metric * increments * metric.transpose();
    for i in count..PARAMETERS {
        covariance.row_mut(i).fill(0.0);
        covariance.column_mut(i).fill(0.0);
    }
    0.5 * (covariance + covariance.transpose())
}

/// The matrix with negative eigenvalues set to 0: correlations that end at some distance may leave some.
fn without_negative(spread: SMatrix<f64, 9, 9>) -> Option<SMatrix<f64, 9, 9>> {
    let mut parts = SymmetricEigen::try_new(spread, f64::EPSILON, 1000)?;
    parts.eigenvalues.apply(|value| *value = value.max(0.0));
    Some(parts.recompose()).filter(|matrix| matrix.iter().all(|value| value.is_finite()))
}

/// `sum rho g g^T` over pairs of cells that are not far apart.
fn correlated_gradients(work: &Workspace, view: &View) -> SMatrix<f64, 9, 9> {
    let target = view.target;
    let m = target.cells;
    let length = CORRELATION * m as f64 / 28.0;
    let reach = (3.0 * length).ceil() as usize;
    let gradients: Vec<Option<SVector<f64, 9>>> = (0..m * m)
        .map(|cell| {
            let mut sum = SVector::<f64, 9>::zeros();
            let mut any = false;
            for slope in work.flux.of_cell(cell) {
                let q = target.probabilities[cell][usize::from(slope.label)];
                let residual = fraction(&work.raster, m, cell, slope.label) - q;
                let factor = f64::from(target.weights[cell] * residual);
                sum += SVector::from(slope.by.map(f64::from)) * factor;
                any = true;
            }
            any.then_some(sum)
        })
        .collect();
    // Separable sums: what each cell sees of its surroundings, weighted.
    let weights: Vec<f64> = (0..=reach).map(|d| (-(d as f64) / length).exp()).collect();
    let blur = |from: &[Option<SVector<f64, 9>>], step: usize, lines: usize| {
        let mut to: Vec<Option<SVector<f64, 9>>> = vec![None; m * m];
        for line in 0..m {
            for (at, value) in (0..m).filter_map(|i| Some((i, from[line * lines + i * step]?))) {
                for other in at.saturating_sub(reach)..=(at + reach).min(m - 1) {
                    let slot = to[line * lines + other * step].get_or_insert_with(SVector::zeros);
                    *slot += value * weights[at.abs_diff(other)];
                }
            }
        }
        to
    };
    let across = blur(&gradients, 1, m);
    let around = blur(&across, m, 1);
    let mut spread = SMatrix::<f64, 9, 9>::zeros();
    for (own, seen) in gradients.iter().zip(&around) {
        if let (Some(own), Some(seen)) = (own, seen) {
            spread += own * seen.transpose();
        }
    }
    0.5 * (spread + spread.transpose())
}

/// The probability of each model: by its best energy against the best at the finest level that it reached.
pub(super) fn model_probabilities(hypotheses: &[Hypothesis], count: usize) -> Vec<f64> {
    let mut odds = vec![0.0; count];
    for (model, odds) in odds.iter_mut().enumerate() {
        if let Some(own) = hypotheses.iter().find(|h| h.model == model) {
            *odds = relative(hypotheses, own).exp();
        }
    }
    let sum: f64 = odds.iter().sum();
    odds.iter().map(|odds| odds / sum.max(1e-300)).collect()
}

/// The logarithm of a hypothesis' odds against the best of its level; never more than 0.
fn relative(hypotheses: &[Hypothesis], own: &Hypothesis) -> f64 {
    let of_level = hypotheses.iter().filter(|h| h.level == own.level);
    let best = of_level.map(|h| h.scored.energy).fold(f64::INFINITY, f64::min);
    ((best - own.scored.energy) / (TEMPER * best + 1e-3)).min(0.0)
}

/// The likeliest hypothesis that is turned by more than 30 degrees against the best, or a tenth of its distance away.
pub(super) fn second_mode(hypotheses: &[Hypothesis], foreground: f64) -> Option<SecondMode> {
    let first = hypotheses.first()?;
    let own = &first.scored.state;
    let second = hypotheses
        .iter()
        .filter(|h| {
            let other = &h.scored.state;
            own.rotation.angle_to(&other.rotation) > super::models::NEIGHBOURS
                || (own.center - other.center).norm() > 0.1 * own.center.norm()
        })
        .max_by(|a, b| relative(hypotheses, a).total_cmp(&relative(hypotheses, b)))?;
    let odds = relative(hypotheses, second).exp();
    let state: &State = &second.scored.state;
    Some(SecondMode {
        model_index: second.model,
        camera_from_vehicle: state.pose(),
        extent: state.extent(),
        energy: second.scored.data / foreground,
        probability: odds / (1.0 + odds),
    })
}

/// How much a fit trusts itself.
pub(super) fn confidence(
    energy: f64,
    overshoot: f64,
    models: &[f64],
    second: Option<&SecondMode>,
) -> f64 {
    let model = models.iter().copied().fold(0.0, f64::max);
    let mode = second.map_or(1.0, |second| 1.0 - second.probability);
    let fits = 1.0 / (1.0 + (energy / EVEN).powi(4));
    model * mode * fits / (1.0 + (overshoot / EVEN_OVERSHOOT).powi(4))
}
