//! `partpose label`: part, instance and COCO labels for a boxed data set.

mod comparison;

use std::path::PathBuf;

use anyhow::Context;
use clap::ValueEnum;
use partpose::dataset::folds::{Fold, Folds};
use partpose::dataset::{Dataset, DatasetOptions, SequenceId};
use partpose::labeling::{
    Categories, DontCare, Event, LabelError, LabelJob, LabelOptions, LabelReport, LabelStore,
    ModelChoice, Shard, Zoos, label_dataset,
};
use partpose::vehicle::ModelZoo;

use crate::commands::provenance;
use crate::progress;
use crate::report::{Outcome, hint, note, warn, warn_error};

/// Skipped frames and rows written out; more are counted.
const SHOWN: usize = 50;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose label --dataset kitti --zoo zoo --out labels
  partpose label --dataset kitti --zoo zoo --shard 3/16 --out labels")]
pub(crate) struct Arguments {
    /// Folder of the data set; its layout is recognised
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Folder of the models; `{fold}` stands for the number of the fold
    #[arg(long, value_name = "DIR")]
    zoo: String,
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Worlds, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    worlds: Vec<String>,
    /// Variations, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    variations: Vec<String>,
    /// Every N-th frame only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    stride: u32,
    /// Camera of Virtual KITTI 2
    #[arg(long, value_name = "N", default_value_t = 0)]
    camera: u32,
    /// How a model is chosen: nearest in size, as in the paper, or by the name that the data set gives
    #[arg(long, value_enum, default_value = "size")]
    models: ModelsFlag,
    /// Categories that get labels, separated by commas, or `all`; those that the zoo has models of, if not given. The
    /// others only hide what is behind them
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    categories: Vec<String>,
    /// Whether vehicles to ignore get labels, marked as such, or only hide what is behind them
    #[arg(long, value_enum, default_value = "draw")]
    dont_care: DontCareFlag,
    /// `all/K`: label each track with the zoo of its fold, which was carved without it
    #[arg(long, value_name = "all/K")]
    fold: Option<String>,
    /// Go on where an earlier run with the same settings stopped
    #[arg(long)]
    resume: bool,
    /// Do part I of N of the work; all parts write to the same folder and keep what they find done
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Threads to work with; as many as there are cores, if not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Compare with reference masks `DIR/<world>/<variation>/%05d.png` in the author's colours
    #[arg(long, value_name = "DIR", conflicts_with = "shard")]
    compare: Option<PathBuf>,
    /// Draw the N frames that agree worst and N about the middle
    #[arg(long, value_name = "N", default_value_t = 0, requires = "compare")]
    pictures: usize,
}

#[derive(Clone, Copy, ValueEnum)]
enum ModelsFlag {
    Size,
    Name,
}

#[derive(Clone, Copy, ValueEnum)]
enum DontCareFlag {
    Draw,
    Occlude,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let folds = fold_count(arguments)?;
    let options = DatasetOptions { camera: arguments.camera };
    let dataset = Dataset::open_with(&arguments.dataset, options)?;
    let sequences = dataset.select(&arguments.worlds, &arguments.variations)?;
    let numbers = folds.map_or(vec![None], |count| (1..=count).map(Some).collect());
    let path = |number: Option<usize>| {
        let number = number.map_or(String::new(), |number| number.to_string());
        PathBuf::from(arguments.zoo.replace("{fold}", &number))
    };
    let mut zoos = Vec::new();
    for number in numbers {
        let zoo = path(number);
        zoos.push(ModelZoo::load(&zoo)?);
        let fold = number.zip(folds).map(|(index, count)| Fold { index, count });
        let objection = provenance::objection(&zoo, &sequences, fold);
        if let Some(objection) = objection.filter(|_| arguments.compare.is_some()) {
            warn(objection);
        }
    }
    let folds = folds.map(|count| Folds::of(&dataset, &sequences, count)).transpose()?;
    if let Some(reference) = arguments.compare.as_ref().filter(|folder| !folder.is_dir()) {
        return Err(hint(
            anyhow::anyhow!("there is no folder `{}` to compare with", reference.display()),
            "`--compare` takes the folder above the worlds' folders",
        ));
    }
    let job = LabelJob {
        sequences: &sequences,
        stride: arguments.stride,
        zoos: Zoos { zoos: &zoos, folds: folds.as_ref() },
        options: label_options(arguments),
        shard: arguments.shard,
        resume: arguments.resume,
        reference: arguments.compare.clone(),
    };
    let report = with_threads(arguments.threads, || label(arguments, &dataset, &job))??;
    finish(arguments, &sequences, &report)
}

