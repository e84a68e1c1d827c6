//! Initial weights from others: torchvision's `ResNets`, Faster R-CNN and Mask R-CNN, as `.safetensors` or `PyTorch` files.
//!
//! Names are translated; a tensor is taken if ours of that name has its shape. What is left over is listed with the reason,
//! so that nobody trains from random weights unawares.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use burn::store::pytorch::{PytorchError, PytorchReader};
use burn::store::pytorch_reader::DType;
use partpose::files;

use crate::config::Neck;
use crate::mask_rcnn::MaskRcnn;
use crate::weights::{self, Values, WeightsError};

/// Why a file could not be imported at all.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A safetensors file that cannot be read.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// A `PyTorch` file that cannot be read.
    #[error("cannot read `{path}` as a PyTorch file")]
    Pytorch {
        /// The file.
        path: PathBuf,
        /// What its reader says.
        source: PytorchError,
    },
    /// A tensor's bytes cannot be read.
    #[error("cannot read tensor `{name}` of `{path}`")]
    Tensor {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// What its reader says.
        source: std::io::Error,
    },
}

/// A tensor of the file, or of ours, that was not taken.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Refused {
    /// The network has no such tensor.
    Unknown { name: String, shape: Vec<usize> },
    /// The network's has another shape.
    Shape { name: String, shape: Vec<usize>, own: String, expected: Vec<usize> },
    /// The network's is not in the file and stays random.
    Absent { own: String, expected: Vec<usize> },
}

/// What came of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// All tensors of the network in its order: the file's where taken, else its own.
    pub weights: Vec<Values>,
    /// Names of ours that were taken.
    pub taken: Vec<String>,
    /// What was not.
    pub refused: Vec<Refused>,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown { name, shape } => {
                write!(f, "`{name}` {shape:?}: the network has no such tensor")
            }
            Self::Shape { name, shape, own, expected } => {
                write!(f, "`{name}` {shape:?}: the network's `{own}` is {expected:?}")
            }
            Self::Absent { own, expected } => {
                write!(f, "`{own}` {expected:?} is not in the file and stays random")
            }
        }
    }
}

/// The network's weights with what fits of a file.
pub fn import(path: &Path, net: &MaskRcnn) -> Result<Imported, ImportError> {
    let is_safetensors = path.extension().is_some_and(|ending| ending == "safetensors");
    let tensors = if is_safetensors {
        let bytes = files::read(path).map_err(WeightsError::from)?;
        weights::decode(path, &bytes)?.1
    } else {
        read_pytorch(path)?
    };
    Ok(fit(tensors, net))
}

#[allow(clippy::iter_over_hash_type, reason = "what is found becomes a map again")]
fn read_pytorch(path: &Path) -> Result<HashMap<String, Values>, ImportError> {
    // So that a missing file and one that is too large are told as everywhere.
    files::read(path).map_err(WeightsError::from)?;
    let failed = |source| ImportError::Pytorch { path: path.to_owned(), source };
    let reader = PytorchReader::new(path).map_err(failed)?;
    let mut found = HashMap::new();
    for (name, tensor) in reader.tensors() {
        // Counters of batches are of no use here.
        if tensor.dtype() != DType::F32 {
            continue;
        }
        let bytes = tensor.read().map_err(|source| {
            let (path, name) = (path.to_owned(), name.clone());
            ImportError::Tensor { path, name, source }
        })?;
        let four = bytes.chunks_exact(4);
        let values = four.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let (name, shape) = (name.clone(), tensor.shape().to_vec());
        found.insert(name.clone(), Values { name, shape, values });
    }
    Ok(found)
}

fn fit(tensors: HashMap<String, Values>, net: &MaskRcnn) -> Imported {
    let mut weights = weights::read_out(net);
    let places: HashMap<String, usize> =
        weights.iter().enumerate().map(|(i, tensor)| (tensor.name.clone(), i)).collect();
    let finest = match net.config().neck {
        Neck::Fpn { finest, .. } => finest,
        Neck::C4 { .. } => 2,
    };
    let mut sorted: Vec<Values> = tensors.into_values().collect();
    sorted.sort_by(|a, b| a.name.cmp(&b.name));
    let mut taken = Vec::new();
    let mut refused = Vec::new();
    let mut reasons = Vec::new();
    for tensor in sorted {
        let own = our_name(&tensor.name, finest);
        match places.get(&own) {
            Some(place) if weights[*place].shape == tensor.shape => {
                weights[*place].values = tensor.values;
                taken.push(*place);
            }
            Some(place) => {
                refused.push(*place);
                let (name, shape) = (tensor.name, tensor.shape);
                let expected = weights[*place].shape.clone();
                reasons.push(Refused::Shape { name, shape, own, expected });
            }
            None => reasons.push(Refused::Unknown { name: tensor.name, shape: tensor.shape }),
        }
    }
    for (i, tensor) in weights.iter().enumerate() {
        if !taken.contains(&i) && !refused.contains(&i) {
            let (own, expected) = (tensor.name.clone(), tensor.shape.clone());
            reasons.push(Refused::Absent { own, expected });
        }
    }
    taken.sort_unstable();
    let taken = taken.into_iter().map(|i| weights[i].name.clone()).collect();
    Imported { weights, taken, refused: reasons }
}

