//! Which detections take which labels, for one class, metric and difficulty.

use super::overlap::{Overlaps, is_dont_care};
use super::{KittiClass, KittiDifficulty, KittiFrame, KittiObject};

/// What a label or a detection counts as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// It counts.
    Counted,
    /// A match with it counts neither for nor against.
    Ignored,
    /// It is not looked at.
    Other,
}

/// The frames with the roles of all that is in them.
pub(super) struct Task<'a> {
    frames: Vec<TaskFrame<'a>>,
    min_overlap: f64,
    /// Labels that count.
    pub(super) positives: usize,
}

struct TaskFrame<'a> {
    frame: &'a KittiFrame,
    overlaps: &'a Overlaps,
    labels: Vec<Role>,
    detections: Vec<Role>,
}

/// Counts at one score.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    pub(super) true_positives: usize,
    pub(super) false_positives: usize,
    pub(super) missed: usize,
    /// Sum of (1 + cos of the difference of alpha) / 2 over the true positives.
    pub(super) similarity: f64,
}

impl<'a> Task<'a> {
    pub(super) fn new(
        frames: &'a [KittiFrame],
        overlaps: &'a [Overlaps],
        class: KittiClass,
        difficulty: &KittiDifficulty,
        min_overlap: f64,
    ) -> Self {
        let frames: Vec<TaskFrame> = frames
            .iter()
            .zip(overlaps)
            .map(|(frame, overlaps)| TaskFrame {
                frame,
                overlaps,
                labels: frame.labels.iter().map(|l| label_role(l, class, difficulty)).collect(),
                detections: frame
                    .detections
                    .iter()
                    .map(|d| detection_role(d, class, difficulty))
                    .collect(),
            })
            .collect();
        let roles = frames.iter().flat_map(|frame| &frame.labels);
        let positives = roles.filter(|role| **role == Role::Counted).count();
        Self { frames, min_overlap, positives }
    }

    /// Scores of the detections that are right if every label takes the one with the highest score.
    pub(super) fn matched_scores(&self) -> Vec<f64> {
        let mut scores = Vec::new();
        for frame in &self.frames {
            let mut taken = vec![false; frame.detections.len()];
            for (l, role) in frame.labels.iter().enumerate().filter(|(_, r)| **r != Role::Other) {
                let mut best: Option<(usize, f64)> = None;
                for d in frame.free(&taken, None) {
                    let score = frame.frame.detections[d].score;
                    let higher = best.is_none_or(|(_, best)| score > best);
                    if higher && frame.overlaps.union(l, d) > self.min_overlap {
                        best = Some((d, score));
                    }
                }
                let Some((d, score)) = best else { continue };
                taken[d] = true;
                if *role == Role::Counted && frame.detections[d] == Role::Counted {
                    scores.push(score);
                }
            }
        }
        scores
    }

    /// Counts over all detections of at least this score, if every label takes the one that overlaps most.
    pub(super) fn counts(&self, least_score: f64) -> Counts {
        let mut sum = Counts::default();
        self.frames.iter().for_each(|frame| frame.count(self.min_overlap, least_score, &mut sum));
        sum
    }
}

impl TaskFrame<'_> {
    /// Detections that may be matched: of the class or ignored, not taken, of at least the given score.
    fn free<'b>(
        &'b self,
        taken: &'b [bool],
        least_score: Option<f64>,
    ) -> impl Iterator<Item = usize> + 'b {
        (0..self.detections.len()).filter(move |d| {
            let above = least_score.is_none_or(|least| self.frame.detections[*d].score >= least);
            above && !taken[*d] && self.detections[*d] != Role::Other
        })
    }

    fn count(&self, min_overlap: f64, least_score: f64, sum: &mut Counts) {
        let mut taken = vec![false; self.detections.len()];
        for (l, role) in self.labels.iter().enumerate().filter(|(_, role)| **role != Role::Other) {
            match self.greatest_overlap(l, &taken, (min_overlap, least_score)) {
                None if *role == Role::Counted => sum.missed += 1,
                None => {}
                Some(d) => {
                    taken[d] = true;
                    if *role == Role::Counted && self.detections[d] == Role::Counted {
                        sum.true_positives += 1;
                        let (label, found) = (&self.frame.labels[l], &self.frame.detections[d]);
                        sum.similarity += 0.5 * (1.0 + (label.alpha - found.alpha).cos());
                    }
                }
            }
        }
        for d in self.free(&taken, Some(least_score)) {
            let excused = || {
                (0..self.labels.len()).any(|label| self.overlaps.covered(label, d) > min_overlap)
            };
            if self.detections[d] == Role::Counted && !excused() {
                sum.false_positives += 1;
            }
        }
    }

    /// The counted detection that overlaps most; without one, the first ignored one that overlaps enough.
    fn greatest_overlap(
        &self,
        label: usize,
        taken: &[bool],
        (min_overlap, least_score): (f64, f64),
    ) -> Option<usize> {
        let mut counted: Option<(usize, f64)> = None;
        let mut ignored = None;
        for d in self.free(taken, Some(least_score)) {
            let overlap = self.overlaps.union(label, d);
            if overlap <= min_overlap {
                continue;
            }
            if self.detections[d] == Role::Ignored {
                ignored = ignored.or(Some(d));
            } else if counted.is_none_or(|(_, best)| overlap > best) {
                counted = Some((d, overlap));
            }
        }
        counted.map(|(d, _)| d).or(ignored)
    }
}

fn label_role(label: &KittiObject, class: KittiClass, difficulty: &KittiDifficulty) -> Role {
    let is = |name: &str| label.category.eq_ignore_ascii_case(name);
    let too_hard = label.occlusion > difficulty.max_occlusion
        || label.truncation > difficulty.max_truncation
        || label.bounds.height() < difficulty.min_height;
    if is_dont_care(label) {
        Role::Other
    } else if is(class.name()) {
        if too_hard { Role::Ignored } else { Role::Counted }
    } else if is(class.neighbour()) {
        Role::Ignored
    } else {
        Role::Other
    }
}

/// The height comes before the class: a low detection of any class can be matched, and then counts as nothing.
fn detection_role(found: &KittiObject, class: KittiClass, difficulty: &KittiDifficulty) -> Role {
    if found.bounds.height().abs() < difficulty.min_height {
        Role::Ignored
    } else if found.category.eq_ignore_ascii_case(class.name()) {
        Role::Counted
    } else {
        Role::Other
    }
}
