//! How well vehicles are followed: whether they keep their numbers, and what following does for their poses.
//!
//! A vehicle changes its number where the number differs from the one that it last had, as in the CLEAR MOT measures
//! (Bernardin and Stiefelhagen: *Evaluating Multiple Object Tracking Performance*, 2008). Jitter is how far the error of
//! a pose moves from a frame to the next: an error that stays is none, however large.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use crate::geometry::{Cuboid, Vector3};

/// A labelled vehicle in a frame, with what was found of it.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackSample {
    /// The sequence, by any number.
    pub sequence: usize,
    /// Index of the frame in its sequence.
    pub frame: u32,
    /// Number of the labelled vehicle in its sequence.
    pub label: u32,
    /// Where it is.
    pub truth: Cuboid,
    /// Where its frame alone has it.
    pub alone: Cuboid,
    /// Number and pose that following gave it.
    pub tracked: Option<(u32, Cuboid)>,
}

/// How near poses are, and how steady.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseSeries {
    /// Mean 3D IoU.
    pub mean_iou3d: f64,
    /// Mean distance of the bottom-face centres, metres.
    pub mean_distance: f64,
    /// Mean angle of the rotation between estimate and truth, radians.
    pub mean_angle: f64,
    /// Mean change of the error of the place between neighbouring frames, metres.
    pub jitter: f64,
    /// Mean change of the error of the rotation between neighbouring frames, radians.
    pub turn_jitter: f64,
}

/// The scores of sequences.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrackScores {
    /// Sightings of labelled vehicles.
    pub sightings: usize,
    /// Those with a track.
    pub tracked: usize,
    /// Labelled vehicles.
    pub labels: usize,
    /// How often a vehicle changed its number.
    pub switches: usize,
    /// Tracks of more than one labelled vehicle.
    pub mixed: usize,
    /// Pairs of neighbouring frames of a vehicle, over which jitter is the mean.
    pub pairs: usize,
    /// Poses of single frames, of sightings with a track.
    pub alone: PoseSeries,
    /// Poses of tracks.
    pub together: PoseSeries,
}

/// Scores samples in any order; means are NaN (`null` in JSON) where there is nothing.
pub fn score_tracks(samples: &[TrackSample]) -> TrackScores {
    let mut by_label: BTreeMap<(usize, u32), Vec<&TrackSample>> = BTreeMap::new();
    let mut by_track: BTreeMap<(usize, u32), BTreeSet<u32>> = BTreeMap::new();
    for sample in samples {
        by_label.entry((sample.sequence, sample.label)).or_default().push(sample);
        if let Some((track, _)) = sample.tracked {
            by_track.entry((sample.sequence, track)).or_default().insert(sample.label);
        }
    }
    let (mut switches, mut pairs) = (0, Vec::new());
    for seen in by_label.values_mut() {
        seen.sort_by_key(|sample| sample.frame);
        let numbered: Vec<(u32, &TrackSample)> =
            seen.iter().filter_map(|sample| Some((sample.tracked?.0, *sample))).collect();
        for pair in numbered.windows(2) {
            switches += usize::from(pair[0].0 != pair[1].0);
            if pair[0].1.frame + 1 == pair[1].1.frame {
                pairs.push((pair[0].1, pair[1].1));
            }
        }
    }
    let followed: Vec<&TrackSample> = samples.iter().filter(|s| s.tracked.is_some()).collect();
    let series = |pose: &dyn Fn(&TrackSample) -> Cuboid| series(&followed, &pairs, pose);
    TrackScores {
        sightings: samples.len(),
        tracked: followed.len(),
        labels: by_label.len(),
        switches,
        mixed: by_track.values().filter(|labels| labels.len() > 1).count(),
        pairs: pairs.len(),
        alone: series(&|sample| sample.alone),
        together: series(&|sample| sample.tracked.map_or(sample.alone, |(_, cuboid)| cuboid)),
    }
}

fn series(
    samples: &[&TrackSample],
    pairs: &[(&TrackSample, &TrackSample)],
    pose: &dyn Fn(&TrackSample) -> Cuboid,
) -> PoseSeries {
    let place = |sample: &TrackSample| {
        let (found, truth) = (pose(sample).camera_from_vehicle, sample.truth.camera_from_vehicle);
        found.translation.vector - truth.translation.vector
    };
    let turn = |sample: &TrackSample| -> Vector3 {
        let (found, truth) = (pose(sample).camera_from_vehicle, sample.truth.camera_from_vehicle);
        (truth.rotation.inverse() * found.rotation).scaled_axis()
    };
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let values: Vec<f64> = values.collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let change = |of: &dyn Fn(&TrackSample) -> Vector3| {
        mean(&mut pairs.iter().map(|(before, after)| (of(after) - of(before)).norm()))
    };
    PoseSeries {
        mean_iou3d: mean(&mut samples.iter().map(|sample| pose(sample).iou(&sample.truth))),
        mean_distance: mean(&mut samples.iter().map(|sample| place(sample).norm())),
        mean_angle: mean(&mut samples.iter().map(|sample| turn(sample).norm())),
        jitter: change(&place),
        turn_jitter: change(&turn),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Extent, Pose};

    fn cuboid(x: f64) -> Cuboid {
        let camera_from_vehicle = Pose::translation(x, 1.0, 20.0);
        Cuboid { camera_from_vehicle, extent: Extent::new(1.8, 1.5, 4.4) }
    }

    /// Vehicle 7 in frames 0 to 3: off by the given metres alone, where it is when followed.
    fn samples(alone: [f64; 4], tracks: [Option<u32>; 4]) -> Vec<TrackSample> {
        let sample = |(frame, (off, track)): (u32, (f64, Option<u32>))| TrackSample {
            sequence: 0,
            frame,
            label: 7,
            truth: cuboid(f64::from(frame)),
            alone: cuboid(f64::from(frame) + off),
            tracked: track.map(|track| (track, cuboid(f64::from(frame)))),
        };
        (0..).zip(alone.into_iter().zip(tracks)).map(sample).collect()
    }

    #[test]
    fn numbers_that_change_are_counted_over_gaps_too() {
        let scores = score_tracks(&samples([0.0; 4], [Some(1), None, Some(2), Some(2)]));
        assert_eq!((scores.sightings, scores.tracked, scores.labels), (4, 3, 1));
        assert_eq!((scores.switches, scores.mixed, scores.pairs), (1, 0, 1));
    }

    #[test]
    fn a_track_of_two_vehicles_is_mixed() {
        let mut samples = samples([0.0; 4], [Some(1); 4]);
        samples[3].label = 8;
        assert_eq!(score_tracks(&samples).mixed, 1);
        samples[3].sequence = 1;
        assert_eq!(score_tracks(&samples).mixed, 0);
    }

    #[test]
    fn an_error_that_stays_is_no_jitter() {
        let scores = score_tracks(&samples([0.5; 4], [Some(1); 4]));
        assert!((scores.alone.mean_distance - 0.5).abs() < 1e-9);
        assert!(scores.alone.jitter < 1e-9 && scores.together.mean_iou3d > 1.0 - 1e-9);
        let scores = score_tracks(&samples([0.5, -0.5, 0.5, -0.5], [Some(1); 4]));
        assert!((scores.alone.jitter - 1.0).abs() < 1e-9);
    }
}
