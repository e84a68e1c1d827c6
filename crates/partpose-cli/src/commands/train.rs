//! `partpose train`: trains a network on labelled data sets.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Context;
use burn::tensor::Device;
use clap::ValueEnum;
use partpose::dataset::Dataset;
use partpose::files;
use partpose::vehicle::ModelZoo;
use partpose_net::sample::{self, Item};
use partpose_net::train::{self, Begin, Event, TrainData, TrainError, Wish};
use partpose_net::training::{Balance, TrainConfig};
use partpose_net::{balance, import};

use crate::device::{DeviceFlag, parse_device};
use crate::progress;
use crate::report::{Outcome, hint, note, warn, warn_error};

/// Name of the configuration in a run's folder.
const CONFIG: &str = "config.toml";
/// Every so many frames one is held out where there is no validation set.
const HELD_OUT: usize = 20;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose synth --out data --worlds 10 --frames 4 --fps 0.5
  partpose train --dataset data --out run --steps 6000
      the default network from random weights
  partpose train --dataset data --out run --resume
      goes on after Ctrl-C or a crash, to the same weights
  partpose train --dataset vkitti --preset paper --kernel 28 --init fasterrcnn.pth --out run")]
pub(crate) struct Arguments {
    /// Data sets with images and part masks to learn from
    #[arg(long, value_name = "DIR", required = true, num_args = 1..)]
    dataset: Vec<PathBuf>,
    /// Data sets to be judged by [default: every twentieth frame of the others, which is then not learnt from]
    #[arg(long, value_name = "DIR", num_args = 1..)]
    validation: Vec<PathBuf>,
    /// Folder of the run: configuration, checkpoints, weights, curves
    #[arg(long, value_name = "RUN")]
    out: PathBuf,
    /// TOML file of a training; what it leaves out comes from the preset
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Where values come from that neither file nor flags give
    #[arg(long, value_enum, default_value = "default")]
    preset: Preset,
    /// Initial weights: ours, or torchvision's classifiers or detectors (`.safetensors`, `.pth`); what fits is taken
    #[arg(long, value_name = "FILE", conflicts_with = "resume")]
    init: Option<PathBuf>,
    /// Go on with the run in the folder
    #[arg(long)]
    resume: bool,
    /// Steps of the whole training
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Save and stop after so many minutes; `--resume` goes on
    #[arg(long, value_name = "MINUTES")]
    time_budget: Option<f64>,
    /// Learn from cars, too, that the data set asks to ignore
    #[arg(long)]
    with_dontcare: bool,
    /// Cells a side of the part masks: 14, 28, 42 or 56 in the paper
    #[arg(long, value_name = "M", value_parser = clap::value_parser!(u16).range(2..=112))]
    kernel: Option<u16>,
    /// Seed of everything random
    #[arg(long)]
    seed: Option<u64>,
    /// Highest learning rate
    #[arg(long, value_name = "RATE")]
    rate: Option<f64>,
    /// Where to compute: `cpu`, and `cuda`, `cuda:1`, `wgpu`, ... if the program was built with that feature
    #[arg(long, default_value = "cpu", value_name = "DEVICE", value_parser = parse_device)]
    device: DeviceFlag,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preset {
    /// A small network that a laptop's processor trains and runs
    Default,
    /// The paper's: ResNet-101, 600 pixels, 400,000 steps from a pretrained detector
    Paper,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let device = arguments.device.device.clone().autodiff();
    let mut config = resolve(arguments)?;
    let data = read_data(arguments, &config)?;
    // A run goes on with the weights that it began with.
    let weighted = arguments.resume && !config.net.parts.class_weights.is_empty();
    if config.data.balance == Balance::InverseSquareRoot && !weighted {
        let zoo = ModelZoo::embedded();
        config.net.parts.class_weights = balance::class_weights(&data.training, &zoo)?;
    }
    let begin = match &arguments.init {
        Some(path) => Begin::Weights(initial(path, &config)?),
        None if arguments.resume => Begin::Resume,
        None => Begin::Scratch,
    };
    note(format_args!(
        "{} frames to learn from, {} to be judged by",
        data.training.len(),
        data.validation.len()
    ));
    files::create_folder(&arguments.out)?;
    let end = train_it(arguments, &data, &config, (begin, &device))?;
    let folder = arguments.out.display();
    if end.finished {
        note(format_args!(
            "trained {} steps; the weights are `{folder}/{}`",
            end.step,
            train::LAST
        ));
    } else {
        note(format_args!("stopped after {} steps; go on with `--resume`", end.step));
    }
    Ok(Outcome::Done)
}

/// Runs the training; shows how it goes.
fn train_it(
    arguments: &Arguments,
    data: &TrainData,
    config: &TrainConfig,
    begin: (Begin, &Device),
) -> anyhow::Result<train::Outcome> {
    let text = toml::to_string_pretty(config).context("cannot write the configuration")?;
    let mut written = Ok(());
    let stop = Arc::new(AtomicBool::new(false));
    let asked = Arc::clone(&stop);
    // Without a handler Ctrl-C ends the program at once, and the last checkpoint is what is left.
    if ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed)).is_err() {
        warn("Ctrl-C will not save a checkpoint");
    }
    let budget = arguments.time_budget.map(|minutes| Duration::from_secs_f64(60.0 * minutes));
    let began = Instant::now();
    let bar = progress::bar("training", config.schedule.steps);
    let mut images = 0;
    let mut done = 0_u64;
    let mut waited = 0.0;
    let end = train::train(data, config, &arguments.out, begin, &mut |event| {
        match event {
            // Only now, so that a run that is not gone on with keeps its own.
            Event::Begun => {
                written = files::write(&arguments.out.join(CONFIG), text.as_bytes());
                if written.is_err() {
                    return Wish::Stop;
                }
            }
            Event::Resumed { step } => bar.reset_with(step),
            Event::Step { step, steps, images: more, waited: seconds, row } => {
                bar.set_position(step);
                images += more;
                done += 1;
                waited += seconds;
                if let Some(row) = row {
                    let seconds = began.elapsed().as_secs_f64();
                    let left = seconds / done as f64 * (steps - step) as f64 / 60.0;
                    let [total, .., norm] = row.means;
                    bar.suspend(|| {
                        note(format_args!(
                            "step {step} of {steps}: loss {total:.3} (objects {:.3}, boxes {:.3}; class {:.3}, box \
                             {:.3}, mask {:.3}), gradient {norm:.1}, rate {:.1e}; {:.2} images/s, {:.0} % of the \
                             time waiting for images, {left:.0} min left",
                            row.means[1],
                            row.means[2],
                            row.means[3],
                            row.means[4],
                            row.means[5],
                            row.rate,
                            images as f64 / seconds,
                            100.0 * waited / seconds,
                        ));
                    });
                }
            }
            Event::Validated { step, scores } => bar.suspend(|| {
                let (boxes, masks) = (&scores.boxes, &scores.masks);
                note(format_args!(
                    "step {step}, {} images: Table I precision {:.4}, recall {:.4}, mIoU {:.4}; Table II mPA {:.4} \
                     (of vehicle pixels {:.4})",
                    boxes.frames,
                    boxes.precision,
                    boxes.recall,
                    boxes.mean_iou,
                    masks.mpa,
                    masks.mean_foreground_accuracy
                ));
            }),
            Event::Saved { path } => {
                bar.suspend(|| note(format_args!("saved `{}`", path.display())));
            }
            Event::Skipped { problem } => bar.suspend(|| warn_error("skipped a frame", problem)),
        }
        let over = budget.is_some_and(|budget| began.elapsed() >= budget);
        if over || stop.load(Ordering::Relaxed) { Wish::Stop } else { Wish::GoOn }
    });
    bar.finish_and_clear();
    written?;
    end.map_err(|error| advised(error, &arguments.out))
}

