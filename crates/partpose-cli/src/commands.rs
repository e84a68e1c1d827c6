//! One file a verb.

pub(crate) mod completions;
pub(crate) mod dataset;
pub(crate) mod demo;
pub(crate) mod detection_files;
pub(crate) mod evaluate;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod fit;
pub(crate) mod fitting;
pub(crate) mod label;
mod mask_bias;
pub(crate) mod provenance;
pub(crate) mod report;
pub(crate) mod result_files;
pub(crate) mod run;
#[cfg(feature = "serve")]
pub(crate) mod serve;
pub(crate) mod synth;
pub(crate) mod tracking;
pub(crate) mod train;
pub(crate) mod view;
pub(crate) mod weights;
pub(crate) mod zoo;
