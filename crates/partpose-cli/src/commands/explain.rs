//! `partpose explain`: a picture for each vehicle that shows why it was found where it was.

use std::path::PathBuf;

use partpose::dataset::{Dataset, Frame};
use partpose::detection::{DetectedSize, Detection};
use partpose::eval::model_names::ModelNames;
use partpose::eval::{Configuration, EvaluationOptions, TruthExtent, calibrate};
use partpose::files::{self, RgbImage};
use partpose::formats::{DetectionFile, read_detections};
use partpose::geometry::{Camera, Cuboid};
use partpose::oracle::{Degradation, HeadErrors, Oracle, OracleBox, OracleOptions};
use partpose::pose::dense::DenseOptions;
use partpose::pose::{PnpMethod, PoseEstimator, PoseOptions};
use partpose::vehicle::ModelZoo;
use partpose::viz::{Explanation, explain};

use crate::camera::load_camera;
use crate::commands::fit;
use crate::commands::fitting::{self, FitExtent};
use crate::commands::{mask_bias as bias_files, result_files};
use crate::progress;
use crate::report::{Outcome, hint, note, warn};

/// The variation that is meant where a data set has it.
const DEFAULT_VARIATION: &str = "clone";
/// Frames that the strength of degradation is found on.
const CALIBRATION_FRAMES: usize = 40;

#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("source").required(true))]
#[command(after_help = "Examples:
  partpose explain --detections detections.safetensors --camera camera.toml --zoo zoo --out why
  partpose explain --dataset vkitti --oracle --worlds 0018 --frames 5 --degrade 85 --zoo zoo-0001 --out why")]
pub(crate) struct Arguments {
    /// Detections as `fit` reads them
    #[arg(long, value_name = "FILE", requires = "camera", group = "source")]
    detections: Option<PathBuf>,
    /// Camera of the detections: TOML, KITTI calib, or the folder of a data set
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Folder of the images named in the detections
    #[arg(long, value_name = "DIR", requires = "detections")]
    images: Option<PathBuf>,
    /// Folder of a data set, whose labelled vehicles are explained beside the truth
    #[arg(long, value_name = "DIR", group = "source", requires = "oracle")]
    dataset: Option<PathBuf>,
    /// Make detections from the ground truth of the data set
    #[arg(long)]
    oracle: bool,
    /// Worlds of the data set, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    worlds: Vec<String>,
    /// Frames of the data set, evenly spread
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Cells a side of the oracle's kernels
    #[arg(long, value_name = "M", default_value_t = 28, value_parser = clap::value_parser!(u32).range(1..=512))]
    kernel: u32,
    /// Lower the oracle's pixel accuracy to this, in percent, with errors like a network's
    #[arg(long, value_name = "PERCENT", value_parser = percent, requires = "oracle")]
    degrade: Option<f64>,
    /// Folder of the models; the embedded ones if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Size of the vehicles: `file` takes the detections' own, or with `--dataset` the true one; `model`, `free` and
    /// width,height,length as in `fit`
    #[arg(long, value_name = "SIZE", default_value = "file", value_parser = fitting::parse_extent)]
    extent: FitExtent,
    /// How far masks lie off the models' outlines: `mask-bias.json` of `evaluate poses --mask-bias`
    #[arg(long, value_name = "FILE")]
    mask_bias: Option<PathBuf>,
    /// Most pictures that are drawn
    #[arg(long, value_name = "N", default_value_t = 200)]
    most: usize,
    /// Folder for the pictures, one a vehicle
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=100.0).contains(&value) => Ok(value / 100.0),
        _ => Err("a pixel accuracy in percent is meant, such as 85".to_owned()),
    }
}

/// One picture to draw.
struct Case {
    /// Name of the image, and number of the vehicle in it.
    name: String,
    camera: Camera,
    /// Place in the list of images.
    image: usize,
    detection: Detection,
    truth: Option<Cuboid>,
    /// What else the title says.
    about: String,
}

