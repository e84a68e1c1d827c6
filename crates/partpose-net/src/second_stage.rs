//! What the second stage learns: regions and their losses.

use burn::Tensor;
use rand_chacha::ChaCha8Rng;

use crate::boxes::{Corners, encode};
use crate::config::{BoxConfig, NetConfig, OtherVehicles, PartConfig};
use crate::heads::{BoxOutput, CHANNELS};
use crate::layers::to_host;
use crate::loss::{cross_entropy, smooth_l1};
use crate::ops::attach;
use crate::sampling::{Match, MatchOptions, choose, match_boxes, sample};
use crate::target::{IGNORED_OWNER, Target};

/// A region that a training step learns from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    pub(crate) image: usize,
    pub(crate) corners: Corners,
    /// Index of the vehicle in the image's target; `None` for background.
    pub(crate) vehicle: Option<usize>,
}

/// Chooses regions from the proposals of each image and from the vehicles' own boxes.
pub(crate) fn choose_samples(
    proposals: Vec<Vec<Corners>>,
    targets: &[Target],
    config: &BoxConfig,
    rng: &mut ChaCha8Rng,
) -> Vec<Sample> {
    let iou = config.positive_iou;
    let options = MatchOptions { positive: iou, negative: iou, force_best: false };
    let mut samples = Vec::new();
    for (image, (mut boxes, target)) in proposals.into_iter().zip(targets).enumerate() {
        // At the start no proposal fits; the truth itself gives the heads something to learn from.
        boxes.extend(&target.boxes);
        let matches = match_boxes(&boxes, target, &options);
        for i in sample(&matches, config.samples, config.positive_share, rng) {
            let vehicle = match matches[i] {
                Match::Vehicle(vehicle) => Some(vehicle),
                _ => None,
            };
            samples.push(Sample { image, corners: boxes[i], vehicle });
        }
    }
    samples
}

/// Of the samples with a vehicle at most `count` an image.
pub(crate) fn choose_masks(samples: &[Sample], count: usize, rng: &mut ChaCha8Rng) -> Vec<Sample> {
    let images = samples.iter().map(|sample| sample.image + 1).max().unwrap_or(0);
    let mut chosen = Vec::new();
    for image in 0..images {
        let of_image = |i: &usize| samples[*i].image == image && samples[*i].vehicle.is_some();
        let positive: Vec<usize> = (0..samples.len()).filter(of_image).collect();
        chosen.extend(choose(&positive, count, rng).into_iter().map(|i| samples[i]));
    }
    chosen
}

/// Losses of class and box: mean over the samples, the box's where there is a vehicle.
pub(crate) fn box_losses(
    output: &BoxOutput,
    samples: &[Sample],
    targets: &[Target],
    config: &BoxConfig,
) -> [Tensor<1>; 2] {
    let share = 1.0 / samples.len().max(1) as f32;
    let mut of_classes = to_host(output.classes.clone());
    let mut of_deltas = to_host(output.deltas.clone());
    let [mut class, mut boxes] = [0.0; 2];
    for ((sample, logits), deltas) in
        samples.iter().zip(of_classes.chunks_mut(2)).zip(of_deltas.chunks_mut(4))
    {
        class += cross_entropy(logits, usize::from(sample.vehicle.is_some()), share);
        let truth = sample.vehicle.map(|vehicle| {
            encode(targets[sample.image].boxes[vehicle], sample.corners, config.coder)
        });
        for (k, delta) in deltas.iter_mut().enumerate() {
            let (loss, slope) = truth.map_or((0.0, 0.0), |truth| smooth_l1(*delta - truth[k]));
            boxes += loss * share;
            *delta = slope * share;
        }
    }
    [
        attach(class, std::slice::from_ref(&output.classes), vec![of_classes]),
        attach(boxes, std::slice::from_ref(&output.deltas), vec![of_deltas]),
    ]
}

/// Loss of the part masks: mean over cells with weight of the soft-max cross-entropy over 30 channels.
///
/// `logits`: `[samples, 30, m, m]`.
pub(crate) fn mask_loss(
    logits: &Tensor<4>,
    samples: &[Sample],
    targets: &[Target],
    config: &PartConfig,
) -> Tensor<1> {
    let kernel = config.kernel;
    let cells = kernel * kernel;
    let labels: Vec<Vec<Option<u8>>> =
        samples.iter().map(|sample| mask_target(sample, &targets[sample.image], config)).collect();
    let weight_of = |label: u8| config.class_weights.get(usize::from(label)).map_or(1.0, |w| *w);
    let total: f32 = labels.iter().flatten().flatten().map(|label| weight_of(*label)).sum();
    let mut values = to_host(logits.clone());
    let mut loss = 0.0f64;
    let mut cell_logits = [0.0; CHANNELS];
    for (labels, values) in labels.iter().zip(values.chunks_mut(CHANNELS * cells)) {
        for (cell, label) in labels.iter().enumerate() {
            for (k, logit) in cell_logits.iter_mut().enumerate() {
                *logit = values[k * cells + cell];
            }
            match label {
                Some(label) => {
                    let weight = weight_of(*label) / total;
                    let truth = usize::from(*label);
                    loss += f64::from(cross_entropy(&mut cell_logits, truth, weight));
                }
                None => cell_logits.fill(0.0),
            }
            for (k, slope) in cell_logits.iter().enumerate() {
                values[k * cells + cell] = *slope;
            }
        }
    }
    attach(loss as f32, std::slice::from_ref(logits), vec![values])
}

/// The label of each cell of a region, read at its centre; `None` where nothing is to be learnt.
fn mask_target(sample: &Sample, target: &Target, config: &PartConfig) -> Vec<Option<u8>> {
    let own = sample.vehicle.map_or(0, |vehicle| vehicle as u16 + 1);
    let [x0, y0, x1, y1] = sample.corners;
    let [width, height] = target.size;
    let m = config.kernel;
    let place = |i: usize, from: f32, to: f32, size: usize| -> Option<usize> {
        let at = from + (i as f32 + 0.5) / m as f32 * (to - from);
        (at >= 0.0 && at < size as f32).then_some(at as usize)
    };
    let columns: Vec<Option<usize>> = (0..m).map(|i| place(i, x0, x1, width)).collect();
    let label_of = |y: usize, x: usize| -> Option<u8> {
        let at = y * width + x;
        match target.owner[at] {
            IGNORED_OWNER => None,
            owner if owner == own => Some(target.labels[at]),
            0 => Some(0),
            _ => (config.others == OtherVehicles::Background).then_some(0),
        }
    };
    let row = |i: usize| {
        let y = place(i, y0, y1, height);
        // Outside the image nothing is known.
        columns.iter().map(move |x| label_of(y?, (*x)?))
    };
    (0..m).flat_map(row).collect()
}

/// Whether a network of this configuration can be trained with these targets; the text says why not.
pub(crate) fn check_targets(config: &NetConfig, targets: &[Target]) {
    for target in targets {
        let pixels = target.size[0] * target.size[1];
        assert_eq!(target.labels.len(), pixels, "labels for {:?} pixels", target.size);
        assert_eq!(target.owner.len(), pixels, "owners for {:?} pixels", target.size);
        let vehicles = target.boxes.len();
        let optional = |count: usize, asked: bool| !asked || count == vehicles;
        assert!(optional(target.models.len(), !config.models.is_empty()), "one model a vehicle");
        assert!(optional(target.extents.len(), config.extents), "extents of every vehicle");
    }
}
