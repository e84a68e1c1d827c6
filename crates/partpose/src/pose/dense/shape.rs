//! The shape of vehicles that know how they were made: some of their measures, fitted beside pose and size.
//!
//! A parametric model is a point in a space of measures ([`ParametricVehicle`]). Of each measure here two bodies are built
//! beforehand, a step either way. Drawn at the pose they give the derivatives of all cells by the measure (central
//! differences), which join those of the pose in one Gauss-Newton step; the body of the new measures is then built and
//! drawn. A measure is expected to be the model's own, give or take what it differs by among the models of about the same
//! size (`ShapeModel::spread`).

use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector};

use crate::vehicle::{ParametricVehicle, VehicleModel};

use super::lm::{Scored, View, Workspace};
use super::state::{PARAMETERS, State};
use super::target::LANES;
use super::unit_mesh::UnitMesh;

/// A measure that is fitted: its name, the measures that move with it, and the least spread that it has.
struct Measure {
    name: &'static str,
    moves: &'static [&'static str],
    least: f64,
}

const fn measure(name: &'static str, moves: &'static [&'static str], least: f64) -> Measure {
    Measure { name, moves, least }
}

/// What outlines and seams show of a body whose length, width and height are given: where its axles are, how the
/// greenhouse stands on it, how high hood and windows begin.
const MEASURES: [Measure; COUNT] = [
    measure("wheelbase", &["wheelbase"], 0.04),
    measure("front_overhang", &["front_overhang"], 0.03),
    measure("cowl_setback", &["cowl_setback"], 0.04),
    measure("windscreen_rake", &["windscreen_rake"], 2.0),
    measure("deck_length", &["deck_length"], 0.03),
    measure("rear_window_rake", &["rear_window_rake"], 2.0),
    measure("hood_height", &["hood_front_height", "cowl_height"], 0.02),
    measure("belt_height", &["belt_front", "belt_rear"], 0.02),
];
const COUNT: usize = 8;

/// Models of about the same size that tell how much measures differ.
const NEAREST: usize = 4;
/// Step of the differences, in standard deviations.
const STEP: f64 = 0.7;
/// Most steps, and the factors on a step that are tried.
const STEPS: usize = 4;
const FACTORS: [f64; 3] = [1.0, 0.5, 0.2];
/// Farthest from a model's own measures, in standard deviations.
const FARTHEST: f64 = 3.0;
/// Relative decrease of the energy below which the fit has arrived.
const ARRIVED: f64 = 5e-3;

/// One fitted measure of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ShapeMeasure {
    /// Its name; `hood_height` moves the hood's front edge and its rear edge, `belt_height` both ends of the windows'
    /// lower edge; all others are those of [`ParametricVehicle`].
    pub name: &'static str,
    /// What was fitted, metres or degrees: of the first measure that moves, before the model is scaled.
    pub value: f64,
    /// What the model has.
    pub of_model: f64,
    /// The standard deviation that was expected.
    pub spread: f64,
}

/// A model whose measures can be changed.
#[derive(Clone, Debug)]
pub(super) struct ShapeModel {
    vehicle: ParametricVehicle,
    spread: [f64; COUNT],
    bodies: OnceLock<Option<Box<Bodies>>>,
}

/// The model as it is, and a step either way.
#[derive(Clone, Debug)]
struct Bodies {
    own: UnitMesh,
    beside: [[Option<UnitMesh>; 2]; COUNT],
}

/// A fit with the shape that it found.
pub(super) struct Shaped {
    pub(super) scored: Scored,
    pub(super) mesh: UnitMesh,
    pub(super) measures: Vec<ShapeMeasure>,
}

