//! How far poses are from the truth (paper, § IV-D).
//!
//! The paper's translation and rotation deviations are sums over the three axes, not norms; both are kept, under
//! different names.

use serde::{Deserialize, Serialize};

use crate::geometry::{Cuboid, EulerAngles, wrap_angle};

/// One estimate against its truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseDeviation {
    /// Whether the predicted model is the true one; `None` where the zoo has no model by the label's name.
    pub model_is_right: Option<bool>,
    /// Intersection over union of the two cuboids.
    pub iou3d: f64,
    /// Absolute differences of the bottom-face centres along the camera's axes, metres.
    pub translation: [f64; 3],
    /// Absolute differences of the Euler angles about the camera's x, y and z axes, radians.
    pub rotation: [f64; 3],
    /// Euclidean distance of the bottom-face centres, metres.
    pub distance: f64,
    /// Angle of the rotation between the two, radians.
    pub angle: f64,
}

/// Deviation of a predicted cuboid from the true one.
pub fn pose_deviation(predicted: &Cuboid, truth: &Cuboid, model_is_right: bool) -> PoseDeviation {
    let (a, b) = (&predicted.camera_from_vehicle, &truth.camera_from_vehicle);
    let difference = a.translation.vector - b.translation.vector;
    let angles = |cuboid: &Cuboid| {
        EulerAngles::from_rotation(&cuboid.camera_from_vehicle.rotation.to_rotation_matrix())
    };
    let (p, t) = (angles(predicted), angles(truth));
    PoseDeviation {
        model_is_right: Some(model_is_right),
        iou3d: predicted.iou(truth),
        translation: [difference.x.abs(), difference.y.abs(), difference.z.abs()],
        rotation: [p.x - t.x, p.y - t.y, p.z - t.z].map(|turn| wrap_angle(turn).abs()),
        distance: difference.norm(),
        angle: a.rotation.angle_to(&b.rotation),
    }
}

/// One detection's score: `None` where there is no pose.
pub type Scored = Option<PoseDeviation>;

/// Scores of many detections; means are over the fitted ones, as in the paper, unless the name says otherwise, and NaN
/// (`null` in JSON) where none was fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseScores {
    /// Detections, fitted or not.
    pub count: usize,
    /// Share of detections without a pose.
    pub unfittable: f64,
    /// Share with the right model, of those where it is known which one that is.
    pub model_precision: f64,
    /// Mean 3D IoU.
    pub mean_iou3d: f64,
    /// Median 3D IoU.
    pub median_iou3d: f64,
    /// Mean 3D IoU over all detections, those without a pose counted as 0.
    pub mean_iou3d_all: f64,
    /// Sum of the three mean translation deviations, metres: the paper's ΔT.
    pub delta_t: f64,
    /// Sum of the three mean rotation deviations, radians: the paper's ΔR.
    pub delta_r: f64,
    /// Mean absolute deviation along x, y, z, metres.
    pub delta_xyz: [f64; 3],
    /// Mean absolute deviation of the Euler angles about x, y, z, radians.
    pub delta_angles: [f64; 3],
    /// Median Euclidean distance, metres.
    pub median_distance: f64,
    /// Median rotation angle, radians.
    pub median_angle: f64,
}

impl PoseScores {
    /// The scores of `count` detections none of which has a pose.
    fn without_fit(count: usize) -> Self {
        Self {
            count,
            unfittable: if count == 0 { f64::NAN } else { 1.0 },
            model_precision: f64::NAN,
            mean_iou3d: f64::NAN,
            median_iou3d: f64::NAN,
            mean_iou3d_all: if count == 0 { f64::NAN } else { 0.0 },
            delta_t: f64::NAN,
            delta_r: f64::NAN,
            delta_xyz: [f64::NAN; 3],
            delta_angles: [f64::NAN; 3],
            median_distance: f64::NAN,
            median_angle: f64::NAN,
        }
    }
}