/// What training frameworks, and checkpoints that hold more than weights, put in front of names.
const WRAPPERS: [&str; 4] = ["module.", "model.", "state_dict.", "model_state_dict."];

/// What a tensor of torchvision is called here; `finest`: exponent of the pyramid's finest stride.
fn our_name(name: &str, finest: usize) -> String {
    let mut name = name;
    while let Some(rest) = WRAPPERS.iter().find_map(|wrapper| name.strip_prefix(wrapper)) {
        name = rest;
    }
    let stages = ["conv1.", "bn1.", "layer1.", "layer2.", "layer3.", "layer4."];
    if stages.iter().any(|stage| name.starts_with(stage)) {
        return format!("backbone.{name}");
    }
    for blocks in ["inner_blocks", "layer_blocks"] {
        let Some(rest) = name.strip_prefix(&format!("backbone.fpn.{blocks}.")) else { continue };
        let Some((level, rest)) = rest.split_once('.') else { continue };
        // Torchvision's first level has a stride of 4 pixels.
        let level = level.parse::<usize>().ok().and_then(|level| (level + 2).checked_sub(finest));
        return match level {
            // Older files lack the inner index.
            Some(level) if rest == "weight" || rest == "bias" => {
                format!("fpn.{blocks}.{level}.0.{rest}")
            }
            Some(level) => format!("fpn.{blocks}.{level}.{rest}"),
            None => name.to_owned(),
        };
    }
    for (theirs, ours) in [
        ("backbone.body.", "backbone."),
        ("rpn.head.conv.0.0.", "rpn.conv."),
        ("rpn.head.", "rpn."),
        ("roi_heads.box_head.", "box_head."),
        ("roi_heads.box_predictor.", "box_head."),
        ("roi_heads.mask_predictor.", "part_head."),
    ] {
        if let Some(rest) = name.strip_prefix(theirs) {
            return format!("{ours}{rest}");
        }
    }
    // Older files have `mask_fcn1.weight`, without a second dot.
    let layer = name.strip_prefix("roi_heads.mask_head.").and_then(|rest| rest.split_once('.'));
    if let Some((index, rest)) = layer {
        return format!("part_head.convs.{index}.{rest}");
    }
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::tests::tiny;
    use crate::weights::{Precision, encode_with};
    use burn::tensor::Device;
    use std::collections::BTreeMap;

    #[test]
    fn torchvisions_names_are_known() {
        for (theirs, ours) in [
            ("layer1.0.conv1.weight", "backbone.layer1.0.conv1.weight"),
            ("module.bn1.running_mean", "backbone.bn1.running_mean"),
            ("model.module.bn1.running_mean", "backbone.bn1.running_mean"),
            ("backbone.body.layer4.1.bn2.bias", "backbone.layer4.1.bn2.bias"),
            ("backbone.fpn.inner_blocks.1.0.weight", "fpn.inner_blocks.0.0.weight"),
            ("backbone.fpn.layer_blocks.3.weight", "fpn.layer_blocks.2.0.weight"),
            ("rpn.head.conv.0.0.weight", "rpn.conv.weight"),
            ("rpn.head.cls_logits.bias", "rpn.cls_logits.bias"),
            ("roi_heads.box_head.fc6.weight", "box_head.fc6.weight"),
            ("roi_heads.box_predictor.bbox_pred.weight", "box_head.bbox_pred.weight"),
            ("roi_heads.mask_head.2.0.weight", "part_head.convs.2.0.weight"),
            ("roi_heads.mask_predictor.conv5_mask.weight", "part_head.conv5_mask.weight"),
        ] {
            assert_eq!(our_name(theirs, 3), ours);
        }
    }

    #[test]
    fn what_fits_is_taken_and_the_rest_is_listed() {
        let net = tiny().init(&Device::flex(), 1);
        let tensor = |name: &str, shape: &[usize]| Values {
            name: name.to_owned(),
            shape: shape.to_vec(),
            values: vec![0.5; shape.iter().product()],
        };
        let tensors = [
            tensor("conv1.weight", &[64, 3, 7, 7]),
            tensor("layer1.0.conv1.weight", &[64, 64, 1, 1]),
            tensor("fc.weight", &[1000, 512]),
        ];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("resnet.safetensors");
        files::write(&path, &encode_with(&tensors, &BTreeMap::new(), Precision::Single)).unwrap();
        let imported = import(&path, &net).unwrap();
        assert_eq!(imported.taken, ["backbone.conv1.weight"]);
        let lines: Vec<String> = imported.refused.iter().map(ToString::to_string).collect();
        assert_eq!(lines[0], "`fc.weight` [1000, 512]: the network has no such tensor");
        assert_eq!(
            lines[1],
            "`layer1.0.conv1.weight` [64, 64, 1, 1]: the network's `backbone.layer1.0.conv1.weight` is [64, 64, 3, 3]"
        );
        assert!(lines[2..].iter().all(|line| line.ends_with("stays random")));
        assert_eq!(imported.weights.len(), 1 + 1 + lines.len() - 2);
        assert!(imported.weights[0].values.iter().all(|value| value.to_bits() == 0.5f32.to_bits()));
    }
}
