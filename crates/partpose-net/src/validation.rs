//! How well a network does on labelled frames while it learns: the figures of the paper's Tables I and II.

use partpose::dataset::DatasetError;
use partpose::eval::boxes::{BoxFrame, BoxScores, score_boxes};
use partpose::eval::masks::{MaskScores, score_mask, summarize_masks};
use partpose::eval::matching::{MatchOptions, TruthBoxes};
use partpose::geometry::Rect;
use partpose::parts::{BACKGROUND, PartMask, ProbabilityError, Scaling};
use partpose::vehicle::ModelZoo;
use serde::Serialize;

use crate::detector::Detector;
use crate::sample::{self, Item, Sample};

/// Detections with a lower score do not count.
pub const MIN_SCORE: f64 = 0.5;

/// What came of a validation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Scores {
    /// Table I, of detections with a score of at least [`MIN_SCORE`].
    pub boxes: BoxScores,
    /// Table II, of the assigned ones, masks scaled bilinearly.
    pub masks: MaskScores,
}

/// Why a validation failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ValidationError {
    /// A frame could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The network's output is no probability.
    #[error("the network's output for `{frame}` is no probability")]
    Output {
        /// The frame.
        frame: String,
        /// What is wrong.
        source: ProbabilityError,
    },
}

/// Runs a detector over frames and scores what it finds.
pub fn validate(
    detector: &Detector,
    items: &[Item],
    zoo: &ModelZoo,
) -> Result<Scores, ValidationError> {
    let options = MatchOptions::default();
    let mut boxes = Vec::new();
    let mut masks = Vec::new();
    for item in items {
        let sample = sample::read(item, false, zoo)?;
        let found = detector
            .detect(&sample.image)
            .map_err(|source| ValidationError::Output { frame: sample.name.clone(), source })?;
        let own = |i: usize| Some(item.frame.vehicles[i].bounds);
        let (truths, vehicles) = TruthBoxes::of_frame(&item.frame, &own);
        let pairs = found.iter().map(|detection| (detection.bounds, detection.score)).collect();
        let frame = BoxFrame::new(pairs, truths, &options);
        for (detection, verdict) in found.iter().zip(&frame.verdicts) {
            if let (Some(truth), true) = (verdict.truth(), detection.score >= MIN_SCORE) {
                let mask = detection.part_mask(sample.image.size, Scaling::Bilinear);
                let truth = vehicle_mask(&sample, vehicles[truth], &detection.bounds);
                masks.push(score_mask(&mask, &truth));
            }
        }
        boxes.push(frame);
    }
    Ok(Scores { boxes: score_boxes(&boxes, MIN_SCORE), masks: summarize_masks(&masks) })
}

/// A vehicle's own parts on the pixels of a rectangle.
fn vehicle_mask(sample: &Sample, vehicle: usize, bounds: &Rect) -> PartMask {
    let (x0, y0, x1, y1) = bounds.pixels(sample.image.size);
    let mut mask = PartMask::background([x0 as i32, y0 as i32], [x1 - x0, y1 - y0]);
    let places = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y)));
    for (label, (x, y)) in mask.labels.iter_mut().zip(places) {
        let at = y as usize * sample.image.size[0] as usize + x as usize;
        let own = usize::from(sample.owners[at]) == vehicle + 1;
        *label = if own { sample.labels[at] } else { BACKGROUND };
    }
    mask
}
