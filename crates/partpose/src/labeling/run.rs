//! Labels for whole data sets: sequence by sequence, in blocks of frames that are done in parallel.
//!
//! A file depends on its frame, a block on its frames and a sequence's file on its blocks, never on who wrote them or
//! when: any number of threads and any division into shards writes the same bytes, and so does a run that another one
//! goes on with. No more than a sequence's rows, and the frames in work, are held.

use std::path::PathBuf;

use crate::dataset::{Dataset, DatasetError, SequenceId};

use super::sequence::Sequence;
use super::store::check_name;
use super::{Agreement, Compared, LabelError, LabelOptions, LabelStore, Shard, Zoos, manifest};

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
    /// Vehicles whose model the zoo has by the name that the data set gives, drawn by another that is nearer in size.
    pub named_otherwise: usize,
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
    pub(super) fn skip(&mut self, name: String, error: LabelError) {
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
    let agreement = job.reference.as_ref().map(|_| Agreement::default());
    let mut report = LabelReport { agreement, ..LabelReport::default() };
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
