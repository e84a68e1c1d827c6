//! `partpose evaluate tracks`: vehicles followed through sequences, against the labels.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use partpose::dataset::{Dataset, Frame, VehicleLabel};
use partpose::eval::matching::{MatchOptions, TruthBoxes, match_detections};
use partpose::eval::tracks::{PoseSeries, TrackSample, TrackScores, score_tracks};
use partpose::eval::{
    Configuration, EvaluationOptions, FrameOutcome, Table, TruthExtent, calibrate, evaluate_frames,
};
use partpose::geometry::{Cuboid, Pose};
use partpose::oracle::{Degradation, HeadErrors, OracleBox};
use partpose::pose::{PnpMethod, PoseOptions};
use partpose::track::{Observation, SequenceFrame, TrackOptions, TrackedPose, smooth_sequence};
use partpose::vehicle::ModelZoo;
use serde_json::json;

use super::scores;
use super::selection::{self, Needs, Selection};
use crate::commands::detection_files::ImageIndex;
use crate::commands::export::read_results;
use crate::progress;
use crate::report::{Outcome, hint, warn};

/// Frames that the strength of degradation is found on.
const CALIBRATION_FRAMES: usize = 30;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose run DIR/vkitti_1.3.1_rgb --camera DIR --track --out run
  partpose evaluate tracks --dataset DIR --results run --out scores
      what `run --track` or `fit --track` wrote
  partpose evaluate tracks --dataset DIR --worlds 0018 --zoo ZOO --oracle --extent model --out scores
      poses and tracks from masks made of the ground truth")]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,
    /// Folder of the results of `run --track` or `fit --track`, of images that are named as in the data set
    #[arg(long, value_name = "DIR", required_unless_present = "oracle")]
    results: Option<PathBuf>,
    /// Make detections from the ground truth, fit and follow them
    #[arg(long, conflicts_with = "results")]
    oracle: bool,
    /// Folder of the models for the oracle; the embedded ones if not given
    #[arg(long, value_name = "DIR", requires = "oracle")]
    zoo: Option<PathBuf>,
    /// Where sizes come from with the oracle
    #[arg(long, value_enum, default_value = "model", requires = "oracle")]
    extent: ExtentFlag,
    /// Lower the oracle's pixel accuracy to this, in percent
    #[arg(long, value_name = "PERCENT", value_parser = clap::value_parser!(u32).range(1..=100), requires = "oracle")]
    degrade: Option<u32>,
    /// With the oracle: follow vehicles in the world, with the data set's poses of the camera
    #[arg(long, requires = "oracle")]
    camera_motion: bool,
    /// Frames a second of the data set, for the oracle
    #[arg(long, value_name = "N", default_value_t = 10.0)]
    fps: f64,
    /// Folder for metrics and the table
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ExtentFlag {
    /// The true size
    Truth,
    /// That of the model
    Model,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&arguments.selection.dataset)?;
    let sequences = arguments.selection.sequences(&dataset, arguments.oracle)?;
    let needs = if arguments.oracle { Needs::PartMask } else { Needs::Labels };
    let (frames, skipped) =
        selection::read(&dataset, &sequences, arguments.selection.stride, needs)?;
    let frames: Vec<&[Frame]> = frames.chunk_by(|a, b| a.sequence == b.sequence).collect();
    let (samples, missing) = match &arguments.results {
        Some(results) => of_results(results, &frames)?,
        None => of_oracle(arguments, &frames)?,
    };
    let scores = score_tracks(&samples);
    if scores.tracked == 0 {
        return Err(hint(
            anyhow::anyhow!("no labelled vehicle has a track"),
            "results have tracks where `run` or `fit` was given `--track`",
        ));
    }
    scores::write_tables(&arguments.out, &json!(scores), &[table(&scores)])?;
    let scored = format!("{} sightings of {} vehicles", scores.sightings, scores.labels);
    scores::finish(
        &arguments.out,
        &scored,
        &[(skipped, "faulty places of the data set"), (missing, "frames without results or masks")],
    )
}

/// The sequences' samples, and how many frames have none.
type Samples = anyhow::Result<(Vec<TrackSample>, usize)>;

/// Labelled vehicles, and the detections that found them.
fn of_results(results: &Path, sequences: &[&[Frame]]) -> Samples {
    let (images, unreadable) = read_results(results, None)?;
    let index = ImageIndex::new(images.iter().map(|image| image.image.clone()).collect());
    let (mut samples, mut missing) = (Vec::new(), unreadable);
    for (sequence, frames) in sequences.iter().enumerate() {
        for frame in *frames {
            let Some(image) = index.of_frame(frame)? else {
                missing += 1;
                continue;
            };
            let found = &images[image].vehicles;
            let boxes: Vec<_> = found.iter().map(|found| (found.bounds, found.score)).collect();
            let (truths, vehicles) =
                TruthBoxes::of_frame(frame, &|vehicle| Some(frame.vehicles[vehicle].bounds));
            let verdicts = match_detections(&boxes, &truths, &MatchOptions::default());
            for (verdict, found) in verdicts.iter().zip(found) {
                let Some(truth) = verdict.truth() else { continue };
                let label = &frame.vehicles[vehicles[truth]];
                let Some(number) = label.track else { continue };
                samples.push(TrackSample {
                    sequence,
                    frame: frame.index,
                    label: number,
                    truth: label.cuboid,
                    alone: found.cuboid,
                    tracked: found.track.as_ref().map(|track| (track.id, track.cuboid)),
                });
            }
        }
    }
    Ok((samples, missing))
}

