//! `partpose zoo carve`: builds annotated models from part masks with known poses.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use partpose::carve::{
    CarveError, CarveOptions, Carved, CarvedModel, Progress, QualityOptions, carve_models,
    measure_quality,
};
use partpose::dataset::folds::{Fold, Folds};
use partpose::dataset::{Dataset, Frame, SequenceId};
use partpose::eval::measure_mask_bias;
use partpose::labeling::Shard;
use partpose::pose::dense::MaskBias;
use partpose::vehicle::{ModelZoo, PartialModel};
use partpose::viz::{TurntableOptions, turntable};

use super::carve_report;
use crate::commands::mask_bias;
use crate::commands::provenance;
use crate::progress;
use crate::report::{self, Outcome, hint};

/// Every how many frames the bias of masks is measured: neighbours say the same.
const MEASURED: u32 = 3;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose zoo carve --dataset vkitti --worlds 0001 --out zoo-0001 --report carved
  partpose zoo carve --dataset vkitti --worlds 0001,0018 --fold 1/4 --out zoo-1
  partpose zoo carve --dataset vkitti --worlds 0001 --shard 2/8 --out zoo-0001")]
pub(crate) struct Arguments {
    /// Folder of the data set
    #[arg(long, value_name = "DIR")]
    dataset: PathBuf,
    /// Worlds to carve from, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', required = true)]
    worlds: Vec<String>,
    /// Leave out the tracks of part I of K
    #[arg(long, value_name = "I/K")]
    fold: Option<Fold>,
    /// Models to carve, separated by commas; all that the rows name, if not given
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    models: Option<Vec<String>>,
    /// Folder to write the models to
    #[arg(long, value_name = "ZOO")]
    out: PathBuf,
    /// Folder to write pictures to, and how the models agree with the left-out tracks (with all, without --fold)
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// How far the masks lie off the true outlines: `none`; `measure` carves twice, the second time with what the first
    /// models show of it; or a file that `evaluate poses --mask-bias` wrote. What is left of it goes into the zoo as
    /// `mask-bias.json`
    #[arg(long, value_name = "BIAS", default_value = "none")]
    mask_bias: String,
    /// Make part I of N of the models; all parts may write to one folder
    #[arg(long, value_name = "I/N", conflicts_with = "report")]
    shard: Option<Shard>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let dataset = Dataset::open(&arguments.dataset)?;
    let (sequences, frames, complete) = read_frames(&dataset, &arguments.worlds)?;
    let folds = match arguments.fold {
        Some(fold) => Some((fold, Folds::of(&dataset, &sequences, fold.count)?)),
        None => None,
    };
    let leave_out = |sequence: &SequenceId, track: u32| {
        folds.as_ref().is_some_and(|(fold, folds)| folds.contains(*fold, sequence, track))
    };
    // Carving takes minutes; what cannot be written to is told before.
    for folder in std::iter::once(&arguments.out).chain(&arguments.report) {
        partpose::files::create_folder(folder)?;
    }
    let bar = progress::bar("masks", 1);
    let mut observe = |progress| match progress {
        Progress::Reading { done, total } => {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
        Progress::Carving { model, step } => bar.set_message(format!("{model}: {step}")),
    };
    let mut options = options(arguments)?;
    let names = arguments.models.as_deref();
    let mut carve = |options: &CarveOptions| {
        carve_models(&frames, names, &leave_out, options, &mut observe).map_err(|error| {
            let remedy = remedy(&error);
            hint(error, remedy)
        })
    };
    // Only what is carved is measured.
    let measure = |carved: &Carved| -> anyhow::Result<MaskBias> {
        let include = |frame: &Frame, vehicle: usize| {
            let track = frame.vehicles[vehicle].track;
            frame.index.is_multiple_of(MEASURED)
                && track.is_none_or(|track| !leave_out(&frame.sequence, track))
        };
        measure_mask_bias(&frames, &zoo_of(carved), &include).ok_or_else(|| {
            hint(
                anyhow::anyhow!("too few vehicles to measure the mask bias on"),
                "carve from more worlds, or without `--mask-bias`",
            )
        })
    };
    options.mask_bias = match arguments.mask_bias.as_str() {
        "none" => None,
        "measure" => Some(measure(&carve(&options)?)?),
        file => Some(mask_bias::read(Path::new(file))?),
    }
    .map(|bias| bias.without_distance());
    let carved = carve(&options)?;
    bar.finish_and_clear();
    for skipped in &carved.skipped {
        report::warn_error("left a model out", skipped);
    }
    if carved.models.is_empty() && arguments.shard.is_none() {
        let error = anyhow::anyhow!("no model could be carved");
        return Err(hint(
            error,
            "carve from more worlds, so that each model is seen from several sides",
        ));
    }
    let mut table = table_of(&carved.models);
    let zoo = zoo_of(&carved);
    save(&zoo, arguments)?;
    if options.mask_bias.is_some() && arguments.shard.is_none() {
        mask_bias::write(&arguments.out.join(mask_bias::NAME), &measure(&carved)?)?;
    }
    provenance::write(&arguments.out, dataset.root(), &sequences, arguments.fold)?;
    if let Some(folder) = &arguments.report {
        let measured =
            |sequence: &SequenceId, track: u32| folds.is_none() || leave_out(sequence, track);
        table = table + "\n" + &write_report(folder, &frames, &zoo, options.mask_bias, &measured)?;
    }
    report::data(&table)?;
    Ok(if carved.skipped.is_empty() && complete { Outcome::Done } else { Outcome::Skipped })
}

fn options(arguments: &Arguments) -> anyhow::Result<CarveOptions> {
    let Some(shard) = arguments.shard else { return Ok(CarveOptions::default()) };
    if arguments.mask_bias == "measure" {
        return Err(hint(
            anyhow::anyhow!("the bias of masks is measured on all models, and a part makes some"),
            "measure it with `evaluate poses --mask-bias`, once a zoo is carved, and give the file",
        ));
    }
    Ok(CarveOptions { made: (shard.count, shard.index - 1), ..Default::default() })
}

/// Writes the models: a part beside those of the others.
fn save(zoo: &ModelZoo, arguments: &Arguments) -> anyhow::Result<()> {
    if arguments.shard.is_none() {
        return Ok(zoo.save(&arguments.out)?);
    }
    for model in &zoo.models {
        ModelZoo::add_to(&arguments.out, &PartialModel::from(model))?;
    }
    Ok(())
}

fn zoo_of(carved: &Carved) -> ModelZoo {
    ModelZoo { models: carved.models.iter().map(|carved| carved.model.clone()).collect() }
}

/// Pictures of the models, and how they agree with the views of the tracks that `measured` names.
fn write_report(
    folder: &Path,
    frames: &[Frame],
    zoo: &ModelZoo,
    mask_bias: Option<MaskBias>,
    measured: &dyn Fn(&SequenceId, u32) -> bool,
) -> anyhow::Result<String> {
    let bar = progress::bar("measuring", 1);
    let mut observe = |progress| {
        if let Progress::Reading { done, total } = progress {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
    };
    let options = QualityOptions { mask_bias, ..Default::default() };
    let views = measure_quality(frames, &zoo.models, measured, &options, &mut observe);
    bar.finish_and_clear();
    for model in &zoo.models {
        let path = folder.join(format!("{}.png", model.name()));
        partpose::files::write_png(&path, &turntable(model, &TurntableOptions::default()))?;
    }
    carve_report::write(folder, &zoo.models, &views)
}

/// What was carved, one line a model.
fn table_of(models: &[CarvedModel]) -> String {
    let mut table = String::from("model\ttracks\tviews\tfaces\twidth\theight\tlength\n");
    for carved in models {
        let (model, extent) = (&carved.model, carved.model.extent());
        let _ = writeln!(
            table,
            "{}\t{}\t{}\t{}\t{:.3}\t{:.3}\t{:.3}",
            model.name(),
            carved.tracks,
            carved.views,
            model.mesh().faces.len(),
            extent.width,
            extent.height,
            extent.length,
        );
    }
    table
}

/// What can be done where nothing can be carved.
fn remedy(error: &CarveError) -> &'static str {
    match error {
        CarveError::NoMasks { .. } => {
            "part masks belong in parts/WORLD/VARIATION/NNNNN.png of the data set's folder"
        }
        CarveError::NoModelNames => "only data sets that name the mesh of a vehicle can be carved",
        _ => "choose among the names given, or leave --models out",
    }
}

/// The sequences and frames of some worlds, and whether all of their rows could be read.
fn read_frames(
    dataset: &Dataset,
    worlds: &[String],
) -> anyhow::Result<(Vec<SequenceId>, Vec<Frame>, bool)> {
    for world in worlds {
        if !dataset.sequences().iter().any(|sequence| sequence.world == *world) {
            let mut known: Vec<&str> =
                dataset.sequences().iter().map(|id| id.world.as_str()).collect();
            known.dedup();
            let error = anyhow::anyhow!("`{}` has no world `{world}`", dataset.root().display());
            return Err(hint(error, format!("it has {}", known.join(", "))));
        }
    }
    let chosen = dataset.sequences().iter().filter(|sequence| worlds.contains(&sequence.world));
    let sequences: Vec<SequenceId> = chosen.cloned().collect();
    let (mut frames, mut complete) = (Vec::new(), true);
    for sequence in &sequences {
        let read = dataset.read(sequence)?;
        for problem in &read.problems {
            report::warn(problem);
        }
        complete &= read.problems.is_empty();
        frames.extend(read.frames);
    }
    Ok((sequences, frames, complete))
}
