//! Region proposals.
//!
//! Ren, He, Girshick and Sun: *Faster R-CNN*, NIPS 2015: at each anchor a score and a refined box; the best that do not
//! overlap go to the second stage.

use burn::Tensor;
use burn::module::Module;
use rand_chacha::ChaCha8Rng;

use crate::anchors::LevelAnchors;
use crate::boxes::{Corners, clipped, decode, encode, suppress};
use crate::config::{ProposalCounts, RpnConfig};
use crate::layers::{Conv, ConvSizes, Finish, Init, to_host};
use crate::loss::{binary_cross_entropy, smooth_l1};
use crate::ops::attach;
use crate::sampling::{Match, MatchOptions, match_boxes, sample};
use crate::target::Target;

/// Sides below which a proposal is none, pixels.
pub(crate) const LEAST_SIDE: f32 = 2.0;

/// The head that looks at every cell of every map.
#[derive(Module, Debug)]
pub struct RpnHead {
    /// 3x3, cut off at zero.
    pub conv: Conv,
    /// One logit an anchor.
    pub cls_logits: Conv,
    /// Four values an anchor, those of one anchor together.
    pub bbox_pred: Conv,
}

/// What the head says of one map.
#[derive(Clone, Debug)]
pub(crate) struct LevelOutput {
    /// `[batch, anchors of a cell, height, width]`.
    logits: Tensor<4>,
    /// `[batch, 4 * anchors of a cell, height, width]`.
    deltas: Tensor<4>,
    logit_values: Vec<f32>,
    delta_values: Vec<f32>,
}

impl RpnHead {
    /// `kinds`: anchors of a cell.
    pub(crate) fn init(init: &mut Init<'_>, channels: usize, width: usize, kinds: usize) -> Self {
        let deviation = (2.0 / (channels * 9) as f32).sqrt();
        Self {
            conv: init.conv_with(ConvSizes::new([channels, width], 3, true), deviation),
            cls_logits: init.conv_with(ConvSizes::new([width, kinds], 1, true), 0.01),
            bbox_pred: init.conv_with(ConvSizes::new([width, 4 * kinds], 1, true), 0.01),
        }
    }

    pub(crate) fn fold(self, finish: Finish) -> Self {
        Self { conv: finish(self.conv), ..self }
    }

    pub(crate) fn forward(&self, maps: &[Tensor<4>]) -> Vec<LevelOutput> {
        let level = |map: &Tensor<4>| {
            let x = self.conv.forward(map.clone(), None, true);
            let logits = self.cls_logits.forward(x.clone(), None, false);
            let deltas = self.bbox_pred.forward(x, None, false);
            let [logit_values, delta_values] = [&logits, &deltas].map(|t| to_host(t.clone()));
            LevelOutput { logits, deltas, logit_values, delta_values }
        };
        maps.iter().map(level).collect()
    }
}

impl LevelOutput {
    /// Place of an anchor's logit.
    fn logit_at(anchors: &LevelAnchors, image: usize, anchor: usize) -> usize {
        image * anchors.len() + anchor
    }

    /// Places of an anchor's four values.
    fn deltas_at(anchors: &LevelAnchors, image: usize, anchor: usize) -> [usize; 4] {
        let area = anchors.size[0] * anchors.size[1];
        let [kind, cell] = [anchor / area, anchor % area];
        let first = image * 4 * anchors.len() + 4 * kind * area + cell;
        [0, 1, 2, 3].map(|k| first + k * area)
    }

    fn decoded(
        &self,
        anchors: &LevelAnchors,
        [image, anchor]: [usize; 2],
        coder: [f32; 4],
    ) -> Corners {
        let deltas = Self::deltas_at(anchors, image, anchor).map(|at| self.delta_values[at]);
        decode(deltas, anchors.corners(anchor), coder)
    }
}

