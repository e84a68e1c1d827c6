//! Where the detections that are scored come from: files, a network, or the ground truth.

use std::convert::Infallible;
use std::path::PathBuf;

use anyhow::Context;
use partpose::dataset::{DatasetError, Frame};
use partpose::detection::Detection;
use partpose::eval::matching::MatchOptions;
use partpose::files;
use partpose::geometry::Rect;
use partpose::oracle::{Oracle, OracleOptions};
use partpose::vehicle::ModelZoo;
use rayon::prelude::*;

use crate::commands::detection_files::{self, DetectionIndex};
use crate::network::{EngineFlags, Network};
use crate::progress;
use crate::report::{hint, warn};
use crate::side_by_side::{JobsFlag, side_by_side};

/// Frames that are worked on at once; more would only fill the memory.
const CHUNK: usize = 32;
/// Complaints that are printed one by one; the rest is counted.
const MOST_COMPLAINTS: usize = 10;

#[derive(clap::Args, Clone)]
pub(super) struct SourceFlags {
    /// Detections to score: safetensors as `run` and others write them, or a folder of such files. May be given several
    /// times: each is a row of the tables, and the figures at the top of `metrics.json` are the first's
    #[arg(long, value_name = "FILE")]
    pub(super) detections: Vec<PathBuf>,
    /// Weights of the network that detects; without detections those that come with the program. May be given several
    /// times
    #[arg(long, value_name = "FILE")]
    pub(super) weights: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) engine: EngineFlags,
    #[command(flatten)]
    jobs: JobsFlag,
    /// Least score of the detections that count; curves and average precision take all
    #[arg(long, value_name = "SCORE", default_value_t = 0.5, value_parser = share)]
    pub(super) min_score: f64,
}

/// A number from 0 to 1.
pub(super) fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("a number from 0 to 1 is meant".to_owned()),
    }
}

impl SourceFlags {
    /// Whether detections are asked for at all.
    pub(super) fn are_given(&self) -> bool {
        !self.detections.is_empty() || !self.weights.is_empty() || self.engine.has_model()
    }

    /// The sources in the order: files, networks; the network that comes with the program if there are none.
    pub(super) fn open(&self) -> anyhow::Result<Vec<Source>> {
        let mut sources = Vec::new();
        for path in &self.detections {
            let index = detection_files::index(path)?;
            sources.push(Source { name: detection_files::title(path), kind: Kind::File(index) });
        }
        let mut networks: Vec<Network> = Vec::new();
        for path in &self.weights {
            networks.push(Network::load(Some(path), &self.engine)?);
        }
        let more = sources.is_empty() && networks.is_empty();
        if more || self.engine.has_model() {
            networks.push(Network::load(None, &self.engine)?);
        }
        let jobs = self.jobs.count(self.engine.shares_device());
        sources.extend(networks.into_iter().map(|network| Source {
            name: network.name.clone(),
            kind: Kind::Network(Box::new(network), jobs),
        }));
        Ok(sources)
    }
}

/// One row of the tables.
pub(super) struct Source {
    pub(super) name: String,
    kind: Kind,
}

enum Kind {
    File(DetectionIndex),
    /// With how many frames are under way at once.
    Network(Box<Network>, usize),
    Oracle(OracleOptions),
}

/// Detections of a frame; `None` where a file does not name it.
pub(super) type Found = anyhow::Result<Option<Vec<Detection>>>;

impl Source {
    /// Perfect detections.
    pub(super) fn oracle(options: OracleOptions) -> Self {
        let name = format!("perfect, {0} x {0}", options.kernel);
        Self { name, kind: Kind::Oracle(options) }
    }

    /// Cells a side of its kernels; the paper's 28 where nothing was found.
    pub(super) fn kernel(&self) -> usize {
        match &self.kind {
            Kind::File(index) => index.kernel().unwrap_or(28),
            Kind::Network(network, _) => network.kernel(),
            Kind::Oracle(options) => options.kernel,
        }
    }

