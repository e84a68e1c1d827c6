//! `partpose evaluate boxes`: the paper's Table I, and COCO's average precision.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::ValueEnum;
use partpose::dataset::{Dataset, Frame};
use partpose::eval::Table;
use partpose::eval::boxes::{
    BoxFrame, BoxScores, CurvePoint, coco_box_scores, precision_recall, score_boxes,
};
use partpose::eval::coco::CocoScores;
use partpose::eval::matching::{MatchOptions, TruthBoxes};
use partpose::files;
use partpose::geometry::Rect;
use partpose::oracle::{OracleBox, OracleOptions};
use partpose::vehicle::ModelZoo;
use partpose::viz::{Axis, Mark, Plot, Series, plot};
use serde_json::{Value, json};

use super::scores;
use super::selection::{self, Needs, Selection};
use super::source::{ScoredFrame, Source, SourceFlags, score_frames, share};
use crate::report::{Outcome, note};

/// Ends of the bands of height in which recall is told, pixels.
const HEIGHTS: [f64; 5] = [0.0, 40.0, 80.0, 160.0, f64::INFINITY];
/// Points of a curve that go into `metrics.json`.
const MOST_POINTS: usize = 200;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose evaluate boxes --dataset DIR --out scores
      the network that comes with the program on every labelled world
  partpose evaluate boxes --dataset DIR --worlds 0018 --detections run/detections --out scores
      what `partpose run --out run` wrote")]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,
    #[command(flatten)]
    source: SourceFlags,
    /// Score perfect detections, made from the part masks: what the evaluation itself allows
    #[arg(long)]
    oracle: bool,
    /// What detections are held against
    #[arg(long = "box", value_enum, default_value = "annotated")]
    bounds: BoxFlag,
    /// Least intersection over union of a detection and its vehicle
    #[arg(long, value_name = "IOU", default_value_t = 0.5, value_parser = share)]
    min_iou: f64,
    /// Folder of the models by which the part masks are told apart by vehicle; the embedded ones if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Folder for metrics, tables and curves
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum BoxFlag {
    /// The annotated box, the projection of the cuboid
    Annotated,
    /// The tight box of the vehicle's own pixels; a vehicle that shows none is ignored
    Tight,
}

impl BoxFlag {
    pub(super) fn of_oracle(self) -> OracleBox {
        match self {
            Self::Annotated => OracleBox::Annotated,
            Self::Tight => OracleBox::Tight,
        }
    }
}

/// The frames of one source that it could do, with their places.
struct Row {
    name: String,
    frames: Vec<(usize, BoxFrame)>,
}

