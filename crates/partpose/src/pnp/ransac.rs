//! P3P and RANSAC: the pose that most correspondences agree on.
//!
//! Fischler and Bolles: *Random Sample Consensus*, CACM 1981, with the truncated squared error as score (Torr and
//! Zisserman: *MLESAC*, CVIU 2000) and local optimisation (Chum, Matas and Kittler: *Locally Optimized RANSAC*, DAGM
//! 2003). Few points have few triples: up to [`EXHAUSTIVE`] points all of them are tried, so that nothing is left to
//! chance; beyond, triples are drawn from a seeded generator. The best few hypotheses, not the best one alone, are
//! refined, robustly first and then on their inliers, because a pose from three noisy points is too coarse to judge.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{
    Correspondence, Loss, PnpError, RefineOptions, Refinement, buffer::Buffer, check,
    p3p::p3p_from_rays, refine,
};
use crate::geometry::{Camera, Pose};

/// Fewest correspondences: three make a pose, the fourth chooses.
const MIN_POINTS: usize = 4;
/// Most points of which all triples are tried: 56 triples.
const EXHAUSTIVE: usize = 8;
/// Rounds of refining on the inliers and looking again who they are.
const ROUNDS: usize = 4;
/// Relative displacement and angle (radians) below which two settled hypotheses are one.
const SAME: f64 = 1e-3;
/// Hypotheses that are refined.
const KEPT: usize = 6;

/// How [`ransac`] searches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RansacOptions {
    /// Distance from the projection beyond which a point is an outlier, pixels; about four standard deviations.
    pub threshold: f64,
    /// How the pose is refined; its loss is not used, inliers are refined without one.
    pub refine: RefineOptions,
    /// Fewest and most triples that are drawn where not all are tried.
    pub iterations: [u32; 2],
    /// Probability with which at least one triple without outliers should be drawn.
    pub confidence: f64,
    /// Seed of the `ChaCha8` generator that draws the triples.
    pub seed: u64,
}

impl Default for RansacOptions {
    fn default() -> Self {
        Self {
            threshold: 4.0,
            refine: RefineOptions::default(),
            iterations: [60, 1000],
            confidence: 0.9999,
            seed: 0,
        }
    }
}

/// The pose that [`ransac`] settled on.
#[derive(Clone, Debug, PartialEq)]
pub struct RansacSolution {
    /// The pose refined on the inliers.
    pub refinement: Refinement,
    /// Which correspondences lie within the threshold, in the order given.
    pub inliers: Vec<bool>,
    /// Sum over all points of the squared distance, cut off at the squared threshold; square pixels.
    pub score: f64,
}

/// The pose that explains most of at least 4 correspondences, some of which may be wrong.
pub fn ransac(
    correspondences: &[Correspondence],
    camera: &Camera,
    options: &RansacOptions,
) -> Result<RansacSolution, PnpError> {
    check(correspondences, camera, MIN_POINTS)?;
    if !(options.threshold > 0.0 && options.threshold.is_finite()) {
        return Err(PnpError::NotPositive);
    }
    let mut search = Search::new(correspondences, camera, options.threshold);
    let n = correspondences.len();
    if n <= EXHAUSTIVE {
        for i in 0..n {
            for j in i + 1..n {
                for k in j + 1..n {
                    search.try_triple([i, j, k]);
                }
            }
        }
    } else {
        search.draw(options);
    }
    let mut best: Option<RansacSolution> = None;
    let mut visited: Vec<Pose> = Vec::with_capacity(KEPT);
    for (_, start) in search.kept.iter().flatten() {
        let start = settle(correspondences, camera, start, options);
        // Most of the best hypotheses come from the same triples of true matches and settle on one pose.
        let seen = visited.iter().any(|pose| {
            let shift = (pose.translation.vector - start.translation.vector).norm();
            shift < SAME * start.translation.vector.norm()
                && pose.rotation.angle_to(&start.rotation) < SAME
        });
        if seen {
            continue;
        }
        visited.push(start);
        let Some(found) = optimise(correspondences, camera, &start, options) else { continue };
        if best.as_ref().is_none_or(|best| found.score < best.score) {
            best = Some(found);
        }
    }
    best.ok_or(if search.any { PnpError::BehindCamera } else { PnpError::Degenerate })
}

struct Search<'a> {
    correspondences: &'a [Correspondence],
    camera: &'a Camera,
    rays: Buffer<Vector3<f64>>,
    limit: f64,
    /// Scores and poses, best first.
    kept: [Option<(f64, Pose)>; KEPT],
    any: bool,
}

