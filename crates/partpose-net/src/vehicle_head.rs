//! The head that says which model of the zoo a vehicle is, and how large: what the paper names as future work.
//!
//! It reads what the part head's convolutions make of a region, which knows where the parts are, and only of vehicles that
//! are kept. Regions are squeezed into squares, so it is told the boxes' proportions too. Sizes come with their likely errors, so that a fit knows how much to believe: the deviation learns by the
//! likelihood of what the estimate misses (Nix and Weigend: *Estimating the mean and variance of the target probability
//! distribution*, ICNN 1994), the estimate itself by a robust loss, which deviations do not weight.

use burn::Tensor;
use burn::module::Module;
use burn::tensor::TensorData;

use crate::boxes::Corners;
use crate::config::NetConfig;
use crate::layers::{Conv, ConvSizes, Init, Linear, to_host};
use crate::loss::{cross_entropy, smooth_l1, soft_max};
use crate::mask_rcnn::{LikelyExtents, RawDetection};
use crate::ops::attach;
use crate::second_stage::Sample;
use crate::target::Target;

/// Width, height and length that estimates are relative to, metres: about a family car's.
pub const TYPICAL_EXTENTS: [f32; 3] = [1.8, 1.5, 4.3];
/// Deviation of a logarithm that deviations are relative to.
pub const TYPICAL_DEVIATION: f32 = 0.08;
/// Factor between an error of a logarithm and its loss: ten per cent cost about as much as a wrong class of a tenth.
const EXTENT_SCALE: f32 = 10.0;
/// Largest logarithm of what an extent, and its deviation, is of the typical one.
pub(crate) const MOST: f32 = 2.0;

/// A convolution, a hidden layer, and the outputs that are asked for.
#[derive(Module, Debug)]
pub struct VehicleHead {
    /// 3x3, stride 2.
    pub conv: Conv,
    /// The hidden layer; its last input is the logarithm of the box's width over its height.
    pub fc: Linear,
    /// Logits of the zoo models.
    pub model: Option<Linear>,
    /// Logarithms of width, height and length relative to [`TYPICAL_EXTENTS`], and of their deviations relative to
    /// [`TYPICAL_DEVIATION`].
    pub extent: Option<Linear>,
}

impl VehicleHead {
    /// `channels` and `cells` are those of what the part head found.
    pub(crate) fn init(
        init: &mut Init<'_>,
        config: &NetConfig,
        [channels, cells]: [usize; 2],
    ) -> Self {
        let (inner, width) = (config.vehicle.channels, config.vehicle.width);
        let inputs = inner * cells.div_ceil(2).pow(2);
        let models = config.models.len();
        Self {
            conv: init.conv(ConvSizes { stride: 2, ..ConvSizes::new([channels, inner], 3, true) }),
            fc: init.linear(inputs + 1, width, (2.0 / inputs as f32).sqrt()),
            model: (models > 0).then(|| init.linear(width, models, 0.01)),
            extent: config.extents.then(|| init.linear(width, 6, 0.001)),
        }
    }

    /// `hidden`: `[regions, channels, cells, cells]` of the part head, with the regions' boxes; to `[regions, models]` and `[regions, 6]`.
    fn forward(&self, hidden: Tensor<4>, boxes: &[Corners]) -> [Option<Tensor<2>>; 2] {
        let proportion =
            |[x0, y0, x1, y1]: &Corners| ((x1 - x0).max(1.0) / (y1 - y0).max(1.0)).ln();
        let values: Vec<f32> = boxes.iter().map(proportion).collect();
        let data = TensorData::new(values, [boxes.len(), 1]);
        let proportions = Tensor::from_data(data, &hidden.device());
        let seen = self.conv.forward(hidden, None, true).flatten(1, 3);
        let x = self.fc.forward(Tensor::cat(vec![seen, proportions], 1), true);
        [&self.model, &self.extent].map(|layer| Some(layer.as_ref()?.forward(x.clone(), false)))
    }

    /// Losses of model and extents, where they are asked for.
    pub(crate) fn losses(
        &self,
        hidden: Tensor<4>,
        samples: &[Sample],
        targets: &[Target],
    ) -> [Option<Tensor<1>>; 2] {
        let boxes: Vec<Corners> = samples.iter().map(|sample| sample.corners).collect();
        let [models, extents] = self.forward(hidden, &boxes);
        [
            models.map(|logits| model_loss(&logits, samples, targets)),
            extents.map(|values| extent_loss(&values, samples, targets)),
        ]
    }

