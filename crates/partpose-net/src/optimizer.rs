//! From gradients to weights: momentum or Adam, on the host, so that a training can be saved and gone on with to the bit.
//!
//! Momentum as in `PyTorch`: `v = m v + g`, `w -= rate v`, weight decay added to the gradient. `AdamW`: Loshchilov and Hutter,
//! *Decoupled Weight Decay Regularization*, ICLR 2019.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::weights::Values;

/// How weights follow gradients.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OptimizerConfig {
    /// Which rule.
    pub kind: Rule,
    /// The highest learning rate.
    pub rate: f64,
    /// Weight decay of convolutions and full connections; biases and normalisation have none.
    pub weight_decay: f64,
    /// Gradients whose norm over all weights is larger are shortened to it.
    pub clip_norm: f64,
    /// Share that the average of the weights keeps at each step; 0 for no average.
    pub average: f64,
    /// Beginnings of names of weights that stay as they are (`backbone.layer1`).
    pub frozen: Vec<String>,
}

/// A rule by which weights follow gradients.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Rule {
    /// Gradient descent with this momentum.
    Sgd {
        /// Share of the last step that is kept.
        momentum: f64,
    },
    /// Adam with decoupled weight decay; moments fade by 0.9 and 0.999.
    AdamW,
}

impl Default for OptimizerConfig {
    fn default() -> Self {
        Self {
            kind: Rule::AdamW,
            rate: 5e-4,
            weight_decay: 0.02,
            clip_norm: 10.0,
            average: 0.998,
            frozen: Vec::new(),
        }
    }
}

impl OptimizerConfig {
    /// The paper's, as far as it says.
    pub fn paper() -> Self {
        Self {
            kind: Rule::Sgd { momentum: 0.9 },
            rate: 3e-4,
            weight_decay: 0.0,
            average: 0.0,
            ..Self::default()
        }
    }
}

const FADES: [f64; 2] = [0.9, 0.999];

/// What is remembered of past gradients.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moments {
    /// Momentum, or Adam's mean, of each tensor.
    pub first: Vec<Vec<f32>>,
    /// Adam's mean square of each tensor; empty for momentum.
    pub second: Vec<Vec<f32>>,
}

impl Moments {
    /// None yet.
    pub fn new(weights: &[Values], rule: Rule) -> Self {
        let zeros = || weights.iter().map(|tensor| vec![0.0; tensor.values.len()]).collect();
        let second = if rule == Rule::AdamW { zeros() } else { Vec::new() };
        Self { first: zeros(), second }
    }
}

/// The norm of all gradients together.
pub fn norm(gradients: &[Option<Vec<f32>>]) -> f64 {
    let square = |values: &Vec<f32>| {
        // In pieces of fixed size, so that the sum does not depend on the number of threads.
        let of_piece = |piece: &[f32]| piece.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
        let pieces: Vec<f64> = values.par_chunks(1 << 16).map(of_piece).collect();
        pieces.into_iter().sum::<f64>()
    };
    gradients.iter().flatten().map(square).sum::<f64>().sqrt()
}

