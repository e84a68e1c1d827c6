//! All models of a zoo against one detection, from coarse to fine.

use std::f64::consts::TAU;

use crate::geometry::{Camera, Extent, Point3, Vector3};
use crate::parts::PartMap;
use crate::pose::{Center3d, model_centers};
use crate::vehicle::simplify::Simplifier;
use crate::vehicle::{Mesh, VehicleModel};

use super::bias::{MaskBias, SampleGrid};
use super::hypotheses::{HEADINGS, Outline, from_centers, upright};
use super::lm::{Descent, Effort, Scored, View, Workspace};
use super::priors::Terms;
use super::shape::ShapeModel;
use super::state::State;
use super::target::Target;
use super::unit_mesh::UnitMesh;

/// One resolution of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Faces of the mesh.
    pub(super) faces: usize,
    /// Most cells a side.
    pub(super) cells: usize,
    /// Samples a side, about.
    pub(super) samples: usize,
    /// How far descents are followed.
    pub(super) effort: Effort,
}

/// Coarse for headings, middle for models, fine for the pose.
pub(super) const LEVELS: [Level; 3] = [
    Level {
        faces: 250,
        cells: 14,
        samples: 28,
        effort: Effort { iterations: 5, arrived: 1e-2, asked_after: 1, promise: 5e-3 },
    },
    Level {
        faces: 800,
        cells: 28,
        samples: 56,
        effort: Effort { iterations: 8, arrived: 3e-3, asked_after: 1, promise: 1e-3 },
    },
    Level {
        faces: 3000,
        cells: 56,
        samples: 112,
        effort: Effort { iterations: 10, arrived: 3e-4, asked_after: 2, promise: 2e-4 },
    },
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
    /// Where the shape is fitted, too.
    pub(super) shape: Option<ShapeModel>,
}

impl DenseModel {
    pub(super) fn new(model: &VehicleModel, fit_shape: bool) -> Self {
        let extent = model.extent();
        let [coarse, middle, fine] = simplified(model.mesh(), LEVELS.map(|level| level.faces));
        let meshes = [coarse, middle, fine].map(|mesh| UnitMesh::new(&mesh, &extent));
        let vertices = meshes[0].vertices().collect();
        let side = extent.to_vector() * 0.5;
        let up = Vector3::new(0.0, side.y, 0.0);
        let centers = model_centers(model, Center3d::Mass)
            .map(|_, center| Point3::from((center.coords + up).component_div(&side)));
        let shape = fit_shape.then(|| ShapeModel::new(model)).flatten();
        Self { extent, meshes, vertices, centers, shape }
    }
}

/// Relative change of the volume, and change of a side of the bounding box as a share of it, that simplification may
/// bring about.
const MOST_CHANGE: f64 = 0.03;

/// The mesh with about so many faces each, the least first, or more where fewer would be another shape: tangled meshes
/// collapse badly.
fn simplified<const N: usize>(mesh: &Mesh, faces: [usize; N]) -> [Mesh; N] {
    let mut simplifier = Simplifier::new(mesh);
    let mut meshes = faces.map(|_| None);
    for (most, found) in faces.iter().zip(&mut meshes).rev() {
        *found = alike(&mut simplifier, mesh, *most);
    }
    let more = |most: usize| {
        let double = |most: &usize| Some(2 * most);
        let counts = std::iter::successors(Some(2 * most), double);
        let mut counts = counts.take_while(|most| *most < mesh.faces.len());
        counts.find_map(|most| alike(&mut Simplifier::new(mesh), mesh, most))
    };
    let mut faces = faces.into_iter();
    meshes.map(|found| {
        let most = faces.next().unwrap_or_default();
        found.or_else(|| more(most)).unwrap_or_else(|| mesh.clone())
    })
}

/// The mesh with about so many faces, if it has more, and if that is the same shape.
fn alike(simplifier: &mut Simplifier, mesh: &Mesh, most: usize) -> Option<Mesh> {
    let simple = (most < mesh.faces.len()).then(|| simplifier.down_to(most));
    simple.filter(|simple| is_alike(mesh, simple))
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
    /// A hypothesis whose energy is more than this many times the best's of its level goes no further.
    pub(super) hopeless: [f64; 3],
}

/// What is searched usually.
pub(super) const NARROW: Search = Search {
    scouts: 4,
    headings: 2,
    depths: &[1.0, 0.65, 0.42],
    keep: [12, 5],
    hopeless: [2.5, 1.4, 1.3],
};
/// What is searched where that finds nothing good: cut and hidden vehicles, mostly.
pub(super) const WIDE: Search = Search {
    scouts: 4,
    headings: 6,
    depths: &[1.2, 1.0, 0.8, 0.6, 0.45, 0.33],
    keep: [16, 4],
    hopeless: [2.5, 1.3, 1.3],
};

