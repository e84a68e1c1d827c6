//! `partpose evaluate poses`: the paper's Tables III to V, or one configuration.

mod bias;
mod compare;
mod frames;
mod output;
mod pictures;
mod rows;
mod scene;
mod uncertainty;

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::ValueEnum;
use partpose::dataset::folds::Folds;
use partpose::dataset::{Dataset, Frame};
use partpose::eval::{
    Configuration, EvaluationOptions, SceneProtocol, Stratum, TruthExtent, VehicleOutcome,
    evaluate_frames,
};
use partpose::files;
use partpose::oracle::OracleBox;
use partpose::vehicle::ModelZoo;

use crate::commands::provenance;
use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{Outcome, hint, note, warn, warn_error};

#[derive(clap::Args, Clone)]
pub(crate) struct Arguments {
    /// Folder of the data set; its layout is recognised
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Worlds, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    worlds: Vec<String>,
    /// Variations, separated by commas; `clone` if not given, or all where there is none of that name
    #[arg(long, value_delimiter = ',')]
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
    /// Make detections from the ground truth: the only source so far, so it must be given
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
    /// Worlds on which it is measured how far masks lie off the models' outlines, for the dense fit; with `--fold` on
    /// the tracks of the other folds; `zoo` takes what was measured when the zoo was carved
    #[arg(long, value_delimiter = ',', value_name = "WORLDS|zoo")]
    mask_bias: Vec<String>,
    #[command(flatten)]
    scene: scene::Flags,
    /// All rows of Tables III to V, and the centres of what is visible, in place of one configuration; with `--fit epnp`,
    /// the paper's solver, unless another one of centres is asked for
    #[arg(long, conflicts_with_all = ["kernel", "scaling", "refine", "points_2d", "points_3d", "filters"])]
    tables: bool,
    /// The dense fit beside the paper's method and the best setting of points: every row of the tables, by distance,
    /// occlusion, truncation, mask accuracy, where sizes come from, and time, as tables and plots
    #[arg(long, conflicts_with_all = ["tables", "degrade", "extent", "kernel", "scaling", "refine", "points_2d", "points_3d", "filters", "fit"])]
    compare: bool,
    #[arg(skip)]
    comparison: Option<compare::Rows>,
    /// Draw this many frames, evenly spread, under the last configuration
    #[arg(long, value_name = "N", default_value_t = 0)]
    pictures: usize,
    #[command(flatten)]
    pose: PoseFlags,
    /// Folder for metrics and tables
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum BoxFlag {
    /// The annotated box, the projection of the cuboid
    Annotated,
    /// The tight box of the vehicle's own pixels
    Tight,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ExtentFlag {
    /// Models scaled per axis to the true size, as in the paper
    Truth,
    /// Models scaled by one factor to the true volume
    TruthUniform,
    /// Models keep their own size
    Model,
    /// Models are stretched by what the mask says, from their own size with its likely spread (dense fit only)
    Free,
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
    let folds = frames::folds(arguments)?;
    let dataset = Dataset::open(&arguments.dataset)?;
    let zoos: Vec<ModelZoo> = folds
        .iter()
        .map(|fold| ModelZoo::load(&frames::zoo_path(arguments, *fold)))
        .collect::<Result<_, _>>()?;
    if arguments.compare {
        return compare::run(arguments, &dataset, &folds, &zoos);
    }
    let evaluated = evaluate(arguments, &dataset, &folds, &zoos)?;
    if evaluated.rows[0].is_empty() {
        return Err(hint(
            anyhow::anyhow!("no vehicle was evaluated"),
            "the zoo must hold models by the names of the data set's (`partpose zoo list ZOO`), \
             and the data set part masks (`partpose dataset check DIR`)",
        ));
    }
    output::write(arguments, &evaluated)?;
    note(format_args!(
        "wrote tables, metrics and the list of vehicles to `{}`",
        arguments.out.display()
    ));
    Ok(if evaluated.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn evaluate(
    arguments: &Arguments,
    dataset: &Dataset,
    folds: &[Option<partpose::dataset::folds::Fold>],
    zoos: &[ModelZoo],
) -> anyhow::Result<Evaluated> {
    let sequences = frames::sequences(arguments, dataset)?;
    let (frames, mut skipped) = frames::read(dataset, &sequences, arguments.stride)?;
    let unknown = frames::without_model(&frames, &zoos[0]);
    if unknown > 0 {
        note(format_args!(
            "left out {unknown} labelled vehicles whose model the zoo does not have"
        ));
    }
    for fold in folds {
        let zoo = frames::zoo_path(arguments, *fold);
        if let Some(objection) = provenance::objection(&zoo, &sequences, *fold) {
            warn(objection);
        }
    }
    // Nothing is written before the end; what cannot be written to is told now.
    files::create_folder(&arguments.out)?;
    let mut configurations = rows::configurations(arguments);
    if let Some(target) = arguments.degrade {
        let options = options(arguments, &zoos[0], &|_, _| true, &|_, _| false, None);
        rows::degrade(&mut configurations, &frames, &options, target, arguments.pose.seed)?;
    }
    let last = configurations.len() - 1;
    let mut pictures = pictures::Pictures::new(&frames, arguments.pictures);
    let mut rows: Vec<Vec<Row>> = configurations.iter().map(|_| Vec::new()).collect();
    let mut unreadable = BTreeSet::new();
    for (fold, zoo) in folds.iter().zip(zoos) {
        let dealt = match fold {
            Some(fold) => Some((*fold, Folds::of(dataset, &sequences, fold.count)?)),
            None => None,
        };
        let include = |frame: &Frame, vehicle: usize| match (&dealt, frame.vehicles[vehicle].track)
        {
            (Some((fold, folds)), Some(track)) => folds.contains(*fold, &frame.sequence, track),
            (Some(_), None) => false,
            (None, _) => true,
        };
        if !arguments.mask_bias.is_empty() {
            let others = |frame: &Frame, vehicle: usize| {
                dealt.is_none()
                    || (frame.vehicles[vehicle].track.is_some() && !include(frame, vehicle))
            };
            let bias = bias::of(arguments, dataset, zoo, *fold, &others)?;
            for configuration in &mut configurations {
                configuration.pose.dense.mask_bias = Some(bias);
            }
        }
        let keep = |frame: &Frame, index: usize| index == last && pictures.shows(frame);
        let mut options = options(arguments, zoo, &include, &keep, arguments.scene.protocol());
        scene::measure(&mut options, &frames, &configurations[last])?;
        let bar = progress::bar("frames", frames.len() as u64);
        let outcomes = evaluate_frames(&frames, &options, &configurations, &|| bar.inc(1));
        bar.finish_and_clear();
        for (frame, outcome) in frames.iter().zip(outcomes) {
            match outcome {
                Ok(outcome) => {
                    for (rows, outcomes) in rows.iter_mut().zip(outcome) {
                        for mut outcome in outcomes {
                            let detection = outcome.detection.take();
                            pictures.add(frame, zoo, detection, &outcome);
                            rows.push(row(frame, outcome));
                        }
                    }
                }
                Err(error) => {
                    if unreadable.insert(frame.name()) {
                        warn_error(format_args!("skipped frame {}", frame.name()), &error);
                    }
                }
            }
        }
    }
    skipped += unreadable.len() + pictures.write(arguments)?;
    Ok(Evaluated { configurations, rows, skipped })
}

fn options<'a>(
    arguments: &Arguments,
    zoo: &'a ModelZoo,
    include: &'a (dyn Fn(&Frame, usize) -> bool + Sync),
    keep_detections: &'a (dyn Fn(&Frame, usize) -> bool + Sync),
    scene: Option<SceneProtocol>,
) -> EvaluationOptions<'a> {
    EvaluationOptions {
        zoo,
        extent: match arguments.extent {
            ExtentFlag::Truth => TruthExtent::PerAxis,
            ExtentFlag::TruthUniform => TruthExtent::Uniform,
            ExtentFlag::Model => TruthExtent::None,
            ExtentFlag::Free => TruthExtent::Free,
        },
        bounds: match arguments.bounds {
            BoxFlag::Annotated => OracleBox::Annotated,
            BoxFlag::Tight => OracleBox::Tight,
        },
        include,
        keep_detections,
        scene,
    }
}

fn row(frame: &Frame, outcome: VehicleOutcome) -> Row {
    let label = &frame.vehicles[outcome.vehicle];
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
