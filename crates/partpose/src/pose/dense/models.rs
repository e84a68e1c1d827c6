//! All models of a zoo against one detection, from coarse to fine.

use std::f64::consts::TAU;

use crate::geometry::{Camera, Extent, Point3, Vector3};
use crate::parts::PartMap;
use crate::pose::{Center3d, model_centers};
use crate::vehicle::simplify::simplify_mesh;
use crate::vehicle::{Mesh, VehicleModel};

use super::bias::{MaskBias, SampleGrid};
use super::hypotheses::{HEADINGS, Outline, from_centers, upright};
use super::lm::{Descent, Scored, View, Workspace};
use super::priors::Terms;
use super::raster::UnitMesh;
use super::state::State;
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
    Level { faces: 3000, cells: 56, samples: 112, iterations: 10 },
];

/// A model ready to be drawn at every level.
#[derive(Clone, Debug)]
pub(super) struct DenseModel {
    pub(super) extent: Extent,
    meshes: [UnitMesh; 3],
    /// Vertices of the coarsest mesh, half-extent units.
    pub(super) vertices: Vec<Vector3>,
    /// Centres of the parts, half-extent units.
    centers: PartMap<Point3>,
}

impl DenseModel {
    pub(super) fn new(model: &VehicleModel) -> Self {
        let extent = model.extent();
        let mesh = |level: &Level| UnitMesh::new(&simplified(model.mesh(), level.faces), &extent);
        let meshes = LEVELS.each_ref().map(mesh);
        let vertices = meshes[0].vertices().collect();
        let side = extent.to_vector() * 0.5;
        let up = Vector3::new(0.0, side.y, 0.0);
        let centers = model_centers(model, Center3d::Mass)
            .map(|_, center| Point3::from((center.coords + up).component_div(&side)));
        Self { extent, meshes, vertices, centers }
    }
}

/// Relative change of the volume, and change of a side of the bounding box as a share of it, that simplification may
/// bring about.
const MOST_CHANGE: f64 = 0.03;

/// The mesh with about so many faces, or more where fewer would be another shape: tangled meshes collapse badly.
fn simplified(mesh: &Mesh, faces: usize) -> Mesh {
    let mut most = faces;
    while most < mesh.faces.len() {
        let simple = simplify_mesh(mesh, most);
        if is_alike(mesh, &simple) {
            return simple;
        }
        most *= 2;
    }
    mesh.clone()
}

fn is_alike(mesh: &Mesh, simple: &Mesh) -> bool {
    let (Some(a), Some(b)) = (mesh.bounds(), simple.bounds()) else { return false };
    let sides = a.1 - a.0;
    let near = |i: usize, p: f64, q: f64| (p - q).abs() <= MOST_CHANGE * sides[i];
    let (own, other) = (mesh.volume(), simple.volume());
    (0..3).all(|i| near(i, a.0[i], b.0[i]) && near(i, a.1[i], b.1[i]))
        && (own - other).abs() <= MOST_CHANGE * own.abs()
}

/// A detection at every level.
#[derive(Clone, Debug)]
pub(super) struct Pyramid {
    pub(super) targets: [Target; 3],
    pub(super) grids: [SampleGrid; 3],
    /// The camera of the image.
    pub(super) camera: Camera,
}

impl Pyramid {
    pub(super) fn new(target: &Target, camera: &Camera, bias: Option<MaskBias>) -> Self {
        let pooled = |level: &Level| {
            if target.cells <= level.cells { target.clone() } else { target.pooled(level.cells) }
        };
        let targets = LEVELS.each_ref().map(pooled);
        let grids = std::array::from_fn(|i| {
            let target = &targets[i];
            let per_cell = LEVELS[i].samples.div_ceil(target.cells).max(1);
            target.grid(camera, per_cell * target.cells, bias)
        });
        Self { targets, grids, camera: *camera }
    }

    pub(super) fn view<'a>(&'a self, level: usize, candidate: &'a Candidate) -> View<'a> {
        View {
            target: &self.targets[level],
            mesh: &candidate.model.meshes[level],
            grid: &self.grids[level],
            terms: &candidate.terms,
        }
    }
}

/// A pose of one model, at the finest level that it reached.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hypothesis {
    pub(super) model: usize,
    pub(super) scored: Scored,
    pub(super) level: usize,
    pub(super) converged: bool,
}

/// A model with the size and the priors that it is fitted with.
#[derive(Clone, Copy)]
pub(super) struct Candidate<'a> {
    pub(super) model: &'a DenseModel,
    pub(super) half: Vector3,
    pub(super) terms: Terms,
}

/// How widely is searched.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Models of which every heading is tried; the others start where those do.
    pub(super) scouts: usize,
    /// Headings of each model that are followed.
    pub(super) headings: usize,
    /// Factors on the distance that is supposed of vehicles which the image cuts or others hide.
    pub(super) depths: &'static [f64],
    /// Hypotheses that reach the middle and the fine level.
    pub(super) keep: [usize; 2],
    /// A hypothesis whose energy is more than this many times the best's does not reach that level.
    pub(super) hopeless: [f64; 2],
}

