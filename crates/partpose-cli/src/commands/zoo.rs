//! `partpose zoo`: makes and inspects annotated models.

mod annotate;
mod carve;
mod carve_report;
mod check;
mod compare;
mod generate;
mod import;
mod list;
mod show;

use std::path::Path;

use partpose::vehicle::{ModelZoo, ZooError};

use crate::report::Outcome;

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// List the models of a zoo
    List(list::Arguments),
    /// Draw a turntable of a model
    Show(show::Arguments),
    /// Find what is wrong with models and say what to do
    Check(check::Arguments),
    /// Compare models with the part masks of vehicles that they stand in for
    Compare(compare::Arguments),
    /// Write the procedural models
    Generate(generate::Arguments),
    /// Read a CAD model and give its parts their classes by name
    Import(import::Arguments),
    /// Transfer part labels to a model from the nearest labelled one
    Annotate(annotate::Arguments),
    /// Build annotated models from part masks with known poses
    Carve(carve::Arguments),
}

pub(crate) fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::List(arguments) => list::run(arguments),
        Command::Show(arguments) => show::run(arguments),
        Command::Check(arguments) => check::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        Command::Generate(arguments) => generate::run(arguments),
        Command::Import(arguments) => import::run(arguments),
        Command::Annotate(arguments) => annotate::run(arguments),
        Command::Carve(arguments) => carve::run(arguments),
    }
}

/// The zoo at a path; without one, the models that come with the program.
fn open(path: Option<&Path>) -> Result<ModelZoo, ZooError> {
    path.map_or_else(|| Ok(ModelZoo::embedded()), ModelZoo::load)
}
