//! Where the models of a zoo came from.

use std::collections::BTreeMap;
use std::path::Path;

use partpose::files;
use partpose::vehicle::import::Imported;
use serde::{Deserialize, Serialize};

use super::map_file::MapFile;

/// Name of the record in the folder of a zoo.
const RECORD: &str = "imported.json";

/// What is told of a model.
#[derive(Debug, Serialize, Deserialize)]
struct Origin {
    version: String,
    /// The foreign model.
    model: String,
    map: String,
    faces: usize,
    unlabeled: usize,
    ignored: usize,
}

/// Adds a model to the record; a record that cannot be read is begun anew.
pub(super) fn write(
    zoo: &Path,
    model: &Path,
    map: &MapFile,
    imported: &Imported,
) -> anyhow::Result<()> {
    let path = zoo.join(RECORD);
    let known = files::read(&path).ok();
    let known = known.and_then(|bytes| serde_json::from_slice(&bytes).ok());
    let mut origins: BTreeMap<String, Origin> = known.unwrap_or_default();
    let origin = Origin {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        model: model.display().to_string(),
        map: map.path.display().to_string(),
        faces: imported.model.faces.len(),
        unlabeled: imported.model.unlabeled(),
        ignored: imported.ignored,
    };
    origins.insert(imported.model.name.clone(), origin);
    Ok(files::write(&path, serde_json::to_string_pretty(&origins)?.as_bytes())?)
}
