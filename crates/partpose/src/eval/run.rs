//! Poses of all labelled vehicles of some frames under several configurations at once, from detections of the oracle or
//! from a detector's.

use std::time::Instant;

use rayon::prelude::*;

use crate::dataset::{DatasetError, Frame, VehicleLabel};
use crate::detection::Detection;
use crate::oracle::{
    Degradation, HeadErrors, Oracle, OracleBox, OracleOptions, strength_for_accuracy,
};
use crate::parts::Scaling;
use crate::pose::dense::SizePrior;
use crate::pose::{ExtentSource, NoPose, PoseEstimate, PoseEstimator, PoseOptions};
use crate::vehicle::ModelZoo;

use super::matching::{MatchOptions, TruthBoxes, match_detections};
use super::scene::{self, Fitted, SceneProtocol};
use super::uncertainty::{Sureness, sureness};
use super::{PoseDeviation, Scored, pose_deviation};

/// What is compared: a row of one of the paper's tables.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// How it is called in tables.
    pub name: String,
    /// Cells a side of the kernels.
    pub kernel: usize,
    /// The pose stage.
    pub pose: PoseOptions,
    /// How much the detections err.
    pub degradation: Option<Degradation>,
}

/// Where sizes come from in an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TruthExtent {
    /// Models are scaled per axis to the true extent: the paper's protocol.
    PerAxis,
    /// Models are scaled by one factor to the true volume.
    Uniform,
    /// Models keep their own extent.
    None,
    /// Models are stretched by what the mask says, from their own extent with its likely spread.
    Free,
}

/// What is evaluated.
#[derive(Clone, Copy)]
pub struct EvaluationOptions<'a> {
    /// The models to choose from.
    pub zoo: &'a ModelZoo,
    /// Whether the true size is used.
    pub extent: TruthExtent,
    /// Which boxes detections get.
    pub bounds: OracleBox,
    /// What the oracle's detections say of sizes and models.
    pub heads: HeadErrors,
    /// Which labelled vehicles of a frame count; rows to ignore never do, nor with the oracle those whose models the zoo
    /// lacks.
    pub include: &'a (dyn Fn(&Frame, usize) -> bool + Sync),
    /// Which models of the zoo are right for a label's model name; with none the choice of the model is not judged.
    pub right_models: &'a (dyn Fn(&str) -> Vec<usize> + Sync),
    /// Whose detections are kept, by frame and index of the configuration, to be drawn; all of them would fill the
    /// memory.
    pub keep_detections: &'a (dyn Fn(&Frame, usize) -> bool + Sync),
    /// How the vehicles of a frame are fitted together; each alone if not given.
    pub scene: Option<SceneProtocol>,
    /// Whether parts are compared with the model, too.
    pub observe: bool,
}

/// What became of one vehicle under one configuration.
#[derive(Clone, Debug)]
pub struct VehicleOutcome {
    /// Index of the vehicle in its frame.
    pub vehicle: usize,
    /// The detection, where [`EvaluationOptions::keep_detections`] asks for it.
    pub detection: Option<Detection>,
    /// The estimate, or why there is none.
    pub estimate: Result<PoseEstimate, NoPose>,
    /// Its deviation from the truth.
    pub scored: Scored,
    /// What the dense fit said of itself, against the truth, where it is known which model is right.
    pub sureness: Option<Sureness>,
    /// Seconds that the estimate took on one thread, with whatever else the machine did then.
    pub seconds: f64,
    /// The paper's PA of the detection's mask; `None` where the frame has no part mask.
    pub pixel_accuracy: Option<f64>,
}

/// What became of the vehicles of one frame: one list a configuration, all of the same vehicles.
pub type FrameOutcome = Result<Vec<Vec<VehicleOutcome>>, DatasetError>;

/// Told after each frame: how many are done.
pub type Progress<'a> = &'a (dyn Fn() + Sync);