impl<'a> Search<'a> {
    fn new(correspondences: &'a [Correspondence], camera: &'a Camera, threshold: f64) -> Self {
        let rays = Buffer::from_fn(correspondences.len(), Vector3::zeros(), |i| {
            camera.ray(&correspondences[i].point_in_image).normalize()
        });
        let limit = threshold * threshold;
        Self { correspondences, camera, rays, limit, kept: [None; KEPT], any: false }
    }

    fn draw(&mut self, options: &RansacOptions) {
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        let n = self.correspondences.len();
        let [fewest, most] = options.iterations;
        let mut enough = f64::from(most);
        let mut drawn = 0;
        while drawn < most.max(1) && (drawn < fewest || f64::from(drawn) < enough) {
            drawn += 1;
            let i = random.random_range(0..n);
            let mut j = random.random_range(0..n - 1);
            j += usize::from(j >= i);
            let mut k = random.random_range(0..n - 2);
            for taken in [i.min(j), i.max(j)] {
                k += usize::from(k >= taken);
            }
            if self.try_triple([i, j, k])
                && let Some((_, pose)) = &self.kept[0]
            {
                let limit = self.limit;
                let distances = self.correspondences.iter();
                let inliers = distances.filter(|c| distance2(c, self.camera, pose) < limit).count();
                let share = (inliers as f64 / n as f64).powi(3).min(1.0 - 1e-12);
                enough = (1.0 - options.confidence).max(1e-300).ln() / (1.0 - share).ln();
            }
        }
    }

    /// Whether one of the triple's poses is the best so far.
    fn try_triple(&mut self, triple: [usize; 3]) -> bool {
        let rays = triple.map(|i| self.rays[i]);
        let points = triple.map(|i| self.correspondences[i].point_in_object.coords);
        let Some(poses) = p3p_from_rays(&rays, &points) else { return false };
        self.any = true;
        let mut improved = false;
        for pose in poses.as_slice() {
            improved |= self.offer(pose);
        }
        improved
    }

    fn offer(&mut self, pose: &Pose) -> bool {
        let worst = self.kept[KEPT - 1].map_or(f64::INFINITY, |(score, _)| score);
        let mut score = 0.0;
        for c in self.correspondences {
            score += distance2(c, self.camera, pose).min(self.limit);
            if !(score < worst) {
                return false;
            }
        }
        let at = self.kept.iter().position(|kept| kept.is_none_or(|(other, _)| score < other));
        let Some(at) = at else { return false };
        self.kept[at..].rotate_right(1);
        self.kept[at] = Some((score, *pose));
        at == 0
    }
}

/// Squared pixel distance; infinite behind the camera.
fn distance2(c: &Correspondence, camera: &Camera, pose: &Pose) -> f64 {
    let p = pose * c.point_in_object;
    match camera.project(&p) {
        Some(pixel) => {
            let d2 = (pixel - c.point_in_image).norm_squared();
            if d2.is_finite() { d2 } else { f64::INFINITY }
        }
        None => f64::INFINITY,
    }
}

/// Refines a hypothesis robustly; itself where that fails.
fn settle(
    correspondences: &[Correspondence],
    camera: &Camera,
    start: &Pose,
    options: &RansacOptions,
) -> Pose {
    let scale = options.threshold / options.refine.sigma;
    let loss = Loss::GemanMcClure { scale };
    let robust = RefineOptions { loss, max_iterations: 15, tolerance: 1e-5, ..options.refine };
    refine(correspondences, camera, start, &robust).map_or(*start, |refined| refined.pose)
}

/// Refines a pose on its inliers until they stay the same.
fn optimise(
    correspondences: &[Correspondence],
    camera: &Camera,
    start: &Pose,
    options: &RansacOptions,
) -> Option<RansacSolution> {
    let limit = options.threshold * options.threshold;
    let flags = |pose: &Pose| -> Vec<bool> {
        correspondences.iter().map(|c| distance2(c, camera, pose) < limit).collect()
    };
    let plain = RefineOptions { loss: Loss::None, ..options.refine };
    let mut pose = *start;
    let mut inliers = flags(&pose);
    let mut refinement = None;
    for _ in 0..ROUNDS {
        let chosen: Vec<Correspondence> = correspondences
            .iter()
            .zip(&inliers)
            .filter(|(_, keep)| **keep)
            .map(|(c, _)| *c)
            .collect();
        if chosen.len() < 3 {
            break;
        }
        let refined = refine(&chosen, camera, &pose, &plain).ok()?;
        pose = refined.pose;
        refinement = Some(refined);
        let next = flags(&pose);
        if next == inliers {
            break;
        }
        inliers = next;
    }
    let score = correspondences.iter().map(|c| distance2(c, camera, &pose).min(limit)).sum();
    refinement.map(|refinement| RansacSolution { refinement, inliers, score })
}