impl ShapeModel {
    /// `None` for models that were not built from measures.
    pub(super) fn new(model: &VehicleModel) -> Option<Self> {
        let vehicle = ParametricVehicle::of(model)?;
        let mut near: Vec<(f64, ParametricVehicle)> = ParametricVehicle::all()
            .into_iter()
            .filter(|other| other.name != vehicle.name)
            .map(|other| (size_distance(&vehicle, &other), other))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let spread = std::array::from_fn(|k| {
            let own = value(&vehicle, k);
            let squares =
                near.iter().take(NEAREST).map(|(_, other)| (value(other, k) - own).powi(2));
            (squares.sum::<f64>() / NEAREST as f64).sqrt().max(MEASURES[k].least)
        });
        Some(Self { vehicle, spread, bodies: OnceLock::new() })
    }

    /// The body with measures so many standard deviations off; `None` where they make no vehicle.
    fn body(&self, shape: &[f64; COUNT]) -> Option<UnitMesh> {
        let mut vehicle = self.vehicle.clone();
        for (measure, step) in MEASURES.iter().zip(shape.iter().zip(&self.spread)) {
            for (name, value) in vehicle.measures_mut() {
                if measure.moves.contains(&name) {
                    *value += step.0 * step.1;
                }
            }
        }
        let model = vehicle.build().ok()?;
        Some(UnitMesh::new(model.mesh(), &model.extent()))
    }

    /// Built when they are first asked for: ten to twenty milliseconds a body.
    fn bodies(&self) -> Option<&Bodies> {
        let build = || {
            let beside = std::array::from_fn(|k| {
                [STEP, -STEP].map(|step| {
                    let mut shape = [0.0; COUNT];
                    shape[k] = step;
                    self.body(&shape)
                })
            });
            Some(Box::new(Bodies { own: self.body(&[0.0; COUNT])?, beside }))
        };
        self.bodies.get_or_init(build).as_deref()
    }

    /// Goes on from a fit with the model's own shape; `None` where no other shape is better.
    pub(super) fn fit(&self, work: &mut Workspace, view: &View, start: &State) -> Option<Shaped> {
        let bodies = self.bodies()?;
        let own = work.score(&View { mesh: &bodies.own, ..*view }, start);
        let (mut here, mut mesh, mut shape) = (own, bodies.own.clone(), [0.0; COUNT]);
        let noise = view.terms.noise;
        let total = |scored: &Scored, shape: &[f64; COUNT]| {
            scored.energy + 0.5 * noise * shape.iter().map(|s| s * s).sum::<f64>()
        };
        for _ in 0..STEPS {
            let Some(step) =
                step(work, &View { mesh: &mesh, ..*view }, (&here.state, &shape), bodies)
            else {
                break;
            };
            let before = total(&here, &shape);
            let better = FACTORS.iter().find_map(|factor| {
                let mut pose = [0.0; PARAMETERS];
                let mut next = shape;
                let count = step.len() - COUNT;
                for (i, value) in step.iter().enumerate() {
                    if i < count {
                        pose[i] = factor * value;
                    } else {
                        next[i - count] =
                            (next[i - count] + factor * value).clamp(-FARTHEST, FARTHEST);
                    }
                }
                let state = Some(here.state.updated(&pose)).filter(State::is_usable)?;
                let body = self.body(&next)?;
                let scored = work.score(&View { mesh: &body, ..*view }, &state);
                (total(&scored, &next) < before).then_some((scored, body, next))
            });
            let Some(better) = better else { break };
            (here, mesh, shape) = better;
            if before - total(&here, &shape) < ARRIVED * before {
                break;
            }
        }
        let measures = (0..COUNT).map(|k| {
            let of_model = value(&self.vehicle, k);
            let spread = self.spread[k];
            ShapeMeasure {
                name: MEASURES[k].name,
                value: of_model + spread * shape[k],
                of_model,
                spread,
            }
        });
        (here.energy < own.energy).then(|| Shaped {
            scored: here,
            mesh,
            measures: measures.collect(),
        })
    }
}

