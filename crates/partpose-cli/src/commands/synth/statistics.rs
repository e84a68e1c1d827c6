//! How a data set is distributed.

use std::path::PathBuf;

use partpose::dataset::Dataset;
use partpose_synth::dataset::{statistics, statistics_beside, statistics_table};

use crate::report::{self, Outcome};

#[derive(clap::Args)]
#[command(after_help = "\
Example:
  partpose synth statistics world --against vkitti")]
pub(super) struct Arguments {
    /// Folder of a data set with part masks
    #[arg(value_name = "DIR")]
    dataset: PathBuf,
    /// Another data set beside it; of two with the same sequences, as one made by the other's
    /// layout, only the frames that both have are counted
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let text = if let Some(path) = &arguments.against {
        let [own, other] = statistics_beside(&dataset, &Dataset::open(path)?)?;
        statistics_table(&[("this", &own), ("against", &other)])
    } else {
        statistics_table(&[("this", &statistics(&dataset)?)])
    };
    report::data(&text)?;
    Ok(Outcome::Done)
}
