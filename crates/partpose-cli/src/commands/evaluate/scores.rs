//! What the evaluators of the public benchmarks share: finding their folders, writing what they find.

use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::eval::{Table, files_with_ending};
use partpose::files::{self, RgbImage};
use partpose::formats::{PosedImage, read_result};

use crate::report::{self, Outcome, hint, note, warn};

/// Where labels, results and scores lie; the same for all of them.
#[derive(clap::Args)]
pub(crate) struct Places {
    /// Folder, or where it is one file the file, of the labels
    #[arg(long, value_name = "DIR")]
    pub(crate) labels: PathBuf,
    /// Folder, or where it is one file the file, of the results
    #[arg(long, value_name = "DIR")]
    pub(crate) results: PathBuf,
    /// Folder to write `metrics.json`, tables and curves to
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

/// The folder itself if it holds files of this ending, else the first of its subfolders that does.
pub(crate) fn folder_with(given: &Path, ending: &str, subfolders: &[&str]) -> PathBuf {
    let holds =
        |folder: &Path| files_with_ending(folder, ending).is_ok_and(|files| !files.is_empty());
    if holds(given) {
        return given.to_owned();
    }
    let found = subfolders.iter().map(|name| given.join(name)).find(|folder| holds(folder));
    found.unwrap_or_else(|| given.to_owned())
}

/// The file itself, or the only one of this ending in the folder.
pub(crate) fn only_file(given: &Path, ending: &str, flag: &str) -> anyhow::Result<PathBuf> {
    if !given.is_dir() {
        return Ok(given.to_owned());
    }
    let mut found = files_with_ending(given, ending)?;
    match (found.len(), found.pop()) {
        (1, Some(path)) => Ok(path),
        (count, _) => Err(hint(
            anyhow::anyhow!("`{}` holds {count} files `*.{ending}`, not one", given.display()),
            format!("give the file itself as `{flag}`"),
        )),
    }
}

/// The results of `fit`, if that is what the folder or file holds: one prediction file for every evaluator.
///
/// An evaluator scores all or nothing, so one that cannot be read is an error.
pub(crate) fn own_results(given: &Path) -> anyhow::Result<Option<Vec<PosedImage>>> {
    let mut paths =
        if given.is_dir() { files_with_ending(given, "json")? } else { vec![given.to_owned()] };
    let category = |_: &str| "Car".to_owned();
    paths.retain(|path| {
        path.file_name().is_none_or(|name| name != "metrics.json" && name != "run.json")
    });
    if paths.first().is_none_or(|path| read_result(path, &category).is_err()) {
        return Ok(None);
    }
    let images: Result<Vec<_>, _> = paths.iter().map(|path| read_result(path, &category)).collect();
    Ok(Some(images?))
}

/// The first of the places beside or above a folder where a file is.
pub(crate) fn nearby(folder: &Path, name: &str) -> Option<PathBuf> {
    let absolute = std::path::absolute(folder).ok()?;
    absolute.ancestors().take(3).map(|folder| folder.join(name)).find(|path| path.exists())
}

/// Writes `metrics.json`, `table.md`, `table-N.csv` and `curves.png`, and the tables to stdout.
pub(crate) fn write(
    out: &Path,
    metrics: &serde_json::Value,
    tables: &[Table],
    curves: &RgbImage,
) -> anyhow::Result<()> {
    files::write_png(&out.join("curves.png"), curves)?;
    write_tables(out, metrics, tables)
}

/// The same without curves.
pub(crate) fn write_tables(
    out: &Path,
    metrics: &serde_json::Value,
    tables: &[Table],
) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(metrics).context("the metrics are no JSON")?;
    files::write(&out.join("metrics.json"), json.as_bytes())?;
    let text = tables.iter().map(Table::to_markdown).collect::<Vec<_>>().join("\n");
    files::write(&out.join("table.md"), text.as_bytes())?;
    for (index, table) in tables.iter().enumerate() {
        let name = format!("table-{}.csv", index + 1);
        files::write(&out.join(name), table.to_csv().as_bytes())?;
    }
    report::data(&text)
}

/// Says what was scored; something left out makes the exit code 1.
#[expect(clippy::unnecessary_wraps, reason = "commands end in it")]
pub(crate) fn finish(
    out: &Path,
    scored: &str,
    left_out: &[(usize, &str)],
) -> anyhow::Result<Outcome> {
    note(format_args!("scored {scored}; wrote metrics, tables and curves to `{}`", out.display()));
    let mut outcome = Outcome::Done;
    for (count, what) in left_out.iter().filter(|(count, _)| *count > 0) {
        warn(format_args!("left out {count} {what}"));
        outcome = Outcome::Skipped;
    }
    Ok(outcome)
}

/// A share of 1 in percent, or a dash.
pub(crate) fn percent(value: Option<f64>) -> String {
    cell(value.map(|value| 100.0 * value))
}

/// A number with the digits of the benchmarks' own tables, or a dash.
pub(crate) fn cell(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.4}"))
}
