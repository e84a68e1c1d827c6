//! A whole sequence at once: who is who going forwards, then every vehicle's poses from all of its frames.

use crate::geometry::{Camera, Extent, Pose};

use super::motion::{Motion, Step};
use super::observation::Observation;
use super::tracker::{TrackOptions, TrackedPose, Tracker};
use super::vehicle::{self, Heading, Identity};

/// A frame of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct SequenceFrame {
    /// Seconds; those of later frames are not smaller.
    pub time: f64,
    /// Its camera.
    pub camera: Camera,
    /// Takes the camera's frame of the frame before to that of this one; the identity where nobody knows.
    pub camera_from_previous: Pose,
    /// What was seen.
    pub seen: Vec<Observation>,
}

/// The vehicle of every sighting of every frame, with the pose that the frames before and after it agree on.
///
/// `None` for sightings of vehicles that were seen less than [`TrackOptions::least_sightings`] times. Numbers of vehicles
/// are those of a [`Tracker`], so some may be missing.
pub fn smooth_sequence(
    frames: &[SequenceFrame],
    options: &TrackOptions,
) -> Vec<Vec<Option<TrackedPose>>> {
    let mut tracker = Tracker::new(options);
    let mut sightings: Vec<Vec<[usize; 2]>> = Vec::new();
    for (index, frame) in frames.iter().enumerate() {
        let SequenceFrame { time, camera, camera_from_previous, seen } = frame;
        let found = tracker.step(*time, camera, camera_from_previous, seen);
        for (row, found) in found.iter().enumerate() {
            let Some(found) = found else { continue };
            let track = found.track as usize;
            if sightings.len() < track {
                sightings.resize(track, Vec::new());
            }
            sightings[track - 1].push([index, row]);
        }
    }
    let mut smoothed: Vec<Vec<Option<TrackedPose>>> =
        frames.iter().map(|frame| vec![None; frame.seen.len()]).collect();
    for (track, sightings) in (1..).zip(&sightings) {
        if sightings.len() < options.least_sightings.max(1) {
            continue;
        }
        let seen: Vec<(&Observation, Step)> = sightings
            .iter()
            .zip(steps(frames, sightings))
            .map(|([frame, row], step)| (&frames[*frame].seen[*row], step))
            .collect();
        for ([frame, row], pose) in sightings.iter().zip(smooth(track, &seen, options)) {
            smoothed[*frame][*row] = Some(pose);
        }
    }
    smoothed
}

/// The step to each sighting of a vehicle from the one before.
fn steps(frames: &[SequenceFrame], sightings: &[[usize; 2]]) -> Vec<Step> {
    let mut before = sightings.first().map_or(0, |first| first[0]);
    let step = |[frame, _]: &[usize; 2]| {
        let between = &frames[(before + 1).min(*frame)..=*frame];
        let moved = if before == *frame {
            Pose::identity()
        } else {
            between.iter().fold(Pose::identity(), |all, one| one.camera_from_previous * all)
        };
        let seconds = frames[*frame].time - frames[before].time;
        before = *frame;
        vehicle::step(seconds, moved)
    };
    sightings.iter().map(step).collect()
}

/// The poses of one vehicle; each sighting with the step that leads to it.
fn smooth(track: u32, seen: &[(&Observation, Step)], options: &TrackOptions) -> Vec<TrackedPose> {
    let mut identity = Identity::default();
    for (seen, _) in seen {
        identity.add(seen);
    }
    let extent = identity.extent();
    let Some((first, _)) = seen.first() else { return Vec::new() };
    let mut start = vehicle::first(first, &extent, options);
    // The first sighting is often one from afar: what the surest says of the rotation is nearer the truth.
    let surest = seen.iter().rev().max_by(|a, b| a.0.confidence.total_cmp(&b.0.confidence));
    if let Some((surest, _)) = surest.filter(|(surest, _)| surest.confidence > first.confidence) {
        start = vehicle::turned_to(&start, surest);
    }
    let mut pass = forwards(&start, seen, &extent, options);
    if pass.heading.0 < 0.0 {
        pass = forwards(&vehicle::turned_about(&start), seen, &extent, options);
    }
    let mut motions = pass.filtered;
    for at in (1..motions.len()).rev() {
        motions[at - 1] = motions[at - 1].smooth(&seen[at].1, &pass.predicted[at], &motions[at]);
    }
    motions.iter().map(|motion| vehicle::tracked(track, seen.len(), motion, &identity)).collect()
}

