//! `partpose evaluate`: scores poses and solvers against ground truth.

mod pnp;
mod poses;

use crate::report::Outcome;

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Tables III to V: poses of the labelled vehicles of a data set
    Poses(poses::Arguments),
    /// Accuracy and time of the `PnP` solvers on problem sets
    Pnp(pnp::Arguments),
}

pub(crate) fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Poses(arguments) => poses::run(arguments),
        Command::Pnp(arguments) => pnp::run(arguments),
    }
}
