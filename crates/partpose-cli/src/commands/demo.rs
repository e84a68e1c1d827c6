//! `partpose demo`: the main job on what the repository ships.

use std::path::PathBuf;

use crate::report::Outcome;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder for pictures and results
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let _ = &arguments.out;
    anyhow::bail!("to be written")
}
