//! `partpose fit`: anybody's detections to poses.

use std::path::{Component, Path, PathBuf};

use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose::formats::{
    DetectionFile, DetectionFileError, ResultSettings, image_result, read_detections,
};
use partpose::geometry::{Camera, Extent};
use partpose::pose::dense::SizePrior;
use partpose::pose::scene::{SceneDetection, estimate_scene};
use partpose::pose::{ExtentSource, NoPose, PoseEstimate, PoseEstimator};
use partpose::vehicle::ModelZoo;
use rayon::prelude::*;

use crate::camera::load_camera;
use crate::commands::mask_bias;
use crate::commands::result_files::{self, Pictured};
use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{Outcome, hint, note, warn};
use crate::scene_flags::SceneFlags;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Detections: safetensors with `boxes`, `scores` and `part_probabilities` (docs/formats.md)
    #[arg(long, value_name = "FILE")]
    detections: PathBuf,
    /// Camera: TOML, KITTI calib, or the folder of a data set
    #[arg(long, value_name = "FILE")]
    camera: PathBuf,
    /// Folder of the models; the embedded ones if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Size of the vehicles, on which their distance depends: `file` takes the detections' own `extents`, else the
    /// models'; `model` the models'; `free` starts with the models' and lets the dense fit stretch them; width,height,
    /// length in metres is one size for all
    #[arg(long, value_name = "SIZE", default_value = "file", value_parser = parse_extent)]
    extent: FitExtent,
    /// Leave out detections with a lower score
    #[arg(long, value_name = "SCORE", default_value_t = 0.0, value_parser = parse_score)]
    min_score: f64,
    /// Folder of the images named in the detections, to draw on
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// Draw no pictures
    #[arg(long)]
    no_pictures: bool,
    /// How far masks lie off the models' outlines, for the dense fit: `mask-bias.json` of `evaluate poses --mask-bias`
    #[arg(long, value_name = "FILE")]
    mask_bias: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    pose: PoseFlags,
    /// Folder for results: one JSON, one KITTI text and one picture an image
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum FitExtent {
    File,
    Model,
    Free,
    Given(Extent),
}

pub(super) fn parse_extent(text: &str) -> Result<FitExtent, String> {
    match text {
        "file" => return Ok(FitExtent::File),
        "model" => return Ok(FitExtent::Model),
        "free" => return Ok(FitExtent::Free),
        _ => {}
    }
    let sides: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    match sides.as_deref() {
        Ok([width, height, length]) => {
            let extent = Extent::new(*width, *height, *length);
            let believed = [0.1, 100.0];
            if [*width, *height, *length]
                .iter()
                .all(|side| (believed[0]..=believed[1]).contains(side))
            {
                return Ok(FitExtent::Given(extent));
            }
            Err("width, height and length must lie between 0.1 and 100 metres".to_owned())
        }
        _ => Err("`file`, `model`, `free` or width,height,length is meant, such as 1.8,1.5,4.4"
            .to_owned()),
    }
}

impl FitExtent {
    /// Where the size of a detection comes from that may have one of its own.
    pub(super) fn source(self, own: Option<Extent>) -> ExtentSource {
        match (self, own) {
            (Self::Given(extent), _) | (Self::File, Some(extent)) => ExtentSource::Given(extent),
            (Self::Free, _) => ExtentSource::Free(SizePrior::around(None)),
            (Self::File | Self::Model, _) => ExtentSource::Model,
        }
    }
}

fn parse_score(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("a score from 0 to 1 is meant".to_owned()),
    }
}

/// What every image is fitted with.
struct Job<'a> {
    arguments: &'a Arguments,
    camera: Camera,
    zoo: ModelZoo,
    estimator: PoseEstimator,
    settings: ResultSettings,
}

