//! Which detections found a vehicle, which found nothing, and which do not count.
//!
//! The Pascal criterion at one overlap (Everingham et al.: *The Pascal Visual Object Classes Challenge*, IJCV 2010), as
//! the paper uses it (§ IV-B): by falling score each detection takes the vehicle that it overlaps most among those not
//! taken, if by enough. Vehicles to ignore are never missed; a detection without a vehicle that lies on one of them is
//! neither right nor wrong. How much of it must lie there the paper leaves open; half of its own area is the rule of
//! KITTI's evaluator.

use serde::{Deserialize, Serialize};

use crate::dataset::Frame;
use crate::geometry::Rect;

/// When boxes belong together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MatchOptions {
    /// Least intersection over union of a detection and its vehicle.
    pub min_iou: f64,
    /// Least share of a detection's area that lies in an ignored box for it not to count.
    pub ignored_share: f64,
}

impl Default for MatchOptions {
    fn default() -> Self {
        Self { min_iou: 0.5, ignored_share: 0.5 }
    }
}

/// What became of a detection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It found a vehicle: the paper's *assigned*.
    Assigned {
        /// Index of the vehicle's box.
        truth: usize,
        /// Their intersection over union.
        iou: f64,
    },
    /// It found nothing.
    Wrong,
    /// It lies on something to ignore.
    Ignored,
}

impl Verdict {
    /// The vehicle that was found, if any.
    pub fn truth(&self) -> Option<usize> {
        match self {
            Self::Assigned { truth, .. } => Some(*truth),
            Self::Wrong | Self::Ignored => None,
        }
    }
}

/// The boxes of one image that detections are held against, square pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TruthBoxes {
    /// Vehicles to find.
    pub counted: Vec<Rect>,
    /// Vehicles and areas to ignore.
    pub ignored: Vec<Rect>,
}

impl TruthBoxes {
    /// The annotated boxes of a frame with the index in [`Frame::vehicles`] of each that counts.
    ///
    /// In Virtual KITTI and in what `partpose synth` writes an annotated box is the projection of the cuboid, clipped
    /// to the image, and so a little larger than what is seen; `bounds` gives another box for a vehicle where one is
    /// meant. A vehicle for which it gives none is ignored where it is annotated.
    pub fn of_frame(frame: &Frame, bounds: &dyn Fn(usize) -> Option<Rect>) -> (Self, Vec<usize>) {
        let mut boxes = Self { counted: Vec::new(), ignored: frame.ignored.clone() };
        let mut vehicles = Vec::new();
        for (index, vehicle) in frame.vehicles.iter().enumerate() {
            match bounds(index).filter(|_| !vehicle.dont_care) {
                Some(bounds) => {
                    boxes.counted.push(bounds);
                    vehicles.push(index);
                }
                None => boxes.ignored.push(vehicle.bounds),
            }
        }
        (boxes, vehicles)
    }
}

/// The verdict on each detection of an image, given as box and score.
///
/// A detection's verdict does not depend on those with a lower score, so that a threshold may be applied afterwards.
pub fn match_detections(
    detections: &[(Rect, f64)],
    truths: &TruthBoxes,
    options: &MatchOptions,
) -> Vec<Verdict> {
    let mut order: Vec<usize> = (0..detections.len()).collect();
    // Stable: of equal scores the first goes first.
    order.sort_by(|a, b| detections[*b].1.total_cmp(&detections[*a].1));
    let mut taken = vec![false; truths.counted.len()];
    let mut verdicts = vec![Verdict::Wrong; detections.len()];
    for index in order {
        let (bounds, _) = &detections[index];
        let mut best: Option<(usize, f64)> = None;
        for (truth, other) in truths.counted.iter().enumerate() {
            let iou = bounds.iou(other);
            let enough = !taken[truth] && iou >= options.min_iou;
            if enough && best.is_none_or(|(_, least)| iou > least) {
                best = Some((truth, iou));
            }
        }
        verdicts[index] = match best {
            Some((truth, iou)) => {
                taken[truth] = true;
                Verdict::Assigned { truth, iou }
            }
            None if lies_on(bounds, &truths.ignored, options.ignored_share) => Verdict::Ignored,
            None => Verdict::Wrong,
        };
    }
    verdicts
}

fn lies_on(bounds: &Rect, ignored: &[Rect], least: f64) -> bool {
    let area = bounds.area();
    area > 0.0
        && ignored.iter().any(|other| {
            bounds.intersection(other).is_some_and(|shared| shared.area() / area >= least)
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 10 x 10 pixels.
    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, x + 10.0, 10.0)
    }

    fn verdicts(detections: &[(Rect, f64)], counted: &[Rect], ignored: &[Rect]) -> Vec<Verdict> {
        let truths = TruthBoxes { counted: counted.to_vec(), ignored: ignored.to_vec() };
        match_detections(detections, &truths, &MatchOptions::default())
    }

    #[test]
    fn higher_score_takes_the_vehicle_and_the_other_is_wrong() {
        let found = verdicts(&[(at(1.0), 0.6), (at(3.0), 0.9)], &[at(0.0)], &[]);
        // 7 of 13 columns are shared; the better box comes too late.
        assert_eq!(found, [Verdict::Wrong, Verdict::Assigned { truth: 0, iou: 70.0 / 130.0 }]);
    }

    #[test]
    fn vehicle_that_overlaps_most_is_taken_and_none_twice() {
        let found = verdicts(&[(at(1.0), 0.9), (at(2.0), 0.8)], &[at(3.0), at(0.0)], &[]);
        assert_eq!(found.iter().map(Verdict::truth).collect::<Vec<_>>(), [Some(1), Some(0)]);
    }

    #[test]
    fn overlap_of_just_a_half_is_enough_and_less_is_not() {
        // 20 x 10 and 10 x 10 within it.
        let wide = Rect::new(0.0, 0.0, 20.0, 10.0);
        assert_eq!(verdicts(&[(at(0.0), 1.0)], &[wide], &[])[0].truth(), Some(0));
        let wider = Rect::new(0.0, 0.0, 20.1, 10.0);
        assert_eq!(verdicts(&[(at(0.0), 1.0)], &[wider], &[]), [Verdict::Wrong]);
    }

    #[test]
    fn half_of_a_detection_on_something_to_ignore_is_neither_right_nor_wrong() {
        let ignored = [Rect::new(5.0, 0.0, 100.0, 10.0)];
        let found = verdicts(&[(at(0.0), 0.9), (at(-1.0), 0.9), (at(50.0), 0.2)], &[], &ignored);
        assert_eq!(found, [Verdict::Ignored, Verdict::Wrong, Verdict::Ignored]);
    }

    #[test]
    fn vehicle_that_counts_goes_before_one_to_ignore() {
        assert_eq!(verdicts(&[(at(0.0), 0.9)], &[at(2.0)], &[at(0.0)])[0].truth(), Some(0));
    }
}
