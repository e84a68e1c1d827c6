//! Which sighting is of which vehicle, frame after frame.
//!
//! A sighting fits a vehicle if their boxes overlap in the image and its place lies within the gate of where the vehicle
//! is expected, by the covariances of both, or if their boxes overlap by so much that the place does not matter: fits of
//! single images miss distances by much, boxes by little. Of all ways to pair them the one with the lowest sum of both
//! costs is taken, in which a sighting without a vehicle has its price, too. A vehicle begins with a
//! sighting that fits none, and ends when it was not seen for a while.

use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};

use crate::geometry::{Camera, Cuboid, Pose, Rect, Vector3};

use super::assignment::assign;
use super::motion::{Motion, MotionNoise};
use super::observation::Observation;
use super::vehicle::{self, Heading, Identity};

/// How vehicles are followed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrackOptions {
    /// How vehicles move.
    pub motion: MotionNoise,
    /// Squared Mahalanobis distance of places up to which a sighting fits a vehicle; sightings farther off that fit by
    /// their box are believed less.
    pub gate: f64,
    /// Least intersection over union of the boxes in the image for a sighting to fit: within the gate, and wherever its
    /// place is.
    pub min_iou: [f64; 2],
    /// What a sighting without a vehicle costs; one with a vehicle costs 0 to 2, half for its place, half for its box.
    pub alone: f64,
    /// Least score of a sighting with which a vehicle begins; others go on with one.
    pub start_score: f64,
    /// Longest time without a sighting, seconds.
    pub longest_gap: f64,
    /// Fewest sightings of a vehicle in a whole sequence; those with fewer are dropped by [`super::smooth_sequence`].
    pub least_sightings: usize,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            motion: MotionNoise::default(),
            gate: 16.0,
            min_iou: [0.1, 0.5],
            alone: 1.5,
            start_score: 0.5,
            longest_gap: 1.0,
            least_sightings: 2,
        }
    }
}

/// A vehicle in a frame, as all frames that were looked at say it.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedPose {
    /// Number of the vehicle, from 1, in the order in which they appeared.
    pub track: u32,
    /// How often it was seen: up to now, or in the whole sequence.
    pub sightings: usize,
    /// The likeliest model over the frames.
    pub model: String,
    /// Pose and size.
    pub cuboid: Cuboid,
    /// Covariance as of [`crate::pose::dense::DenseReport::covariance`], what is open of the size included.
    pub covariance: Matrix6<f64>,
    /// Velocity in camera axes, metres per second: against the camera unless it is known how that moves.
    pub velocity: Vector3,
    /// Rate of turn in camera axes, radians per second.
    pub turn_rate: Vector3,
}

/// A vehicle that is being followed.
#[derive(Clone, Debug)]
struct Followed {
    track: u32,
    motion: Motion,
    identity: Identity,
    heading: Heading,
    /// Box of the last sighting.
    bounds: Rect,
    sightings: usize,
    /// When it was seen last.
    seen: f64,
}

/// Follows the vehicles of one sequence.
#[derive(Clone, Debug)]
pub struct Tracker {
    options: TrackOptions,
    followed: Vec<Followed>,
    last: u32,
    time: Option<f64>,
}

impl Tracker {
    /// One that has seen nothing yet.
    pub fn new(options: &TrackOptions) -> Self {
        Self { options: *options, followed: Vec::new(), last: 0, time: None }
    }