/// Defaults, then the file, then flags.
fn resolve(arguments: &Arguments) -> anyhow::Result<TrainConfig> {
    let base = match arguments.preset {
        Preset::Default => TrainConfig::default(),
        Preset::Paper => TrainConfig::paper(),
    };
    let saved = arguments.out.join(CONFIG);
    let path = match &arguments.config {
        // A run goes on as it was begun.
        None if arguments.resume && saved.is_file() => Some(saved),
        other => other.clone(),
    };
    let mut config = match path {
        Some(path) => merged(&base, &path)?,
        None => base,
    };
    config.schedule.steps = arguments.steps.unwrap_or(config.schedule.steps);
    config.seed = arguments.seed.unwrap_or(config.seed);
    config.optimizer.rate = arguments.rate.unwrap_or(config.optimizer.rate);
    config.net.parts.kernel = arguments.kernel.map_or(config.net.parts.kernel, usize::from);
    config.data.with_dontcare |= arguments.with_dontcare;
    Ok(config)
}

/// A preset with what a file says otherwise.
fn merged(base: &TrainConfig, path: &Path) -> anyhow::Result<TrainConfig> {
    fn lay(over: toml::Table, under: &mut toml::Table) {
        for (key, value) in over {
            match (value, under.get_mut(&key)) {
                (toml::Value::Table(over), Some(toml::Value::Table(under)))
                    // A table that says its kind is one of several: it replaces the other.
                    if !over.contains_key("kind") =>
                {
                    lay(over, under);
                }
                (value, _) => {
                    under.insert(key, value);
                }
            }
        }
    }
    let text = files::read_text(path)?;
    let failed = || format!("cannot read the configuration `{}`", path.display());
    let file: toml::Table = toml::from_str(&text).with_context(failed)?;
    let mut table = toml::Table::try_from(base).context("cannot lay out the preset")?;
    lay(file, &mut table);
    table.try_into().with_context(failed)
}

