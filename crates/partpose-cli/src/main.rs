//! The `partpose` command line: parses what was typed, calls the library, reports.

mod camera;
mod commands;
mod network;
mod pose_flags;
mod progress;
mod report;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

/// Six-degree-of-freedom vehicle poses from part masks.
#[derive(Parser)]
#[command(name = "partpose", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run the main job on what the repository ships
    Demo(commands::demo::Arguments),
    /// Make and inspect annotated vehicle models
    #[command(subcommand)]
    Zoo(commands::zoo::Command),
    /// Inspect data sets
    #[command(subcommand)]
    Dataset(commands::dataset::Command),
    /// Make part labels for a boxed data set
    Label(commands::label::Arguments),
    /// Make a synthetic labelled data set
    Synth(commands::synth::Arguments),
    /// Find vehicles and their poses in images
    Run(commands::run::Arguments),
    /// Turn anybody's detections into poses
    Fit(commands::fit::Arguments),
    /// Write the results of `fit` in other programs' formats
    Export(commands::export::Arguments),
    /// Train a network
    Train(commands::train::Arguments),
    /// Convert and inspect a network's weights
    #[command(subcommand)]
    Weights(commands::weights::Command),
    /// Score boxes, masks, poses and solvers against ground truth
    #[command(subcommand)]
    Evaluate(commands::evaluate::Command),
}

fn main() -> ExitCode {
    // The paper's fit is the default of `fit`, which reproduces its tables; whoever has an image wants the best.
    let best = |run: clap::Command| run.mut_arg("fit", |fit| fit.default_value("dense"));
    let typed = Arguments::command().mut_subcommand("run", best).get_matches();
    let arguments = Arguments::from_arg_matches(&typed).unwrap_or_else(|error| error.exit());
    let outcome = match arguments.command {
        Command::Demo(arguments) => commands::demo::run(&arguments),
        Command::Zoo(command) => commands::zoo::run(&command),
        Command::Dataset(command) => commands::dataset::run(&command),
        Command::Label(arguments) => commands::label::run(&arguments),
        Command::Synth(arguments) => commands::synth::run(&arguments),
        Command::Run(arguments) => commands::run::run(&arguments),
        Command::Fit(arguments) => commands::fit::run(&arguments),
        Command::Export(arguments) => commands::export::run(&arguments),
        Command::Train(arguments) => commands::train::run(&arguments),
        Command::Weights(command) => commands::weights::run(&command),
        Command::Evaluate(command) => commands::evaluate::run(&command),
    };
    report::exit_code(outcome)
}
