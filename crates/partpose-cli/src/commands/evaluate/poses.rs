//! `partpose evaluate poses`: the paper's Tables III to V, or one configuration.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use partpose::dataset::folds::{Fold, Folds};
use partpose::dataset::{Dataset, Frame, SequenceId};
use partpose::eval::{
    Configuration, EvaluationOptions, PoseScores, Stratum, Table, TruthExtent, VehicleOutcome,
    breakdown, calibrate, evaluate_frames, paper_configurations, paper_tables, score_table,
    summarize,
};
use partpose::files;
use partpose::oracle::{Degradation, OracleBox};
use partpose::pose::{Center2d, Center3d, PartFilters, PoseOptions};
use partpose::vehicle::ModelZoo;

use serde_json::json;

use crate::pose_flags::PoseFlags;
use crate::progress;
use crate::report::{self, Outcome, hint, warn};

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
    write(arguments, &evaluated)?;
    Ok(if evaluated.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn evaluate(arguments: &Arguments) -> anyhow::Result<Evaluated> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let sequences = dataset.select(&arguments.worlds, &arguments.variations)?;
    let mut configurations = configurations(arguments);
    let mut skipped = 0;
    let frames = frames(&dataset, &sequences, arguments.stride, &mut skipped)?;
    let mut rows: Vec<Vec<Row>> = configurations.iter().map(|_| Vec::new()).collect();
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

fn row(frame: &Frame, mut outcome: VehicleOutcome) -> Row {
    let label = &frame.vehicles[outcome.vehicle];
    // Kernels of thousands of vehicles would fill the memory.
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

fn write(arguments: &Arguments, evaluated: &Evaluated) -> anyhow::Result<()> {
    let scores: Vec<(String, PoseScores)> = evaluated
        .configurations
        .iter()
        .zip(&evaluated.rows)
        .map(|(configuration, rows)| {
            (configuration.name.clone(), summarize(rows.iter().map(|row| row.outcome.scored)))
        })
        .collect();
    let mut tables = if arguments.tables { paper_tables(&scores) } else { Vec::new() };
    let others: Vec<(String, PoseScores)> = scores
        .iter()
        .filter_map(|(name, scores)| Some((name.strip_prefix("past: ")?.to_owned(), *scores)))
        .collect();
    if !others.is_empty() {
        tables.push(score_table("Past the tables: visible centres, LM", &others));
    }
    let detailed = evaluated.rows.len() - 1;
    let by = breakdown(
        &evaluated.rows[detailed]
            .iter()
            .map(|row| (row.stratum, row.outcome.scored))
            .collect::<Vec<_>>(),
    );
    let title = format!(
        "By distance, occlusion and truncation: {}",
        evaluated.configurations[detailed].name
    );
    tables.push(score_table(&title, &by));
    let text = markdown(&tables);
    report::data(&text)?;
    let file = |name: &str| arguments.out.join(name);
    files::write(&file("tables.md"), text.as_bytes())?;
    for (index, table) in tables.iter().enumerate() {
        files::write(&file(&format!("table-{}.csv", index + 1)), table.to_csv().as_bytes())?;
    }
    files::write(&file("vehicles.csv"), vehicle_list(evaluated).to_csv().as_bytes())?;
    write_metrics(&file("metrics.json"), arguments, evaluated, &scores, &by)
}

fn markdown(tables: &[Table]) -> String {
    tables.iter().map(Table::to_markdown).collect::<Vec<_>>().join("\n")
}

/// One configuration's scores stand at the top, as `count`, `mean_iou3d` and so on; all of them under `rows`.
fn write_metrics(
    path: &Path,
    arguments: &Arguments,
    evaluated: &Evaluated,
    scores: &[(String, PoseScores)],
    by: &[(String, PoseScores)],
) -> anyhow::Result<()> {
    let last = scores.len() - 1;
    let mut metrics = serde_json::to_value(scores[last].1)?;
    let rows: Vec<_> = scores
        .iter()
        .zip(&evaluated.configurations)
        .zip(&evaluated.rows)
        .map(|(((name, scores), configuration), rows)| {
            let accuracy = rows.iter().map(|row| row.outcome.pixel_accuracy).sum::<f64>();
            json!({
                "name": name,
                "kernel": configuration.kernel,
                "pose": configuration.pose,
                "degradation_strength": configuration.degradation.map(|d| d.strength),
                "mean_pixel_accuracy": accuracy / rows.len().max(1) as f64,
                "scores": scores,
            })
        })
        .collect();
    let Some(object) = metrics.as_object_mut() else { bail!("scores are not an object") };
    object.insert("name".to_owned(), json!(scores[last].0));
    object.insert("extent".to_owned(), json!(extent_name(arguments.extent)));
    object.insert("skipped_frames".to_owned(), json!(evaluated.skipped));
    object.insert("rows".to_owned(), json!(rows));
    let by: Vec<_> = by.iter().map(|(name, s)| json!({ "name": name, "scores": s })).collect();
    object.insert("breakdown".to_owned(), json!(by));
    let text = serde_json::to_string_pretty(&metrics)?;
    files::write(path, text.as_bytes()).context("the metrics could not be written")
}

fn extent_name(extent: ExtentFlag) -> String {
    extent.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned())
}

/// Every vehicle under the last configuration.
fn vehicle_list(evaluated: &Evaluated) -> Table {
    let columns = [
        "sequence",
        "frame",
        "track",
        "model",
        "depth",
        "occluded",
        "truncated",
        "pixel_accuracy",
        "predicted_model",
        "reprojection_rmse",
        "iou3d",
        "delta_x",
        "delta_y",
        "delta_z",
        "delta_alpha_x",
        "delta_alpha_y",
        "delta_alpha_z",
        "no_pose",
    ];
    let mut table = Table::new("vehicles", &columns);
    for row in evaluated.rows.last().into_iter().flatten() {
        let mut cells = vec![
            row.sequence.clone(),
            row.frame.to_string(),
            row.track.map_or(String::new(), |track| track.to_string()),
            row.model.clone(),
            format!("{:.2}", row.stratum.depth),
            row.stratum.occluded.to_string(),
            row.stratum.truncated.to_string(),
            format!("{:.4}", row.outcome.pixel_accuracy),
        ];
        match (&row.outcome.estimate, &row.outcome.scored) {
            (Ok(estimate), Some(d)) => {
                cells.push(estimate.model.clone());
                cells.push(format!("{:.3}", estimate.reprojection_rmse));
                let numbers = std::iter::once(d.iou3d).chain(d.translation).chain(d.rotation);
                cells.extend(numbers.map(|value| format!("{value:.4}")));
                cells.push(String::new());
            }
            (outcome, _) => {
                cells.extend(std::iter::repeat_n(String::new(), 9));
                cells.push(outcome.as_ref().err().map_or(String::new(), ToString::to_string));
            }
        }
        table.rows.push(cells);
    }
    table
}
