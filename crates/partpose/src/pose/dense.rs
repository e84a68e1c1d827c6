//! The fit of every pixel and every probability.
//!
//! Centres of parts throw away what a mask says of outlines and seams, and no solver brings it back. Here the model is
//! drawn at a pose, the share of each label in each cell of the kernel is compared with the predicted probabilities,
//! and the pose goes downhill: one picture gives the energy (`energy`) and its derivatives (`jacobian`).
//! `docs/dense-fit.md` has the equations, what was tried and what it brought.

mod behind;
mod bias;
mod cell;
mod energy;
mod hypotheses;
mod jacobian;
mod judgement;
mod lm;
mod models;
mod occluders;
mod priors;
mod raster;
mod robust;
mod shape;
mod state;
mod target;
#[cfg(test)]
mod tests;
mod triangles;
mod uncertainty;
mod unit_mesh;
mod vector;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::detection::Detection;
use crate::geometry::{Camera, Extent, Pose};
use crate::vehicle::ModelZoo;

pub use bias::MaskBias;
pub use judgement::{DenseFlag, DenseHypothesis, DenseReport, DepthAndSize, ModeKind, SecondMode};
pub use priors::{DensePriors, GravityPrior, GroundPrior, SizePrior};
pub use shape::ShapeMeasure;

pub(super) use priors::across;

use super::{ExtentSource, NoPose};
use hypotheses::Outline;
use judgement::{Evidence, Suspicion};
use lm::{View, Workspace};
use models::{Candidate, DenseModel, Hypothesis, LEVELS, NARROW, Pyramid, WIDE};
use priors::{SizeTerm, Terms};
use shape::Shaped;
use target::Target;

/// Cells of a 28-cell kernel that must show the vehicle.
const LEAST_EVIDENCE: f64 = 1.0;
/// Energy per foreground cell above which the search is widened: where the whole outline is the vehicle's own, and
/// where the image or another vehicle cuts it.
const DOUBT: [f64; 2] = [0.25, 0.12];
/// The same from which a vehicle is looked for behind something unlabelled: where nothing seems to hide it, and where
/// something does.
const DOUBT_BEHIND: [f64; 2] = [0.12, 0.04];
/// What the dense fit supposes of masks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DenseOptions {
    /// Where masks have outlines, against where models have them; none if not measured.
    pub mask_bias: Option<MaskBias>,
    /// Whether background deep inside a fitted vehicle is taken for something unlabelled in front of it.
    pub find_occluders: bool,
    /// How much a detector's probabilities of models count beside the masks when models are compared: 0 for nothing,
    /// 1 as if they were independent of the mask and honest.
    pub model_weight: f64,
    /// Whether the best model's own measures are fitted, too, where it is a parametric one that comes with the library:
    /// about a tenth of a second a vehicle.
    pub fit_shape: bool,
}

/// Probability below which a detector does not rule a model out further.
const LEAST_PROBABILITY: f64 = 1e-3;

impl Default for DenseOptions {
    fn default() -> Self {
        Self { mask_bias: None, find_occluders: true, model_weight: 1.0, fit_shape: false }
    }
}

/// The models of a zoo, ready for the dense fit.
#[derive(Clone, Debug)]
pub(super) struct DenseZoo {
    models: Vec<DenseModel>,
    names: Vec<String>,
    options: DenseOptions,
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
    pub(super) fn new(zoo: &ModelZoo, options: &DenseOptions) -> Self {
        let names = zoo.models.iter().map(|model| model.name().to_owned());
        let models = zoo.models.par_iter().map(|model| DenseModel::new(model, options.fit_shape));
        Self { models: models.collect(), names: names.collect(), options: *options }
    }

