//! The network: images to losses in training, one image to detections in inference.
//!
//! He, Gkioxari, Dollar and Girshick: *Mask R-CNN*, ICCV 2017, with the changes of Barowski, Szczot and Houben, ITSC 2019:
//! the box head tells vehicles from background, the mask head gives every cell one of 30 channels by soft-max.

use burn::Tensor;
use burn::module::Module;
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;

use crate::anchors::{LevelAnchors, kinds_of_cell};
use crate::boxes::{Corners, clipped, decode, suppress};
use crate::config::{LossWeights, Neck, NetConfig, RegionKind};
use crate::fpn::Fpn;
use crate::heads::{BoxHead, CHANNELS, PartHead};
use crate::layers::{Conv, Finish, Init, Pass, to_host};
use crate::loss::soft_max;
use crate::ops;
use crate::ops::roi_align::{Region, Sampling};
use crate::resnet::{ResNet, StageStep, run_stage};
use crate::rpn::{self, RpnHead};
use crate::second_stage as second;
use crate::target::Target;
use crate::vehicle_head::VehicleHead;

/// A network. Names and layouts of the backbone's parameters are torchvision's.
#[derive(Module, Debug)]
pub struct MaskRcnn {
    /// The residual network.
    pub backbone: ResNet,
    /// The feature pyramid, unless the configuration is `c4`.
    pub fpn: Option<Fpn>,
    /// Region proposals.
    pub rpn: RpnHead,
    /// Vehicle or background, boxes.
    pub box_head: BoxHead,
    /// Part masks.
    pub part_head: PartHead,
    /// Zoo model and size, where the configuration asks for one of them.
    pub vehicle_head: Option<VehicleHead>,
    #[module(skip)]
    config: NetConfig,
}

/// Losses of one batch, each of one element.
#[derive(Clone, Debug)]
pub struct Losses {
    /// Whether anchors are vehicles'.
    pub rpn_objectness: Tensor<1>,
    /// Boxes of anchors.
    pub rpn_box: Tensor<1>,
    /// Vehicle or background.
    pub class: Tensor<1>,
    /// Boxes of regions.
    pub boxes: Tensor<1>,
    /// Part masks.
    pub mask: Tensor<1>,
    /// Zoo model, where the network has that head.
    pub model: Option<Tensor<1>>,
    /// Extents, where the network has that head.
    pub extent: Option<Tensor<1>>,
}

/// Width, height and length, and how far they may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LikelyExtents {
    /// Metres.
    pub sides: [f32; 3],
    /// Standard deviations of their logarithms.
    pub deviations: [f32; 3],
}

/// One detection in pixels of the network's input.
#[derive(Clone, Debug, PartialEq)]
pub struct RawDetection {
    /// Corners, pixel (i, j) covering `i..i+1`, `j..j+1`.
    pub corners: [f32; 4],
    /// 0 to 1.
    pub score: f32,
    /// `[30, m, m]`, background first.
    pub probabilities: Vec<f32>,
    /// Probability of each zoo model, where the network has that head.
    pub models: Option<Vec<f32>>,
    /// Width, height and length, where the network has that head.
    pub extents: Option<LikelyExtents>,
}

/// A network for inference alone.
///
/// Normalisation is folded into convolutions, and weights of 3 x 3 kernels are held once more in the form that they are
/// multiplied in (four times their memory). Weights that changed would not change that form, so they cannot be reached.
#[derive(Clone, Debug)]
pub struct PreparedNet(MaskRcnn);

impl PreparedNet {
    /// Takes a network's weights as they are now, without gradients.
    pub fn new(net: &MaskRcnn) -> Self {
        Self(net.valid().fold_with(Conv::prepared))
    }

    /// What the network is made of.
    pub fn config(&self) -> &NetConfig {
        self.0.config()
    }

    /// Where it computes.
    pub(crate) fn device(&self) -> Device {
        self.0.rpn.conv.weight.val().device()
    }

    /// [`MaskRcnn::detect`].
    pub fn detect(&self, image: Tensor<4>, size: [usize; 2]) -> Vec<RawDetection> {
        self.0.detect(image, size)
    }
}

