//! `partpose fit`: anybody's detections to poses.

use std::path::{Component, Path, PathBuf};

use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose::formats::DetectionFile;
use partpose::geometry::Camera;
use partpose::labeling::Shard;
use rayon::prelude::*;

use crate::camera::load_camera;
use crate::commands::detection_files;
use crate::commands::fitting::{Counts, FitFlags, Fitter, Fitting};
use crate::commands::result_files;
use crate::commands::tracking::{self, TrackFlags};
use crate::progress;
use crate::report::{Outcome, note, warn};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose fit --detections detections.safetensors --camera camera.toml --fit dense --out poses
  partpose fit --detections run/detections --camera calib/000001.txt --images image_2 --out poses
  partpose fit --detections run/detections --camera camera.toml --track --fps 25 --out poses")]
pub(crate) struct Arguments {
    /// Detections: safetensors with `boxes`, `scores` and `part_probabilities` (docs/formats.md), or a folder of such
    /// files
    #[arg(long, value_name = "FILE")]
    detections: PathBuf,
    /// Camera: TOML, KITTI calib, or the folder of a data set
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// Leave out detections with a lower score
    #[arg(long, value_name = "SCORE", default_value_t = 0.0, value_parser = crate::commands::fitting::parse_score)]
    min_score: f64,
    /// Folder of the images named in the detections, to draw on
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    #[command(flatten)]
    fit: FitFlags,
    #[command(flatten)]
    track: TrackFlags,
    /// Do part I of N of the images; all parts may write to the same folder
    #[arg(long, value_name = "I/N", conflicts_with = "track")]
    shard: Option<Shard>,
    /// Folder for results: one JSON, one KITTI text and one picture an image
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// The detections of one image.
struct ImageDetections {
    name: String,
    stem: String,
    detections: Vec<Detection>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let file = detection_files::read(&arguments.detections)?;
    let fitter = Fitter::new(&arguments.fit, &arguments.out)?;
    let camera = load_camera(&arguments.camera)?;
    let mut by_image = by_image(file, arguments.min_score)?;
    if let Some(shard) = &arguments.shard {
        let mut index = 0..;
        by_image.retain(|_| index.next().is_some_and(|index| shard.has(index)));
    }
    files::create_folder(&arguments.out)?;
    let frame = |image: &ImageDetections| tracking::Frame {
        name: image.name.clone(),
        stem: image.stem.clone(),
        world_from_camera: None,
    };
    let frames: Vec<tracking::Frame> = by_image.iter().map(frame).collect();
    let bar = progress::bar("images", by_image.len() as u64);
    let done: Vec<anyhow::Result<Counts>> = by_image
        .into_par_iter()
        .map(|image| {
            let counts = fit_image(arguments, &fitter, &camera, image);
            bar.inc(1);
            counts
        })
        .collect();
    bar.finish_and_clear();
    let mut total = Counts::default();
    for counts in done {
        total.add(&counts?);
    }
    tracking::track(&arguments.out, &frames, &arguments.track, fitter.zoo())?;
    let reasons = if total.without == 0 { "" } else { " (the results say why)" };
    note(format_args!(
        "found {} poses, {} detections have none{reasons}; wrote `{}`",
        total.posed,
        total.without,
        arguments.out.display()
    ));
    if total.posed == 0 {
        warn("no detection has a pose");
        return Ok(Outcome::Skipped);
    }
    Ok(if total.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn by_image(file: DetectionFile, min_score: f64) -> anyhow::Result<Vec<ImageDetections>> {
    let stems = result_files::stems(&file.images)?;
    let mut images: Vec<ImageDetections> = file
        .images
        .into_iter()
        .zip(stems)
        .map(|(name, stem)| ImageDetections { name, stem, detections: Vec::new() })
        .collect();
    for (image, detection) in file.detections {
        if detection.score >= min_score {
            images[image].detections.push(detection);
        }
    }
    Ok(images)
}

fn fit_image(
    arguments: &Arguments,
    fitter: &Fitter,
    camera: &Camera,
    image: ImageDetections,
) -> anyhow::Result<Counts> {
    let ImageDetections { name, stem, detections } = image;
    let mut skipped = 0;
    let image = match &arguments.images {
        Some(folder) if fitter.draws() => match read_image(folder, &name, camera) {
            Ok(image) => Some(image),
            Err(error) => {
                warn(format_args!("drew `{stem}` without its image: {error:#}"));
                skipped += 1;
                None
            }
        },
        _ => None,
    };
    let counts = fitter.fit(Fitting {
        name: &name,
        stem: &stem,
        camera,
        image: image.as_ref(),
        detections,
    })?;
    Ok(Counts { skipped: counts.skipped + skipped, ..counts })
}

/// The image by its name below a folder; the file of detections must not lead out of it.
pub(super) fn read_image(folder: &Path, name: &str, camera: &Camera) -> anyhow::Result<RgbImage> {
    let inside = Path::new(name).components().all(|c| matches!(c, Component::Normal(_)));
    if !inside {
        anyhow::bail!("the name `{name}` leads out of `{}`", folder.display());
    }
    let path = folder.join(name);
    let image = files::read_rgb(&path)?;
    if image.size != camera.size {
        anyhow::bail!(
            "`{}` has {} x {} pixels, but the camera {} x {}",
            path.display(),
            image.size[0],
            image.size[1],
            camera.size[0],
            camera.size[1]
        );
    }
    Ok(image)
}
