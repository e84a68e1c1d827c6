//! What something unlabelled hides at the outline: a guard rail before the wheels, a fence before the sills.
//!
//! There the mask says background where the vehicle is, and no cell lies deep enough inside it for `occluders` to begin at.
//! As a quadratic term it pulls the outline to where the mask ends, and the seams inside, which fit at the true pose alone,
//! give way a little everywhere. So the fit goes on with the `Geman-McClure` loss on such cells (iteratively reweighted least
//! squares; Holland and Welsch 1977): a few that contradict wholly cost less than many that
//! contradict a little. What shows the vehicle where nothing is drawn keeps its weight, so that the drawn outline comes to
//! lie a little outside the mask's: right where masks are too small, wrong where that was measured and is allowed for
//! ([`super::MaskBias`]), and so not done there.

use super::jacobian::fraction;
use super::lm::{Descent, View, Workspace};
use super::models::{Candidate, LEVELS, Pyramid};
use super::raster::Raster;
use super::state::State;
use super::target::Target;

/// Squared share of a cell that contradicts, from which on it counts less.
const SCALE: f32 = 0.15;
/// Rounds of weighing and going downhill.
const ROUNDS: usize = 2;
/// What must contradict for it to be worth while, as a share of the mask.
const LEAST: f64 = 0.01;

/// Goes on from a state on the finest level; `None` where little background lies inside the vehicle, and where the bias of
/// masks is known. The energy of what is
/// found is that of `target`, not of the weights on the way, and may be higher than the start's.
pub(super) fn descend(
    work: &mut Workspace,
    pyramid: &Pyramid,
    candidate: &Candidate,
    (target, start): (&Target, &State),
) -> Option<Descent> {
    let fine = LEVELS.len() - 1;
    let view = View { target, ..pyramid.view(fine, candidate) };
    if view.grid.bias.is_some() {
        return None;
    }
    let mut softer = target.clone();
    let mut found: Option<Descent> = None;
    for _ in 0..ROUNDS {
        let here = found.map_or(*start, |descent| descent.end.state);
        work.score(&view, &here);
        let cells = contradictions(target, &work.raster);
        let sum: f64 = cells.iter().zip(&target.weights).map(|(c, w)| f64::from(c * w)).sum();
        if sum < LEAST * target.foreground() {
            break;
        }
        for ((weight, own), cell) in softer.weights.iter_mut().zip(&target.weights).zip(&cells) {
            *weight = own / (1.0 + cell / SCALE).powi(2);
        }
        let softer = View { target: &softer, ..view };
        found = Some(work.descend(&softer, &here, &LEVELS[fine].effort, f64::INFINITY));
    }
    found.map(|descent| Descent { end: work.score(&view, &descent.end.state), ..descent })
}

/// Of each cell the squared share that shows the vehicle in the last picture, but background in the mask.
fn contradictions(target: &Target, raster: &Raster) -> Vec<f32> {
    let m = target.cells;
    let of_cell = |cell: usize| {
        let drawn = 1.0 - fraction(raster, m, cell, 0);
        (drawn + target.probabilities[cell][0] - 1.0).max(0.0).powi(2)
    };
    (0..m * m).map(of_cell).collect()
}
