//! (to be written)

use crate::report::Outcome;

#[derive(clap::Args)]
pub(crate) struct Arguments {}

pub(crate) fn run(_arguments: &Arguments) -> anyhow::Result<Outcome> {
    anyhow::bail!("to be written")
}
