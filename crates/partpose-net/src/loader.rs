//! Images for training steps, read and varied by threads in the background.
//!
//! Which frame comes when, and how it is varied, follows from the seed and the step alone: an image's generator is seeded
//! by its number. So the result depends neither on the number of threads nor on where a training was cut off.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

use partpose::dataset::DatasetError;
use partpose::vehicle::ModelZoo;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use crate::augment::{TrainingImage, choose_view, training_image};
use crate::input::scaled_size;
use crate::sample::{self, Item};
use crate::target::Target;
use crate::training::TrainConfig;

/// Steps that are prepared in advance.
const AHEAD: u64 = 4;
/// Frames tried in place of one that cannot be read.
const TRIES: usize = 8;

/// The images of a step.
#[derive(Debug)]
pub struct Batch {
    /// `[batch, 3, height, width]`.
    pub values: Vec<f32>,
    /// Its axes.
    pub shape: [usize; 4],
    /// One an image.
    pub targets: Vec<Target>,
    /// Frames, for messages.
    pub names: Vec<String>,
    /// Frames that could not be read; others stand in for them.
    pub problems: Vec<DatasetError>,
}

/// Threads that prepare batches.
#[derive(Debug)]
pub struct Loader {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    items: Arc<Vec<Item>>,
    config: TrainConfig,
    /// Images before each phase's first step, with that step.
    starts: Vec<(u64, u64)>,
    zoo: ModelZoo,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Debug)]
struct State {
    /// Step and place in its batch that nobody works on yet.
    next: (u64, usize),
    /// Step that is waited for.
    wanted: u64,
    done: BTreeMap<(u64, usize), (TrainingImage, Vec<DatasetError>)>,
    failed: Option<DatasetError>,
    stop: bool,
}

impl Loader {
    /// Begins to prepare the batches from a step on.
    ///
    /// # Panics
    ///
    /// If there are no items: a bug of the caller.
    pub fn start(items: Arc<Vec<Item>>, config: &TrainConfig, step: u64) -> Self {
        assert!(!items.is_empty(), "nothing to learn from");
        let state = State {
            next: (step, 0),
            wanted: step,
            done: BTreeMap::new(),
            failed: None,
            stop: false,
        };
        let shared = Arc::new(Shared {
            items,
            starts: starts(config),
            config: config.clone(),
            zoo: ModelZoo::embedded(),
            state: Mutex::new(state),
            changed: Condvar::new(),
        });
        let threads = match config.data.threads {
            0 => std::thread::available_parallelism().map_or(2, std::num::NonZero::get),
            threads => threads,
        };
        let threads = (0..threads).map(|_| {
            let shared = Arc::clone(&shared);
            std::thread::spawn(move || work(&shared))
        });
        Self { threads: threads.collect(), shared }
    }

    /// The images of the next step.
    pub fn next_batch(&mut self) -> Result<Batch, DatasetError> {
        let mut state = self.shared.state.lock().expect("no thread panicked");
        let step = state.wanted;
        let phase = *self.shared.config.phase(step);
        let ready =
            |state: &State| (0..phase.batch).all(|place| state.done.contains_key(&(step, place)));
        while !ready(&state) {
            if let Some(error) = state.failed.take() {
                return Err(error);
            }
            state = self.shared.changed.wait(state).expect("no thread panicked");
        }
        let size = self.shared.image_size(step);
        let mut batch = Batch {
            values: Vec::with_capacity(3 * phase.batch * size[0] * size[1]),
            shape: [phase.batch, 3, size[1], size[0]],
            targets: Vec::new(),
            names: Vec::new(),
            problems: Vec::new(),
        };
        for place in 0..phase.batch {
            let (image, problems) = state.done.remove(&(step, place)).expect("it is ready");
            batch.values.extend(image.values);
            batch.targets.push(image.target);
            batch.names.push(image.name);
            batch.problems.extend(problems);
        }
        state.wanted += 1;
        drop(state);
        self.shared.changed.notify_all();
        Ok(batch)
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        if let Ok(mut state) = self.shared.state.lock() {
            state.stop = true;
        }
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // A thread that panicked has nothing to hand over.
            let _ = thread.join();
        }
    }
}

impl Shared {
    /// Width and height of a step's images.
    fn image_size(&self, step: u64) -> [usize; 2] {
        self.config.image_size(self.config.phase(step), self.items[0].frame.camera.size)
    }

    /// The number of an image among all of the training.
    fn number(&self, step: u64, place: usize) -> u64 {
        let last = self.starts.iter().rev().find(|(_, first)| *first <= step);
        let (before, first) = last.copied().unwrap_or((0, 0));
        before + (step - first) * self.config.phase(step).batch as u64 + place as u64
    }

    fn image(
        &self,
        (step, place): (u64, usize),
    ) -> Result<(TrainingImage, Vec<DatasetError>), DatasetError> {
        let number = self.number(step, place);
        let mut rng = ChaCha8Rng::seed_from_u64(self.config.seed);
        rng.set_stream(number + 1);
        let count = self.items.len() as u64;
        let mut order: Vec<u32> = (0..count as u32).collect();
        order.shuffle(&mut ChaCha8Rng::seed_from_u64(self.config.seed ^ (number / count) << 32));
        let mut problems = Vec::new();
        for attempt in 0..TRIES {
            let at = order[((number + attempt as u64) % count) as usize];
            let read =
                sample::read(&self.items[at as usize], self.config.data.with_dontcare, &self.zoo);
            match read {
                Ok(sample) => {
                    let phase = self.config.phase(step);
                    let net = &self.config.net;
                    let whole = scaled_size(sample.image.size, &net.input);
                    let base = whole[1] as f64 / f64::from(sample.image.size[1]);
                    let size = self.image_size(step);
                    let scales = phase.scales.map(|scale| scale * base);
                    let config = &self.config.augment;
                    let view = choose_view(&sample, size, scales, config, &mut rng);
                    let image = training_image(&sample, &view, size, (config, net), &mut rng);
                    return Ok((image, problems));
                }
                Err(error) if attempt + 1 == TRIES => return Err(error),
                Err(error) => problems.push(error),
            }
        }
        unreachable!("the last attempt returns")
    }
}

/// Images before each phase's first step, with that step.
fn starts(config: &TrainConfig) -> Vec<(u64, u64)> {
    let mut starts = vec![(0, 0)];
    let mut before = 0;
    let mut first = 0;
    for phase in &config.phases {
        // The first step that is not this phase's any more.
        let mut end = (phase.until * config.schedule.steps as f64).ceil() as u64;
        while end > first && config.phase(end - 1) != phase {
            end -= 1;
        }
        before += end.saturating_sub(first) * phase.batch as u64;
        first = first.max(end);
        starts.push((before, first));
    }
    starts.pop();
    starts
}

fn work(shared: &Shared) {
    loop {
        let Ok(mut state) = shared.state.lock() else { return };
        while !state.stop && state.next.0 >= state.wanted + AHEAD {
            state = match shared.changed.wait(state) {
                Ok(state) => state,
                Err(_) => return,
            };
        }
        if state.stop || state.failed.is_some() {
            return;
        }
        let own = state.next;
        let last = own.1 + 1 == shared.config.phase(own.0).batch;
        state.next = if last { (own.0 + 1, 0) } else { (own.0, own.1 + 1) };
        drop(state);
        let image = shared.image(own);
        let Ok(mut state) = shared.state.lock() else { return };
        match image {
            Ok(image) => {
                state.done.insert(own, image);
            }
            Err(error) => state.failed = Some(error),
        }
        drop(state);
        shared.changed.notify_all();
    }
}
