//! The derivative against differences, the gauge, and what must hold for every picture.

use nalgebra::{SVector, UnitQuaternion};

use super::bias::MaskBias;
use super::energy::data_energy;
use super::hypotheses::upright;
use super::lm::{Effort, View, Workspace};
use super::priors::{DensePriors, GravityPrior, GroundPrior, SizePrior, SizeTerm, Terms};
use super::state::{PARAMETERS, State};
use super::target::{LANES, Target};
use super::unit_mesh::UnitMesh;
use crate::geometry::{Camera, Cuboid, Rect, Vector3};
use crate::vehicle::ModelZoo;

const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
const CELLS: usize = 14;

fn mesh() -> (UnitMesh, Vector3) {
    let zoo = ModelZoo::embedded();
    let model = &zoo.models[0];
    (UnitMesh::new(model.mesh(), &model.extent()), model.extent().to_vector() * 0.5)
}

fn state(half: Vector3) -> State {
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.02, 0.0, -0.01));
    let center = Vector3::new(2.5, 0.9, 14.0);
    State { rotation: tilt * upright(&Vector3::y(), 0.7), center, half }
}

fn terms(free: bool, half: Vector3) -> Terms {
    let extent = State { half, ..state(half) }.extent();
    let size = SizeTerm::new(&SizePrior::around(None), &extent, None).filter(|_| free);
    Terms { priors: DensePriors::default(), size, model: 0.0, noise: 1.0 }
}

fn bounds(state: &State) -> Rect {
    let cuboid = Cuboid { camera_from_vehicle: state.pose(), extent: state.extent() };
    cuboid.project(&CAMERA).unwrap()
}

/// Probabilities that are the drawn fractions of a state, at `s` samples a cell side.
fn target_of(work: &mut Workspace, mesh: &UnitMesh, state: &State, s: usize) -> Target {
    let blank = Target {
        cells: CELLS,
        probabilities: vec![[0.0; LANES]; CELLS * CELLS],
        weights: vec![1.0; CELLS * CELLS],
        squares: vec![0.0; CELLS * CELLS],
        bounds: bounds(state),
    };
    let grid = blank.grid(&CAMERA, s * CELLS, None);
    work.raster.draw(mesh, &state.projection(&grid), s * CELLS);
    let probabilities = fractions(work, s);
    let squares = probabilities.iter().map(|q| q.iter().map(|v| v * v).sum()).collect();
    Target { probabilities, squares, ..blank }
}

fn fractions(work: &Workspace, s: usize) -> Vec<[f32; LANES]> {
    let n = s * CELLS;
    let mut all = vec![[0.0; LANES]; CELLS * CELLS];
    for (at, label) in work.raster.labels.iter().enumerate() {
        let cell = (at / n / s) * CELLS + at % n / s;
        all[cell][usize::from(*label)] += 1.0 / (s * s) as f32;
    }
    all
}

#[test]
fn the_flux_agrees_with_central_differences() {
    const S: usize = 8;
    let (mesh, half) = mesh();
    let state = state(half);
    let mut work = Workspace::default();
    let target = target_of(&mut work, &mesh, &state, S);
    let grid = target.grid(&CAMERA, S * CELLS, None);
    work.flux.collect(&target, &work.raster.clone(), &grid.camera, &state, PARAMETERS);
    let slopes: Vec<(usize, u8, [f32; PARAMETERS])> = (0..CELLS * CELLS)
        .flat_map(|cell| work.flux.of_cell(cell).map(move |s| (cell, s.label, s.by)))
        .collect();
    let steps = [0.02, 0.02, 0.02, 0.03, 0.03, 0.02, 0.04, 0.03, 0.03];
    for (parameter, step) in steps.into_iter().enumerate() {
        let mut change = [0.0; PARAMETERS];
        let mut at = |sign: f64| {
            change[parameter] = sign * step;
            work.raster.draw(&mesh, &state.updated(&change).projection(&grid), S * CELLS);
            fractions(&work, S)
        };
        let (ahead, behind) = (at(1.0), at(-1.0));
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for cell in 0..CELLS * CELLS {
            for label in 0..LANES {
                let difference = f64::from(ahead[cell][label] - behind[cell][label]) / (2.0 * step);
                let slope = slopes
                    .iter()
                    .find(|(c, l, _)| *c == cell && usize::from(*l) == label)
                    .map_or(0.0, |(_, _, by)| f64::from(by[parameter]));
                ab += slope * difference;
                aa += slope * slope;
                bb += difference * difference;
            }
        }
        let correlation = ab / (aa * bb).sqrt();
        assert!(correlation > 0.95, "increment {parameter}: {correlation:.3}");
        let scale = ab / bb;
        assert!((0.85..1.15).contains(&scale), "increment {parameter}: {scale:.3}");
    }
}

