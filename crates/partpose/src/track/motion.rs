//! A Kalman filter of a vehicle's pose with constant velocity and constant rate of turn.
//!
//! Kalman: *A New Approach to Linear Filtering and Prediction Problems*, 1960; backwards over a whole sequence by Rauch,
//! Tung and Striebel: *Maximum Likelihood Estimates of Linear Dynamic Systems*, AIAA Journal 1965. Rotations are kept as
//! such and only their errors are vectors (Markley: *Attitude Error Representations for Kalman Filtering*, 2003), so that
//! a yaw knows no seam.
//!
//! The error's twelve numbers are: rotation vector in camera axes (the true rotation is `exp(w) R`), centre of the cuboid
//! in the camera frame, rate of turn, velocity. The first six are those of
//! [`crate::pose::dense::DenseReport::covariance`].

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, UnitQuaternion, Vector6};
use serde::{Deserialize, Serialize};

use crate::geometry::{Pose, Vector3};

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

/// How far vehicles are from moving evenly.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionNoise {
    /// Standard deviation of the change of velocity within a second, metres per second.
    pub acceleration: f64,
    /// Standard deviation of the change of the rate of turn within a second, radians per second.
    pub turn_acceleration: f64,
    /// Standard deviation of the velocity of a vehicle seen for the first time, metres per second.
    pub first_speed: f64,
    /// The same of its rate of turn, radians per second.
    pub first_turn_rate: f64,
}

impl Default for MotionNoise {
    fn default() -> Self {
        Self { acceleration: 3.0, turn_acceleration: 0.3, first_speed: 12.0, first_turn_rate: 0.3 }
    }
}

/// From one frame to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Seconds between the two, 0 or more.
    pub seconds: f64,
    /// How the camera moved: from its frame then to its frame now; the identity where nobody knows.
    pub camera_from_previous: Pose,
}

/// Where a vehicle is, how it is turned and how both change, with the covariance of all.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// The rotation from the vehicle frame to the camera frame.
    pub rotation: UnitQuaternion<f64>,
    /// Centre of the cuboid in the camera frame, metres.
    pub center: Vector3,
    /// Rate of turn in camera axes, radians per second.
    pub turn_rate: Vector3,
    /// Velocity in camera axes, metres per second.
    pub velocity: Vector3,
    /// Covariance of the errors, in the order of this file's head.
    pub covariance: SMatrix<f64, 12, 12>,
}

impl Step {
    /// The matrix that takes errors before the step to errors after it.
    fn transition(&self) -> Matrix12 {
        let turn: Matrix3<f64> = *self.camera_from_previous.rotation.to_rotation_matrix().matrix();
        let mut transition = Matrix12::zeros();
        for block in 0..4 {
            transition.fixed_view_mut::<3, 3>(3 * block, 3 * block).copy_from(&turn);
        }
        for block in 0..2 {
            let mut rate = transition.fixed_view_mut::<3, 3>(3 * block, 6 + 3 * block);
            rate.copy_from(&(turn * self.seconds));
        }
        transition
    }
}

impl Motion {
    /// A vehicle seen for the first time.
    pub fn first(
        rotation: UnitQuaternion<f64>,
        center: Vector3,
        seen: &Matrix6<f64>,
        noise: &MotionNoise,
    ) -> Self {
        let mut covariance = Matrix12::zeros();
        covariance.fixed_view_mut::<6, 6>(0, 0).copy_from(seen);
        for i in 0..3 {
            covariance[(6 + i, 6 + i)] = noise.first_turn_rate.powi(2);
            covariance[(9 + i, 9 + i)] = noise.first_speed.powi(2);
        }
        let (turn_rate, velocity) = (Vector3::zeros(), Vector3::zeros());
        Self { rotation, center, turn_rate, velocity, covariance }
    }

    /// Where it will be after a step.
    #[must_use]
    pub fn predict(&self, step: &Step, noise: &MotionNoise) -> Self {
        let t = step.seconds;
        let transition = step.transition();
        let mut covariance = transition * self.covariance * transition.transpose();
        for (block, sd) in [(0, noise.turn_acceleration), (3, noise.acceleration)] {
            let density = sd.powi(2);
            for i in block..block + 3 {
                covariance[(i, i)] += density * t.powi(3) / 3.0;
                covariance[(i, 6 + i)] += density * t.powi(2) / 2.0;
                covariance[(6 + i, i)] += density * t.powi(2) / 2.0;
                covariance[(6 + i, 6 + i)] += density * t;
            }
        }
        let turn = &step.camera_from_previous.rotation;
        let moved = nalgebra::Point3::from(self.center + self.velocity * t);
        Self {
            rotation: turn * UnitQuaternion::from_scaled_axis(self.turn_rate * t) * self.rotation,
            center: (step.camera_from_previous * moved).coords,
            turn_rate: turn * self.turn_rate,
            velocity: turn * self.velocity,
            covariance,
        }
    }

