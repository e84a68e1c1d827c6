//! The 29 part classes and what is indexed by them.

mod class;
mod map;
mod mask;
mod probabilities;
pub mod rle;

pub use class::{CoarseClass, FineClass, PartClass, PartGroup};
pub use map::PartMap;
pub use mask::PartMask;
pub use probabilities::{PartProbabilities, ProbabilityError, Scaling, upscale_labels};

/// Outputs of a part classifier: background, then the 29 parts.
pub const CHANNELS: usize = PartClass::COUNT + 1;

/// The label of pixels that show no part.
pub const BACKGROUND: u8 = 0;
