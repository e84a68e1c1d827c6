//! Residual networks.
//!
//! He, Zhang, Ren and Sun: *Deep Residual Learning for Image Recognition*, CVPR 2016, in torchvision's layout: the stride of
//! a bottleneck lies in its 3x3 convolution.

use burn::Tensor;
use burn::module::Module;

use crate::config::{Backbone, NormKind};
use crate::layers::{Conv, ConvSizes, Finish, Init, Norm, Pass, conv_norm, fold};
use crate::ops;

/// A residual network without its classifier. Parameters are named as in torchvision.
#[derive(Module, Debug)]
#[allow(missing_docs)]
pub struct ResNet {
    pub conv1: Conv,
    pub bn1: Option<Norm>,
    pub layer1: Vec<Block>,
    pub layer2: Vec<Block>,
    pub layer3: Vec<Block>,
    pub layer4: Vec<Block>,
}

/// A residual block of two 3x3 convolutions, or of three with a narrow 3x3 between 1x1.
#[derive(Module, Debug)]
#[allow(missing_docs)]
pub struct Block {
    pub conv1: Conv,
    pub bn1: Option<Norm>,
    pub conv2: Conv,
    pub bn2: Option<Norm>,
    pub conv3: Option<Conv>,
    pub bn3: Option<Norm>,
    pub downsample: Option<(Conv, Option<Norm>)>,
}

/// How stages step over their input.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StageStep {
    pub(crate) stride: usize,
    /// Of the blocks after the first.
    pub(crate) dilation: usize,
}

impl Backbone {
    /// Blocks of the four stages.
    pub(crate) fn blocks(self) -> [usize; 4] {
        match self {
            Self::Resnet18 => [2, 2, 2, 2],
            Self::Resnet34 | Self::Resnet50 => [3, 4, 6, 3],
            Self::Resnet101 => [3, 4, 23, 3],
        }
    }

    fn has_bottlenecks(self) -> bool {
        matches!(self, Self::Resnet50 | Self::Resnet101)
    }

    /// Channels that a stage, 0 to 3, puts out.
    pub(crate) fn channels(self, stage: usize) -> usize {
        (64 << stage) * if self.has_bottlenecks() { 4 } else { 1 }
    }

    /// The network; `steps` are those of the third and fourth stage.
    pub(crate) fn init(self, init: &mut Init<'_>, norm: NormKind, steps: [StageStep; 2]) -> ResNet {
        let first = StageStep { stride: 1, dilation: 1 };
        let second = StageStep { stride: 2, dilation: 1 };
        let conv1 = init.conv(ConvSizes { stride: 2, ..ConvSizes::new([3, 64], 7, false) });
        let bn1 = Some(init.norm(64, norm, 1.0));
        let [layer1, layer2, layer3, layer4] =
            [(0, first), (1, second), (2, steps[0]), (3, steps[1])]
                .map(|(stage, step)| self.stage(init, norm, stage, step));
        ResNet { conv1, bn1, layer1, layer2, layer3, layer4 }
    }

    fn stage(
        self,
        init: &mut Init<'_>,
        norm: NormKind,
        stage: usize,
        step: StageStep,
    ) -> Vec<Block> {
        let out = self.channels(stage);
        let mut channels = if stage == 0 { 64 } else { self.channels(stage - 1) };
        let mut blocks = Vec::new();
        for i in 0..self.blocks()[stage] {
            let step = if i == 0 {
                StageStep { dilation: 1, ..step }
            } else {
                StageStep { stride: 1, ..step }
            };
            blocks.push(self.block(init, norm, [channels, 64 << stage, out], step));
            channels = out;
        }
        blocks
    }