/// Losses of the proposals: whether anchors are vehicles', and their boxes, each divided by the number of sampled anchors.
pub(crate) fn losses(
    outputs: &[LevelOutput],
    anchors: &[LevelAnchors],
    targets: &[Target],
    (config, coder): (&RpnConfig, [f32; 4]),
    rng: &mut ChaCha8Rng,
) -> [Tensor<1>; 2] {
    let boxes: Vec<Corners> =
        anchors.iter().flat_map(|level| (0..level.len()).map(|i| level.corners(i))).collect();
    let places: Vec<(usize, usize)> = anchors
        .iter()
        .enumerate()
        .flat_map(|(level, anchors)| (0..anchors.len()).map(move |i| (level, i)))
        .collect();
    let options = MatchOptions {
        positive: config.positive_iou,
        negative: config.negative_iou,
        force_best: true,
    };
    let samples: Vec<(usize, usize, Match)> = targets
        .iter()
        .enumerate()
        .flat_map(|(image, target)| {
            let matches = match_boxes(&boxes, target, &options);
            let chosen = sample(&matches, config.samples, config.positive_share, rng);
            chosen.into_iter().map(move |i| (image, i, matches[i])).collect::<Vec<_>>()
        })
        .collect();
    let share = 1.0 / samples.len().max(1) as f32;
    let zeros = |values: fn(&LevelOutput) -> &Vec<f32>| -> Vec<Vec<f32>> {
        outputs.iter().map(|output| vec![0.0; values(output).len()]).collect()
    };
    let mut of_logits = zeros(|output| &output.logit_values);
    let mut of_deltas = zeros(|output| &output.delta_values);
    let [mut objectness, mut of_boxes] = [0.0; 2];
    for (image, index, matched) in samples {
        let (level, anchor) = places[index];
        let (output, anchors) = (&outputs[level], &anchors[level]);
        let at = LevelOutput::logit_at(anchors, image, anchor);
        let positive = matches!(matched, Match::Vehicle(_));
        let (loss, slope) = binary_cross_entropy(output.logit_values[at], positive);
        objectness += loss * share;
        of_logits[level][at] = slope * share;
        if let Match::Vehicle(vehicle) = matched {
            let truth = encode(targets[image].boxes[vehicle], boxes[index], coder);
            let at = LevelOutput::deltas_at(anchors, image, anchor);
            for (at, truth) in at.into_iter().zip(truth) {
                let (loss, slope) = smooth_l1(output.delta_values[at] - truth);
                of_boxes += loss * share;
                of_deltas[level][at] = slope * share;
            }
        }
    }
    let tensors = |of: fn(&LevelOutput) -> &Tensor<4>| -> Vec<Tensor<4>> {
        outputs.iter().map(|output| of(output).clone()).collect()
    };
    [
        attach(objectness, &tensors(|output| &output.logits), of_logits),
        attach(of_boxes, &tensors(|output| &output.deltas), of_deltas),
    ]
}

/// Proposals of one image of the batch, best first, inside its `size`, width and height.
pub(crate) fn proposals(
    outputs: &[LevelOutput],
    anchors: &[LevelAnchors],
    (image, size): (usize, [usize; 2]),
    (counts, nms_iou): (ProposalCounts, f32),
    coder: [f32; 4],
) -> Vec<Corners> {
    let mut kept: Vec<(f32, Corners)> = Vec::new();
    for (output, anchors) in outputs.iter().zip(anchors) {
        let logits = &output.logit_values[image * anchors.len()..][..anchors.len()];
        let mut order: Vec<usize> = (0..logits.len()).collect();
        let by_score = |a: &usize, b: &usize| logits[*b].total_cmp(&logits[*a]).then(a.cmp(b));
        if counts.before < order.len() {
            order.select_nth_unstable_by(counts.before, by_score);
            order.truncate(counts.before);
        }
        order.sort_unstable_by(by_score);
        let boxes: Vec<(f32, Corners)> = order
            .into_iter()
            .map(|i| (logits[i], clipped(output.decoded(anchors, [image, i], coder), size)))
            // A box of no numbers is none.
            .filter(|(_, [x0, y0, x1, y1])| x1 - x0 >= LEAST_SIDE && y1 - y0 >= LEAST_SIDE)
            .collect();
        let corners: Vec<Corners> = boxes.iter().map(|(_, corners)| *corners).collect();
        kept.extend(suppress(&corners, nms_iou, counts.after).into_iter().map(|i| boxes[i]));
    }
    kept.sort_by(|a, b| b.0.total_cmp(&a.0));
    kept.truncate(counts.after);
    kept.into_iter().map(|(_, corners)| corners).collect()
}
