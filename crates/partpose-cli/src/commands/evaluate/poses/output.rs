//! Tables, metrics and the list of vehicles, as files.

use std::path::Path;

use anyhow::{Context, bail};
use clap::ValueEnum;
use partpose::eval::{
    PoseScores, Table, breakdown, paper_tables, part_table, score_table, summarize,
};
use partpose::files;
use partpose::pose::PoseEstimate;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{Arguments, Evaluated, uncertainty};
use crate::report;

/// Prints the tables and writes everything.
pub(super) fn write(arguments: &Arguments, evaluated: &Evaluated) -> anyhow::Result<()> {
    let scores: Vec<(String, PoseScores)> = evaluated
        .configurations
        .iter()
        .zip(&evaluated.rows)
        .map(|(configuration, rows)| {
            (configuration.name.clone(), summarize(rows.iter().map(|row| row.scored)))
        })
        .collect();
    let mut tables = if arguments.tables { paper_tables(&scores) } else { Vec::new() };
    if let (false, Some(last)) = (arguments.oracle, evaluated.configurations.last()) {
        for table in &mut tables {
            table.title = table.title.replace("56 x 56", &format!("{0} x {0}", last.kernel));
        }
    }
    let others: Vec<(String, PoseScores)> = scores
        .iter()
        .filter_map(|(name, scores)| Some((name.strip_prefix("past: ")?.to_owned(), *scores)))
        .collect();
    if !others.is_empty() {
        tables.push(score_table("Past the tables: visible centres, LM", &others));
    }
    let detailed = evaluated.rows.len() - 1;
    let by = breakdown(
        &evaluated.rows[detailed].iter().map(|row| (row.stratum, row.scored)).collect::<Vec<_>>(),
    );
    let title = format!(
        "By distance, occlusion and truncation: {}",
        evaluated.configurations[detailed].name
    );
    tables.push(score_table(&title, &by));
    tables.extend(uncertainty::tables(evaluated));
    if arguments.parts {
        let rows = evaluated.rows[detailed].iter();
        let parts: Vec<_> = rows.map(|row| row.parts.as_slice()).collect();
        tables.push(part_table("Parts against the model", &parts));
    }
    let text = markdown(&tables);
    report::data(&text)?;
    let file = |name: &str| arguments.out.join(name);
    files::write(&file("tables.md"), text.as_bytes())?;
    for (index, table) in tables.iter().enumerate() {
        files::write(&file(&format!("table-{}.csv", index + 1)), table.to_csv().as_bytes())?;
    }
    uncertainty::write_plots(arguments, evaluated)?;
    files::write(&file("vehicles.csv"), vehicle_list(evaluated).to_csv().as_bytes())?;
    write_metrics(&file("metrics.json"), arguments, evaluated, &scores, &by)
}

fn markdown(tables: &[Table]) -> String {
    tables.iter().map(Table::to_markdown).collect::<Vec<_>>().join("\n")
}

/// One configuration's scores stand at the top, as `count`, `mean_iou3d` and so on; all of them under `rows`.
fn write_metrics(
    path: &Path,
    arguments: &Arguments,
    evaluated: &Evaluated,
    scores: &[(String, PoseScores)],
    by: &[(String, PoseScores)],
) -> anyhow::Result<()> {
    let last = scores.len() - 1;
    let mut metrics = serde_json::to_value(scores[last].1)?;
    let rows: Vec<_> = scores
        .iter()
        .zip(&evaluated.configurations)
        .zip(&evaluated.rows)
        .map(|(((name, scores), configuration), rows)| {
            let accuracies = || rows.iter().filter_map(|row| row.pixel_accuracy);
            // NaN, which is `null`, without part masks.
            let accuracy = accuracies().sum::<f64>() / accuracies().count() as f64;
            json!({
                "name": name,
                "kernel": configuration.kernel,
                "pose": configuration.pose,
                "degradation_strength": configuration.degradation.map(|d| d.strength),
                "mean_pixel_accuracy": accuracy,
                "uncertainty": uncertainty::scores(rows),
                "scores": scores,
            })
        })
        .collect();
    let Some(object) = metrics.as_object_mut() else { bail!("scores are not an object") };
    object.insert("name".to_owned(), json!(scores[last].0));
    object.insert("settings".to_owned(), settings(arguments, &evaluated.detections));
    object.insert("skipped_frames".to_owned(), json!(evaluated.skipped));
    object.insert("rows".to_owned(), json!(rows));
    let by: Vec<_> = by.iter().map(|(name, s)| json!({ "name": name, "scores": s })).collect();
    object.insert("breakdown".to_owned(), json!(by));
    let text = serde_json::to_string_pretty(&metrics)?;
    files::write(path, text.as_bytes()).context("the metrics could not be written")
}