/// The detections of one image, each with its size where the file knows it.
struct ImageDetections {
    name: String,
    stem: String,
    detections: Vec<(Detection, Option<Extent>)>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let file = read_detections(&arguments.detections).map_err(|error| match error {
        DetectionFileError::File(_) => anyhow::Error::from(error),
        error => hint(
            error,
            "docs/formats.md, \"Detections\", lists the tensors, their shapes and types",
        ),
    })?;
    let mut options = arguments.pose.options();
    options.dense.mask_bias = arguments.mask_bias.as_deref().map(mask_bias::read).transpose()?;
    let zoo = match &arguments.zoo {
        Some(folder) => ModelZoo::load(folder)?,
        None => ModelZoo::embedded(),
    };
    let job = Job {
        arguments,
        camera: load_camera(&arguments.camera)?,
        estimator: PoseEstimator::new(&zoo, &options),
        zoo,
        settings: ResultSettings {
            version: env!("CARGO_PKG_VERSION"),
            zoo: arguments
                .zoo
                .as_ref()
                .map_or("embedded".to_owned(), |zoo| zoo.display().to_string()),
            extent: extent_in_words(arguments.extent, file.extents.is_some()),
            pose: options,
        },
    };
    let by_image = by_image(file, arguments.min_score)?;
    files::create_folder(&arguments.out)?;
    let bar = progress::bar("images", by_image.len() as u64);
    let done: Vec<anyhow::Result<Counts>> = by_image
        .into_par_iter()
        .map(|image| {
            let counts = fit_image(&job, image);
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

fn extent_in_words(extent: FitExtent, has_extents: bool) -> String {
    match extent {
        FitExtent::File if has_extents => "given with the detections".to_owned(),
        FitExtent::File | FitExtent::Model => "of the models".to_owned(),
        FitExtent::Free => "of the models, stretched by the masks".to_owned(),
        FitExtent::Given(e) => {
            format!("given: {} x {} x {} m (width, height, length)", e.width, e.height, e.length)
        }
    }
}

#[derive(Default)]
struct Counts {
    posed: usize,
    without: usize,
    /// Images that were asked for and could not be drawn on.
    skipped: usize,
}

fn by_image(file: DetectionFile, min_score: f64) -> anyhow::Result<Vec<ImageDetections>> {
    let stems = result_files::stems(&file.images)?;
    let mut images: Vec<ImageDetections> = file
        .images
        .into_iter()
        .zip(stems)
        .map(|(name, stem)| ImageDetections { name, stem, detections: Vec::new() })
        .collect();
    for (index, (image, detection)) in file.detections.into_iter().enumerate() {
        if detection.score >= min_score {
            let extent = file.extents.as_ref().map(|extents| extents[index]);
            images[image].detections.push((detection, extent));
        }
    }
    Ok(images)
}

fn fit_image(job: &Job, image: ImageDetections) -> anyhow::Result<Counts> {
    let arguments = job.arguments;
    let ImageDetections { name, stem, detections } = image;
    let sizes: Vec<ExtentSource> =
        detections.iter().map(|(_, own)| arguments.extent.source(*own)).collect();
    let given: Vec<SceneDetection> = detections
        .iter()
        .zip(sizes)
        .map(|((detection, _), extent)| SceneDetection { detection, extent })
        .collect();
    let scene = arguments.scene.options();
    let found = estimate_scene(&job.estimator, &job.zoo, &job.camera, &given, &scene);
    let mut estimated: Vec<(Detection, Result<PoseEstimate, NoPose>)> =
        detections.into_iter().map(|(detection, _)| detection).zip(found.vehicles).collect();
    for (detection, estimate) in &mut estimated {
        if let Ok(estimate) = estimate {
            job.estimator.observe(&job.camera, detection, estimate);
        }
    }
    let posed = estimated.iter().filter(|(_, estimate)| estimate.is_ok()).count();
    let mut counts = Counts { posed, without: estimated.len() - posed, skipped: 0 };
    let result = image_result(&name, &job.camera, &job.settings, &estimated);
    let written: Vec<_> = estimated.iter().map(|(d, e)| (d, e.as_ref().ok())).collect();
    result_files::write_results(&arguments.out, &stem, &result, &written, &job.zoo)?;
    if arguments.no_pictures {
        return Ok(counts);
    }
    let image = match &arguments.images {
        Some(folder) => match read_image(folder, &name, &job.camera) {
            Ok(image) => Some(image),
            Err(error) => {
                warn(format_args!("drew `{stem}` without its image: {error:#}"));
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
            zoo: &job.zoo,
            truth: None,
        })
        .collect();
    let drawn = (pictured.as_slice(), job.estimator.options().scaling);
    let picture = result_files::picture(&stem, &job.camera, image.as_ref(), drawn);
    files::write_png(&arguments.out.join(format!("{stem}.png")), &picture)?;
    Ok(counts)
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
