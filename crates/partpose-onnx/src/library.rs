//! Where ONNX Runtime's library is: told, or in one of the places where it usually is.

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use ort::environment::Environment;

use crate::OnnxError;

/// Environment variable that names the library.
pub const VARIABLE: &str = "ORT_DYLIB_PATH";

/// A process has one environment and one library.
static OPENED: Mutex<Option<Environment>> = Mutex::new(None);

/// Opens the library, unless it is open: `given`, else what `ORT_DYLIB_PATH` names, else what is found.
///
/// The library that was opened first stays.
pub(crate) fn open(given: Option<&Path>) -> Result<Environment, OnnxError> {
    let mut opened = OPENED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(environment) = opened.as_ref() {
        return Ok(environment.clone());
    }
    let path = find(given)?;
    // A bare name is left to the system's own search.
    let builder = ort::init_from(&path)
        .map_err(|source| OnnxError::Library { path: path.clone(), source })?;
    let environment = builder.with_name("partpose").with_telemetry(false).build();
    let environment =
        environment.map_err(|source| OnnxError::Runtime { what: "to start".to_owned(), source })?;
    *opened = Some(environment.clone());
    Ok(environment)
}

/// The library that would be opened.
pub fn find(given: Option<&Path>) -> Result<PathBuf, OnnxError> {
    if let Some(path) = given {
        return Ok(path.to_owned());
    }
    if let Some(path) = env::var_os(VARIABLE).filter(|path| !path.is_empty()) {
        return Ok(path.into());
    }
    let folders = folders();
    let found = folders.iter().find_map(|folder| library_in(folder));
    found.ok_or(OnnxError::NoLibrary { tried: folders })
}

/// Folders that may hold it: beside the program, the system's, those of Python's package.
fn folders() -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = Vec::new();
    if let Some(folder) = env::current_exe().ok().as_deref().and_then(Path::parent) {
        folders.push(folder.to_owned());
    }
    let paths = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    folders.extend(env::split_paths(&paths).filter(|path| path.is_absolute()));
    folders.extend(
        ["/usr/local/lib", "/usr/lib", "/usr/lib64", "/usr/lib/x86_64-linux-gnu"].map(Into::into),
    );
    // Where `pip install onnxruntime` puts it.
    let roots = ["VIRTUAL_ENV", "CONDA_PREFIX"].into_iter().filter_map(env::var_os);
    let home = env::var_os("HOME").map(|home| Path::new(&home).join(".local"));
    let system = ["/usr/local", "/usr"].map(PathBuf::from);
    for root in roots.map(PathBuf::from).chain(home).chain(system) {
        for python in entries(&root.join("lib"), "python3") {
            for packages in ["site-packages", "dist-packages"] {
                folders.push(python.join(packages).join("onnxruntime/capi"));
            }
        }
    }
    folders
}

/// The entries of a folder whose names begin so, sorted.
fn entries(folder: &Path, beginning: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let begins = |path: &PathBuf| {
        path.file_name().and_then(OsStr::to_str).is_some_and(|name| name.starts_with(beginning))
    };
    let mut found: Vec<PathBuf> =
        entries.filter_map(|entry| Some(entry.ok()?.path())).filter(begins).collect();
    found.sort();
    found
}

fn library_in(folder: &Path) -> Option<PathBuf> {
    let name = format!("{}onnxruntime{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    // With a version behind it, too (`.so.1.22.0`), or before the ending (`.1.22.0.dylib`).
    let stem = format!("{}onnxruntime.", env::consts::DLL_PREFIX);
    let plain = folder.join(name);
    if plain.is_file() {
        return Some(plain);
    }
    entries(folder, &stem).into_iter().rfind(|path| path.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_given_comes_before_what_is_found() {
        let given = Path::new("nowhere/libonnxruntime.so");
        assert_eq!(find(Some(given)).unwrap(), given);
        assert!(folders().iter().any(|folder| folder.starts_with("/usr/lib")));
    }
}