    /// Takes the next frame; gives the vehicle of each sighting, or `None` where none may begin with it.
    ///
    /// `time` is in seconds and must not fall; `camera_from_previous` takes the camera's frame at the last call to that
    /// of now, the identity where nobody knows how it moved.
    pub fn step(
        &mut self,
        time: f64,
        camera: &Camera,
        camera_from_previous: &Pose,
        seen: &[Observation],
    ) -> Vec<Option<TrackedPose>> {
        let step = vehicle::step(self.time.map_or(0.0, |last| time - last), *camera_from_previous);
        let before = self.time.replace(time);
        for followed in &mut self.followed {
            followed.motion = followed.motion.predict(&step, &self.options.motion);
        }
        let longest = self.options.longest_gap + 1e-9;
        self.followed.retain(|followed| time - followed.seen <= longest);
        let (followed, options) = (&self.followed, &self.options);
        let expected: Vec<Option<Rect>> = followed.iter().map(|f| f.expected(camera)).collect();
        let pairs = assign(seen.len(), followed.len(), options.alone, &|row, column| {
            let (followed, expected) = (&followed[column], expected[column].as_ref());
            // The last box is right where the expected place is not, as long as it is fresh.
            let last = (before == Some(followed.seen)).then_some(&followed.bounds);
            followed.cost(&seen[row], [expected, last], options)
        });
        let found = seen.iter().zip(pairs).map(|(seen, pair)| match pair {
            Some(index) => {
                let followed = &mut self.followed[index];
                followed.take(seen, time, &self.options);
                Some(followed.tracked())
            }
            None if seen.score >= self.options.start_score => {
                self.last += 1;
                let begun = Followed::begin(self.last, seen, time, &self.options);
                self.followed.push(begun);
                self.followed.last().map(Followed::tracked)
            }
            None => None,
        });
        found.collect()
    }
}

impl Followed {
    fn begin(track: u32, seen: &Observation, time: f64, options: &TrackOptions) -> Self {
        let mut identity = Identity::default();
        identity.add(seen);
        let motion = vehicle::first(seen, &identity.extent(), options);
        let heading = Heading(seen.confidence.clamp(vehicle::LEAST_CONFIDENCE, 1.0));
        Self { track, motion, identity, heading, bounds: seen.bounds, sightings: 1, seen: time }
    }

    /// Where it is expected in the image.
    fn expected(&self, camera: &Camera) -> Option<Rect> {
        let cuboid = vehicle::cuboid(&self.motion, self.identity.extent());
        cuboid.project(camera)?.intersection(&camera.image_rect())
    }

    /// What it costs to take a sighting for this vehicle, whose boxes may be anywhere of these, 0 to 2; `None` if it
    /// does not fit.
    fn cost(
        &self,
        seen: &Observation,
        boxes: [Option<&Rect>; 2],
        options: &TrackOptions,
    ) -> Option<f64> {
        let overlaps = boxes.into_iter().flatten().map(|bounds| bounds.iou(&seen.bounds));
        let overlap = overlaps.fold(0.0, f64::max);
        let far = vehicle::distance(&self.motion, seen, &self.identity.extent()) / options.gate;
        let least = options.min_iou[usize::from(!(far <= 1.0))];
        (overlap >= least).then(|| far.min(1.0) + 1.0 - overlap)
    }

    fn take(&mut self, seen: &Observation, time: f64, options: &TrackOptions) {
        let before = self.identity.extent();
        self.identity.add(seen);
        let extent = self.identity.extent();
        let motion = self.motion.scaled((extent.volume() / before.volume()).cbrt());
        self.motion = vehicle::update(&motion, &mut self.heading, seen, &extent, options);
        if self.heading.0 < 0.0 {
            self.motion = vehicle::turned_about(&self.motion);
            self.heading.0 = -self.heading.0;
        }
        self.bounds = seen.bounds;
        self.sightings += 1;
        self.seen = time;
    }

    fn tracked(&self) -> TrackedPose {
        vehicle::tracked(self.track, self.sightings, &self.motion, &self.identity)
    }
}

#[cfg(test)]
mod tests {
    use super::super::observation::tests::{camera, observation};
    use super::*;

    fn ids(found: &[Option<TrackedPose>]) -> Vec<Option<u32>> {
        found.iter().map(|found| found.as_ref().map(|found| found.track)).collect()
    }