struct Pass {
    predicted: Vec<Motion>,
    filtered: Vec<Motion>,
    heading: Heading,
}

fn forwards(
    start: &Motion,
    seen: &[(&Observation, Step)],
    extent: &Extent,
    options: &TrackOptions,
) -> Pass {
    let (mut predicted, mut filtered) = (vec![start.clone()], vec![start.clone()]);
    let mut heading = Heading::default();
    let mut motion = start.clone();
    for (at, (seen, step)) in seen.iter().enumerate() {
        if at == 0 {
            // The start is made of it already; it only says which end it takes for the front.
            vehicle::update(&motion, &mut heading, seen, extent, options);
            continue;
        }
        let expected = motion.predict(step, &options.motion);
        motion = vehicle::update(&expected, &mut heading, seen, extent, options);
        predicted.push(expected);
        filtered.push(motion.clone());
    }
    Pass { predicted, filtered, heading }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::super::observation::tests::{camera, observation};
    use super::*;

    /// A car that drives by, its place and size off by a little in every frame; with the true centres.
    fn noisy(seed: u64) -> (Vec<SequenceFrame>, Vec<[f64; 3]>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let truth = |frame: u32| {
            let t = f64::from(frame) * 0.1;
            [-4.0 + 3.0 * t, 1.0, 30.0 - 6.0 * t]
        };
        let frames = (0..30).map(|frame| {
            let size = random.random_range(0.85..1.15);
            let depth = random.random_range(0.96..1.04);
            let yaw = 0.3 + random.random_range(-0.1..0.1);
            let place = truth(frame).map(|value| value * size * depth);
            SequenceFrame {
                time: f64::from(frame) * 0.1,
                camera: camera(),
                camera_from_previous: Pose::identity(),
                seen: vec![observation(place, yaw, size)],
            }
        });
        (frames.collect(), (0..30).map(truth).collect())
    }

    fn error(cuboid: &crate::geometry::Cuboid, truth: &[f64; 3]) -> f64 {
        (cuboid.center().coords - crate::geometry::Vector3::from(*truth)).norm()
    }

    #[test]
    fn all_frames_together_are_nearer_the_truth_than_each() {
        for seed in 0..5 {
            let (frames, truth) = noisy(seed);
            let smoothed = smooth_sequence(&frames, &TrackOptions::default());
            let (mut alone, mut together) = (0.0, 0.0);
            for ((frame, truth), pose) in frames.iter().zip(&truth).zip(&smoothed) {
                let pose = pose[0].as_ref().unwrap();
                assert_eq!((pose.track, pose.sightings), (1, 30));
                alone += error(&frame.seen[0].cuboid, truth);
                together += error(&pose.cuboid, truth);
                // The covariance knows that.
                assert!(error(&pose.cuboid, truth) < 4.0 * pose.covariance.trace().sqrt());
            }
            assert!(together < 0.5 * alone, "seed {seed}: {together} {alone}");
        }
    }

    #[test]
    fn a_vehicle_seen_once_is_none() {
        let (mut frames, _) = noisy(1);
        frames[7].seen.push(observation([8.0, 1.0, 20.0], 0.0, 1.0));
        let smoothed = smooth_sequence(&frames, &TrackOptions::default());
        assert!(smoothed[7][0].is_some() && smoothed[7][1].is_none());
    }

    #[test]
    fn the_front_is_what_most_frames_say_from_the_first_on() {
        let (mut frames, _) = noisy(2);
        for frame in &mut frames[..9] {
            let pose = &mut frame.seen[0].cuboid.camera_from_vehicle;
            pose.rotation *= nalgebra::UnitQuaternion::from_axis_angle(
                &nalgebra::Vector3::y_axis(),
                std::f64::consts::PI,
            );
        }
        for pose in smooth_sequence(&frames, &TrackOptions::default()) {
            let yaw = pose[0].as_ref().unwrap().cuboid.camera_from_vehicle.rotation.angle();
            assert!((yaw - 0.3).abs() < 0.1, "{yaw}");
        }
    }
}
