//! A detection: what the first stage says of one vehicle, from a network, a file or the oracle.

use crate::geometry::Rect;
use crate::parts::{PartMask, PartProbabilities, Scaling};

/// One detected vehicle as data; whoever can write it needs no interface of ours.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// The box that the probabilities cover.
    pub bounds: Rect,
    /// Confidence, 0 to 1.
    pub score: f64,
    /// `[30, m, m]`, background first; where `unknown` is above 0, of the known share of the cell.
    pub probabilities: PartProbabilities,
    /// `[m, m]`: the share of each cell that nothing is known of, since another vehicle hides it.
    pub unknown: Option<Vec<f32>>,
}

impl Detection {
    /// The part mask at image resolution; what is unknown is background there, as in the paper.
    pub fn part_mask(&self, image_size: [u32; 2], scaling: Scaling) -> PartMask {
        match &self.unknown {
            Some(unknown) => self.probabilities.with_unknown_as_background(unknown).upscale(
                &self.bounds,
                image_size,
                scaling,
            ),
            None => self.probabilities.upscale(&self.bounds, image_size, scaling),
        }
    }
}
