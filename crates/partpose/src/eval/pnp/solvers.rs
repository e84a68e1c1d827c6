//! Runs a solver over a problem set and scores it.

use std::{collections::BTreeMap, time::Instant};

use serde::{Deserialize, Serialize};

use super::{Problem, ProblemSet};
use crate::{
    geometry::Pose,
    pnp::{self, PnpError, RansacOptions, RefineOptions},
};

/// Rotation error, degrees, above which a trial has failed.
const MAX_ROTATION: f64 = 20.0;
/// Relative translation error above which a trial has failed.
const MAX_TRANSLATION: f64 = 0.2;
/// What a missing result counts as: degrees and metres.
const MISSING: [f64; 2] = [180.0, 1000.0];

/// A solver, or a chain of them, under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// [`pnp::epnp`].
    Epnp,
    /// [`pnp::epnp`], then [`pnp::refine`].
    EpnpRefined,
    /// The best minimum of [`pnp::sqpnp`].
    Sqpnp,
    /// [`pnp::solve`]: the better mode.
    SqpnpRefined,
    /// [`pnp::solve`]: both modes, of which the second counts in `both_wrong` only.
    TwoModes,
    /// [`pnp::ransac`], threshold four standard deviations but at least 4 px.
    Ransac,
}

impl Solver {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 6] = [
        Self::Epnp,
        Self::EpnpRefined,
        Self::Sqpnp,
        Self::SqpnpRefined,
        Self::TwoModes,
        Self::Ransac,
    ];

    /// Its name in the tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Epnp => "EPnP",
            Self::EpnpRefined => "EPnP + LM",
            Self::Sqpnp => "SQPnP",
            Self::SqpnpRefined => "SQPnP + LM",
            Self::TwoModes => "SQPnP + LM, two modes",
            Self::Ransac => "P3P-RANSAC + LM",
        }
    }

    /// The pose, and the second one where there is one.
    fn run(self, problem: &Problem, set: &ProblemSet) -> Result<(Pose, Option<Pose>), PnpError> {
        let (points, camera) = (problem.correspondences.as_slice(), &set.camera);
        let options = RefineOptions { sigma: set.sigma_px, ..RefineOptions::default() };
        match self {
            Self::Epnp => Ok((pnp::epnp(points, camera)?, None)),
            Self::EpnpRefined => {
                let start = pnp::epnp(points, camera)?;
                Ok((pnp::refine(points, camera, &start, &options)?.pose, None))
            }
            Self::Sqpnp => Ok((pnp::sqpnp(points, camera)?[0].pose, None)),
            Self::SqpnpRefined => {
                Ok((pnp::solve(points, camera, &options)?.best.refinement.pose, None))
            }
            Self::TwoModes => {
                let solution = pnp::solve(points, camera, &options)?;
                let second = solution.second.map(|mode| mode.refinement.pose);
                Ok((solution.best.refinement.pose, second))
            }
            Self::Ransac => {
                let threshold = (4.0 * set.sigma_px).max(4.0);
                let options =
                    RansacOptions { threshold, refine: options, ..RansacOptions::default() };
                Ok((pnp::ransac(points, camera, &options)?.refinement.pose, None))
            }
        }
    }
}

/// What is reported of a solver on a cell; the names are those of the reference scores.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// Median angle between the rotation and the true one, degrees.
    pub rot_deg_median: f64,
    /// 95th percentile of it.
    pub rot_deg_p95: f64,
    /// Median distance between the translation and the true one, metres.
    pub trans_m_median: f64,
    /// 95th percentile of it.
    pub trans_m_p95: f64,
    /// Share of failed trials.
    pub failure: f64,
    /// Share of trials without a result.
    pub no_result: f64,
    /// Share of trials in which every returned mode fails; for solvers that return two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub both_wrong: Option<f64>,
    /// Share of trials with a second mode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub two_distinct: Option<f64>,
    /// Median wall time of one call on one core, microseconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_us_median: Option<f64>,
}

