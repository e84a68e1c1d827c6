//! Which model a vehicle is, when poses come from the centres of parts.
//!
//! The paper takes the model with the lowest reprojection error. At the true size models differ little in the centres of
//! their parts, so the error alone confuses them. [`Ranking::Evidence`] adds what else is known, as logarithms of
//! likelihoods: a detector's probabilities of models, and how far a size that is given lies from the model's own, against
//! the spread of [`SizePrior::around`].

use serde::{Deserialize, Serialize};

use crate::detection::Detection;
use crate::geometry::Extent;

use super::ExtentSource;
use super::dense::SizePrior;

/// What models are compared by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ranking {
    /// The reprojection error alone: the paper's.
    #[default]
    Error,
    /// The error, the detector's probabilities of models, and the size where it is given.
    Evidence,
}

/// What the logarithm of the error counts against the others. Residuals of independent points with an unknown spread
/// would count once each coordinate, some 16 times; those of a model's centres err together. From 1 to 3 the choice is
/// about the same.
const ERROR_WEIGHT: f64 = 2.0;
/// What the logarithms of the detector's probabilities count where a size is given. They are honest by themselves, but
/// speak of the size, too, which is then weighed on its own: counted in full they outvote it, and of vehicles of
/// synthetic worlds 5 to 9 in a hundred fewer are named rightly (`docs/network.md`); from 0.2 to 0.5 the choice is about
/// the same. Without a size they count in full.
const LOOKS_BESIDE_SIZE: f64 = 0.35;
/// Errors below this are as good as it, pixels: with few points some model fits by chance.
const LEAST_ERROR: f64 = 0.3;
/// Probability below which a detector does not rule a model out further.
const LEAST_PROBABILITY: f64 = 1e-3;

impl Ranking {
    /// What speaks against a model: the lowest wins. `error` in pixels.
    pub(super) fn against(
        self,
        error: f64,
        (name, own): (&str, &Extent),
        detection: &Detection,
        extent: &ExtentSource,
    ) -> f64 {
        if self == Self::Error || !error.is_finite() {
            return error;
        }
        let looks = detection.models.as_ref().map_or(0.0, |models| {
            // Of a model that is not in the list nothing is known.
            let unknown = 1.0 / models.names.len().max(1) as f64;
            -models.of(name).unwrap_or(unknown).clamp(LEAST_PROBABILITY, 1.0).ln()
        });
        let (looks, size) = match extent {
            ExtentSource::Given(given) => (LOOKS_BESIDE_SIZE * looks, strain(given, own)),
            _ => (looks, 0.0),
        };
        ERROR_WEIGHT * error.max(LEAST_ERROR).ln() + looks + size
    }
}

/// Half the squared distance of a size from a model's own, in standard deviations.
fn strain(given: &Extent, own: &Extent) -> f64 {
    let away = given.ratio(own).map(f64::ln);
    let solved = SizePrior::around(None).covariance.cholesky().map(|c| c.solve(&away));
    let strain = solved.map_or(0.0, |solved| 0.5 * away.dot(&solved));
    if strain.is_finite() { strain } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detection::ModelProbabilities;
    use crate::geometry::Rect;
    use crate::parts::{CHANNELS, PartProbabilities};

    #[test]
    fn looks_and_size_decide_between_models_that_fit_alike() {
        let mut kernel = vec![0.0; CHANNELS];
        kernel[0] = 1.0;
        let kernel = PartProbabilities::new(1, kernel).unwrap();
        let mut detection = Detection::new(Rect::new(0.0, 0.0, 9.0, 9.0), 1.0, kernel);
        let (small, large) = (Extent::new(1.6, 1.5, 3.6), Extent::new(1.9, 1.5, 4.9));
        let best = |ranking: Ranking, detection: &Detection, extent: &ExtentSource| {
            let of = |error, name, own| ranking.against(error, (name, own), detection, extent);
            if of(2.0, "small", &small) < of(1.9, "large", &large) { "small" } else { "large" }
        };
        assert_eq!(best(Ranking::Error, &detection, &ExtentSource::Model), "large");
        assert_eq!(best(Ranking::Evidence, &detection, &ExtentSource::Model), "large");
        assert_eq!(best(Ranking::Evidence, &detection, &ExtentSource::Given(small)), "small");
        let names = ["small".to_owned(), "large".to_owned()].into();
        detection.models = Some(ModelProbabilities { names, values: vec![0.7, 0.3] });
        assert_eq!(best(Ranking::Evidence, &detection, &ExtentSource::Model), "small");
        assert_eq!(best(Ranking::Error, &detection, &ExtentSource::Given(small)), "large");
        // In full the looks would outvote a size that is nearer to the other's.
        let nearer_to_large = ExtentSource::Given(Extent::new(1.74, 1.5, 4.26));
        assert_eq!(best(Ranking::Evidence, &detection, &nearer_to_large), "large");
    }
}
