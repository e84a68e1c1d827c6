//! `partpose synth`: makes a synthetic labelled data set, checks one, draws sheets of it, says how it is distributed.

mod make;
mod sheet;
mod statistics;
mod verify;

use crate::report::{Outcome, hint};

use partpose_synth::dataset::SynthError;

#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = make::EXAMPLES
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    make: make::Arguments,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Check that parts, segmentation, cuboids and labels made anew agree in every pixel
    Verify(verify::Arguments),
    /// Say how a data set is distributed: shares of parts, distances, occlusion, truncation
    Statistics(statistics::Arguments),
    /// Draw all variations side by side, as pictures and with their part labels
    Sheet(sheet::Arguments),
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    match &arguments.command {
        Some(Command::Verify(arguments)) => verify::run(arguments),
        Some(Command::Statistics(arguments)) => statistics::run(arguments),
        Some(Command::Sheet(arguments)) => sheet::run(arguments),
        None => make::run(&arguments.make),
    }
}

/// Says what can be done about an error.
fn advised(error: SynthError) -> anyhow::Error {
    let remedy = match &error {
        SynthError::Exists { .. } => "add `--resume` to go on with it, or choose an empty folder",
        SynthError::Foreign { .. } => "choose a new or empty folder",
        SynthError::OtherOptions { .. } => {
            "repeat the options it was begun with, or choose an empty folder"
        }
        SynthError::Manifest { .. } => "choose an empty folder, or remove this one",
        SynthError::ModelName { .. } => "rename the model",
        SynthError::NotSynthetic { .. } => {
            "`partpose dataset check DIR` tells what the folder holds"
        }
        SynthError::File(partpose::files::FileError::Write { .. }) => {
            "see that the folder may be written and the disk has room, then repeat the command with `--resume`: \
             frames that are whole are kept"
        }
        SynthError::File(partpose::files::FileError::NotAFolder { .. }) => {
            "choose a folder that is new or empty"
        }
        _ => return error.into(),
    };
    hint(error, remedy)
}
