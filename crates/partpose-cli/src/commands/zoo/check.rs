//! `partpose zoo check`: finds what is wrong with models and says what to do.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use partpose::files;
use partpose::vehicle::check::{Finding, Severity, check_model, check_partial};
use partpose::vehicle::{ModelZoo, ZooError, from_partial_glb};

use crate::report::{self, Outcome};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose zoo check zoo-0001")]
pub(crate) struct Arguments {
    /// Folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// End with 1 for warnings too, not for errors only
    #[arg(long)]
    strict: bool,
    /// Write JSON instead of text
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let rows = if let Some(path) = &arguments.zoo {
        check_files(path)?
    } else {
        let models = ModelZoo::embedded().models;
        models.iter().map(|model| Row::new(model.name(), &check_model(model))).collect()
    };
    if arguments.json {
        report::data(&(serde_json::to_string_pretty(&rows)? + "\n"))?;
    } else {
        report::data(&text(&rows))?;
    }
    let findings = || rows.iter().flat_map(|row| &row.findings);
    let count = |severity| findings().filter(|found| found.severity == severity).count();
    let (errors, warnings, notes) =
        (count(Severity::Error), count(Severity::Warning), count(Severity::Note));
    report::note(format_args!(
        "checked {} models: {errors} errors, {warnings} warnings, {notes} notes",
        rows.len()
    ));
    let is_clean = errors == 0 && (warnings == 0 || !arguments.strict);
    Ok(if is_clean { Outcome::Done } else { Outcome::Skipped })
}

/// What is told of a model or a file.
#[derive(serde::Serialize)]
struct Row {
    model: String,
    findings: Vec<Found>,
}

#[derive(serde::Serialize)]
struct Found {
    severity: Severity,
    kind: &'static str,
    finding: String,
    remedy: String,
}

impl Row {
    fn new(model: &str, findings: &[Finding]) -> Self {
        let found = |finding: &Finding| Found {
            severity: finding.severity(),
            kind: finding.kind(),
            finding: finding.to_string(),
            remedy: finding.remedy(),
        };
        Self { model: printable(model), findings: findings.iter().map(found).collect() }
    }

    /// A file that holds no model is the gravest of findings, but the others are checked all the same.
    fn unreadable(error: ZooError) -> Self {
        let name = match &error {
            ZooError::Model { path, .. } => path.display().to_string(),
            _ => String::new(),
        };
        let remedy = error.remedy().unwrap_or_default();
        let finding = format!("{:#}", anyhow::Error::new(error));
        let found = Found { severity: Severity::Error, kind: "unreadable", finding, remedy };
        Self { model: name, findings: vec![found] }
    }
}

fn check_files(path: &Path) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    for file in ModelZoo::files(path)? {
        match from_partial_glb(&files::read(&file).map_err(ZooError::from)?) {
            Ok(model) => rows.push(Row::new(&model.name, &check_partial(&model))),
            Err(source) => rows.push(Row::unreadable(ZooError::Model { path: file, source })),
        }
    }
    Ok(rows)
}

/// A model's name comes from a file, and is written to a terminal.
fn printable(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).collect()
}

fn text(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        if row.findings.is_empty() {
            let _ = writeln!(text, "{}: nothing found", row.model);
            continue;
        }
        let _ = writeln!(text, "{}:", row.model);
        for found in &row.findings {
            let _ = writeln!(text, "  {:<8} {}", found.severity.name(), found.finding);
            if !found.remedy.is_empty() {
                let _ = writeln!(text, "           -> {}", found.remedy);
            }
        }
    }
    text
}
