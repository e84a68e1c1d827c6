//! Which worlds a data set has.

use std::path::Path;
use std::sync::Arc;

use partpose::dataset::{Dataset, SequenceId};
use partpose::geometry::Camera;
use partpose::labeling::Shard;

use super::{SynthError, SynthOptions};
use crate::world::{Fleet, Layout, SceneKind, Variation, World, WorldOptions};

/// Time between two frames of a data set whose layout is followed, seconds.
const LAYOUT_INTERVAL: f64 = 0.1;

/// A world and the frames and variations in which it is drawn.
pub(super) struct PlannedWorld {
    /// Its folder.
    pub(super) name: String,
    pub(super) frames: Vec<u32>,
    pub(super) variations: Vec<Variation>,
    source: Source,
}

enum Source {
    Random { kind: SceneKind, index: u32 },
    Layout(Arc<Layout>),
}

/// All worlds: random ones by kind and number, or those of the data set whose layout is followed.
pub(super) fn plan(options: &SynthOptions) -> Result<Vec<PlannedWorld>, SynthError> {
    if let Some(path) = &options.layout {
        return from_layout(path, options);
    }
    let mut kinds = options.scenes.clone();
    kinds.sort();
    kinds.dedup();
    let world = |kind: SceneKind, index: u32| PlannedWorld {
        name: format!("{:04}", kind.digit() * 1000 + index + 1),
        frames: (0..options.frames).collect(),
        variations: sorted(&options.variations),
        source: Source::Random { kind, index },
    };
    Ok(kinds.iter().flat_map(|kind| (0..options.worlds).map(|index| world(*kind, index))).collect())
}

/// Leaves the sequences of one part, counted over all worlds.
pub(super) fn keep(planned: &mut Vec<PlannedWorld>, shard: &Shard) {
    let mut count = 0;
    for world in planned.iter_mut() {
        world.variations.retain(|_| {
            count += 1;
            shard.has(count - 1)
        });
    }
    planned.retain(|world| !world.variations.is_empty());
}

/// The clone of every world of a data set, as many frames as asked for, in the variations asked for.
fn from_layout(path: &Path, options: &SynthOptions) -> Result<Vec<PlannedWorld>, SynthError> {
    let dataset = Dataset::open(path)?;
    let mut planned = Vec::new();
    for id in dataset.sequences().iter().filter(|id| id.variation == "clone") {
        let layout = Layout::read(&dataset, id)?;
        let all = layout.frame_indices();
        let mut frames: Vec<u32> = (0..options.frames)
            .map(|i| (f64::from(i) * options.interval / LAYOUT_INTERVAL).round() as usize)
            .map_while(|at| all.get(at).copied())
            .collect();
        frames.dedup();
        planned.push(PlannedWorld {
            name: id.world.clone(),
            frames,
            variations: sorted(&options.variations),
            source: Source::Layout(Arc::new(layout)),
        });
    }
    if planned.is_empty() {
        return Err(SynthError::Options(
            "the data set for the layout has no sequence of the variation `clone`",
        ));
    }
    Ok(planned)
}

fn sorted(variations: &[Variation]) -> Vec<Variation> {
    let mut variations = variations.to_vec();
    variations.sort();
    variations.dedup();
    variations
}

impl PlannedWorld {
    /// How many images there will be.
    pub(super) fn images(&self) -> usize {
        self.frames.len() * self.variations.len()
    }

    /// The sequence of a variation.
    pub(super) fn sequence(&self, variation: Variation) -> SequenceId {
        SequenceId { world: self.name.clone(), variation: variation.name().to_owned() }
    }

    /// Makes the world.
    pub(super) fn world(&self, options: &SynthOptions, fleet: &Arc<Fleet>) -> World {
        match &self.source {
            Source::Random { kind, index } => World::new(
                &WorldOptions {
                    kind: *kind,
                    index: *index,
                    seed: options.seed,
                    duration: f64::from(options.frames) * options.interval,
                    camera: options.camera,
                    open: options.open,
                },
                Arc::clone(fleet),
            ),
            Source::Layout(layout) => {
                World::from_layout(Arc::clone(layout), options.seed, Arc::clone(fleet))
            }
        }
    }

    /// The camera, where it is that of a layout, whatever the options say.
    pub(super) fn camera_of_layout(&self) -> Option<Camera> {
        match &self.source {
            Source::Random { .. } => None,
            Source::Layout(layout) => Some(layout.camera()),
        }
    }
}
