//! `partpose evaluate poses`: the paper's Tables III to V, or one configuration.

mod bias;
mod compare;
mod frames;
mod output;
mod pictures;
mod predicted;
mod rows;
mod scene;
mod shards;
mod uncertainty;

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::ValueEnum;
use partpose::dataset::folds::Folds;
use partpose::dataset::{Dataset, Frame};
use partpose::eval::model_names::ModelNames;
use partpose::eval::uncertainty::Sureness;
use partpose::eval::{
    Configuration, EvaluationOptions, SceneProtocol, Scored, Stratum, TruthExtent, VehicleOutcome,
    evaluate_frames,
};
use partpose::files;
use partpose::labeling::Shard;
use partpose::oracle::{HeadErrors, OracleBox};
use partpose::pose::PartState;
use partpose::vehicle::ModelZoo;
use serde::{Deserialize, Serialize};

use super::selection::{self, Needs, Selection};
use super::source::{Source, SourceFlags};
use crate::commands::provenance;
use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{Outcome, hint, note, warn};

#[derive(clap::Args, Clone)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag that is typed")]
#[command(after_help = "\
Examples:
  partpose evaluate poses --dataset DIR --fit dense --out scores
      the network and the models that come with the program on every labelled world
  partpose evaluate poses --dataset DIR --detections run/detections --out scores
      what `partpose run --out run` wrote
  partpose evaluate poses --dataset DIR --worlds 0018 --zoo ZOO --oracle --tables --out scores
      the pose stage alone, on masks made from the ground truth")]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,
    #[command(flatten)]
    source: SourceFlags,
    /// Score the tracks of fold I of K alone; `all/K` scores every fold, each with its own zoo
    #[arg(long, value_name = "I/K")]
    fold: Option<String>,
    /// Folder of the models; `{fold}` stands for the number of the fold; the embedded models if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<String>,
    /// Which models of the zoo are right for the data set's names: TOML of lists, such as `Hybrid = ["hatchback"]`. A
    /// name that is not listed stands for the model of its name, else for the models of the body style it begins with
    #[arg(long, value_name = "FILE")]
    model_names: Option<PathBuf>,
    /// Make detections from the ground truth
    #[arg(long, conflicts_with_all = ["detections", "weights"])]
    oracle: bool,
    /// Cells a side of the oracle's kernels
    #[arg(long, value_name = "M", default_value_t = 28, value_parser = clap::value_parser!(u32).range(1..=512))]
    kernel: u32,
    /// Box of the oracle's detections
    #[arg(long = "box", value_enum, default_value = "annotated")]
    bounds: BoxFlag,
    /// Lower the oracle's pixel accuracy to this, in percent, with errors like a network's
    #[arg(long, value_name = "PERCENT", value_parser = percent, requires = "oracle")]
    degrade: Option<f64>,
    /// Let the oracle say sizes, as a network's size head does: the true one with errors of so much on each side, in
    /// percent; `--extent free` makes use of it
    #[arg(long, value_name = "PERCENT", value_parser = percent, requires = "oracle")]
    size_head: Option<f64>,
    /// Let the oracle say models, as a network's model head does: the true one is the likeliest of so many vehicles, in
    /// percent
    #[arg(long, value_name = "PERCENT", value_parser = percent, requires = "oracle")]
    model_head: Option<f64>,
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
    #[arg(long, conflicts_with_all = ["kernel", "scaling", "rank", "refine", "points_2d", "points_3d", "filters"])]
    tables: bool,
    /// The dense fit beside the paper's method and the best setting of points: every row of the tables, by distance,
    /// occlusion, truncation, mask accuracy, where sizes come from, and time, as tables and plots
    #[arg(long, conflicts_with_all = ["tables", "degrade", "extent", "kernel", "scaling", "rank", "refine", "points_2d", "points_3d", "filters", "fit"], requires = "oracle")]
    compare: bool,
    #[arg(skip)]
    comparison: Option<compare::Rows>,
    /// Compare the parts of every vehicle with its model, too, and tell how often which was said to be missing,
    /// displaced and so on: false alarms where vehicles are whole
    #[arg(long)]
    parts: bool,
    /// Draw this many frames, evenly spread, under the last configuration
    #[arg(long, value_name = "N", default_value_t = 0)]
    pictures: usize,
    #[command(flatten)]
    pose: PoseFlags,
    /// Score part I of N of the frames; all parts write to one folder, and whoever finds the others done writes the
    /// tables of all
    #[arg(long, value_name = "I/N", conflicts_with_all = ["compare", "parts", "pictures"])]
    shard: Option<Shard>,
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
        _ => Err("a number in percent, from 1 to 100, is meant, such as 85".to_owned()),
    }
}

