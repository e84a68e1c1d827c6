//! How well parts are told: the paper's Table II, by class, and what is confused with what.
//!
//! PA of a detection is the share of right pixels of its box, clipped to the image, background included as a class;
//! mPA is its mean over the assigned detections (paper, § IV-B). Pixels of the vehicle outside of the detection's box
//! are no errors, so that errors of boxes are kept out. Another vehicle's pixels are background to it. What the paper
//! leaves open is decided as in `docs/paper-map.md`; the share over the vehicle's own pixels alone is another number
//! and has another name.

use serde::Serialize;

use crate::parts::{BACKGROUND, CHANNELS, PartMask};

/// One detection's mask against the truth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MaskScore {
    /// The paper's PA: share of right pixels of the box; 0 for a box without pixels.
    pub pixel_accuracy: f64,
    /// Share of right ones among the pixels that show the vehicle; `None` where none does.
    pub foreground_accuracy: Option<f64>,
    /// Intersection over union of the silhouettes, parts or not; `None` where neither has a pixel.
    pub silhouette_iou: Option<f64>,
}

/// Counts of pixels: rows are the truth's classes, columns the detections', background first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Confusion {
    /// `[30, 30]`, row by row.
    pub counts: Vec<u64>,
}

impl Default for Confusion {
    fn default() -> Self {
        Self { counts: vec![0; CHANNELS * CHANNELS] }
    }
}

/// How a class fares over all pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ClassScore {
    /// 0 background, 1 to 29 the parts.
    pub class: u8,
    /// Pixels that show it.
    pub pixels: u64,
    /// Share of them that are called so.
    pub accuracy: Option<f64>,
    /// Share of the pixels called so that show it.
    pub precision: Option<f64>,
    /// Intersection over union.
    pub iou: Option<f64>,
}

impl Confusion {
    /// Adds the pixels of a detection's mask; `truth` is background outside of its rectangle.
    pub fn add_mask(&mut self, predicted: &PartMask, truth: &PartMask) {
        for (was, is) in pairs(predicted, truth) {
            if let Some(count) = self.counts.get_mut(usize::from(was) * CHANNELS + usize::from(is))
            {
                *count += 1;
            }
        }
    }

    /// Adds the counts of another; whole numbers, so the order changes nothing.
    pub fn add(&mut self, other: &Self) {
        self.counts.iter_mut().zip(&other.counts).for_each(|(sum, count)| *sum += count);
    }

    /// The scores of all classes, background first.
    pub fn classes(&self) -> Vec<ClassScore> {
        let share = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
        let score = |class: usize| {
            let right = self.counts[class * CHANNELS + class];
            let row = &self.counts[class * CHANNELS..(class + 1) * CHANNELS];
            let pixels: u64 = row.iter().sum();
            let called: u64 = (0..CHANNELS).map(|row| self.counts[row * CHANNELS + class]).sum();
            ClassScore {
                class: class as u8,
                pixels,
                accuracy: share(right, pixels),
                precision: share(right, called),
                iou: share(right, pixels + called - right),
            }
        };
        (0..CHANNELS).map(score).collect()
    }

    /// Share of right pixels, whatever detection they are of; `None` without pixels.
    pub fn accuracy(&self) -> Option<f64> {
        let right: u64 = (0..CHANNELS).map(|class| self.counts[class * CHANNELS + class]).sum();
        let all: u64 = self.counts.iter().sum();
        (all > 0).then(|| right as f64 / all as f64)
    }

    /// Mean accuracy of the parts that are seen at all, each with the same weight; background is no part.
    pub fn mean_class_accuracy(&self) -> Option<f64> {
        mean_of(self.classes().iter().skip(1).filter_map(|class| class.accuracy))
    }

    /// Mean intersection over union of the parts that are seen or called.
    pub fn mean_class_iou(&self) -> Option<f64> {
        mean_of(self.classes().iter().skip(1).filter_map(|class| class.iou))
    }
}

/// Compares the mask of a detection with the truth, which is background outside of its rectangle.
pub fn score_mask(predicted: &PartMask, truth: &PartMask) -> MaskScore {
    let (mut all, mut right, mut seen, mut right_seen) = (0u64, 0u64, 0u64, 0u64);
    let (mut both, mut either) = (0u64, 0u64);
    for (was, is) in pairs(predicted, truth) {
        let shows = was != BACKGROUND;
        let same = u64::from(was == is);
        all += 1;
        right += same;
        seen += u64::from(shows);
        right_seen += same * u64::from(shows);
        both += u64::from(shows && is != BACKGROUND);
        either += u64::from(shows || is != BACKGROUND);
    }
    let share = |part: u64, whole: u64| (whole > 0).then(|| part as f64 / whole as f64);
    MaskScore {
        pixel_accuracy: share(right, all).unwrap_or(0.0),
        foreground_accuracy: share(right_seen, seen),
        silhouette_iou: share(both, either),
    }
}

