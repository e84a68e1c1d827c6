//! Labels for whole data sets: sequence by sequence, in blocks of frames that are done in parallel.
//!
//! A file depends on its frame, a block on its frames and a sequence's file on its blocks, never on who wrote them or
//! when: any number of threads and any division into shards writes the same bytes, and so does a run that another one
//! goes on with. No more than a sequence's rows, and the frames in work, are held.

use std::path::PathBuf;

use rayon::prelude::*;

use crate::dataset::{Dataset, DatasetError, Frame, SegmentColor, SequenceId};
use crate::render::LabelRenderer;

use super::block::{BLOCK, Block, BlockFrame, BlockHeader, finished};
use super::coco_file::{self, assemble};
use super::store::check_name;
use super::{
    Agreement, Compared, LabelError, LabelOptions, LabelStore, Segmentation, Shard, Zoos, compare,
    label_frame, manifest,
};

/// Skipped frames and faulty rows that are told of; more are counted.
const MAX_TOLD: usize = 1000;

/// What is to be labelled.
#[derive(Clone, Debug)]
pub struct LabelJob<'a> {
    /// The sequences.
    pub sequences: &'a [SequenceId],
    /// Every how many-th frame.
    pub stride: u32,
    /// The models.
    pub zoos: Zoos<'a>,
    /// How.
    pub options: LabelOptions,
    /// The part of the work that is done here; all of it if `None`.
    ///
    /// Shards share a folder, which none of them finds empty but the first.
    pub shard: Option<Shard>,
    /// Whether the folder may hold labels of an earlier run with the same settings, which are kept where they are whole.
    pub resume: bool,
    /// Folder of reference masks to compare with.
    pub reference: Option<PathBuf>,
}

/// What a run tells while it is at it, from any thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// So many frames more are to be done.
    Found(usize),
    /// So many frames more are done.
    Done(usize),
}

/// Something that was left out.
#[derive(Debug)]
pub struct Skipped {
    /// The frame or the sequence.
    pub name: String,
    /// Why.
    pub error: LabelError,
}

/// What became of a sequence.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SequenceReport {
    /// Its name.
    pub name: String,
    /// Frames that were labelled.
    pub written: usize,
    /// Frames whose labels were there already.
    pub kept: usize,
    /// Frames that were left out, faulty rows included.
    pub skipped: usize,
    /// Labelled vehicles that are seen.
    pub vehicles: usize,
    /// Labelled vehicles that are hidden altogether.
    pub hidden: usize,
    /// Vehicles drawn by a model that stands in for one that the zoo lacks.
    pub stand_ins: usize,
    /// Frames with a segmentation; in the others, occluders that are no vehicles are unknown.
    pub segmented: usize,
    /// Blocks of frames that other shards have still to do; where there are none, the sequence's file is written.
    pub missing_blocks: usize,
}

/// What became of a run.
#[derive(Debug, Default)]
pub struct LabelReport {
    /// In the order of the job.
    pub sequences: Vec<SequenceReport>,
    /// What was left out, up to a thousand.
    pub skipped: Vec<Skipped>,
    /// How much more was.
    pub skipped_omitted: usize,
    /// How the labels agree with the reference, where one was given.
    pub agreement: Option<Agreement>,
    /// The score of every frame that was compared.
    pub compared: Vec<Compared>,
    /// Frames without reference.
    pub without_reference: usize,
}

impl LabelReport {
    fn skip(&mut self, name: String, error: LabelError) {
        if self.skipped.len() < MAX_TOLD {
            self.skipped.push(Skipped { name, error });
        } else {
            self.skipped_omitted += 1;
        }
    }
}

/// Labels a data set.
///
/// Frames and sequences that cannot be labelled are left out and told of; an error is what would stop any frame, such
/// as a full disk.
pub fn label_dataset(
    dataset: &Dataset,
    job: &LabelJob,
    store: &LabelStore,
    observer: &(dyn Fn(Event) + Sync),
) -> Result<LabelReport, LabelError> {
    let may_resume = job.resume || job.shard.is_some();
    manifest::claim(store, &manifest::settings(dataset, job), may_resume)?;
    let mut report = LabelReport::default();
    report.agreement = job.reference.as_ref().map(|_| Agreement::default());
    for (number, id) in job.sequences.iter().enumerate() {
        let mut sequence = SequenceReport { name: id.to_string(), ..SequenceReport::default() };
        let read = check_name(id).and_then(|()| Ok(dataset.read(id)?));
        match read {
            Err(error) => {
                sequence.skipped += 1;
                report.skip(id.to_string(), error);
            }
            Ok(read) => {
                sequence.skipped += read.problems.len() + read.problems_omitted;
                report.skipped_omitted += read.problems_omitted;
                for problem in read.problems {
                    report.skip(id.to_string(), DatasetError::from(problem).into());
                }
                let mut frames = read.frames;
                frames.retain(|frame| frame.index % job.stride.max(1) == 0);
                let unread: Vec<u32> =
                    read.skipped.into_iter().filter(|at| at % job.stride.max(1) == 0).collect();
                let work = Sequence { dataset, job, store, observer, id, number, frames };
                work.label(&unread, &mut sequence, &mut report)?;
            }
        }
        report.sequences.push(sequence);
    }
    Ok(report)
}

