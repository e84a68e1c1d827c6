//! What a network is made of: every choice of the paper and of this crate as data.
//!
//! [`NetConfig::default`] is the small network that a laptop's processor trains and runs; [`NetConfig::paper`] is the
//! paper's, whose open values are those of the TensorFlow Object Detection API of that time.

use serde::{Deserialize, Serialize};

/// A network's configuration. Saved beside its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetConfig {
    /// The residual network that features come from.
    pub backbone: Backbone,
    /// How its features reach the heads.
    pub neck: Neck,
    /// Normalisation inside the backbone.
    pub norm: NormKind,
    /// Normalisation in the feature pyramid and the part head; `none` gives their convolutions a bias.
    pub head_norm: HeadNorm,
    /// How images enter.
    pub input: InputConfig,
    /// Boxes that the proposals start from.
    pub anchors: AnchorConfig,
    /// Region proposals.
    pub rpn: RpnConfig,
    /// How features of a region are read.
    pub regions: RegionConfig,
    /// Vehicle or background, and the box.
    pub boxes: BoxConfig,
    /// The part masks.
    pub parts: PartConfig,
    /// Zoo models that the network tells apart, by name; without names there is no such head.
    pub models: Vec<String>,
    /// Whether a head estimates width, height and length.
    pub extents: bool,
    /// The head that says both, where one is asked for.
    pub vehicle: VehicleConfig,
    /// Weights of the losses.
    pub loss: LossWeights,
}

/// Residual networks of He, Zhang, Ren and Sun: *Deep Residual Learning for Image Recognition*, CVPR 2016, laid out and
/// named as in torchvision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Backbone {
    Resnet18,
    Resnet34,
    Resnet50,
    Resnet101,
}

/// How features reach the heads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum Neck {
    /// One feature map from the third stage; the fourth stage runs on each region (Faster R-CNN's way).
    C4 {
        /// Pixels of the input a cell, 16 or 8 (the third stage dilated).
        stride: usize,
    },
    /// A feature pyramid: Lin et al.: *Feature Pyramid Networks for Object Detection*, CVPR 2017.
    Fpn {
        /// Channels of each level.
        channels: usize,
        /// Exponent of the finest level's stride, 2 (4 pixels) to 5.
        finest: usize,
        /// Exponent of the coarsest level's stride, at least 5; above 5 by taking every second cell.
        coarsest: usize,
    },
}

/// Normalisation inside the backbone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NormKind {
    /// Statistics of the batch in training, running averages in inference.
    Batch,
    /// Fixed statistics and factors, from imported weights.
    Frozen,
    /// Statistics of groups of channels (32 groups).
    Group,
}

/// Normalisation in the pyramid and the part head.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HeadNorm {
    /// None.
    None,
    /// Statistics of the batch in training, running averages in inference.
    Batch,
    /// Fixed statistics, trained factors: for the end of a training with `batch`.
    Frozen,
    /// Statistics of groups of channels.
    Group,
}

/// How images enter the network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InputConfig {
    /// The shorter side after scaling, pixels; 0 leaves images as they are.
    pub min_side: u32,
    /// The longer side is at most this, pixels; 0 for no limit.
    pub max_side: u32,
    /// Subtracted from the channels red, green, blue, 0 to 255.
    pub mean: [f32; 3],
    /// Divisor after that.
    pub deviation: [f32; 3],
}

/// Anchors: boxes of each size and ratio on every cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AnchorConfig {
    /// Square roots of areas, pixels of the input, ascending. On a pyramid they are shared out evenly over its levels.
    pub sizes: Vec<f32>,
    /// Width over height.
    pub ratios: Vec<f32>,
    /// Place of anchors in their cell, as a share of it: 0.5 its middle; 0 its first corner, as the paper's framework and
    /// torchvision have it.
    pub offset: f32,
}

/// Numbers of proposals around non-maximum suppression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProposalCounts {
    /// Best by score that enter, of each level.
    pub before: usize,
    /// Best by score that leave, of an image.
    pub after: usize,
}

