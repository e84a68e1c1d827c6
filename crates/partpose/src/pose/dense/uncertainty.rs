//! The covariance of a fit: what its cells, its outline and its unknown size leave open.
//!
//! Three things err, and add up:
//!
//! - *Cells.* They are no independent witnesses: where a mask is wrong it is wrong over several cells. Their share is the
//!   sandwich `H^-1 (B + P) H^-1` with `B = sum rho(|c - d|) g_c g_d^T` over pairs of cells, `g_c` a cell's part of the
//!   gradient and rho an exponential (after Huber 1967; White 1980).
//! - *The outline as a whole.* Masks and models have it in slightly different places, the same way along a whole side.
//!   That shows in no residual. Each of the four sides is a parameter that was not fitted, with a deviation of its own:
//!   with C the mixed derivative of the energy, `H^-1 C S C^T H^-1`.
//! - *The size*, where it was neither given nor fitted: the same with the spread that sizes have beforehand. Size and
//!   distance together change no picture, so most of it is distance.

use nalgebra::{SMatrix, SVector, SymmetricEigen};

use super::bias::SampleGrid;
use super::jacobian::{NormalEquations, fraction};
use super::lm::{Scored, View, Workspace};
use super::priors::{SizeTerm, Terms};
use super::state::{PARAMETERS, State};

/// Cells of a 28-cell kernel over which errors of masks are correlated.
const CORRELATION: f64 = 4.0;
/// Factor on the sandwich, `A + B (energy / 0.1)^C`: what masks err in that fit badly is correlated farther. This and all
/// that follows was found on world 0001, with exact masks and masks of which 90, 85 and 80 % are right
/// (`docs/dense-fit.md`).
const INFLATION: [f64; 3] = [2.6, 21.5, 1.5];
/// Noise of a cell that is there however well the model fits, as a share of [`NOISE`]: what no edge tells is unsure, not
/// sure for want of residuals.
const LEAST_NOISE: f64 = 1e-3;
/// Standard deviations that no mask takes away: turn (radians), sideways and up as a share of the distance, distance
/// (logarithm).
const FLOOR: [f64; 3] = [0.0005, 0.0004, 0.005];
/// Variance of a reference cell's term where priors are weighed against it.
pub(super) const NOISE: f64 = 0.05;
/// How far each side of an outline lies off where the model has it, pixels: where that was measured on other masks,
/// and where it was not.
const OUTLINE: [f64; 2] = [0.1, 0.4];
/// The same as a share of the box's side at an energy of 0.1, and in proportion to it: cells are shares of the box.
const OUTLINE_SHARE: f64 = 0.0055;
/// How much more unsure everything is than the rest says: gross errors, such as wrong models, grow with the third power
/// of the energy over 0.1, up to twice that.
const GROSS: [f64; 2] = [2.0, 2.0];

/// Factor on all where the size is fitted, too: a model that is stretched has no true shape any more.
const STRETCHED: f64 = 1.6;

type Matrix9 = SMatrix<f64, PARAMETERS, PARAMETERS>;
type Vector9 = SVector<f64, PARAMETERS>;

/// What is left open.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    /// Covariance of the nine increments in metric form; the last three rows are 0 where the size is fixed.
    pub(super) covariance: Matrix9,
    /// Variance of the distance without what an unfitted size adds, square metres.
    pub(super) depth_variance_if_size_known: f64,
}

/// The covariance of what was fitted, at so much energy per foreground cell.
///
/// `unfitted` is the spread of a size that is neither given nor fitted.
pub(super) fn covariance(
    work: &mut Workspace,
    view: &View,
    end: &Scored,
    energy: f64,
    unfitted: Option<&SizeTerm>,
) -> Spread {
    let state = &end.state;
    work.score(view, state);
    let equations = work.equations(view, state);
    let count = view.terms.count();
    let poor = (energy / 0.1).clamp(0.0, 10.0);
    let inflation = INFLATION[0] + INFLATION[1] * poor.powf(INFLATION[2]);
    let mut spread = correlated_gradients(work, view) * inflation;
    let of_priors = view.terms.spread(state);
    let mut hessian = equations.hessian;
    let largest = hessian.diagonal().max().max(1e-12);
    for i in 0..PARAMETERS {
        hessian[(i, i)] += 1e-9 * largest;
        if i >= count {
            hessian[(i, i)] = 1.0;
        }
    }
    spread += hessian * (LEAST_NOISE * view.terms.noise);
    let (Some(cells), Some(inverse)) =
        (without_negative(spread), hessian.cholesky().map(|c| c.inverse()))
    else {
        return unbounded();
    };
    let spread = cells + outline_spread(work, view, state, &equations, OUTLINE_SHARE * poor);
    let doubt = 1.0 + GROSS[0] * poor.min(GROSS[1]).powi(3);
    let shape = if view.terms.size.is_some() { STRETCHED } else { 1.0 };
    let metric = |more: Matrix9| {
        let mut increments = inverse * (spread * doubt + of_priors + more) * inverse * shape;
        let z = state.center.z;
        for i in 0..3 {
            increments[(i, i)] += FLOOR[0].powi(2);
            increments[(3 + i, 3 + i)] +=
                if i < 2 { (FLOOR[1] * z).powi(2) } else { FLOOR[2].powi(2) };
        }
        let mut metric = Matrix9::identity();
        metric.fixed_view_mut::<3, 1>(3, 5).copy_from(&state.center);
        let mut covariance = metric * increments * metric.transpose();
        for i in count..PARAMETERS {
            covariance.row_mut(i).fill(0.0);
            covariance.column_mut(i).fill(0.0);
        }
        0.5 * (covariance + covariance.transpose())
    };
    let known = metric(Matrix9::zeros());
    let covariance = unfitted.map_or(known, |size| metric(size_spread(work, view, state, size)));
    if !covariance.iter().all(|value| value.is_finite()) {
        return unbounded();
    }
    Spread { covariance, depth_variance_if_size_known: known[(5, 5)] }
}