    /// Squared Mahalanobis distance of a centre that was seen, three degrees of freedom.
    pub fn distance_to(&self, center: &Vector3, seen: &Matrix6<f64>) -> f64 {
        let spread = self.covariance.fixed_view::<3, 3>(3, 3) + seen.fixed_view::<3, 3>(3, 3);
        let apart = center - self.center;
        spread.cholesky().map_or(f64::INFINITY, |c| apart.dot(&c.solve(&apart)))
    }

    /// With what a frame says of rotation and centre; `seen` is the covariance of both. A sighting farther off than
    /// `limit`, squared, is believed less, the farther the less.
    #[must_use]
    pub fn update(
        &self,
        rotation: &UnitQuaternion<f64>,
        center: &Vector3,
        seen: &Matrix6<f64>,
        limit: f64,
    ) -> Self {
        let turn = (rotation * self.rotation.inverse()).scaled_axis();
        let apart = center - self.center;
        let residual = Vector6::new(turn.x, turn.y, turn.z, apart.x, apart.y, apart.z);
        let prior = self.covariance.fixed_view::<6, 6>(0, 0).into_owned();
        let Some(spread) = (prior + seen).cholesky() else { return self.clone() };
        let far = residual.dot(&spread.solve(&residual)) / limit;
        let seen = seen * far.max(1.0);
        let Some(spread) = (prior + seen).cholesky() else { return self.clone() };
        let columns = self.covariance.fixed_view::<12, 6>(0, 0).into_owned();
        let gain = spread.solve(&columns.transpose()).transpose();
        // Joseph's form stays positive whatever is rounded.
        let mut rest = Matrix12::identity();
        let mut left = rest.fixed_view_mut::<12, 6>(0, 0);
        left -= gain;
        let covariance = rest * self.covariance * rest.transpose() + gain * seen * gain.transpose();
        Self { covariance, ..self.moved_by(&(gain * residual)) }
    }

    /// What the frame after says of this one: `next` is the smoothed state there, `predicted` what this one led to expect.
    #[must_use]
    pub fn smooth(&self, step: &Step, predicted: &Self, next: &Self) -> Self {
        let Some(inverse) = predicted.covariance.cholesky() else { return self.clone() };
        let back = step.transition() * self.covariance;
        let gain = inverse.solve(&back).transpose();
        let covariance =
            self.covariance + gain * (next.covariance - predicted.covariance) * gain.transpose();
        let covariance = 0.5 * (covariance + covariance.transpose());
        Self { covariance, ..self.moved_by(&(gain * next.minus(predicted))) }
    }

