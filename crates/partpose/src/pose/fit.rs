//! The fit of one model to one detection: PnP on the parts that both have.

use crate::detection::Detection;
use crate::geometry::{Camera, Point3, Pose};
use crate::parts::{PartClass, PartMap};
use crate::pnp::{
    self, Correspondence, Loss, PnpError, RansacOptions, RefineOptions, WeightedCorrespondence,
};

use super::estimator::MIN_CORRESPONDENCES;
use super::{Alternative, NoPose, PartEvidence, PnpMethod, PoseOptions};

/// One model's fit.
pub(super) struct Fit {
    pub(super) camera_from_vehicle: Pose,
    /// Over the inliers.
    pub(super) rmse: f64,
    /// What models are compared by: the same, with outliers at the threshold that makes them outliers.
    pub(super) error: f64,
    pub(super) correspondences: Vec<(PartClass, Correspondence)>,
    pub(super) inliers: Vec<bool>,
}

/// One detection as every model sees it.
pub(super) struct Problem<'a> {
    pub(super) camera: &'a Camera,
    pub(super) detection: &'a Detection,
    pub(super) parts: PartMap<PartEvidence>,
}

/// PnP on the parts that mask and model share.
pub(super) fn solve(
    problem: &Problem,
    points: &PartMap<Point3>,
    options: &PoseOptions,
) -> Result<Fit, NoPose> {
    let pairs: Vec<(PartClass, Correspondence)> = problem
        .parts
        .zip(points)
        .map(|(class, part, point)| {
            (class, Correspondence { point_in_image: part.center, point_in_object: *point })
        })
        .collect();
    if pairs.len() < MIN_CORRESPONDENCES {
        return Err(NoPose::TooFewCorrespondences {
            found: pairs.len(),
            seen: problem.parts.len(),
        });
    }
    let correspondences: Vec<Correspondence> = pairs.iter().map(|(_, c)| *c).collect();
    let camera = problem.camera;
    let mut inliers = vec![true; pairs.len()];
    let mut pose = match options.method {
        // The dense fit never comes here; its correspondences would be solved like the paper's.
        PnpMethod::Epnp | PnpMethod::Dense => pnp::epnp(&correspondences, camera)?,
        PnpMethod::Sqpnp => {
            let minima = pnp::sqpnp(&correspondences, camera)?;
            minima.first().ok_or(PnpError::BehindCamera)?.pose
        }
        PnpMethod::Ransac => {
            let ransac = RansacOptions { seed: options.seed, ..Default::default() };
            let solution = pnp::ransac(&correspondences, camera, &ransac)?;
            inliers = solution.inliers;
            solution.refinement.pose
        }
    };
    if options.refine {
        // Where refinement fails the solver's pose stands.
        pose = refine(problem, &pairs, &inliers, &pose).unwrap_or(pose);
    }
    let used: Vec<Correspondence> = correspondences
        .iter()
        .zip(&inliers)
        .filter(|(_, inlier)| **inlier)
        .map(|(c, _)| *c)
        .collect();
    let rmse = pnp::reprojection_rmse(&used, camera, &pose)?;
    let (n, outliers) = (correspondences.len() as f64, correspondences.len() - used.len());
    let limit = RansacOptions::default().threshold;
    let squares = rmse * rmse * used.len() as f64 + limit * limit * outliers as f64;
    let error = (squares / n).sqrt();
    Ok(Fit { camera_from_vehicle: pose, rmse, error, correspondences: pairs, inliers })
}

impl Fit {
    /// Error per degree of freedom: fits of few points must not win by their few points.
    pub(super) fn score(&self) -> f64 {
        let n = self.correspondences.len() as f64;
        self.error * (n / (n - 2.5)).sqrt()
    }
}

/// The better of two fits; a fit is better than none.
pub(super) fn better(a: Result<Fit, NoPose>, b: Result<Fit, NoPose>) -> Result<Fit, NoPose> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok(if b.score() < a.score() { b } else { a }),
        (Ok(fit), Err(_)) | (Err(_), Ok(fit)) => Ok(fit),
        (Err(reason), Err(_)) => Err(reason),
    }
}

/// The second mode, if its error is not clearly larger.
pub(super) fn alternative(fit: &Fit, camera: &Camera) -> Option<Alternative> {
    /// Errors up to this many times the first's, and this many pixels more, are nearly as good.
    const NEARLY: (f64, f64) = (1.5, 0.25);
    let inliers = fit.correspondences.iter().zip(&fit.inliers).filter(|(_, inlier)| **inlier);
    let used: Vec<Correspondence> = inliers.map(|((_, c), _)| *c).collect();
    let options = RefineOptions::default();
    let first = pnp::refine(&used, camera, &fit.camera_from_vehicle, &options).ok()?;
    let second = pnp::second_mode(&used, camera, &first, &options)?;
    let rmse = pnp::reprojection_rmse(&used, camera, &second.pose).ok()?;
    (rmse < NEARLY.0 * fit.rmse + NEARLY.1)
        .then_some(Alternative { camera_from_vehicle: second.pose, reprojection_rmse: rmse })
}

/// Levenberg-Marquardt where each part's covariance grows with its spread in the image.
fn refine(
    problem: &Problem,
    pairs: &[(PartClass, Correspondence)],
    inliers: &[bool],
    start: &Pose,
) -> Result<Pose, NoPose> {
    // A centre errs by half a pixel and by a share of the part's own spread; chosen, not fitted to data.
    const PIXEL_VARIANCE: f64 = 0.25;
    const SPREAD: f64 = 0.1;
    let weighted: Vec<WeightedCorrespondence> = pairs
        .iter()
        .zip(inliers)
        .filter(|(_, inlier)| **inlier)
        .map(|((class, correspondence), _)| {
            let scatter =
                problem.parts.get(*class).map_or(nalgebra::Matrix2::identity(), |p| p.scatter);
            let covariance =
                nalgebra::Matrix2::identity() * PIXEL_VARIANCE + scatter * (SPREAD * SPREAD);
            WeightedCorrespondence { correspondence: *correspondence, covariance }
        })
        .collect();
    let options = RefineOptions { loss: Loss::Huber { scale: 2.0 }, ..Default::default() };
    Ok(pnp::refine_weighted(&weighted, problem.camera, start, &options)?.pose)
}
