//! A network as an ONNX model, for runtimes of others.
//!
//! One model does all: it takes an image, red, green and blue from 0 to 255 and of any size, normalises and pads it, and
//! puts out boxes, scores and part probabilities of the vehicles, best first, in pixels of that image. Only scaling is
//! left to the caller ([`crate::input::scaled`]). Proposals, non-maximum suppression and `RoIAlign` are the operators of
//! ONNX (operator set 16), so that no code besides the runtime is needed.

mod boxes;
mod graph;
mod network;
mod proto;
mod regions;

pub use graph::{Attribute, Axis, Element, Graph, Value};

use crate::config::{HeadNorm, NormKind};
use crate::mask_rcnn::MaskRcnn;
use crate::weights::CONFIG_KEY;

/// Name of the input, `[1, 3, height, width]`.
pub const IMAGE: &str = "image";
/// Name of the boxes, `[vehicles, 4]`: corners in pixels, pixel (i, j) covering `i..i+1`, `j..j+1`.
pub const BOXES: &str = "boxes";
/// Name of the scores, `[vehicles]`.
pub const SCORES: &str = "scores";
/// Name of the part probabilities, `[vehicles, 30, m, m]`, background first.
pub const PARTS: &str = "part_probabilities";
/// Name of the probabilities of zoo models, `[vehicles, models]`, if the network has that head.
pub const MODELS: &str = "model_probabilities";
/// Name of width, height and length in metres, `[vehicles, 3]`, if the network has that head.
pub const EXTENTS: &str = "extents";
/// Name of the standard deviations of their logarithms, `[vehicles, 3]`.
pub const EXTENT_SIGMAS: &str = "extent_sigma";

/// Why a network cannot be exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OnnxError {
    /// Statistics of groups would have to be taken anew in every image.
    #[error("group normalisation has no operator in the operator set that is written")]
    GroupNorm,
}

/// The bytes of an ONNX model that does what the network does.
///
/// `size` fixes width and height of the input, which some runtimes need; without it the model takes images of any size.
pub fn export(net: &MaskRcnn, size: Option<[usize; 2]>) -> Result<Vec<u8>, OnnxError> {
    let config = net.config();
    if config.norm == NormKind::Group || config.head_norm == HeadNorm::Group {
        return Err(OnnxError::GroupNorm);
    }
    let mut graph = Graph::new("partpose");
    network::add(&mut graph, net, size);
    let config = serde_json::to_string(config).expect("a configuration is plain data");
    Ok(graph.finish(&[(CONFIG_KEY, &config)]))
}