/// A sequence in work.
struct Sequence<'a> {
    dataset: &'a Dataset,
    job: &'a LabelJob<'a>,
    store: &'a LabelStore,
    observer: &'a (dyn Fn(Event) + Sync),
    id: &'a SequenceId,
    /// Its place in the job.
    number: usize,
    frames: Vec<Frame>,
}

/// What became of a block.
struct Outcome {
    header: BlockHeader,
    kept: bool,
    skipped: Vec<Skipped>,
    agreement: Agreement,
    compared: Vec<Compared>,
    without_reference: usize,
}

/// A frame's annotations and its comparison.
struct Labeled {
    frame: BlockFrame,
    image: String,
    annotations: Vec<String>,
    comparison: Result<Option<Agreement>, LabelError>,
}

impl Sequence<'_> {
    fn label(
        &self,
        unread: &[u32],
        sequence: &mut SequenceReport,
        report: &mut LabelReport,
    ) -> Result<(), LabelError> {
        let has_segmentation =
            self.frames.iter().any(|frame| frame.classes.is_some() || frame.instances.is_some());
        let colors =
            if has_segmentation { self.dataset.segment_colors(self.id) } else { Ok(Vec::new()) };
        let colors = match colors {
            Ok(colors) => has_segmentation.then_some(colors),
            Err(error) => {
                sequence.skipped += self.frames.len();
                report.skip(self.id.to_string(), error.into());
                return Ok(());
            }
        };
        if self.job.resume && self.job.shard.is_none() {
            self.store.clean(self.id);
        }
        let blocks: Vec<&[Frame]> = self.frames.chunks(BLOCK).collect();
        let own: Vec<(usize, &[Frame])> = blocks
            .iter()
            .copied()
            .enumerate()
            .filter(|(at, _)| self.job.shard.is_none_or(|shard| shard.holds(self.number, *at)))
            .collect();
        (self.observer)(Event::Found(own.iter().map(|(_, frames)| frames.len()).sum()));
        let outcomes: Result<Vec<Outcome>, LabelError> = own
            .into_par_iter()
            .map(|(at, frames)| self.block(at, frames, colors.as_deref()))
            .collect();
        for outcome in outcomes? {
            add(sequence, &outcome);
            report.without_reference += outcome.without_reference;
            report.compared.extend(outcome.compared);
            if let Some(sum) = &mut report.agreement {
                sum.add(&outcome.agreement);
            }
            for skipped in outcome.skipped {
                report.skip(skipped.name, skipped.error);
            }
        }
        let wanted: Vec<Vec<u32>> =
            blocks.iter().map(|frames| frames.iter().map(|frame| frame.index).collect()).collect();
        sequence.missing_blocks = assemble(self.store, self.dataset, self.id, &wanted, unread)?;
        Ok(())
    }

    fn block(
        &self,
        at: usize,
        frames: &[Frame],
        colors: Option<&[SegmentColor]>,
    ) -> Result<Outcome, LabelError> {
        let path = self.store.block(self.id, at);
        let mut outcome = Outcome {
            header: BlockHeader::default(),
            kept: false,
            skipped: Vec::new(),
            agreement: Agreement::default(),
            compared: Vec::new(),
            without_reference: 0,
        };
        if let Some(header) = finished(&path, frames, self.store).filter(|_| self.may_keep()) {
            (outcome.header, outcome.kept) = (header, true);
            if let Some(reference) = &self.job.reference {
                let compared: Vec<_> = frames
                    .par_iter()
                    .map(|frame| compare::compare_written(reference, frame, self.store))
                    .collect();
                for (frame, comparison) in frames.iter().zip(compared) {
                    outcome.compare(frame, comparison);
                }
            }
            (self.observer)(Event::Done(frames.len()));
            return Ok(outcome);
        }
        let labelled: Result<Vec<_>, LabelError> = frames
            .par_iter()
            .map_init(LabelRenderer::default, |renderer, frame| {
                let labelled = self.frame(frame, colors, renderer);
                (self.observer)(Event::Done(1));
                labelled
            })
            .collect();
        let mut block = Block::default();
        for (frame, labelled) in frames.iter().zip(labelled?) {
            match labelled {
                Ok(labelled) => {
                    block.header.frames.push(labelled.frame);
                    block.header.annotations += labelled.annotations.len();
                    block.images.push(labelled.image);
                    block.annotations.extend(labelled.annotations);
                    if self.job.reference.is_some() {
                        outcome.compare(frame, labelled.comparison);
                    }
                }
                Err(error) => {
                    self.store.remove_images(frame);
                    block.header.skipped.push(frame.index);
                    outcome.skipped.push(Skipped { name: frame.name(), error });
                }
            }
        }
        block.write(&path)?;
        outcome.header = block.header;
        Ok(outcome)
    }

    /// Whether what is there may be kept; the folder's settings are known to be the same.
    fn may_keep(&self) -> bool {
        self.job.resume || self.job.shard.is_some()
    }

    /// Labels a frame and writes its images. The inner error costs the frame, the outer one stops the run.
    fn frame(
        &self,
        frame: &Frame,
        colors: Option<&[SegmentColor]>,
        renderer: &mut LabelRenderer,
    ) -> Result<Result<Labeled, LabelError>, LabelError> {
        let segmentation = match colors.map(|colors| Segmentation::read(frame, colors)) {
            None => None,
            Some(Ok(Some(segmentation))) => Some(segmentation),
            Some(Ok(None)) => return Ok(Err(LabelError::NoSegmentation)),
            Some(Err(error)) => return Ok(Err(error)),
        };
        let (zoos, options) = (&self.job.zoos, &self.job.options);
        let labels = match label_frame(frame, zoos, options, segmentation.as_ref(), renderer) {
            Ok(labels) => labels,
            Err(error) => return Ok(Err(error)),
        };
        let json = |result: serde_json::Result<String>| {
            result.map_err(|error| LabelError::Damaged {
                path: self.store.path(&frame.name()),
                reason: error.to_string(),
            })
        };
        let image = json(serde_json::to_string(&coco_file::image(frame, self.dataset.root())))?;
        let annotations: Result<Vec<String>, LabelError> = coco_file::annotations(frame, &labels)
            .iter()
            .map(|annotation| json(serde_json::to_string(annotation)))
            .collect();
        let bytes = self.store.write_images(frame, &labels)?;
        let comparison = match &self.job.reference {
            Some(reference) => compare::compare(reference, frame, &labels.parts, &labels.instances),
            None => Ok(None),
        };
        let seen = labels.vehicles.iter().filter(|vehicle| vehicle.visible_pixels > 0).count();
        Ok(Ok(Labeled {
            frame: BlockFrame {
                index: frame.index,
                bytes,
                vehicles: seen,
                hidden: labels.vehicles.len() - seen,
                stand_ins: labels.vehicles.iter().filter(|v| v.stand_in.is_some()).count(),
                segmented: labels.segmented,
            },
            image,
            annotations: annotations?,
            comparison,
        }))
    }
}

impl Outcome {
    fn compare(&mut self, frame: &Frame, comparison: Result<Option<Agreement>, LabelError>) {
        match comparison {
            Ok(Some(agreement)) => {
                self.compared.push(Compared {
                    sequence: frame.sequence.clone(),
                    index: frame.index,
                    inside: agreement.inside(),
                    outline: agreement.missed() + agreement.surplus(),
                });
                self.agreement.add(&agreement);
            }
            Ok(None) => self.without_reference += 1,
            Err(error) => {
                self.without_reference += 1;
                self.skipped.push(Skipped { name: frame.name(), error });
            }
        }
    }
}

fn add(sequence: &mut SequenceReport, outcome: &Outcome) {
    let frames = &outcome.header.frames;
    let count = if outcome.kept { &mut sequence.kept } else { &mut sequence.written };
    *count += frames.len();
    sequence.skipped += outcome.header.skipped.len();
    for frame in frames {
        sequence.vehicles += frame.vehicles;
        sequence.hidden += frame.hidden;
        sequence.stand_ins += frame.stand_ins;
        sequence.segmented += usize::from(frame.segmented);
    }
}
