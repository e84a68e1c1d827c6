//! How far masks lie off the models' outlines, for the dense fit.

use partpose::dataset::folds::Fold;
use partpose::dataset::{Dataset, Frame};
use partpose::eval::measure_mask_bias;
use partpose::pose::dense::MaskBias;
use partpose::vehicle::ModelZoo;

use super::{Arguments, Needs, selection};
use crate::commands::mask_bias;
use crate::report::{hint, warn};

/// Every how many frames a mask is measured: neighbours say the same.
const STRIDE: u32 = 3;

/// Measures on the worlds asked for, and writes what `fit --mask-bias` reads.
pub(super) fn measure(
    arguments: &Arguments,
    dataset: &Dataset,
    zoo: &ModelZoo,
    fold: Option<Fold>,
    include: &(dyn Fn(&Frame, usize) -> bool + Sync),
) -> anyhow::Result<MaskBias> {
    let evaluated = arguments.selection.sequences(dataset, arguments.oracle)?;
    let sequences =
        arguments.selection.sequences_of(&arguments.mask_bias, dataset, arguments.oracle)?;
    if fold.is_none() && sequences.iter().any(|sequence| evaluated.contains(sequence)) {
        warn(
            "the mask bias is measured on frames that are evaluated, too: name other worlds, or a fold",
        );
    }
    let (frames, _) = selection::read(dataset, &sequences, STRIDE, Needs::PartMask)?;
    let bias = measure_mask_bias(&frames, zoo, include).ok_or_else(|| {
        hint(
            anyhow::anyhow!("too few vehicles to measure the mask bias on"),
            "at least 20 uncut vehicles between 8 and 60 m that no other hides are needed",
        )
    })?;
    let name = match fold {
        Some(fold) => format!("mask-bias-{}.json", fold.index),
        None => mask_bias::NAME.to_owned(),
    };
    mask_bias::write(&arguments.out.join(&name), &bias)?;
    Ok(bias)
}