    /// What tells it from others of its name.
    pub(super) fn identity(&self) -> String {
        match &self.kind {
            Kind::File(index) => index.identity(),
            Kind::Network(network, _) => network.identity.clone(),
            Kind::Oracle(_) => self.name.clone(),
        }
    }

    /// Whether it is the ground truth.
    pub(super) fn is_oracle(&self) -> bool {
        matches!(self.kind, Kind::Oracle(_))
    }

    /// The detections of one frame; none where a file does not name it.
    pub(super) fn detect_one(
        &self,
        frame: &Frame,
        oracle: &Oracle,
    ) -> anyhow::Result<Vec<Detection>> {
        Ok(match &self.kind {
            Kind::File(index) => index.of_frame(frame)?.map_or(Vec::new(), <[Detection]>::to_vec),
            Kind::Network(network, _) => of_network(network, frame)?,
            Kind::Oracle(options) => of_oracle(frame, oracle, options),
        })
    }

    /// The detections of some frames, one result each.
    pub(super) fn detect(&self, frames: &[Frame], oracles: &[Option<Oracle>]) -> Vec<Found> {
        match &self.kind {
            Kind::File(index) => frames
                .iter()
                .map(|frame| Ok(index.of_frame(frame)?.map(<[Detection]>::to_vec)))
                .collect(),
            Kind::Network(network, jobs) => {
                let look = |frame: &Frame| Ok(of_network(network, frame).map(Some));
                let Ok(found) = side_by_side::<_, _, Infallible>(frames, *jobs, look);
                found
            }
            Kind::Oracle(options) => {
                let frames: Vec<_> = frames.iter().zip(oracles).collect();
                frames
                    .into_par_iter()
                    .map(|(frame, oracle)| {
                        Ok(oracle.as_ref().map(|oracle| of_oracle(frame, oracle, options)))
                    })
                    .collect()
            }
        }
    }

    /// Says what is wrong if it named none of the frames.
    fn check_named(&self, frames: &[Frame], named: usize) -> anyhow::Result<()> {
        let (Kind::File(index), Some(frame)) = (&self.kind, frames.first()) else { return Ok(()) };
        if named > 0 {
            return Ok(());
        }
        Err(hint(
            anyhow::anyhow!(
                "`{}` names none of the frames: its first image is `{}`, the first frame {}",
                self.name,
                index.first_name(),
                frame.name()
            ),
            "name images as the data set does, such as `0001/clone/00012.png`",
        ))
    }
}

fn of_network(network: &Network, frame: &Frame) -> anyhow::Result<Vec<Detection>> {
    let path = frame.image.as_ref().context("the frame has no image")?;
    network.detect(&files::read_rgb(path)?)
}

fn of_oracle(frame: &Frame, oracle: &Oracle, options: &OracleOptions) -> Vec<Detection> {
    let counted = (0..frame.vehicles.len()).filter(|index| !frame.vehicles[*index].dont_care);
    counted.filter_map(|vehicle| oracle.detection(vehicle, options)).collect()
}

/// The detection that overlaps a box most, if by half.
pub(super) fn best_match<'a>(detections: &'a [Detection], bounds: &Rect) -> Option<&'a Detection> {
    let overlap = |detection: &Detection| detection.bounds.iou(bounds);
    let best = detections.iter().max_by(|a, b| overlap(a).total_cmp(&overlap(b)));
    best.filter(|detection| overlap(detection) >= MatchOptions::default().min_iou)
}

/// What a frame is scored with.
pub(super) struct ScoredFrame<'a> {
    pub(super) frame: &'a Frame,
    /// What its mask shows, where masks are asked for.
    pub(super) oracle: Option<&'a Oracle>,
    pub(super) detections: &'a [Detection],
}