    pub(super) fn fit(
        &self,
        camera: &Camera,
        detection: &Detection,
        extent: &ExtentSource,
        priors: &DensePriors,
    ) -> Result<DenseFit, NoPose> {
        if self.models.is_empty() {
            return Err(NoPose::NoModel);
        }
        let target = Target::new(detection, camera);
        let foreground = target.foreground();
        if !(foreground >= LEAST_EVIDENCE) {
            return Err(NoPose::TooLittleEvidence { found: foreground });
        }
        let mut pyramid = Pyramid::new(&target, camera, self.options.mask_bias);
        let outline = Outline::new(&pyramid.targets[1], camera)
            .ok_or(NoPose::TooLittleEvidence { found: foreground })?;
        let candidates = self.candidates(detection, extent, priors);
        let mut work = Workspace::default();
        let against = self.against(detection);
        let Found { hypotheses, mut best, hidden } =
            self.search(&mut work, &mut pyramid, &outline, (&candidates, &against))?;
        let candidate = &candidates[best.model];
        let shaped = candidate.model.shape.as_ref().and_then(|shape| {
            let view = pyramid.view(LEVELS.len() - 1, candidate);
            shape.fit(&mut work, &view, &best.scored.state)
        });
        if let Some(shaped) = &shaped {
            best.scored = shaped.scored;
        }
        let shaped = shaped.as_ref();
        let asked = Asked { camera, detection, extent, outline: &outline, hidden, shaped };
        let report = report(&mut work, &pyramid, &candidates, (&best, &hypotheses), &asked);
        let energies = (0..candidates.len()).map(|index| {
            let of_model = hypotheses.iter().find(|h| h.model == index);
            of_model.map(|h| h.scored.data / foreground).ok_or(NoPose::NoStart)
        });
        let state = &best.scored.state;
        Ok(DenseFit {
            model: best.model,
            camera_from_vehicle: state.pose(),
            extent: state.extent(),
            candidates: energies.collect(),
            report,
        })
    }

    /// From the usual search to wider ones, as long as what was found is poor. The finest target of the pyramid loses
    /// what is hidden.
    fn search(
        &self,
        work: &mut Workspace,
        pyramid: &mut Pyramid,
        outline: &Outline,
        (candidates, against): (&[Candidate], &[f64]),
    ) -> Result<Found, NoPose> {
        let foreground = pyramid.targets[LEVELS.len() - 1].foreground();
        let mut order: Vec<usize> = (0..candidates.len()).collect();
        let outlines = [*outline];
        let mut found = models::search(work, pyramid, &outlines, (candidates, &order), &NARROW);
        let limit = DOUBT[usize::from(!outline.is_whole())] * foreground;
        if found.first().is_none_or(|best| best.scored.data > limit) {
            models::best_first(&found, &mut order);
            found.extend(models::search(work, pyramid, &outlines, (candidates, &order), &WIDE));
            models::sort(&mut found);
        }
        judgement::weigh_models(&mut found, against);
        let best = *found.first().ok_or(NoPose::NoStart)?;
        if !self.options.find_occluders {
            return Ok(Found { hypotheses: found, best, hidden: 0.0 });
        }
        let mut fit = behind::without_hidden(work, pyramid, candidates, &best, occluders::MOST);
        let doubt = DOUBT_BEHIND[usize::from(fit.hidden.share > 0.0)];
        if fit.hypothesis.scored.data > doubt * foreground {
            models::best_first(&found, &mut order);
            let others = behind::search(work, pyramid, outline, (candidates, &order));
            if others.first().is_some_and(|other| other.energy() < fit.energy()) {
                found = others.iter().map(|other| other.hypothesis).collect();
                judgement::weigh_models(&mut found, against);
                let likeliest = found.first().map(|best| best.model);
                let mut others = others.into_iter();
                fit = others
                    .find(|other| Some(other.hypothesis.model) == likeliest)
                    .ok_or(NoPose::NoStart)?;
            }
        }
        pyramid.targets[LEVELS.len() - 1] = fit.target;
        Ok(Found { hypotheses: found, best: fit.hypothesis, hidden: fit.hidden.share })
    }

    fn candidates<'a>(
        &'a self,
        detection: &Detection,
        extent: &ExtentSource,
        priors: &DensePriors,
    ) -> Vec<Candidate<'a>> {
        let priors = priors.usable();
        let candidate = |model: &'a DenseModel| {
            let own = &model.extent;
            let size = match extent {
                ExtentSource::Free(prior) => SizeTerm::new(prior, own, detection.size.as_ref()),
                _ => None,
            };
            let given = || own.to_vector().component_mul(&extent.scale(own)) * 0.5;
            let half = size.map_or_else(given, |size| size.half());
            let noise = uncertainty::NOISE;
            Candidate { model, half, terms: Terms { priors, size, noise } }
        };
        self.models.iter().map(candidate).collect()
    }

    /// How much a detector speaks against each model, beside the one it thinks likeliest: differences of logarithms.
    fn against(&self, detection: &Detection) -> Vec<f64> {
        let weight = self.options.model_weight;
        let Some(models) = detection.models.as_ref().filter(|_| weight > 0.0) else {
            return vec![0.0; self.names.len()];
        };
        // Of a model that is not in the list nothing is known.
        let unknown = 1.0 / models.names.len().max(1) as f64;
        let of = |name: &String| models.of(name).unwrap_or(unknown).clamp(LEAST_PROBABILITY, 1.0);
        let logarithms: Vec<f64> = self.names.iter().map(|name| weight * of(name).ln()).collect();
        let best = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        logarithms.into_iter().map(|own| best - own).collect()
    }
}

