//! `partpose evaluate kitti`: KITTI's average precision of 2D boxes, orientation, bird's-eye view and 3D boxes.

use partpose::eval::Table;
use partpose::eval::kitti::{
    Curve, KittiDifficulty, KittiOptions, KittiScores, read_kitti, score_kitti,
};
use partpose::files::{self, RgbImage};
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};
use serde_json::{Map, Value, json};

use super::scores::{self, Places};
use crate::report::{Outcome, hint};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose evaluate kitti --labels training/label_2 --results run --out scores
  partpose evaluate kitti --labels training/label_2 --results run --subset --out scores")]
pub(crate) struct Arguments {
    #[command(flatten)]
    places: Places,
    /// Score only the images that have a result file; otherwise a missing one is an error
    #[arg(long)]
    subset: bool,
}

/// The metrics in the order of the benchmark, with their curve and whether orientation is meant.
const METRICS: [(&str, usize, bool); 4] =
    [("2d", 0, false), ("aos", 0, true), ("bev", 1, false), ("3d", 2, false)];

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let places = &arguments.places;
    let labels = scores::folder_with(&places.labels, "txt", &["label_2", "training/label_2"]);
    let results = scores::folder_with(&places.results, "txt", &["data", "results"]);
    let files = read_kitti(&labels, &results, arguments.subset).map_err(|error| {
        let missing = error.to_string().contains("is missing");
        if missing {
            hint(error, "add `--subset` to score only the images with results")
        } else {
            error.into()
        }
    })?;
    files::create_folder(&places.out)?;
    let scored = score_kitti(&files.frames, &KittiOptions::default());
    let details = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "images": files.frames.len(),
        "curves": curves(&scored),
    });
    let details = serde_json::to_string_pretty(&details)?;
    files::write(&places.out.join("curves.json"), details.as_bytes())?;
    scores::write(&places.out, &metrics(&scored), &[table(&scored)], &picture(&scored))?;
    let said = format!("{} images", files.frames.len());
    scores::finish(
        &places.out,
        &said,
        &[
            (files.without_results, "label files without results, as `--subset` allows"),
            (files.without_labels, "result files without labels"),
        ],
    )
}

fn average(curve: &Curve, orientation: bool, points: &str) -> Option<f64> {
    match (orientation, points) {
        (false, "R11") => curve.r11(),
        (false, _) => curve.r40(),
        (true, "R11") => curve.orientation_r11(),
        (true, _) => curve.orientation_r40(),
    }
}

/// Class, metric, recall points, difficulty.
fn metrics(scored: &[KittiScores]) -> Value {
    let mut classes = Map::new();
    for scores in scored {
        let mut metrics = Map::new();
        for (name, curve, orientation) in METRICS {
            let mut by_points = Map::new();
            for points in ["R11", "R40"] {
                let levels = KittiDifficulty::ALL.iter().zip(&scores.curves[curve]);
                let values = levels.map(|(level, curve)| {
                    (level.name.to_owned(), json!(average(curve, orientation, points)))
                });
                by_points.insert(points.to_owned(), Value::Object(values.collect()));
            }
            metrics.insert(name.to_owned(), Value::Object(by_points));
        }
        classes.insert(scores.class.name().to_owned(), Value::Object(metrics));
    }
    Value::Object(classes)
}

/// Precision and similarity of orientation at all 41 points.
fn curves(scored: &[KittiScores]) -> Value {
    let mut classes = Map::new();
    for scores in scored {
        let metric = |curves: &[Curve; 3]| {
            let levels = KittiDifficulty::ALL.iter().zip(curves);
            Value::Object(levels.map(|(level, c)| (level.name.to_owned(), json!(c))).collect())
        };
        let [image, birds_eye, volume] = scores.curves.each_ref().map(metric);
        let value = json!({ "2d": image, "bev": birds_eye, "3d": volume });
        classes.insert(scores.class.name().to_owned(), value);
    }
    Value::Object(classes)
}

fn table(scored: &[KittiScores]) -> Table {
    let columns =
        ["", "R11 easy", "R11 moderate", "R11 hard", "R40 easy", "R40 moderate", "R40 hard"];
    let mut table = Table::new("KITTI average precision, %", &columns);
    for scores in scored {
        for (name, curve, orientation) in METRICS {
            let mut row = vec![format!("{} {name}", scores.class.name())];
            for points in ["R11", "R40"] {
                let curves = scores.curves[curve].iter();
                row.extend(curves.map(|c| scores::cell(average(c, orientation, points))));
            }
            table.rows.push(row);
        }
    }
    table
}

/// A row a class, a column a metric, a curve a difficulty.
fn picture(scored: &[KittiScores]) -> RgbImage {
    let mut pictures = Vec::new();
    for scores in scored {
        for (name, curves) in ["2D", "bird's-eye view", "3D"].iter().zip(&scores.curves) {
            let series = KittiDifficulty::ALL.iter().zip(curves).map(|(level, curve)| {
                let recall = |i: usize| i as f64 / 40.0;
                let points = curve.precision.iter().enumerate().map(|(i, p)| [recall(i), *p]);
                Series::new(level.name, Mark::Curve, points.collect())
            });
            pictures.push(plot(&Plot {
                title: format!("{} {name}", scores.class.name()),
                x: Axis::over("recall", [0.0, 1.0]),
                y: Axis::over("precision", [0.0, 1.0]),
                series: series.collect(),
                size: [400, 300],
            }));
        }
    }
    panels(&pictures, 3)
}