/// One vehicle's outcome with what tables and lists need of its label.
#[derive(Serialize, Deserialize)]
struct Row {
    /// Which fold, and which frame of all: the order of the list.
    place: [usize; 2],
    sequence: String,
    frame: u32,
    track: Option<u32>,
    model: String,
    stratum: Stratum,
    /// Index of the vehicle in its frame.
    vehicle: usize,
    scored: Scored,
    sureness: Option<Sureness>,
    pixel_accuracy: Option<f64>,
    /// Of the estimate.
    seconds: f64,
    /// What the list says of the estimate, or why there is none.
    estimate: Result<output::Estimated, String>,
    /// Only for the table of parts, which no shard makes.
    #[serde(skip)]
    parts: Vec<PartState>,
}

/// The rows of every configuration, and how many frames could not be read.
struct Evaluated {
    /// What made the detections.
    detections: String,
    /// What tells it from others of that name.
    identity: String,
    configurations: Vec<Configuration>,
    rows: Vec<Vec<Row>>,
    skipped: usize,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let folds = frames::folds(arguments)?;
    let dataset = Dataset::open(&arguments.selection.dataset)?;
    let zoos: Vec<ModelZoo> = folds
        .iter()
        .map(|fold| match frames::zoo_path(arguments, *fold) {
            Some(path) => ModelZoo::load(&path),
            None => Ok(ModelZoo::embedded()),
        })
        .collect::<Result<_, _>>()?;
    let names = frames::model_names(arguments, &zoos[0])?;
    if arguments.compare {
        return compare::run(arguments, &dataset, (&folds, &zoos), &names);
    }
    let source = if arguments.oracle { None } else { Some(predicted::open(&arguments.source)?) };
    let mut evaluated = evaluate(arguments, &dataset, (&folds, &zoos), (source.as_ref(), &names))?;
    if let Some(shard) = arguments.shard
        && !shards::join(arguments, shard, &mut evaluated)?
    {
        return Ok(if evaluated.skipped == 0 { Outcome::Done } else { Outcome::Skipped });
    }
    if evaluated.rows[0].is_empty() {
        let advice = if arguments.oracle {
            "the zoo must hold models by the names of the data set's (`partpose zoo list ZOO`), \
             and the data set part masks (`partpose dataset check DIR`)"
        } else {
            "no detection is assigned to a labelled vehicle: `partpose evaluate boxes` tells which boxes were found"
        };
        return Err(hint(anyhow::anyhow!("no vehicle was evaluated"), advice));
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
    (folds, zoos): (&[Option<partpose::dataset::folds::Fold>], &[ModelZoo]),
    (source, names): (Option<&Source>, &ModelNames),
) -> anyhow::Result<Evaluated> {
    let (sequences, frames, mut skipped) = frames::chosen(arguments, dataset)?;
    frames::tell_unknown(&frames, (&zoos[0], names), arguments.oracle);
    for fold in folds {
        let zoo = frames::zoo_path(arguments, *fold);
        if let Some(objection) = zoo.and_then(|zoo| provenance::objection(&zoo, &sequences, *fold))
        {
            warn(objection);
        }
    }
    // Nothing is written before the end; what cannot be written to is told now.
    files::create_folder(&arguments.out)?;
    let mut configurations = rows::configurations(arguments, source.map(Source::kernel));
    if let Some(target) = arguments.degrade {
        let right = |name: &str| names.right(name, &zoos[0]);
        let options = options(arguments, &zoos[0], (&|_, _| true, &|_, _| false, &right), None);
        rows::degrade(&mut configurations, &frames, &options, target, arguments.pose.seed)?;
    }
    let detections = source.map_or("oracle".to_owned(), |source| source.name.clone());
    // Only parts must be sure that all have the same; files are gone through for it.
    let identity =
        source.filter(|_| arguments.shard.is_some()).map_or(String::new(), Source::identity);
    let own =
        shards::own(arguments, &frames, (&detections, &identity, &configurations), &mut skipped)?;
    let last = configurations.len() - 1;
    let mut pictures = pictures::Pictures::new(&own, arguments.pictures);
    let mut rows: Vec<Vec<Row>> = configurations.iter().map(|_| Vec::new()).collect();
    let mut unreadable = BTreeSet::new();
    for (fold_index, (fold, zoo)) in folds.iter().zip(zoos).enumerate() {
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
        let right = |name: &str| names.right(name, zoo);
        let scene = arguments.scene.protocol();
        let mut options = options(arguments, zoo, (&include, &keep, &right), scene);
        if source.is_none() {
            scene::measure(&mut options, &frames, &configurations[last])?;
        }
        let outcomes = outcomes(&own, source, arguments, (&options, &configurations));
        for (index, (frame, outcome)) in own.iter().zip(outcomes).enumerate() {
            let place = [fold_index, shards::place(index, arguments.shard)];
            match outcome {
                Ok(outcome) => {
                    for (rows, outcomes) in rows.iter_mut().zip(outcome) {
                        for mut outcome in outcomes {
                            let detection = outcome.detection.take();
                            pictures.add(frame, zoo, detection, &outcome);
                            rows.push(row(place, frame, outcome));
                        }
                    }
                }
                Err(error) => {
                    if unreadable.insert(frame.name()) {
                        warn(format_args!("skipped frame {}: {error:#}", frame.name()));
                    }
                }
            }
        }
    }
    skipped += unreadable.len() + pictures.write(arguments)?;
    Ok(Evaluated { detections, identity, configurations, rows, skipped })
}

/// What became of the vehicles of each frame.
fn outcomes(
    frames: &[Frame],
    source: Option<&Source>,
    arguments: &Arguments,
    (options, configurations): (&EvaluationOptions, &[Configuration]),
) -> Vec<anyhow::Result<Vec<Vec<VehicleOutcome>>>> {
    let bar = progress::bar("frames", frames.len() as u64);
    let tick = || bar.inc(1);
    let outcomes = match source {
        Some(source) => {
            let min_score = arguments.source.min_score;
            predicted::outcomes(frames, (source, min_score), options, configurations, &tick)
        }
        None => evaluate_frames(frames, options, configurations, &tick)
            .into_iter()
            .map(|outcome| outcome.map_err(anyhow::Error::from))
            .collect(),
    };
    bar.finish_and_clear();
    outcomes
}

/// Says whether a vehicle of a frame, or a configuration of it, is meant.
type Asks<'a> = &'a (dyn Fn(&Frame, usize) -> bool + Sync);

fn options<'a>(
    arguments: &Arguments,
    zoo: &'a ModelZoo,
    (include, keep_detections, right_models): (
        Asks<'a>,
        Asks<'a>,
        &'a (dyn Fn(&str) -> Vec<usize> + Sync),
    ),
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
        heads: HeadErrors {
            size: arguments.size_head,
            model: arguments.model_head,
            seed: arguments.pose.seed,
        },
        include,
        right_models,
        keep_detections,
        scene,
        observe: arguments.parts,
    }
}

fn row(place: [usize; 2], frame: &Frame, outcome: VehicleOutcome) -> Row {
    let label = &frame.vehicles[outcome.vehicle];
    Row {
        place,
        sequence: frame.sequence.to_string(),
        frame: frame.index,
        track: label.track,
        model: label.model.clone().unwrap_or_default(),
        stratum: Stratum {
            depth: label.cuboid.camera_from_vehicle.translation.z,
            occluded: label.occluded,
            truncated: label.truncated,
            occupancy: label.occupancy,
        },
        vehicle: outcome.vehicle,
        scored: outcome.scored,
        sureness: outcome.sureness,
        pixel_accuracy: outcome.pixel_accuracy,
        seconds: outcome.seconds,
        estimate: match &outcome.estimate {
            Ok(estimate) => Ok(output::Estimated::of(estimate)),
            Err(reason) => Err(reason.to_string()),
        },
        parts: outcome.estimate.map_or(Vec::new(), |estimate| estimate.parts),
    }
}
