//! Cuboids projected onto the annotated boxes.

use serde::Serialize;

use crate::geometry::{Camera, Cuboid, Rect};

use super::super::{Dataset, Fault, Layout, Problem, SequenceFrames};
use super::convention;

/// Error beyond which a row of Virtual KITTI is wrong, pixels: the published rows stay below.
const LIMIT: f64 = 6.0;
/// The same for KITTI, whose labels were made by people; too few were at hand to choose it well.
const LIMIT_KITTI: f64 = 12.0;
/// Errors up to this share of the box's longer side are let pass, as the published rows of near vehicles need.
const LIMIT_SHARE: f64 = 0.1;

/// Errors of the projected cuboids: the mean distance of the four sides from the annotated ones, pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reprojection {
    /// Boxes compared: those of vehicles wholly in the image.
    pub boxes: usize,
    /// Mean error.
    pub mean: f64,
    /// Median error.
    pub median: f64,
    /// Largest error.
    pub max: f64,
    /// Boxes whose error no rounding explains.
    pub beyond_limit: usize,
}

/// A box to compare with, and where it comes from.
pub(super) struct Sample<'a> {
    pub(super) camera: &'a Camera,
    pub(super) cuboid: Cuboid,
    /// Edges as the file has them.
    pub(super) edges: Rect,
    place: (usize, usize),
}

/// The errors of a sequence, the rows that contradict themselves, and how many of those are not listed.
pub(super) fn check(
    dataset: &Dataset,
    read: &SequenceFrames,
    worst: usize,
) -> (Option<Reprojection>, Vec<Problem>, usize) {
    let layout = dataset.layout();
    let samples = samples(layout, read);
    let mut errors: Vec<(f64, &Sample)> =
        samples.iter().map(|sample| (error(sample, &sample.cuboid), sample)).collect();
    errors.sort_by(|a, b| b.0.total_cmp(&a.0));
    let finite: Vec<f64> =
        errors.iter().map(|(error, _)| *error).filter(|error| error.is_finite()).collect();
    if errors.is_empty() {
        return (None, Vec::new(), 0);
    }
    let limit = if layout == Layout::Kitti { LIMIT_KITTI } else { LIMIT };
    let beyond = |(error, sample): &(f64, &Sample)| {
        *error > limit.max(LIMIT_SHARE * sample.edges.width().max(sample.edges.height()))
    };
    let bad: Vec<&(f64, &Sample)> = errors.iter().filter(|pair| beyond(pair)).collect();
    let reprojection = Reprojection {
        boxes: errors.len(),
        mean: finite.iter().sum::<f64>() / finite.len().max(1) as f64,
        median: finite.get(finite.len() / 2).copied().unwrap_or_default(),
        max: finite.first().copied().unwrap_or_default(),
        beyond_limit: bad.len(),
    };
    if let Some(finding) = convention::detect(layout, &samples) {
        let first = &read.frames[0];
        let path = dataset.label_file(&first.sequence, first.index);
        let problem = Problem::of_file(&path, None, Fault::Contradiction { finding });
        // Every row would be listed for the same reason.
        return (Some(reprojection), vec![problem], 0);
    }
    let problem = |(error, sample): &&(f64, &Sample)| {
        let (i, j) = sample.place;
        let frame = &read.frames[i];
        let vehicle = &frame.vehicles[j];
        let track = vehicle.track.map(|track| format!(" of track {track}")).unwrap_or_default();
        let finding = if error.is_finite() {
            format!("the cuboid{track} misses the annotated box by {error:.1} px")
        } else {
            format!("the cuboid{track} reaches behind the camera, yet is not truncated")
        };
        Problem {
            path: dataset.label_file(&frame.sequence, frame.index),
            line: read.line_of(i, j),
            frame: Some(frame.index),
            fault: Fault::Contradiction { finding },
        }
    };
    let listed: Vec<Problem> = bad.iter().take(worst).copied().map(|pair| problem(&pair)).collect();
    let omitted = bad.len() - listed.len();
    (Some(reprojection), listed, omitted)
}

/// Mean distance of the four sides; infinite where the cuboid reaches behind the camera.
pub(super) fn error(sample: &Sample, cuboid: &Cuboid) -> f64 {
    let Some(rect) = cuboid.project(sample.camera) else { return f64::INFINITY };
    let edges = &sample.edges;
    let sides = [
        rect.x_min - edges.x_min,
        rect.y_min - edges.y_min,
        rect.x_max - edges.x_max,
        rect.y_max - edges.y_max,
    ];
    sides.iter().map(|side| side.abs()).sum::<f64>() / 4.0
}

/// The vehicles that are not truncated; their boxes back in the file's convention.
fn samples(layout: Layout, read: &SequenceFrames) -> Vec<Sample<'_>> {
    // Inclusive integer edges were widened by half a pixel when they were read.
    let widened = if layout == Layout::Kitti { 0.0 } else { 0.5 };
    let mut samples = Vec::new();
    for (i, frame) in read.frames.iter().enumerate() {
        for (j, vehicle) in frame.vehicles.iter().enumerate() {
            if vehicle.truncation > 0.0 {
                continue;
            }
            let b = &vehicle.bounds;
            let edges = Rect::new(
                b.x_min + widened,
                b.y_min + widened,
                b.x_max - widened,
                b.y_max - widened,
            );
            samples.push(Sample {
                camera: &frame.camera,
                cuboid: vehicle.cuboid,
                edges,
                place: (i, j),
            });
        }
    }
    samples
}