/// How many folds there are, if any.
fn fold_count(arguments: &Arguments) -> anyhow::Result<Option<usize>> {
    let in_zoo = arguments.zoo.contains("{fold}");
    let Some(text) = &arguments.fold else {
        if in_zoo {
            anyhow::bail!(
                "`{{fold}}` in `--zoo` stands for the number of a fold, so it needs `--fold all/K`"
            );
        }
        return Ok(None);
    };
    let count = text
        .strip_prefix("all/")
        .and_then(|count| Some(Fold::parse(&format!("{count}/{count}")).ok()?.count));
    match count {
        Some(count) if in_zoo => Ok(Some(count)),
        Some(_) => Err(hint(
            anyhow::anyhow!("all folds would be labelled with one zoo"),
            "carve a zoo for each fold (`zoo carve --fold I/K`) and write `{fold}` for its number, as in `--zoo zoo-{fold}`",
        )),
        None => Err(hint(
            anyhow::anyhow!("`{text}` does not say how many folds there are"),
            "every track is labelled, each with the zoo of its own fold: write `all/K`, as in `all/4`",
        )),
    }
}

fn label_options(arguments: &Arguments) -> LabelOptions {
    LabelOptions {
        models: match arguments.models {
            ModelsFlag::Size => ModelChoice::Size,
            ModelsFlag::Name => ModelChoice::Name,
        },
        categories: match &arguments.categories[..] {
            [] => Categories::OfZoo,
            [all] if all == "all" => Categories::All,
            named => Categories::Named(named.to_vec()),
        },
        dont_care: match arguments.dont_care {
            DontCareFlag::Draw => DontCare::Draw,
            DontCareFlag::Occlude => DontCare::Occlude,
        },
    }
}

fn with_threads<T: Send>(
    threads: Option<u16>,
    work: impl FnOnce() -> T + Send,
) -> anyhow::Result<T> {
    let Some(threads) = threads else { return Ok(work()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build();
    Ok(pool.context("the threads could not be started")?.install(work))
}

fn label(arguments: &Arguments, dataset: &Dataset, job: &LabelJob) -> anyhow::Result<LabelReport> {
    let bar = progress::bar("frames", 0);
    let observe = |event| match event {
        Event::Found(count) => bar.inc_length(count as u64),
        Event::Done(count) => bar.inc(count as u64),
    };
    let report = label_dataset(dataset, job, &LabelStore::new(&arguments.out), &observe);
    bar.finish_and_clear();
    report.map_err(|error| match remedy(&error) {
        Some(remedy) => hint(error, remedy),
        None => error.into(),
    })
}

fn remedy(error: &LabelError) -> Option<&'static str> {
    match error {
        LabelError::Occupied { .. } => {
            Some("choose another folder, or add `--resume` if it holds labels of the same settings")
        }
        LabelError::OtherRun { .. } => Some("choose another folder, or the same settings"),
        LabelError::Damaged { .. } => Some("choose another folder, or remove the file"),
        _ => None,
    }
}

/// Says what was done, writes the comparison.
fn finish(
    arguments: &Arguments,
    sequences: &[SequenceId],
    report: &LabelReport,
) -> anyhow::Result<Outcome> {
    for skipped in report.skipped.iter().take(SHOWN) {
        warn_error(format_args!("skipped {}", skipped.name), &skipped.error);
    }
    let left_out = report.skipped.len() + report.skipped_omitted;
    if left_out > SHOWN {
        warn(format_args!("{} more were skipped", left_out - SHOWN));
    }
    let sum = |count: fn(&partpose::labeling::SequenceReport) -> usize| -> usize {
        report.sequences.iter().map(count).sum()
    };
    let (written, kept) = (sum(|s| s.written), sum(|s| s.kept));
    if written + kept == 0 && arguments.shard.is_none() {
        return Err(hint(
            anyhow::anyhow!("no frame was labelled"),
            "`partpose dataset check DIR` tells what the data set holds",
        ));
    }
    note(format_args!(
        "labelled {} vehicles in {written} frames, kept {kept} frames, skipped {left_out}",
        sum(|s| s.vehicles)
    ));
    let (stand_ins, unknown) = (sum(|s| s.stand_ins), written + kept - sum(|s| s.segmented));
    if stand_ins > 0 {
        note(format_args!("{stand_ins} of them by models that stand in for what the zoo lacks"));
    }
    let named = sum(|s| s.named_otherwise);
    if named > 0 {
        note(format_args!(
            "{named} of them by the model nearest in size, though the zoo has the one that the data set names: \
             `--models name` goes by names"
        ));
    }
    if unknown > 0 {
        note(format_args!(
            "vehicles hide each other by depth; other occluders are unknown in {unknown} frames, which have no \
             segmentation"
        ));
    }
    let missing = sum(|s| s.missing_blocks);
    if missing > 0 {
        let open = report.sequences.iter().filter(|s| s.missing_blocks > 0).count();
        note(format_args!(
            "{missing} blocks of frames are left to other shards; the COCO files of {open} of {} sequences are written \
             by whoever finishes them",
            sequences.len()
        ));
    }
    if let (Some(agreement), Some(reference)) = (&report.agreement, &arguments.compare) {
        if agreement.frames == 0 {
            return Err(hint(
                anyhow::anyhow!("`{}` has no mask of the frames", reference.display()),
                "masks are looked for as `DIR/<world>/<variation>/%05d.png`",
            ));
        }
        comparison::write(arguments, reference, agreement, report)?;
    }
    Ok(if left_out == 0 { Outcome::Done } else { Outcome::Skipped })
}
