//! The first stage: weights looked up, images to detections, by our own engine or by ONNX Runtime.
//!
//! The weights that come with the program are part of it, put there by `build.rs` if `weights/partpose-r18.safetensors`
//! lies in the repository when it is built: a clone's `cargo run`, an installed binary and a copied one then behave
//! alike, and no search can find the wrong file. (A package on crates.io may not be so large; whoever builds from one
//! gives `--weights`.)

#[cfg(feature = "onnx")]
pub(crate) mod onnx;

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use clap::ValueEnum;
use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose_net::detector::Detector;
use partpose_net::{MaskRcnn, weights};

use crate::device::{DeviceFlag, parse_device};
use crate::report::hint;

/// Name of the file in the repository's `weights`.
const SHIPPED_NAME: &str = "partpose-r18.safetensors";

#[cfg(shipped_weights)]
const SHIPPED: Option<&[u8]> = Some(include_bytes!(env!("PARTPOSE_WEIGHTS")));
#[cfg(not(shipped_weights))]
const SHIPPED: Option<&[u8]> = None;

/// A network that is ready to look at images.
pub(crate) struct Network {
    /// What its weights are called in tables.
    pub(crate) name: String,
    /// A hash of the weights, which tells networks of one name apart, and what runs them unless it is our own engine on
    /// processors: others find the same, but not to the last digit.
    pub(crate) identity: String,
    kernel: usize,
    detector: AnyDetector,
}

enum AnyDetector {
    Own(Box<Detector>),
    #[cfg(feature = "onnx")]
    Onnx(Box<partpose_onnx::OnnxDetector>),
}

/// What runs the first stage.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct EngineFlags {
    /// What runs the network
    #[arg(long, value_enum, default_value = "own")]
    engine: Engine,
    /// A detector of your own as an ONNX file, in place of the network; ONNX Runtime runs it
    #[arg(long, value_name = "FILE", conflicts_with = "weights")]
    onnx_model: Option<PathBuf>,
    /// TOML file that says what the model of `--onnx-model` takes and puts out; that of `export onnx` if not given
    #[arg(long, value_name = "MAP", requires = "onnx_model")]
    mapping: Option<PathBuf>,
    /// ONNX Runtime's library; else the one that `ORT_DYLIB_PATH` names, else the system's or that of `pip install
    /// onnxruntime`
    #[arg(long, value_name = "FILE")]
    onnxruntime: Option<PathBuf>,
    /// Where our own engine computes: `cpu`, and `cuda`, `cuda:1`, `wgpu`, ... if the program was built with that feature
    #[arg(long, default_value = "cpu", value_name = "DEVICE", value_parser = parse_device)]
    device: DeviceFlag,
}

impl EngineFlags {
    /// Whether a detector of one's own is given.
    pub(crate) fn has_model(&self) -> bool {
        self.onnx_model.is_some()
    }

    /// Whether all images go through one device that is not the processors.
    pub(crate) fn shares_device(&self) -> bool {
        self.engine == Engine::Own && self.onnx_model.is_none() && !self.device.is_processor()
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// Ours
    #[default]
    Own,
    /// ONNX Runtime, with the network as `export onnx` writes it
    Onnx,
}

impl Network {
    /// The network with the weights of a file, or with those that come with the program; or the detector of an ONNX file.
    pub(crate) fn load(weights: Option<&Path>, flags: &EngineFlags) -> anyhow::Result<Self> {
        if let Some(model) = &flags.onnx_model {
            return Self::of_model(model, flags);
        }
        let (net, name, mut identity) = load_weights(weights, &flags.device.device)?;
        if flags.shares_device() {
            identity = format!("{identity}, {}", flags.device.kind);
        }
        let kernel = net.config().parts.kernel;
        let detector = match flags.engine {
            Engine::Own => AnyDetector::Own(Box::new(Detector::new(&net))),
            Engine::Onnx => return Self::of_export(&net, (name, identity), flags),
        };
        Ok(Self { name, identity, kernel, detector })
    }

    /// Cells a side of the kernels.
    pub(crate) fn kernel(&self) -> usize {
        self.kernel
    }

    /// The vehicles of an image, best first.
    pub(crate) fn detect(&self, image: &RgbImage) -> anyhow::Result<Vec<Detection>> {
        match &self.detector {
            AnyDetector::Own(detector) => Ok(detector.detect(image)?),
            #[cfg(feature = "onnx")]
            AnyDetector::Onnx(detector) => Ok(detector.detect(image)?),
        }
    }

    #[cfg(not(feature = "onnx"))]
    fn of_model(_: &Path, _: &EngineFlags) -> anyhow::Result<Self> {
        Err(without_onnx())
    }

    #[cfg(not(feature = "onnx"))]
    fn of_export(_: &MaskRcnn, _: (String, String), _: &EngineFlags) -> anyhow::Result<Self> {
        Err(without_onnx())
    }
}

#[cfg(not(feature = "onnx"))]
fn without_onnx() -> anyhow::Error {
    hint(
        anyhow::anyhow!("this program was built without ONNX Runtime"),
        "build it with the feature `onnx`, which is on by default",
    )
}

/// A network with the weights of a file, or those that come with the program; what they are called, and a name that tells
/// them apart.
pub(crate) fn load_weights(
    weights: Option<&Path>,
    device: &Device,
) -> anyhow::Result<(MaskRcnn, String, String)> {
    let (path, read);
    let bytes: &[u8] = match (weights, SHIPPED) {
        (Some(given), _) => {
            path = given.to_owned();
            read = files::read(given)?;
            &read
        }
        (None, Some(shipped)) => {
            path = PathBuf::from(SHIPPED_NAME);
            shipped
        }
        (None, None) => {
            return Err(hint(
                anyhow::anyhow!("this program was built without weights"),
                format!(
                    "give `--weights FILE`, or build it from a clone that has `weights/{SHIPPED_NAME}`; \
                         `partpose train` trains a network"
                ),
            ));
        }
    };
    let net = weights::from_bytes(&path, bytes, device)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let identity = format!("{name}, {:016x}", hash(bytes));
    Ok((net, name, identity))
}

/// FNV-1a of eight bytes at a time: fixed, and fast enough for 30 MB.
pub(crate) fn hash(bytes: &[u8]) -> u64 {
    let step = |hash: u64, chunk: &[u8]| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        (hash ^ u64::from_le_bytes(word)).wrapping_mul(0x0100_0000_01b3)
    };
    bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, step)
}
