//! A detection: what the first stage says of one vehicle, from a network, a file or the oracle.

use std::sync::Arc;

use crate::geometry::{Extent, Rect};
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
    /// What is known of its size.
    pub size: Option<DetectedSize>,
    /// Which model it looks like.
    pub models: Option<ModelProbabilities>,
}

/// A size as a detector says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectedSize {
    /// The likeliest size, metres.
    pub extent: Extent,
    /// Standard deviations of the logarithms of width, height and length; zeros where the size is known.
    pub sigma: [f64; 3],
}

impl DetectedSize {
    /// A size that is known.
    pub fn exact(extent: Extent) -> Self {
        Self { extent, sigma: [0.0; 3] }
    }

    /// Whether nothing of it is left to find out.
    pub fn is_exact(&self) -> bool {
        self.sigma.iter().all(|sigma| *sigma <= 0.0)
    }
}

/// How probable some models are by the looks of a vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelProbabilities {
    /// Names of the models, shared by the detections of a network.
    pub names: Arc<[String]>,
    /// `[models]`: one a name; they sum to 1.
    pub values: Vec<f32>,
}

impl ModelProbabilities {
    /// The probability of a model; `None` for one that is not in the list.
    pub fn of(&self, name: &str) -> Option<f64> {
        let index = self.names.iter().position(|known| known == name)?;
        self.values.get(index).copied().map(f64::from)
    }
}

impl Detection {
    /// A detection of which no more is known.
    pub fn new(bounds: Rect, score: f64, probabilities: PartProbabilities) -> Self {
        Self { bounds, score, probabilities, unknown: None, size: None, models: None }
    }

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