impl Row {
    fn boxes(&self) -> impl Iterator<Item = &BoxFrame> {
        self.frames.iter().map(|(_, frame)| frame)
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let mut sources = Vec::new();
    if arguments.source.are_given() || !arguments.oracle {
        sources = arguments.source.open()?;
    }
    if arguments.oracle {
        let bounds = arguments.bounds.of_oracle();
        sources.push(Source::oracle(OracleOptions { bounds, ..Default::default() }));
    }
    let masks = arguments.oracle || arguments.bounds == BoxFlag::Tight;
    let dataset = Dataset::open(&arguments.selection.dataset)?;
    let clear = sources.iter().all(Source::is_oracle);
    let sequences = arguments.selection.sequences(&dataset, clear)?;
    let needs = if masks { Needs::PartMask } else { Needs::Labels };
    let (frames, mut skipped) =
        selection::read(&dataset, &sequences, arguments.selection.stride, needs)?;
    let zoo = match &arguments.zoo {
        Some(path) => ModelZoo::load(path)?,
        None => ModelZoo::embedded(),
    };
    files::create_folder(&arguments.out)?;
    let mut rows: Vec<Row> = sources
        .iter()
        .map(|source| Row { name: source.name.clone(), frames: Vec::new() })
        .collect();
    skipped += score_frames(
        &frames,
        &sources,
        masks.then_some(&zoo),
        &|scored| match_frame(arguments, scored),
        &mut |source, frame, boxes| rows[source].frames.push((frame, boxes)),
    )?;
    write(arguments, &frames, &rows, skipped)?;
    note(format_args!(
        "scored {} frames; wrote metrics, tables and curves to `{}`",
        rows[0].frames.len(),
        arguments.out.display()
    ));
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn match_frame(arguments: &Arguments, scored: &ScoredFrame) -> BoxFrame {
    let bounds = |vehicle: usize| match (arguments.bounds, scored.oracle) {
        (BoxFlag::Tight, Some(oracle)) => oracle.tight_bounds(vehicle),
        _ => Some(scored.frame.vehicles[vehicle].bounds),
    };
    let (truths, _) = TruthBoxes::of_frame(scored.frame, &bounds);
    let detections = scored.detections.iter().map(|found| (found.bounds, found.score)).collect();
    let options = MatchOptions { min_iou: arguments.min_iou, ..MatchOptions::default() };
    BoxFrame::new(detections, truths, &options)
}

fn write(
    arguments: &Arguments,
    frames: &[Frame],
    rows: &[Row],
    skipped: usize,
) -> anyhow::Result<()> {
    let min_score = arguments.source.min_score;
    let scored: Vec<(String, BoxScores, CocoScores)> = rows
        .iter()
        .map(|row| {
            let frames: Vec<BoxFrame> = row.boxes().cloned().collect();
            (row.name.clone(), score_boxes(&frames, min_score), coco_box_scores(&frames))
        })
        .collect();
    let curves: Vec<(String, Vec<CurvePoint>)> = rows
        .iter()
        .map(|row| (row.name.clone(), precision_recall(&row.boxes().cloned().collect::<Vec<_>>())))
        .collect();
    let groups: Vec<(String, BoxScores)> =
        rows.iter().flat_map(|row| by_sequence(frames, row, min_score)).collect();
    let heights = recall_by_height(rows, min_score);
    let mut tables = vec![table_one(&scored)];
    if groups.len() > rows.len() {
        tables.push(group_table(&groups));
    }
    tables.push(height_table(rows, &heights));
    let metrics = metrics(arguments, &scored, (&curves, &groups), skipped);
    scores::write(&arguments.out, &metrics, &tables, &picture(&curves))?;
    files::write(&arguments.out.join("curves.csv"), curve_table(&curves).to_csv().as_bytes())?;
    Ok(())
}

fn percent(share: f64) -> String {
    if share.is_nan() { "-".to_owned() } else { format!("{:.2}", 100.0 * share) }
}

fn figure(scores: &CocoScores, name: &str) -> f64 {
    let found = scores.figures.iter().find(|(known, _)| *known == name);
    found.and_then(|(_, value)| *value).unwrap_or(f64::NAN)
}

fn table_one(scored: &[(String, BoxScores, CocoScores)]) -> Table {
    let columns = [
        "detections",
        "frames",
        "vehicles",
        "assigned",
        "wrong",
        "ignored",
        "precision %",
        "recall %",
        "mIoU %",
        "AP %",
        "AP50 %",
        "AP75 %",
    ];
    let mut table = Table::new("Table I: boxes", &columns);
    for (name, s, coco) in scored {
        let mut cells = vec![name.clone()];
        let counts = [s.frames, s.vehicles, s.assigned, s.wrong, s.ignored];
        cells.extend(counts.map(|count| count.to_string()));
        cells.extend([s.precision, s.recall, s.mean_iou].map(percent));
        cells.extend(["AP", "AP50", "AP75"].map(|name| percent(figure(coco, name))));
        table.rows.push(cells);
    }
    table
}

/// Scores by variation and by world, where there are several.
fn by_sequence(frames: &[Frame], row: &Row, min_score: f64) -> Vec<(String, BoxScores)> {
    let mut groups: [BTreeMap<String, Vec<&BoxFrame>>; 2] = Default::default();
    for (frame, boxes) in &row.frames {
        let id = &frames[*frame].sequence;
        for (groups, name) in groups.iter_mut().zip([&id.variation, &id.world]) {
            groups.entry(name.clone()).or_default().push(boxes);
        }
    }
    let several = groups.into_iter().filter(|groups| groups.len() > 1);
    several
        .flatten()
        .map(|(name, frames)| (format!("{}: {name}", row.name), score_boxes(frames, min_score)))
        .collect()
}

fn group_table(groups: &[(String, BoxScores)]) -> Table {
    let columns = ["detections", "frames", "vehicles", "precision %", "recall %", "mIoU %"];
    let mut table = Table::new("By variation and world", &columns);
    for (name, s) in groups {
        let mut cells = vec![name.clone(), s.frames.to_string(), s.vehicles.to_string()];
        cells.extend([s.precision, s.recall, s.mean_iou].map(percent));
        table.rows.push(cells);
    }
    table
}

/// Vehicles and how many of them were found, by source and band of height.
fn recall_by_height(rows: &[Row], min_score: f64) -> Vec<[[usize; 2]; 4]> {
    let band = |bounds: &Rect| {
        (1..HEIGHTS.len()).find(|i| bounds.height() < HEIGHTS[*i]).map_or(3, |i| i - 1)
    };
    let count = |row: &Row| {
        let mut counts = [[0; 2]; 4];
        for frame in row.boxes() {
            for bounds in &frame.truths.counted {
                counts[band(bounds)][0] += 1;
            }
            for ((_, score), verdict) in frame.detections.iter().zip(&frame.verdicts) {
                if let (true, Some(truth)) = (*score >= min_score, verdict.truth()) {
                    counts[band(&frame.truths.counted[truth])][1] += 1;
                }
            }
        }
        counts
    };
    rows.iter().map(count).collect()
}

fn height_table(rows: &[Row], heights: &[[[usize; 2]; 4]]) -> Table {
    let mut columns = vec!["detections".to_owned()];
    columns.extend(HEIGHTS.windows(2).map(|band| match band {
        [low, high] if high.is_finite() => format!("{low} to {high} px"),
        [low, ..] => format!("from {low} px"),
        [] => String::new(),
    }));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::new("Recall by the height of the vehicle's box, %", &columns);
    for (row, counts) in rows.iter().zip(heights) {
        let mut cells = vec![row.name.clone()];
        cells.extend(counts.iter().map(|[all, found]| {
            if *all == 0 {
                return "-".to_owned();
            }
            format!("{} of {all}", percent(*found as f64 / *all as f64))
        }));
        table.rows.push(cells);
    }
    table
}

fn metrics(
    arguments: &Arguments,
    scored: &[(String, BoxScores, CocoScores)],
    (curves, groups): (&[(String, Vec<CurvePoint>)], &[(String, BoxScores)]),
    skipped: usize,
) -> Value {
    let row = |(name, scores, coco): &(String, BoxScores, CocoScores)| {
        let mut row = json!(scores);
        if let Some(object) = row.as_object_mut() {
            object.insert("name".to_owned(), json!(name));
            object.insert("ap".to_owned(), json!(figure(coco, "AP")));
            object.insert("ap50".to_owned(), json!(figure(coco, "AP50")));
            let figures = coco.figures.iter();
            let figures: serde_json::Map<_, _> =
                figures.map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
            object.insert("coco".to_owned(), Value::Object(figures));
        }
        row
    };
    let rows: Vec<Value> = scored.iter().map(row).collect();
    let mut metrics = rows[0].clone();
    if let Some(object) = metrics.as_object_mut() {
        let curve = |(name, points): &(String, Vec<CurvePoint>)| {
            let step = points.len().div_ceil(MOST_POINTS).max(1);
            let points: Vec<_> = points.iter().step_by(step).collect();
            json!({ "name": name, "points": points })
        };
        let group = |(name, s): &(String, BoxScores)| json!({ "name": name, "scores": s });
        object.insert("rows".to_owned(), Value::Array(rows));
        object.insert("curves".to_owned(), curves.iter().map(curve).collect());
        object.insert("by_sequence".to_owned(), groups.iter().map(group).collect());
        object.insert("skipped_frames".to_owned(), json!(skipped));
        object.insert("settings".to_owned(), settings(arguments));
    }
    metrics
}

fn settings(arguments: &Arguments) -> Value {
    let selection = &arguments.selection;
    let bounds = arguments.bounds.to_possible_value();
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "dataset": selection.dataset.display().to_string(),
        "worlds": selection.worlds,
        "variations": selection.variations,
        "stride": selection.stride,
        "min_score": arguments.source.min_score,
        "min_iou": arguments.min_iou,
        "box": bounds.map_or(String::new(), |value| value.get_name().to_owned()),
    })
}

fn curve_table(curves: &[(String, Vec<CurvePoint>)]) -> Table {
    let mut table = Table::new("curves", &["detections", "score", "precision", "recall"]);
    for (name, points) in curves {
        for point in points {
            let mut cells = vec![name.clone()];
            let numbers = [point.score, point.precision, point.recall];
            cells.extend(numbers.map(|number| format!("{number:.5}")));
            table.rows.push(cells);
        }
    }
    table
}

fn picture(curves: &[(String, Vec<CurvePoint>)]) -> files::RgbImage {
    let series = curves.iter().map(|(name, points)| {
        let points = points.iter().map(|point| [point.recall, point.precision]);
        Series::new(name, Mark::Curve, points.filter(|p| p[0].is_finite()).collect())
    });
    plot(&Plot {
        title: "Boxes: precision over recall as the least score falls".to_owned(),
        x: Axis::over("recall", [0.0, 1.0]),
        y: Axis::over("precision", [0.0, 1.0]),
        series: series.collect(),
        ..Plot::default()
    })
}
