//! The feature pyramid.
//!
//! Lin, Dollar, Girshick, He, Hariharan and Belongie: *Feature Pyramid Networks for Object Detection*, CVPR 2017.

use burn::Tensor;
use burn::module::Module;

use crate::config::HeadNorm;
use crate::layers::{Conv, ConvSizes, Finish, Init, Norm, Pass, conv_norm, fold};
use crate::ops;

/// A feature pyramid: levels of equal channels, each half as fine as the one before.
#[derive(Module, Debug)]
pub struct Fpn {
    /// 1x1 convolutions of the backbone's maps, finest first.
    pub inner_blocks: Vec<(Conv, Option<Norm>)>,
    /// 3x3 convolutions after the sums, finest first.
    pub layer_blocks: Vec<(Conv, Option<Norm>)>,
    pub(crate) extra: usize,
}

impl Fpn {
    /// `inputs`: channels of the backbone's maps, finest first; `extra`: levels beyond the coarsest of them.
    pub(crate) fn init(
        init: &mut Init<'_>,
        inputs: &[usize],
        channels: usize,
        norm: HeadNorm,
        extra: usize,
    ) -> Self {
        let mut conv = |sizes: [usize; 2], size: usize| {
            // Variance is kept: there is no cut at zero in the pyramid.
            let deviation = (1.0 / (sizes[0] * size * size) as f32).sqrt();
            let sizes = ConvSizes::new(sizes, size, norm == HeadNorm::None);
            (init.conv_with(sizes, deviation), init.head_norm(channels, norm))
        };
        Self {
            inner_blocks: inputs.iter().map(|input| conv([*input, channels], 1)).collect(),
            layer_blocks: inputs.iter().map(|_| conv([channels, channels], 3)).collect(),
            extra,
        }
    }

    /// Maps of the backbone, finest first, to levels, `[batch, channels, height, width]` each, finest first.
    pub(crate) fn forward(&self, maps: Vec<Tensor<4>>, pass: Pass) -> Vec<Tensor<4>> {
        let mut levels = Vec::new();
        let mut above: Option<Tensor<4>> = None;
        let blocks = self.inner_blocks.iter().zip(&self.layer_blocks);
        for ((inner, layer), map) in blocks.zip(maps).rev() {
            let lateral = conv_norm((&inner.0, inner.1.as_ref()), map, None, false, pass);
            let sum = match above {
                Some(above) => ops::upsample_add(above, lateral),
                None => lateral,
            };
            above = Some(sum.clone());
            levels.push(conv_norm((&layer.0, layer.1.as_ref()), sum, None, false, pass));
        }
        levels.reverse();
        for _ in 0..self.extra {
            let coarsest = levels.last().expect("a pyramid has levels").clone();
            levels.push(ops::max_pool(coarsest, 1, 2, 0));
        }
        levels
    }

    pub(crate) fn fold(self, finish: Finish) -> Self {
        let all = |blocks: Vec<(Conv, Option<Norm>)>| {
            blocks.into_iter().map(|(conv, norm)| fold(conv, norm, finish)).collect()
        };
        Self {
            inner_blocks: all(self.inner_blocks),
            layer_blocks: all(self.layer_blocks),
            extra: self.extra,
        }
    }
}
