//! The fit of every pixel and every probability.
//!
//! Centres of parts throw away what a mask says of outlines and seams, and no solver brings it back. Here the model is
//! drawn at a pose, the share of each label in each cell of the kernel is compared with the predicted probabilities,
//! and the pose goes downhill: one picture gives the energy (`energy`) and its derivatives (`jacobian`).
//! `docs/dense-fit.md` has the equations, what was tried and what it brought.

mod energy;
mod hypotheses;
mod jacobian;
mod lm;
mod models;
mod priors;
mod raster;
mod state;
mod target;

use crate::detection::Detection;
use crate::geometry::{Camera, Extent, Pose, Vector3};
use crate::vehicle::ModelZoo;

pub use priors::{DensePriors, GravityPrior, GroundPrior, SizePrior};

use super::{ExtentSource, NoPose};
use hypotheses::Outline;
use lm::Workspace;
use models::{DenseModel, Pyramid, Search};
use priors::{SizeTerm, Terms};
use target::Target;

/// Variance of a cell's term for priors and probabilities.
const NOISE: f64 = 1.0;

/// The models of a zoo, ready for the dense fit.
#[derive(Clone, Debug)]
pub(super) struct DenseZoo {
    models: Vec<DenseModel>,
}

/// What the dense fit knows besides pose, size and model.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseReport {
    /// The data term per cell that shows the vehicle: 0 for a perfect fit.
    pub energy: f64,
}

/// What the dense fit found.
#[derive(Clone, Debug)]
pub(super) struct DenseFit {
    pub(super) model: usize,
    pub(super) camera_from_vehicle: Pose,
    pub(super) extent: Extent,
    /// Every model's energy per foreground cell.
    pub(super) candidates: Vec<Result<f64, NoPose>>,
    pub(super) report: DenseReport,
}

impl DenseZoo {
    pub(super) fn new(zoo: &ModelZoo) -> Self {
        Self { models: zoo.models.iter().map(DenseModel::new).collect() }
    }

    pub(super) fn fit(
        &self,
        camera: &Camera,
        detection: &Detection,
        extent: &ExtentSource,
        priors: &DensePriors,
    ) -> Result<DenseFit, NoPose> {
        let target = Target::new(detection, camera);
        let found = target.foreground();
        if !(found >= LEAST_EVIDENCE) {
            return Err(NoPose::TooLittleEvidence { found });
        }
        let pyramid = Pyramid::new(&target, camera);
        let outline = Outline::new(&pyramid.targets[1], camera)
            .ok_or(NoPose::TooLittleEvidence { found })?;
        let priors = priors.usable();
        let models: Vec<(&DenseModel, Vector3, Terms)> = self
            .models
            .iter()
            .map(|model| {
                let scale = extent.scale(&model.extent);
                let half = model.extent.to_vector().component_mul(&scale) * 0.5;
                let size = match extent {
                    ExtentSource::Free(prior) => SizeTerm::new(prior, &model.extent),
                    _ => None,
                };
                (model, half, Terms { priors, size, noise: NOISE })
            })
            .collect();
        let mut work = Workspace::default();
        let search = Search { headings: 2, middle: 6, fine: 3 };
        let hypotheses = models::search(&mut work, &pyramid, &outline, &models, &search);
        let best = hypotheses.first().ok_or(NoPose::NoStart)?;
        let candidates = (0..models.len()).map(|index| {
            let of_model = hypotheses.iter().find(|h| h.model == index);
            of_model.map(|h| h.scored.data / found).ok_or(NoPose::NoStart)
        });
        Ok(DenseFit {
            model: best.model,
            camera_from_vehicle: best.scored.state.pose(),
            extent: best.scored.state.extent(),
            candidates: candidates.collect(),
            report: DenseReport { energy: best.scored.data / found },
        })
    }
}

/// Cells of a 28-cell kernel that must show the vehicle.
const LEAST_EVIDENCE: f64 = 3.0;
