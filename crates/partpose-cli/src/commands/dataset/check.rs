//! `partpose dataset check`: what a data set folder holds and what is wrong with it.

use std::fmt::Write;
use std::path::PathBuf;

use partpose::dataset::check::{self, CheckOptions, CheckReport, SequenceReport};
use partpose::dataset::{Dataset, DatasetOptions};

use crate::report::{self, Outcome};

/// Problems written out; more are counted.
const SHOWN: usize = 50;

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose dataset check vkitti")]
pub(crate) struct Arguments {
    /// Folder in the layout of Virtual KITTI 1.3.1 or 2.0.3 or KITTI object
    #[arg(value_name = "DIR")]
    dataset: PathBuf,
    /// Decode every part mask, not eight of each sequence
    #[arg(long)]
    deep: bool,
    /// Rows to list whose boxes fit worst, in each sequence
    #[arg(long, value_name = "N", default_value_t = 10)]
    worst: usize,
    /// Camera of Virtual KITTI 2
    #[arg(long, value_name = "N", default_value_t = 0)]
    camera: u32,
    /// Write JSON instead of tables
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let options = DatasetOptions { camera: arguments.camera };
    let dataset = Dataset::open_with(&arguments.dataset, options)?;
    let defaults = CheckOptions::default();
    let options = CheckOptions {
        masks: if arguments.deep { None } else { defaults.masks },
        worst: arguments.worst,
    };
    let report = check::check(&dataset, &options, &mut |_| {});
    if arguments.json {
        report::data(&(serde_json::to_string_pretty(&report)? + "\n"))?;
    } else {
        report::data(&tables(&report))?;
    }
    for problem in report.problems.iter().take(SHOWN) {
        report::warn(problem);
    }
    let problems = report.problems.len() + report.problems_omitted;
    if problems > SHOWN {
        let more = if arguments.json { "" } else { "; `--json` lists up to 1000 a sequence" };
        report::warn(format_args!("{} problems more{more}", problems - SHOWN));
    }
    let frames: usize = report.sequences.iter().map(|sequence| sequence.frames).sum();
    let skipped: usize = report.sequences.iter().map(|sequence| sequence.skipped).sum();
    report::note(format_args!(
        "checked {frames} frames of {} sequences: {problems} problems, {skipped} frames to skip",
        dataset.sequences().len()
    ));
    Ok(if report.is_clean() { Outcome::Done } else { Outcome::Skipped })
}

fn tables(report: &CheckReport) -> String {
    let mut text = format!("{}\n\n", report.layout);
    let header = [
        "sequence", "frames", "skipped", "rows", "counted", "vehicles", "boxes", "mean px",
        "max px", "rgb", "masks", "stray %",
    ];
    let rows: Vec<Vec<String>> = report.sequences.iter().map(sequence_row).collect();
    text += &table(&header, &rows);
    text += "\n";
    text += &table(&["category", "model", "rows", "counted", "vehicles"], &model_rows(report));
    if !report.missing.is_empty() {
        text += "\n";
    }
    for missing in &report.missing {
        let _ = writeln!(text, "{}: {}", missing.what, missing.consequence);
    }
    text
}

fn sequence_row(sequence: &SequenceReport) -> Vec<String> {
    let name = match sequence.variation.as_str() {
        "" => sequence.world.clone(),
        variation => format!("{}/{variation}", sequence.world),
    };
    let mut row = vec![name];
    row.extend(
        [sequence.frames, sequence.skipped, sequence.rows, sequence.rows_counted, sequence.tracks]
            .map(|count| count.to_string()),
    );
    match sequence.reprojection {
        Some(errors) => row.extend([
            errors.boxes.to_string(),
            format!("{:.2}", errors.mean),
            format!("{:.2}", errors.max),
        ]),
        None => row.extend(["0", "-", "-"].map(str::to_owned)),
    }
    let archives = &sequence.archives;
    row.extend([archives.images.to_string(), archives.parts.to_string()]);
    row.push(if archives.mask_pixels == 0 {
        "-".to_owned()
    } else {
        let share = archives.mask_pixels_outside as f64 / archives.mask_pixels as f64;
        format!("{:.3}", 100.0 * share)
    });
    row
}

/// Categories and models over all sequences.
fn model_rows(report: &CheckReport) -> Vec<Vec<String>> {
    let mut models: Vec<check::ModelReport> = Vec::new();
    for model in report.sequences.iter().flat_map(|sequence| &sequence.models) {
        let same = |other: &&mut check::ModelReport| {
            other.category == model.category && other.model == model.model
        };
        if let Some(sum) = models.iter_mut().find(same) {
            sum.rows += model.rows;
            sum.rows_counted += model.rows_counted;
            sum.tracks += model.tracks;
        } else {
            models.push(model.clone());
        }
    }
    models.sort_by(|a, b| (&a.category, &a.model).cmp(&(&b.category, &b.model)));
    let row = |model: check::ModelReport| {
        let counts = [model.rows, model.rows_counted, model.tracks].map(|count| count.to_string());
        let names = [model.category, model.model.unwrap_or_else(|| "-".to_owned())];
        names.into_iter().chain(counts).collect()
    };
    models.into_iter().map(row).collect()
}

/// Columns as wide as they need to be; the first to the left, numbers to the right.
fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let mut widths: Vec<usize> = header.iter().map(|name| name.chars().count()).collect();
    for row in rows {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut left = vec![false; header.len()];
    for (at, left) in left.iter_mut().enumerate() {
        *left = rows.iter().any(|row| row[at].starts_with(char::is_alphabetic)) || at == 0;
    }
    let mut text = String::new();
    let header: Vec<String> = header.iter().map(ToString::to_string).collect();
    for row in std::iter::once(&header).chain(rows) {
        let mut line = String::new();
        for ((cell, width), left) in row.iter().zip(&widths).zip(&left) {
            let cell = if *left { format!("{cell:<width$}") } else { format!("{cell:>width$}") };
            line += &cell;
            line += "  ";
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}
