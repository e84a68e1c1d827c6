//! Which frames, tracks and models are evaluated.

use std::path::PathBuf;

use partpose::dataset::folds::Fold;
use partpose::dataset::{Dataset, Fault, Frame, SequenceId};
use partpose::vehicle::ModelZoo;

use super::Arguments;
use crate::report::{hint, warn};

/// The variation that is meant where none is named.
const DEFAULT_VARIATION: &str = "clone";

/// The sequences that were chosen.
pub(super) fn sequences(
    arguments: &Arguments,
    dataset: &Dataset,
) -> anyhow::Result<Vec<SequenceId>> {
    sequences_of(&arguments.worlds, arguments, dataset)
}

/// The sequences of some worlds in the variations that were chosen.
pub(super) fn sequences_of(
    worlds: &[String],
    arguments: &Arguments,
    dataset: &Dataset,
) -> anyhow::Result<Vec<SequenceId>> {
    let mut variations = arguments.variations.clone();
    let has_default = dataset.sequences().iter().any(|id| id.variation == DEFAULT_VARIATION);
    if variations.is_empty() && has_default {
        variations.push(DEFAULT_VARIATION.to_owned());
    }
    Ok(dataset.select(worlds, &variations)?)
}

/// Every `stride`-th frame that has a part mask, and how many places were wrong; each is reported.
pub(super) fn read(
    dataset: &Dataset,
    sequences: &[SequenceId],
    stride: u32,
) -> anyhow::Result<(Vec<Frame>, usize)> {
    let mut frames = Vec::new();
    let mut skipped = 0;
    for sequence in sequences {
        let read = dataset.read(sequence)?;
        for problem in &read.problems {
            warn(format_args!("{problem}"));
            // A size that had to be guessed costs nothing here: masks have their own.
            skipped += usize::from(!matches!(problem.fault, Fault::SizeUnknown { .. }));
        }
        skipped += read.problems_omitted;
        frames.extend(read.frames.into_iter().filter(|frame| frame.index % stride == 0));
    }
    let shows = |frame: &&Frame| frame.vehicles.iter().any(|vehicle| !vehicle.dont_care);
    let missing: Vec<String> = frames
        .iter()
        .filter(|frame| frame.parts.is_none())
        .filter(shows)
        .map(Frame::name)
        .collect();
    frames.retain(|frame| frame.parts.is_some());
    if frames.is_empty() {
        return Err(hint(
            anyhow::anyhow!("`{}` has no part masks for what was chosen", dataset.root().display()),
            "the oracle reads `parts/<world>/<variation>/%05d.png`; `partpose dataset check DIR` tells what is there",
        ));
    }
    if let Some(first) = missing.first() {
        warn(format_args!(
            "skipped {} frames without a part mask, the first is {first}",
            missing.len()
        ));
        skipped += missing.len();
    }
    Ok((frames, skipped))
}

/// How many vehicles that are not to be ignored show a model that the zoo lacks.
pub(super) fn without_model(frames: &[Frame], zoo: &ModelZoo) -> usize {
    let vehicles = frames.iter().flat_map(|frame| &frame.vehicles).filter(|v| !v.dont_care);
    let known = |name: &str| zoo.get(name).is_some();
    vehicles.filter(|vehicle| !vehicle.model.as_deref().is_some_and(known)).count()
}

/// The folds to score, one zoo each.
pub(super) fn folds(arguments: &Arguments) -> anyhow::Result<Vec<Option<Fold>>> {
    let Some(text) = &arguments.fold else {
        if arguments.zoo.contains("{fold}") {
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
    if !arguments.zoo.contains("{fold}") {
        return Err(hint(
            anyhow::anyhow!(
                "all folds would be judged by one zoo, which was made from their own pictures"
            ),
            "carve a zoo for each fold (`zoo carve --fold I/K`) and write `{fold}` for its number, as in `--zoo zoo-{fold}`",
        ));
    }
    Ok((1..=last.count).map(|index| Some(Fold { index, count: last.count })).collect())
}

/// The zoo of a fold.
pub(super) fn zoo_path(arguments: &Arguments, fold: Option<Fold>) -> PathBuf {
    let number = fold.map_or(String::new(), |fold| fold.index.to_string());
    PathBuf::from(arguments.zoo.replace("{fold}", &number))
}
