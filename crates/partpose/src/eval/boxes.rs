//! How well vehicles are found: the paper's Table I, and COCO's average precision of the same boxes.
//!
//! Precision, recall and mean intersection over union at one overlap and one score (paper, § IV-B; see
//! [`super::matching`]), and their curve over all scores. The average precision is COCO's, Lin et al., ECCV 2014, with
//! what is to be ignored as *crowd*: there, too, a result is measured by the share of its own area that lies in it.

use serde::Serialize;

use crate::geometry::Rect;

use super::coco::{CocoImage, CocoOverlap, CocoResult, CocoScores, CocoSet, CocoTruth, score_coco};
use super::matching::{MatchOptions, TruthBoxes, Verdict, match_detections};

/// Boxes and scores of the detections of one image, what they are held against, and the verdicts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoxFrame {
    /// Boxes with scores, 0 to 1.
    pub detections: Vec<(Rect, f64)>,
    /// What there is to find and to ignore.
    pub truths: TruthBoxes,
    /// One a detection.
    pub verdicts: Vec<Verdict>,
}

impl BoxFrame {
    /// Matches the detections of an image.
    pub fn new(detections: Vec<(Rect, f64)>, truths: TruthBoxes, options: &MatchOptions) -> Self {
        let verdicts = match_detections(&detections, &truths, options);
        Self { detections, truths, verdicts }
    }
}

/// A row of Table I, as shares of 1; NaN (`null` in JSON) where nothing counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BoxScores {
    /// Images.
    pub frames: usize,
    /// Vehicles to find.
    pub vehicles: usize,
    /// Detections that found one: the paper's *assigned*.
    pub assigned: usize,
    /// Detections that found nothing.
    pub wrong: usize,
    /// Detections that do not count.
    pub ignored: usize,
    /// Assigned over all that count.
    pub precision: f64,
    /// Assigned over vehicles.
    pub recall: f64,
    /// Mean intersection over union of the assigned with their vehicles.
    pub mean_iou: f64,
}

/// Precision and recall of the detections of at least some score.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// The lowest score that is kept.
    pub score: f64,
    /// Assigned over all that count.
    pub precision: f64,
    /// Assigned over vehicles.
    pub recall: f64,
}

/// Table I's figures of the detections with at least the score `min_score`.
pub fn score_boxes<'a>(
    frames: impl IntoIterator<Item = &'a BoxFrame>,
    min_score: f64,
) -> BoxScores {
    let mut scores = BoxScores {
        frames: 0,
        vehicles: 0,
        assigned: 0,
        wrong: 0,
        ignored: 0,
        precision: f64::NAN,
        recall: f64::NAN,
        mean_iou: f64::NAN,
    };
    let mut overlap = 0.0;
    for frame in frames {
        scores.frames += 1;
        scores.vehicles += frame.truths.counted.len();
        for ((_, score), verdict) in frame.detections.iter().zip(&frame.verdicts) {
            if *score < min_score {
                continue;
            }
            match verdict {
                Verdict::Assigned { iou, .. } => {
                    scores.assigned += 1;
                    overlap += iou;
                }
                Verdict::Wrong => scores.wrong += 1,
                Verdict::Ignored => scores.ignored += 1,
            }
        }
    }
    let assigned = scores.assigned as f64;
    // 0 / 0 is NaN, as is meant.
    scores.precision = assigned / (scores.assigned + scores.wrong) as f64;
    scores.recall = assigned / scores.vehicles as f64;
    scores.mean_iou = overlap / assigned;
    scores
}

/// Precision over recall by falling score: one point a score that occurs, what does not count left out.
pub fn precision_recall(frames: &[BoxFrame]) -> Vec<CurvePoint> {
    let vehicles: usize = frames.iter().map(|frame| frame.truths.counted.len()).sum();
    let mut found: Vec<(f64, bool)> = frames
        .iter()
        .flat_map(|frame| frame.detections.iter().zip(&frame.verdicts))
        .filter(|(_, verdict)| **verdict != Verdict::Ignored)
        .map(|((_, score), verdict)| (*score, verdict.truth().is_some()))
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut points: Vec<CurvePoint> = Vec::new();
    let (mut right, mut all) = (0.0, 0.0);
    for (score, is_right) in found {
        all += 1.0;
        right += f64::from(u8::from(is_right));
        let point = CurvePoint { score, precision: right / all, recall: right / vehicles as f64 };
        match points.last_mut() {
            Some(last) if last.score.total_cmp(&score).is_eq() => *last = point,
            _ => points.push(point),
        }
    }
    points
}