/// The Gauss-Newton step of pose (and size) and shape together.
fn step(
    work: &mut Workspace,
    view: &View,
    (state, shape): (&State, &[f64; COUNT]),
    bodies: &Bodies,
) -> Option<DVector<f64>> {
    let target = view.target;
    let (m, count) = (target.cells, view.terms.count());
    work.score(view, state);
    let equations = work.equations(view, state);
    let here = shares(work, m);
    let columns: Vec<Vec<[f32; LANES]>> =
        bodies.beside.iter().map(|pair| difference(work, view, state, pair, &bodies.own)).collect();
    let size = count + COUNT;
    let mut hessian = DMatrix::<f64>::zeros(size, size);
    let mut gradient = DVector::<f64>::zeros(size);
    for i in 0..count {
        gradient[i] = equations.gradient[i];
        for j in 0..count {
            hessian[(i, j)] = equations.hessian[(i, j)];
        }
    }
    for cell in (0..m * m).filter(|cell| target.weights[*cell] > 0.0) {
        let weight = f64::from(target.weights[cell]);
        let slopes: Vec<_> = work.flux.of_cell(cell).collect();
        for (k, column) in columns.iter().enumerate() {
            let column = &column[cell];
            let dot = |other: &[f32; LANES]| -> f64 {
                column.iter().zip(other).map(|(a, b)| f64::from(a * b)).sum()
            };
            let residual = std::array::from_fn(|l| here[cell][l] - target.probabilities[cell][l]);
            gradient[count + k] += weight * dot(&residual);
            for (l, other) in columns.iter().enumerate().take(k + 1) {
                hessian[(count + k, count + l)] += weight * dot(&other[cell]);
            }
            for slope in &slopes {
                let share = weight * f64::from(column[usize::from(slope.label)]);
                for (i, by) in slope.by.iter().enumerate().take(count) {
                    hessian[(count + k, i)] += share * f64::from(*by);
                }
            }
        }
    }
    for (k, off) in shape.iter().enumerate() {
        hessian[(count + k, count + k)] += view.terms.noise;
        gradient[count + k] += view.terms.noise * off;
    }
    hessian.fill_upper_triangle_with_lower_triangle();
    for i in 0..size {
        hessian[(i, i)] = hessian[(i, i)] * (1.0 + 1e-3) + 1e-12;
    }
    let step = hessian.cholesky()?.solve(&-gradient);
    step.iter().all(|value| value.is_finite()).then_some(step)
}

/// The derivative of every cell's shares by one measure; nothing where neither body could be built.
fn difference(
    work: &mut Workspace,
    view: &View,
    state: &State,
    pair: &[Option<UnitMesh>; 2],
    own: &UnitMesh,
) -> Vec<[f32; LANES]> {
    let m = view.target.cells;
    let width = pair.iter().flatten().count() as f32 * STEP as f32;
    let [mut after, before] = pair.each_ref().map(|body| {
        work.score(&View { mesh: body.as_ref().unwrap_or(own), ..*view }, state);
        shares(work, m)
    });
    for (after, before) in after.iter_mut().zip(&before) {
        for (after, before) in after.iter_mut().zip(before) {
            *after = if width > 0.0 { (*after - before) / width } else { 0.0 };
        }
    }
    after
}

/// The share of every label in every cell of the last picture.
fn shares(work: &Workspace, cells: usize) -> Vec<[f32; LANES]> {
    let raster = &work.raster;
    let side = raster.size / cells;
    let unit = 1.0 / (side * side) as f32;
    let mut shares = vec![[0.0; LANES]; cells * cells];
    for (at, label) in raster.labels.iter().enumerate() {
        let cell = at / raster.size / side * cells + at % raster.size / side;
        shares[cell][usize::from(*label)] += unit;
    }
    shares
}

/// The measure that stands for what moves with it.
fn value(vehicle: &ParametricVehicle, measure: usize) -> f64 {
    let mut vehicle = vehicle.clone();
    let first = MEASURES[measure].moves[0];
    vehicle.measures_mut().into_iter().find(|(name, _)| *name == first).map_or(0.0, |(_, v)| *v)
}

fn size_distance(a: &ParametricVehicle, b: &ParametricVehicle) -> f64 {
    (a.length - b.length).abs() + (a.width - b.width).abs() + (a.height - b.height).abs()
}
