//! What is known of one vehicle over its frames: size, model, which end is the front, and its motion.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Matrix6, UnitQuaternion};

use crate::geometry::{Cuboid, Extent, Point3, Pose, Vector3};

use super::motion::{Motion, Step};
use super::observation::Observation;
use super::tracker::{TrackOptions, TrackedPose};

/// Least probability of a model in one frame: no frame alone rules one out.
const LEAST_PROBABILITY: f64 = 1e-3;
/// Least weight of a sighting.
pub(super) const LEAST_CONFIDENCE: f64 = 0.01;
/// Added to the variance of the logarithm of a size: no frame alone settles it.
const SIZE_FLOOR: f64 = 0.02;
/// Variance of a turn that another frame says, square radians.
const UNSURE_TURN: f64 = 0.5;
/// Variance of a turn that is of no use, square radians.
const NO_TURN: f64 = 4.0;

/// The size and the model, the same in all frames.
#[derive(Clone, Debug, Default)]
pub(super) struct Identity {
    /// Weighted sum of the logarithms of width, height and length.
    logs: Vector3,
    weight: f64,
    /// Weighted sum of the variances: errors of sizes are the same in every frame and do not average out.
    variance: f64,
    /// Sums of the logarithms of probabilities, against the likeliest of each frame.
    models: BTreeMap<String, f64>,
    /// What a model loses that no frame so far named.
    unnamed: f64,
}

impl Identity {
    pub(super) fn add(&mut self, seen: &Observation) {
        let (_, variance) = seen.covariance_and_size_variance();
        let weight = seen.confidence.clamp(LEAST_CONFIDENCE, 1.0) / (variance + SIZE_FLOOR.powi(2));
        self.logs += seen.cuboid.extent.to_vector().map(f64::ln) * weight;
        self.variance += variance * weight;
        self.weight += weight;
        let likely = |probability: f64| probability.max(LEAST_PROBABILITY).ln();
        for (name, _) in &seen.models {
            self.models.entry(name.clone()).or_insert(self.unnamed);
        }
        for (name, sum) in &mut self.models {
            let named = seen.models.iter().find(|(other, _)| other == name);
            *sum += likely(named.map_or(0.0, |(_, probability)| *probability));
        }
        self.unnamed += likely(0.0);
    }

    pub(super) fn extent(&self) -> Extent {
        let sides = (self.logs / self.weight).map(f64::exp);
        Extent::new(sides.x, sides.y, sides.z)
    }

    /// The likeliest; of equals the first by name.
    fn model(&self) -> String {
        let best = self.models.iter().rev().max_by(|a, b| a.1.total_cmp(b.1));
        best.map_or(String::new(), |(name, _)| name.clone())
    }
}

/// A sighting brought to a size and to the end of the vehicle that is thought to be its front.
struct Sighting {
    rotation: UnitQuaternion<f64>,
    center: Vector3,
    covariance: Matrix6<f64>,
}

/// How often sightings agreed with the front that is believed, less how often they did not.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Heading(pub(super) f64);

fn sighting(seen: &Observation, extent: &Extent) -> Sighting {
    let (mut covariance, _) = seen.covariance_and_size_variance();
    let factor = (extent.volume() / seen.cuboid.extent.volume()).cbrt();
    let scale = Matrix6::from_fn(|i, j| match (i == j, i < 3) {
        (true, true) => 1.0,
        (true, false) => factor,
        (false, _) => 0.0,
    });
    covariance = scale * covariance * scale;
    let rotation = seen.cuboid.camera_from_vehicle.rotation;
    Sighting { rotation, center: seen.cuboid.center().coords * factor, covariance }
}

fn half_turn() -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI)
}

/// The motion of a vehicle that is seen for the first time.
pub(super) fn first(seen: &Observation, extent: &Extent, options: &TrackOptions) -> Motion {
    let Sighting { rotation, center, covariance } = sighting(seen, extent);
    Motion::first(rotation, center, &covariance, &options.motion)
}

/// The same motion with another rotation, of which little is known.
pub(super) fn turned_to(motion: &Motion, seen: &Observation) -> Motion {
    let mut turned =
        Motion { rotation: seen.cuboid.camera_from_vehicle.rotation, ..motion.clone() };
    for i in 0..3 {
        turned.covariance[(i, i)] += UNSURE_TURN;
    }
    turned
}

/// The same motion of a vehicle whose other end is the front.
pub(super) fn turned_about(motion: &Motion) -> Motion {
    Motion { rotation: motion.rotation * half_turn(), ..motion.clone() }
}

/// Squared distance of a sighting from where the vehicle is expected.
pub(super) fn distance(motion: &Motion, seen: &Observation, extent: &Extent) -> f64 {
    let sighting = sighting(seen, extent);
    motion.distance_to(&sighting.center, &sighting.covariance)
}

