//! Poses of what a detector found, in place of the oracle.

use anyhow::Context;
use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::eval::{
    Configuration, EvaluationOptions, Progress, VehicleOutcome, evaluate_detections,
};

use crate::commands::evaluate::source::{Source, SourceFlags};
use crate::report::hint;

/// Frames that are detected before their poses are found.
const CHUNK: usize = 32;

/// The one source that is asked for.
pub(super) fn open(flags: &SourceFlags) -> anyhow::Result<Source> {
    if flags.detections.len() + flags.weights.len() > 1 {
        return Err(hint(
            anyhow::anyhow!("poses are scored of one source of detections at a time"),
            "give one `--detections` or one `--weights`",
        ));
    }
    let mut sources = flags.open()?;
    sources.pop().context("there is no source of detections")
}

/// What became of the vehicles that were found in each frame; an error where a frame has no detections.
pub(super) fn outcomes(
    frames: &[Frame],
    (source, min_score): (&Source, f64),
    options: &EvaluationOptions,
    configurations: &[Configuration],
    progress: Progress,
) -> Vec<anyhow::Result<Vec<Vec<VehicleOutcome>>>> {
    let mut outcomes = Vec::with_capacity(frames.len());
    for frames in frames.chunks(CHUNK) {
        let found: Vec<anyhow::Result<Vec<Detection>>> = source
            .detect(frames, &[])
            .into_iter()
            .map(|found| found?.with_context(|| format!("`{}` does not name it", source.name)))
            .collect();
        let detections = |index: usize| match &found[index] {
            Ok(detections) => detections.clone(),
            Err(_) => Vec::new(),
        };
        let scored =
            evaluate_detections(frames, &detections, min_score, options, configurations, progress);
        outcomes.extend(found.into_iter().zip(scored).map(|(found, outcome)| {
            found?;
            outcome.map_err(anyhow::Error::from)
        }));
    }
    outcomes
}
