//! The course of a training as tables and pictures: losses, and the scores of validations.

use std::fmt::Write;
use std::path::Path;

use partpose::files::{self, FileError};
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};

use crate::validation::Scores;

/// Name of the table of losses in a run's folder.
pub const LOSSES: &str = "losses.csv";
/// Name of the table of validations.
pub const SCORES: &str = "validation.csv";
/// Name of the picture of both.
pub const PICTURE: &str = "curves.png";

/// Columns of [`LossRow::means`].
pub const LOSS_NAMES: [&str; 9] = [
    "total",
    "rpn_objectness",
    "rpn_box",
    "class",
    "box",
    "mask",
    "model",
    "extent",
    "gradient_norm",
];
const SCORE_NAMES: [&str; 5] =
    ["precision", "recall", "mean_iou", "mpa", "mean_foreground_accuracy"];

/// Means over the steps since the row before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossRow {
    /// Steps done.
    pub step: u64,
    /// The learning rate.
    pub rate: f64,
    /// In the order of [`LOSS_NAMES`].
    pub means: [f64; 9],
}

/// Scores of a validation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoreRow {
    /// Steps done.
    pub step: u64,
    /// Precision, recall, mean IoU, mean pixel accuracy, that of the foreground.
    pub values: [f64; 5],
}

/// A training so far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves {
    /// By step.
    pub losses: Vec<LossRow>,
    /// By step.
    pub scores: Vec<ScoreRow>,
}

impl ScoreRow {
    /// The scores that are drawn.
    pub fn new(step: u64, scores: &Scores) -> Self {
        let (boxes, masks) = (&scores.boxes, &scores.masks);
        let values = [
            boxes.precision,
            boxes.recall,
            boxes.mean_iou,
            masks.mpa,
            masks.mean_foreground_accuracy,
        ];
        Self { step, values }
    }

    /// What the best weights are chosen by: the harmonic mean of precision and recall, times mean IoU and mean pixel
    /// accuracy; 0 where nothing was found.
    pub fn quality(&self) -> f64 {
        let [precision, recall, iou, mpa, _] = self.values;
        let both = 2.0 * precision * recall / (precision + recall) * iou * mpa;
        if both.is_finite() { both } else { 0.0 }
    }
}

/// Writes tables and picture into a run's folder.
pub fn write(folder: &Path, curves: &Curves) -> Result<(), FileError> {
    let mut losses = format!("step,rate,{}\n", LOSS_NAMES.join(","));
    for row in &curves.losses {
        let _ = write!(losses, "{},{:e}", row.step, row.rate);
        for value in row.means {
            let _ = write!(losses, ",{value:.6}");
        }
        losses.push('\n');
    }
    files::write(&folder.join(LOSSES), losses.as_bytes())?;
    let mut scores = format!("step,{}\n", SCORE_NAMES.join(","));
    for row in &curves.scores {
        let _ = write!(scores, "{}", row.step);
        for value in row.values {
            let _ = write!(scores, ",{value:.6}");
        }
        scores.push('\n');
    }
    files::write(&folder.join(SCORES), scores.as_bytes())?;
    let of_losses = |columns: &[usize]| -> Vec<Series> {
        let series = columns.iter().map(|column| {
            let points = curves.losses.iter().map(|row| [row.step as f64, row.means[*column]]);
            Series::new(LOSS_NAMES[*column], Mark::Curve, points.collect())
        });
        series.collect()
    };
    let of_scores = SCORE_NAMES.iter().enumerate().map(|(i, name)| {
        let points = curves.scores.iter().map(|row| [row.step as f64, row.values[i]]);
        Series::new(name, Mark::Line, points.collect())
    });
    let draw = |title: &str, y: Axis, series: Vec<Series>| {
        let title = title.to_owned();
        plot(&Plot { title, x: Axis::new("step"), y, series, ..Plot::default() })
    };
    let logarithmic = |label: &str| Axis { logarithmic: true, ..Axis::new(label) };
    let pictures = [
        draw("Losses, unweighted", logarithmic("loss"), of_losses(&[1, 2, 3, 4, 5])),
        draw("Weighted sum of the losses", logarithmic("loss"), of_losses(&[0])),
        draw("Validation", Axis::over("share", [0.0, 1.0]), of_scores.collect()),
        draw("Norm of the gradients", logarithmic("norm"), of_losses(&[8])),
    ];
    files::write_png(&folder.join(PICTURE), &panels(&pictures, 2))
}

/// Reads the tables of a run up to a step; lines that are not theirs are left out.
pub fn read(folder: &Path, last: u64) -> Result<Curves, FileError> {
    let rows = |name: &str| -> Result<Vec<Vec<f64>>, FileError> {
        let path = folder.join(name);
        if !path.is_file() {
            return Ok(Vec::new());
        }
        let text = files::read_text(&path)?;
        let numbers = |line: &str| line.split(',').map(|word| word.parse().ok()).collect();
        Ok(text.lines().skip(1).filter_map(numbers).collect())
    };
    let losses = rows(LOSSES)?.into_iter().filter_map(|row| {
        let means = row.get(2..)?.try_into().ok()?;
        Some(LossRow { step: row[0] as u64, rate: row[1], means })
    });
    let scores = rows(SCORES)?.into_iter().filter_map(|row| {
        let values = row.get(1..)?.try_into().ok()?;
        Some(ScoreRow { step: row[0] as u64, values })
    });
    Ok(Curves {
        losses: losses.filter(|row| row.step <= last).collect(),
        scores: scores.filter(|row| row.step <= last).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_come_back_up_to_a_step() {
        let folder = tempfile::tempdir().unwrap();
        let losses = [20, 40].map(|step| LossRow { step, rate: 1e-4, means: [0.5; 9] }).to_vec();
        let scores = [40, 80].map(|step| ScoreRow { step, values: [0.25; 5] }).to_vec();
        let curves = Curves { losses, scores };
        write(folder.path(), &curves).unwrap();
        assert_eq!(read(folder.path(), 100).unwrap(), curves);
        let first = read(folder.path(), 30).unwrap();
        assert_eq!([first.losses.len(), first.scores.len()], [1, 0]);
        assert!(files::image_size(&folder.path().join(PICTURE)).is_ok());
    }
}
