//! Which frames of a data set are evaluated.

use std::path::PathBuf;

use partpose::dataset::{Dataset, Fault, Frame, SequenceId};

use crate::report::{hint, warn};

/// The variation that is meant where the oracle makes the detections: to it all weathers look the same.
const CLEAR: &str = "clone";

#[derive(clap::Args, Clone)]
pub(super) struct Selection {
    /// Folder of the data set; its layout is recognised
    #[arg(long, value_name = "DIR")]
    pub(super) dataset: PathBuf,
    /// Worlds, separated by commas; all if not given
    #[arg(long, value_delimiter = ',')]
    pub(super) worlds: Vec<String>,
    /// Variations, separated by commas. If not given: for the oracle `clone`, or all where there is none of that name;
    /// for detections all
    #[arg(long, value_delimiter = ',')]
    pub(super) variations: Vec<String>,
    /// Every N-th frame only
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) stride: u32,
}

/// What a frame must have to be evaluated.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Needs {
    /// Labels, which every frame has.
    Labels,
    /// A part mask, too.
    PartMask,
}

impl Selection {
    /// The sequences that are chosen; `clear` asks for one variation where none is named.
    pub(super) fn sequences(
        &self,
        dataset: &Dataset,
        clear: bool,
    ) -> anyhow::Result<Vec<SequenceId>> {
        self.sequences_of(&self.worlds, dataset, clear)
    }

    /// The sequences of some worlds in the variations that are chosen.
    pub(super) fn sequences_of(
        &self,
        worlds: &[String],
        dataset: &Dataset,
        clear: bool,
    ) -> anyhow::Result<Vec<SequenceId>> {
        let mut variations = self.variations.clone();
        let has_clear = dataset.sequences().iter().any(|id| id.variation == CLEAR);
        if clear && variations.is_empty() && has_clear {
            variations.push(CLEAR.to_owned());
        }
        Ok(dataset.select(worlds, &variations)?)
    }
}

/// Every `stride`-th frame that has what is needed, and how many places were wrong; each is reported.
pub(super) fn read(
    dataset: &Dataset,
    sequences: &[SequenceId],
    stride: u32,
    needs: Needs,
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
    if needs == Needs::PartMask {
        skipped += drop_without_mask(dataset, &mut frames)?;
    }
    let counts = |frame: &Frame| frame.vehicles.iter().any(|vehicle| !vehicle.dont_care);
    if !frames.iter().any(counts) {
        return Err(hint(
            anyhow::anyhow!("`{}` labels no vehicle in what was chosen", dataset.root().display()),
            "`partpose dataset check DIR` tells what is there",
        ));
    }
    Ok((frames, skipped))
}

fn drop_without_mask(dataset: &Dataset, frames: &mut Vec<Frame>) -> anyhow::Result<usize> {
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
            "they are read from `parts/<world>/<variation>/%05d.png`; `partpose dataset check DIR` tells what is there",
        ));
    }
    if let Some(first) = missing.first() {
        warn(format_args!(
            "skipped {} frames without a part mask, the first is {first}",
            missing.len()
        ));
    }
    Ok(missing.len())
}
