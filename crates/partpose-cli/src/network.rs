//! The first stage: weights looked up, images to detections.

use std::path::{Path, PathBuf};

use partpose::detection::Detection;
use partpose::files::RgbImage;
use partpose::geometry::Extent;

use crate::report::hint;

/// A network that is ready to look at images.
pub(crate) struct Network {
    /// What its weights are called.
    pub(crate) name: String,
}

/// A vehicle that was found.
pub(crate) struct Found {
    pub(crate) detection: Detection,
    /// Its size, where the network says it.
    pub(crate) extent: Option<Extent>,
}

impl Network {
    /// The weights of a file, or those that come with the program.
    pub(crate) fn load(weights: Option<&Path>) -> anyhow::Result<Self> {
        let path: PathBuf = weights.map_or_else(PathBuf::new, Path::to_owned);
        Err(hint(
            anyhow::anyhow!("there are no weights `{}`", path.display()),
            "give `--weights FILE`, or detections as `--detections FILE`",
        ))
    }

    /// Cells a side of the kernels.
    #[expect(clippy::unused_self, reason = "the network is to come")]
    pub(crate) fn kernel(&self) -> usize {
        28
    }

    /// The vehicles of an image, best first.
    #[expect(clippy::unused_self, clippy::unnecessary_wraps, reason = "the network is to come")]
    pub(crate) fn detect(&self, _image: &RgbImage) -> anyhow::Result<Vec<Found>> {
        Ok(Vec::new())
    }
}
