//! A network's weights as named values: read out, put in, saved as safetensors, loaded.
//!
//! Names are paths in the network (`backbone.layer1.0.conv1.weight`), which in the backbone are torchvision's. A file holds
//! the configuration in its metadata, so that whoever loads it needs nothing else. Single and half precision load alike.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use burn::Tensor;
use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, TensorData};
use partpose::files::{self, FileError};
use partpose::formats::safetensors_bytes;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};

use crate::config::NetConfig;
use crate::mask_rcnn::MaskRcnn;

/// Key of the configuration in the metadata.
pub(crate) const CONFIG_KEY: &str = "partpose.net";

/// Why weights could not be read or do not fit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// The file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a safetensors file.
    #[error("`{path}` is not a safetensors file")]
    Format {
        /// The file.
        path: PathBuf,
        /// What its reader says.
        source: safetensors::SafeTensorError,
    },
    /// The file does not say which network it is for.
    #[error("`{path}` holds no configuration of a network")]
    NoConfig {
        /// The file.
        path: PathBuf,
    },
    /// The file's configuration is not one.
    #[error("the configuration in `{path}` cannot be read")]
    BadConfig {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: serde_json::Error,
    },
    /// A tensor of the network is not in the file.
    #[error("`{path}` has no tensor `{name}` {shape:?}")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Its shape in the network.
        shape: Vec<usize>,
    },
    /// A tensor has another shape than the network's.
    #[error("`{path}`: tensor `{name}` is {found:?}, but the network's is {expected:?}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// Its shape in the file.
        found: Vec<usize>,
        /// Its shape in the network.
        expected: Vec<usize>,
    },
    /// A tensor holds something else than floats.
    #[error(
        "`{path}`: tensor `{name}` is of type {found:?}, but 32-bit or 16-bit floats are needed"
    )]
    Type {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
        /// What it holds.
        found: Dtype,
    },
    /// A tensor holds infinite values or none at all.
    #[error("`{path}`: tensor `{name}` has a value that is no finite number")]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// The tensor.
        name: String,
    },
}

/// A named tensor on the host.
#[derive(Clone, Debug, PartialEq)]
pub struct Values {
    /// Path in the network.
    pub name: String,
    /// Its axes.
    pub shape: Vec<usize>,
    /// Row by row.
    pub values: Vec<f32>,
}

/// How finely values are saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits.
    Single,
    /// 16 bits (IEEE 754 binary16), rounded to nearest.
    Half,
}

/// All parameters and running statistics in the order of the network.
pub fn read_out(net: &MaskRcnn) -> Vec<Values> {
    struct Reader {
        path: Vec<String>,
        found: Vec<Values>,
    }
    impl ModuleVisitor for Reader {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            let tensor = param.val();
            let shape = tensor.dims().to_vec();
            let values = crate::layers::to_host(tensor);
            self.found.push(Values { name: self.path.join("."), shape, values });
        }

        fn enter_module(&mut self, name: &str, _: &str) {
            self.path.push(name.to_owned());
        }

        fn exit_module(&mut self, _: &str, _: &str) {
            self.path.pop();
        }
    }
    let mut reader = Reader { path: Vec::new(), found: Vec::new() };
    // The copy for validation has the newest running statistics; the network itself may lag by one update.
    net.valid().visit(&mut reader);
    reader.found
}

/// The network with other values: `values(i)` gives those of the i-th tensor of [`read_out`], or `None` to keep them.
///
/// # Panics
///
/// If a count of values is wrong: a bug of the caller.
#[must_use]
pub fn put_in<'a>(net: MaskRcnn, values: impl Fn(usize) -> Option<&'a [f32]>) -> MaskRcnn {
    struct Writer<F> {
        next: usize,
        values: F,
    }
    impl<'a, F: Fn(usize) -> Option<&'a [f32]>> ModuleMapper for Writer<F> {
        fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
            let index = self.next;
            self.next += 1;
            let Some(values) = (self.values)(index) else { return param };
            param.map(|old| {
                let shape = old.dims();
                assert_eq!(shape.iter().product::<usize>(), values.len(), "tensor {index}");
                let data = TensorData::new(values.to_vec(), shape);
                let tensor = Tensor::from_data(data, &old.device());
                tensor.set_require_grad(old.is_require_grad())
            })
        }
    }
    // Pending updates of the statistics would come after the new values.
    drop(net.valid());
    net.map(&mut Writer { next: 0, values })
}

