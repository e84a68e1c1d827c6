//! Looks for what a reader alone cannot see: rows that contradict their images, each other, or the convention.
//!
//! The annotated 2D boxes of Virtual KITTI are projections of the cuboids, so that projecting them again finds nearly
//! every mistake in a row or in a reader: a swapped column is off by tens of pixels where the published files are off
//! by less than one. KITTI's boxes were drawn by hand and fit to several pixels only.

mod archives;
mod convention;
mod reprojection;

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{Dataset, DatasetError, Fault, Layout, Problem, SequenceFrames, SequenceId};

pub use archives::Archives;
pub use reprojection::Reprojection;

/// How thoroughly a data set is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CheckOptions {
    /// Part masks decoded in each sequence, spread evenly; `None` for all.
    pub masks: Option<usize>,
    /// Rows listed whose boxes fit worst, in each sequence.
    pub worst: usize,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self { masks: Some(8), worst: 10 }
    }
}

/// What a data set holds and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// The layout that was recognised.
    pub layout: Layout,
    /// Its sequences.
    pub sequences: Vec<SequenceReport>,
    /// What is wrong.
    pub problems: Vec<Problem>,
    /// Problems that are not listed because there are too many.
    pub problems_omitted: usize,
    /// What is absent, which is no fault.
    pub missing: Vec<Missing>,
}

impl CheckReport {
    /// Whether nothing is wrong.
    pub fn is_clean(&self) -> bool {
        self.problems.is_empty() && self.problems_omitted == 0
    }
}

/// Something that a data set could have and has not.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Missing {
    /// What is absent, and from how many sequences.
    pub what: String,
    /// What cannot be done without it.
    pub consequence: &'static str,
}

/// What a sequence holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SequenceReport {
    /// World.
    pub world: String,
    /// Variation; empty where there is none.
    pub variation: String,
    /// Frames without fault.
    pub frames: usize,
    /// Frames that readers leave out.
    pub skipped: usize,
    /// Labelled vehicles in all frames.
    pub rows: usize,
    /// Those that are not to be ignored.
    pub rows_counted: usize,
    /// Different vehicles, where they are tracked.
    pub tracks: usize,
    /// Rows, rows that count, and vehicles of each category and model.
    pub models: Vec<ModelReport>,
    /// How well cuboids project onto 2D boxes, over vehicles wholly in the image.
    pub reprojection: Option<Reprojection>,
    /// Which images are there.
    pub archives: Archives,
}

/// The vehicles of one category and model.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ModelReport {
    /// `Car`, `Van`, `Truck`.
    pub category: String,
    /// Name of the mesh, where the data set has it.
    pub model: Option<String>,
    /// Labelled vehicles in all frames.
    pub rows: usize,
    /// Those that are not to be ignored.
    pub rows_counted: usize,
    /// Different vehicles, where they are tracked.
    pub tracks: usize,
}

/// Checks all sequences; `progress` hears of each before it is read.
pub fn check(
    dataset: &Dataset,
    options: &CheckOptions,
    progress: &mut dyn FnMut(&SequenceId),
) -> CheckReport {
    let mut report = CheckReport {
        layout: dataset.layout(),
        sequences: Vec::new(),
        problems: Vec::new(),
        problems_omitted: 0,
        missing: Vec::new(),
    };
    for id in dataset.sequences() {
        progress(id);
        match dataset.read(id) {
            Ok(read) => check_sequence(dataset, id, &read, options, &mut report),
            Err(error) => report.problems.push(hopeless(dataset, id, error)),
        }
    }
    // What concerns whole files explains what follows on their lines.
    report.problems.sort_by_key(|problem| problem.line.is_some());
    report.missing = archives::missing(dataset.layout(), &report.sequences);
    report
}

