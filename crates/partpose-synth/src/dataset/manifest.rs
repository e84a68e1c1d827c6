//! The record of what a folder holds, so that runs are neither mixed nor lost.

use std::fs;
use std::io;
use std::path::Path;

use partpose::files::{self, FileError};
use partpose::vehicle::{ModelZoo, to_glb};
use serde_json::{Map, Value, json};

use super::{SynthError, SynthOptions};

/// Name of the record in the folder of a data set.
pub const MANIFEST: &str = "synth.json";

/// Makes the folder one's own: a new or empty one, or with `resume` one that was begun with the same options.
pub(super) fn claim(out: &Path, options: &SynthOptions, zoo: &ModelZoo) -> Result<(), SynthError> {
    files::create_folder(out)?;
    let path = out.join(MANIFEST);
    let asked = describe(options, zoo);
    if path.is_file() {
        if !options.resume {
            return Err(SynthError::Exists { path: out.to_owned() });
        }
        let begun: Map<String, Value> = serde_json::from_slice(&files::read(&path)?)
            .map_err(|source| SynthError::Manifest { path: path.clone(), source })?;
        return same(out, &begun, &asked);
    }
    if let Some(found) = first_entry(out)? {
        return Err(SynthError::Foreign { path: out.to_owned(), found });
    }
    let text = serde_json::to_string_pretty(&asked).unwrap_or_default() + "\n";
    files::write(&path, text.as_bytes())?;
    Ok(())
}

/// Everything that the bytes of the data set depend on.
fn describe(options: &SynthOptions, zoo: &ModelZoo) -> Map<String, Value> {
    let names = |list: &mut Vec<String>| {
        list.sort();
        list.dedup();
        list.join(",")
    };
    let mut scenes: Vec<String> = options.scenes.iter().map(ToString::to_string).collect();
    let mut variations: Vec<String> = options.variations.iter().map(ToString::to_string).collect();
    let models: Vec<Value> = zoo
        .models
        .iter()
        .map(|model| json!(format!("{} {:016x}", model.name(), fingerprint(&to_glb(model)))))
        .collect();
    let camera = &options.camera;
    let fields = [
        ("version", json!(env!("CARGO_PKG_VERSION"))),
        ("seed", json!(options.seed)),
        ("frames", json!(options.frames)),
        ("interval", json!(options.interval)),
        ("scenes", json!(names(&mut scenes))),
        ("worlds", json!(options.worlds)),
        ("variations", json!(names(&mut variations))),
        ("camera", json!(camera.camera)),
        ("camera_height", json!(camera.height)),
        ("camera_pitch", json!(camera.pitch)),
        ("camera_roll", json!(camera.roll)),
        ("camera_spread", json!(camera.spread)),
        ("effects", json!(options.effects)),
        ("anti_aliasing", json!(options.render.anti_aliasing)),
        ("shadows", json!(options.render.shadows)),
        ("layout", json!(options.layout.as_ref().map(|path| path.display().to_string()))),
        ("models", Value::Array(models)),
    ];
    fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn same(
    out: &Path,
    begun: &Map<String, Value>,
    asked: &Map<String, Value>,
) -> Result<(), SynthError> {
    let missing = Value::Null;
    for (field, value) in asked {
        let before = begun.get(field).unwrap_or(&missing);
        // Through text, since a number may come back as another kind of number.
        if before.to_string() != value.to_string() {
            return Err(SynthError::OtherOptions {
                path: out.to_owned(),
                field: field.clone(),
                begun: before.to_string(),
                asked: value.to_string(),
            });
        }
    }
    Ok(())
}

/// The first name in a folder, sorted.
fn first_entry(folder: &Path) -> Result<Option<String>, FileError> {
    let failed = |source: io::Error| FileError::read(folder, source);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        names.push(entry.map_err(failed)?.file_name().to_string_lossy().into_owned());
    }
    Ok(names.into_iter().min())
}

/// FNV-1a, enough to notice that models are others.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