    /// Everything that has a length, times a factor: the same picture of a larger vehicle farther away.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let scale = Matrix12::from_fn(|i, j| match (i == j, (i / 3) % 2) {
            (true, 1) => factor,
            (true, _) => 1.0,
            (false, _) => 0.0,
        });
        Self {
            rotation: self.rotation,
            center: self.center * factor,
            turn_rate: self.turn_rate,
            velocity: self.velocity * factor,
            covariance: scale * self.covariance * scale,
        }
    }

    fn moved_by(&self, by: &Vector12) -> Self {
        let three = |at: usize| by.fixed_view::<3, 1>(at, 0).into_owned();
        Self {
            rotation: UnitQuaternion::from_scaled_axis(three(0)) * self.rotation,
            center: self.center + three(3),
            turn_rate: self.turn_rate + three(6),
            velocity: self.velocity + three(9),
            covariance: self.covariance,
        }
    }

    fn minus(&self, other: &Self) -> Vector12 {
        let mut difference = Vector12::zeros();
        let turn = (self.rotation * other.rotation.inverse()).scaled_axis();
        for (at, part) in [
            turn,
            self.center - other.center,
            self.turn_rate - other.turn_rate,
            self.velocity - other.velocity,
        ]
        .iter()
        .enumerate()
        {
            difference.fixed_view_mut::<3, 1>(3 * at, 0).copy_from(part);
        }
        difference
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covariance(turn: f64, place: f64) -> Matrix6<f64> {
        Matrix6::from_fn(|i, j| match (i == j, i < 3) {
            (true, true) => turn * turn,
            (true, false) => place * place,
            (false, _) => 0.0,
        })
    }

    fn step(seconds: f64) -> Step {
        Step { seconds, camera_from_previous: Pose::identity() }
    }

    /// The filter over exact sightings of a vehicle that drives and turns evenly, and where it really is.
    fn drive(frames: usize, step: &Step) -> (Motion, UnitQuaternion<f64>, Vector3) {
        let noise = MotionNoise::default();
        let seen = covariance(0.01, 0.1);
        let (velocity, rate) = (Vector3::new(4.0, 0.0, -7.0), Vector3::new(0.0, 0.8, 0.0));
        let mut rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 3.0, 0.0));
        let mut center = Vector3::new(-3.0, 1.0, 30.0);
        let mut motion = Motion::first(rotation, center, &seen, &noise);
        for _ in 1..frames {
            rotation = UnitQuaternion::from_scaled_axis(rate * step.seconds) * rotation;
            center += velocity * step.seconds;
            motion = motion.predict(step, &noise).update(&rotation, &center, &seen, 1e9);
        }
        (motion, rotation, center)
    }

    #[test]
    fn even_motion_is_followed_through_the_seam_of_the_yaw() {
        let (motion, rotation, center) = drive(40, &step(0.1));
        assert!((motion.center - center).norm() < 0.02, "{}", motion.center);
        assert!(motion.rotation.angle_to(&rotation) < 0.01);
        assert!((motion.velocity - Vector3::new(4.0, 0.0, -7.0)).norm() < 0.3);
        assert!((motion.turn_rate.y - 0.8).abs() < 0.1);
    }

    #[test]
    fn a_turning_camera_that_is_known_is_no_motion_of_the_vehicle() {
        let noise = MotionNoise::default();
        let seen = covariance(0.01, 0.1);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.05, 0.0));
        let moved = Pose::from_parts(Vector3::new(0.0, 0.0, -0.5).into(), turn);
        let step = Step { seconds: 0.1, camera_from_previous: moved };
        let mut pose =
            Pose::from_parts(Vector3::new(2.0, 1.0, 40.0).into(), UnitQuaternion::identity());
        let mut motion = Motion::first(pose.rotation, pose.translation.vector, &seen, &noise);
        for _ in 0..20 {
            pose = moved * pose;
            motion = motion.predict(&step, &noise);
            assert!(motion.distance_to(&pose.translation.vector, &seen) < 1e-6);
            motion = motion.update(&pose.rotation, &pose.translation.vector, &seen, 16.0);
        }
        assert!(motion.velocity.norm() < 1e-6);
    }

    #[test]
    fn a_sighting_far_off_moves_less() {
        let (motion, rotation, center) = drive(20, &step(0.1));
        let seen = covariance(0.01, 0.1);
        let wrong = center + Vector3::new(0.0, 0.0, 8.0);
        let believed = motion.update(&rotation, &wrong, &seen, 1e9).center - center;
        let doubted = motion.update(&rotation, &wrong, &seen, 16.0).center - center;
        assert!(doubted.norm() < 0.1 * believed.norm(), "{doubted} {believed}");
    }

    #[test]
    fn the_future_makes_the_past_surer() {
        let (noise, seen, step) = (MotionNoise::default(), covariance(0.05, 0.5), step(0.1));
        let first = Motion::first(UnitQuaternion::identity(), Vector3::z() * 20.0, &seen, &noise);
        let predicted = first.predict(&step, &noise);
        let second =
            predicted.update(&UnitQuaternion::identity(), &(Vector3::z() * 20.4), &seen, 16.0);
        let smoothed = first.smooth(&step, &predicted, &second);
        assert!(smoothed.covariance.trace() < first.covariance.trace());
        assert!(
            smoothed.velocity.z > 0.0 && smoothed.covariance.symmetric_eigenvalues().min() > 0.0
        );
    }

    #[test]
    fn scaling_is_a_larger_vehicle_farther_away() {
        let (motion, _, _) = drive(5, &step(0.1));
        let twice = motion.scaled(2.0);
        assert_eq!(twice.center, motion.center * 2.0);
        let (a, b) = (&motion.covariance, &twice.covariance);
        assert!(
            (b[(4, 4)] - 4.0 * a[(4, 4)]).abs() < 1e-12 && (a[(1, 1)] - b[(1, 1)]).abs() < 1e-12
        );
        assert!((b[(4, 1)] - 2.0 * a[(4, 1)]).abs() < 1e-12);
    }
}
