//! Checking a data set's labels against each other.

use std::fmt::Write;
use std::path::PathBuf;

use partpose_synth::dataset::{Verified, verify};

use super::advised;
use crate::report::{self, Outcome, note};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose synth verify world")]
pub(super) struct Arguments {
    /// Folder that `partpose synth` wrote
    #[arg(value_name = "DIR")]
    dataset: PathBuf,
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let sequences = verify(&arguments.dataset).map_err(advised)?;
    let mut text = format!(
        "{:<20}{:>8}{:>16}{:>14}{:>8}{:>10}{:>12}{:>12}\n",
        "sequence",
        "frames",
        "vehicle pixels",
        "without part",
        "stray",
        "outside",
        "relabelled",
        "and blind"
    );
    let mut line = |name: &str, counts: &Verified| {
        let _ = writeln!(
            text,
            "{name:<20}{:>8}{:>16}{:>14}{:>8}{:>10}{:>12}{:>12}",
            counts.frames,
            counts.vehicle,
            counts.without_part,
            counts.stray,
            counts.outside,
            counts.relabelled,
            counts.relabelled_blind
        );
    };
    let mut sum = Verified::default();
    for (id, counts) in &sequences {
        line(&id.to_string(), counts);
        sum = sum.plus(*counts);
    }
    line("all", &sum);
    report::data(&text)?;
    if sum.is_clean() {
        note(format_args!(
            "parts, segmentation, cuboids and labels made anew agree in every pixel"
        ));
        return Ok(Outcome::Done);
    }
    note(format_args!(
        "{} vehicle pixels lack a part, {} other pixels have one, {} lie beside their cuboid, {} change when labelled \
         anew",
        sum.without_part, sum.stray, sum.outside, sum.relabelled
    ));
    Ok(Outcome::Skipped)
}