/// Means over detections, as shares of 1; NaN (`null` in JSON) without any.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MaskScores {
    /// Detections.
    pub count: usize,
    /// The paper's mPA.
    pub mpa: f64,
    /// Mean share of right ones among the pixels that show the vehicle.
    pub mean_foreground_accuracy: f64,
    /// Mean intersection over union of silhouettes.
    pub mean_silhouette_iou: f64,
}

/// The means over the assigned detections: a cell of Table II.
pub fn summarize_masks(scores: &[MaskScore]) -> MaskScores {
    let mean = |values: &mut dyn Iterator<Item = f64>| mean_of(values).unwrap_or(f64::NAN);
    MaskScores {
        count: scores.len(),
        mpa: mean(&mut scores.iter().map(|score| score.pixel_accuracy)),
        mean_foreground_accuracy: mean(&mut scores.iter().filter_map(|s| s.foreground_accuracy)),
        mean_silhouette_iou: mean(&mut scores.iter().filter_map(|s| s.silhouette_iou)),
    }
}

fn mean_of(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u64), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// Truth and prediction of every pixel of the predicted mask.
fn pairs<'a>(predicted: &'a PartMask, truth: &'a PartMask) -> impl Iterator<Item = (u8, u8)> + 'a {
    let [x0, y0] = predicted.origin;
    predicted.rows().zip(y0..).flat_map(move |(row, y)| {
        row.iter().zip(x0..).map(move |(label, x)| (truth.at(x, y), *label))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(origin: [i32; 2], size: [u32; 2], labels: &[u8]) -> PartMask {
        PartMask { origin, size, labels: labels.to_vec() }
    }

    /// The vehicle fills 2 x 2 pixels of which the detection's box, 3 x 2, holds the right column.
    fn case() -> (PartMask, PartMask) {
        let truth = mask([0, 0], [2, 2], &[5, 6, 5, 6]);
        let predicted = mask([1, 0], [3, 2], &[6, 0, 6, 27, 0, 0]);
        (predicted, truth)
    }

    #[test]
    fn vehicle_outside_of_the_box_is_no_error() {
        let (predicted, truth) = case();
        let score = score_mask(&predicted, &truth);
        // Right are 6 and three of background; wrong 6 where nothing is, and 27 for 6.
        assert!((score.pixel_accuracy - 4.0 / 6.0).abs() < 1e-12);
        assert!((score.pixel_accuracy - predicted.agreement(&truth)).abs() < 1e-12);
        assert_eq!(score.foreground_accuracy, Some(0.5));
        assert_eq!(score.silhouette_iou, Some(2.0 / 3.0));
    }

    #[test]
    fn confusion_counts_truth_by_rows() {
        let (predicted, truth) = case();
        let mut confusion = Confusion::default();
        confusion.add_mask(&predicted, &truth);
        let mut twice = confusion.clone();
        twice.add(&confusion);
        let at = |truth: usize, predicted: usize| twice.counts[truth * CHANNELS + predicted];
        assert_eq!((at(6, 6), at(6, 27), at(0, 6), at(0, 0)), (2, 2, 2, 6));
        assert_eq!(twice.counts.iter().sum::<u64>(), 12);
        let wheel = twice.classes()[6];
        assert_eq!((wheel.pixels, wheel.accuracy, wheel.precision), (4, Some(0.5), Some(0.5)));
        assert_eq!(wheel.iou, Some(1.0 / 3.0));
        assert_eq!(twice.classes()[27].accuracy, None);
        // Class 6 alone is seen; 27 is called once and never right.
        assert_eq!(twice.mean_class_accuracy(), Some(0.5));
        assert_eq!(twice.mean_class_iou(), Some(1.0 / 6.0));
        assert_eq!(twice.accuracy(), Some(8.0 / 12.0));
    }

    #[test]
    fn means_are_over_detections_and_nothing_has_none() {
        let score = |pixel_accuracy, foreground_accuracy| MaskScore {
            pixel_accuracy,
            foreground_accuracy,
            silhouette_iou: None,
        };
        let scores = summarize_masks(&[score(1.0, Some(0.5)), score(0.5, None)]);
        assert_eq!((scores.count, scores.mpa, scores.mean_foreground_accuracy), (2, 0.75, 0.5));
        assert!(scores.mean_silhouette_iou.is_nan() && summarize_masks(&[]).mpa.is_nan());
    }
}