impl NetConfig {
    /// A network with random weights: the same seed, the same weights.
    ///
    /// On a device with gradients (`Device::autodiff`) it can be trained.
    pub fn init(&self, device: &Device, seed: u64) -> MaskRcnn {
        let init = &mut Init::new(device, seed);
        let usual = StageStep { stride: 2, dilation: 1 };
        let steps = match self.neck {
            Neck::C4 { stride: 8 } => {
                [StageStep { stride: 1, dilation: 2 }, StageStep { stride: 1, dilation: 1 }]
            }
            Neck::C4 { .. } => [usual, StageStep { stride: 1, dilation: 1 }],
            Neck::Fpn { .. } => [usual; 2],
        };
        let backbone = self.backbone.init(init, self.norm, steps);
        let (fpn, channels, region, hidden) = match self.neck {
            Neck::C4 { .. } => {
                let [third, fourth] = [2, 3].map(|stage| self.backbone.channels(stage));
                (None, third, fourth, None)
            }
            Neck::Fpn { channels, finest, coarsest } => {
                let inputs: Vec<usize> =
                    (finest - 2..4).map(|stage| self.backbone.channels(stage)).collect();
                let fpn = Fpn::init(init, &inputs, channels, self.head_norm, coarsest - 5);
                (Some(fpn), channels, channels, Some(self.boxes.width))
            }
        };
        let kinds = kinds_of_cell(&self.anchors, self.strides().len());
        let rpn = RpnHead::init(init, channels, self.rpn.channels, kinds);
        let values = if hidden.is_some() { region * self.regions.box_cells.pow(2) } else { region };
        let box_head = BoxHead::init(init, values, hidden);
        let cells = if hidden.is_some() { self.regions.part_cells } else { self.regions.box_cells };
        let part_head = PartHead::init(init, self, region, cells);
        let asked = !self.models.is_empty() || self.extents;
        let hidden = PartHead::hidden_shape(self, region, cells);
        let vehicle_head = asked.then(|| VehicleHead::init(init, self, hidden));
        MaskRcnn { backbone, fpn, rpn, box_head, part_head, vehicle_head, config: self.clone() }
    }

    /// Pixels of the input a cell of each feature map, finest first.
    pub fn strides(&self) -> Vec<usize> {
        match self.neck {
            Neck::C4 { stride } => vec![stride],
            Neck::Fpn { finest, coarsest, .. } => (finest..=coarsest).map(|e| 1 << e).collect(),
        }
    }
}

impl MaskRcnn {
    /// Sides of inputs are padded to multiples of this.
    pub const SIDE_STEP: usize = 32;

    /// What the network is made of.
    pub fn config(&self) -> &NetConfig {
        &self.config
    }

    /// Losses of a batch.
    ///
    /// `images`: `[batch, 3, height, width]`, red, green, blue, normalised by `NetConfig::input`, sides multiples of
    /// [`MaskRcnn::SIDE_STEP`]; one target an image. `rng` chooses samples.
    ///
    /// # Panics
    ///
    /// If a target's lists do not fit each other: a bug of the caller.
    pub fn losses(&self, images: Tensor<4>, targets: &[Target], rng: &mut ChaCha8Rng) -> Losses {
        second::check_targets(&self.config, targets);
        let config = &self.config;
        let device = images.device();
        let maps = self.maps(images, Pass::Training);
        let outputs = self.rpn.forward(&maps);
        let anchors = self.anchors(&maps);
        let coder = config.boxes.coder;
        let [rpn_objectness, rpn_box] =
            rpn::losses(&outputs, &anchors, targets, (&config.rpn, coder), rng);
        let counts = (config.rpn.training, config.rpn.nms_iou);
        let proposals = targets
            .iter()
            .enumerate()
            .map(|(i, target)| rpn::proposals(&outputs, &anchors, (i, target.size), counts, coder))
            .collect();
        let samples = second::choose_samples(proposals, targets, &config.boxes, rng);
        let zero = || Tensor::zeros([1], &device);
        let [model, extent] = [None, None];
        if samples.is_empty() {
            let [class, boxes, mask] = [zero(), zero(), zero()];
            return Losses { rpn_objectness, rpn_box, class, boxes, mask, model, extent };
        }
        let regions = samples.iter().map(|sample| (sample.image, sample.corners)).collect();
        let features = self.box_features(&maps, regions, Pass::Training);
        let output = self.box_head.forward(features);
        let [class, boxes] = second::box_losses(&output, &samples, targets, &config.boxes);
        let chosen = second::choose_masks(&samples, config.parts.samples, rng);
        if chosen.is_empty() {
            let mask = zero();
            return Losses { rpn_objectness, rpn_box, class, boxes, mask, model, extent };
        }
        let regions = chosen.iter().map(|sample| (sample.image, sample.corners)).collect();
        let features = self.part_features(&maps, regions, Pass::Training);
        let hidden = self.part_head.hidden(features, Pass::Training);
        let [model, extent] = match &self.vehicle_head {
            Some(head) => head.losses(hidden.clone(), &chosen, targets),
            None => [None, None],
        };
        let logits = self.part_head.logits(hidden);
        let mask = second::mask_loss(&logits, &chosen, targets, &config.parts);
        Losses { rpn_objectness, rpn_box, class, boxes, mask, model, extent }
    }