/// Evaluates frames in parallel; a frame that cannot be read is an error in its place, and the rest is done.
pub fn evaluate_frames(
    frames: &[Frame],
    options: &EvaluationOptions,
    configurations: &[Configuration],
    progress: Progress,
) -> Vec<FrameOutcome> {
    let estimators: Vec<PoseEstimator> = configurations
        .iter()
        .map(|configuration| PoseEstimator::new(options.zoo, &configuration.pose))
        .collect();
    let one = |frame: &Frame| {
        let outcome = evaluate_frame(frame, options, configurations, &estimators);
        progress();
        outcome
    };
    frames.par_iter().map(one).collect()
}

fn included(frame: &Frame, options: &EvaluationOptions) -> Vec<usize> {
    let counts = |index: &usize| {
        let vehicle = &frame.vehicles[*index];
        let known = vehicle.model.as_deref().is_some_and(|name| options.zoo.get(name).is_some());
        !vehicle.dont_care && known && (options.include)(frame, *index)
    };
    (0..frame.vehicles.len()).filter(counts).collect()
}

fn evaluate_frame(
    frame: &Frame,
    options: &EvaluationOptions,
    configurations: &[Configuration],
    estimators: &[PoseEstimator],
) -> FrameOutcome {
    let vehicles = included(frame, options);
    if vehicles.is_empty() {
        return Ok(vec![Vec::new(); configurations.len()]);
    }
    let oracle = Oracle::new(frame, frame.read_parts()?, options.zoo);
    let run = |(index, (configuration, estimator)): (usize, (&Configuration, &PoseEstimator))| {
        let keep = (options.keep_detections)(frame, index);
        let stage = (configuration, estimator);
        let mut fitted = match &options.scene {
            Some(protocol) => scene::fit(frame, options, protocol, &oracle, stage),
            None => vehicles.iter().map(|v| alone(frame, *v, options, &oracle, stage)).collect(),
        };
        fitted.retain(|fitted| vehicles.contains(&fitted.vehicle));
        observe(frame, options, estimator, &mut fitted);
        let one = |fitted: Fitted| {
            let outcome = outcome(frame, fitted, options, (Some(&oracle), configuration));
            VehicleOutcome { detection: outcome.detection.filter(|_| keep), ..outcome }
        };
        fitted.into_iter().map(one).collect()
    };
    Ok(configurations.iter().zip(estimators).enumerate().map(run).collect())
}

/// Where a vehicle's size comes from.
pub(super) fn extent_source(extent: TruthExtent, label: &VehicleLabel) -> ExtentSource {
    match extent {
        TruthExtent::PerAxis => ExtentSource::Given(label.cuboid.extent),
        TruthExtent::Uniform => ExtentSource::GivenUniform(label.cuboid.extent),
        TruthExtent::None => ExtentSource::Model,
        TruthExtent::Free => ExtentSource::Free(SizePrior::around(None)),
    }
}

/// One vehicle of the oracle's by itself.
fn alone(
    frame: &Frame,
    vehicle: usize,
    options: &EvaluationOptions,
    oracle: &Oracle,
    (configuration, estimator): (&Configuration, &PoseEstimator),
) -> Fitted {
    let oracle_options = OracleOptions {
        kernel: configuration.kernel,
        bounds: options.bounds,
        degradation: configuration.degradation,
        heads: options.heads,
    };
    by_itself(frame, vehicle, options, oracle.detection(vehicle, &oracle_options), estimator)
}

/// The pose of one detection, whatever is around it.
fn by_itself(
    frame: &Frame,
    vehicle: usize,
    options: &EvaluationOptions,
    detection: Option<Detection>,
    estimator: &PoseEstimator,
) -> Fitted {
    let extent = extent_source(options.extent, &frame.vehicles[vehicle]);
    let start = Instant::now();
    let estimate = match &detection {
        Some(detection) => estimator.estimate(&frame.camera, detection, &extent),
        None => Err(NoPose::TooFewCorrespondences { found: 0, seen: 0 }),
    };
    Fitted { vehicle, detection, estimate, seconds: start.elapsed().as_secs_f64() }
}

