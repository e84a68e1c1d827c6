//! The detections of one image together: what hides what, and the road that all stand on.
//!
//! Networks say "background" where a nearer vehicle stands, and a fit that believes them pulls the outline inwards. So
//! detections are fitted from front to back, the lower edge of the box first (vehicles stand on a road), and each is
//! told which of its cells the nearer fits cover. With a road asked for, the first fits say where it is, and all are
//! fitted again on it.

use crate::detection::Detection;
use crate::geometry::Camera;
use crate::parts::BACKGROUND;
use crate::render::{Instance, LabelRenderer, RenderOptions};
use crate::vehicle::{Mesh, ModelZoo};

use super::dense::{DensePriors, GravityPrior};
use super::ground::{Footing, GroundOptions, GroundPlane};
use super::{ExtentSource, NoPose, PoseEstimate, PoseEstimator};

/// What is supposed of the vehicles of one image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneOptions {
    /// Whether nearer vehicles' fits tell the farther ones what is hidden.
    pub occlusion: bool,
    /// Which way is down, where something besides the image knows: an IMU, a data set's camera poses.
    pub gravity: Option<GravityPrior>,
    /// Whether the road is estimated and the vehicles put on it.
    pub ground: Option<GroundOptions>,
}

/// One vehicle of a scene.
#[derive(Clone, Copy, Debug)]
pub struct SceneDetection<'a> {
    /// What the network says of it.
    pub detection: &'a Detection,
    /// Where its size comes from.
    pub extent: ExtentSource,
}

/// What was found in one image.
#[derive(Clone, Debug)]
pub struct SceneEstimate {
    /// One result a detection, in their order.
    pub vehicles: Vec<Result<PoseEstimate, NoPose>>,
    /// The road, where it was asked for and found.
    pub ground: Option<GroundPlane>,
}

/// Energy per foreground cell up to which a fit is believed where it hides others or says where the road is.
const BELIEVED: f64 = 0.3;
/// Samples a side of a cell when it is asked what a nearer vehicle covers.
const SAMPLES: usize = 4;
/// Probability of the vehicle's own parts above which a cell is not hidden, whatever the nearer fit says.
const OWN: f32 = 0.5;

/// Fits all detections of an image. `zoo` is that of the estimator. Without the dense fit, options have no effect.
pub fn estimate_scene(
    estimator: &PoseEstimator,
    zoo: &ModelZoo,
    camera: &Camera,
    detections: &[SceneDetection],
    options: &SceneOptions,
) -> SceneEstimate {
    let priors = DensePriors { gravity: options.gravity, ground: None };
    let scene = Scene { estimator, zoo, camera, detections, occlusion: options.occlusion };
    let first = scene.fit(&|_| priors);
    let Some(ground) = &options.ground else {
        return SceneEstimate { vehicles: first, ground: None };
    };
    let footings: Vec<Footing> = first.iter().flatten().filter_map(footing).collect();
    let Some(plane) = GroundPlane::of(&footings, options.gravity.as_ref(), ground) else {
        return SceneEstimate { vehicles: first, ground: None };
    };
    let gravity = options.gravity.unwrap_or_else(|| plane.gravity());
    let on_plane = |index: usize| match &first[index] {
        Ok(estimate) => {
            let bottom = estimate.camera_from_vehicle.translation.vector.into();
            DensePriors { gravity: Some(gravity), ground: Some(plane.prior_at(&bottom)) }
        }
        Err(_) => priors,
    };
    SceneEstimate { vehicles: scene.fit(&on_plane), ground: Some(plane) }
}

/// What a fit says of the road; `None` if it is not believed.
pub fn footing(estimate: &PoseEstimate) -> Option<Footing> {
    let is_believed = estimate.dense.as_ref().is_some_and(|report| report.energy < BELIEVED);
    let pose = &estimate.camera_from_vehicle;
    is_believed.then(|| Footing {
        bottom: pose.translation.vector.into(),
        down: pose.rotation * crate::geometry::Vector3::y(),
    })
}