/// What is searched usually.
pub(super) const NARROW: Search = Search {
    scouts: 4,
    headings: 2,
    depths: &[1.0, 0.65, 0.42],
    keep: [12, 5],
    hopeless: [2.5, 1.4],
};
/// What is searched where that finds nothing good: cut and hidden vehicles, mostly.
pub(super) const WIDE: Search = Search {
    scouts: 64,
    headings: 6,
    depths: &[1.2, 1.0, 0.8, 0.6, 0.45, 0.33],
    keep: [16, 4],
    hopeless: [2.5, 1.3],
};

/// Angle between rotations below which two hypotheses of a model are one, radians.
pub(super) const NEIGHBOURS: f64 = 0.5;

/// Every hypothesis that was followed, the finest first, the best first among equally fine ones.
pub(super) fn search(
    work: &mut Workspace,
    pyramid: &Pyramid,
    outline: &Outline,
    candidates: &[Candidate],
    search: &Search,
) -> Vec<Hypothesis> {
    let mut done: Vec<Hypothesis> = Vec::new();
    let mut pool: Vec<Hypothesis> = Vec::new();
    // Where the scouts' headings led: starts for all others.
    let mut common: Vec<State> = Vec::new();
    for (index, candidate) in candidates.iter().enumerate() {
        let view = pyramid.view(0, candidate);
        let scored = if index < search.scouts {
            headings(work, pyramid, outline, candidate, search.depths)
        } else {
            let start = |state: &State| State { half: candidate.half, ..*state };
            common.iter().map(|state| work.score(&view, &start(state))).collect()
        };
        let starts = distinct(scored, search.headings);
        for start in starts {
            let descent = work.descend(&view, &start.state, LEVELS[0].iterations);
            if index < search.scouts {
                common.push(descent.end.state);
            }
            pool.push(Hypothesis::new(index, 0, &descent));
        }
    }
    for level in 1..LEVELS.len() {
        sort(&mut pool);
        let next = promoted(&pool, search, level - 1);
        done.append(&mut pool);
        for hypothesis in next {
            let view = pyramid.view(level, &candidates[hypothesis.model]);
            let start = hypothesis.scored.state;
            let descent = work.descend(&view, &start, LEVELS[level].iterations);
            pool.push(Hypothesis::new(hypothesis.model, level, &descent));
        }
    }
    done.append(&mut pool);
    sort(&mut done);
    done
}

/// What goes on to the next level: the best of each model in turn, then their others.
fn promoted(pool: &[Hypothesis], search: &Search, step: usize) -> Vec<Hypothesis> {
    let best = pool.first().map_or(0.0, |h| h.scored.energy);
    let hopeful = || pool.iter().filter(|h| h.scored.energy <= search.hopeless[step] * best);
    let mut next: Vec<Hypothesis> = Vec::new();
    for of_own_model in [true, false] {
        for hypothesis in hopeful() {
            let taken = |other: &Hypothesis| {
                if of_own_model {
                    hypothesis.model == other.model
                } else {
                    hypothesis.repeats(other)
                }
            };
            if next.len() < search.keep[step] && !next.iter().any(taken) {
                next.push(*hypothesis);
            }
        }
    }
    next
}

impl Hypothesis {
    fn new(model: usize, level: usize, descent: &Descent) -> Self {
        Self { model, scored: descent.end, level, converged: descent.converged }
    }

    /// Whether it is the same model at about the same rotation.
    pub(super) fn repeats(&self, other: &Self) -> bool {
        let (a, b) = (&self.scored.state, &other.scored.state);
        self.model == other.model
            && a.rotation.angle_to(&b.rotation) < 0.1
            && (a.center - b.center).norm() < 0.05 * a.center.norm()
    }
}

/// The finest first, then the best.
pub(super) fn sort(hypotheses: &mut [Hypothesis]) {
    hypotheses
        .sort_by(|a, b| b.level.cmp(&a.level).then(a.scored.energy.total_cmp(&b.scored.energy)));
}

/// Headings all around and what centres of parts say, drawn coarsely.
fn headings(
    work: &mut Workspace,
    pyramid: &Pyramid,
    outline: &Outline,
    candidate: &Candidate,
    depths: &'static [f64],
) -> Vec<Scored> {
    let (model, half) = (candidate.model, &candidate.half);
    let view = pyramid.view(0, candidate);
    let down = view.terms.down();
    let depths = if outline.is_whole() { &[1.0] } else { depths };
    let mut scored = Vec::with_capacity(HEADINGS * depths.len() + 2);
    for index in 0..HEADINGS {
        let rotation = upright(&down, index as f64 / HEADINGS as f64 * TAU);
        for nearer in depths {
            if let Some(state) = outline.place(&model.vertices, &rotation, half, *nearer) {
                scored.push(work.score(&view, &state));
            }
        }
    }
    for state in from_centers(&pyramid.targets[1], &pyramid.camera, &model.centers, half) {
        scored.push(work.score(&view, &state));
    }
    scored
}

/// The best `keep` that differ in rotation.
fn distinct(mut scored: Vec<Scored>, keep: usize) -> Vec<Scored> {
    scored.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    let mut kept: Vec<Scored> = Vec::new();
    for one in &scored {
        let is_new =
            |other: &Scored| one.state.rotation.angle_to(&other.state.rotation) > NEIGHBOURS;
        if kept.len() < keep && kept.iter().all(is_new) {
            kept.push(*one);
        }
    }
    kept
}