/// Evaluates what a detector says of frames: poses of the assigned detections ([`super::matching`]) with at least the
/// score `min_score`, as in the paper.
///
/// `detections` gives those of a frame by its place in the list. A vehicle that is not found has no outcome. Where a
/// frame has no part mask, pixel accuracies are `None`; the configurations' kernels and degradations have no say.
pub fn evaluate_detections(
    frames: &[Frame],
    detections: &(dyn Fn(usize) -> Vec<Detection> + Sync),
    min_score: f64,
    options: &EvaluationOptions,
    configurations: &[Configuration],
    progress: Progress,
) -> Vec<FrameOutcome> {
    let estimators: Vec<PoseEstimator> = configurations
        .iter()
        .map(|configuration| PoseEstimator::new(options.zoo, &configuration.pose))
        .collect();
    let one = |(index, frame): (usize, &Frame)| {
        let found = detections(index).into_iter().filter(|found| found.score >= min_score);
        let outcome =
            evaluate_found(frame, &found.collect::<Vec<_>>(), options, configurations, &estimators);
        progress();
        outcome
    };
    frames.par_iter().enumerate().map(one).collect()
}

fn evaluate_found(
    frame: &Frame,
    detections: &[Detection],
    options: &EvaluationOptions,
    configurations: &[Configuration],
    estimators: &[PoseEstimator],
) -> FrameOutcome {
    let (truths, vehicles) = TruthBoxes::of_frame(frame, &|vehicle| {
        (options.include)(frame, vehicle).then(|| frame.vehicles[vehicle].bounds)
    });
    let boxes: Vec<_> = detections.iter().map(|found| (found.bounds, found.score)).collect();
    let verdicts = match_detections(&boxes, &truths, &MatchOptions::default());
    let mut assigned: Vec<(usize, &Detection)> = verdicts
        .iter()
        .zip(detections)
        .filter_map(|(verdict, detection)| Some((vehicles[verdict.truth()?], detection)))
        .collect();
    if assigned.is_empty() {
        return Ok(vec![Vec::new(); configurations.len()]);
    }
    assigned.sort_by_key(|(vehicle, _)| *vehicle);
    let oracle = match &frame.parts {
        Some(_) => Some(Oracle::new(frame, frame.read_parts()?, options.zoo)),
        None => None,
    };
    let assigned: Vec<(usize, Option<Detection>)> = assigned
        .into_iter()
        .map(|(vehicle, detection)| (vehicle, Some(detection.clone())))
        .collect();
    let run = |(index, (configuration, estimator)): (usize, (&Configuration, &PoseEstimator))| {
        let keep = (options.keep_detections)(frame, index);
        let mut fitted: Vec<Fitted> = match &options.scene {
            Some(protocol) => {
                scene::fit_detections(frame, options, protocol, assigned.clone(), estimator)
            }
            None => assigned
                .iter()
                .map(|(vehicle, found)| {
                    by_itself(frame, *vehicle, options, found.clone(), estimator)
                })
                .collect(),
        };
        observe(frame, options, estimator, &mut fitted);
        let one = |fitted: Fitted| {
            let outcome = outcome(frame, fitted, options, (oracle.as_ref(), configuration));
            VehicleOutcome { detection: outcome.detection.filter(|_| keep), ..outcome }
        };
        fitted.into_iter().map(one).collect()
    };
    Ok(configurations.iter().zip(estimators).enumerate().map(run).collect())
}

/// Compares the parts of every vehicle with its model, if that is asked for.
fn observe(
    frame: &Frame,
    options: &EvaluationOptions,
    estimator: &PoseEstimator,
    fitted: &mut [Fitted],
) {
    for one in fitted.iter_mut().filter(|_| options.observe) {
        if let (Ok(estimate), Some(detection)) = (&mut one.estimate, &one.detection) {
            estimator.observe(&frame.camera, detection, estimate);
        }
    }
}