struct Scene<'a> {
    estimator: &'a PoseEstimator,
    zoo: &'a ModelZoo,
    camera: &'a Camera,
    detections: &'a [SceneDetection<'a>],
    occlusion: bool,
}

impl Scene<'_> {
    /// Every detection, from front to back.
    fn fit(&self, priors: &dyn Fn(usize) -> DensePriors) -> Vec<Result<PoseEstimate, NoPose>> {
        let mut order: Vec<usize> = (0..self.detections.len()).collect();
        let lower = |index: &usize| self.detections[*index].detection.bounds.y_max;
        order.sort_by(|a, b| lower(b).total_cmp(&lower(a)));
        let mut found: Vec<Option<Result<PoseEstimate, NoPose>>> =
            vec![None; self.detections.len()];
        let mut renderer = LabelRenderer::default();
        for index in order {
            let SceneDetection { detection, extent } = &self.detections[index];
            let nearer: Vec<&PoseEstimate> = found.iter().flatten().flatten().collect();
            let hidden = self.occlusion.then(|| self.hidden(detection, &nearer, &mut renderer));
            let seen = hidden.flatten();
            let detection = seen.as_ref().unwrap_or(detection);
            let fitted =
                self.estimator.estimate_with(self.camera, detection, extent, &priors(index));
            found[index] = Some(fitted);
        }
        found.into_iter().map(|one| one.unwrap_or(Err(NoPose::NoStart))).collect()
    }

    /// The detection with what nearer vehicles cover marked as unknown; `None` if that is nothing.
    fn hidden(
        &self,
        detection: &Detection,
        nearer: &[&PoseEstimate],
        renderer: &mut LabelRenderer,
    ) -> Option<Detection> {
        let m = detection.probabilities.size();
        let bias = &self.estimator.options().dense.mask_bias;
        let mut covered = vec![0.0f32; m * m];
        for estimate in nearer {
            let is_believed =
                estimate.dense.as_ref().is_some_and(|report| report.energy < BELIEVED);
            let cuboid = estimate.cuboid();
            let overlaps = cuboid
                .project(self.camera)
                .is_some_and(|rect| rect.intersection(&detection.bounds).is_some());
            if !is_believed || !overlaps {
                continue;
            }
            let camera = bias.map_or(*self.camera, |bias| bias.camera(self.camera, &cuboid));
            let side = (m * SAMPLES) as u32;
            let crop = camera.crop(&detection.bounds, [side; 2]);
            let mesh: &Mesh = self.zoo.models.get(estimate.model_index)?.mesh();
            let instance = Instance {
                mesh,
                scale: estimate.scale,
                camera_from_vehicle: estimate.camera_from_vehicle,
                id: 1,
            };
            let drawn = renderer.render(&crop, &[instance], &RenderOptions::default());
            let mut share = vec![0.0f32; m * m];
            for (at, part) in drawn.parts.iter().enumerate() {
                if *part != BACKGROUND {
                    let (x, y) = (at % side as usize / SAMPLES, at / side as usize / SAMPLES);
                    share[y * m + x] += 1.0 / (SAMPLES * SAMPLES) as f32;
                }
            }
            for (all, own) in covered.iter_mut().zip(share) {
                *all = all.max(own);
            }
        }
        if covered.iter().all(|share| *share == 0.0) {
            return None;
        }
        let background = detection.probabilities.channel(0);
        let mut unknown = detection.unknown.clone().unwrap_or_else(|| vec![0.0; m * m]);
        for ((unknown, covered), background) in unknown.iter_mut().zip(covered).zip(background) {
            if 1.0 - background < OWN {
                *unknown = unknown.max(covered.min(1.0));
            }
        }
        Some(Detection { unknown: Some(unknown), ..detection.clone() })
    }
}