/// The bytes of a safetensors file with a network's configuration.
pub fn encode(tensors: &[Values], config: &NetConfig, precision: Precision) -> Vec<u8> {
    let text = serde_json::to_string(config).expect("a configuration is plain data");
    encode_with(tensors, &BTreeMap::from([(CONFIG_KEY.to_owned(), text)]), precision)
}

pub(crate) fn encode_with(
    tensors: &[Values],
    metadata: &BTreeMap<String, String>,
    precision: Precision,
) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> = tensors
        .iter()
        .map(|tensor| match precision {
            Precision::Single => tensor.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
            Precision::Half => {
                tensor.values.iter().flat_map(|v| half_from_single(*v).to_le_bytes()).collect()
            }
        })
        .collect();
    let dtype = match precision {
        Precision::Single => Dtype::F32,
        Precision::Half => Dtype::F16,
    };
    let views = tensors.iter().zip(&bytes).map(|(tensor, bytes)| {
        let view = TensorView::new(dtype, tensor.shape.clone(), bytes);
        (tensor.name.as_str(), view.expect("as many values as the shape says"))
    });
    safetensors_bytes(views, metadata).expect("names are unique")
}

/// Saves a network for use: parameters, running statistics, configuration.
pub fn save(path: &Path, net: &MaskRcnn, precision: Precision) -> Result<(), WeightsError> {
    Ok(files::write(path, &encode(&read_out(net), net.config(), precision))?)
}

/// A network out of a file that [`save`] or a training wrote.
///
/// `device` decides where it runs, and with gradients (`Device::autodiff`) that it can be trained on.
pub fn load(path: &Path, device: &Device) -> Result<MaskRcnn, WeightsError> {
    from_bytes(path, &files::read(path)?, device)
}

/// The same from a file's bytes; `path` names it in errors.
pub fn from_bytes(path: &Path, bytes: &[u8], device: &Device) -> Result<MaskRcnn, WeightsError> {
    let (metadata, tensors) = decode(path, bytes)?;
    let text =
        metadata.get(CONFIG_KEY).ok_or_else(|| WeightsError::NoConfig { path: path.to_owned() })?;
    let config: NetConfig = serde_json::from_str(text)
        .map_err(|source| WeightsError::BadConfig { path: path.to_owned(), source })?;
    let net = config.init(device, 0);
    fit(path, net, &tensors)
}

/// The network with a file's values; every tensor must be there and fit.
pub(crate) fn fit(
    path: &Path,
    net: MaskRcnn,
    tensors: &HashMap<String, Values>,
) -> Result<MaskRcnn, WeightsError> {
    let mut chosen = Vec::new();
    for own in read_out(&net) {
        let found = tensors.get(&own.name).ok_or_else(|| WeightsError::Missing {
            path: path.to_owned(),
            name: own.name.clone(),
            shape: own.shape.clone(),
        })?;
        if found.shape != own.shape {
            return Err(WeightsError::Shape {
                path: path.to_owned(),
                name: own.name,
                found: found.shape.clone(),
                expected: own.shape,
            });
        }
        if !found.values.iter().all(|value| value.is_finite()) {
            return Err(WeightsError::NotFinite { path: path.to_owned(), name: own.name });
        }
        chosen.push(found);
    }
    Ok(put_in(net, |i| Some(&chosen[i].values)))
}

/// Metadata and tensors of a safetensors file.
pub(crate) fn decode(
    path: &Path,
    bytes: &[u8],
) -> Result<(HashMap<String, String>, HashMap<String, Values>), WeightsError> {
    let failed = |source| WeightsError::Format { path: path.to_owned(), source };
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(failed)?;
    let metadata = header.metadata().clone().unwrap_or_default();
    let file = SafeTensors::deserialize(bytes).map_err(failed)?;
    let mut tensors = HashMap::new();
    for (name, view) in file.iter() {
        let pairs = || view.data().chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
        let values = match view.dtype() {
            Dtype::F32 => {
                let four = view.data().chunks_exact(4);
                four.map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
            }
            Dtype::F16 => pairs().map(single_from_half).collect(),
            Dtype::BF16 => pairs().map(|bits| f32::from_bits(u32::from(bits) << 16)).collect(),
            // Counters of batches and the like are of no use here.
            Dtype::I64 | Dtype::I32 | Dtype::U8 | Dtype::BOOL => continue,
            found => {
                let (path, name) = (path.to_owned(), name.to_owned());
                return Err(WeightsError::Type { path, name, found });
            }
        };
        let shape = view.shape().to_vec();
        tensors.insert(name.to_owned(), Values { name: name.to_owned(), shape, values });
    }
    Ok((metadata, tensors))
}

