//! The vehicles of a frame fitted together: on the road that they stand on, and behind each other.

use std::time::Instant;

use rayon::prelude::*;

use crate::dataset::Frame;
use crate::detection::Detection;
use crate::geometry::Vector3;
use crate::oracle::{Oracle, OracleOptions};
use crate::pose::dense::GravityPrior;
use crate::pose::ground::{GroundOptions, GroundPlane};
use crate::pose::scene::{SceneDetection, SceneOptions, estimate_scene, footing};
use crate::pose::{NoPose, PoseEstimate, PoseEstimator};

use super::run::{Configuration, EvaluationOptions, extent_source};

/// How the vehicles of a frame are fitted together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneProtocol {
    /// The road is estimated, and vehicles are put on it.
    pub ground: Option<GroundOptions>,
    /// Which way is down is taken from the data set's camera poses, as from an IMU. Poses of vehicles are never used.
    pub gravity_from_poses: bool,
    /// Nearer fits tell farther ones what is hidden.
    pub occlusion: bool,
    /// Detections do not say what is unknown, as a network's do not.
    pub hide_unknown: bool,
}

/// Error of an IMU's roll and pitch that is supposed, radians.
const IMU_SIGMA: f64 = 0.002;

/// One vehicle of a frame with its detection and what came of it.
pub(super) struct Fitted {
    pub(super) vehicle: usize,
    pub(super) detection: Option<Detection>,
    pub(super) estimate: Result<PoseEstimate, NoPose>,
    pub(super) seconds: f64,
}

/// Fits every vehicle of a frame that is not to be ignored.
pub(super) fn fit(
    frame: &Frame,
    options: &EvaluationOptions,
    protocol: &SceneProtocol,
    oracle: &Oracle,
    (configuration, estimator): (&Configuration, &PoseEstimator),
) -> Vec<Fitted> {
    let detections = detections(frame, options, protocol, oracle, configuration);
    fit_detections(frame, options, protocol, detections, estimator)
}

/// Fits detections of the vehicles of a frame, given by the vehicles' indices.
pub(super) fn fit_detections(
    frame: &Frame,
    options: &EvaluationOptions,
    protocol: &SceneProtocol,
    detections: Vec<(usize, Option<Detection>)>,
    estimator: &PoseEstimator,
) -> Vec<Fitted> {
    let given: Vec<SceneDetection> = detections
        .iter()
        .filter_map(|(vehicle, detection)| {
            let extent = extent_source(options.extent, &frame.vehicles[*vehicle]);
            Some(SceneDetection { detection: detection.as_ref()?, extent })
        })
        .collect();
    let scene = SceneOptions {
        occlusion: protocol.occlusion,
        gravity: protocol.gravity_from_poses.then(|| gravity(frame)).flatten(),
        ground: protocol.ground,
    };
    let start = Instant::now();
    let found = estimate_scene(estimator, options.zoo, &frame.camera, &given, &scene);
    let seconds = start.elapsed().as_secs_f64() / given.len().max(1) as f64;
    let mut estimates = found.vehicles.into_iter();
    let fitted = detections.into_iter().map(|(vehicle, detection)| {
        let estimate = match &detection {
            Some(_) => estimates.next().unwrap_or(Err(NoPose::NoStart)),
            None => Err(NoPose::TooFewCorrespondences { found: 0, seen: 0 }),
        };
        Fitted { vehicle, detection, estimate, seconds }
    });
    fitted.collect()
}

fn detections(
    frame: &Frame,
    options: &EvaluationOptions,
    protocol: &SceneProtocol,
    oracle: &Oracle,
    configuration: &Configuration,
) -> Vec<(usize, Option<Detection>)> {
    let oracle_options = OracleOptions {
        kernel: configuration.kernel,
        bounds: options.bounds,
        degradation: configuration.degradation,
        heads: options.heads,
    };
    let shown = (0..frame.vehicles.len()).filter(|index| !frame.vehicles[*index].dont_care);
    let detection = |vehicle: usize| {
        let mut detection = oracle.detection(vehicle, &oracle_options);
        if let Some(detection) = detection.as_mut().filter(|_| protocol.hide_unknown) {
            detection.unknown = None;
        }
        (vehicle, detection)
    };
    shown.map(detection).collect()
}

/// Down in the camera frame, from the camera's pose in a world whose y axis points down.
fn gravity(frame: &Frame) -> Option<GravityPrior> {
    let world_from_camera = frame.world_from_camera.as_ref()?;
    let down_in_camera = world_from_camera.rotation.inverse() * Vector3::y();
    Some(GravityPrior { down_in_camera, sigma: IMU_SIGMA })
}

/// The height of the camera over a sequence, from the likely sizes of all vehicles: the median over frames. `None`
/// where no frame shows a plane.
pub fn measure_camera_height(
    frames: &[Frame],
    options: &EvaluationOptions,
    configuration: &Configuration,
    protocol: &SceneProtocol,
) -> Option<f64> {
    let ground = GroundOptions { camera_height: None, ..protocol.ground? };
    let estimator = PoseEstimator::new(options.zoo, &configuration.pose);
    let alone = SceneProtocol { ground: None, ..*protocol };
    let mut heights: Vec<f64> = frames
        .par_iter()
        .filter(|frame| frame.vehicles.iter().any(|vehicle| !vehicle.dont_care))
        .filter_map(|frame| {
            let oracle = Oracle::new(frame, frame.read_parts().ok()?, options.zoo);
            let fitted = fit(frame, options, &alone, &oracle, (configuration, &estimator));
            let estimates = fitted.iter().filter_map(|fitted| fitted.estimate.as_ref().ok());
            let footings: Vec<_> = estimates.filter_map(footing).collect();
            let gravity = protocol.gravity_from_poses.then(|| gravity(frame)).flatten();
            Some(GroundPlane::of(&footings, gravity.as_ref(), &ground)?.height)
        })
        .collect();
    heights.sort_by(f64::total_cmp);
    heights.get(heights.len() / 2).copied()
}
