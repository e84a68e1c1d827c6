//! The settings of a run, by which another one knows whether it may go on where this one stopped.

use std::path::Path;

use serde_json::{Map, Value, json};

use crate::dataset::folds::Folds;
use crate::dataset::{Dataset, SequenceId};
use crate::files;
use crate::vehicle::{ModelZoo, to_glb};

use super::{LabelError, LabelJob, LabelStore};

/// Everything that the labels depend on besides the data set's files.
pub(super) fn settings(dataset: &Dataset, job: &LabelJob) -> Map<String, Value> {
    let names: Vec<String> = job.sequences.iter().map(SequenceId::to_string).collect();
    let zoos: Vec<Value> = job.zoos.zoos.iter().map(zoo_settings).collect();
    let settings = json!({
        "format": "partpose labels 1",
        "version": env!("CARGO_PKG_VERSION"),
        "layout": dataset.layout().to_string(),
        "sequences": names,
        "stride": job.stride,
        "models": job.options.models,
        "categories": job.options.categories,
        "dont_care": job.options.dont_care,
        "folds": job.zoos.folds.map(Folds::count),
        "zoos": zoos,
    });
    match settings {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

fn zoo_settings(zoo: &ModelZoo) -> Value {
    let models = zoo.models.iter().map(|model| {
        let bytes = to_glb(model);
        (model.name().to_owned(), Value::String(format!("{:016x}", fingerprint(&bytes))))
    });
    Value::Object(models.collect())
}

/// FNV-1a of 64 bits: tells versions of a model apart, and is no protection against forgery.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

/// Makes the folder this run's, or finds that it may go on in it.
pub(super) fn claim(
    store: &LabelStore,
    settings: &Map<String, Value>,
    may_resume: bool,
) -> Result<(), LabelError> {
    files::create_folder(store.root())?;
    let path = store.manifest();
    if path.exists() {
        let there: Option<Map<String, Value>> = serde_json::from_slice(&files::read(&path)?).ok();
        let Some(there) = there else {
            let reason = "it is not the record of a run".to_owned();
            return Err(LabelError::Damaged { path, reason });
        };
        let differences = differences(&there, settings);
        if !differences.is_empty() {
            return Err(LabelError::OtherRun { path: store.root().to_owned(), differences });
        }
        if !may_resume {
            return Err(LabelError::Occupied { path: store.root().to_owned() });
        }
        return Ok(());
    }
    if !is_empty(store.root())? {
        return Err(LabelError::Occupied { path: store.root().to_owned() });
    }
    let mut text = serde_json::to_string_pretty(settings).unwrap_or_default();
    text.push('\n');
    Ok(files::write(&path, text.as_bytes())?)
}

/// Whether a folder holds nothing but temporary files, which another shard may be writing.
fn is_empty(folder: &Path) -> Result<bool, files::FileError> {
    let failed = |source| files::FileError::read(folder, source);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        if !name.to_string_lossy().starts_with(".tmp") {
            return Ok(false);
        }
    }
    Ok(true)
}

fn differences(there: &Map<String, Value>, here: &Map<String, Value>) -> Vec<String> {
    let mut keys: Vec<&String> = there.keys().chain(here.keys()).collect();
    keys.sort();
    keys.dedup();
    let shown = |value: Option<&Value>| {
        let text = value.map_or("nothing".to_owned(), Value::to_string);
        if text.chars().count() > 80 {
            text.chars().take(77).chain("...".chars()).collect()
        } else {
            text
        }
    };
    keys.into_iter()
        .filter(|key| there.get(*key) != here.get(*key))
        .map(|key| {
            let (was, is) = (shown(there.get(key)), shown(here.get(key)));
            if was == is {
                return format!("`{key}` is another");
            }
            format!("`{key}` was {was} and is now {is}")
        })
        .collect()
}
