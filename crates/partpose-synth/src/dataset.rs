//! A synthetic data set in the layout of Virtual KITTI 1.3.1.
//!
//! [`write()`] draws all frames of all sequences. Every file is written whole or not at all, and the rows of a frame
//! come last, into a folder of fragments; when a sequence has all its frames the fragments are put together. A run that
//! was killed therefore goes on with the frames without a fragment, and ends with the same bytes. [`verify()`] checks
//! that the labels of a data set agree with each other, [`statistics()`] counts how it is distributed.

mod boxes;
mod effects;
mod fragments;
mod frame;
mod manifest;
mod options;
mod rows;
mod sequences;
mod sheet;
mod statistics;
mod verify;
mod workers;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use partpose::dataset::{DatasetError, SequenceId};
use partpose::files::{self, FileError};
use partpose::vehicle::{ModelZoo, VehicleModel, ZooError};

use crate::vehicles::{Opening, opened};
use crate::world::{Fleet, LayoutError, Variation};

pub use effects::{Effect, UnknownEffect};
pub use manifest::MANIFEST;
pub use options::SynthOptions;
pub use sheet::contact_sheets;
pub use statistics::{Statistics, statistics, statistics_beside, statistics_table};
pub use verify::{Verified, verify};

use frame::Shot;
use sequences::PlannedWorld;
use workers::Workers;

/// Folder with the models of the vehicles, beside the archives.
pub const ZOO: &str = "zoo";

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// Sequences of the data set.
    pub sequences: usize,
    /// Frames drawn by this run.
    pub drawn: usize,
    /// Frames that were there already.
    pub kept: usize,
}

