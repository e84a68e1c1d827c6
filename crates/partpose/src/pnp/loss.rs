//! Robust losses: how much a squared residual counts.

use serde::{Deserialize, Serialize};

/// A loss `rho(s)` on the squared, whitened residual `s` of a point; scales are in standard deviations.
///
/// Set the scale from the noise: a Cauchy loss at one standard deviation costs 6 to 15 % of the accuracy on clean data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Loss {
    /// `s`: least squares.
    #[default]
    None,
    /// `s` up to `scale^2`, then `2 scale sqrt(s) - scale^2`.
    Huber {
        /// Where the loss turns from quadratic to linear, standard deviations.
        scale: f64,
    },
    /// `scale^2 ln(1 + s / scale^2)`.
    Cauchy {
        /// Half-weight point, standard deviations.
        scale: f64,
    },
    /// `s / (1 + s / scale^2)`, which never exceeds `scale^2`.
    GemanMcClure {
        /// Quarter-weight point, standard deviations.
        scale: f64,
    },
}

impl Loss {
    /// `rho(s)` and its derivative, the weight.
    pub fn evaluate(self, s: f64) -> (f64, f64) {
        match self {
            Self::None => (s, 1.0),
            Self::Huber { scale } if s <= scale * scale => (s, 1.0),
            Self::Huber { scale } => {
                let root = s.sqrt();
                (scale * (2.0 * root - scale), scale / root)
            }
            Self::Cauchy { scale } => {
                let k2 = scale * scale;
                (k2 * (s / k2).ln_1p(), 1.0 / (1.0 + s / k2))
            }
            Self::GemanMcClure { scale } => {
                let shrink = 1.0 / (1.0 + s / (scale * scale));
                (s * shrink, shrink * shrink)
            }
        }
    }

    /// Whether the scale is a positive number.
    pub(super) fn is_valid(self) -> bool {
        match self {
            Self::None => true,
            Self::Huber { scale } | Self::Cauchy { scale } | Self::GemanMcClure { scale } => {
                scale > 0.0 && scale.is_finite()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weight_is_the_derivative_of_the_loss() {
        let losses = [
            Loss::None,
            Loss::Huber { scale: 1.5 },
            Loss::Cauchy { scale: 1.5 },
            Loss::GemanMcClure { scale: 1.5 },
        ];
        for loss in losses {
            for s in [0.1, 1.0, 3.0, 20.0] {
                let step = 1e-5;
                let slope = (loss.evaluate(s + step).0 - loss.evaluate(s - step).0) / (2.0 * step);
                assert!((slope - loss.evaluate(s).1).abs() < 1e-8, "{loss:?} at {s}");
            }
        }
    }
}
