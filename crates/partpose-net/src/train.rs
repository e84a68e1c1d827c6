//! The training loop.
//!
//! One call trains from where the run's folder stands to the end, or until the observer says stop. The host keeps the
//! weights; each step puts them into the network, takes losses and gradients, and moves them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use burn::Tensor;
use burn::module::{ModuleVisitor, Param};
use burn::optim::GradientsParams;
use burn::tensor::{Device, TensorData};
use partpose::dataset::DatasetError;
use partpose::files::FileError;
use partpose::vehicle::ModelZoo;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::checkpoint::{self, Checkpoint};
use crate::curves::{self, Curves, LossRow, ScoreRow};
use crate::detector::Detector;
use crate::layers::to_host;
use crate::loader::{Batch, Loader};
use crate::mask_rcnn::{Losses, MaskRcnn};
use crate::optimizer::{self, Moments};
use crate::sample::Item;
use crate::training::TrainConfig;
use crate::validation::{Scores, ValidationError, validate};
use crate::weights::{self, Precision, Values, WeightsError, put_in, read_out};

/// Name of the best weights of a validation in a run's folder, ready for use.
pub const BEST: &str = "best.safetensors";
/// Name of the last weights in a run's folder, ready for use.
pub const LAST: &str = "weights.safetensors";

/// What a training learns from and is judged by.
#[derive(Clone, Debug)]
pub struct TrainData {
    /// To learn from.
    pub training: Arc<Vec<Item>>,
    /// To be judged by.
    pub validation: Vec<Item>,
}

/// Why a training stopped before its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrainError {
    /// There is nothing to learn from.
    #[error("no frame has an image, a part mask and vehicles")]
    NoFrames,
    /// The configuration is impossible.
    #[error("the configuration is impossible: {fault}")]
    Config {
        /// What is wrong with it.
        fault: String,
    },
    /// A training of another configuration lies in the folder.
    #[error("the run in `{folder}` was begun with another configuration: {field} differs")]
    OtherConfig {
        /// The run.
        folder: PathBuf,
        /// The table of the configuration that differs.
        field: &'static str,
    },
    /// The folder holds a run already.
    #[error("`{folder}` holds a run already")]
    Exists {
        /// The run.
        folder: PathBuf,
    },
    /// A loss is infinite or no number.
    #[error("the loss of step {step} is no finite number ({losses}); its images: {names}")]
    NotFinite {
        /// The step.
        step: u64,
        /// The losses.
        losses: String,
        /// The frames of its batch.
        names: String,
    },
    /// Frames could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Weights could not be read or written.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A validation failed.
    #[error(transparent)]
    Validation(#[from] ValidationError),
}

/// What a training tells while it runs.
#[derive(Debug)]
pub enum Event<'a> {
    /// It begins: nothing speaks against it. Nothing has been written yet.
    Begun,
    /// It goes on from a checkpoint.
    Resumed {
        /// Steps done.
        step: u64,
    },
    /// A step was done.
    Step {
        /// Steps done.
        step: u64,
        /// Steps in all.
        steps: u64,
        /// Images of this step.
        images: usize,
        /// Seconds that the step waited for its images.
        waited: f64,
        /// The newest line of the loss curve, at the steps that have one.
        row: Option<&'a LossRow>,
    },
    /// A validation was done.
    Validated {
        /// Steps done.
        step: u64,
        /// What came of it.
        scores: &'a Scores,
    },
    /// A checkpoint was written.
    Saved {
        /// Where.
        path: &'a Path,
    },
    /// A frame could not be read; another stands in for it.
    Skipped {
        /// Why.
        problem: &'a DatasetError,
    },
}

/// What the observer wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Go on.
    GoOn,
    /// Save and stop.
    Stop,
}

/// How a training ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Steps done.
    pub step: u64,
    /// Whether all steps are done.
    pub finished: bool,
}

/// From where a training begins.
#[derive(Clone, Debug)]
pub enum Begin {
    /// From random weights.
    Scratch,
    /// From these, in the network's order.
    Weights(Vec<Values>),
    /// From the last checkpoint in the folder; from random weights if there is none.
    Resume,
}

struct State {
    net: MaskRcnn,
    checkpoint: Checkpoint,
    trained: Vec<bool>,
    curves: Curves,
    best: f64,
}

