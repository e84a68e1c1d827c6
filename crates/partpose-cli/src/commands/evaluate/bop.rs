//! `partpose evaluate bop`: recalls of the BOP benchmark under MSSD, MSPD and ADD.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Context;
use partpose::eval::Table;
use partpose::eval::bop::{
    BopEstimate, BopFolders, BopRecalls, BopScores, parse_estimates, read_bop, score_bop,
};
use partpose::files::{self, RgbImage};
use partpose::formats::bop::{bop_csv, bop_image_ids};
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};
use serde_json::{Value, json};

use super::scores::{self, Places};
use crate::report::{Outcome, hint};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose evaluate bop --labels test --results results.csv --out scores")]
pub(crate) struct Arguments {
    #[command(flatten)]
    places: Places,
    /// Folder with `models_info.json` and the PLY files; `models_eval` or `models` in the labels' folder or above if
    /// not given
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// List of what is to be found; `test_targets_bop19.json` in the labels' folder or above if not given, else all
    /// that is visible by a tenth
    #[arg(long, value_name = "FILE")]
    targets: Option<PathBuf>,
    /// Width of the images in pixels; that of `camera.json` in the labels' folder or above if not given
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    image_width: Option<u32>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let places = &arguments.places;
    let models = arguments.models.clone().or_else(|| {
        ["models_eval", "models"].iter().find_map(|name| scores::nearby(&places.labels, name))
    });
    let models = models.ok_or_else(|| {
        let folder = places.labels.display();
        let error =
            anyhow::anyhow!("there is no folder `models_eval` or `models` in `{folder}` or above");
        hint(error, "give the folder with `models_info.json` as `--models`")
    })?;
    let targets = arguments
        .targets
        .clone()
        .or_else(|| scores::nearby(&places.labels, "test_targets_bop19.json"));
    let folders = BopFolders { scenes: places.labels.clone(), models, targets };
    let set = read_bop(&folders, image_width(arguments)?)?;
    let estimates = read_estimates(arguments)?;
    files::create_folder(&places.out)?;
    let scored = score_bop(&set, &estimates);
    scores::write(
        &places.out,
        &metrics(&scored),
        &[table(&scored), object_table(&scored)],
        &picture(&scored),
    )?;
    let said = format!("{} targets in {} images", scored.targets, set.images.len());
    let left_out = [(scored.unused, "estimates that no target asks for")];
    scores::finish(&places.out, &said, &left_out)
}

/// BOP's CSV, or the results of `fit` on images and models whose names tell their ids.
fn read_estimates(arguments: &Arguments) -> anyhow::Result<Vec<BopEstimate>> {
    let results = &arguments.places.results;
    let Some(images) = scores::own_results(results)? else {
        let path = scores::only_file(results, "csv", "--results")?;
        return Ok(parse_estimates(&path, &files::read_text(&path)?)?);
    };
    let ids = |image| {
        let unknown = || {
            let error = anyhow::anyhow!("the name `{image}` does not tell a scene and an image");
            hint(error, "images are called as in the benchmark: `000002/rgb/000007.png`")
        };
        bop_image_ids(image).ok_or_else(unknown)
    };
    let mut objects = BTreeMap::new();
    for vehicle in images.iter().flat_map(|image| &image.vehicles) {
        let id = vehicle.model.strip_prefix("obj_").and_then(|id| id.parse::<u32>().ok());
        let unknown = || {
            let name = &vehicle.model;
            let error = anyhow::anyhow!("the name of the model `{name}` does not tell its id");
            hint(error, "call the zoo's models as in the benchmark: `obj_000001`")
        };
        objects.insert(vehicle.model.clone(), id.ok_or_else(unknown)?);
    }
    let keyed: anyhow::Result<Vec<_>> =
        images.iter().map(|image| Ok((ids(&image.image)?, image))).collect();
    Ok(parse_estimates(results, &bop_csv(&keyed?, &objects))?)
}

fn image_width(arguments: &Arguments) -> anyhow::Result<f64> {
    if let Some(width) = arguments.image_width {
        return Ok(f64::from(width));
    }
    let Some(path) = scores::nearby(&arguments.places.labels, "camera.json") else {
        let folder = arguments.places.labels.display();
        let error = anyhow::anyhow!("there is no `camera.json` in `{folder}` or above");
        return Err(hint(error, "give the width of the images as `--image-width`"));
    };
    let camera: Value = serde_json::from_str(&files::read_text(&path)?)
        .with_context(|| format!("`{}` is not JSON", path.display()))?;
    let width = camera["width"].as_f64().filter(|width| (1.0..=1e5).contains(width));
    width.ok_or_else(|| {
        let error = anyhow::anyhow!("`{}` has no sensible `width`", path.display());
        hint(error, "give the width of the images as `--image-width`")
    })
}

/// The errors in the order of the tables.
fn errors(scores: &BopScores) -> [(&'static str, &BopRecalls); 3] {
    [("MSSD", &scores.mssd), ("MSPD", &scores.mspd), ("ADD", &scores.add)]
}

fn metrics(scores: &BopScores) -> Value {
    let recalls = |recalls: &BopRecalls| {
        let pairs = recalls.recalls.iter();
        let pairs =
            pairs.map(|(threshold, recall)| json!({ "threshold": threshold, "recall": recall }));
        json!({
            "average_recall": recalls.average,
            "recalls": pairs.collect::<Vec<_>>(),
            "objects": recalls.objects,
        })
    };
    json!({
        "bop19_average_recall_mssd": scores.mssd.average,
        "bop19_average_recall_mspd": scores.mspd.average,
        "recall_add_0.1d": scores.add.average,
        "targets": scores.targets,
        "unused_estimates": scores.unused,
        "average_time_per_image": scores.time,
        "mssd": recalls(&scores.mssd),
        "mspd": recalls(&scores.mspd),
        "add": recalls(&scores.add),
    })
}

fn table(scores: &BopScores) -> Table {
    let mut table = Table::new("BOP average recall, %", &["error", "thresholds", "average recall"]);
    let thresholds =
        ["0.05 to 0.50 of the diameter", "5 to 50 px at a width of 640", "0.1 of the diameter"];
    for ((name, recalls), thresholds) in errors(scores).into_iter().zip(thresholds) {
        let row = vec![name.to_owned(), thresholds.to_owned(), scores::percent(recalls.average)];
        table.rows.push(row);
    }
    table
}

fn object_table(scores: &BopScores) -> Table {
    let mut table = Table::new("Average recall by object, %", &["object", "MSSD", "MSPD", "ADD"]);
    for object in scores.mssd.objects.keys() {
        let mut row = vec![object.to_string()];
        let values = errors(scores).map(|(_, recalls)| recalls.objects.get(object).copied());
        row.extend(values.map(scores::percent));
        table.rows.push(row);
    }
    table
}

fn picture(scores: &BopScores) -> RgbImage {
    let units = ["share of the diameter", "pixels at a width of 640"];
    let pictures: Vec<RgbImage> = errors(scores)
        .iter()
        .zip(units)
        .map(|((name, recalls), unit)| {
            let points = recalls.recalls.iter().map(|(threshold, recall)| [*threshold, *recall]);
            plot(&Plot {
                title: format!("{name}: recall over the threshold of correctness"),
                x: Axis::new(unit),
                y: Axis::over("recall", [0.0, 1.0]),
                series: vec![Series::new("", Mark::Line, points.collect())],
                ..Plot::default()
            })
        })
        .collect();
    panels(&pictures, 2)
}
