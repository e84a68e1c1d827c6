//! `partpose evaluate a3dp`: average precision of car poses as `ApolloCar3D` has it.

use std::fmt::Write;
use std::path::PathBuf;

use partpose::eval::Table;
use partpose::eval::a3dp::{
    A3dpDistance, A3dpMatching, A3dpScores, parse_similarity, read_a3dp, score_a3dp,
};
use partpose::files::{self, RgbImage};
use partpose::viz::{Axis, Mark, Plot, Series, plot};
use serde_json::{Map, Value, json};

use super::scores::{self, Places};
use crate::report::{Outcome, hint};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose evaluate a3dp --labels labels --results results --out scores")]
pub(crate) struct Arguments {
    #[command(flatten)]
    places: Places,
    /// Similarities of the models' shapes; `sim_mat.txt` in the labels' folder or above if not given
    #[arg(long, value_name = "FILE")]
    similarity: Option<PathBuf>,
}

/// The variants, with their title and their key in the metrics.
const VARIANTS: [(&str, &str, A3dpDistance, A3dpMatching); 4] = [
    ("Abs", "abs", A3dpDistance::Absolute, A3dpMatching::Released),
    ("Abs, fresh", "abs_fresh", A3dpDistance::Absolute, A3dpMatching::Fresh),
    ("Rel", "rel", A3dpDistance::Relative, A3dpMatching::Released),
    ("Rel, fresh", "rel_fresh", A3dpDistance::Relative, A3dpMatching::Fresh),
];

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let places = &arguments.places;
    let labels = scores::folder_with(&places.labels, "json", &["det3d_gt"]);
    let results = scores::folder_with(&places.results, "json", &["det3d_res"]);
    let path = arguments.similarity.clone().or_else(|| scores::nearby(&labels, "sim_mat.txt"));
    let path = path.ok_or_else(|| {
        let error = anyhow::anyhow!("there is no `sim_mat.txt` in `{}` or above", labels.display());
        hint(error, "give the table of similarities as `--similarity`")
    })?;
    let similarity = parse_similarity(&path, &files::read_text(&path)?)?;
    let files = read_a3dp(&labels, &results, &similarity)?;
    files::create_folder(&places.out)?;
    let scored = VARIANTS.map(|(_, _, distance, matching)| {
        score_a3dp(&files.images, &similarity, distance, matching)
    });
    let mut metrics = figures(&scored[0]);
    for ((_, key, _, _), scores) in VARIANTS.iter().zip(&scored) {
        metrics.insert((*key).to_owned(), Value::Object(figures(scores)));
    }
    let mut text = String::new();
    for (name, value) in &scored[0].figures {
        // Writing to a string does not fail; the evaluator writes -1 where nothing counts.
        let _ = writeln!(text, "{name} {:.4}", value.unwrap_or(-1.0));
    }
    files::write(&places.out.join("res.txt"), text.as_bytes())?;
    let curves = picture(&scored[0], &scored[1]);
    scores::write(&places.out, &Value::Object(metrics), &[table(&scored)], &curves)?;
    let cars: usize = files.images.iter().map(|image| image.truths.len()).sum();
    let said = format!("{cars} cars in {} images", files.images.len());
    scores::finish(&places.out, &said, &[(files.without_labels, "result files without labels")])
}

fn figures(scores: &A3dpScores) -> Map<String, Value> {
    scores.figures.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect()
}

fn table(scored: &[A3dpScores; 4]) -> Table {
    let mut columns = vec![""];
    columns.extend(VARIANTS.map(|(title, ..)| title));
    let mut table = Table::new("A3DP, shares of 1", &columns);
    for (i, (name, _)) in scored[0].figures.iter().enumerate() {
        let mut row = vec![(*name).to_owned()];
        row.extend(scored.iter().map(|scores| scores::cell(scores.figures[i].1)));
        table.rows.push(row);
    }
    table
}

fn picture(released: &A3dpScores, fresh: &A3dpScores) -> RgbImage {
    let mut series = Vec::new();
    for (name, scores) in [("", released), (", fresh", fresh)] {
        for criterion in [0, 3] {
            let Some(precision) = scores.precision.get(criterion) else { continue };
            let points = precision.iter().enumerate().map(|(i, p)| [i as f64 / 100.0, *p]);
            let title = format!("c{criterion}{name}");
            series.push(Series::new(&title, Mark::Curve, points.collect()));
        }
    }
    plot(&Plot {
        title: "A3DP-Abs".to_owned(),
        x: Axis::over("recall", [0.0, 1.0]),
        y: Axis::over("precision", [0.0, 1.0]),
        series,
        ..Plot::default()
    })
}