/// Scores of detections in the order given.
pub fn summarize(scored: impl IntoIterator<Item = Scored>) -> PoseScores {
    let all: Vec<Scored> = scored.into_iter().collect();
    let fitted: Vec<PoseDeviation> = all.iter().flatten().copied().collect();
    if fitted.is_empty() {
        return PoseScores::without_fit(all.len());
    }
    let n = fitted.len() as f64;
    let mean = |value: &dyn Fn(&PoseDeviation) -> f64| fitted.iter().map(value).sum::<f64>() / n;
    let median = |value: &dyn Fn(&PoseDeviation) -> f64| {
        let mut values: Vec<f64> = fitted.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
    };
    let delta_xyz: [f64; 3] = std::array::from_fn(|axis| mean(&|d| d.translation[axis]));
    let delta_angles: [f64; 3] = std::array::from_fn(|axis| mean(&|d| d.rotation[axis]));
    let mean_iou3d = mean(&|d| d.iou3d);
    PoseScores {
        count: all.len(),
        unfittable: 1.0 - n / all.len() as f64,
        model_precision: {
            let known = || fitted.iter().filter_map(|d| d.model_is_right);
            // 0 / 0 is NaN, as is meant.
            known().filter(|right| *right).count() as f64 / known().count() as f64
        },
        mean_iou3d,
        median_iou3d: median(&|d| d.iou3d),
        mean_iou3d_all: mean_iou3d * n / all.len() as f64,
        delta_t: delta_xyz.iter().sum(),
        delta_r: delta_angles.iter().sum(),
        delta_xyz,
        delta_angles,
        median_distance: median(&|d| d.distance),
        median_angle: median(&|d| d.angle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Extent, Pose, Vector3};
    use nalgebra::UnitQuaternion;

    fn cuboid(x: f64, z: f64, yaw: f64) -> Cuboid {
        let rotation = EulerAngles { x: 0.02, y: yaw, z: -0.01 }.to_rotation();
        Cuboid {
            camera_from_vehicle: Pose::from_parts(
                Vector3::new(x, 1.6, z).into(),
                UnitQuaternion::from_rotation_matrix(&rotation),
            ),
            extent: Extent::new(1.8, 1.5, 4.4),
        }
    }

    #[test]
    fn deviation_is_by_axis_and_wraps() {
        let deviation = pose_deviation(&cuboid(1.0, 20.5, 3.1), &cuboid(0.7, 20.0, -3.1), true);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(close(deviation.translation[0], 0.3) && close(deviation.translation[2], 0.5));
        assert!(close(deviation.distance, 0.34f64.sqrt()));
        assert!(close(deviation.rotation[1], std::f64::consts::TAU - 6.2));
        assert!(deviation.rotation[0] < 1e-9 && deviation.iou3d > 0.5);
    }

    #[test]
    fn detections_without_a_pose_are_counted_apart() {
        let good = pose_deviation(&cuboid(0.0, 20.0, 0.5), &cuboid(0.0, 20.0, 0.5), true);
        let bad = pose_deviation(&cuboid(0.0, 40.0, 0.5), &cuboid(0.0, 20.0, 0.5), false);
        let scores = summarize([Some(good), None, Some(bad), None]);
        assert_eq!((scores.count, scores.unfittable), (4, 0.5));
        assert!((scores.mean_iou3d - 0.5).abs() < 1e-9);
        assert!((scores.mean_iou3d_all - 0.25).abs() < 1e-9);
        assert!(
            (scores.delta_t - 10.0).abs() < 1e-9 && (scores.model_precision - 0.5).abs() < 1e-9
        );
    }

    #[test]
    fn nothing_has_no_scores() {
        assert!(summarize([]).unfittable.is_nan());
        let scores = summarize([None]);
        assert!((scores.unfittable - 1.0).abs() < 1e-12 && scores.mean_iou3d_all.abs() < 1e-12);
        // A run without a single fit must not look like a perfect one.
        assert!(scores.delta_t.is_nan() && scores.model_precision.is_nan());
    }
}
