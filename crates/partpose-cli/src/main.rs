//! The `partpose` command line: parses what was typed, calls the library, reports.

mod camera;
mod commands;
mod device;
mod network;
mod pose_flags;
mod progress;
mod report;
mod scene_flags;
mod side_by_side;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

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
    /// Draw why each vehicle was found where it was, and how sure that is
    Explain(commands::explain::Arguments),
    /// Write the results of `fit` in other programs' formats
    Export(commands::export::Arguments),
    /// Train a network
    Train(commands::train::Arguments),
    /// Convert and inspect a network's weights
    #[command(subcommand)]
    Weights(commands::weights::Command),
    /// Write results as a page in 3D that opens without a network
    View(commands::view::Arguments),
    /// Write runs and evaluations as one page that opens without a network
    Report(commands::report::Arguments),
    /// Score boxes, masks, poses and solvers against ground truth
    #[command(subcommand)]
    Evaluate(commands::evaluate::Command),
    /// Answer images over HTTP: KServe V2, and a plain endpoint
    #[cfg(feature = "serve")]
    Serve(commands::serve::Arguments),
    /// Print the completions of a shell
    Completions(commands::completions::Arguments),
    /// Write manual pages
    Man(commands::completions::ManArguments),
}

fn main() -> ExitCode {
    let outcome = match Arguments::parse().command {
        Command::Demo(arguments) => commands::demo::run(&arguments),
        Command::Zoo(command) => commands::zoo::run(&command),
        Command::Dataset(command) => commands::dataset::run(&command),
        Command::Label(arguments) => commands::label::run(&arguments),
        Command::Synth(arguments) => commands::synth::run(&arguments),
        Command::Run(arguments) => commands::run::run(&arguments),
        Command::Fit(arguments) => commands::fit::run(&arguments),
        Command::Explain(arguments) => commands::explain::run(&arguments),
        Command::Export(arguments) => commands::export::run(&arguments),
        Command::Train(arguments) => commands::train::run(&arguments),
        Command::Weights(command) => commands::weights::run(&command),
        Command::View(arguments) => commands::view::run(&arguments),
        Command::Report(arguments) => commands::report::run(&arguments),
        #[cfg(feature = "serve")]
        Command::Serve(arguments) => commands::serve::run(&arguments),
        Command::Evaluate(command) => commands::evaluate::run(&command),
        Command::Completions(arguments) => {
            commands::completions::run(&arguments, Arguments::command())
        }
        Command::Man(arguments) => commands::completions::man(&arguments, Arguments::command()),
    };
    report::exit_code(outcome)
}
