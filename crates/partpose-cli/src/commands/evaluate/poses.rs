//! `partpose evaluate poses`: the paper's Tables III to V, or one configuration.

mod output;

use std::path::PathBuf;

use clap::ValueEnum;
use partpose::dataset::folds::{Fold, Folds};
use partpose::dataset::{Dataset, Frame, SequenceId};
use partpose::eval::{
    Configuration, EvaluationOptions, Stratum, TruthExtent, VehicleOutcome, calibrate,
    evaluate_frames, paper_configurations,
};
use partpose::files;
use partpose::oracle::{Degradation, OracleBox};
use partpose::parts::Scaling;
use partpose::pose::{Center2d, Center3d, PartFilters, PoseOptions};
use partpose::vehicle::ModelZoo;

use crate::commands::result_files::{self, Pictured};
use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{Outcome, hint, warn};

/// Vehicles that the strength of degradation is found on.
const CALIBRATION_FRAMES: usize = 60;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder of the data set; its layout is recognised
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Worlds, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    worlds: Vec<String>,
    /// Variations, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "clone")]
    variations: Vec<String>,
    /// Score the tracks of fold I of K alone; `all/K` scores every fold, each with its own zoo
    #[arg(long, value_name = "I/K")]
    fold: Option<String>,
    /// Every N-th frame only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    stride: u32,
    /// Folder of the models; `{fold}` stands for the number of the fold
    #[arg(long, value_name = "DIR")]
    zoo: String,
    /// Make detections from the ground truth
    #[arg(long)]
    oracle: bool,
    /// Cells a side of the oracle's kernels
    #[arg(long, value_name = "M", default_value_t = 28, value_parser = clap::value_parser!(u32).range(1..=512))]
    kernel: u32,
    /// Box of the oracle's detections
    #[arg(long = "box", value_enum, default_value = "annotated")]
    bounds: BoxFlag,
    /// Lower the oracle's pixel accuracy to this, in percent, with errors like a network's
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    degrade: Option<f64>,
    /// Where the size of a vehicle comes from
    #[arg(long, value_enum, default_value = "truth")]
    extent: ExtentFlag,
    /// All rows of Tables III to V, and the centres of what is visible, in place of one configuration
    #[arg(long)]
    tables: bool,
    /// Draw this many frames, evenly spread, under the last configuration
    #[arg(long, value_name = "N", default_value_t = 0)]
    pictures: usize,
    #[command(flatten)]
    pose: PoseFlags,
    /// Folder for metrics and tables
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, ValueEnum)]
enum BoxFlag {
    /// The annotated box, the projection of the cuboid
    Annotated,
    /// The tight box of the vehicle's own pixels
    Tight,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ExtentFlag {
    /// Models scaled per axis to the true size, as in the paper
    Truth,
    /// Models scaled by one factor to the true volume
    TruthUniform,
    /// Models keep their own size
    Model,
}

fn percent(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=100.0).contains(&value) => Ok(value / 100.0),
        _ => Err("a pixel accuracy in percent is meant, such as 85".to_owned()),
    }
}

/// One vehicle's outcome with what tables and lists need of its label.
struct Row {
    sequence: String,
    frame: u32,
    track: Option<u32>,
    model: String,
    stratum: Stratum,
    outcome: VehicleOutcome,
}