    fn block(
        self,
        init: &mut Init<'_>,
        norm: NormKind,
        [channels, narrow, out]: [usize; 3],
        step: StageStep,
    ) -> Block {
        let conv = |init: &mut Init<'_>, channels, size, step: StageStep| {
            let sizes = ConvSizes::new(channels, size, false);
            init.conv(ConvSizes { stride: step.stride, dilation: step.dilation, ..sizes })
        };
        let plain = StageStep { stride: 1, dilation: 1 };
        let bottleneck = self.has_bottlenecks();
        let (conv1, conv2, conv3) = if bottleneck {
            (
                conv(init, [channels, narrow], 1, plain),
                conv(init, [narrow, narrow], 3, step),
                Some(conv(init, [narrow, out], 1, plain)),
            )
        } else {
            let rest = StageStep { stride: 1, ..step };
            (conv(init, [channels, out], 3, step), conv(init, [out, out], 3, rest), None)
        };
        // A block that begins as the identity trains more easily (Goyal et al., 2017).
        let last = if norm == NormKind::Frozen { 1.0 } else { 0.0 };
        let downsample = (step.stride != 1 || channels != out).then(|| {
            let step = StageStep { dilation: 1, ..step };
            (conv(init, [channels, out], 1, step), Some(init.norm(out, norm, 1.0)))
        });
        Block {
            conv1,
            bn1: Some(init.norm(narrow, norm, 1.0)),
            conv2,
            bn2: Some(init.norm(narrow, norm, if bottleneck { 1.0 } else { last })),
            conv3,
            bn3: bottleneck.then(|| init.norm(out, norm, last)),
            downsample,
        }
    }
}

impl ResNet {
    /// Feature maps of the first `stages` stages.
    ///
    /// `images`: `[batch, 3, height, width]`; maps: `[batch, channels, height / 4, width / 4]` and so on by the strides.
    pub(crate) fn forward(&self, images: Tensor<4>, stages: usize, pass: Pass) -> Vec<Tensor<4>> {
        let stem = conv_norm((&self.conv1, self.bn1.as_ref()), images, None, true, pass);
        let mut x = ops::max_pool(stem, 3, 2, 1);
        let layers = [&self.layer1, &self.layer2, &self.layer3, &self.layer4];
        let stages = layers.into_iter().take(stages).map(|layer| {
            x = run_stage(layer, x.clone(), pass);
            x.clone()
        });
        stages.collect()
    }

    pub(crate) fn fold(self, finish: Finish) -> Self {
        let (conv1, bn1) = fold(self.conv1, self.bn1, finish);
        let [layer1, layer2, layer3, layer4] = [self.layer1, self.layer2, self.layer3, self.layer4]
            .map(|layer| layer.into_iter().map(|block| block.fold(finish)).collect());
        Self { conv1, bn1, layer1, layer2, layer3, layer4 }
    }
}

/// Blocks one after the other.
pub(crate) fn run_stage(blocks: &[Block], input: Tensor<4>, pass: Pass) -> Tensor<4> {
    blocks.iter().fold(input, |x, block| block.forward(x, pass))
}

impl Block {
    fn forward(&self, input: Tensor<4>, pass: Pass) -> Tensor<4> {
        let residual = match &self.downsample {
            Some((conv, norm)) => {
                conv_norm((conv, norm.as_ref()), input.clone(), None, false, pass)
            }
            None => input.clone(),
        };
        let x = conv_norm((&self.conv1, self.bn1.as_ref()), input, None, true, pass);
        let second = (&self.conv2, self.bn2.as_ref());
        match &self.conv3 {
            Some(conv3) => {
                let x = conv_norm(second, x, None, true, pass);
                conv_norm((conv3, self.bn3.as_ref()), x, Some(residual), true, pass)
            }
            None => conv_norm(second, x, Some(residual), true, pass),
        }
    }

    fn fold(self, finish: Finish) -> Self {
        let (conv1, bn1) = fold(self.conv1, self.bn1, finish);
        let (conv2, bn2) = fold(self.conv2, self.bn2, finish);
        let (conv3, bn3) = match self.conv3 {
            Some(conv3) => {
                let (conv3, bn3) = fold(conv3, self.bn3, finish);
                (Some(conv3), bn3)
            }
            None => (None, None),
        };
        let downsample = self.downsample.map(|(conv, norm)| fold(conv, norm, finish));
        Self { conv1, bn1, conv2, bn2, conv3, bn3, downsample }
    }
}
