//! A training on disk: weights, their average, what the optimiser remembers, the step, the configuration.
//!
//! Random numbers need no state of their own: each step's generator is seeded by the training's seed and the step. So a
//! training that goes on from a checkpoint comes to the same weights as one that was never cut off.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use partpose::files::{self, FileError};

use crate::optimizer::{Moments, Rule};
use crate::training::TrainConfig;
use crate::weights::{self, Precision, Values, WeightsError};

const STEP_KEY: &str = "partpose.step";
const CONFIG_KEY: &str = "partpose.train";
const BEGINNING: &str = "checkpoint-";
const ENDING: &str = ".safetensors";

/// Where a training stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Steps done.
    pub step: u64,
    /// What is trained, and how.
    pub config: TrainConfig,
    /// Parameters and running statistics in the network's order.
    pub weights: Vec<Values>,
    /// Their average over steps.
    pub average: Vec<Values>,
    /// What the optimiser remembers.
    pub moments: Moments,
}

/// Writes a checkpoint into a run's folder and removes all but the last `keep`.
pub fn save(folder: &Path, checkpoint: &Checkpoint, keep: usize) -> Result<PathBuf, WeightsError> {
    let mut tensors = Vec::new();
    let named = |kind: &str, name: &str, shape: &[usize], values: &[f32]| Values {
        name: format!("{kind}/{name}"),
        shape: shape.to_vec(),
        values: values.to_vec(),
    };
    for (i, tensor) in checkpoint.weights.iter().enumerate() {
        let mut add = |kind: &str, values: &[f32]| {
            tensors.push(named(kind, &tensor.name, &tensor.shape, values));
        };
        add("weights", &tensor.values);
        add("average", &checkpoint.average[i].values);
        add("first", &checkpoint.moments.first[i]);
        if let Some(second) = checkpoint.moments.second.get(i) {
            add("second", second);
        }
    }
    let config = serde_json::to_string(&checkpoint.config).expect("a configuration is plain data");
    let metadata = BTreeMap::from([
        (STEP_KEY.to_owned(), checkpoint.step.to_string()),
        (CONFIG_KEY.to_owned(), config),
    ]);
    let path = folder.join(format!("{BEGINNING}{:08}{ENDING}", checkpoint.step));
    files::write(&path, &weights::encode_with(&tensors, &metadata, Precision::Single))?;
    let all = list(folder)?;
    for old in &all[..all.len().saturating_sub(keep)] {
        std::fs::remove_file(old).map_err(|source| FileError::write(old, source))?;
    }
    Ok(path)
}

/// The checkpoints of a run, oldest first.
pub fn list(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(source) => return Err(FileError::read(folder, source)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(|source| FileError::read(folder, source))?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
        let is_one = |name: &String| name.starts_with(BEGINNING) && name.ends_with(ENDING);
        if name.as_ref().is_some_and(is_one) {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// Reads a checkpoint.
pub fn load(path: &Path) -> Result<Checkpoint, WeightsError> {
    let (metadata, mut tensors) = weights::decode(path, &files::read(path)?)?;
    let none = || WeightsError::NoConfig { path: path.to_owned() };
    let text = metadata.get(CONFIG_KEY).ok_or_else(none)?;
    let config: TrainConfig = serde_json::from_str(text)
        .map_err(|source| WeightsError::BadConfig { path: path.to_owned(), source })?;
    let step = metadata.get(STEP_KEY).and_then(|step| step.parse().ok()).ok_or_else(none)?;
    // The order is that of a network of this configuration.
    let net = config.net.init(&burn::tensor::Device::flex(), 0);
    let mut take = |kind: &str, own: &Values| {
        let name = format!("{kind}/{}", own.name);
        let found = tensors.remove(&name).ok_or_else(|| WeightsError::Missing {
            path: path.to_owned(),
            name: name.clone(),
            shape: own.shape.clone(),
        })?;
        if found.shape != own.shape {
            let (found, expected) = (found.shape, own.shape.clone());
            return Err(WeightsError::Shape { path: path.to_owned(), name, found, expected });
        }
        Ok(Values { name: own.name.clone(), ..found })
    };
    let [mut weights, mut average] = [Vec::new(), Vec::new()];
    let mut moments = Moments::default();
    for own in weights::read_out(&net) {
        weights.push(take("weights", &own)?);
        average.push(take("average", &own)?);
        moments.first.push(take("first", &own)?.values);
        if config.optimizer.kind == Rule::AdamW {
            moments.second.push(take("second", &own)?.values);
        }
    }
    Ok(Checkpoint { step, config, weights, average, moments })
}
