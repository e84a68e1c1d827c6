//! All models of a zoo against one detection, from coarse to fine.

use std::f64::consts::TAU;

use crate::geometry::{Camera, Extent, Vector3};
use crate::vehicle::VehicleModel;
use crate::vehicle::simplify::simplify_mesh;

use super::hypotheses::{HEADINGS, Outline, upright};
use super::lm::{Descent, Scored, View, Workspace};
use super::priors::Terms;
use super::raster::UnitMesh;
use super::target::Target;

/// One resolution of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Faces of the mesh.
    pub(super) faces: usize,
    /// Most cells a side.
    pub(super) cells: usize,
    /// Samples a side, about.
    pub(super) samples: usize,
    /// Steps of the descent.
    pub(super) iterations: usize,
}

/// Coarse for headings, middle for models, fine for the pose.
pub(super) const LEVELS: [Level; 3] = [
    Level { faces: 250, cells: 14, samples: 28, iterations: 5 },
    Level { faces: 800, cells: 28, samples: 56, iterations: 8 },
    Level { faces: 3000, cells: 56, samples: 112, iterations: 12 },
];

/// A model ready to be drawn at every level.
#[derive(Clone, Debug)]
pub(super) struct DenseModel {
    pub(super) extent: Extent,
    meshes: [UnitMesh; 3],
    /// Vertices of the coarsest mesh, half-extent units.
    vertices: Vec<Vector3>,
}

impl DenseModel {
    pub(super) fn new(model: &VehicleModel) -> Self {
        let extent = model.extent();
        let mesh = |level: &Level| {
            if model.mesh().faces.len() <= level.faces {
                return UnitMesh::new(model.mesh(), &extent);
            }
            UnitMesh::new(&simplify_mesh(model.mesh(), level.faces), &extent)
        };
        let meshes = LEVELS.each_ref().map(mesh);
        let vertices = meshes[0].vertices().collect();
        Self { extent, meshes, vertices }
    }
}

/// A detection at every level.
#[derive(Clone, Debug)]
pub(super) struct Pyramid {
    pub(super) targets: [Target; 3],
    pub(super) cameras: [Camera; 3],
}

impl Pyramid {
    pub(super) fn new(target: &Target, camera: &Camera) -> Self {
        let pooled = |level: &Level| {
            if target.cells <= level.cells { target.clone() } else { target.pooled(level.cells) }
        };
        let targets = LEVELS.each_ref().map(pooled);
        let cameras = std::array::from_fn(|i| {
            let target = &targets[i];
            let per_cell = LEVELS[i].samples.div_ceil(target.cells).max(1);
            target.camera(camera, per_cell * target.cells)
        });
        Self { targets, cameras }
    }

    pub(super) fn view<'a>(
        &'a self,
        level: usize,
        model: &'a DenseModel,
        terms: &'a Terms,
    ) -> View<'a> {
        View {
            target: &self.targets[level],
            mesh: &model.meshes[level],
            camera: &self.cameras[level],
            terms,
        }
    }
}

/// A pose of one model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    pub(super) model: usize,
    pub(super) scored: Scored,
    pub(super) converged: bool,
}

impl Hypothesis {
    fn new(model: usize, descent: &Descent) -> Self {
        Self { model, scored: descent.end, converged: descent.converged }
    }
}

/// Angle between headings below which two hypotheses are one, radians.
const NEIGHBOURS: f64 = 0.5;

/// The best headings of one model, drawn coarsely; none is near a better one.
pub(super) fn headings(
    work: &mut Workspace,
    outline: &Outline,
    view: &View,
    model: &DenseModel,
    half: &Vector3,
    keep: usize,
) -> Vec<Scored> {
    let down = view.terms.down();
    let mut scored = Vec::with_capacity(2 * HEADINGS);
    let depths: &[f64] = if outline.tells_distance() { &[1.0] } else { &[1.0, 0.7] };
    for index in 0..HEADINGS {
        let rotation = upright(&down, index as f64 / HEADINGS as f64 * TAU);
        for nearer in depths {
            if let Some(state) = outline.place(&model.vertices, &rotation, half, *nearer) {
                scored.push(work.score(view, &state));
            }
        }
    }
    scored.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    distinct(&scored, keep)
}

/// The first `keep` of a sorted list that differ in rotation.
pub(super) fn distinct(sorted: &[Scored], keep: usize) -> Vec<Scored> {
    let mut kept: Vec<Scored> = Vec::new();
    for one in sorted {
        let is_new = |other: &Scored| one.state.rotation.angle_to(&other.state.rotation) > NEIGHBOURS;
        if kept.len() < keep && kept.iter().all(is_new) {
            kept.push(*one);
        }
    }
    kept
}

/// How widely is searched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Headings of each model that are followed.
    pub(super) headings: usize,
    /// Hypotheses that reach the middle level.
    pub(super) middle: usize,
    /// Hypotheses that reach the fine level.
    pub(super) fine: usize,
}

/// Hypotheses at the fine level, the best first; every model's best energy at the finest level it reached.
pub(super) fn search(
    work: &mut Workspace,
    pyramid: &Pyramid,
    outline: &Outline,
    models: &[(&DenseModel, Vector3, Terms)],
    search: &Search,
) -> Vec<Hypothesis> {
    let mut pool: Vec<Hypothesis> = Vec::new();
    for (index, (model, half, terms)) in models.iter().enumerate() {
        let view = pyramid.view(0, model, terms);
        for start in headings(work, outline, &view, model, half, search.headings) {
            let descent = work.descend(&view, &start.state, LEVELS[0].iterations);
            pool.push(Hypothesis::new(index, &descent));
        }
    }
    for (level, keep) in [(1, search.middle), (2, search.fine)] {
        pool.sort_by(|a, b| a.scored.energy.total_cmp(&b.scored.energy));
        pool.truncate(keep);
        for hypothesis in &mut pool {
            let (model, _, terms) = &models[hypothesis.model];
            let view = pyramid.view(level, model, terms);
            let descent =
                work.descend(&view, &hypothesis.scored.state, LEVELS[level].iterations);
            *hypothesis = Hypothesis::new(hypothesis.model, &descent);
        }
    }
    pool.sort_by(|a, b| a.scored.energy.total_cmp(&b.scored.energy));
    pool
}