/// COCO's twelve figures of the same boxes, all detections whatever their score, vehicles as the only category.
pub fn coco_box_scores(frames: &[BoxFrame]) -> CocoScores {
    let corner = |bounds: &Rect| {
        [bounds.x_min, bounds.y_min, bounds.width().max(0.0), bounds.height().max(0.0)]
    };
    let truth = |bounds: &Rect, crowd: bool| CocoTruth {
        category: 0,
        bounds: Some(corner(bounds)),
        area: bounds.area(),
        crowd,
        mask: None,
    };
    let image = |frame: &BoxFrame| CocoImage {
        truths: (frame.truths.counted.iter().map(|bounds| truth(bounds, false)))
            .chain(frame.truths.ignored.iter().map(|bounds| truth(bounds, true)))
            .collect(),
        results: (frame.detections.iter())
            .map(|(bounds, score)| CocoResult {
                category: 0,
                bounds: Some(corner(bounds)),
                area: bounds.area(),
                score: *score,
                mask: None,
            })
            .collect(),
    };
    let set = CocoSet {
        categories: vec![(1, "vehicle".to_owned())],
        images: frames.iter().map(image).collect(),
        unknown_categories: 0,
    };
    score_coco(&set, CocoOverlap::Boxes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, x + 10.0, 10.0)
    }

    /// One exact box, one shifted by a column in nine, one wrong, one on something to ignore; one vehicle missed.
    fn frames() -> Vec<BoxFrame> {
        let options = MatchOptions::default();
        let first = TruthBoxes { counted: vec![at(0.0), at(20.0)], ignored: vec![at(200.0)] };
        let second = TruthBoxes { counted: vec![at(0.0)], ignored: Vec::new() };
        vec![
            BoxFrame::new(
                vec![(at(0.0), 0.9), (at(21.0), 0.7), (at(100.0), 0.8), (at(200.0), 0.95)],
                first,
                &options,
            ),
            BoxFrame::new(Vec::new(), second, &options),
        ]
    }

    #[test]
    fn table_one_is_what_a_hand_computes() {
        let scores = score_boxes(&frames(), 0.5);
        assert_eq!((scores.frames, scores.vehicles), (2, 3));
        assert_eq!((scores.assigned, scores.wrong, scores.ignored), (2, 1, 1));
        let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(close(scores.precision, 2.0 / 3.0) && close(scores.recall, 2.0 / 3.0));
        // 9 of 11 columns.
        assert!(close(scores.mean_iou, 0.5 * (1.0 + 9.0 / 11.0)), "{scores:?}");
        let strict = score_boxes(&frames(), 0.85);
        assert_eq!((strict.assigned, strict.wrong, strict.ignored), (1, 0, 1));
        assert!(score_boxes(&[], 0.5).precision.is_nan());
    }

    #[test]
    fn curve_has_a_point_a_score_and_no_ignored_ones() {
        let curve = precision_recall(&frames());
        let points: Vec<[f64; 3]> =
            curve.iter().map(|p| [p.score, p.precision, p.recall]).collect();
        assert_eq!(
            points,
            [[0.9, 1.0, 1.0 / 3.0], [0.8, 0.5, 1.0 / 3.0], [0.7, 2.0 / 3.0, 2.0 / 3.0]]
        );
    }

    #[test]
    fn coco_ap_is_that_of_its_definition() {
        let scores = coco_box_scores(&frames());
        let figure = |name: &str| scores.figures.iter().find(|(n, _)| *n == name).unwrap().1;
        // At IoU 0.5 precision is 1 up to recall 1/3 (34 of 101 points, 0.00 to 0.33) and 2/3 up to 2/3 (33 more).
        let at_half = (34.0 + 33.0 * 2.0 / 3.0) / 101.0;
        assert!((figure("AP50").unwrap() - at_half).abs() < 1e-9, "{scores:?}");
        // 9/11 = 0.818 is enough up to 0.80, seven of ten thresholds; past it the shifted box is a second wrong one.
        let past = 34.0 / 101.0;
        let mean = (7.0 * at_half + 3.0 * past) / 10.0;
        assert!((figure("AP").unwrap() - mean).abs() < 1e-9, "{scores:?}");
    }

    #[test]
    fn perfect_boxes_have_perfect_scores() {
        let truths = TruthBoxes { counted: vec![at(0.0), at(20.0)], ignored: vec![at(5.0)] };
        let detections = vec![(at(20.0), 1.0), (at(0.0), 1.0)];
        let frame = BoxFrame::new(detections, truths, &MatchOptions::default());
        let scores = score_boxes([&frame], 0.5);
        for figure in [scores.precision, scores.recall, scores.mean_iou] {
            assert!((figure - 1.0).abs() < 1e-12, "{scores:?}");
        }
        let ap = coco_box_scores(&[frame]).figures[0].1.unwrap();
        assert!((ap - 1.0).abs() < 1e-9);
    }
}
