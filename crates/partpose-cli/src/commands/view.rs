//! `partpose view`: results as one page in 3D that opens without a network.

use std::path::PathBuf;

use partpose::files;
use partpose::formats::PosedImage;
use partpose::vehicle::ModelZoo;
use partpose::viz::scene_page;

use crate::commands::export::{read_results, scene};
use crate::report::{Outcome, hint, note};

/// Most images that a page holds: each brings its picture.
const MOST_IMAGES: usize = 2000;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  partpose view out/demo --images out/demo/images --truth out/demo/truth --out view.html
  partpose view out/fit --zoo zoo --images frames --out view.html

Other programs' results become ours with `partpose export --from FORMAT --to results`.")]
pub(crate) struct Arguments {
    /// Results of `fit`: JSON files, or folders of them
    #[arg(required = true, value_name = "RESULTS")]
    results: Vec<PathBuf>,
    /// Zoo of the results' models; the embedded one if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Show vehicles where `--track` of `run` or `fit` has them, not their frames alone
    #[arg(long)]
    tracked: bool,
    #[command(flatten)]
    scene: scene::SceneFlags,
    /// Title of the page
    #[arg(long, default_value = "partpose")]
    title: String,
    /// The page to write
    #[arg(long, value_name = "FILE", default_value = "view.html")]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = match &arguments.zoo {
        Some(folder) => ModelZoo::load(folder)?,
        None => ModelZoo::embedded(),
    };
    let (mut images, mut skipped): (Vec<PosedImage>, usize) = Default::default();
    for path in &arguments.results {
        let (more, bad) = read_results(path, Some(&zoo))?;
        images.extend(more);
        skipped += bad;
    }
    if images.len() > MOST_IMAGES {
        let count = images.len();
        let error = anyhow::anyhow!("{count} images are more than the {MOST_IMAGES} of a page");
        return Err(hint(error, "name some of the result files"));
    }
    if arguments.tracked {
        images = images.into_iter().map(scene::as_tracked).collect();
    }
    let known = |name: &str| zoo.get(name).is_some();
    let vehicles = || images.iter().flat_map(|image| &image.vehicles);
    let boxes = vehicles().filter(|vehicle| !known(&vehicle.model)).count();
    let count = vehicles().count();
    let frames = scene::frames(images, &arguments.scene)?;
    let page = scene_page(&arguments.title, &frames, &zoo);
    files::write(&arguments.out, page.as_bytes())?;
    if boxes > 0 {
        note(format_args!("{boxes} vehicles are boxes: the zoo does not have their models"));
    }
    note(format_args!(
        "wrote {count} vehicles of {} images to `{}`",
        frames.len(),
        arguments.out.display()
    ));
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}