    /// Detections in one image, `[1, 3, height, width]` as in [`MaskRcnn::losses`], best first.
    ///
    /// `size`: width and height of the part of the input that is image.
    pub fn detect(&self, image: Tensor<4>, size: [usize; 2]) -> Vec<RawDetection> {
        let config = &self.config;
        let maps = self.maps(image, Pass::Inference);
        let outputs = self.rpn.forward(&maps);
        let anchors = self.anchors(&maps);
        let counts = (config.rpn.inference, config.rpn.nms_iou);
        let proposals = rpn::proposals(&outputs, &anchors, (0, size), counts, config.boxes.coder);
        let mut found = self.boxes(&maps, &proposals, size);
        if found.is_empty() {
            return found;
        }
        let regions = found.iter().map(|detection| (0, detection.corners)).collect();
        let features = self.part_features(&maps, regions, Pass::Inference);
        let hidden = self.part_head.hidden(features, Pass::Inference);
        if let Some(head) = &self.vehicle_head {
            head.describe(hidden.clone(), &mut found);
        }
        let logits = to_host(self.part_head.logits(hidden));
        let masks = logits.chunks(CHANNELS * config.parts.kernel * config.parts.kernel);
        for (detection, logits) in found.iter_mut().zip(masks) {
            detection.probabilities = channel_soft_max(logits);
        }
        found
    }

    /// A network that finds the same: normalisation by kept statistics becomes part of the convolutions before it.
    #[must_use]
    pub fn fold(self) -> Self {
        self.fold_with(|conv| conv)
    }

    fn fold_with(self, finish: Finish) -> Self {
        Self {
            backbone: self.backbone.fold(finish),
            fpn: self.fpn.map(|fpn| fpn.fold(finish)),
            part_head: self.part_head.fold(finish),
            rpn: self.rpn.fold(finish),
            ..self
        }
    }

    /// Feature maps, finest first.
    fn maps(&self, images: Tensor<4>, pass: Pass) -> Vec<Tensor<4>> {
        match (&self.fpn, self.config.neck) {
            (Some(fpn), Neck::Fpn { finest, .. }) => {
                let maps = self.backbone.forward(images, 4, pass);
                fpn.forward(maps.into_iter().skip(finest - 2).collect(), pass)
            }
            _ => self.backbone.forward(images, 3, pass).split_off(2),
        }
    }

    fn anchors(&self, maps: &[Tensor<4>]) -> Vec<LevelAnchors> {
        let sizes: Vec<[usize; 2]> = maps
            .iter()
            .map(|map| {
                let [_, _, height, width] = map.dims();
                [height, width]
            })
            .collect();
        LevelAnchors::all(&self.config.anchors, &sizes, &self.config.strides())
    }

    /// Features of regions (image, box) for the box head, `[regions, values]`.
    fn box_features(
        &self,
        maps: &[Tensor<4>],
        regions: Vec<(usize, Corners)>,
        pass: Pass,
    ) -> Tensor<2> {
        let features = self.read(maps, regions, self.config.regions.box_cells);
        match self.config.neck {
            Neck::C4 { .. } => ops::average(run_stage(&self.backbone.layer4, features, pass)),
            Neck::Fpn { .. } => features.flatten(1, 3),
        }
    }

    /// Features of regions for the part head, `[regions, channels, cells, cells]`.
    fn part_features(
        &self,
        maps: &[Tensor<4>],
        regions: Vec<(usize, Corners)>,
        pass: Pass,
    ) -> Tensor<4> {
        match self.config.neck {
            Neck::C4 { .. } => {
                let features = self.read(maps, regions, self.config.regions.box_cells);
                run_stage(&self.backbone.layer4, features, pass)
            }
            Neck::Fpn { .. } => self.read(maps, regions, self.config.regions.part_cells),
        }
    }