/// Region proposals: Ren, He, Girshick and Sun: *Faster R-CNN*, NIPS 2015.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RpnConfig {
    /// Channels of its 3x3 convolution.
    pub channels: usize,
    /// IoU from which an anchor is a vehicle's.
    pub positive_iou: f32,
    /// IoU below which an anchor is background.
    pub negative_iou: f32,
    /// Anchors sampled of each image.
    pub samples: usize,
    /// At most this share of them vehicles'.
    pub positive_share: f32,
    /// IoU above which the weaker of two proposals is dropped.
    pub nms_iou: f32,
    /// Proposals in training.
    pub training: ProposalCounts,
    /// Proposals in inference.
    pub inference: ProposalCounts,
}

/// How features of a region are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegionConfig {
    /// The operation.
    pub kind: RegionKind,
    /// Cells a side for the box head.
    pub box_cells: usize,
    /// Cells a side for the part head (a pyramid's; with `c4` it shares the box head's features).
    pub part_cells: usize,
    /// Points a side that a cell averages (`RoIAlign`).
    pub points: usize,
}

/// The operation that reads features of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegionKind {
    /// One bilinear sample a cell, the outer ones on the box's edge, twice as many as cells, then 2x2 max-pooling
    /// (TensorFlow's operation of that name).
    CropAndResize,
    /// Cells average points inside them (*Mask R-CNN*).
    RoiAlign,
}

/// The head that decides whether a region holds a vehicle, and refines its box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxConfig {
    /// Width of its two hidden layers (a pyramid's).
    pub width: usize,
    /// Regions sampled of each image.
    pub samples: usize,
    /// At most this share of them vehicles.
    pub positive_share: f32,
    /// IoU from which a region is a vehicle's; below it is background.
    pub positive_iou: f32,
    /// Factors of the encoded centre (x, y) and size (width, height), for proposals and detections.
    pub coder: [f32; 4],
    /// Detections with a lower score are dropped.
    pub score_threshold: f32,
    /// IoU above which the weaker of two detections is dropped.
    pub nms_iou: f32,
    /// Detections of an image at most.
    pub max_detections: usize,
}

/// The part head.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PartConfig {
    /// Cells a side of the mask: 14, 28, 42 or 56 in the paper.
    pub kernel: usize,
    /// Channels of its convolutions.
    pub channels: usize,
    /// 3x3 convolutions before the output layer.
    pub convs: usize,
    /// Where the features are brought to the kernel's size.
    pub upscale: PartUpscale,
    /// Positive regions of each image that masks are learnt from, at most.
    pub samples: usize,
    /// What pixels of other vehicles are in a vehicle's target.
    pub others: OtherVehicles,
    /// Weights of the 30 channels in the loss, background first; empty for equal ones.
    pub class_weights: Vec<f32>,
}

/// The head that says which model a vehicle is and how large.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleConfig {
    /// Channels of its 3x3 convolution, which halves the cells.
    pub channels: usize,
    /// Width of its hidden layer.
    pub width: usize,
}

/// Where the part head's features are brought to the kernel's size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartUpscale {
    /// Bilinearly, corners aligned, before the convolutions: the paper's, whose cost grows with the kernel's area.
    First,
    /// A transposed convolution (or a resize, where the kernel is not twice the cells) after the convolutions.
    Last,
}

/// What pixels of other vehicles are in a vehicle's target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum OtherVehicles {
    /// Background.
    Background,
    /// Without weight.
    Ignore,
}

/// Weights of the losses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossWeights {
    /// Whether an anchor is a vehicle's.
    pub rpn_objectness: f32,
    /// Boxes of anchors.
    pub rpn_box: f32,
    /// Vehicle or background (the paper's alpha of 1).
    pub class: f32,
    /// Boxes of regions (2).
    pub boxes: f32,
    /// Part masks (4).
    pub mask: f32,
    /// Zoo model.
    pub model: f32,
    /// Extents.
    pub extent: f32,
}