/// What a search came to.
struct Found {
    /// Everything that was followed, the best first.
    hypotheses: Vec<Hypothesis>,
    /// The best of them, after what hides it was found.
    best: Hypothesis,
    /// Share of the vehicle behind something unlabelled.
    hidden: f64,
}

/// What a fit was asked, and what was found on the way.
struct Asked<'a> {
    camera: &'a Camera,
    detection: &'a Detection,
    extent: &'a ExtentSource,
    outline: &'a Outline,
    /// Share of the vehicle behind something unlabelled.
    hidden: f64,
    /// The best hypothesis with the shape that was found, if that was fitted.
    shaped: Option<&'a Shaped>,
}

/// What is said of the best hypothesis.
fn report(
    work: &mut Workspace,
    pyramid: &Pyramid,
    candidates: &[Candidate],
    (best, found): (&Hypothesis, &[Hypothesis]),
    asked: &Asked,
) -> DenseReport {
    let foreground = pyramid.targets[LEVELS.len() - 1].foreground().max(LEAST_EVIDENCE);
    let candidate = &candidates[best.model];
    let view = pyramid.view(LEVELS.len() - 1, candidate);
    let view = View { mesh: asked.shaped.map_or(view.mesh, |shaped| &shaped.mesh), ..view };
    let is_free = candidate.terms.size.is_some();
    let size_is_unknown = matches!(asked.extent, ExtentSource::Model | ExtentSource::Free(_));
    let unfitted = (size_is_unknown && !is_free)
        .then(|| SizeTerm::new(&SizePrior::around(None), &candidate.model.extent, None))
        .flatten();
    let energy = best.scored.data / foreground;
    let spread = uncertainty::covariance(work, &view, &best.scored, energy, unfitted.as_ref());
    let covariance = spread.covariance;
    let model_probabilities = judgement::model_probabilities(found, candidates.len());
    let second_mode = judgement::second_mode(found, foreground);
    let state = &best.scored.state;
    let overshoot = asked.outline.overshoot(&candidate.model.vertices, state);
    let evidence = Evidence {
        energy,
        foreground,
        overshoot,
        model: model_probabilities.get(best.model).copied().unwrap_or(0.0),
        mode: second_mode.map_or(1.0, |second| 1.0 - second.probability),
        depth: covariance[(5, 5)].sqrt() / (2.0 * state.half.z),
        turn: covariance[(1, 1)].sqrt(),
    };
    let cut = if judgement::is_cut(&asked.detection.bounds, asked.camera) {
        Some(DenseFlag::CutByImage)
    } else {
        (!asked.outline.is_whole()).then_some(DenseFlag::HiddenByVehicle)
    };
    let suspicion = Suspicion {
        evidence,
        converged: best.converged,
        nearest: state.nearest(),
        size_deviation: candidate.terms.size_deviation(state),
        ground_deviation: candidate.terms.ground_deviation(state),
        hidden: asked.hidden,
        cut,
        size_is_unknown,
    };
    DenseReport {
        energy,
        foreground,
        overshoot,
        covariance: covariance.fixed_view::<6, 6>(0, 0).into(),
        covariance_with_size: is_free.then_some(covariance),
        depth_and_size: judgement::depth_and_size(
            &covariance,
            spread.depth_variance_if_size_known,
            is_free,
        ),
        confidence: judgement::confidence(&evidence),
        model_probabilities,
        second_mode,
        hypotheses: judgement::kept(found, foreground),
        flags: suspicion.flags(),
        shape: asked.shaped.map_or(Vec::new(), |shaped| shaped.measures.clone()),
        pictures: work.pictures,
    }
}