/// The frames to learn from and to be judged by.
fn read_data(arguments: &Arguments, config: &TrainConfig) -> anyhow::Result<TrainData> {
    let training = read_items(&arguments.dataset)?;
    let (training, mut validation) = if arguments.validation.is_empty() {
        let (held, kept): (Vec<_>, Vec<_>) =
            training.into_iter().enumerate().partition(|(i, _)| i % HELD_OUT == HELD_OUT / 2);
        let items = |list: Vec<(usize, Item)>| list.into_iter().map(|(_, item)| item).collect();
        (items(kept), items(held))
    } else {
        (training, read_items(&arguments.validation)?)
    };
    let most = config.report.validation_images.max(1);
    let step = validation.len().div_ceil(most).max(1);
    validation = validation.into_iter().step_by(step).collect();
    Ok(TrainData { training: Arc::new(training), validation })
}

fn read_items(folders: &[PathBuf]) -> anyhow::Result<Vec<Item>> {
    let mut all = Vec::new();
    for folder in folders {
        let (items, left_out) = sample::items(&Dataset::open(folder)?)?;
        if items.is_empty() {
            return Err(hint(
                anyhow::anyhow!(
                    "`{}` has no frame with an image, a part mask and vehicles",
                    folder.display()
                ),
                "`partpose label` makes part masks for a data set with images and boxes",
            ));
        }
        if left_out > 0 {
            let folder = folder.display();
            note(format_args!("`{folder}`: {left_out} frames cannot be learnt from"));
        }
        all.extend(items);
    }
    Ok(all)
}

/// Initial weights out of a file; says what of it was not taken.
fn initial(
    path: &Path,
    config: &TrainConfig,
) -> anyhow::Result<Vec<partpose_net::weights::Values>> {
    let net = config.net.init(&Device::flex(), config.seed);
    let imported = import::import(path, &net)?;
    note(format_args!(
        "took {} of {} tensors from `{}`",
        imported.taken.len(),
        imported.weights.len(),
        path.display()
    ));
    for refused in &imported.refused {
        note(format_args!("  not taken: {refused}"));
    }
    if imported.taken.is_empty() {
        anyhow::bail!("nothing in `{}` fits the network", path.display());
    }
    Ok(imported.weights)
}

fn advised(error: TrainError, folder: &Path) -> anyhow::Error {
    let folder = folder.display();
    match &error {
        TrainError::Exists { .. } => {
            hint(error, "add `--resume` to go on with it, or choose another folder")
        }
        TrainError::OtherConfig { .. } => hint(
            error,
            format!("leave `--config` and flags out to go on as `{folder}/{CONFIG}` says"),
        ),
        TrainError::NotFinite { .. } => hint(
            error,
            format!(
                "the last checkpoint in `{folder}` is good: `--resume --rate` with a lower rate goes on from it"
            ),
        ),
        _ => error.into(),
    }
}

trait ResetWith {
    fn reset_with(&self, step: u64);
}

impl ResetWith for indicatif::ProgressBar {
    /// Counts rates from a step on.
    fn reset_with(&self, step: u64) {
        self.set_position(step);
        self.reset_eta();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_overrides_a_preset_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        let text =
            "seed = 9\n[net.parts]\nkernel = 14\n[schedule.fall]\nkind = \"cosine\"\nlast = 0.5\n";
        files::write(&path, text.as_bytes()).unwrap();
        let config = merged(&TrainConfig::paper(), &path).unwrap();
        let mut expected = TrainConfig::paper();
        expected.seed = 9;
        expected.net.parts.kernel = 14;
        expected.schedule.fall = partpose_net::schedule::Fall::Cosine { last: 0.5 };
        assert_eq!(config, expected);
    }

    /// Names of all keys, those of tables within tables after a dot.
    fn keys(table: &toml::Table, before: &str, found: &mut Vec<String>) {
        for (key, value) in table {
            let name = format!("{before}.{key}");
            match value {
                toml::Value::Table(inner) => keys(inner, &name, found),
                _ => found.push(name),
            }
        }
    }

    #[test]
    fn the_files_of_configs_are_complete_and_say_what_the_presets_do() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        for (name, preset) in
            [("default.toml", TrainConfig::default()), ("paper.toml", TrainConfig::paper())]
        {
            let text = files::read_text(&folder.join(name)).unwrap();
            let read: TrainConfig = toml::from_str(&text).unwrap();
            assert_eq!(read, preset, "{name}");
            let [mut given, mut all] = [Vec::new(), Vec::new()];
            keys(&toml::from_str(&text).unwrap(), "", &mut given);
            keys(&toml::Table::try_from(&preset).unwrap(), "", &mut all);
            given.sort();
            all.sort();
            assert_eq!(given, all, "{name}");
        }
    }

    #[test]
    fn a_misspelt_key_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("c.toml");
        files::write(&path, b"[net.parts]\nkernels = 14\n").unwrap();
        let error = merged(&TrainConfig::default(), &path).unwrap_err();
        assert!(format!("{error:#}").contains("kernels"), "{error:#}");
    }
}