/// Trains.
pub fn train(
    data: &TrainData,
    config: &TrainConfig,
    folder: &Path,
    (begin, device): (Begin, &Device),
    observe: &mut dyn FnMut(Event<'_>) -> Wish,
) -> Result<Outcome, TrainError> {
    if let Some(fault) = config.fault() {
        return Err(TrainError::Config { fault });
    }
    if data.training.is_empty() {
        return Err(TrainError::NoFrames);
    }
    let mut state = State::begin(config, folder, begin, device)?;
    let mut wish = observe(Event::Begun);
    if state.checkpoint.step > 0 {
        observe(Event::Resumed { step: state.checkpoint.step });
    }
    let steps = config.schedule.steps;
    let mut loader = Loader::start(Arc::clone(&data.training), config, state.checkpoint.step);
    let mut window = Window::default();
    while state.checkpoint.step < steps && wish == Wish::GoOn {
        let waiting = Instant::now();
        let batch = loader.next_batch()?;
        let waited = waiting.elapsed().as_secs_f64();
        for problem in &batch.problems {
            observe(Event::Skipped { problem });
        }
        let images = batch.names.len();
        let losses = state.step(batch, device)?;
        let step = state.checkpoint.step;
        window.add(losses);
        let due = step.is_multiple_of(config.report.every) || step == steps;
        if due {
            let row = window.row(step, state.rate(step - 1));
            state.curves.losses.push(row);
        }
        let row = state.curves.losses.last().filter(|_| due);
        wish = observe(Event::Step { step, steps, images, waited, row });
        let every = config.report.validate_every;
        if !data.validation.is_empty() && every > 0 && (step.is_multiple_of(every) || step == steps)
        {
            let scores = state.validate(&data.validation, folder)?;
            if observe(Event::Validated { step, scores: &scores }) == Wish::Stop {
                wish = Wish::Stop;
            }
        }
        let due = step.is_multiple_of(config.report.checkpoint_every);
        if due || step == steps || wish == Wish::Stop {
            let path = state.save(folder)?;
            observe(Event::Saved { path: &path });
        }
    }
    let step = state.checkpoint.step;
    Ok(Outcome { step, finished: step >= steps })
}

impl State {
    fn begin(
        config: &TrainConfig,
        folder: &Path,
        begin: Begin,
        device: &Device,
    ) -> Result<Self, TrainError> {
        let last = checkpoint::list(folder)?.pop();
        let net = config.net.init(device, config.seed);
        let names: Vec<Values> = read_out(&net);
        let (weights, curves, saved) = match (begin, last) {
            (Begin::Resume, Some(path)) => {
                let saved = checkpoint::load(&path)?;
                if let Some(field) = difference(&saved.config, config) {
                    return Err(TrainError::OtherConfig { folder: folder.to_owned(), field });
                }
                let curves = curves::read(folder, saved.step)?;
                (saved.weights.clone(), curves, Some(saved))
            }
            (_, Some(_)) => return Err(TrainError::Exists { folder: folder.to_owned() }),
            (Begin::Weights(weights), None) => (weights, Curves::default(), None),
            (Begin::Scratch | Begin::Resume, None) => (names.clone(), Curves::default(), None),
        };
        let net = put_in(net, |i| Some(&weights[i].values));
        let trained = names.iter().map(|tensor| {
            let frozen = config.optimizer.frozen.iter().any(|name| tensor.name.starts_with(name));
            !frozen && !is_statistic(&tensor.name)
        });
        let best =
            curves.scores.iter().map(super::curves::ScoreRow::quality).fold(f64::MIN, f64::max);
        let checkpoint = saved.map_or_else(
            || Checkpoint {
                step: 0,
                config: config.clone(),
                average: weights.clone(),
                moments: Moments::new(&weights, config.optimizer.kind),
                weights,
            },
            |saved| Checkpoint { config: config.clone(), ..saved },
        );
        Ok(Self { net, trained: trained.collect(), checkpoint, curves, best })
    }

    /// The learning rate of a step, counted from 0.
    fn rate(&self, step: u64) -> f64 {
        let config = &self.checkpoint.config;
        config.optimizer.rate * config.schedule.factor(step)
    }

    /// Learns from a batch; returns its losses and the norm of the gradients.
    fn step(&mut self, batch: Batch, device: &Device) -> Result<[f64; 9], TrainError> {
        let step = self.checkpoint.step;
        let config = &self.checkpoint.config;
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed ^ 0x6c6f_7373);
        rng.set_stream(step + 1);
        let images = Tensor::from_data(TensorData::new(batch.values, batch.shape), device);
        let losses = self.net.losses(images, &batch.targets, &mut rng);
        let total = losses.total(&config.net.loss);
        let values = values_of(&losses, &total);
        let broken = |losses: &[f64]| TrainError::NotFinite {
            step,
            losses: format!("{losses:.3?}"),
            names: batch.names.join(", "),
        };
        if !values.iter().all(|value| value.is_finite()) {
            return Err(broken(&values));
        }
        let gradients = gradients(&self.net, &total, &self.trained);
        let norm = optimizer::norm(&gradients);
        if !norm.is_finite() {
            return Err(broken(&values));
        }
        let now = (self.rate(step), step);
        let config = &self.checkpoint.config;
        optimizer::update(
            &mut self.checkpoint.weights,
            &mut self.checkpoint.moments,
            &gradients,
            &config.optimizer,
            now,
        );
        for (own, newest) in self.checkpoint.weights.iter_mut().zip(statistics(&self.net)) {
            if let Some(newest) = newest {
                own.values = newest;
            }
        }
        let weights = &self.checkpoint.weights;
        let trained = &self.trained;
        self.net = put_in(self.net.clone(), |i| trained[i].then(|| weights[i].values.as_slice()));
        let keep = config.optimizer.average;
        optimizer::average(&mut self.checkpoint.average, weights, keep, step);
        self.checkpoint.step += 1;
        let [a, b, c, d, e, f, g, h] = values;
        Ok([a, b, c, d, e, f, g, h, norm])
    }

    /// The network with the averaged weights.
    fn averaged(&self) -> MaskRcnn {
        let average = &self.checkpoint.average;
        let net = self.checkpoint.config.net.init(&Device::flex(), 0);
        put_in(net, |i| Some(&average[i].values))
    }

    fn validate(&mut self, items: &[Item], folder: &Path) -> Result<Scores, TrainError> {
        let net = self.averaged();
        let scores = validate(&Detector::new(&net), items, &ModelZoo::embedded())?;
        let row = ScoreRow::new(self.checkpoint.step, &scores);
        if row.quality() > self.best {
            self.best = row.quality();
            weights::save(&folder.join(BEST), &net, Precision::Half)?;
        }
        self.curves.scores.push(row);
        Ok(scores)
    }

    fn save(&self, folder: &Path) -> Result<PathBuf, TrainError> {
        let keep = self.checkpoint.config.report.keep;
        let path = checkpoint::save(folder, &self.checkpoint, keep)?;
        weights::save(&folder.join(LAST), &self.averaged(), Precision::Half)?;
        curves::write(folder, &self.curves)?;
        Ok(path)
    }
}