impl Default for NetConfig {
    fn default() -> Self {
        Self {
            backbone: Backbone::Resnet18,
            neck: Neck::Fpn { channels: 128, finest: 3, coarsest: 7 },
            norm: NormKind::Batch,
            head_norm: HeadNorm::Batch,
            input: InputConfig::default(),
            anchors: AnchorConfig::default(),
            rpn: RpnConfig::default(),
            regions: RegionConfig::default(),
            boxes: BoxConfig::default(),
            parts: PartConfig::default(),
            models: Vec::new(),
            extents: false,
            vehicle: VehicleConfig::default(),
            loss: LossWeights::default(),
        }
    }
}

impl NetConfig {
    /// The paper's network: ResNet-101, C4, 600 pixels of height, 300 proposals.
    pub fn paper() -> Self {
        Self {
            backbone: Backbone::Resnet101,
            neck: Neck::C4 { stride: 16 },
            norm: NormKind::Frozen,
            head_norm: HeadNorm::None,
            input: InputConfig {
                min_side: 600,
                max_side: 1987,
                mean: [123.68, 116.779, 103.939],
                deviation: [1.0; 3],
            },
            anchors: AnchorConfig {
                sizes: vec![32.0, 64.0, 128.0, 256.0, 512.0],
                ratios: vec![0.5, 1.0, 2.0],
                offset: 0.0,
            },
            rpn: RpnConfig {
                channels: 512,
                training: ProposalCounts { before: 1_000_000, after: 300 },
                inference: ProposalCounts { before: 1_000_000, after: 300 },
                ..RpnConfig::default()
            },
            regions: RegionConfig { kind: RegionKind::CropAndResize, ..RegionConfig::default() },
            boxes: BoxConfig {
                score_threshold: 0.0,
                nms_iou: 0.6,
                max_detections: 100,
                ..BoxConfig::default()
            },
            parts: PartConfig {
                kernel: 56,
                channels: 256,
                convs: 3,
                upscale: PartUpscale::First,
                samples: 64,
                ..PartConfig::default()
            },
            models: Vec::new(),
            extents: false,
            vehicle: VehicleConfig::default(),
            loss: LossWeights::default(),
        }
    }
}

impl Default for InputConfig {
    fn default() -> Self {
        Self {
            min_side: 0,
            max_side: 1408,
            mean: [123.675, 116.28, 103.53],
            deviation: [58.395, 57.12, 57.375],
        }
    }
}

impl Default for AnchorConfig {
    fn default() -> Self {
        Self {
            sizes: vec![28.0, 56.0, 112.0, 224.0, 448.0],
            ratios: vec![0.75, 1.5, 3.0],
            offset: 0.5,
        }
    }
}

impl Default for RpnConfig {
    fn default() -> Self {
        Self {
            channels: 128,
            positive_iou: 0.7,
            negative_iou: 0.3,
            samples: 256,
            positive_share: 0.5,
            nms_iou: 0.7,
            training: ProposalCounts { before: 1000, after: 300 },
            inference: ProposalCounts { before: 300, after: 100 },
        }
    }
}

impl Default for RegionConfig {
    fn default() -> Self {
        Self { kind: RegionKind::RoiAlign, box_cells: 7, part_cells: 14, points: 2 }
    }
}

impl Default for BoxConfig {
    fn default() -> Self {
        Self {
            width: 512,
            samples: 64,
            positive_share: 0.25,
            positive_iou: 0.5,
            coder: [10.0, 10.0, 5.0, 5.0],
            score_threshold: 0.05,
            nms_iou: 0.5,
            max_detections: 100,
        }
    }
}

impl Default for PartConfig {
    fn default() -> Self {
        Self {
            kernel: 28,
            channels: 128,
            convs: 4,
            upscale: PartUpscale::Last,
            samples: 16,
            others: OtherVehicles::Background,
            class_weights: Vec::new(),
        }
    }
}

impl Default for VehicleConfig {
    fn default() -> Self {
        Self { channels: 64, width: 160 }
    }
}

impl Default for LossWeights {
    fn default() -> Self {
        Self {
            rpn_objectness: 1.0,
            rpn_box: 2.0,
            class: 1.0,
            boxes: 2.0,
            mask: 4.0,
            model: 1.0,
            extent: 1.0,
        }
    }
}