/// The same of what the oracle sees, fitted and followed here.
fn of_oracle(arguments: &Arguments, sequences: &[&[Frame]]) -> Samples {
    let zoo = match &arguments.zoo {
        Some(folder) => ModelZoo::load(folder)?,
        None => ModelZoo::embedded(),
    };
    let options = EvaluationOptions {
        zoo: &zoo,
        extent: match arguments.extent {
            ExtentFlag::Truth => TruthExtent::PerAxis,
            ExtentFlag::Model => TruthExtent::None,
        },
        bounds: OracleBox::Annotated,
        heads: HeadErrors::default(),
        include: &|_, _| true,
        right_models: &|_| Vec::new(),
        keep_detections: &|_, _| false,
        scene: None,
        observe: false,
    };
    let pose = PoseOptions { method: PnpMethod::Dense, ..PoseOptions::default() };
    let mut configuration =
        Configuration { name: "dense".to_owned(), kernel: 28, pose, degradation: None };
    if let Some(percent) = arguments.degrade {
        let target = f64::from(percent) / 100.0;
        let all: Vec<&Frame> = sequences.iter().copied().flatten().collect();
        let step = all.len().div_ceil(CALIBRATION_FRAMES).max(1);
        let sample: Vec<Frame> = all.into_iter().step_by(step).cloned().collect();
        let found = calibrate(&sample, &options, &configuration, target, 0);
        let strength = found.map_or(0.0, |(strength, _)| strength);
        configuration.degradation = Some(Degradation { strength, seed: 0 });
    }
    let count = sequences.iter().map(|frames| frames.len()).sum::<usize>();
    let bar = progress::bar("frames", count as u64);
    let (mut samples, mut missing) = (Vec::new(), 0);
    for (sequence, frames) in sequences.iter().enumerate() {
        let outcomes =
            evaluate_frames(frames, &options, std::slice::from_ref(&configuration), &|| bar.inc(1));
        missing += outcomes.iter().filter(|outcome| outcome.is_err()).count();
        samples.extend(follow(arguments, sequence, frames, outcomes));
    }
    bar.finish_and_clear();
    Ok((samples, missing))
}

/// Follows what was fitted in the frames of a sequence.
fn follow(
    arguments: &Arguments,
    sequence: usize,
    frames: &[Frame],
    outcomes: Vec<FrameOutcome>,
) -> Vec<TrackSample> {
    let (mut seen, mut vehicles) = (Vec::new(), Vec::new());
    let mut before: Option<Pose> = None;
    for (frame, outcome) in frames.iter().zip(outcomes) {
        let found = outcome.unwrap_or_else(|error| {
            warn(format_args!("skipped frame {}: {error}", frame.name()));
            Vec::new()
        });
        let mut observations = Vec::new();
        for outcome in found.into_iter().flatten() {
            let label = &frame.vehicles[outcome.vehicle];
            let Ok(estimate) = &outcome.estimate else { continue };
            observations.push(Observation::of(&label.bounds, 1.0, estimate));
            vehicles.push((frame, label, estimate.cuboid()));
        }
        let moved = match (&frame.world_from_camera, &before) {
            (Some(now), Some(before)) if arguments.camera_motion => now.inverse() * before,
            _ => Pose::identity(),
        };
        before = frame.world_from_camera;
        seen.push(SequenceFrame {
            time: f64::from(frame.index) / arguments.fps,
            camera: frame.camera,
            camera_from_previous: moved,
            seen: observations,
        });
    }
    let tracked = smooth_sequence(&seen, &TrackOptions::default());
    let sample = |((frame, label, alone), tracked): (
        &(&Frame, &VehicleLabel, Cuboid),
        &Option<TrackedPose>,
    )| {
        Some(TrackSample {
            sequence,
            frame: frame.index,
            label: label.track?,
            truth: label.cuboid,
            alone: *alone,
            tracked: tracked.as_ref().map(|tracked| (tracked.track, tracked.cuboid)),
        })
    };
    vehicles.iter().zip(tracked.iter().flatten()).filter_map(sample).collect()
}

fn table(scores: &TrackScores) -> Table {
    let title = format!(
        "{} of {} sightings of {} vehicles are followed; {} changes of number, {} tracks of more than one vehicle",
        scores.tracked, scores.sightings, scores.labels, scores.switches, scores.mixed
    );
    let columns = ["pose", "3D IoU %", "off by m", "turned by °", "jitter m", "jitter °"];
    let mut table = Table::new(&title, &columns);
    for (name, series) in [("of its frame", &scores.alone), ("of its track", &scores.together)] {
        let PoseSeries { mean_iou3d, mean_distance, mean_angle, jitter, turn_jitter } = series;
        table.rows.push(vec![
            name.to_owned(),
            format!("{:.1}", 100.0 * mean_iou3d),
            format!("{mean_distance:.2}"),
            format!("{:.1}", mean_angle.to_degrees()),
            format!("{jitter:.3}"),
            format!("{:.2}", turn_jitter.to_degrees()),
        ]);
    }
    table
}
