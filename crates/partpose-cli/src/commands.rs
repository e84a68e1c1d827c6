//! One file a verb.

pub(crate) mod dataset;
pub(crate) mod demo;
pub(crate) mod evaluate;
pub(crate) mod explain;
pub(crate) mod export;
pub(crate) mod fit;
pub(crate) mod label;
mod mask_bias;
pub(crate) mod provenance;
pub(crate) mod result_files;
pub(crate) mod synth;
pub(crate) mod zoo;
