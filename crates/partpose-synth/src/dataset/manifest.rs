//! The record of what a folder holds, so that runs are neither mixed nor lost.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use partpose::files::{self, FileError};
use partpose::vehicle::{ModelZoo, to_glb};
use serde_json::{Map, Value, json};

use super::{SynthError, SynthOptions};

/// Name of the record in the folder of a data set.
pub const MANIFEST: &str = "synth.json";

/// How deep files lie below the folder of a data set: archive, world, variation.
const DEPTH: usize = 3;

/// Makes the folder one's own: a new or empty one, or with `resume` one that was begun with the same options.
pub(super) fn claim(out: &Path, options: &SynthOptions, zoo: &ModelZoo) -> Result<(), SynthError> {
    files::create_folder(out)?;
    let path = out.join(MANIFEST);
    let asked = describe(options, zoo);
    let shares = options.shard.is_some();
    let found = first_entry(out)?.filter(|found| !(shares && found == MANIFEST));
    if path.is_file() {
        if !options.resume && !shares {
            return Err(SynthError::Exists { path: out.to_owned() });
        }
        let begun: Map<String, Value> = serde_json::from_slice(&files::read(&path)?)
            .map_err(|source| SynthError::Manifest { path: path.clone(), source })?;
        same(out, &begun, &asked)?;
        // What looks unfinished may be another part's, which is at it.
        return if shares { Ok(()) } else { Ok(sweep(out, DEPTH)?) };
    }
    if let Some(found) = found {
        return Err(SynthError::Foreign { path: out.to_owned(), found });
    }
    if !shares {
        sweep(out, 0)?;
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
    let mut effects: Vec<String> = options.effects.iter().map(ToString::to_string).collect();
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
        ("open", json!(options.open)),
        ("effects", json!(names(&mut effects))),
        ("render", json!(format!("{:?}", options.render))),
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
        // Through text, since a number may come back as another kind of number.
        let [begun, asked] = [begun.get(field).unwrap_or(&missing), value].map(ToString::to_string);
        if begun != asked {
            let (path, field) = (out.to_owned(), field.clone());
            return Err(SynthError::OtherOptions { path, field, begun, asked });
        }
    }
    Ok(())
}

/// The first name in a folder, sorted; unfinished files of a run that was cut off do not count.
fn first_entry(folder: &Path) -> Result<Option<String>, FileError> {
    let names = entries(folder)?.into_iter().filter_map(|path| name_of(&path));
    Ok(names.filter(|name| !is_unfinished(name)).min())
}

/// Removes the unfinished files that a killed run leaves, in a folder and `depth` levels below.
fn sweep(folder: &Path, depth: usize) -> Result<(), FileError> {
    for path in entries(folder)? {
        if path.is_dir() {
            if depth > 0 {
                sweep(&path, depth - 1)?;
            }
        } else if name_of(&path).is_some_and(|name| is_unfinished(&name)) {
            fs::remove_file(&path).map_err(|source| FileError::write(&path, source))?;
        }
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let failed = |source: io::Error| FileError::read(folder, source);
    let entries = fs::read_dir(folder).map_err(failed)?;
    entries.map(|entry| Ok(entry.map_err(failed)?.path())).collect()
}

fn name_of(path: &Path) -> Option<String> {
    Some(path.file_name()?.to_string_lossy().into_owned())
}

/// Whether a name is one that `files` gives to what it has not finished.
fn is_unfinished(name: &str) -> bool {
    name.strip_prefix(".tmp").is_some_and(|rest| {
        rest.len() == 6 && rest.bytes().all(|byte| byte.is_ascii_alphanumeric())
    })
}

/// FNV-1a, enough to notice that models are others.
fn fingerprint(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    })
}
