//! `partpose zoo list`: what models a zoo holds.

use std::fmt::Write;
use std::path::PathBuf;

use partpose::geometry::Extent;
use partpose::parts::PartClass;
use partpose::vehicle::VehicleModel;

use crate::report::{self, Outcome};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose zoo list
  partpose zoo list zoo-0001")]
pub(crate) struct Arguments {
    /// Folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// Write JSON instead of a table
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = super::open(arguments.zoo.as_deref())?;
    let rows: Vec<Row> = zoo.models.iter().map(Row::new).collect();
    if arguments.json {
        report::data(&(serde_json::to_string_pretty(&rows)? + "\n"))?;
    } else {
        report::data(&table(&rows))?;
    }
    Ok(Outcome::Done)
}

/// What is told of a model.
#[derive(serde::Serialize)]
struct Row<'a> {
    name: &'a str,
    category: &'a str,
    body_style: &'a str,
    /// Metres.
    extent: Extent,
    vertices: usize,
    faces: usize,
    missing_parts: Vec<PartClass>,
}

impl<'a> Row<'a> {
    fn new(model: &'a VehicleModel) -> Self {
        Self {
            name: model.name(),
            category: model.category(),
            body_style: model.body_style(),
            extent: model.extent(),
            vertices: model.mesh().vertices.len(),
            faces: model.mesh().faces.len(),
            missing_parts: model.missing_parts(),
        }
    }
}

fn table(rows: &[Row]) -> String {
    let header =
        ["name", "category", "body style", "width", "height", "length", "faces", "missing"];
    let mut lines = vec![header.map(str::to_owned)];
    for row in rows {
        let metres = |value: f64| format!("{value:.2}");
        let missing: Vec<_> = row.missing_parts.iter().map(|part| part.name()).collect();
        lines.push([
            row.name.to_owned(),
            row.category.to_owned(),
            row.body_style.to_owned(),
            metres(row.extent.width),
            metres(row.extent.height),
            metres(row.extent.length),
            row.faces.to_string(),
            if missing.is_empty() { "-".to_owned() } else { missing.join(" ") },
        ]);
    }
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max();
    let widths: Vec<usize> = (0..header.len()).map(|column| width(column).unwrap_or(0)).collect();
    let mut text = String::new();
    for line in &lines {
        let mut row = String::new();
        for (column, (cell, width)) in line.iter().zip(&widths).enumerate() {
            // Text to the left, numbers to the right.
            let _ = if (3..7).contains(&column) {
                write!(row, "{cell:>width$}  ")
            } else {
                write!(row, "{cell:<width$}  ")
            };
        }
        text += row.trim_end();
        text += "\n";
    }
    text
}