/// What is said where nothing is known.
fn unbounded() -> Spread {
    let covariance = Matrix9::from_diagonal_element(f64::INFINITY);
    Spread { covariance, depth_variance_if_size_known: f64::INFINITY }
}

/// The matrix with negative eigenvalues set to 0: correlations that end at some distance may leave some.
fn without_negative(spread: Matrix9) -> Option<Matrix9> {
    let mut parts = SymmetricEigen::try_new(spread, f64::EPSILON, 1000)?;
    parts.eigenvalues.apply(|value| *value = value.max(0.0));
    Some(parts.recompose()).filter(|matrix| matrix.iter().all(|value| value.is_finite()))
}

/// The spread of the gradient that comes of outlines which lie off, side by side.
fn outline_spread(
    work: &mut Workspace,
    view: &View,
    state: &State,
    here: &NormalEquations,
    share: f64,
) -> Matrix9 {
    let known = usize::from(view.grid.bias.is_none());
    let bounds = &view.target.bounds;
    let mut spread = Matrix9::zeros();
    for side in 0..4 {
        let (length, per_pixel) = if side % 2 == 0 {
            (bounds.width(), view.grid.per_pixel[0])
        } else {
            (bounds.height(), view.grid.per_pixel[1])
        };
        // A step that moves the outline over about a sample: less changes nothing.
        let step = (1.0 / per_pixel).max(0.75);
        let mut bias = view.grid.bias.unwrap_or_default();
        bias.offset[side] += step;
        let grid = SampleGrid { bias: Some(bias), ..*view.grid };
        let moved = View { grid: &grid, ..*view };
        work.score(&moved, state);
        let there = work.equations(&moved, state);
        let slope = (there.gradient - here.gradient) / step;
        let deviation = OUTLINE[known].hypot(share * length);
        spread += slope * slope.transpose() * deviation.powi(2);
    }
    spread
}

/// The spread of the gradient that comes of a size which is not the vehicle's.
fn size_spread(work: &mut Workspace, view: &View, state: &State, size: &SizeTerm) -> Matrix9 {
    let Some(covariance) = size.covariance() else { return Matrix9::zeros() };
    let terms = Terms { size: Some(*size), ..*view.terms };
    let view = View { terms: &terms, ..*view };
    work.score(&view, state);
    let mixed = work.equations(&view, state).hessian;
    let mixed = mixed.fixed_view::<6, 3>(0, 6);
    let mut spread = Matrix9::zeros();
    spread.fixed_view_mut::<6, 6>(0, 0).copy_from(&(mixed * covariance * mixed.transpose()));
    spread
}
/// `sum rho g g^T` over pairs of cells that are not far apart.
fn correlated_gradients(work: &Workspace, view: &View) -> Matrix9 {
    let target = view.target;
    let m = target.cells;
    let length = CORRELATION * m as f64 / 28.0;
    let reach = (3.0 * length).ceil() as usize;
    let gradients: Vec<Option<Vector9>> = (0..m * m)
        .map(|cell| {
            let mut sum = Vector9::zeros();
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
    let blur = |from: &[Option<Vector9>], step: usize, lines: usize| {
        let mut to: Vec<Option<Vector9>> = vec![None; m * m];
        for line in 0..m {
            for (at, value) in (0..m).filter_map(|i| Some((i, from[line * lines + i * step]?))) {
                for other in at.saturating_sub(reach)..=(at + reach).min(m - 1) {
                    let slot = to[line * lines + other * step].get_or_insert_with(Vector9::zeros);
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
