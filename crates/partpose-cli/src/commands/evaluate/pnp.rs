//! `partpose evaluate pnp`: accuracy and time of the `PnP` solvers on problem sets.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use anyhow::Context;
use partpose::{
    eval::pnp::{
        Baseline, CellScores, Metrics, ProblemSet, Solver, evaluate, read_problem_set, targets,
        to_csv, to_markdown,
    },
    files,
};

use crate::report::{self, Outcome};

/// Reference scores, beside the problem sets.
const BASELINE: &str = "baseline.json";

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose evaluate pnp --problems problems --out scores")]
pub(crate) struct Arguments {
    /// Folder with one `.safetensors` file per cell, and perhaps `baseline.json`
    #[arg(long, value_name = "DIR")]
    problems: PathBuf,
    /// Folder to write `metrics.json`, `table.md` and `table.csv` to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Score only the cells whose names contain this
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let cells = cells(&arguments.problems, &arguments.only)?;
    let baseline = read_baseline(&arguments.problems)?;
    let mut metrics = Metrics::default();
    let mut skipped = 0;
    for path in &cells {
        match read_problem_set(path) {
            Ok(set) => {
                let scores = score(&set);
                metrics.cells.insert(set.name, scores);
            }
            Err(error) => {
                skipped += 1;
                report::warn_error("skipped a cell", &error);
            }
        }
    }
    if metrics.cells.is_empty() {
        anyhow::bail!("none of the {} problem sets could be read", cells.len());
    }
    let json = serde_json::to_vec_pretty(&metrics).context("cannot write the scores as JSON")?;
    files::write(&arguments.out.join("metrics.json"), &json)?;
    let markdown = to_markdown(&metrics, baseline.as_ref());
    files::write(&arguments.out.join("table.md"), markdown.as_bytes())?;
    files::write(&arguments.out.join("table.csv"), to_csv(&metrics).as_bytes())?;
    report::note(format_args!("scored {} cells, skipped {skipped}", metrics.cells.len()));
    if let Some(baseline) = baseline {
        let targets = targets(&metrics, &baseline);
        let held = targets.iter().filter(|target| target.holds()).count();
        report::note(format_args!("{held} of {} targets hold", targets.len()));
    }
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

/// The problem sets of a folder, by name.
fn cells(folder: &Path, only: &str) -> anyhow::Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder)
        .with_context(|| format!("cannot read the folder `{}`", folder.display()))?;
    let mut cells = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| format!("cannot list `{}`", folder.display()))?.path();
        let is_set = path.extension().is_some_and(|ending| ending == "safetensors");
        let chosen = path.file_stem().is_some_and(|stem| stem.to_string_lossy().contains(only));
        if is_set && chosen {
            cells.push(path);
        }
    }
    cells.sort();
    if cells.is_empty() {
        let pattern = if only.is_empty() { String::new() } else { format!("{only}*") };
        let error =
            anyhow::anyhow!("no problem set `*{pattern}.safetensors` in `{}`", folder.display());
        return Err(report::hint(
            error,
            "give the folder that holds the cells' files as `--problems`",
        ));
    }
    Ok(cells)
}

fn read_baseline(folder: &Path) -> anyhow::Result<Option<Baseline>> {
    let path = folder.join(BASELINE);
    if !path.exists() {
        return Ok(None);
    }
    let text = files::read_text(&path)?;
    let baseline = serde_json::from_str(&text)
        .with_context(|| format!("cannot understand the reference scores `{}`", path.display()))?;
    Ok(Some(baseline))
}

fn score(set: &ProblemSet) -> CellScores {
    let solvers: BTreeMap<_, _> = Solver::ALL
        .iter()
        .map(|solver| (solver.name().to_owned(), evaluate(set, *solver)))
        .collect();
    CellScores {
        geometry: set.geometry.clone(),
        n: set.points,
        sigma_px: set.sigma_px,
        outlier_fraction: set.outlier_fraction,
        trials: set.problems.len(),
        solvers,
    }
}