/// Angle between rotations below which two hypotheses of a model are one, radians.
pub(super) const NEIGHBOURS: f64 = 0.5;
/// A second heading of a model that is no scout is followed if its energy is at most this many times the first's.
const SECOND: f64 = 1.4;

/// Every hypothesis that was followed, the finest first, the best first among equally fine ones. Models are taken in the
/// order given; each way to see the mask's outline is tried.
pub(super) fn search(
    work: &mut Workspace,
    pyramid: &Pyramid,
    outlines: &[Outline],
    (candidates, order): (&[Candidate], &[usize]),
    search: &Search,
) -> Vec<Hypothesis> {
    let mut done: Vec<Hypothesis> = Vec::new();
    let mut pool: Vec<Hypothesis> = Vec::new();
    // Where the scouts' headings led: starts for all others.
    let mut common: Vec<State> = Vec::new();
    for (rank, index) in order.iter().enumerate() {
        let candidate = &candidates[*index];
        let view = pyramid.view(0, candidate);
        let is_scout = rank < search.scouts;
        let scored = if is_scout {
            headings(work, pyramid, outlines, candidate, search.depths)
        } else {
            let start = |state: &State| State { half: candidate.half, ..*state };
            common.iter().map(|state| work.score(&view, &start(state))).collect()
        };
        let mut starts = distinct(scored, search.headings);
        if let Some(limit) = starts.first().map(|best| SECOND * best.energy)
            && !is_scout
        {
            starts.retain(|start| start.energy <= limit);
        }
        for start in starts {
            // Coarse energies say too little to give anything up on the way.
            let descent = work.descend(&view, &start.state, &LEVELS[0].effort, f64::INFINITY);
            let end = descent.end.state;
            if is_scout && !common.iter().any(|state| state.is_near(&end)) {
                common.push(end);
            }
            pool.push(Hypothesis::new(*index, 0, &descent));
        }
    }
    for level in 1..LEVELS.len() {
        sort(&mut pool);
        let next = promoted(&pool, search, level - 1);
        done.append(&mut pool);
        for hypothesis in next {
            let view = pyramid.view(level, &candidates[hypothesis.model]);
            let start = better_start(work, &view, &hypothesis, &pool);
            let ceiling = search.hopeless[level] * least(&pool);
            let descent = work.descend(&view, &start, &LEVELS[level].effort, ceiling);
            pool.push(Hypothesis::new(hypothesis.model, level, &descent));
        }
    }
    done.append(&mut pool);
    sort(&mut done);
    done
}

/// Puts the models of the best hypotheses first.
pub(super) fn best_first(found: &[Hypothesis], order: &mut [usize]) {
    let rank = |index: &usize| {
        found.iter().position(|hypothesis| hypothesis.model == *index).unwrap_or(usize::MAX)
    };
    order.sort_by_key(rank);
}

/// The least energy so far.
fn least(pool: &[Hypothesis]) -> f64 {
    pool.iter().map(|h| h.scored.energy).fold(f64::INFINITY, f64::min)
}

/// Where a hypothesis starts on a finer level: where it was, or where the best of another model of about the same
/// heading arrived, whichever fits better.
fn better_start(
    work: &mut Workspace,
    view: &View,
    hypothesis: &Hypothesis,
    arrived: &[Hypothesis],
) -> State {
    let own = hypothesis.scored.state;
    let alike = |other: &&Hypothesis| {
        let rotation = &other.scored.state.rotation;
        other.model != hypothesis.model && own.rotation.angle_to(rotation) < 0.5 * NEIGHBOURS
    };
    let best =
        arrived.iter().filter(alike).min_by(|a, b| a.scored.energy.total_cmp(&b.scored.energy));
    let Some(best) = best else { return own };
    let shared = State { half: own.half, ..best.scored.state };
    let energies = [own, shared].map(|state| work.score(view, &state).energy);
    if energies[1] < energies[0] { shared } else { own }
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

    /// Whether it is the same model at about the same pose.
    pub(super) fn repeats(&self, other: &Self) -> bool {
        self.model == other.model && self.scored.state.is_near(&other.scored.state)
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
    outlines: &[Outline],
    candidate: &Candidate,
    depths: &'static [f64],
) -> Vec<Scored> {
    let (model, half) = (candidate.model, &candidate.half);
    let view = pyramid.view(0, candidate);
    let down = view.terms.down();
    let mut scored = Vec::with_capacity(HEADINGS * depths.len() * outlines.len() + 2);
    for outline in outlines {
        let depths = if outline.is_whole() { &[1.0] } else { depths };
        for index in 0..HEADINGS {
            let rotation = upright(&down, index as f64 / HEADINGS as f64 * TAU);
            for nearer in depths {
                if let Some(state) = outline.place(&model.vertices, &rotation, half, *nearer) {
                    scored.push(work.score(&view, &state));
                }
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
