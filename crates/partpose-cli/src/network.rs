//! The first stage: weights looked up, images to detections.
//!
//! The weights that come with the program are part of it, put there by `build.rs` if `weights/partpose-r18.safetensors`
//! lies in the repository when it is built: a clone's `cargo run`, an installed binary and a copied one then behave
//! alike, and no search can find the wrong file. (A package on crates.io may not be so large; whoever builds from one
//! gives `--weights`.)

use std::path::{Path, PathBuf};

use burn::tensor::Device;
use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose_net::detector::Detector;
use partpose_net::weights;

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
    /// A hash of the weights, which tells networks of one name apart.
    pub(crate) identity: String,
    kernel: usize,
    detector: Detector,
}

impl Network {
    /// The weights of a file, or those that come with the program.
    pub(crate) fn load(weights: Option<&Path>) -> anyhow::Result<Self> {
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
        let net = weights::from_bytes(&path, bytes, &Device::default())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let identity = format!("{name}, {:016x}", hash(bytes));
        let kernel = net.config().parts.kernel;
        Ok(Self { name, identity, kernel, detector: Detector::new(&net) })
    }

    /// Cells a side of the kernels.
    pub(crate) fn kernel(&self) -> usize {
        self.kernel
    }

    /// The vehicles of an image, best first.
    pub(crate) fn detect(&self, image: &RgbImage) -> anyhow::Result<Vec<Detection>> {
        Ok(self.detector.detect(image)?)
    }
}

/// FNV-1a of eight bytes at a time: fixed, and fast enough for 30 MB.
fn hash(bytes: &[u8]) -> u64 {
    let step = |hash: u64, chunk: &[u8]| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        (hash ^ u64::from_le_bytes(word)).wrapping_mul(0x0100_0000_01b3)
    };
    bytes.chunks(8).fold(0xcbf2_9ce4_8422_2325, step)
}