/// The nearest 16-bit float; what is too large becomes the largest finite one.
fn half_from_single(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = (bits >> 16 & 0x8000) as u16;
    if value.is_nan() {
        return sign | 0x7e00;
    }
    let magnitude = value.abs().min(65_504.0);
    // Below 2^-14 steps are 2^-24 wide.
    if magnitude < 6.103_515_6e-5 {
        return sign | (magnitude * 16_777_216.0).round_ties_even() as u16;
    }
    let bits = magnitude.to_bits();
    let kept = bits >> 13;
    let rest = bits & 0x1fff;
    let up = u32::from(rest > 0x1000 || (rest == 0x1000 && kept & 1 == 1));
    sign | (kept + up - (112 << 10)) as u16
}

fn single_from_half(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let fraction = f32::from(bits & 0x3ff);
    sign * match bits >> 10 & 0x1f {
        0 => fraction / 16_777_216.0,
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        exponent => (1.0 + fraction / 1024.0) * f32::from(exponent).exp2() / 32_768.0,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::config::{Backbone, Neck};

    /// A network that is made and run in no time.
    pub(crate) fn tiny() -> NetConfig {
        let mut config = NetConfig {
            backbone: Backbone::Resnet18,
            neck: Neck::Fpn { channels: 32, finest: 3, coarsest: 6 },
            ..NetConfig::default()
        };
        config.rpn.channels = 32;
        config.boxes.width = 32;
        config.parts.channels = 32;
        config.parts.convs = 1;
        config
    }

    #[test]
    fn half_precision_rounds_to_nearest_and_comes_back() {
        let cases = [(0.0, 0), (-2.0, 0xc000), (1.0, 0x3c00), (65_504.0, 0x7bff), (1e9, 0x7bff)];
        for (value, bits) in cases {
            assert_eq!(half_from_single(value), bits, "{value}");
        }
        for bits in (0..0x7c00).chain(0x8001..0xfc00) {
            assert_eq!(half_from_single(single_from_half(bits)), bits);
        }
        let between = f32::midpoint(single_from_half(0x3c00), single_from_half(0x3c01));
        assert_eq!([between, between + 1e-6].map(half_from_single), [0x3c00, 0x3c01]);
    }

    #[test]
    fn weights_survive_a_file_and_wrong_ones_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("w.safetensors");
        let device = Device::flex();
        let net = tiny().init(&device, 5);
        save(&path, &net, Precision::Single).unwrap();
        let back = load(&path, &device).unwrap();
        assert_eq!(read_out(&back), read_out(&net));
        assert_eq!(back.config(), net.config());
        save(&path, &net, Precision::Half).unwrap();
        let half = load(&path, &device).unwrap();
        for (half, whole) in read_out(&half).iter().zip(read_out(&net)) {
            let near = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-3 * b.abs() + 1e-7;
            assert!(half.values.iter().zip(&whole.values).all(near), "{}", half.name);
        }
        let mut other = tiny();
        other.boxes.width = 16;
        let bytes = encode(&read_out(&net), &other, Precision::Half);
        let error = from_bytes(&path, &bytes, &device).unwrap_err().to_string();
        assert!(error.contains("box_head") && error.contains("but the network's is"), "{error}");
        let error = from_bytes(&path, b"nonsense", &device).unwrap_err().to_string();
        assert!(error.ends_with("is not a safetensors file"), "{error}");
    }

    #[test]
    fn names_are_torchvisions() {
        let names: Vec<String> =
            read_out(&tiny().init(&Device::flex(), 1)).into_iter().map(|v| v.name).collect();
        for name in [
            "backbone.layer1.0.conv1.weight",
            "backbone.layer2.0.downsample.1.running_var",
            "fpn.inner_blocks.0.0.weight",
        ] {
            assert!(names.iter().any(|own| own == name), "{name} is not in {names:?}");
        }
    }
}
