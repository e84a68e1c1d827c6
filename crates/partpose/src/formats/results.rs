//! The poses of one image as JSON.

use serde::Serialize;

use crate::detection::Detection;
use crate::geometry::{Camera, EulerAngles, Extent, Pose};
use crate::parts::PartClass;
use crate::pose::dense::{DenseFlag, DenseReport, DepthAndSize, ModeKind, ShapeMeasure};
use crate::pose::{
    Candidate, NoPose, PartState, PartVerdict, PoseEstimate, PoseOptions, Reason, reasons,
};

/// All detections of one image, with poses or with reasons.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageResult {
    /// Name of the image.
    pub image: String,
    /// The camera the poses refer to.
    pub camera: Camera,
    /// How the poses were found.
    pub settings: ResultSettings,
    /// In the order of the detections.
    pub vehicles: Vec<VehicleResult>,
}

/// What a result depends on besides its detections.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ResultSettings {
    /// Version of `partpose`.
    pub version: &'static str,
    /// The zoo, as it was given.
    pub zoo: String,
    /// Where sizes came from, in words.
    pub extent: String,
    /// The pose stage.
    pub pose: PoseOptions,
    /// What tells the settings of a whole run from others, the detector's included; `None` where there is no run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
}

/// One detection with its pose, or with the reason why there is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VehicleResult {
    /// `x_min, y_min, x_max, y_max` in pixels, pixel centres at integers.
    pub bounds: [f64; 4],
    /// Confidence of the detection.
    pub score: f64,
    /// The pose, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose: Option<PoseResult>,
    /// Why there is no pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_pose: Option<String>,
    /// Why there is no pose, or what limits what may be made of it; empty for a good pose of known size.
    pub reasons: Vec<Reason>,
}

/// A pose as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseResult {
    /// Name of the model.
    pub model: String,
    /// Bottom-face centre in the camera frame, metres.
    pub translation: [f64; 3],
    /// Rows of the rotation that takes the vehicle frame to the camera frame.
    pub rotation: [[f64; 3]; 3],
    /// The same as angles about the camera's axes, `R = R_y R_x R_z`, radians.
    pub euler_angles: EulerAngles,
    /// Size in metres.
    pub extent: Extent,
    /// Root mean square reprojection error, pixels; not there with the dense fit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reprojection_rmse: Option<f64>,
    /// Another pose that explains the same points nearly as well: nearly flat parts leave two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alternative: Option<AlternativeResult>,
    /// What the pose rests on.
    pub correspondences: Vec<CorrespondenceResult>,
    /// How each model of the zoo fared.
    pub candidates: Vec<CandidateResult>,
    /// What the mask shows of each part, against the model at its pose.
    pub parts: Vec<PartResult>,
    /// What only the dense fit knows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dense: Option<DenseResult>,
}

/// What the dense fit adds, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DenseResult {
    /// The data term per cell that shows the vehicle: 0 for a perfect fit, 1 for none.
    pub energy: f64,
    /// Cells of a 28 x 28 kernel that show the vehicle.
    pub foreground: f64,
    /// Rows of the covariance of a rotation vector in camera axes about the cuboid's centre (radians) and of the
    /// centre's place in the camera frame (metres); then, where the size was free, of the logarithms of width, height
    /// and length.
    pub covariance: Vec<Vec<f64>>,
    /// How distance and size trade off.
    pub depth_and_size: DepthAndSize,
    /// The probability of each model of the zoo.
    pub model_probabilities: Vec<ModelProbability>,
    /// The best pose that is clearly another.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second_mode: Option<SecondModeResult>,
    /// The probability that estimate and truth share more than half of their volumes.
    pub confidence: f64,
    /// What speaks against it.
    pub flags: Vec<DenseFlag>,
    /// The vehicle's measures, where they were fitted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub shape: Vec<ShapeMeasure>,
}

/// A part's state as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PartResult {
    /// The part.
    pub part: PartClass,
    /// Whether mask and model agree on it.
    pub verdict: PartVerdict,
    /// How much they agree, 0 to 1.
    pub agreement: f64,
    /// `x_min, y_min, x_max, y_max` of its pixels in the mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bounds: Option<[f64; 4]>,
    /// The middle of what is seen of it, pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_in_image: Option<[f64; 2]>,
    /// What the mask shows of it, square pixels.
    pub area: f64,
    /// Mean probability where the mask has it.
    pub probability: f64,
    /// What the model shows of it, square pixels.
    pub area_of_model: f64,
    /// The share of that of which the mask says anything.
    pub known_share: f64,
    /// Middle of its visible surface in the camera frame, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_in_camera: Option<[f64; 3]>,
    /// The same in the vehicle frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point_in_vehicle: Option<[f64; 3]>,
}

/// A model's probability as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ModelProbability {
    /// Name of the model.
    pub model: String,
    /// 0 to 1; they sum to 1.
    pub probability: f64,
}

/// Another pose that explains the mask, as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SecondModeResult {
    /// What it exchanges.
    pub kind: ModeKind,
    /// Its model's name.
    pub model: String,
    /// Bottom-face centre in the camera frame, metres.
    pub translation: [f64; 3],
    /// Rows of the rotation that takes the vehicle frame to the camera frame.
    pub rotation: [[f64; 3]; 3],
    /// Size in metres.
    pub extent: Extent,
    /// As that of the first.
    pub energy: f64,
    /// Its probability against the first.
    pub probability: f64,
}