/// Why a data set could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SynthError {
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The models cannot be used.
    #[error(transparent)]
    Zoo(#[from] ZooError),
    /// The data set with the layout cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The layout cannot be used.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The zoo has neither cars nor vans.
    #[error("the zoo holds no model of the category `Car` or `Van`")]
    NoVehicles,
    /// A name that does not fit into a table of fields between spaces.
    #[error("the model name `{name}` holds a space, which the tables of the data set cannot")]
    ModelName {
        /// The name.
        name: String,
    },
    /// The folder holds something that is no part of a synthetic data set.
    #[error("`{path}` holds something else already: `{found}`")]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// The first thing found there.
        found: String,
    },
    /// The folder holds a synthetic data set.
    #[error("`{path}` holds a synthetic data set already")]
    Exists {
        /// The folder.
        path: PathBuf,
    },
    /// The run to go on with had other options.
    #[error("`{path}` was begun with `{field}` {begun}, but now it is {asked}")]
    OtherOptions {
        /// The folder.
        path: PathBuf,
        /// The option that differs.
        field: String,
        /// Its value then.
        begun: String,
        /// Its value now.
        asked: String,
    },
    /// A data set that was not written by this program.
    #[error("`{path}` is no synthetic data set: it lacks `{missing}`")]
    NotSynthetic {
        /// The folder.
        path: PathBuf,
        /// What is missing.
        missing: &'static str,
    },
    /// A frame could not be labelled again.
    #[error(transparent)]
    Label(#[from] partpose::labeling::LabelError),
    /// The manifest is damaged.
    #[error("`{path}` is not the manifest of a synthetic data set")]
    Manifest {
        /// The file.
        path: PathBuf,
        /// What the parser says.
        source: serde_json::Error,
    },
    /// An option that makes no data set.
    #[error("{0}")]
    Options(&'static str),
    /// Threads could not be started.
    #[error("cannot start {threads} threads")]
    Threads {
        /// How many.
        threads: usize,
        /// What the system says.
        source: rayon::ThreadPoolBuildError,
    },
}

/// Writes a data set, or the rest of one. `progress` hears of the number of frames before the first and of every frame
/// that is done.
pub fn write(
    out: &Path,
    zoo: &ModelZoo,
    options: &SynthOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Summary, SynthError> {
    options::check(options)?;
    let mut planned = sequences::plan(options)?;
    let camera = frame::other_camera(options, &planned);
    if let Some(shard) = &options.shard {
        sequences::keep(&mut planned, shard);
    }
    manifest::claim(out, options, zoo)?;
    let with_opened = options.open > 0.0 && options.layout.is_none();
    let zoo = written_zoo(out, zoo, with_opened)?;
    let fleet = Arc::new(Fleet::new(&zoo));
    let workers = Workers::new(options.threads)?;
    progress(Progress::Total(planned.iter().map(PlannedWorld::images).sum()));
    if let Some(camera) = camera {
        let text = serde_json::to_string(&camera).unwrap_or_default();
        files::write(&out.join(partpose::dataset::CAMERA_FILE), text.as_bytes())?;
    }
    let run = Run { out, options, fleet: &fleet, workers: &workers, progress };
    let mut summary = Summary::default();
    for planned in &planned {
        let drawn = write_world(&run, planned)?;
        summary.sequences += planned.variations.len();
        summary.drawn += drawn;
        summary.kept += planned.images() - drawn;
    }
    fragments::clean(out, options.shard.is_some())?;
    Ok(summary)
}

/// What all worlds of a run share.
struct Run<'a> {
    out: &'a Path,
    options: &'a SynthOptions,
    fleet: &'a Arc<Fleet>,
    workers: &'a Workers,
    progress: &'a (dyn Fn(Progress) + Sync),
}

/// Writes what is missing of a world and gives the number of frames that were.
fn write_world(run: &Run, planned: &PlannedWorld) -> Result<usize, SynthError> {
    let missing: Vec<(SequenceId, Variation)> = planned
        .variations
        .iter()
        .map(|variation| (planned.sequence(*variation), *variation))
        .filter(|(id, _)| !fragments::is_complete(run.out, id))
        .collect();
    let whole = planned.variations.len() - missing.len();
    (run.progress)(Progress::Done(whole * planned.frames.len()));
    if missing.is_empty() {
        return Ok(0);
    }
    let world = planned.world(run.options, run.fleet);
    let drawn = AtomicUsize::new(0);
    run.workers.run(missing.len() * planned.frames.len(), &|at| {
        let (id, variation) = &missing[at / planned.frames.len()];
        let index = planned.frames[at % planned.frames.len()];
        if !fragments::exists(run.out, id, index) {
            let shot = Shot { id, index, variation: *variation };
            frame::write(run.out, &shot, &world, run.options)?;
            drawn.fetch_add(1, Ordering::Relaxed);
        }
        (run.progress)(Progress::Done(1));
        Ok(())
    })?;
    for (id, _) in &missing {
        fragments::assemble(run.out, id, &planned.frames)?;
    }
    Ok(drawn.into_inner())
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// As many frames there will be.
    Total(usize),
    /// So many more are done.
    Done(usize),
}

/// The models as anybody reads them from the data set: the numbers of their files, not those they were made with. With
/// `with_opened` the first cars that can be opened have such a form too, each another.
fn written_zoo(out: &Path, zoo: &ModelZoo, with_opened: bool) -> Result<ModelZoo, SynthError> {
    let cars = |model: &&VehicleModel| matches!(model.category(), "Car" | "Van");
    let closed = |model: &&VehicleModel| Opening::of_name(model.name()).is_none();
    let models = zoo.models.iter().filter(cars).filter(closed).cloned().collect();
    let mut kept = ModelZoo { models };
    if kept.models.is_empty() {
        return Err(SynthError::NoVehicles);
    }
    if let Some(model) = kept.models.iter().find(|model| model.name().contains(' ')) {
        return Err(SynthError::ModelName { name: model.name().to_owned() });
    }
    if with_opened {
        let mut left = Opening::ALL.to_vec();
        let mut open = |model: &VehicleModel| {
            let model = opened(model, *left.first()?)?;
            left.remove(0);
            Some(model)
        };
        let cars = kept.models.iter().filter(|model| model.category() == "Car");
        let opened: Vec<VehicleModel> = cars.filter_map(&mut open).collect();
        kept.models.extend(opened);
    }
    let path = out.join(ZOO);
    kept.save(&path)?;
    Ok(ModelZoo::load(&path)?)
}
