//! `partpose fit`: anybody's detections to poses.

use std::path::{Path, PathBuf};

use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose::formats::{DetectionFile, image_result, read_detections};
use partpose::geometry::{Camera, Extent};
use partpose::pose::{ExtentSource, NoPose, PoseEstimate, PoseEstimator};
use partpose::vehicle::ModelZoo;
use rayon::prelude::*;

use crate::camera::load_camera;
use crate::commands::result_files::{self, Pictured};
use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{Outcome, hint, note, warn};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Detections: safetensors with `boxes`, `scores` and `part_probabilities` (docs/formats.md)
    #[arg(long, value_name = "FILE")]
    detections: PathBuf,
    /// Camera: TOML, KITTI calib, or the folder of a data set
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// Folder of the models
    #[arg(long, value_name = "DIR")]
    zoo: PathBuf,
    /// Size of the vehicles: `model`, or width,height,length in metres
    #[arg(long, value_name = "SIZE", default_value = "model", value_parser = parse_extent)]
    extent: FitExtent,
    /// Leave out detections with a lower score
    #[arg(long, value_name = "SCORE", default_value_t = 0.0)]
    min_score: f64,
    /// Folder of the images named in the detections, to draw on
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Draw no pictures
    #[arg(long)]
    no_pictures: bool,
    #[command(flatten)]
    pose: PoseFlags,
    /// Folder for results: one JSON, one KITTI text and one picture an image
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug)]
enum FitExtent {
    Model,
    Given(Extent),
}

fn parse_extent(text: &str) -> Result<FitExtent, String> {
    if text == "model" {
        return Ok(FitExtent::Model);
    }
    let sides: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    match sides.as_deref() {
        Ok([width, height, length]) => {
            let extent = Extent::new(*width, *height, *length);
            if extent.is_valid() {
                return Ok(FitExtent::Given(extent));
            }
            Err("width, height and length must be positive".to_owned())
        }
        _ => Err("`model` or width,height,length is meant, such as 1.8,1.5,4.4".to_owned()),
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let file = read_detections(&arguments.detections).map_err(|error| {
        hint(error, "docs/formats.md, \"Detections\", lists the tensors, their shapes and types")
    })?;
    let camera = load_camera(&arguments.camera)?;
    let zoo = ModelZoo::load(&arguments.zoo)?;
    let estimator = PoseEstimator::new(&zoo, &arguments.pose.options());
    let extent = match arguments.extent {
        FitExtent::Model => ExtentSource::Model,
        FitExtent::Given(extent) => ExtentSource::Given(extent),
    };
    let by_image = by_image(file, arguments.min_score);
    let bar = progress::bar("images", by_image.len() as u64);
    let done: Vec<anyhow::Result<Counts>> = by_image
        .into_par_iter()
        .map(|(name, detections)| {
            let counts =
                fit_image(arguments, (&name, detections), &camera, (&zoo, &estimator), &extent);
            bar.inc(1);
            counts
        })
        .collect();
    bar.finish_and_clear();
    let mut total = Counts::default();
    for counts in done {
        let counts = counts?;
        total.posed += counts.posed;
        total.without += counts.without;
        total.skipped += counts.skipped;
    }
    note(format_args!(
        "found {} poses; {} detections have none, with the reason in the results",
        total.posed, total.without
    ));
    Ok(if total.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

#[derive(Default)]
struct Counts {
    posed: usize,
    without: usize,
    /// Images that were asked for and could not be drawn on.
    skipped: usize,
}

fn by_image(file: DetectionFile, min_score: f64) -> Vec<(String, Vec<Detection>)> {
    let mut images: Vec<(String, Vec<Detection>)> =
        file.images.into_iter().map(|name| (name, Vec::new())).collect();
    for (image, detection) in file.detections {
        if detection.score >= min_score {
            images[image].1.push(detection);
        }
    }
    images
}

fn fit_image(
    arguments: &Arguments,
    (name, detections): (&str, Vec<Detection>),
    camera: &Camera,
    (zoo, estimator): (&ModelZoo, &PoseEstimator),
    extent: &ExtentSource,
) -> anyhow::Result<Counts> {
    let estimated: Vec<(Detection, Result<PoseEstimate, NoPose>)> = detections
        .into_iter()
        .map(|detection| {
            let estimate = estimator.estimate(camera, &detection, extent);
            (detection, estimate)
        })
        .collect();
    let posed = estimated.iter().filter(|(_, estimate)| estimate.is_ok()).count();
    let mut counts = Counts { posed, without: estimated.len() - posed, skipped: 0 };
    let stem = result_files::stem(name);
    let result = image_result(name, camera, &estimated);
    let written: Vec<_> = estimated.iter().map(|(d, e)| (d, e.as_ref().ok())).collect();
    result_files::write_results(&arguments.out, &stem, &result, &written, zoo)?;
    if !arguments.no_pictures {
        let image = match &arguments.images {
            Some(folder) => match read_image(&folder.join(name), camera) {
                Ok(image) => Some(image),
                Err(error) => {
                    warn(format_args!("drew `{stem}` without its image: {error}"));
                    counts.skipped += 1;
                    None
                }
            },
            None => None,
        };
        let pictured: Vec<Pictured> = estimated
            .iter()
            .map(|(detection, estimate)| Pictured {
                detection,
                estimate: estimate.as_ref().ok(),
                truth: None,
            })
            .collect();
        let scaling = arguments.pose.options().scaling;
        let picture =
            result_files::picture(&stem, camera, zoo, image.as_ref(), (&pictured, scaling));
        files::write_png(&arguments.out.join(format!("{stem}.png")), &picture)?;
    }
    Ok(counts)
}

fn read_image(path: &Path, camera: &Camera) -> anyhow::Result<RgbImage> {
    let image = files::read_rgb(path)?;
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
