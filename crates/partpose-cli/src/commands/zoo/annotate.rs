//! `partpose zoo annotate`: part labels for a mesh that lacks them, from the labelled models that resemble it.

mod self_test;
mod tables;

use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::annotate::{
    self, AnnotateError, AnnotateOptions, AnnotateWarning, Annotation, Sources,
};
use partpose::files;
use partpose::parts::PartClass;
use partpose::vehicle::{ModelZoo, PartialModel, VehicleModel, ZooError, from_partial_glb};
use partpose::viz::{TurntableOptions, confidence_turntable, turntable};

use crate::progress;
use crate::report::{self, Outcome, hint};

/// Confidence below which a part is worth a warning.
const LOW: f64 = 0.6;

#[expect(clippy::option_option, reason = "a flag whose value may be left out")]
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose zoo annotate zoo/hatchback.partial.glb --out zoo --report pictures
  partpose zoo annotate --self-test")]
pub(crate) struct Arguments {
    /// Model with faces without a part, as `zoo import` writes it
    #[arg(value_name = "MODEL", required_unless_present = "self_test")]
    model: Option<PathBuf>,
    /// Labelled models: folder of `.glb` files, or one such file; the embedded models, if not given
    #[arg(long, value_name = "ZOO")]
    from: Option<PathBuf>,
    /// Parts that the vehicle lacks, such as `doors_RL,doors_RR`; those that its body style lacks are known
    #[arg(long, value_name = "PARTS", value_delimiter = ',', value_parser = part)]
    without: Vec<PartClass>,
    /// Transfer from models of this body style only
    #[arg(long, value_name = "NAME")]
    style: Option<String>,
    /// How many of the labelled models vote, the nearest ones
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    sources: u16,
    /// Keep faces without a part that can be seen from nowhere, such as seats
    #[arg(long)]
    keep_hidden: bool,
    /// Folder to write the annotated model to, beside those that are there
    #[arg(long, value_name = "ZOO", required_unless_present = "self_test")]
    out: Option<PathBuf>,
    /// Folder for pictures to check the result by
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Strip the labels of these models (the labelled ones themselves, if no value is given), transfer them from
    /// models of other body styles, and print how many come back
    #[arg(long, value_name = "ZOO", num_args = 0..=1, conflicts_with_all = ["model", "out", "report", "without", "style"])]
    self_test: Option<Option<PathBuf>>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let options = AnnotateOptions {
        style: arguments.style.clone(),
        without: arguments.without.clone(),
        sources: usize::from(arguments.sources),
        keep_hidden: arguments.keep_hidden,
    };
    // What was typed is looked at before minutes of work.
    let partial = arguments.model.as_deref().map(read).transpose()?;
    let zoo = super::open(arguments.from.as_deref())?;
    if let Some(targets) = &arguments.self_test {
        let targets = targets.as_deref().map(ModelZoo::load).transpose()?;
        return self_test::run(&zoo, targets.as_ref(), &options);
    }
    let (Some(partial), Some(out)) = (partial, &arguments.out) else {
        anyhow::bail!("a model and `--out` are needed");
    };
    files::create_folder(out)?;
    if let Some(report) = &arguments.report {
        files::create_folder(report)?;
    }
    let sources = prepare(&zoo);
    let annotation = annotate::annotate(&partial, &sources, &options).map_err(advised)?;
    let file = ModelZoo::add_to(out, &PartialModel::from(&annotation.model))?;
    let record = out.join(format!("{}.annotation.json", partial.name));
    files::write(&record, tables::record(&annotation).as_bytes())?;
    report::data(&tables::parts(&annotation))?;
    if let Some(folder) = &arguments.report {
        draw(folder, &zoo, &annotation)?;
    }
    report::note(format_args!("wrote `{}` and `{}`", file.display(), record.display()));
    report::note(tables::summary(&annotation));
    let is_sure = tell(&annotation);
    Ok(if is_sure { Outcome::Done } else { Outcome::Skipped })
}

fn part(name: &str) -> Result<PartClass, String> {
    PartClass::from_name(name)
        .ok_or_else(|| "not one of the 29 parts, such as `doors_RL` or `glass_CR`".to_owned())
}

fn read(path: &Path) -> anyhow::Result<PartialModel> {
    let bytes = files::read(path)?;
    let model = from_partial_glb(&bytes)
        .map_err(|source| ZooError::Model { path: path.to_owned(), source })?;
    if model.unlabeled() == 0 {
        let error = anyhow::anyhow!("every face of `{}` has its part already", path.display());
        return Err(hint(error, "leave faces without one: `partpose zoo import` tells how"));
    }
    Ok(model)
}

fn prepare(zoo: &ModelZoo) -> Sources {
    let bar = progress::bar("preparing", zoo.models.len() as u64);
    let sources = Sources::new(zoo, &mut |done| bar.set_position(done as u64));
    bar.finish_and_clear();
    sources
}

fn advised(error: AnnotateError) -> anyhow::Error {
    match error {
        AnnotateError::Style { .. } => {
            hint(error, "give one of these to `--style`, or leave it away")
        }
        AnnotateError::NoSurface => hint(error, "look at it with another program: is it empty?"),
        _ => error.into(),
    }
}

/// The labelled model, the same by confidence, and the source that counted most.
fn draw(folder: &Path, zoo: &ModelZoo, annotation: &Annotation) -> anyhow::Result<()> {
    let options = TurntableOptions::default();
    let name = annotation.model.name();
    let write = |suffix: &str, image| {
        let path = folder.join(format!("{name}.{suffix}.png"));
        files::write_png(&path, &image)
            .with_context(|| format!("cannot draw `{name}`"))
            .map(|()| report::note(format_args!("drew `{}`", path.display())))
    };
    write("parts", turntable(&annotation.model, &options))?;
    write("confidence", confidence_turntable(annotation, &options))?;
    let first = annotation.sources.first().map(|source| source.name.as_str());
    let source: Option<&VehicleModel> = first.and_then(|name| zoo.get(name));
    source.map_or(Ok(()), |source| write("source", turntable(source, &options)))
}

/// Warnings; whether there were none.
fn tell(annotation: &Annotation) -> bool {
    for warning in &annotation.warnings {
        match warning {
            AnnotateWarning::Backwards { distance, turned } => report::warn(format_args!(
                "the mesh is more like the labelled models when turned round ({turned:.2} m off instead of \
                 {distance:.2} m): is `forward` right?"
            )),
            AnnotateWarning::Sideways => {
                report::warn("the mesh is wider than long: are its axes right?");
            }
            AnnotateWarning::NoWheels => {
                report::warn("no wheels were found on the ground: the axles are guessed");
            }
            AnnotateWarning::Unlike { distance } => report::warn(format_args!(
                "no labelled model is like the mesh: the nearest is {distance:.2} m off on average"
            )),
            _ => report::warn(format_args!("{warning:?}")),
        }
    }
    let low = tables::unsure(annotation, LOW);
    for (part, confidence) in &low {
        report::warn(format_args!("`{}` is unsure: mean confidence {confidence:.2}", part.name()));
    }
    if !low.is_empty() {
        report::note("hint: look at the pictures that `--report DIR` draws");
    }
    annotation.warnings.is_empty() && low.is_empty()
}