/// A second pose as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AlternativeResult {
    /// Bottom-face centre in the camera frame, metres.
    pub translation: [f64; 3],
    /// Rows of the rotation that takes the vehicle frame to the camera frame.
    pub rotation: [[f64; 3]; 3],
    /// Root mean square reprojection error, pixels.
    pub reprojection_rmse: f64,
}

/// A correspondence as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CorrespondenceResult {
    /// The part.
    pub part: PartClass,
    /// Pixels.
    pub point_in_image: [f64; 2],
    /// Metres in the vehicle frame.
    pub point_in_vehicle: [f64; 3],
    /// Pixels.
    pub residual: f64,
    /// Whether the fit counts it as right.
    pub inlier: bool,
}

/// One model's fit as JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CandidateResult {
    /// Name of the model.
    pub model: String,
    /// What models are compared by: the reprojection error in pixels, where an outlier counts as far as its threshold;
    /// with the dense fit the energy per foreground cell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Why there is no pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_pose: Option<String>,
}

/// The result of an image whose detections were estimated one by one.
pub fn image_result(
    image: &str,
    camera: &Camera,
    settings: &ResultSettings,
    estimated: &[(Detection, Result<PoseEstimate, NoPose>)],
) -> ImageResult {
    let vehicle =
        |(detection, outcome): &(Detection, Result<PoseEstimate, NoPose>)| VehicleResult {
            bounds: {
                let b = &detection.bounds;
                [b.x_min, b.y_min, b.x_max, b.y_max]
            },
            score: detection.score,
            pose: outcome.as_ref().ok().map(pose_result),
            no_pose: outcome.as_ref().err().map(ToString::to_string),
            reasons: reasons(outcome),
        };
    let vehicles = estimated.iter().map(vehicle).collect();
    ImageResult { image: image.to_owned(), camera: *camera, settings: settings.clone(), vehicles }
}

fn pose_result(estimate: &PoseEstimate) -> PoseResult {
    let (translation, rotation) = placed(&estimate.camera_from_vehicle);
    let angles = estimate.camera_from_vehicle.rotation.to_rotation_matrix();
    let candidate = |candidate: &Candidate| CandidateResult {
        model: candidate.model.clone(),
        error: candidate.outcome.as_ref().ok().copied(),
        no_pose: candidate.outcome.as_ref().err().map(ToString::to_string),
    };
    PoseResult {
        model: estimate.model.clone(),
        translation,
        rotation,
        euler_angles: EulerAngles::from_rotation(&angles),
        extent: estimate.extent,
        reprojection_rmse: estimate.reprojection_rmse,
        alternative: estimate.alternative.as_ref().map(|alternative| {
            let (translation, rotation) = placed(&alternative.camera_from_vehicle);
            let reprojection_rmse = alternative.reprojection_rmse;
            AlternativeResult { translation, rotation, reprojection_rmse }
        }),
        correspondences: estimate
            .correspondences
            .iter()
            .map(|c| CorrespondenceResult {
                part: c.part,
                point_in_image: c.point_in_image.coords.into(),
                point_in_vehicle: c.point_in_vehicle.coords.into(),
                residual: c.residual,
                inlier: c.inlier,
            })
            .collect(),
        candidates: estimate.candidates.iter().map(candidate).collect(),
        parts: estimate.parts.iter().map(part_result).collect(),
        dense: estimate.dense.as_ref().map(|report| dense_result(estimate, report)),
    }
}

fn part_result(state: &PartState) -> PartResult {
    PartResult {
        part: state.part,
        verdict: state.verdict,
        agreement: state.agreement,
        bounds: state.bounds.map(|b| [b.x_min, b.y_min, b.x_max, b.y_max]),
        point_in_image: state.point_in_image.map(|point| point.coords.into()),
        area: state.area,
        probability: state.probability,
        area_of_model: state.area_of_model,
        known_share: state.known_share,
        point_in_camera: state.point_in_camera.map(|point| point.coords.into()),
        point_in_vehicle: state.point_in_vehicle.map(|point| point.coords.into()),
    }
}

fn dense_result(estimate: &PoseEstimate, report: &DenseReport) -> DenseResult {
    let name = |index: usize| {
        estimate.candidates.get(index).map_or(String::new(), |candidate| candidate.model.clone())
    };
    let covariance = match &report.covariance_with_size {
        Some(all) => rows(all),
        None => rows(&report.covariance),
    };
    let probability = |(index, probability): (usize, &f64)| ModelProbability {
        model: name(index),
        probability: *probability,
    };
    DenseResult {
        energy: report.energy,
        foreground: report.foreground,
        covariance,
        depth_and_size: report.depth_and_size,
        model_probabilities: report
            .model_probabilities
            .iter()
            .enumerate()
            .map(probability)
            .collect(),
        second_mode: report.second_mode.as_ref().map(|mode| {
            let (translation, rotation) = placed(&mode.camera_from_vehicle);
            SecondModeResult {
                kind: mode.kind,
                model: name(mode.model_index),
                translation,
                rotation,
                extent: mode.extent,
                energy: mode.energy,
                probability: mode.probability,
            }
        }),
        confidence: report.confidence,
        flags: report.flags.clone(),
        shape: report.shape.clone(),
    }
}

pub(super) fn rows<const N: usize>(matrix: &nalgebra::SMatrix<f64, N, N>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// Translation, and the rows of the rotation.
pub(super) fn placed(camera_from_vehicle: &Pose) -> ([f64; 3], [[f64; 3]; 3]) {
    let rotation = camera_from_vehicle.rotation.to_rotation_matrix();
    let m = rotation.matrix();
    let rows = std::array::from_fn(|row| std::array::from_fn(|column| m[(row, column)]));
    (camera_from_vehicle.translation.vector.into(), rows)
}