/// The table in which two configurations differ, besides what may change when a training goes on.
fn difference(a: &TrainConfig, b: &TrainConfig) -> Option<&'static str> {
    [
        ("`net`", a.net != b.net),
        ("`seed`", a.seed != b.seed),
        ("`optimizer.kind`", a.optimizer.kind != b.optimizer.kind),
    ]
    .into_iter()
    .find_map(|(name, differs)| differs.then_some(name))
}

fn is_statistic(name: &str) -> bool {
    name.ends_with("running_mean") || name.ends_with("running_var")
}

fn values_of(losses: &Losses, total: &Tensor<1>) -> [f64; 8] {
    let value = |tensor: &Tensor<1>| to_host(tensor.clone()).first().map_or(0.0, |v| f64::from(*v));
    let or_zero = |tensor: &Option<Tensor<1>>| tensor.as_ref().map_or(0.0, value);
    [
        value(total),
        value(&losses.rpn_objectness),
        value(&losses.rpn_box),
        value(&losses.class),
        value(&losses.boxes),
        value(&losses.mask),
        or_zero(&losses.model),
        or_zero(&losses.extent),
    ]
}

/// The gradient of each tensor of the network, in its order; `None` for those that are not trained.
fn gradients(net: &MaskRcnn, total: &Tensor<1>, trained: &[bool]) -> Vec<Option<Vec<f32>>> {
    struct Collector<'a> {
        from: GradientsParams,
        trained: &'a [bool],
        found: Vec<Option<Vec<f32>>>,
    }
    impl ModuleVisitor for Collector<'_> {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let gradient = self.from.remove::<D>(param.id);
            let wanted = self.trained[self.found.len()];
            self.found.push(gradient.filter(|_| wanted).map(to_host));
        }
    }
    let from = GradientsParams::from_grads(total.backward(), net);
    let mut collector = Collector { from, trained, found: Vec::new() };
    burn::module::Module::visit(net, &mut collector);
    collector.found
}

/// The running statistics among the tensors of the network, in its order.
fn statistics(net: &MaskRcnn) -> Vec<Option<Vec<f32>>> {
    struct Collector {
        name: Vec<String>,
        found: Vec<Option<Vec<f32>>>,
    }
    impl ModuleVisitor for Collector {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let is_one = self.name.last().is_some_and(|name| is_statistic(name));
            self.found.push(is_one.then(|| to_host(param.val())));
        }

        fn enter_module(&mut self, name: &str, _: &str) {
            self.name.push(name.to_owned());
        }

        fn exit_module(&mut self, _: &str, _: &str) {
            self.name.pop();
        }
    }
    let mut collector = Collector { name: Vec::new(), found: Vec::new() };
    // The copy for validation has the newest ones.
    burn::module::Module::visit(&burn::module::Module::valid(net), &mut collector);
    collector.found
}

/// Losses of the steps since the last line of the curve.
#[derive(Default)]
struct Window {
    sums: [f64; 9],
    count: u64,
}

impl Window {
    fn add(&mut self, losses: [f64; 9]) {
        self.sums.iter_mut().zip(losses).for_each(|(sum, loss)| *sum += loss);
        self.count += 1;
    }

    fn row(&mut self, step: u64, rate: f64) -> LossRow {
        let means = self.sums.map(|sum| sum / self.count.max(1) as f64);
        *self = Self::default();
        LossRow { step, rate, means }
    }
}