/// What is explained, and the images it was seen in.
struct Cases {
    cases: Vec<Case>,
    images: Vec<Option<RgbImage>>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = match &arguments.zoo {
        Some(folder) => ModelZoo::load(folder)?,
        None => ModelZoo::embedded(),
    };
    let mask_bias = arguments.mask_bias.as_deref().map(bias_files::read).transpose()?;
    let dense = DenseOptions { mask_bias, ..Default::default() };
    let options = PoseOptions { method: PnpMethod::Dense, dense, ..Default::default() };
    let estimator = PoseEstimator::new(&zoo, &options);
    let Cases { cases, images } = match (&arguments.detections, &arguments.dataset) {
        (Some(detections), _) => of_detections(arguments, detections)?,
        (None, Some(dataset)) => of_dataset(arguments, dataset, &zoo)?,
        (None, None) => anyhow::bail!("either `--detections` or `--dataset` is needed"),
    };
    if cases.is_empty() {
        warn("there is nothing to explain");
        return Ok(Outcome::Skipped);
    }
    let drawn = cases.len().min(arguments.most);
    if drawn < cases.len() {
        note(format_args!("draws the first {drawn} of {} vehicles (`--most`)", cases.len()));
    }
    files::create_folder(&arguments.out)?;
    let bar = progress::bar("vehicles", drawn as u64);
    for case in cases.iter().take(drawn) {
        let extent = arguments.extent.source(case.detection.size.as_ref());
        let mut outcome = estimator.estimate(&case.camera, &case.detection, &extent);
        if let Ok(estimate) = &mut outcome {
            estimator.observe(&case.camera, &case.detection, estimate);
        }
        let picture = explain(&Explanation {
            title: &format!("{}{}", case.name, case.about),
            camera: case.camera,
            image: images[case.image].as_ref(),
            detection: &case.detection,
            outcome: &outcome,
            zoo: &zoo,
            truth: case.truth,
        });
        let file = format!("{}.png", result_files::stem(&case.name));
        files::write_png(&arguments.out.join(file), &picture)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    note(format_args!("wrote {drawn} pictures to `{}`", arguments.out.display()));
    Ok(Outcome::Done)
}

fn of_detections(arguments: &Arguments, path: &std::path::Path) -> anyhow::Result<Cases> {
    let file: DetectionFile = read_detections(path)?;
    let Some(camera) = &arguments.camera else { anyhow::bail!("`--camera` is needed") };
    let camera = load_camera(camera)?;
    let stems = result_files::stems(&file.images)?;
    let read = |name: &String| {
        let folder = arguments.images.as_ref()?;
        match fit::read_image(folder, name, &camera) {
            Ok(image) => Some(image),
            Err(error) => {
                warn(format_args!("drew `{name}` without its image: {error:#}"));
                None
            }
        }
    };
    let images = file.images.iter().map(read).collect();
    let mut counts = vec![0usize; stems.len()];
    let mut cases = Vec::new();
    for (image, detection) in file.detections {
        counts[image] += 1;
        cases.push(Case {
            name: format!("{}-{}", stems[image], counts[image]),
            camera,
            image,
            about: format!(", score {:.2}", detection.score),
            detection,
            truth: None,
        });
    }
    Ok(Cases { cases, images })
}

fn of_dataset(
    arguments: &Arguments,
    path: &std::path::Path,
    zoo: &ModelZoo,
) -> anyhow::Result<Cases> {
    let dataset = Dataset::open(path)?;
    let has_default = dataset.sequences().iter().any(|id| id.variation == DEFAULT_VARIATION);
    let variations: Vec<String> =
        if has_default { vec![DEFAULT_VARIATION.to_owned()] } else { Vec::new() };
    let mut frames: Vec<Frame> = Vec::new();
    for sequence in dataset.select(&arguments.worlds, &variations)? {
        frames.extend(dataset.read(&sequence)?.frames);
    }
    frames.retain(|f| f.parts.is_some() && f.vehicles.iter().any(|vehicle| !vehicle.dont_care));
    if frames.is_empty() {
        return Err(hint(
            anyhow::anyhow!("`{}` has no frame with vehicles and part masks", path.display()),
            "`partpose dataset check DIR` tells what is there",
        ));
    }
    let degradation =
        arguments.degrade.and_then(|target| strength(&frames, zoo, arguments, target));
    let step = frames.len().div_ceil(arguments.frames as usize).max(1);
    let chosen: Vec<&Frame> =
        frames.iter().skip(step / 2).step_by(step).take(arguments.frames as usize).collect();
    let mut cases = Vec::new();
    let mut images = Vec::new();
    for (index, frame) in chosen.into_iter().enumerate() {
        let image = frame.image.as_deref().map(files::read_rgb).transpose();
        images.push(image.unwrap_or_else(|error| {
            warn(format_args!("drew frame {} without its image: {error}", frame.name()));
            None
        }));
        let oracle = Oracle::new(frame, frame.read_parts()?, zoo);
        let options =
            OracleOptions { kernel: arguments.kernel as usize, degradation, ..Default::default() };
        for (vehicle, label) in frame.vehicles.iter().enumerate().filter(|(_, v)| !v.dont_care) {
            let Some(mut detection) = oracle.detection(vehicle, &options) else { continue };
            detection.size = Some(DetectedSize::exact(label.cuboid.extent));
            let model = label.model.as_deref().unwrap_or("unknown model");
            cases.push(Case {
                name: format!("{}-{}", frame.name(), vehicle + 1),
                camera: frame.camera,
                image: index,
                detection,
                truth: Some(label.cuboid),
                about: format!(", in truth a {model}"),
            });
        }
    }
    Ok(Cases { cases, images })
}

/// How strongly kernels must err for the accuracy asked for.
fn strength(
    frames: &[Frame],
    zoo: &ModelZoo,
    arguments: &Arguments,
    target: f64,
) -> Option<Degradation> {
    const SEED: u64 = 0;
    let step = frames.len().div_ceil(CALIBRATION_FRAMES).max(1);
    let sample: Vec<Frame> = frames.iter().step_by(step).cloned().collect();
    let right = |name: &str| ModelNames::default().right(name, zoo);
    let options = EvaluationOptions {
        zoo,
        extent: TruthExtent::PerAxis,
        bounds: OracleBox::Annotated,
        heads: HeadErrors::default(),
        include: &|_, _| true,
        right_models: &right,
        keep_detections: &|_, _| false,
        scene: None,
        observe: false,
    };
    let configuration = Configuration {
        name: String::new(),
        kernel: arguments.kernel as usize,
        pose: PoseOptions::default(),
        degradation: None,
    };
    let found = calibrate(&sample, &options, &configuration, target, SEED);
    if found.is_none() {
        warn("no vehicle to find the strength of `--degrade` on: masks are exact");
    }
    found.map(|(strength, _)| Degradation { strength, seed: SEED })
}
