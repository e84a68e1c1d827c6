//! `partpose report`: runs and evaluations as one page that opens without a network.

mod csv;
mod folder;
mod gallery;
mod page;
mod paper;
mod plots;

use std::path::PathBuf;

use partpose::files;

use crate::report::{Outcome, note};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  partpose report out/evaluation --out report.html
  partpose explain ... --out out/evaluation/explain    its pictures are then shown
  partpose report out/epnp out/dense --title \"EPnP and the dense fit\" --out report.html

Any folder that `fit`, `demo` or `evaluate` wrote can be given; several are laid beside each other.")]
pub(crate) struct Arguments {
    /// Folders of runs and evaluations
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Title of the page
    #[arg(long, default_value = "partpose report")]
    title: String,
    /// Most vehicles in each row of the gallery: best, median, worst
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=50))]
    gallery: u32,
    /// The page to write
    #[arg(long, value_name = "FILE", default_value = "report.html")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let runs: Vec<folder::Run> =
        arguments.runs.iter().map(|path| folder::read(path)).collect::<Result<_, _>>()?;
    let html = page::page(&arguments.title, &runs, arguments.gallery as usize)?;
    files::write(&arguments.out, html.as_bytes())?;
    note(format_args!("wrote the report of {} runs to `{}`", runs.len(), arguments.out.display()));
    Ok(Outcome::Done)
}
