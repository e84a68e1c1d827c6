//! `partpose evaluate masks`: the paper's Table II, what is confused with what, Fig. 4, and the kernel that sizes imply.

mod figure;
mod output;

use std::path::PathBuf;

use partpose::dataset::{Dataset, Frame};
use partpose::eval::masks::{Confusion, MaskScore, score_mask};
use partpose::eval::matching::{MatchOptions, TruthBoxes, match_detections};
use partpose::files;
use partpose::oracle::OracleOptions;
use partpose::parts::Scaling;
use partpose::vehicle::ModelZoo;

use super::boxes::BoxFlag;
use super::selection::{self, Needs, Selection};
use super::source::{ScoredFrame, Source, SourceFlags, score_frames};
use crate::report::{Outcome, hint, note};

/// The ways of scaling that Table II compares.
const SCALINGS: [(Scaling, &str); 2] =
    [(Scaling::Bilinear, "bilinear"), (Scaling::Nearest, "nearest")];

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose evaluate masks --dataset DIR --out scores
      the network that comes with the program on every labelled world
  partpose evaluate masks --dataset DIR --oracle --out scores
      perfect kernels alone: what a size of kernel allows at best")]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,
    #[command(flatten)]
    source: SourceFlags,
    /// Score nothing but the perfect kernels that stand below the detections in Table II
    #[arg(long, conflicts_with_all = ["detections", "weights"])]
    oracle: bool,
    /// Cells a side of the perfect kernels
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "14,28,42,56", value_parser = clap::value_parser!(u32).range(1..=512))]
    kernel: Vec<u32>,
    /// Box that vehicles are found by, and box of the perfect kernels
    #[arg(long = "box", value_enum, default_value = "annotated")]
    bounds: BoxFlag,
    /// Folder of the models by which the part masks are told apart by vehicle; the embedded ones if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Vehicle of `figure-4.png` as FRAME:TRACK, such as `0001/clone/00012:3`; if not given one that is hardly hidden
    #[arg(long, value_name = "VEHICLE")]
    vehicle: Option<String>,
    /// Folder for metrics, tables and pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// An assigned detection under both scalings.
struct Assigned {
    frame: usize,
    scores: [MaskScore; 2],
}

/// All that is known of one source.
struct Row {
    name: String,
    masks: Vec<Assigned>,
    /// Of all assigned detections, by scaling.
    confusion: [Confusion; 2],
}

/// The assigned detections of a frame.
struct FrameMasks {
    scores: Vec<[MaskScore; 2]>,
    confusion: [Confusion; 2],
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut sources = if arguments.oracle { Vec::new() } else { arguments.source.open()? };
    let bounds = arguments.bounds.of_oracle();
    for kernel in arguments.kernel.iter().map(|m| *m as usize) {
        sources.push(Source::oracle(OracleOptions { kernel, bounds, ..Default::default() }));
    }
    let dataset = Dataset::open(&arguments.selection.dataset)?;
    let sequences = arguments.selection.sequences(&dataset, arguments.oracle)?;
    let (frames, mut skipped) =
        selection::read(&dataset, &sequences, arguments.selection.stride, Needs::PartMask)?;
    let zoo = match &arguments.zoo {
        Some(path) => ModelZoo::load(path)?,
        None => ModelZoo::embedded(),
    };
    files::create_folder(&arguments.out)?;
    let mut rows: Vec<Row> = sources
        .iter()
        .map(|source| Row {
            name: source.name.clone(),
            masks: Vec::new(),
            confusion: Default::default(),
        })
        .collect();
    skipped += score_frames(
        &frames,
        &sources,
        Some(&zoo),
        &|scored| score(arguments, scored),
        &mut |source, frame, masks| {
            let row = &mut rows[source];
            row.masks.extend(masks.scores.into_iter().map(|scores| Assigned { frame, scores }));
            for (sum, more) in row.confusion.iter_mut().zip(&masks.confusion) {
                sum.add(more);
            }
        },
    )?;
    if rows[0].masks.is_empty() {
        return Err(hint(
            anyhow::anyhow!("no detection of `{}` is assigned to a vehicle", rows[0].name),
            "`partpose evaluate boxes` tells which boxes were found; `--min-score` lets more in",
        ));
    }
    output::write(arguments, &frames, &rows, skipped)?;
    figure::write(arguments, &frames, &zoo, &sources)?;
    note(format_args!(
        "scored {} detections; wrote metrics, tables and pictures to `{}`",
        rows[0].masks.len(),
        arguments.out.display()
    ));
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn score(arguments: &Arguments, scored: &ScoredFrame) -> FrameMasks {
    let mut masks = FrameMasks { scores: Vec::new(), confusion: Default::default() };
    let (frame, Some(oracle)) = (scored.frame, scored.oracle) else { return masks };
    let bounds = |vehicle: usize| match arguments.bounds {
        BoxFlag::Annotated => Some(frame.vehicles[vehicle].bounds),
        BoxFlag::Tight => oracle.tight_bounds(vehicle),
    };
    let (truths, vehicles) = TruthBoxes::of_frame(frame, &bounds);
    let boxes: Vec<_> = scored.detections.iter().map(|found| (found.bounds, found.score)).collect();
    let verdicts = match_detections(&boxes, &truths, &MatchOptions::default());
    for (verdict, detection) in verdicts.iter().zip(scored.detections) {
        let Some(truth) = verdict.truth().filter(|_| detection.score >= arguments.source.min_score)
        else {
            continue;
        };
        let truth = oracle.vehicle_mask(vehicles[truth], &detection.bounds);
        let scores = std::array::from_fn(|scaling| {
            let mask = detection.part_mask(frame.camera.size, SCALINGS[scaling].0);
            masks.confusion[scaling].add_mask(&mask, &truth);
            score_mask(&mask, &truth)
        });
        masks.scores.push(scores);
    }
    masks
}

/// The vehicles of the frames that count, as boxes.
fn counted_boxes(frames: &[Frame]) -> Vec<partpose::geometry::Rect> {
    let vehicles = frames.iter().flat_map(|frame| &frame.vehicles);
    vehicles.filter(|vehicle| !vehicle.dont_care).map(|vehicle| vehicle.bounds).collect()
}