/// One step: `rate` is the learning rate now, `step` counts from 0. Tensors without a gradient stay as they are.
pub fn update(
    weights: &mut [Values],
    moments: &mut Moments,
    gradients: &[Option<Vec<f32>>],
    config: &OptimizerConfig,
    (rate, step): (f64, u64),
) {
    let total = norm(gradients);
    let shorten = if total > config.clip_norm { config.clip_norm / total } else { 1.0 };
    for (i, (tensor, gradient)) in weights.iter_mut().zip(gradients).enumerate() {
        let Some(gradient) = gradient else { continue };
        let decay = if tensor.shape.len() > 1 { config.weight_decay } else { 0.0 };
        let values = tensor.values.par_chunks_mut(1 << 16).zip(gradient.par_chunks(1 << 16));
        let first = moments.first[i].par_chunks_mut(1 << 16);
        match config.kind {
            Rule::Sgd { momentum } => {
                let [shorten, decay, momentum, rate] =
                    [shorten, decay, momentum, rate].map(|value| value as f32);
                values.zip(first).for_each(|((values, gradient), first)| {
                    for ((value, gradient), first) in values.iter_mut().zip(gradient).zip(first) {
                        *first = momentum * *first + shorten * gradient + decay * *value;
                        *value -= rate * *first;
                    }
                });
            }
            Rule::AdamW => {
                let exponent = step.min(1 << 30) as i32 + 1;
                let [unbias, unbias_square] = FADES.map(|fade| 1.0 / (1.0 - fade.powi(exponent)));
                let unbias_square = unbias_square as f32;
                let [keep, keep_square] = FADES.map(|fade| fade as f32);
                let [shorten, shrink, rate] =
                    [shorten, 1.0 - rate * decay, rate * unbias].map(|value| value as f32);
                let second = moments.second[i].par_chunks_mut(1 << 16);
                values.zip(first.zip(second)).for_each(|((values, gradient), (first, second))| {
                    let moments = first.iter_mut().zip(second);
                    for ((value, gradient), (first, second)) in
                        values.iter_mut().zip(gradient).zip(moments)
                    {
                        let gradient = shorten * gradient;
                        *first = keep * *first + (1.0 - keep) * gradient;
                        *second = keep_square * *second + (1.0 - keep_square) * gradient * gradient;
                        let size = (*second * unbias_square).sqrt() + 1e-8;
                        *value = shrink * *value - rate * *first / size;
                    }
                });
            }
        }
    }
}

/// Moves an average of weights towards the newest.
///
/// Early on, when there is little to average, it follows faster (as in TensorFlow: `(1 + n) / (10 + n)`).
pub fn average(average: &mut [Values], newest: &[Values], keep: f64, step: u64) {
    let keep = keep.min((1.0 + step as f64) / (10.0 + step as f64)) as f32;
    average.par_iter_mut().zip(newest).for_each(|(average, newest)| {
        for (average, newest) in average.values.iter_mut().zip(&newest.values) {
            *average = keep * *average + (1.0 - keep) * newest;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn descend(config: &OptimizerConfig, steps: u64) -> Vec<f32> {
        let mut weights =
            vec![Values { name: "w".to_owned(), shape: vec![2], values: vec![3.0, -2.0] }];
        let mut moments = Moments::new(&weights, config.kind);
        for step in 0..steps {
            // The gradient of (w0 - 1)^2 + 10 (w1 - 2)^2.
            let w = &weights[0].values;
            let gradient = vec![2.0 * (w[0] - 1.0), 20.0 * (w[1] - 2.0)];
            update(&mut weights, &mut moments, &[Some(gradient)], config, (config.rate, step));
        }
        weights.remove(0).values
    }

    #[test]
    fn both_rules_descend() {
        let sgd = OptimizerConfig { rate: 0.02, ..OptimizerConfig::paper() };
        let adam = OptimizerConfig { rate: 0.05, ..OptimizerConfig::default() };
        for config in [sgd, adam] {
            let found = descend(&config, 400);
            assert!((found[0] - 1.0).abs() < 0.05 && (found[1] - 2.0).abs() < 0.05, "{found:?}");
        }
    }

    #[test]
    fn long_gradients_are_shortened() {
        let config = OptimizerConfig {
            kind: Rule::Sgd { momentum: 0.0 },
            rate: 1.0,
            clip_norm: 0.5,
            ..OptimizerConfig::paper()
        };
        // Of length 100 * sqrt(...): the step is of length 0.5.
        let found = descend(&config, 1);
        let step = ((found[0] - 3.0).powi(2) + (found[1] + 2.0).powi(2)).sqrt();
        assert!((step - 0.5).abs() < 1e-5, "{step}");
    }
}