    /// Two cars that pass each other, seen in changing order.
    fn pass(frame: u32) -> [Observation; 2] {
        let t = f64::from(frame) * 0.1;
        let away = observation([-2.0, 1.0, 15.0 + 8.0 * t], 0.0, 1.0);
        let near = observation([2.0, 1.0, 40.0 - 12.0 * t], std::f64::consts::PI, 1.0);
        if frame.is_multiple_of(2) { [away, near] } else { [near, away] }
    }

    fn step(tracker: &mut Tracker, frame: u32, seen: &[Observation]) -> Vec<Option<TrackedPose>> {
        tracker.step(f64::from(frame) * 0.1, &camera(), &Pose::identity(), seen)
    }

    #[test]
    fn vehicles_keep_their_numbers_in_any_order() {
        let mut tracker = Tracker::new(&TrackOptions::default());
        for frame in 0..20 {
            let found = ids(&step(&mut tracker, frame, &pass(frame)));
            let expected = if frame.is_multiple_of(2) { [1, 2] } else { [2, 1] };
            assert_eq!(found, expected.map(Some), "frame {frame}");
        }
    }

    #[test]
    fn a_vehicle_outlives_a_short_gap_and_not_a_long_one() {
        let mut tracker = Tracker::new(&TrackOptions::default());
        let seen = |frame: u32| [observation([1.0, 1.0, 20.0 + 0.1 * f64::from(frame)], 0.0, 1.0)];
        for frame in 0..5 {
            step(&mut tracker, frame, &seen(frame));
        }
        step(&mut tracker, 8, &[]);
        assert_eq!(ids(&step(&mut tracker, 12, &seen(12))), [Some(1)]);
        step(&mut tracker, 20, &[]);
        assert_eq!(ids(&step(&mut tracker, 30, &seen(30))), [Some(2)]);
    }

    #[test]
    fn a_doubtful_sighting_goes_on_with_a_vehicle_and_begins_none() {
        let mut tracker = Tracker::new(&TrackOptions::default());
        let mut seen = observation([1.0, 1.0, 20.0], 0.0, 1.0);
        seen.score = 0.3;
        assert_eq!(ids(&step(&mut tracker, 0, std::slice::from_ref(&seen))), [None]);
        seen.score = 0.8;
        assert_eq!(ids(&step(&mut tracker, 1, std::slice::from_ref(&seen))), [Some(1)]);
        seen.score = 0.3;
        assert_eq!(ids(&step(&mut tracker, 2, &[seen])), [Some(1)]);
    }

    #[test]
    fn a_wrong_distance_does_not_break_a_track() {
        let mut tracker = Tracker::new(&TrackOptions::default());
        for frame in 0..10 {
            // In frame 6 the fit takes it for a much larger vehicle farther away, with a size that it does not own to.
            let seen = observation([1.0, 1.0, 20.0], 0.0, 1.0);
            let mut wrong = observation([1.0, 1.0, 20.0], 0.0, 1.0);
            wrong.cuboid.camera_from_vehicle.translation.vector *= 1.6;
            let found = step(&mut tracker, frame, &[if frame == 6 { wrong } else { seen }]);
            let found = found[0].as_ref().unwrap();
            assert_eq!(found.track, 1);
            let depth = found.cuboid.center().z;
            assert!((depth - 20.0).abs() < 2.5, "frame {frame}: {depth}");
        }
    }

    #[test]
    fn the_front_is_what_most_frames_say() {
        let mut tracker = Tracker::new(&TrackOptions::default());
        let mut yaw = 0.0;
        for frame in 0..8 {
            let front = if frame < 2 { std::f64::consts::PI } else { 0.0 };
            let found = step(&mut tracker, frame, &[observation([1.0, 1.0, 20.0], front, 1.0)]);
            yaw = found[0].as_ref().unwrap().cuboid.camera_from_vehicle.rotation.angle();
        }
        assert!(yaw < 0.1, "{yaw}");
    }
}
