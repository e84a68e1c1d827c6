//! Detectors in ONNX files: an image to boxes, scores and part probabilities.
//!
//! The model may be anybody's; a [`Mapping`] says what it takes and which of its outputs mean what. `ONNX Runtime` runs
//! it. Its library is not part of the program: it is looked for when the first model is opened ([`library`]).

pub mod library;
pub mod mapping;

mod detector;
mod image;
mod parts;
mod tensor;

use std::path::PathBuf;

use partpose::parts::ProbabilityError;

pub use detector::OnnxDetector;
pub use mapping::Mapping;

/// Why a model cannot be used, or an image not be looked at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OnnxError {
    /// No library was found in any of the places where it may be.
    #[error("ONNX Runtime's library was not found; looked for {}", places(tried))]
    NoLibrary {
        /// Where it was looked for.
        tried: Vec<PathBuf>,
    },
    /// The library is there but cannot be used.
    #[error("cannot use the library `{path}`")]
    Library {
        /// The library.
        path: PathBuf,
        /// Why.
        source: ort::LoadDynamicError,
    },
    /// The runtime refuses something.
    #[error("ONNX Runtime refuses {what}")]
    Runtime {
        /// What was asked of it.
        what: String,
        /// What it says.
        source: ort::Error,
    },
    /// The model has no input or output of a name that the mapping says.
    #[error("the model has no {kind} `{name}`; it has {known}")]
    Name {
        /// `input` or `output`.
        kind: &'static str,
        /// The name.
        name: String,
        /// Those that it has.
        known: String,
    },
    /// A mapping contradicts itself.
    #[error("the mapping is impossible: {fault}")]
    Mapping {
        /// What is wrong with it.
        fault: String,
    },
    /// An output has a shape or type that it cannot have by the mapping.
    #[error("output `{name}` is {found}, but {expected} is needed")]
    Shape {
        /// The output.
        name: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// An output is no probability.
    #[error("output `{name}` of vehicle {vehicle} is no probability")]
    Probability {
        /// The output.
        name: String,
        /// Which vehicle, from 0.
        vehicle: usize,
        /// What is wrong.
        source: ProbabilityError,
    },
    /// The image is larger than the model can be given.
    #[error("an input of {width} x {height} pixels is more than {limit} pixels")]
    TooLarge {
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
        /// The limit.
        limit: usize,
    },
}

fn places(tried: &[PathBuf]) -> String {
    let names: Vec<String> = tried.iter().map(|path| format!("`{}`", path.display())).collect();
    names.join(", ")
}
