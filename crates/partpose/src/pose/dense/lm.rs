//! Levenberg-Marquardt on the energy: one picture a trial, derivatives from the picture that was accepted.

use nalgebra::SVector;

use super::bias::SampleGrid;
use super::energy::data_energy;
use super::jacobian::{Flux, NormalEquations};
use super::priors::Terms;
use super::raster::Raster;
use super::state::{PARAMETERS, State};
use super::target::Target;
use super::unit_mesh::UnitMesh;

/// Damping at the start, its factors after a success and a failure, and its least value after each.
const DAMPING: f64 = 1e-3;
const EASE: [f64; 2] = [0.2, 1e-5];
const BRAKE: [f64; 2] = [8.0, 1e-2];
/// Trials for one step.
const TRIALS: usize = 3;
/// Largest turn and largest relative change of a step: beyond them the picture says nothing of where it leads.
const LARGEST: f64 = 0.5;
/// What is left of the energy is at best this many times what the next step promises: what cannot get below the ceiling
/// even so is given up.
const HOPE: f64 = 5.0;

/// How far a descent is followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Effort {
    /// Most steps.
    pub(super) iterations: usize,
    /// Relative decrease below which the descent has arrived, from the step `asked_after` on.
    pub(super) arrived: f64,
    pub(super) asked_after: usize,
    /// A step that promises less than this share of the energy is not tried: samples are no finer than that.
    pub(super) promise: f64,
}

/// One resolution: probabilities on cells, a mesh, and how many samples a cell has.
#[derive(Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) target: &'a Target,
    pub(super) mesh: &'a UnitMesh,
    pub(super) grid: &'a SampleGrid,
    pub(super) terms: &'a Terms,
}

/// A state with its energies.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scored {
    pub(super) state: State,
    /// Data term, in reference cells.
    pub(super) data: f64,
    /// Data term and priors.
    pub(super) energy: f64,
}

/// What a descent came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Descent {
    pub(super) end: Scored,
    pub(super) converged: bool,
}

/// Buffers of the renderer and the derivatives, and how often they were used.
#[derive(Clone, Debug, Default)]
pub(super) struct Workspace {
    pub(super) raster: Raster,
    pub(super) flux: Flux,
    pub(super) pictures: usize,
}

impl Workspace {
    /// Draws a state and compares it.
    pub(super) fn score(&mut self, view: &View, state: &State) -> Scored {
        let samples = view.grid.camera.size[0] as usize;
        self.raster.draw(view.mesh, &state.projection(view.grid), samples);
        self.pictures += 1;
        let data = data_energy(view.target, &self.raster);
        Scored { state: *state, data, energy: data + view.terms.energy(state) }
    }

    /// Normal equations of the state that was scored last.
    pub(super) fn equations(&mut self, view: &View, state: &State) -> NormalEquations {
        let count = view.terms.count();
        self.flux.collect(view.target, &self.raster, &view.grid.camera, state, count);
        let mut equations = self.flux.normal_equations(view.target, &self.raster);
        view.terms.add(state, &mut equations);
        equations
    }

    /// Goes downhill; the end is never higher than the start. What is not going to get below `ceiling` is given up.
    pub(super) fn descend(
        &mut self,
        view: &View,
        start: &State,
        effort: &Effort,
        ceiling: f64,
    ) -> Descent {
        let mut here = self.score(view, start);
        let mut damping = DAMPING;
        for iteration in 0..effort.iterations {
            let equations = self.equations(view, &here.state);
            let before = here.energy;
            let mut accepted = false;
            for trial in 0..TRIALS {
                let step = solve(&equations, view.terms.count(), damping);
                let promise = step.map_or(0.0, |step| promised(&equations, &step));
                if trial == 0 && before - HOPE * promise > ceiling {
                    return Descent { end: here, converged: false };
                }
                if step.is_some() && promise < effort.promise * before {
                    break;
                }
                let next = step.map(|step| here.state.updated(&step)).filter(State::is_usable);
                if let Some(next) = next {
                    let scored = self.score(view, &next);
                    if scored.energy < here.energy {
                        here = scored;
                        damping = (damping * EASE[0]).max(EASE[1]);
                        accepted = true;
                        break;
                    }
                }
                damping = (damping * BRAKE[0]).max(BRAKE[1]);
            }
            let decrease = before - here.energy;
            let asked = iteration >= effort.asked_after;
            if !accepted || (asked && decrease < effort.arrived * before) {
                return Descent { end: here, converged: true };
            }
        }
        Descent { end: here, converged: false }
    }
}

/// The decrease that the quadratic model promises for a step.
fn promised(equations: &NormalEquations, step: &[f64; PARAMETERS]) -> f64 {
    let step = SVector::from(*step);
    -equations.gradient.dot(&step) - 0.5 * step.dot(&(equations.hessian * step))
}

/// `-(H + damping diag H)^-1 g`, no longer than a picture can vouch for; `None` if it is not a number.
fn solve(equations: &NormalEquations, count: usize, damping: f64) -> Option<[f64; PARAMETERS]> {
    let mut hessian = equations.hessian;
    let largest = hessian.diagonal().max();
    for i in 0..PARAMETERS {
        // An increment that moves nothing stays where it is.
        hessian[(i, i)] += damping * hessian[(i, i)] + 1e-9 * largest + 1e-12;
        if i >= count {
            hessian[(i, i)] = 1.0;
        }
    }
    let step: SVector<f64, PARAMETERS> = hessian.cholesky()?.solve(&(-equations.gradient));
    let mut step: [f64; PARAMETERS] = step.into();
    let size = [0, 1, 2, 5, 6, 7, 8].map(|i: usize| step[i].abs()).into_iter().fold(0.0, f64::max);
    if !size.is_finite() {
        return None;
    }
    if size > LARGEST {
        for value in &mut step {
            *value *= LARGEST / size;
        }
    }
    Some(step)
}