fn check_sequence(
    dataset: &Dataset,
    id: &SequenceId,
    read: &SequenceFrames,
    options: &CheckOptions,
    report: &mut CheckReport,
) {
    report.problems.extend(read.problems.iter().cloned());
    report.problems_omitted += read.problems_omitted;
    let (archives, found) = archives::check(dataset.layout(), read, options.masks);
    report.problems.extend(found);
    report.problems.extend(inconstant_tracks(dataset, read));
    report.problems.extend(turned_edges(dataset, id, read));
    let (reprojection, found, omitted) = reprojection::check(dataset, read, options.worst);
    report.problems.extend(found);
    report.problems_omitted += omitted;
    let models = models(read);
    report.sequences.push(SequenceReport {
        world: id.world.clone(),
        variation: id.variation.clone(),
        frames: read.frames.len(),
        skipped: read.skipped.len(),
        rows: models.iter().map(|model| model.rows).sum(),
        rows_counted: models.iter().map(|model| model.rows_counted).sum(),
        tracks: models.iter().map(|model| model.tracks).sum(),
        models,
        reprojection,
        archives,
    });
}

/// A sequence that cannot be read at all.
fn hopeless(dataset: &Dataset, id: &SequenceId, error: DatasetError) -> Problem {
    if let DatasetError::Problem(problem) = error {
        return problem;
    }
    Problem::of_file(&dataset.label_file(id, 0), None, Fault::unreadable(&error))
}

fn models(read: &SequenceFrames) -> Vec<ModelReport> {
    let mut found: BTreeMap<(String, Option<String>), (ModelReport, BTreeSet<u32>)> =
        BTreeMap::new();
    for vehicle in read.frames.iter().flat_map(|frame| &frame.vehicles) {
        let key = (vehicle.category.clone(), vehicle.model.clone());
        let (model, tracks) = found.entry(key).or_default();
        model.rows += 1;
        model.rows_counted += usize::from(!vehicle.dont_care);
        tracks.extend(vehicle.track);
    }
    let report = |((category, model), (counts, tracks)): ((String, _), (_, BTreeSet<u32>))| {
        ModelReport { category, model, tracks: tracks.len(), ..counts }
    };
    found.into_iter().map(report).collect()
}

/// A finding where most rows have left beyond right: the columns of the other release, or corners and size.
fn turned_edges(dataset: &Dataset, id: &SequenceId, read: &SequenceFrames) -> Option<Problem> {
    /// Fewer rows prove nothing.
    const MIN_ROWS: usize = 4;
    let turned = |problem: &&Problem| matches!(problem.fault, Fault::SwappedEdges { .. });
    let turned = read.problems.iter().filter(turned).count();
    let good: usize = read.frames.iter().map(|frame| frame.vehicles.len()).sum();
    if turned < MIN_ROWS || turned < good {
        return None;
    }
    let order = match dataset.layout() {
        Layout::VirtualKitti1 => "`l t r b`",
        Layout::VirtualKitti2 => "`left right top bottom`",
        Layout::Kitti => "`x1 y1 x2 y2`",
    };
    let finding =
        format!("{turned} rows have edges beyond each other: the order should be {order}");
    let path = dataset.label_file(id, 0);
    Some(Problem::of_file(&path, None, Fault::Contradiction { finding }))
}

/// Tracks that change size, model or colour: rows of different vehicles, or a cut last word.
fn inconstant_tracks(dataset: &Dataset, read: &SequenceFrames) -> Vec<Problem> {
    /// Relative change of a side that is rounding of the file.
    const ROUNDING: f64 = 1e-3;
    let mut first = BTreeMap::new();
    let mut told = BTreeSet::new();
    let mut problems = Vec::new();
    for (i, frame) in read.frames.iter().enumerate() {
        for (j, vehicle) in frame.vehicles.iter().enumerate() {
            let Some(track) = vehicle.track else { continue };
            let line = read.line_of(i, j);
            let (before, first_line) = *first.entry(track).or_insert((vehicle, line));
            let ratio = vehicle.cuboid.extent.ratio(&before.cuboid.extent);
            let change = if vehicle.model != before.model {
                "model"
            } else if vehicle.color != before.color {
                "colour"
            } else if ratio.iter().any(|ratio| (ratio - 1.0).abs() > ROUNDING) {
                "size"
            } else {
                continue;
            };
            if !told.insert(track) {
                continue;
            }
            let line_before = first_line.unwrap_or_default();
            let finding =
                format!("track {track} has another {change} here than on line {line_before}");
            problems.push(Problem {
                path: dataset.label_file(&frame.sequence, frame.index),
                line,
                frame: Some(frame.index),
                fault: Fault::Contradiction { finding },
            });
        }
    }
    problems
}
