//! What one frame says of one vehicle.

use nalgebra::{Matrix3, Matrix6};

use crate::geometry::{Cuboid, Rect};
use crate::pose::PoseEstimate;

/// Deviations where a fit says nothing of itself: turn (radians), sideways and distance (shares of the distance).
const UNKNOWN: [f64; 3] = [0.15, 0.01, 0.06];
/// Standard deviation of the logarithm of a size that nobody gave, where the fit says nothing of it.
const UNKNOWN_SIZE: f64 = 0.08;
/// Largest deviations that are told apart: turn (radians), place as a share of the distance.
const LARGEST: [f64; 2] = [3.0, 1.0];

/// How sure a pose is, as the dense fit says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// As [`crate::pose::dense::DenseReport::covariance`].
    pub covariance: Matrix6<f64>,
    /// As [`crate::pose::dense::DepthAndSize::depth_sd`].
    pub depth_sd: f64,
    /// As [`crate::pose::dense::DepthAndSize::depth_sd_if_size_known`].
    pub depth_sd_if_size_known: f64,
}

/// A vehicle in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation {
    /// The detection's box, pixels.
    pub bounds: Rect,
    /// The detection's confidence, 0 to 1.
    pub score: f64,
    /// The estimated pose and size.
    pub cuboid: Cuboid,
    /// How sure they are; a guess is made where that is not known or not finite.
    pub spread: Option<Spread>,
    /// The probability that the pose is good, 0 to 1; 0.5 where that is not known.
    pub confidence: f64,
    /// Models by name with their probabilities; nothing with a probability of 0 is needed.
    pub models: Vec<(String, f64)>,
}

impl Observation {
    /// Of an estimate of the pose stage; box and score are the detection's.
    pub fn of(bounds: &Rect, score: f64, estimate: &PoseEstimate) -> Self {
        let report = estimate.dense.as_ref();
        let models = match report {
            Some(report) => estimate
                .candidates
                .iter()
                .zip(&report.model_probabilities)
                .map(|(candidate, probability)| (candidate.model.clone(), *probability))
                .collect(),
            None => vec![(estimate.model.clone(), 1.0)],
        };
        Self {
            bounds: *bounds,
            score,
            cuboid: estimate.cuboid(),
            spread: report.map(|report| Spread {
                covariance: report.covariance,
                depth_sd: report.depth_and_size.depth_sd,
                depth_sd_if_size_known: report.depth_and_size.depth_sd_if_size_known,
            }),
            confidence: report.map_or(0.5, |report| report.confidence),
            models,
        }
    }

    /// Covariance of rotation vector and centre if the size is right, and the variance of the logarithm of the size.
    ///
    /// What the unknown size adds lies along the line of sight and is taken out there.
    pub(super) fn covariance_and_size_variance(&self) -> (Matrix6<f64>, f64) {
        let center = self.cuboid.center().coords;
        let distance = center.norm().max(0.1);
        let along = center / distance;
        let Some(spread) = self.usable_spread() else {
            let place = Matrix3::identity() * (UNKNOWN[1] * distance).powi(2)
                + along * along.transpose() * (UNKNOWN[2] * distance).powi(2);
            let mut covariance = Matrix6::identity() * UNKNOWN[0].powi(2);
            covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&place);
            return (covariance, UNKNOWN_SIZE.powi(2));
        };
        let (all, known) = (spread.depth_sd, spread.depth_sd_if_size_known);
        let size = (all * all - known * known).max(0.0) / center.z.abs().max(0.1).powi(2);
        let shrink = if all > 0.0 { (known / all).clamp(0.0, 1.0) } else { 1.0 };
        let mut squeeze = Matrix6::identity();
        let place = Matrix3::identity() + along * along.transpose() * (shrink - 1.0);
        squeeze.fixed_view_mut::<3, 3>(3, 3).copy_from(&place);
        let mut covariance = squeeze * spread.covariance * squeeze.transpose();
        // No filter gains by deviations of kilometres or of whole turns.
        let limit = |i: usize| if i < 3 { LARGEST[0] } else { LARGEST[1] * distance };
        let factors: [f64; 6] =
            std::array::from_fn(|i| (limit(i) / covariance[(i, i)].sqrt()).min(1.0));
        covariance = Matrix6::from_fn(|i, j| covariance[(i, j)] * factors[i] * factors[j]);
        let floor = |i: usize| if i < 3 { 1e-3 } else { 1e-3 * distance };
        for i in 0..6 {
            covariance[(i, i)] += floor(i).powi(2);
        }
        (covariance, size)
    }

    fn usable_spread(&self) -> Option<&Spread> {
        let usable = |spread: &&Spread| {
            spread.covariance.iter().all(|value| value.is_finite())
                && (0..6).all(|i| spread.covariance[(i, i)] > 0.0)
                && spread.depth_sd.is_finite()
                && spread.depth_sd_if_size_known.is_finite()
        };
        self.spread.as_ref().filter(usable)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;
    use crate::geometry::{Camera, Extent, Pose};

    pub(crate) fn camera() -> Camera {
        Camera::pinhole(700.0, [620.5, 187.0], [1242, 375])
    }

    /// A car, `size` times as large as usual, at a place of its centre and with a yaw.
    pub(crate) fn observation(center: [f64; 3], yaw: f64, size: f64) -> Observation {
        let extent = Extent::new(1.8 * size, 1.5 * size, 4.4 * size);
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, yaw, 0.0));
        let bottom = Vector3::from(center) + Vector3::new(0.0, 0.5 * extent.height, 0.0);
        let cuboid =
            Cuboid { camera_from_vehicle: Pose::from_parts(bottom.into(), rotation), extent };
        Observation {
            bounds: cuboid.project(&camera()).unwrap(),
            score: 0.9,
            cuboid,
            spread: None,
            confidence: 0.8,
            models: vec![("sedan".to_owned(), 0.7), ("van".to_owned(), 0.3)],
        }
    }

    #[test]
    fn what_the_size_adds_is_taken_out_along_the_line_of_sight() {
        let mut seen = observation([0.0, 0.0, 20.0], 0.3, 1.0);
        let mut covariance = Matrix6::identity() * 0.01;
        covariance[(5, 5)] = 4.0;
        let spread = Spread { covariance, depth_sd: 2.0, depth_sd_if_size_known: 0.5 };
        seen.spread = Some(spread);
        let (given_size, size) = seen.covariance_and_size_variance();
        assert!((given_size[(5, 5)].sqrt() - 0.5).abs() < 0.01, "{given_size}");
        assert!((given_size[(3, 3)].sqrt() - 0.1).abs() < 0.01);
        assert!((size - (4.0 - 0.25) / 400.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_not_finite_or_too_large_is_bounded() {
        let mut seen = observation([0.0, 0.0, 20.0], 0.3, 1.0);
        let guess = seen.covariance_and_size_variance();
        for value in [f64::INFINITY, f64::NAN, 0.0] {
            seen.spread = Some(Spread {
                covariance: Matrix6::identity() * value,
                depth_sd: 1.0,
                depth_sd_if_size_known: 1.0,
            });
            assert_eq!(seen.covariance_and_size_variance(), guess);
        }
        let covariance = Matrix6::identity() * 1e12;
        seen.spread = Some(Spread { covariance, depth_sd: 1e6, depth_sd_if_size_known: 1e6 });
        let (bounded, _) = seen.covariance_and_size_variance();
        assert!(bounded.diagonal().max() < 401.0 && bounded.cholesky().is_some());
    }
}
