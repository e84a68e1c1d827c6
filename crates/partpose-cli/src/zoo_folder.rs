//! Zoos as commands are given them.

use std::path::Path;

use partpose::vehicle::ModelZoo;

use crate::report::hint;

/// Reads a zoo; a failure says what to do about it.
pub(crate) fn load_zoo(path: &Path) -> anyhow::Result<ModelZoo> {
    ModelZoo::load(path).map_err(|error| {
        let remedy = error.remedy();
        hint(
            error,
            remedy.unwrap_or_else(|| "write the model again, or take it out of the zoo".to_owned()),
        )
    })
}
