//! What is written, and which options make no data set.

use std::path::PathBuf;

use partpose::labeling::Shard;

use super::{Effect, SynthError};
use crate::shading::RenderOptions;
use crate::world::{CameraOptions, SceneKind, Variation};

/// Most threads that a run may have.
pub(super) const MAX_THREADS: usize = 1024;

/// Share of parked vehicles that have something open, unless asked for otherwise.
const OPEN: f64 = 0.04;

/// What is written.
#[derive(Clone, Debug)]
pub struct SynthOptions {
    /// Seed of everything random.
    pub seed: u64,
    /// Frames of every sequence.
    pub frames: u32,
    /// Time between two frames, seconds. Of a layout, whose frames are 0.1 s apart, the nearest to every such time is
    /// taken.
    pub interval: f64,
    /// Kinds of worlds.
    pub scenes: Vec<SceneKind>,
    /// Worlds of every kind.
    pub worlds: u32,
    /// Variations of every world.
    pub variations: Vec<Variation>,
    /// The camera.
    pub camera: CameraOptions,
    /// Share of parked vehicles that have a door or the boot open; none do where a layout is followed.
    pub open: f64,
    /// What lenses, sensors, weather and files add to pictures; without any the camera only exposes.
    pub effects: Vec<Effect>,
    /// How pictures are drawn.
    pub render: RenderOptions,
    /// A data set whose camera paths and vehicles are taken instead of random ones.
    pub layout: Option<PathBuf>,
    /// Threads, 0 for as many as there are processors; the result does not depend on it.
    pub threads: usize,
    /// Goes on with a run that was cut off.
    pub resume: bool,
    /// The part of the sequences that is written here; all of them if `None`. Parts share a folder, which none of them
    /// finds empty but the first.
    pub shard: Option<Shard>,
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
            open: OPEN,
            effects: Effect::ALL.to_vec(),
            render: RenderOptions::default(),
            layout: None,
            threads: 0,
            resume: false,
            shard: None,
        }
    }
}

/// Says which option makes no data set, and what it may be.
pub(super) fn check(options: &SynthOptions) -> Result<(), SynthError> {
    let camera = &options.camera.camera;
    let fault = if options.frames == 0 || options.frames > 100_000 {
        Some("the number of frames must be 1 to 100000, since their names have five digits")
    } else if options.scenes.is_empty() || options.variations.is_empty() {
        Some("at least one scene and one variation are needed")
    } else if options.worlds == 0 || options.worlds > 999 {
        Some("the number of worlds of a kind must be 1 to 999, since their names have four digits")
    } else if !(options.interval > 0.0 && options.interval <= 10.0) {
        Some("the time between two frames must be above 0 and at most 10 seconds")
    } else if camera.size.iter().any(|side| !(16..=4096).contains(side)) {
        Some("the sides of the image must be 16 to 4096 pixels")
    } else if !camera.focal.iter().all(|focal| (8.0..=1e5).contains(focal)) {
        Some("the focal length must be 8 to 100000 pixels")
    } else if !(0.3..=10.0).contains(&options.camera.height) {
        Some("the height of the camera must be 0.3 to 10 metres")
    } else if !(options.camera.pitch.abs() <= 0.5 && options.camera.roll.abs() <= 0.5) {
        Some("pitch and roll of the camera must be within 28 degrees")
    } else if !(0.0..=1.0).contains(&options.open) {
        Some("the share of parked vehicles with something open must be 0 to 1")
    } else if options.threads > MAX_THREADS {
        Some("there can be at most 1024 threads")
    } else {
        None
    };
    fault.map_or(Ok(()), |fault| Err(SynthError::Options(fault)))
}