/// What the scores depend on besides the rows' own options.
pub(super) fn settings(arguments: &Arguments, detections: &str) -> serde_json::Value {
    let name = |value: Option<clap::builder::PossibleValue>| {
        value.map_or(String::new(), |value| value.get_name().to_owned())
    };
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "dataset": arguments.selection.dataset.display().to_string(),
        "worlds": arguments.selection.worlds,
        "variations": arguments.selection.variations,
        "fold": arguments.fold,
        "stride": arguments.selection.stride,
        "zoo": arguments.zoo.as_deref().unwrap_or("embedded"),
        "detections": detections,
        "min_score": arguments.source.min_score,
        "box": name(arguments.bounds.to_possible_value()),
        "degrade_to_pixel_accuracy": arguments.degrade,
        "extent": name(arguments.extent.to_possible_value()),
        "mask_bias_measured_on": arguments.mask_bias,
        "scene": arguments.scene.in_words(),
        "size_head": arguments.size_head,
        "model_head": arguments.model_head,
        "model_names": arguments.model_names.as_ref().map(|path| path.display().to_string()),
    })
}

/// What the list of vehicles says of an estimate.
#[derive(Serialize, Deserialize)]
pub(super) struct Estimated {
    model: String,
    reprojection_rmse: Option<f64>,
    evidence: [String; 10],
}

impl Estimated {
    pub(super) fn of(estimate: &PoseEstimate) -> Self {
        let reprojection_rmse = estimate.reprojection_rmse;
        Self { model: estimate.model.clone(), reprojection_rmse, evidence: evidence(estimate) }
    }
}

/// The size, and what the dense fit rests its confidence on.
fn evidence(estimate: &PoseEstimate) -> [String; 10] {
    let mut cells = [const { String::new() }; 10];
    let number = |value: f64| format!("{value:.4}");
    let e = &estimate.extent;
    let [width, height, length] = [e.width, e.height, e.length].map(number);
    cells[..3].clone_from_slice(&[width, height, length]);
    let Some(report) = &estimate.dense else { return cells };
    let model = report.model_probabilities.get(estimate.model_index).copied();
    let second = report.second_mode.map_or(0.0, |second| second.probability);
    let turn = report.covariance[(1, 1)].sqrt();
    let figures =
        [report.energy, report.foreground, report.overshoot, model.unwrap_or(0.0), second, turn];
    cells[3..9].clone_from_slice(&figures.map(number));
    if let Some(with_size) = &report.covariance_with_size {
        cells[9] = [6, 7, 8].map(|i| number(with_size[(i, i)].sqrt())).join(" ");
    }
    cells
}

/// Every vehicle under the last configuration.
fn vehicle_list(evaluated: &Evaluated) -> Table {
    let columns = [
        "sequence",
        "frame",
        "track",
        "vehicle",
        "model",
        "depth",
        "occluded",
        "truncated",
        "pixel_accuracy",
        "predicted_model",
        "reprojection_rmse",
        "iou3d",
        "delta_x",
        "delta_y",
        "delta_z",
        "delta_alpha_x",
        "delta_alpha_y",
        "delta_alpha_z",
        "confidence",
        "normalised_squared_error",
        "depth_sd",
        "no_pose",
        "width",
        "height",
        "length",
        "energy",
        "foreground",
        "overshoot",
        "model_probability",
        "second_probability",
        "turn_sd",
        "size_sds",
    ];
    let mut table = Table::new("vehicles", &columns);
    for row in evaluated.rows.last().into_iter().flatten() {
        let mut cells = vec![
            row.sequence.clone(),
            row.frame.to_string(),
            row.track.map_or(String::new(), |track| track.to_string()),
            (row.vehicle + 1).to_string(),
            row.model.clone(),
            format!("{:.2}", row.stratum.depth),
            row.stratum.occluded.to_string(),
            row.stratum.truncated.to_string(),
            row.pixel_accuracy.map_or(String::new(), |share| format!("{share:.4}")),
        ];
        match (&row.estimate, &row.scored) {
            (Ok(estimate), Some(d)) => {
                cells.push(estimate.model.clone());
                let rmse = estimate.reprojection_rmse;
                cells.push(rmse.map_or(String::new(), |rmse| format!("{rmse:.3}")));
                let numbers = std::iter::once(d.iou3d).chain(d.translation).chain(d.rotation);
                cells.extend(numbers.map(|value| format!("{value:.4}")));
                let said = row.sureness.map(|s| [s.confidence, s.squared_error, s.depth_sd]);
                match said {
                    Some(said) => cells.extend(said.map(|value| format!("{value:.4}"))),
                    None => cells.extend(std::iter::repeat_n(String::new(), 3)),
                }
                cells.push(String::new());
            }
            (outcome, _) => {
                cells.extend(std::iter::repeat_n(String::new(), 12));
                cells.push(outcome.as_ref().err().cloned().unwrap_or_default());
            }
        }
        match &row.estimate {
            Ok(estimate) => cells.extend(estimate.evidence.clone()),
            Err(_) => cells.extend([const { String::new() }; 10]),
        }
        table.rows.push(cells);
    }
    table
}