/// Takes the score of a frame: index of the source, index of the frame, score.
pub(super) type Take<'a, T> = &'a mut dyn FnMut(usize, usize, T);

/// Scores the frames with every source; `zoo` where masks are needed. `take` hears of frames in their order.
///
/// Returns how many frames some source could not do.
pub(super) fn score_frames<T: Send>(
    frames: &[Frame],
    sources: &[Source],
    zoo: Option<&ModelZoo>,
    score: &(dyn Fn(&ScoredFrame) -> T + Sync),
    take: Take<T>,
) -> anyhow::Result<usize> {
    let bar = progress::bar("frames", (frames.len() * sources.len()) as u64);
    let mut complaints = Complaints::default();
    let (mut named, mut unnamed) = (vec![0usize; sources.len()], vec![0usize; sources.len()]);
    for (chunk, start) in frames.chunks(CHUNK).zip((0..).step_by(CHUNK)) {
        let oracles = oracles(chunk, zoo, &mut complaints);
        for (index, source) in sources.iter().enumerate() {
            let found = source.detect(chunk, &oracles);
            let work: Vec<_> = chunk.iter().zip(&oracles).zip(found).collect();
            let scored: Vec<Result<Option<T>, (String, anyhow::Error)>> = work
                .into_par_iter()
                .map(|((frame, oracle), found)| {
                    // Without its mask, which has been complained of, a frame has no scores.
                    if zoo.is_some() && oracle.is_none() {
                        return Ok(None);
                    }
                    let found = found.map_err(|error| (frame.name(), error))?;
                    let oracle = oracle.as_ref();
                    Ok(found.map(|detections| {
                        score(&ScoredFrame { frame, oracle, detections: &detections })
                    }))
                })
                .collect();
            for ((at, scored), oracle) in (start..).zip(scored).zip(&oracles) {
                match scored {
                    Ok(Some(scored)) => {
                        named[index] += 1;
                        take(index, at, scored);
                    }
                    Ok(None) if zoo.is_some() && oracle.is_none() => {}
                    Ok(None) => unnamed[index] += 1,
                    Err((frame, error)) => {
                        complaints.add(format_args!("skipped frame {frame}: {error:#}"));
                    }
                }
            }
            bar.inc(chunk.len() as u64);
        }
    }
    bar.finish_and_clear();
    complaints.finish();
    for ((source, named), unnamed) in sources.iter().zip(named).zip(unnamed) {
        source.check_named(frames, named)?;
        if unnamed > 0 {
            warn(format_args!("left out {unnamed} frames that `{}` does not name", source.name));
            complaints.count += unnamed;
        }
    }
    Ok(complaints.count)
}

fn oracles(
    frames: &[Frame],
    zoo: Option<&ModelZoo>,
    complaints: &mut Complaints,
) -> Vec<Option<Oracle>> {
    let Some(zoo) = zoo else { return frames.iter().map(|_| None).collect() };
    let read: Vec<Result<Oracle, DatasetError>> =
        frames.par_iter().map(|frame| Ok(Oracle::new(frame, frame.read_parts()?, zoo))).collect();
    let pairs = frames.iter().zip(read);
    pairs
        .map(|(frame, oracle)| match oracle {
            Ok(oracle) => Some(oracle),
            Err(error) => {
                let error = anyhow::Error::from(error);
                complaints.add(format_args!("skipped frame {}: {error:#}", frame.name()));
                None
            }
        })
        .collect()
}

/// Prints what is wrong, but not all of it.
#[derive(Default)]
struct Complaints {
    count: usize,
}

impl Complaints {
    fn add(&mut self, message: std::fmt::Arguments) {
        self.count += 1;
        if self.count <= MOST_COMPLAINTS {
            warn(message);
        }
    }

    fn finish(&self) {
        let more = self.count.saturating_sub(MOST_COMPLAINTS);
        if more > 0 {
            warn(format_args!("skipped {more} frames more"));
        }
    }
}
