//! What a network's heads for size and model would say, with errors of a chosen amount.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::detection::{DetectedSize, ModelProbabilities};
use crate::geometry::Extent;

use super::degrade::{mix, normal};

/// How much the heads err; a head without an error is silent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeadErrors {
    /// Standard deviation of the logarithms of width, height and length, which err independently; it is what the
    /// detection then says of itself.
    pub size: Option<f64>,
    /// How often the likeliest model is the true one. It gets that probability, the others share the rest evenly.
    pub model: Option<f64>,
    /// Changes which vehicles are misjudged.
    pub seed: u64,
}

impl HeadErrors {
    /// The size that is seen of a vehicle; `of_vehicle` tells vehicles apart.
    pub(super) fn size(&self, truth: &Extent, of_vehicle: u64) -> Option<DetectedSize> {
        let sigma = self.size?;
        let mut rng = ChaCha8Rng::seed_from_u64(mix(self.seed, of_vehicle) ^ 1);
        let mut side = |truth: f64| truth * (sigma * normal(&mut rng)).exp();
        let extent = Extent::new(side(truth.width), side(truth.height), side(truth.length));
        Some(DetectedSize { extent, sigma: [sigma; 3] })
    }

    /// The model that is seen of a vehicle, whose true one has the place `truth` among `names`.
    pub(super) fn models(
        &self,
        truth: usize,
        names: &Arc<[String]>,
        of_vehicle: u64,
    ) -> Option<ModelProbabilities> {
        let accuracy = self.model?.clamp(0.0, 1.0);
        let mut rng = ChaCha8Rng::seed_from_u64(mix(self.seed, of_vehicle) ^ 2);
        let others = names.len().saturating_sub(1);
        let wrong = rng.random::<f64>() >= accuracy && others > 0;
        let step = if wrong { rng.random_range(1..=others) } else { 0 };
        let mut values = vec![((1.0 - accuracy) / others.max(1) as f64) as f32; names.len()];
        values[(truth + step) % names.len()] = if others > 0 { accuracy as f32 } else { 1.0 };
        Some(ModelProbabilities { names: Arc::clone(names), values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heads_are_as_good_as_they_say() {
        let heads = HeadErrors { size: Some(0.08), model: Some(0.7), seed: 3 };
        let truth = Extent::new(1.8, 1.5, 4.4);
        let names: Arc<[String]> = ["a", "b", "c"].map(str::to_owned).into();
        let count = 4000;
        let (mut squares, mut right) = (0.0, 0);
        for vehicle in 0..count {
            let seen = heads.size(&truth, vehicle).unwrap();
            squares += seen.extent.ratio(&truth).map(|r| r.ln().powi(2)).sum() / 3.0;
            let models = heads.models(1, &names, vehicle).unwrap();
            right += usize::from(models.of("b").unwrap() > 0.5);
            assert!((models.values.iter().sum::<f32>() - 1.0).abs() < 1e-5);
        }
        assert!(((squares / count as f64).sqrt() - 0.08).abs() < 0.003);
        assert!((right as f64 / count as f64 - 0.7).abs() < 0.03);
        assert!(HeadErrors::default().size(&truth, 0).is_none());
    }
}