    /// Reads regions into `[regions, channels, cells, cells]`, each from the map whose cells suit its size.
    fn read(&self, maps: &[Tensor<4>], regions: Vec<(usize, Corners)>, cells: usize) -> Tensor<4> {
        let strides = self.config.strides();
        let last = match self.config.neck {
            Neck::C4 { .. } => 0,
            Neck::Fpn { finest, .. } => 5 - finest,
        };
        let regions = regions.into_iter().map(|(image, corners)| {
            let level = match self.config.neck {
                Neck::C4 { .. } => 0,
                Neck::Fpn { finest, .. } => level_of(corners).saturating_sub(finest).min(last),
            };
            Region { image, level, corners }
        });
        let scales: Vec<f32> = strides[..=last].iter().map(|s| 1.0 / *s as f32).collect();
        let (maps, regions) = (&maps[..=last], regions.collect());
        match self.config.regions.kind {
            RegionKind::RoiAlign => {
                let sampling = Sampling::Align(self.config.regions.points);
                ops::read_regions(maps, &scales, regions, cells, sampling)
            }
            RegionKind::CropAndResize => {
                let sampling = Sampling::CropAndResize;
                ops::max_pool(
                    ops::read_regions(maps, &scales, regions, 2 * cells, sampling),
                    2,
                    2,
                    0,
                )
            }
        }
    }

    /// Detections without masks among proposals of the first image, best first.
    fn boxes(
        &self,
        maps: &[Tensor<4>],
        proposals: &[Corners],
        size: [usize; 2],
    ) -> Vec<RawDetection> {
        let config = &self.config.boxes;
        if proposals.is_empty() {
            return Vec::new();
        }
        let regions = proposals.iter().map(|corners| (0, *corners)).collect();
        let output = self.box_head.forward(self.box_features(maps, regions, Pass::Inference));
        let [classes, deltas] = [to_host(output.classes), to_host(output.deltas)];
        let mut found = Vec::new();
        for (i, proposal) in proposals.iter().enumerate() {
            let mut scores = [classes[2 * i], classes[2 * i + 1]];
            soft_max(&mut scores);
            let deltas = [0, 1, 2, 3].map(|k| deltas[4 * i + k]);
            let corners = clipped(decode(deltas, *proposal, config.coder), size);
            let [x0, y0, x1, y1] = corners;
            // Comparisons fail for what is no number.
            if !(scores[1] >= config.score_threshold && x1 - x0 >= 1.0 && y1 - y0 >= 1.0) {
                continue;
            }
            let (score, probabilities) = (scores[1], Vec::new());
            let (models, extents) = (None, None);
            found.push(RawDetection { corners, score, probabilities, models, extents });
        }
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        let corners: Vec<Corners> = found.iter().map(|detection| detection.corners).collect();
        let kept = suppress(&corners, config.nms_iou, config.max_detections);
        kept.into_iter().map(|i| found[i].clone()).collect()
    }
}

/// Exponent of the stride of the map that suits a box: 4 for a box as large as the images that backbones learn from (Lin
/// et al.), one more for twice its side.
fn level_of(corners: Corners) -> usize {
    let side = crate::boxes::area(corners).sqrt();
    (4.0 + (side / 224.0 + 1e-6).log2()).floor().max(0.0) as usize
}

/// Probabilities of `[30, m, m]` logits, by soft-max over the channels.
fn channel_soft_max(logits: &[f32]) -> Vec<f32> {
    let cells = logits.len() / CHANNELS;
    let mut values = vec![0.0; logits.len()];
    let mut cell = [0.0; CHANNELS];
    for i in 0..cells {
        (0..CHANNELS).for_each(|k| cell[k] = logits[k * cells + i]);
        soft_max(&mut cell);
        (0..CHANNELS).for_each(|k| values[k * cells + i] = cell[k]);
    }
    values
}

impl Losses {
    /// The weighted sum, of one element.
    pub fn total(&self, weights: &LossWeights) -> Tensor<1> {
        let parts = [
            (Some(&self.rpn_objectness), weights.rpn_objectness),
            (Some(&self.rpn_box), weights.rpn_box),
            (Some(&self.class), weights.class),
            (Some(&self.boxes), weights.boxes),
            (Some(&self.mask), weights.mask),
            (self.model.as_ref(), weights.model),
            (self.extent.as_ref(), weights.extent),
        ];
        let weighted = parts.into_iter().filter_map(|(loss, weight)| Some(loss?.clone() * weight));
        weighted.reduce(|sum, loss| sum + loss).expect("there are five losses always")
    }
}