/// The motion with what a frame says of it.
///
/// A sighting with front and back exchanged speaks for the other front and of the line on which the vehicle stands; one
/// that is turned across speaks of the place only.
pub(super) fn update(
    motion: &Motion,
    heading: &mut Heading,
    seen: &Observation,
    extent: &Extent,
    options: &TrackOptions,
) -> Motion {
    let Sighting { mut rotation, center, mut covariance } = sighting(seen, extent);
    let speaks = seen.confidence.clamp(LEAST_CONFIDENCE, 1.0);
    if motion.rotation.angle_to(&rotation) > FRAC_PI_2 {
        rotation *= half_turn();
        heading.0 -= speaks;
    } else {
        heading.0 += speaks;
    }
    if motion.rotation.angle_to(&rotation) > 0.5 * FRAC_PI_2 {
        for i in 0..3 {
            covariance[(i, i)] += NO_TURN;
        }
    }
    motion.update(&rotation, &center, &covariance, options.gate)
}

/// The step from a frame to a later one.
pub(super) fn step(seconds: f64, camera_from_previous: Pose) -> Step {
    Step { seconds: seconds.max(0.0), camera_from_previous }
}

/// The box that a motion and a size make.
pub(super) fn cuboid(motion: &Motion, extent: Extent) -> Cuboid {
    let bottom = motion.rotation * Vector3::new(0.0, 0.5 * extent.height, 0.0);
    let place = Point3::from(motion.center + bottom);
    let camera_from_vehicle = Pose::from_parts(place.coords.into(), motion.rotation);
    Cuboid { camera_from_vehicle, extent }
}

/// What is told of a vehicle in a frame.
pub(super) fn tracked(
    track: u32,
    sightings: usize,
    motion: &Motion,
    identity: &Identity,
) -> TrackedPose {
    let mut covariance = motion.covariance.fixed_view::<6, 6>(0, 0).into_owned();
    // The size errs the same way in all frames: it makes the whole track nearer or farther.
    let size = identity.variance / identity.weight;
    let far: Matrix3<f64> = motion.center * motion.center.transpose() * size;
    let mut place = covariance.fixed_view_mut::<3, 3>(3, 3);
    place += far;
    TrackedPose {
        track,
        sightings,
        model: identity.model(),
        cuboid: cuboid(motion, identity.extent()),
        covariance,
        velocity: motion.velocity,
        turn_rate: motion.turn_rate,
    }
}

#[cfg(test)]
mod tests {
    use super::super::observation::tests::observation;
    use super::*;

    #[test]
    fn size_and_model_are_those_of_all_frames() {
        let mut identity = Identity::default();
        for size in [0.9, 1.0, 1.0 / 0.9] {
            identity.add(&observation([0.0, 1.0, 20.0], 0.0, size));
        }
        let mut wrong = observation([0.0, 1.0, 20.0], 0.0, 1.0);
        wrong.models = vec![("van".to_owned(), 0.6), ("sedan".to_owned(), 0.4)];
        identity.add(&wrong);
        assert!(identity.extent().l1_distance(&wrong.cuboid.extent) < 1e-9);
        assert_eq!(identity.model(), "sedan");
    }

    #[test]
    fn a_sighting_of_another_size_stands_on_the_same_line() {
        let extent = Extent::new(1.8, 1.5, 4.4);
        let options = TrackOptions::default();
        let motion = first(&observation([2.0, 1.0, 20.0], 0.4, 1.0), &extent, &options);
        let larger = observation([2.5, 1.25, 25.0], 0.4, 1.25);
        assert!(distance(&motion, &larger, &extent) < 1e-9);
        let updated = update(&motion, &mut Heading::default(), &larger, &extent, &options);
        assert!((updated.center - motion.center).norm() < 1e-9);
    }

    #[test]
    fn exchanged_ends_do_not_turn_a_vehicle() {
        let extent = Extent::new(1.8, 1.5, 4.4);
        let (options, mut heading) = (TrackOptions::default(), Heading(1.0));
        let motion = first(&observation([2.0, 1.0, 20.0], 0.4, 1.0), &extent, &options);
        let turned = observation([2.0, 1.0, 20.0], 0.4 + PI, 1.0);
        let updated = update(&motion, &mut heading, &turned, &extent, &options);
        assert!(updated.rotation.angle_to(&motion.rotation) < 1e-6);
        assert!(heading.0 < 1.0);
        let across = observation([2.0, 1.0, 20.0], 0.4 + 1.2, 1.0);
        let updated = update(&motion, &mut heading, &across, &extent, &options);
        assert!(updated.rotation.angle_to(&motion.rotation) < 0.1);
    }
}