#[test]
fn larger_and_farther_is_the_same_picture_and_no_cell_gains() {
    let (mesh, half) = mesh();
    let state = state(half);
    let mut work = Workspace::default();
    let target = target_of(&mut work, &mesh, &state, 4);
    let grid = target.grid(&CAMERA, 4 * CELLS, None);
    work.flux.collect(&target, &work.raster.clone(), &grid.camera, &state, PARAMETERS);
    let mut count = 0;
    for cell in 0..CELLS * CELLS {
        let mut sums = [0.0f32; PARAMETERS];
        for slope in work.flux.of_cell(cell) {
            let gauge = slope.by[5] + slope.by[6] + slope.by[7] + slope.by[8];
            let size = slope.by[5].abs() + slope.by[8].abs();
            assert!(gauge.abs() < 1e-4 * (1.0 + size), "{gauge}");
            sums.iter_mut().zip(&slope.by).for_each(|(sum, by)| *sum += by);
            count += 1;
        }
        assert!(sums.iter().all(|sum| sum.abs() < 1e-4), "{sums:?}");
    }
    assert!(count > 100);
}

#[test]
fn a_descent_never_ends_above_its_start_and_finds_the_pose() {
    let (mesh, half) = mesh();
    let truth = state(half);
    let mut work = Workspace::default();
    let target = target_of(&mut work, &mesh, &truth, 8);
    let grid = target.grid(&CAMERA, 4 * CELLS, None);
    let terms = terms(false, half);
    let view = View { target: &target, mesh: &mesh, grid: &grid, terms: &terms };
    let effort = Effort { iterations: 15, arrived: 2e-4, asked_after: 2, promise: 1e-4 };
    for turn in [-0.15, 0.0, 0.15] {
        let start = truth.updated(&[0.0, turn, 0.0, 0.2, -0.1, 0.04, 0.0, 0.0, 0.0]);
        let before = work.score(&view, &start).energy;
        let descent = work.descend(&view, &start, &effort, f64::INFINITY);
        assert!(descent.end.energy <= before);
        let away = (descent.end.state.center - truth.center).norm();
        assert!(away < 0.12, "{away}");
        assert!(descent.end.state.rotation.angle_to(&truth.rotation) < 0.02);
    }
}

#[test]
fn energy_of_the_own_fractions_is_nothing() {
    let (mesh, half) = mesh();
    let mut work = Workspace::default();
    let target = target_of(&mut work, &mesh, &state(half), 4);
    assert!(data_energy(&target, &work.raster).abs() < 1e-3);
}

#[test]
fn priors_have_the_derivatives_of_their_energy() {
    let (_, half) = mesh();
    let state = state(half);
    let mut terms = terms(true, half);
    let down = Vector3::new(0.05, 1.0, -0.1).normalize();
    terms.priors = DensePriors {
        gravity: Some(GravityPrior { down_in_camera: down, sigma: 0.02 }),
        ground: Some(GroundPrior { normal_in_camera: down, offset: 1.5, sigma: 0.05 }),
    };
    terms.noise = 0.3;
    let here = state.updated(&[0.01, 0.0, -0.02, 0.1, 0.0, 0.01, 0.03, -0.02, 0.01]);
    let mut equations = super::jacobian::NormalEquations {
        hessian: nalgebra::SMatrix::zeros(),
        gradient: SVector::zeros(),
    };
    terms.add(&here, &mut equations);
    for i in 0..PARAMETERS {
        let at = |step: f64| {
            let mut change = [0.0; PARAMETERS];
            change[i] = step;
            terms.energy(&here.updated(&change))
        };
        let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
        let gradient = equations.gradient[i];
        assert!((difference - gradient).abs() < 1e-3 * (1.0 + gradient.abs()), "{i}");
    }
}

#[test]
fn a_mask_that_is_smaller_is_drawn_smaller() {
    let (mesh, half) = mesh();
    let state = state(half);
    let mut work = Workspace::default();
    let target = target_of(&mut work, &mesh, &state, 4);
    let n = 8 * CELLS;
    let mut draw = |bias: Option<MaskBias>| {
        let grid = target.grid(&CAMERA, n, bias);
        work.raster.draw(&mesh, &state.projection(&grid), n);
        let rows: Vec<usize> =
            (0..n).filter(|y| (0..n).any(|x| work.raster.labels[y * n + x] != 0)).collect();
        let per_pixel = grid.per_pixel[1];
        (rows[0] as f64 / per_pixel, rows[rows.len() - 1] as f64 / per_pixel)
    };
    let (top, bottom) = draw(None);
    let bias = MaskBias { offset: [0.0, -1.0, 0.0, -3.0], per_distance: [0.0; 4] };
    let (low, high) = draw(Some(bias));
    assert!((low - top - 1.0).abs() < 0.6, "{}", low - top);
    assert!((bottom - high - 3.0).abs() < 0.6, "{}", bottom - high);
}
