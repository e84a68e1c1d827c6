//! The heads that look at regions: vehicle or background and box, parts.

use burn::Tensor;
use burn::module::{Module, Param};

use crate::config::{NetConfig, PartUpscale};
use crate::layers::{Conv, ConvSizes, Finish, Init, Linear, Norm, Pass, conv_norm, fold};
use crate::ops::{self, ConvOptions};

/// Channels of a mask: background and 29 parts.
pub const CHANNELS: usize = partpose::parts::CHANNELS;

/// Vehicle or background, and the box.
#[derive(Module, Debug)]
pub struct BoxHead {
    /// First hidden layer (a pyramid's).
    pub fc6: Option<Linear>,
    /// Second hidden layer (a pyramid's).
    pub fc7: Option<Linear>,
    /// Logits of background and vehicle.
    pub cls_score: Linear,
    /// The box relative to the region.
    pub bbox_pred: Linear,
}

/// What the box head says of regions, `[regions, ..]`.
#[derive(Clone, Debug)]
pub(crate) struct BoxOutput {
    pub(crate) classes: Tensor<2>,
    pub(crate) deltas: Tensor<2>,
}

/// The part head.
#[derive(Module, Debug)]
pub struct PartHead {
    /// 3x3 convolutions.
    pub convs: Vec<(Conv, Option<Norm>)>,
    /// Doubles the cells, if the kernel is twice the region's cells.
    pub conv5_mask: Option<Doubling>,
    /// The output layer.
    pub mask_fcn_logits: Conv,
    pub(crate) kernel: usize,
    pub(crate) upscale_first: bool,
}

/// A transposed convolution of 2 x 2 with stride 2.
#[derive(Module, Debug)]
pub struct Doubling {
    /// `[in_channels, out_channels, 2, 2]`.
    pub weight: Param<Tensor<4>>,
    /// `[out_channels]`.
    pub bias: Param<Tensor<1>>,
}

impl BoxHead {
    /// `inputs`: values of a region; `hidden`: width of the hidden layers, if there are any.
    pub(crate) fn init(init: &mut Init<'_>, inputs: usize, hidden: Option<usize>) -> Self {
        let deviation = |inputs: usize| (2.0 / inputs as f32).sqrt();
        let fc6 = hidden.map(|width| init.linear(inputs, width, deviation(inputs)));
        let fc7 = hidden.map(|width| init.linear(width, width, deviation(width)));
        let width = hidden.unwrap_or(inputs);
        Self {
            fc6,
            fc7,
            cls_score: init.linear(width, 2, 0.01),
            bbox_pred: init.linear(width, 4, 0.001),
        }
    }

    /// `features`: `[regions, values]`.
    pub(crate) fn forward(&self, features: Tensor<2>) -> BoxOutput {
        let hidden = [&self.fc6, &self.fc7].into_iter().flatten();
        let x = hidden.fold(features, |x, layer| layer.forward(x, true));
        BoxOutput {
            classes: self.cls_score.forward(x.clone(), false),
            deltas: self.bbox_pred.forward(x, false),
        }
    }
}

impl PartHead {
    /// `channels` and `cells` are those of a region's features.
    pub(crate) fn init(
        init: &mut Init<'_>,
        config: &NetConfig,
        channels: usize,
        cells: usize,
    ) -> Self {
        let parts = &config.parts;
        let width = parts.channels;
        let bias = config.head_norm == crate::config::HeadNorm::None;
        let mut inputs = channels;
        let mut convs = Vec::new();
        for _ in 0..parts.convs {
            let conv = init.conv(ConvSizes::new([inputs, width], 3, bias));
            convs.push((conv, init.head_norm(width, config.head_norm)));
            inputs = width;
        }
        let upscale_first = parts.upscale == PartUpscale::First;
        let doubles = !upscale_first && parts.kernel == 2 * cells;
        let conv5_mask = doubles.then(|| Doubling {
            weight: init.normal([inputs, width, 2, 2], (2.0 / inputs as f32).sqrt()),
            bias: init.constant(width, 0.0),
        });
        if doubles {
            inputs = width;
        }
        // The paper's framework ends with a 3x3 convolution, Mask R-CNN with a 1x1.
        let size = if upscale_first { 3 } else { 1 };
        let sizes = ConvSizes::new([inputs, CHANNELS], size, true);
        let mask_fcn_logits = init.conv_with(sizes, (1.0 / (inputs * size * size) as f32).sqrt());
        Self { convs, conv5_mask, mask_fcn_logits, kernel: parts.kernel, upscale_first }
    }

    /// What its convolutions make of a region's features, `[regions, channels, cells, cells]`; with
    /// [`PartUpscale::First`] the cells are the kernel's.
    pub(crate) fn hidden(&self, features: Tensor<4>, pass: Pass) -> Tensor<4> {
        let mut x = features;
        if self.upscale_first {
            x = ops::resize(x, [self.kernel; 2], true);
        }
        for (conv, norm) in &self.convs {
            x = conv_norm((conv, norm.as_ref()), x, None, true, pass);
        }
        x
    }

    /// What [`PartHead::hidden`] found to logits `[regions, 30, m, m]`.
    pub(crate) fn logits(&self, hidden: Tensor<4>) -> Tensor<4> {
        if let Some(doubling) = &self.conv5_mask {
            return doubling.forward(hidden, &self.mask_fcn_logits);
        }
        let [_, _, cells, _] = hidden.dims();
        let x = if cells == self.kernel {
            hidden
        } else {
            ops::resize(hidden, [self.kernel; 2], false)
        };
        self.mask_fcn_logits.forward(x, None, false)
    }

    /// Channels and cells of [`PartHead::hidden`] for those of a region's features.
    pub(crate) fn hidden_shape(config: &NetConfig, channels: usize, cells: usize) -> [usize; 2] {
        let parts = &config.parts;
        let channels = if parts.convs > 0 { parts.channels } else { channels };
        [channels, if parts.upscale == PartUpscale::First { parts.kernel } else { cells }]
    }

    pub(crate) fn fold(self, finish: Finish) -> Self {
        let convs = self.convs.into_iter().map(|(conv, norm)| fold(conv, norm, finish));
        Self { convs: convs.collect(), ..self }
    }
}

impl Doubling {
    /// Doubles the cells, cuts off at zero, and applies a 1x1 convolution.
    ///
    /// The four cells that a cell becomes are computed as four images; the output layer runs on these, and only its
    /// channels are sorted to their places.
    fn forward(&self, x: Tensor<4>, output: &Conv) -> Tensor<4> {
        let [inputs, width, _, _] = self.weight.val().dims();
        let [regions, _, height, columns] = x.dims();
        let weight = self.weight.val().permute([2, 3, 1, 0]).reshape([4 * width, inputs, 1, 1]);
        let bias = self.bias.val().reshape([1, width]).repeat_dim(0, 4).reshape([4 * width]);
        let options = ConvOptions { relu: true, ..ConvOptions::same(1) };
        let x = ops::conv2d(x, weight, Some(bias), None, options);
        let x = output.forward(x.reshape([regions * 4, width, height, columns]), None, false);
        let channels = x.dims()[1];
        x.reshape([regions, 2, 2, channels, height, columns]).permute([0, 3, 4, 1, 5, 2]).reshape([
            regions,
            channels,
            2 * height,
            2 * columns,
        ])
    }
}