/// A cell and the scores of every solver on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CellScores {
    /// `spread` or `planar`.
    pub geometry: String,
    /// Points per trial.
    pub n: usize,
    /// Standard deviation of the pixels.
    pub sigma_px: f64,
    /// Share of gross outliers.
    pub outlier_fraction: f64,
    /// Number of trials.
    pub trials: usize,
    /// Scores by the solver's name.
    pub solvers: BTreeMap<String, Scores>,
}

/// Runs one solver over all trials, one after the other on the calling thread.
pub fn evaluate(set: &ProblemSet, solver: Solver) -> Scores {
    let count = set.problems.len();
    let mut rotations = Vec::with_capacity(count);
    let mut translations = Vec::with_capacity(count);
    let mut times = Vec::with_capacity(count);
    let (mut failed, mut missing, mut both_wrong, mut two) = (0, 0, 0, 0);
    for problem in &set.problems {
        let start = Instant::now();
        let result = solver.run(problem, set);
        times.push(start.elapsed().as_secs_f64() * 1e6);
        let Ok((pose, second)) = result else {
            rotations.push(MISSING[0]);
            translations.push(MISSING[1]);
            (failed, missing, both_wrong) = (failed + 1, missing + 1, both_wrong + 1);
            continue;
        };
        let (rotation, translation, wrong) = errors(&pose, &problem.camera_from_object);
        rotations.push(rotation);
        translations.push(translation);
        failed += usize::from(wrong);
        two += usize::from(second.is_some());
        let rescued = second.is_some_and(|pose| !errors(&pose, &problem.camera_from_object).2);
        both_wrong += usize::from(wrong && !rescued);
    }
    let share = |part: usize| part as f64 / count.max(1) as f64;
    let returns_two = solver == Solver::TwoModes;
    Scores {
        rot_deg_median: quantile(&mut rotations, 0.5),
        rot_deg_p95: quantile(&mut rotations, 0.95),
        trans_m_median: quantile(&mut translations, 0.5),
        trans_m_p95: quantile(&mut translations, 0.95),
        failure: share(failed),
        no_result: share(missing),
        both_wrong: returns_two.then(|| share(both_wrong)),
        two_distinct: returns_two.then(|| share(two)),
        time_us_median: Some(quantile(&mut times, 0.5)),
    }
}

/// Degrees, metres, and whether the trial failed.
fn errors(pose: &Pose, truth: &Pose) -> (f64, f64, bool) {
    let rotation = pose.rotation.angle_to(&truth.rotation).to_degrees();
    let (t, true_t) = (pose.translation.vector, truth.translation.vector);
    let translation = (t - true_t).norm();
    let far = translation / true_t.norm() > MAX_TRANSLATION;
    (rotation, translation, rotation > MAX_ROTATION || far || t.z <= 0.0)
}

/// Linear interpolation between order statistics; 0 of nothing.
fn quantile(values: &mut [f64], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    let at = share * (values.len() - 1) as f64;
    let low = at.floor() as usize;
    let high = (low + 1).min(values.len() - 1);
    values[low] + (values[high] - values[low]) * (at - at.floor())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pnp::synthetic::{SyntheticOptions, synthetic_problem};

    #[test]
    fn every_solver_solves_problems_without_noise() {
        let problems = (0..20).map(|seed| synthetic_problem(seed, &SyntheticOptions::default()));
        let problems: Vec<_> = problems.collect();
        let set = ProblemSet {
            name: "clean".to_owned(),
            geometry: "spread".to_owned(),
            points: 8,
            sigma_px: 1.0,
            outlier_fraction: 0.0,
            camera: problems[0].camera,
            problems: problems
                .into_iter()
                .map(|p| Problem {
                    inliers: vec![true; p.correspondences.len()],
                    correspondences: p.correspondences,
                    camera_from_object: p.camera_from_object,
                })
                .collect(),
        };
        for solver in Solver::ALL {
            let scores = evaluate(&set, solver);
            assert!(scores.failure == 0.0 && scores.rot_deg_p95 < 1e-3, "{solver:?} {scores:?}");
        }
    }

    #[test]
    fn quantile_interpolates() {
        assert!((quantile(&mut [4.0, 1.0, 2.0], 0.5) - 2.0).abs() < 1e-15);
        assert!((quantile(&mut [1.0, 2.0], 0.95) - 1.95).abs() < 1e-15);
    }
}
