//! Precision over recall at 41 points, and its averages.

use serde::Serialize;

use super::matching::Task;

/// Points of recall, 0 to 1 in fortieths.
const POINTS: usize = 41;

/// Precision over recall of one class, metric and difficulty.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Curve {
    /// Labels that count.
    pub positives: usize,
    /// Precision at recall i / 40, never rising; 0 beyond the recall that is reached.
    pub precision: Vec<f64>,
    /// The same for the similarity of orientation.
    pub orientation: Vec<f64>,
}

impl Curve {
    /// Mean of precision over the 11 points 0, 0.1 to 1, in percent; `None` without labels that count.
    pub fn r11(&self) -> Option<f64> {
        self.mean(&self.precision, 0, 4)
    }

    /// Mean of precision over the 40 points 1/40 to 1, in percent; `None` without labels that count.
    pub fn r40(&self) -> Option<f64> {
        self.mean(&self.precision, 1, 1)
    }

    /// [`Self::r11`] of the similarity of orientation.
    pub fn orientation_r11(&self) -> Option<f64> {
        self.mean(&self.orientation, 0, 4)
    }

    /// [`Self::r40`] of the similarity of orientation.
    pub fn orientation_r40(&self) -> Option<f64> {
        self.mean(&self.orientation, 1, 1)
    }

    fn mean(&self, values: &[f64], first: usize, step: usize) -> Option<f64> {
        let picked: Vec<f64> = values.iter().skip(first).step_by(step).copied().collect();
        (self.positives > 0).then(|| 100.0 * picked.iter().sum::<f64>() / picked.len() as f64)
    }
}

pub(super) fn curve(task: &Task) -> Curve {
    let thresholds = thresholds(task.matched_scores(), task.positives);
    let mut precision = vec![0.0; POINTS];
    let mut orientation = vec![0.0; POINTS];
    for (i, threshold) in thresholds.iter().take(POINTS).enumerate() {
        let counts = task.counts(*threshold);
        let found = counts.true_positives + counts.false_positives;
        if found > 0 {
            precision[i] = counts.true_positives as f64 / found as f64;
            orientation[i] = counts.similarity / found as f64;
        }
    }
    for values in [&mut precision, &mut orientation] {
        for i in (1..POINTS).rev() {
            values[i - 1] = values[i - 1].max(values[i]);
        }
    }
    Curve { positives: task.positives, precision, orientation }
}

/// The scores at which recall passes each fortieth, as near as the scores allow.
fn thresholds(mut scores: Vec<f64>, positives: usize) -> Vec<f64> {
    scores.sort_by(|a, b| b.total_cmp(a));
    let mut thresholds = Vec::new();
    let mut next = 0.0;
    for (i, score) in scores.iter().enumerate() {
        let recall = |found: usize| found as f64 / positives as f64;
        let (left, is_last) = (recall(i + 1), i + 1 == scores.len());
        // The recall of the following score is nearer to the point: leave the point to it.
        if !is_last && recall(i + 2) - next < next - left {
            continue;
        }
        thresholds.push(*score);
        next += 1.0 / (POINTS as f64 - 1.0);
    }
    thresholds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_labels_there_is_no_average() {
        let curve = Curve { positives: 0, precision: vec![0.0; 41], orientation: vec![0.0; 41] };
        assert_eq!((curve.r11(), curve.orientation_r40()), (None, None));
    }

    #[test]
    fn a_perfect_curve_has_a_hundred_percent() {
        let curve = Curve { positives: 1, precision: vec![1.0; 41], orientation: vec![0.5; 41] };
        assert_eq!((curve.r11(), curve.r40()), (Some(100.0), Some(100.0)));
        assert_eq!(curve.orientation_r11(), Some(50.0));
    }

    #[test]
    fn many_scores_give_a_threshold_for_every_fortieth() {
        let scores: Vec<f64> = (0..400).map(f64::from).collect();
        let found = thresholds(scores, 400);
        assert_eq!(found.len(), 41);
        assert_eq!(found[..3], [399.0, 390.0, 380.0]);
    }
}
