//! Contact sheets.

use std::path::PathBuf;

use partpose_synth::dataset::contact_sheets;

use super::advised;
use crate::report::{Outcome, note};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose synth sheet world --out sheet")]
pub(super) struct Arguments {
    /// Folder of a data set with images and part masks
    #[arg(value_name = "DIR")]
    dataset: PathBuf,
    /// Where the sheets go: `NAME-rgb.jpg` and `NAME-parts.jpg`
    #[arg(long, value_name = "NAME")]
    out: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    for file in contact_sheets(&arguments.dataset, &arguments.out).map_err(advised)? {
        note(format_args!("drew `{}`", file.display()));
    }
    Ok(Outcome::Done)
}