/// The rows of every configuration, and how many frames could not be read.
struct Evaluated {
    configurations: Vec<Configuration>,
    rows: Vec<Vec<Row>>,
    skipped: usize,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    if !arguments.oracle {
        return Err(hint(
            anyhow::anyhow!("there are no detections to evaluate"),
            "add `--oracle` to make them from the ground truth",
        ));
    }
    let evaluated = evaluate(arguments)?;
    if evaluated.rows[0].is_empty() {
        return Err(hint(
            anyhow::anyhow!("no vehicle was evaluated"),
            "the zoo must hold models by the names of the data set's (`partpose zoo list ZOO`), \
             and the data set part masks (`partpose dataset check DIR`)",
        ));
    }
    output::write(arguments, &evaluated)?;
    Ok(if evaluated.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn evaluate(arguments: &Arguments) -> anyhow::Result<Evaluated> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let sequences = dataset.select(&arguments.worlds, &arguments.variations)?;
    let mut configurations = configurations(arguments);
    let mut skipped = 0;
    let frames = frames(&dataset, &sequences, arguments.stride, &mut skipped)?;
    let mut rows: Vec<Vec<Row>> = configurations.iter().map(|_| Vec::new()).collect();
    let last = configurations.len() - 1;
    let drawn = drawn_frames(&frames, arguments.pictures);
    let scaling = configurations[last].pose.scaling;
    for fold in folds(arguments)? {
        let zoo = ModelZoo::load(&zoo_path(arguments, fold))?;
        let folds = match fold {
            Some(fold) => Some((fold, Folds::of(&dataset, &sequences, fold.count)?)),
            None => None,
        };
        let include = |frame: &Frame, vehicle: usize| match (&folds, frame.vehicles[vehicle].track)
        {
            (Some((fold, folds)), Some(track)) => folds.contains(*fold, &frame.sequence, track),
            (Some(_), None) => false,
            (None, _) => true,
        };
        let options = EvaluationOptions {
            zoo: &zoo,
            extent: match arguments.extent {
                ExtentFlag::Truth => TruthExtent::PerAxis,
                ExtentFlag::TruthUniform => TruthExtent::Uniform,
                ExtentFlag::Model => TruthExtent::None,
            },
            bounds: match arguments.bounds {
                BoxFlag::Annotated => OracleBox::Annotated,
                BoxFlag::Tight => OracleBox::Tight,
            },
            include: &include,
            keep_detections: &|frame, index| index == last && drawn.contains(&frame.name()),
        };
        if let Some(target) = arguments.degrade
            && configurations.iter().any(|configuration| configuration.degradation.is_none())
        {
            set_degradation(&mut configurations, &frames, &options, target, arguments.pose.seed)?;
        }
        let bar = progress::bar("frames", frames.len() as u64);
        let outcomes = evaluate_frames(&frames, &options, &configurations, &|| bar.inc(1));
        bar.finish_and_clear();
        for (frame, outcome) in frames.iter().zip(outcomes) {
            match outcome {
                Ok(outcome) => {
                    if drawn.contains(&frame.name()) {
                        draw(arguments, frame, (&zoo, scaling), &outcome[last])?;
                    }
                    for (rows, outcomes) in rows.iter_mut().zip(outcome) {
                        rows.extend(outcomes.into_iter().map(|outcome| row(frame, outcome)));
                    }
                }
                Err(error) => {
                    warn(format_args!("skipped frame {}: {error}", frame.name()));
                    skipped += 1;
                }
            }
        }
    }
    Ok(Evaluated { configurations, rows, skipped })
}

/// The names of `count` frames with vehicles, evenly spread.
fn drawn_frames(frames: &[Frame], count: usize) -> Vec<String> {
    let shown: Vec<&Frame> =
        frames.iter().filter(|frame| frame.vehicles.iter().any(|v| !v.dont_care)).collect();
    let step = shown.len().div_ceil(count.max(1)).max(1);
    shown.into_iter().step_by(step).take(count).map(Frame::name).collect()
}

fn draw(
    arguments: &Arguments,
    frame: &Frame,
    (zoo, scaling): (&ModelZoo, Scaling),
    outcomes: &[VehicleOutcome],
) -> anyhow::Result<()> {
    let pictured: Vec<Pictured> = outcomes
        .iter()
        .filter_map(|outcome| {
            Some(Pictured {
                detection: outcome.detection.as_ref()?,
                estimate: outcome.estimate.as_ref().ok(),
                truth: Some(frame.vehicles[outcome.vehicle].cuboid),
            })
        })
        .collect();
    if pictured.is_empty() {
        return Ok(());
    }
    let image = frame.image.as_deref().map(files::read_rgb).transpose()?;
    let name = frame.name();
    let picture =
        result_files::picture(&name, &frame.camera, zoo, image.as_ref(), (&pictured, scaling));
    let path = arguments.out.join("pictures").join(format!("{}.png", result_files::stem(&name)));
    Ok(files::write_png(&path, &picture)?)
}

fn row(frame: &Frame, mut outcome: VehicleOutcome) -> Row {
    let label = &frame.vehicles[outcome.vehicle];
    outcome.detection = None;
    Row {
        sequence: frame.sequence.to_string(),
        frame: frame.index,
        track: label.track,
        model: label.model.clone().unwrap_or_default(),
        stratum: Stratum {
            depth: label.cuboid.camera_from_vehicle.translation.z,
            occluded: label.occluded,
            truncated: label.truncated,
        },
        outcome,
    }
}

/// Every `stride`-th frame; what cannot be read is reported.
fn frames(
    dataset: &Dataset,
    sequences: &[SequenceId],
    stride: u32,
    skipped: &mut usize,
) -> anyhow::Result<Vec<Frame>> {
    let mut frames = Vec::new();
    for sequence in sequences {
        let read = dataset.read(sequence)?;
        read.problems.iter().for_each(|problem| warn(format_args!("{problem}")));
        *skipped += read.skipped.len();
        frames.extend(read.frames.into_iter().filter(|frame| frame.index % stride == 0));
    }
    if frames.iter().all(|frame| frame.parts.is_none()) {
        return Err(hint(
            anyhow::anyhow!("`{}` has no part masks for what was chosen", dataset.root().display()),
            "the oracle reads `parts/<world>/<variation>/%05d.png`; `partpose dataset check DIR` tells what is there",
        ));
    }
    frames.retain(|frame| frame.parts.is_some());
    Ok(frames)
}

fn folds(arguments: &Arguments) -> anyhow::Result<Vec<Option<Fold>>> {
    let Some(text) = &arguments.fold else { return Ok(vec![None]) };
    if let Some(count) = text.strip_prefix("all/") {
        let last = Fold::parse(&format!("{count}/{count}"))?;
        return Ok((1..=last.count).map(|index| Some(Fold { index, count: last.count })).collect());
    }
    Ok(vec![Some(Fold::parse(text)?)])
}

fn zoo_path(arguments: &Arguments, fold: Option<Fold>) -> PathBuf {
    let number = fold.map_or(String::new(), |fold| fold.index.to_string());
    PathBuf::from(arguments.zoo.replace("{fold}", &number))
}

fn configurations(arguments: &Arguments) -> Vec<Configuration> {
    let base = arguments.pose.options();
    let kernel = arguments.kernel as usize;
    if !arguments.tables {
        let name = "as asked".to_owned();
        return vec![Configuration { name, kernel, pose: base, degradation: None }];
    }
    let mut rows = paper_configurations(&base);
    let all = PartFilters::ALL;
    let more = [
        ("CM / CM, all filters", Center2d::Mass, Center3d::Mass, false),
        ("CM / visible, all filters", Center2d::Mass, Center3d::Visible, false),
        ("CM / CM, all filters, LM", Center2d::Mass, Center3d::Mass, true),
        ("CM / visible, all filters, LM", Center2d::Mass, Center3d::Visible, true),
    ];
    for kernel in [28, 56] {
        for (name, center_2d, center_3d, refine) in more {
            let pose = PoseOptions { center_2d, center_3d, filters: all, refine, ..base };
            let name = format!("past: {kernel} {name}");
            rows.push(Configuration { name, kernel, pose, degradation: None });
        }
    }
    rows
}

/// Finds for each kernel size the strength that gives the accuracy asked for.
fn set_degradation(
    configurations: &mut [Configuration],
    frames: &[Frame],
    options: &EvaluationOptions,
    target: f64,
    seed: u64,
) -> anyhow::Result<()> {
    let step = frames.len().div_ceil(CALIBRATION_FRAMES).max(1);
    let sample: Vec<Frame> = frames.iter().step_by(step).cloned().collect();
    let mut found: Vec<(usize, f64)> = Vec::new();
    for configuration in configurations {
        let kernel = configuration.kernel;
        let known = found.iter().find(|(size, _)| *size == kernel).map(|(_, strength)| *strength);
        let strength = match known {
            Some(strength) => strength,
            None => calibrate(&sample, options, configuration, target, seed)?,
        };
        found.push((kernel, strength));
        configuration.degradation = Some(Degradation { strength, seed });
    }
    Ok(())
}
