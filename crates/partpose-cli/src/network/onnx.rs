//! The first stage by ONNX Runtime: our network as it is exported, or anybody's model with a mapping.

use std::path::Path;

use anyhow::Context;
use partpose::files;
use partpose_net::config::NetConfig;
use partpose_net::{MaskRcnn, onnx};
use partpose_onnx::mapping::{PartsMapping, Resize};
use partpose_onnx::{Mapping, OnnxDetector, OnnxError};

use super::{AnyDetector, EngineFlags, Network, hash};
use crate::report::hint;

impl Network {
    /// The detector of an ONNX file.
    pub(super) fn of_model(model: &Path, flags: &EngineFlags) -> anyhow::Result<Self> {
        let mapping = match &flags.mapping {
            Some(path) => read_mapping(path)?,
            None => Mapping::default(),
        };
        let bytes = files::read(model)?;
        let name = model.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let words = toml::to_string(&mapping)?;
        let identity = format!("{name}, {:016x}, {:016x}", hash(&bytes), hash(words.as_bytes()));
        let kernel = match mapping.output.parts {
            PartsMapping::Boxes { .. } => 28,
            PartsMapping::Instances { kernel, .. } | PartsMapping::Image { kernel, .. } => kernel,
        };
        let detector = open(&bytes, mapping, flags)
            .with_context(|| format!("cannot use the model `{}`", model.display()))?;
        Ok(Self { name, identity, kernel, detector })
    }

    /// Our network, exported in memory.
    pub(super) fn of_export(
        net: &MaskRcnn,
        (name, identity): (String, String),
        flags: &EngineFlags,
    ) -> anyhow::Result<Self> {
        let detector = open(&onnx::export(net, None)?, mapping_of(net.config()), flags)?;
        let identity = format!("{identity}, onnx");
        Ok(Self { name, identity, kernel: net.config().parts.kernel, detector })
    }
}

/// What [`onnx::export`] writes takes and puts out.
pub(crate) fn mapping_of(config: &NetConfig) -> Mapping {
    let mut mapping = Mapping::default();
    onnx::IMAGE.clone_into(&mut mapping.input.name);
    let [shorter, longer] = [config.input.min_side, config.input.max_side];
    mapping.input.resize = Resize::Keep { shorter, longer };
    if config.extents {
        onnx::EXTENTS.clone_into(&mut mapping.output.extents);
        onnx::EXTENT_SIGMAS.clone_into(&mut mapping.output.extent_sigmas);
    }
    if !config.models.is_empty() {
        onnx::MODELS.clone_into(&mut mapping.output.models);
        mapping.models.clone_from(&config.models);
    }
    mapping
}

fn read_mapping(path: &Path) -> anyhow::Result<Mapping> {
    let text = files::read_text(path)?;
    let read = toml::from_str(&text)
        .with_context(|| format!("cannot read the mapping `{}`", path.display()));
    read.map_err(|error| hint(error, "docs/guide/5-detector.md tells what a mapping holds"))
}

fn open(bytes: &[u8], mapping: Mapping, flags: &EngineFlags) -> anyhow::Result<AnyDetector> {
    match OnnxDetector::new(bytes, mapping, flags.onnxruntime.as_deref()) {
        Ok(detector) => Ok(AnyDetector::Onnx(Box::new(detector))),
        Err(error @ (OnnxError::NoLibrary { .. } | OnnxError::Library { .. })) => Err(hint(
            error,
            "`pip install onnxruntime` brings it; `--onnxruntime FILE` or the variable ORT_DYLIB_PATH names it",
        )),
        Err(error) => Err(error.into()),
    }
}
