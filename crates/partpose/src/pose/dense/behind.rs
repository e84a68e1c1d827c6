//! Vehicles behind something unlabelled: fences, hedges, trees.
//!
//! What hides a vehicle without being labelled says "background", and where it hides the outline the fit takes it for the
//! outline's end. So where a fit is poor, all is searched again with background that counts little and one side of the
//! outline at a time not taken for the vehicle's own. What is found then loses the cells that seem hidden, pays a little
//! for each of them, and has to be better than what there was.

use super::hypotheses::Outline;
use super::lm::Workspace;
use super::models::{self, Candidate, Hypothesis, LEVELS, Pyramid, Search};
use super::occluders::{self, Hidden};
use super::robust;
use super::target::Target;

/// Weight of background while it is not believed.
const OPEN: f32 = 0.15;
/// Energy of a cell that is taken for hidden, besides what those that are seen have on average: hiding a cell must not pay
/// off where nothing fits anyway. A cell that is drawn where the mask says background has 1.
const COST: f64 = 0.1;
/// Largest share of the drawn model that may be hidden.
const MOST: f64 = 0.65;
/// Hypotheses that are looked at closely.
const FINALISTS: usize = 4;

const SEARCH: Search = Search {
    scouts: 3,
    headings: 4,
    depths: &[1.0, 0.65],
    keep: [12, 6],
    hopeless: [2.0, 1.5, 1.4],
};

/// A fit with what it takes for hidden.
#[derive(Clone, Debug)]
pub(super) struct Behind {
    pub(super) hypothesis: Hypothesis,
    pub(super) hidden: Hidden,
    /// The finest target without what is hidden.
    pub(super) target: Target,
}

impl Behind {
    /// Energy with what hidden cells cost.
    pub(super) fn energy(&self) -> f64 {
        let scored = &self.hypothesis.scored;
        let usual = scored.data / self.target.foreground().max(1.0);
        scored.energy + (COST + 0.5 * usual) * self.hidden.cells
    }
}

/// The hypothesis on the finest level, without what something unlabelled hides, which is at most `most` of it.
pub(super) fn without_hidden(
    work: &mut Workspace,
    pyramid: &Pyramid,
    candidates: &[Candidate],
    start: &Hypothesis,
    most: f64,
) -> Behind {
    let fine = LEVELS.len() - 1;
    let mut view = pyramid.view(fine, &candidates[start.model]);
    let mut best = *start;
    best.scored = work.score(&view, &best.scored.state);
    let mut target = pyramid.targets[fine].clone();
    let hidden = occluders::hide(&mut target, &work.raster, most);
    if hidden.share > 0.0 {
        view.target = &target;
        let effort = &LEVELS[fine].effort;
        let descent = work.descend(&view, &best.scored.state, effort, f64::INFINITY);
        best.scored = descent.end;
        best.converged = descent.converged;
    }
    let candidate = &candidates[start.model];
    if let Some(descent) = robust::descend(work, pyramid, candidate, (&target, &best.scored.state))
    {
        best.scored = descent.end;
        best.converged = descent.converged;
    }
    Behind { hypothesis: best, hidden, target }
}

/// The best fits behind something unlabelled, the best first; `order` says which models to begin with.
pub(super) fn search(
    work: &mut Workspace,
    pyramid: &Pyramid,
    outline: &Outline,
    (candidates, order): (&[Candidate], &[usize]),
) -> Vec<Behind> {
    let mut open = pyramid.clone();
    for target in &mut open.targets {
        for (weight, cell) in target.weights.iter_mut().zip(&target.probabilities) {
            *weight *= 1.0 - (1.0 - OPEN) * cell[0];
        }
    }
    let outlines = [0, 1, 2, 3].map(|side| outline.without(side));
    let found = models::search(work, &open, &outlines, (candidates, order), &SEARCH);
    let mut finalists: Vec<Behind> = Vec::new();
    for hypothesis in found.iter().filter(|h| h.level == LEVELS.len() - 1).take(FINALISTS) {
        let first = without_hidden(work, pyramid, candidates, hypothesis, MOST);
        // What is hidden is clearer from where that led.
        finalists.push(without_hidden(work, pyramid, candidates, &first.hypothesis, MOST));
    }
    finalists.sort_by(|a, b| a.energy().total_cmp(&b.energy()));
    finalists
}