    /// Adds to detections, one a region, what it says of them.
    pub(crate) fn describe(&self, hidden: Tensor<4>, found: &mut [RawDetection]) {
        let boxes: Vec<Corners> = found.iter().map(|found| found.corners).collect();
        let [models, extents] = self.forward(hidden, &boxes);
        if let Some(logits) = models {
            let [_, count] = logits.dims();
            for (found, logits) in found.iter_mut().zip(to_host(logits).chunks_mut(count)) {
                soft_max(logits);
                found.models = Some(logits.to_vec());
            }
        }
        let values = extents.map(to_host).unwrap_or_default();
        for (found, values) in found.iter_mut().zip(values.as_chunks::<6>().0) {
            let factor = values.map(|value| value.clamp(-MOST, MOST).exp());
            let sides = [0, 1, 2].map(|k| factor[k] * TYPICAL_EXTENTS[k]);
            let deviations = [3, 4, 5].map(|k| factor[k] * TYPICAL_DEVIATION);
            found.extents = Some(LikelyExtents { sides, deviations });
        }
    }
}

/// Mean over the vehicles whose model is known.
fn model_loss(logits: &Tensor<2>, samples: &[Sample], targets: &[Target]) -> Tensor<1> {
    let [_, models] = logits.dims();
    let truth_of = |sample: &Sample| -> Option<usize> {
        let model = *targets[sample.image].models.get(sample.vehicle?)?;
        model.filter(|model| *model < models)
    };
    let known = samples.iter().filter_map(truth_of).count();
    let mut values = to_host(logits.clone());
    let mut loss = 0.0;
    for (sample, logits) in samples.iter().zip(values.chunks_mut(models)) {
        match truth_of(sample) {
            Some(truth) => loss += cross_entropy(logits, truth, 1.0 / known as f32),
            None => logits.fill(0.0),
        }
    }
    attach(loss, std::slice::from_ref(logits), vec![values])
}

/// Mean over the vehicles whose extents are known.
fn extent_loss(estimates: &Tensor<2>, samples: &[Sample], targets: &[Target]) -> Tensor<1> {
    let truth_of = |sample: &Sample| targets[sample.image].extents.get(sample.vehicle?).copied();
    let known = samples.iter().filter_map(truth_of).count().max(1) as f32;
    let mut values = to_host(estimates.clone());
    let mut total = 0.0;
    for (sample, values) in samples.iter().zip(values.as_chunks_mut::<6>().0) {
        let Some(truth) = truth_of(sample) else {
            values.fill(0.0);
            continue;
        };
        for k in 0..3 {
            let error = values[k] - (truth[k] / TYPICAL_EXTENTS[k]).ln();
            let (loss, slopes) = side_loss(error, values[k + 3]);
            total += loss / known;
            [values[k], values[k + 3]] = slopes.map(|slope| slope / known);
        }
    }
    attach(total, std::slice::from_ref(estimates), vec![values])
}

/// Loss of one side from the error of its logarithm and the logarithm of its deviation relative to the typical one; and
/// its slopes by the two, of which the first is that of the robust loss alone.
fn side_loss(error: f32, deviation: f32) -> (f32, [f32; 2]) {
    let (robust, slope) = smooth_l1(EXTENT_SCALE * error);
    let held = deviation.clamp(-MOST, MOST);
    let squared = (error / (TYPICAL_DEVIATION * held.exp())).powi(2);
    // Past its limits it only may come back.
    let pull = 1.0 - squared;
    let stuck = (deviation - held) * pull < 0.0;
    (robust + held + 0.5 * squared, [EXTENT_SCALE * slope, if stuck { 0.0 } else { pull }])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deviations_settle_at_the_errors_that_are_left() {
        let errors = [0.03, -0.05, 0.01, -0.02, 0.04f32];
        let mut deviation = 0.0;
        for _ in 0..2000 {
            let slope: f32 = errors.iter().map(|error| side_loss(*error, deviation).1[1]).sum();
            deviation -= 0.01 * slope / errors.len() as f32;
        }
        let expected = (errors.iter().map(|error| error * error).sum::<f32>() / 5.0).sqrt();
        let found = TYPICAL_DEVIATION * deviation.exp();
        assert!((found - expected).abs() < 1e-4, "{found} instead of {expected}");
    }

    #[test]
    fn slopes_are_those_of_the_losses() {
        let step = 1e-3;
        for (error, deviation) in [(0.02, -0.5), (0.3, 0.7), (-0.05, -1.5)] {
            let by_deviation = |d: f32| side_loss(error, d).0;
            let slope =
                (by_deviation(deviation + step) - by_deviation(deviation - step)) / (2.0 * step);
            let found = side_loss(error, deviation).1[1];
            assert!((slope - found).abs() < 1e-2 * found.abs().max(1.0), "{slope} {found}");
        }
        assert!(side_loss(0.0, -MOST - 1.0).1[1].abs() < f32::EPSILON);
        assert!(side_loss(1.0, -MOST - 1.0).1[1] < 0.0);
    }
}
