//! Which frames, tracks and models are evaluated.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use anyhow::Context;
use partpose::dataset::folds::Fold;
use partpose::dataset::{Dataset, Frame, SequenceId};
use partpose::eval::model_names::ModelNames;
use partpose::files;
use partpose::vehicle::ModelZoo;

use super::{Arguments, Needs, selection};
use crate::report::{hint, note};

/// The sequences and frames that were chosen, and how many places were wrong.
pub(super) fn chosen(
    arguments: &Arguments,
    dataset: &Dataset,
) -> anyhow::Result<(Vec<SequenceId>, Vec<Frame>, usize)> {
    let sequences = arguments.selection.sequences(dataset, arguments.oracle)?;
    // Without masks there are still poses, only no accuracy of pixels.
    let needs = if arguments.oracle { Needs::PartMask } else { Needs::Labels };
    let (frames, skipped) =
        selection::read(dataset, &sequences, arguments.selection.stride, needs)?;
    Ok((sequences, frames, skipped))
}

/// Tells which vehicles are not judged, or not by their model.
pub(super) fn tell_unknown(frames: &[Frame], (zoo, names): (&ModelZoo, &ModelNames), oracle: bool) {
    if oracle {
        let unknown = without_model(frames, zoo);
        if unknown > 0 {
            note(format_args!(
                "left out {unknown} labelled vehicles whose model the zoo does not have"
            ));
        }
        return;
    }
    let vehicles = frames.iter().flat_map(|frame| &frame.vehicles).filter(|v| !v.dont_care);
    let models: BTreeSet<&str> = vehicles.filter_map(|v| v.model.as_deref()).collect();
    let unknown: Vec<&str> =
        models.into_iter().filter(|name| names.right(name, zoo).is_empty()).collect();
    if !unknown.is_empty() {
        note(format_args!(
            "the choice of the model is not judged for {}: the zoo has no model of that name or body style \
             (`--model-names` says which are right)",
            unknown.join(", ")
        ));
    }
}

/// What the user says of the names of models.
pub(super) fn model_names(arguments: &Arguments, zoo: &ModelZoo) -> anyhow::Result<ModelNames> {
    let Some(path) = &arguments.model_names else { return Ok(ModelNames::default()) };
    let given: BTreeMap<String, Vec<String>> = toml::from_str(&files::read_text(path)?)
        .with_context(|| format!("`{}` is no list of models by name", path.display()))?;
    let names = ModelNames { given };
    if let Some(unknown) = names.unknown(zoo).first() {
        return Err(hint(
            anyhow::anyhow!(
                "`{}` names the model `{unknown}`, which the zoo lacks",
                path.display()
            ),
            "`partpose zoo list` lists the models",
        ));
    }
    Ok(names)
}

/// How many vehicles that are not to be ignored show a model that the zoo lacks.
fn without_model(frames: &[Frame], zoo: &ModelZoo) -> usize {
    let vehicles = frames.iter().flat_map(|frame| &frame.vehicles).filter(|v| !v.dont_care);
    let known = |name: &str| zoo.get(name).is_some();
    vehicles.filter(|vehicle| !vehicle.model.as_deref().is_some_and(known)).count()
}

/// The folds to score, one zoo each.
pub(super) fn folds(arguments: &Arguments) -> anyhow::Result<Vec<Option<Fold>>> {
    let zoo = arguments.zoo.as_deref().unwrap_or_default();
    let Some(text) = &arguments.fold else {
        if zoo.contains("{fold}") {
            anyhow::bail!(
                "`{{fold}}` in `--zoo` stands for the number of a fold, so it needs `--fold`"
            );
        }
        return Ok(vec![None]);
    };
    let Some(count) = text.strip_prefix("all/") else {
        return Ok(vec![Some(Fold::parse(text)?)]);
    };
    let last = Fold::parse(&format!("{count}/{count}"))?;
    if !zoo.contains("{fold}") {
        return Err(hint(
            anyhow::anyhow!(
                "all folds would be judged by one zoo, which was made from their own pictures"
            ),
            "carve a zoo for each fold (`zoo carve --fold I/K`) and write `{fold}` for its number, as in `--zoo zoo-{fold}`",
        ));
    }
    Ok((1..=last.count).map(|index| Some(Fold { index, count: last.count })).collect())
}

/// The zoo of a fold; `None` for the embedded one.
pub(super) fn zoo_path(arguments: &Arguments, fold: Option<Fold>) -> Option<PathBuf> {
    let number = fold.map_or(String::new(), |fold| fold.index.to_string());
    arguments.zoo.as_ref().map(|zoo| PathBuf::from(zoo.replace("{fold}", &number)))
}
