//! One sequence in work: its blocks in parallel, its file at the end.

use rayon::prelude::*;

use crate::dataset::{Dataset, Frame, SegmentColor, SequenceId};
use crate::render::LabelRenderer;

use super::block::{BLOCK, Block, BlockFrame, BlockHeader, finished};
use super::coco_file::{self, assemble};
use super::{
    Agreement, Compared, Event, LabelError, LabelJob, LabelReport, LabelStore, LabeledVehicle,
    Segmentation, SequenceReport, Skipped, compare, label_frame,
};

/// A sequence in work.
pub(super) struct Sequence<'a> {
    pub(super) dataset: &'a Dataset,
    pub(super) job: &'a LabelJob<'a>,
    pub(super) store: &'a LabelStore,
    pub(super) observer: &'a (dyn Fn(Event) + Sync),
    pub(super) id: &'a SequenceId,
    /// Its place in the job.
    pub(super) number: usize,
    pub(super) frames: Vec<Frame>,
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
    /// Labels what of it is this job's, and writes its file if nothing is missing then.
    pub(super) fn label(
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
        let count = |which: &dyn Fn(&LabeledVehicle) -> bool| {
            labels.vehicles.iter().filter(|vehicle| which(vehicle)).count()
        };
        let seen = count(&|vehicle| vehicle.visible_pixels > 0);
        Ok(Ok(Labeled {
            frame: BlockFrame {
                index: frame.index,
                bytes,
                vehicles: seen,
                hidden: labels.vehicles.len() - seen,
                stand_ins: count(&|vehicle| vehicle.stand_in.is_some()),
                named_otherwise: count(&|vehicle| vehicle.named_otherwise),
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
        sequence.named_otherwise += frame.named_otherwise;
        sequence.segmented += usize::from(frame.segmented);
    }
}
