//! A synthetic data set in the layout of Virtual KITTI 1.3.1.
//!
//! [`write()`] draws all frames of all sequences. Every file is written whole or not at all, and the rows of a frame
//! come last, into a folder of fragments; when a sequence has all its frames the fragments are put together. A run that
//! was killed therefore goes on at the first frame without a fragment, and ends with the same bytes.

mod boxes;
mod fragments;
mod frame;
mod manifest;
mod rows;
mod sequences;
mod sheet;
mod statistics;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use partpose::dataset::{DatasetError, SequenceId};
use partpose::files::{self, FileError};
use partpose::vehicle::{ModelZoo, ZooError};
use rayon::prelude::*;

use crate::shading::RenderOptions;
use crate::world::{CameraOptions, Fleet, LayoutError, SceneKind, Variation};

pub use manifest::MANIFEST;
pub use sheet::contact_sheets;
pub use statistics::{Statistics, statistics, statistics_table};

/// Folder with the models of the vehicles, beside the archives.
pub const ZOO: &str = "zoo";

/// What is written.
#[derive(Clone, Debug)]
pub struct SynthOptions {
    /// Seed of everything random.
    pub seed: u64,
    /// Frames of every sequence.
    pub frames: u32,
    /// Time between two frames, seconds.
    pub interval: f64,
    /// Kinds of worlds.
    pub scenes: Vec<SceneKind>,
    /// Worlds of every kind.
    pub worlds: u32,
    /// Variations of every world.
    pub variations: Vec<Variation>,
    /// The camera.
    pub camera: CameraOptions,
    /// Whether pictures show what lenses, sensors and files add; else the camera only exposes.
    pub effects: bool,
    /// How pictures are drawn.
    pub render: RenderOptions,
    /// A data set whose camera paths and vehicles are taken instead of random ones.
    pub layout: Option<PathBuf>,
    /// Threads, 0 for as many as there are processors; the result does not depend on it.
    pub threads: usize,
    /// Goes on with a run that was cut off.
    pub resume: bool,
}

impl Default for SynthOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            frames: 10,
            interval: 0.1,
            scenes: SceneKind::ALL.to_vec(),
            worlds: 1,
            variations: Variation::ALL.to_vec(),
            camera: CameraOptions::default(),
            effects: true,
            render: RenderOptions::default(),
            layout: None,
            threads: 0,
            resume: false,
        }
    }
}

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
    check(options)?;
    let planned = sequences::plan(options)?;
    manifest::claim(out, options, zoo)?;
    let zoo = written_zoo(out, zoo)?;
    let fleet = Arc::new(Fleet::new(&zoo));
    let threads = if options.threads == 0 { rayon::current_num_threads() } else { options.threads };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|source| SynthError::Threads { threads, source })?;
    progress(Progress::Total(
        planned.iter().map(|world| world.frames.len() * world.variations.len()).sum(),
    ));
    if let Some(camera) = frame::other_camera(options, &planned) {
        let text = serde_json::to_string(&camera).unwrap_or_default();
        files::write(&out.join(partpose::dataset::CAMERA_FILE), text.as_bytes())?;
    }
    let mut summary = Summary::default();
    for planned in &planned {
        let world = planned.world(options, &fleet);
        for variation in &planned.variations {
            let id =
                SequenceId { world: planned.name.clone(), variation: variation.name().to_owned() };
            summary.sequences += 1;
            if fragments::is_complete(out, &id) {
                summary.kept += planned.frames.len();
                progress(Progress::Done(planned.frames.len()));
                continue;
            }
            let drawn = AtomicUsize::new(0);
            // No more frames than threads at a time, so that memory is bounded.
            for group in planned.frames.chunks(threads) {
                pool.install(|| {
                    group.par_iter().try_for_each(|index| {
                        if !fragments::exists(out, &id, *index) {
                            frame::write(out, &id, &world, *index, *variation, options)?;
                            drawn.fetch_add(1, Ordering::Relaxed);
                        }
                        progress(Progress::Done(1));
                        Ok::<(), SynthError>(())
                    })
                })?;
            }
            let drawn = drawn.into_inner();
            summary.drawn += drawn;
            summary.kept += planned.frames.len() - drawn;
            fragments::assemble(out, &id, &planned.frames)?;
        }
    }
    fragments::clean(out)?;
    Ok(summary)
}

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// As many frames there will be.
    Total(usize),
    /// So many more are done.
    Done(usize),
}

fn check(options: &SynthOptions) -> Result<(), SynthError> {
    let camera = &options.camera.camera;
    let fault = if options.frames == 0 || options.frames > 100_000 {
        Some("the number of frames must be 1 to 100000, since their names have five digits")
    } else if options.scenes.is_empty() || options.variations.is_empty() {
        Some("at least one scene and one variation are needed")
    } else if options.worlds == 0 || options.worlds > 999 {
        Some("the number of worlds of a kind must be 1 to 999")
    } else if !(options.interval > 0.0 && options.interval <= 10.0) {
        Some("the time between two frames must be above 0 and at most 10 seconds")
    } else if camera.size.iter().any(|side| !(16..=4096).contains(side)) {
        Some("the sides of the image must be 16 to 4096 pixels")
    } else if !camera.focal.iter().all(|focal| (8.0..=1e5).contains(focal)) {
        Some("the focal length must be 8 to 100000 pixels")
    } else if !(0.3..=10.0).contains(&options.camera.height) {
        Some("the height of the camera must be 0.3 to 10 metres")
    } else if !(options.camera.pitch.abs() <= 0.5 && options.camera.roll.abs() <= 0.5) {
        Some("pitch and roll of the camera must be within 0.5 radians")
    } else {
        None
    };
    fault.map_or(Ok(()), |fault| Err(SynthError::Options(fault)))
}

/// The models as anybody reads them from the data set: the numbers of their files, not those they were made with.
fn written_zoo(out: &Path, zoo: &ModelZoo) -> Result<ModelZoo, SynthError> {
    let cars = |model: &&partpose::vehicle::VehicleModel| matches!(model.category(), "Car" | "Van");
    let kept = ModelZoo { models: zoo.models.iter().filter(cars).cloned().collect() };
    if kept.models.is_empty() {
        return Err(SynthError::NoVehicles);
    }
    if let Some(model) = kept.models.iter().find(|model| model.name().contains(' ')) {
        return Err(SynthError::ModelName { name: model.name().to_owned() });
    }
    let path = out.join(ZOO);
    kept.save(&path)?;
    Ok(ModelZoo::load(&path)?)
}
