//! `partpose evaluate coco`: COCO's average precision and recall of boxes and masks.

use std::path::Path;

use clap::ValueEnum;
use partpose::eval::Table;
use partpose::eval::coco::{CocoOverlap, CocoScores, CocoSet, parse_coco, read_coco, score_coco};
use partpose::files::{self, RgbImage};
use partpose::formats::{coco_results, read_coco_ids};
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};
use serde_json::{Map, Value, json};

use super::scores::{self, Places};
use crate::commands::export::with_coco_ids;
use crate::report::{Outcome, hint};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose evaluate coco --labels instances.json --results results.json --out scores")]
pub(crate) struct Arguments {
    #[command(flatten)]
    places: Places,
    /// What overlap is measured by; all that labels and results both have if not given
    #[arg(long, value_enum)]
    overlap: Option<OverlapFlag>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OverlapFlag {
    /// Boxes
    Bbox,
    /// Masks
    Segm,
}

const OVERLAPS: [(OverlapFlag, &str, CocoOverlap); 2] = [
    (OverlapFlag::Bbox, "bbox", CocoOverlap::Boxes),
    (OverlapFlag::Segm, "segm", CocoOverlap::Masks),
];

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let places = &arguments.places;
    let labels = scores::only_file(&places.labels, "json", "--labels")?;
    let set = read_set(&labels, &places.results)?;
    let chosen: Vec<_> = OVERLAPS
        .into_iter()
        .filter(|(flag, _, overlap)| match arguments.overlap {
            Some(wanted) => wanted == *flag,
            None => set.has(*overlap),
        })
        .collect();
    let missing = chosen.iter().find(|(_, _, overlap)| !set.has(*overlap));
    if chosen.is_empty() || missing.is_some() {
        let what = missing.map_or("neither boxes nor masks", |(_, name, _)| match *name {
            "bbox" => "boxes missing",
            _ => "masks missing",
        });
        let error = anyhow::anyhow!("labels or results have {what} in some of their entries");
        return Err(hint(
            error,
            "every annotation and every result needs a `bbox` or every one a `segmentation`",
        ));
    }
    files::create_folder(&places.out)?;
    let scored: Vec<(&str, CocoScores)> =
        chosen.iter().map(|(_, name, overlap)| (*name, score_coco(&set, *overlap))).collect();
    let tables = [table(&scored), category_table(&set, &scored)];
    let pictures: Vec<RgbImage> =
        scored.iter().map(|(name, scores)| picture(name, scores)).collect();
    let curves = panels(&pictures, 2);
    scores::write(&places.out, &metrics(&set, &scored), &tables, &curves)?;
    let results: usize = set.images.iter().map(|image| image.results.len()).sum();
    let said = format!("{results} results in {} images", set.images.len());
    let left_out = [(set.unknown_categories, "results of categories that the labels do not have")];
    scores::finish(&places.out, &said, &left_out)
}

/// COCO's own list of results, or the results of `fit`, whose images are found by their names.
fn read_set(labels: &Path, results: &Path) -> anyhow::Result<CocoSet> {
    let Some(images) = scores::own_results(results)? else {
        let results = scores::only_file(results, "json", "--results")?;
        return Ok(read_coco(labels, &results)?);
    };
    let ids = read_coco_ids(labels)?;
    let found = coco_results(&with_coco_ids(&images, &ids)?, &ids);
    let text = serde_json::to_string(&found)?;
    Ok(parse_coco((labels, &files::read(labels)?), (results, text.as_bytes()))?)
}

fn metrics(set: &CocoSet, scored: &[(&str, CocoScores)]) -> Value {
    let mut metrics = Map::new();
    for (name, scores) in scored {
        let figures = scores.figures.iter().map(|(name, value)| ((*name).to_owned(), json!(value)));
        let mut figures: Map<String, Value> = figures.collect();
        let categories = set.categories.iter().zip(&scores.categories);
        let categories =
            categories.map(|((id, name), value)| json!({ "id": id, "name": name, "AP": value }));
        figures.insert("categories".to_owned(), Value::Array(categories.collect()));
        metrics.insert((*name).to_owned(), Value::Object(figures));
    }
    Value::Object(metrics)
}

fn table(scored: &[(&str, CocoScores)]) -> Table {
    let mut columns = vec![""];
    columns.extend(scored.iter().map(|(name, _)| *name));
    let mut table = Table::new("COCO average precision and recall, %", &columns);
    for (i, (name, _)) in scored[0].1.figures.iter().enumerate() {
        let mut row = vec![(*name).to_owned()];
        row.extend(scored.iter().map(|(_, scores)| scores::percent(scores.figures[i].1)));
        table.rows.push(row);
    }
    table
}

fn category_table(set: &CocoSet, scored: &[(&str, CocoScores)]) -> Table {
    let mut columns = vec!["category"];
    columns.extend(scored.iter().map(|(name, _)| *name));
    let mut table = Table::new("AP by category, %", &columns);
    for (i, (id, name)) in set.categories.iter().enumerate() {
        let mut row = vec![if name.is_empty() { id.to_string() } else { name.clone() }];
        row.extend(scored.iter().map(|(_, scores)| scores::percent(scores.categories[i])));
        table.rows.push(row);
    }
    table
}

fn picture(name: &str, scores: &CocoScores) -> RgbImage {
    let thresholds = [(0, "IoU 0.50"), (5, "IoU 0.75"), (8, "IoU 0.90")];
    let series = thresholds.iter().filter_map(|(threshold, title)| {
        let precision = scores.precision.get(*threshold)?;
        let points = precision.iter().enumerate().map(|(i, p)| [i as f64 / 100.0, *p]);
        Some(Series::new(title, Mark::Curve, points.collect()))
    });
    plot(&Plot {
        title: format!("COCO {name}, mean over the categories"),
        x: Axis::over("recall", [0.0, 1.0]),
        y: Axis::over("precision", [0.0, 1.0]),
        series: series.collect(),
        ..Plot::default()
    })
}
