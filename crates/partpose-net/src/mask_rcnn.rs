//! The network: images to losses in training, one image to detections in inference.
//!
//! He, Gkioxari, Dollar and Girshick: *Mask R-CNN*, ICCV 2017, with the changes of Barowski, Szczot and Houben, ITSC 2019:
//! the box head tells vehicles from background, the mask head gives every cell one of 30 channels by soft-max.

use burn::Tensor;
use burn::module::{Module, Param};
use burn::tensor::Device;
use rand_chacha::ChaCha8Rng;

use crate::config::{LossWeights, NetConfig};
use crate::target::Target;

/// A network. Names and layouts of the backbone's parameters are torchvision's.
#[derive(Module, Debug)]
pub struct MaskRcnn {
    stub: Param<Tensor<1>>,
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
    /// Width, height and length in metres, where the network has that head.
    pub extents: Option<[f32; 3]>,
}

impl NetConfig {
    /// A network with random weights: the same seed, the same weights.
    ///
    /// On a device with gradients (`Device::autodiff`) it can be trained.
    pub fn init(&self, device: &Device, _seed: u64) -> MaskRcnn {
        let stub = Param::from_tensor(Tensor::zeros([1], device));
        MaskRcnn { stub, config: self.clone() }
    }
}

impl MaskRcnn {
    /// What the network is made of.
    pub fn config(&self) -> &NetConfig {
        &self.config
    }

    /// Losses of a batch.
    ///
    /// `images`: `[batch, 3, height, width]`, red, green, blue, normalised by `NetConfig::input`, sides multiples of
    /// [`MaskRcnn::SIDE_STEP`]; one target an image. `rng` chooses samples.
    pub fn losses(&self, _images: Tensor<4>, _targets: &[Target], _rng: &mut ChaCha8Rng) -> Losses {
        let zero = self.stub.val();
        Losses {
            rpn_objectness: zero.clone(),
            rpn_box: zero.clone(),
            class: zero.clone(),
            boxes: zero.clone(),
            mask: zero,
            model: None,
            extent: None,
        }
    }

    /// Detections in one image, `[1, 3, height, width]` as in [`MaskRcnn::losses`], best first.
    ///
    /// `size`: width and height of the part of the input that is image.
    pub fn detect(&self, _image: Tensor<4>, _size: [usize; 2]) -> Vec<RawDetection> {
        Vec::new()
    }

    /// Sides of inputs are padded to multiples of this.
    pub const SIDE_STEP: usize = 32;
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
