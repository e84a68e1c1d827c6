//! `partpose dataset`: inspects data sets.

mod check;

use crate::report::Outcome;

#[derive(clap::Subcommand)]
pub(crate) enum Command {
    /// Say what a data set folder holds and what is wrong with it
    Check(check::Arguments),
}

pub(crate) fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Check(arguments) => check::run(arguments),
    }
}