/// A fit against the truth; `oracle` knows the true part mask.
fn outcome(
    frame: &Frame,
    fitted: Fitted,
    options: &EvaluationOptions,
    (oracle, configuration): (Option<&Oracle>, &Configuration),
) -> VehicleOutcome {
    let Fitted { vehicle, detection, estimate, seconds } = fitted;
    let label = &frame.vehicles[vehicle];
    let scored =
        estimate.as_ref().ok().map(|estimate| deviation(frame, vehicle, options, estimate));
    let sureness = match (&estimate, scored.and_then(|scored| scored.model_is_right)) {
        (Ok(estimate), Some(right)) => sureness(estimate, &label.cuboid, right),
        _ => None,
    };
    let scaling = configuration.pose.scaling;
    let pixel_accuracy = oracle.map(|oracle| {
        detection.as_ref().map_or(0.0, |d| accuracy(oracle, vehicle, d, frame.camera.size, scaling))
    });
    VehicleOutcome { vehicle, detection, estimate, scored, sureness, seconds, pixel_accuracy }
}

fn deviation(
    frame: &Frame,
    vehicle: usize,
    options: &EvaluationOptions,
    estimate: &PoseEstimate,
) -> PoseDeviation {
    let label = &frame.vehicles[vehicle];
    let right = label.model.as_deref().map_or(Vec::new(), options.right_models);
    let is_right = right.contains(&estimate.model_index);
    let deviation = pose_deviation(&estimate.cuboid(), &label.cuboid, is_right);
    PoseDeviation { model_is_right: (!right.is_empty()).then_some(is_right), ..deviation }
}

/// The paper's PA: right pixels of the detection box at image resolution, background included.
fn accuracy(
    oracle: &Oracle,
    vehicle: usize,
    detection: &Detection,
    image_size: [u32; 2],
    scaling: Scaling,
) -> f64 {
    let mask = detection.part_mask(image_size, scaling);
    mask.agreement(&oracle.vehicle_mask(vehicle, &detection.bounds))
}

/// The strength of degradation at which the mean pixel accuracy over the vehicles of some frames is nearest to
/// `target`, and the accuracy it gives; `None` without a vehicle. Frames that cannot be read are left out.
pub fn calibrate(
    frames: &[Frame],
    options: &EvaluationOptions,
    configuration: &Configuration,
    target: f64,
    seed: u64,
) -> Option<(f64, f64)> {
    let oracles: Vec<(&Frame, Vec<usize>, Oracle)> = frames
        .par_iter()
        .map(|frame| (frame, included(frame, options)))
        .filter(|(_, vehicles)| !vehicles.is_empty())
        .filter_map(|(frame, vehicles)| {
            let oracle = Oracle::new(frame, frame.read_parts().ok()?, options.zoo);
            Some((frame, vehicles, oracle))
        })
        .collect();
    if oracles.is_empty() {
        return None;
    }
    let mean_accuracy = |strength: f64| {
        let oracle_options = OracleOptions {
            kernel: configuration.kernel,
            bounds: options.bounds,
            degradation: Some(Degradation { strength, seed }),
            heads: HeadErrors::default(),
        };
        let accuracies: Vec<f64> = oracles
            .par_iter()
            .flat_map_iter(|(frame, vehicles, oracle)| {
                vehicles.iter().filter_map(|vehicle| {
                    let detection = oracle.detection(*vehicle, &oracle_options)?;
                    let size = frame.camera.size;
                    Some(accuracy(oracle, *vehicle, &detection, size, configuration.pose.scaling))
                })
            })
            .collect();
        accuracies.iter().sum::<f64>() / accuracies.len().max(1) as f64
    };
    let strength = strength_for_accuracy(mean_accuracy, target);
    Some((strength, mean_accuracy(strength)))
}
