//! `partpose synth`.

use crate::report::Outcome;

#[derive(clap::Args)]
pub(crate) struct Arguments {}

#[expect(clippy::unnecessary_wraps, reason = "as every command")]
pub(crate) fn run(_: &Arguments) -> anyhow::Result<Outcome> {
    Ok(Outcome::Done)
}
