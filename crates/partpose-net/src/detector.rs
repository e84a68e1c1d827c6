//! From an image's pixels to detections in that image.

use burn::Tensor;
use burn::module::Module;
use burn::tensor::{Device, TensorData};
use partpose::detection::Detection;
use partpose::files::RgbImage;
use partpose::geometry::{Extent, Rect};
use partpose::parts::{PartProbabilities, ProbabilityError};

use crate::config::InputConfig;
use crate::input::{self, Input};
use crate::mask_rcnn::{MaskRcnn, RawDetection};

/// A network ready to look at images.
#[derive(Clone, Debug)]
pub struct Detector {
    net: MaskRcnn,
    device: Device,
}

/// A detected vehicle with what the optional heads say.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleDetection {
    /// Box, score and part probabilities, in pixels of the original image.
    pub detection: Detection,
    /// Probability of each model of `NetConfig::models`.
    pub models: Option<Vec<f32>>,
    /// Width, height and length.
    pub extent: Option<Extent>,
}

impl Detector {
    /// Takes a network's weights for inference: without gradients, normalisation folded into the convolutions.
    pub fn new(net: &MaskRcnn) -> Self {
        let net = net.valid().fold();
        let device = net.rpn.conv.weight.val().device();
        Self { net, device }
    }

    /// Vehicles in an image, best first. The error is a bug of the network: a value that is no probability.
    pub fn detect(&self, image: &RgbImage) -> Result<Vec<VehicleDetection>, ProbabilityError> {
        let config = self.net.config();
        let input = input::prepare(image, &config.input);
        let found = self.net.detect(to_tensor(&input, &self.device), input.size);
        let kernel = config.parts.kernel;
        found.into_iter().map(|raw| in_image(raw, &input, image.size, kernel)).collect()
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
) -> Result<VehicleDetection, ProbabilityError> {
    let scale = [0, 1].map(|i| f64::from(size[i]) / input.size[i] as f64);
    let [x0, y0, x1, y1] = [0, 1, 2, 3].map(|i| f64::from(raw.corners[i]) * scale[i % 2] - 0.5);
    let probabilities = PartProbabilities::new(kernel, raw.probabilities)?;
    let bounds = Rect::new(x0, y0, x1, y1);
    let detection = Detection::new(bounds, f64::from(raw.score), probabilities);
    let extent = raw.extents.map(|e| e.map(f64::from)).map(|[w, h, l]| Extent::new(w, h, l));
    Ok(VehicleDetection { detection, models: raw.models, extent })
}
