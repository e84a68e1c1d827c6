//! What a folder of a run holds: scores, tables, the list of vehicles, pictures, results, curves of a training.

use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::eval::{Table, files_with_ending};
use partpose::files;
use partpose::formats::{PosedImage, read_result};
use serde_json::Value;

use super::csv;
use crate::report::hint;

/// Subfolders with pictures of frames and vehicles.
const PICTURES: [&str; 4] = ["explain", "explanations", "pictures", "."];
/// Pictures that the report draws itself.
const DRAWN: [&str; 2] = ["curves", "confusion"];
/// Names of the first column of a curve over the course of a training.
const STEPS: [&str; 4] = ["step", "iteration", "epoch", "images"];

/// A vehicle of an evaluation.
pub(super) struct Vehicle {
    pub(super) frame: String,
    /// Its number in the frame, from 1, where the list tells it.
    pub(super) number: Option<u32>,
    pub(super) model: String,
    pub(super) predicted: Option<String>,
    pub(super) depth: f64,
    /// 3D IoU; `None` without a pose.
    pub(super) iou: Option<f64>,
    pub(super) confidence: Option<f64>,
    pub(super) no_pose: String,
}

/// One folder.
pub(super) struct Run {
    pub(super) name: String,
    pub(super) metrics: Option<Value>,
    pub(super) tables: Vec<Table>,
    pub(super) vehicles: Vec<Vehicle>,
    /// Files `*.png`, those that explain first.
    pub(super) pictures: Vec<PathBuf>,
    pub(super) results: Vec<PosedImage>,
    /// Numbers over steps of a training, with the name of their file.
    pub(super) curves: Vec<Table>,
    /// Counts of what each class was taken for: names before each row and above each column.
    pub(super) confusion: Option<Table>,
    /// Precision over recall of each source of detections.
    pub(super) precision: Option<Table>,
}

/// Reads a folder; one that holds nothing of all that is an error.
pub(super) fn read(path: &Path) -> anyhow::Result<Run> {
    let name = path
        .file_name()
        .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned());
    let metrics = match path.join("metrics.json") {
        file if file.is_file() => {
            let value = serde_json::from_slice(&files::read(&file)?);
            Some(value.with_context(|| format!("`{}` is not JSON", file.display()))?)
        }
        _ => None,
    };
    let pictures = PICTURES
        .iter()
        .filter_map(|name| files_with_ending(&path.join(name), "png").ok())
        .flatten()
        .filter(|path| path.file_stem().is_none_or(|stem| !DRAWN.iter().any(|name| stem == *name)))
        .collect();
    let vehicles = match path.join("vehicles.csv") {
        file if file.is_file() => vehicles(&csv::read(&file)?),
        _ => Vec::new(),
    };
    let Tables { plain: tables, curves, confusion, precision } = tables(path)?;
    let results = results(path)?;
    let run =
        Run { name, metrics, tables, vehicles, pictures, results, curves, confusion, precision };
    let empty = run.metrics.is_none() && run.tables.is_empty() && run.results.is_empty();
    if empty && run.curves.is_empty() && run.confusion.is_none() {
        let error = anyhow::anyhow!("`{}` holds no run and no evaluation", path.display());
        return Err(hint(error, "give the folder that was `--out` of `fit`, `demo` or `evaluate`"));
    }
    Ok(run)
}

/// The tables of a folder, by what is made of them.
#[derive(Default)]
struct Tables {
    plain: Vec<Table>,
    curves: Vec<Table>,
    confusion: Option<Table>,
    precision: Option<Table>,
}

/// Tables with the titles that stand in the Markdown beside them, and what is drawn.
fn tables(path: &Path) -> anyhow::Result<Tables> {
    let markdown = ["tables.md", "table.md", "comparison.md"].map(|name| path.join(name));
    let text = match markdown.iter().find(|file| file.is_file()) {
        Some(file) => files::read_text(file)?,
        None => String::new(),
    };
    let mut titles = text
        .lines()
        .filter_map(|line| line.strip_prefix("**")?.strip_suffix("**").map(str::to_owned));
    let mut found = Tables::default();
    // `table-10.csv` comes after `table-9.csv`.
    let mut paths = files_with_ending(path, "csv")?;
    paths.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    for path in paths {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        if stem == "vehicles" || stem == "results" {
            continue;
        }
        let mut table = csv::read(&path)?;
        let over_steps = table.columns.first().is_some_and(|c| STEPS.contains(&c.as_str()));
        if over_steps {
            table.title = stem;
            found.curves.push(table);
        } else if stem == "confusion" && table.columns.len() == table.rows.len() + 1 {
            found.confusion = Some(table);
        } else if stem == "curves" {
            found.precision = Some(table);
        } else {
            // The titles are those of the numbered ones.
            let numbered = stem.starts_with("table-") || stem.starts_with("comparison-");
            let title = if numbered { titles.next() } else { None };
            table.title = title.unwrap_or(stem);
            found.plain.push(table);
        }
    }
    Ok(found)
}

fn vehicles(table: &Table) -> Vec<Vehicle> {
    let column = |name: &str| csv::column(table, name);
    let [sequence, frame, model, depth] = ["sequence", "frame", "model", "depth"].map(&column);
    let [predicted, iou, confidence, no_pose] =
        ["predicted_model", "iou3d", "confidence", "no_pose"].map(&column);
    let vehicle = |row: &Vec<String>| {
        let text = |at: Option<usize>| at.map_or("", |at| row[at].as_str());
        let number = |at: Option<usize>| text(at).parse::<f64>().ok().filter(|v| v.is_finite());
        let index: u32 = text(frame).parse().unwrap_or(0);
        Vehicle {
            frame: format!("{}/{index:05}", text(sequence)),
            number: text(column("vehicle")).parse().ok(),
            model: text(model).to_owned(),
            predicted: Some(text(predicted).to_owned()).filter(|name| !name.is_empty()),
            depth: number(depth).unwrap_or(0.0),
            iou: number(iou),
            confidence: number(confidence),
            no_pose: text(no_pose).to_owned(),
        }
    };
    table.rows.iter().map(vehicle).collect()
}

/// The results of `fit`; other JSON is passed over.
fn results(path: &Path) -> anyhow::Result<Vec<PosedImage>> {
    let category = |_: &str| "Car".to_owned();
    let paths = files_with_ending(path, "json")?;
    Ok(paths.iter().filter_map(|path| read_result(path, &category).ok()).collect())
}
