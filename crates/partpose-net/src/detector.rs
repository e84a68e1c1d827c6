//! From an image's pixels to detections in that image.

use std::sync::Arc;

use burn::Tensor;
use burn::tensor::{Device, TensorData};
use partpose::detection::{DetectedSize, Detection, ModelProbabilities};
use partpose::files::RgbImage;
use partpose::geometry::{Extent, Rect};
use partpose::parts::{PartProbabilities, ProbabilityError};

use crate::config::InputConfig;
use crate::input::{self, Input};
use crate::mask_rcnn::{MaskRcnn, PreparedNet, RawDetection};

/// A network ready to look at images.
#[derive(Clone, Debug)]
pub struct Detector {
    net: PreparedNet,
    device: Device,
    /// Names of the zoo models that it tells apart.
    models: Arc<[String]>,
}

impl Detector {
    /// Takes a network's weights for inference: without gradients, normalisation folded into the convolutions.
    pub fn new(net: &MaskRcnn) -> Self {
        let net = PreparedNet::new(net);
        let models = net.config().models.clone().into();
        Self { device: net.device(), net, models }
    }

    /// Vehicles in an image, best first, in pixels of the image; with model and size where the network has that head. The error is a bug of the network: a value that is no probability.
    pub fn detect(&self, image: &RgbImage) -> Result<Vec<Detection>, ProbabilityError> {
        let config = self.net.config();
        let input = input::prepare(image, &config.input);
        let found = self.net.detect(to_tensor(&input, &self.device), input.size);
        let kernel = config.parts.kernel;
        let in_image = |mut raw: RawDetection| {
            let models = raw.models.take();
            let models =
                models.map(|values| ModelProbabilities { names: self.models.clone(), values });
            Ok(Detection { models, ..in_image(raw, &input, image.size, kernel)? })
        };
        found.into_iter().map(in_image).collect()
    }

    /// How images enter.
    pub fn input(&self) -> &InputConfig {
        &self.net.config().input
    }
}

/// `[1, 3, height, width]`.
fn to_tensor(input: &Input, device: &Device) -> Tensor<4> {
    let [width, height] = input.padded;
    Tensor::from_data(TensorData::new(input.values.clone(), [1, 3, height, width]), device)
}

fn in_image(
    raw: RawDetection,
    input: &Input,
    size: [u32; 2],
    kernel: usize,
) -> Result<Detection, ProbabilityError> {
    let scale = [0, 1].map(|i| f64::from(size[i]) / input.size[i] as f64);
    let [x0, y0, x1, y1] = [0, 1, 2, 3].map(|i| f64::from(raw.corners[i]) * scale[i % 2] - 0.5);
    let probabilities = PartProbabilities::new(kernel, raw.probabilities)?;
    let bounds = Rect::new(x0, y0, x1, y1);
    let detection = Detection::new(bounds, f64::from(raw.score), probabilities);
    let size = raw.extents.map(|likely| {
        let [width, height, length] = likely.sides.map(f64::from);
        let extent = Extent::new(width, height, length);
        DetectedSize { extent, sigma: likely.deviations.map(f64::from) }
    });
    Ok(Detection { size, ..detection })
}
