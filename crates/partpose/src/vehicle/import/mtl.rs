//! The names in an MTL file, the material library of an OBJ.
//!
//! Wavefront: *Advanced Visualizer Manual*, 1995, appendix B. Of materials only the names are used; colours are checked
//! to be numbers, so that a broken file is told, and textures are never opened.

use std::collections::BTreeSet;
use std::path::Path;

use crate::files;

use super::{ImportError, LineFault, scene::clean_name};

/// Statements that are followed by numbers.
const NUMBERS: [&str; 9] = ["Ka", "Kd", "Ks", "Ke", "Ns", "Ni", "d", "Tr", "illum"];

/// The names of the materials that a library defines.
pub(super) fn read_names(path: &Path) -> Result<BTreeSet<String>, ImportError> {
    let bytes = files::read(path)?;
    let mut names = BTreeSet::new();
    for (at, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let line = String::from_utf8_lossy(line);
        let failed = |source| ImportError::Line { path: path.to_owned(), line: at + 1, source };
        let mut words = line.split_whitespace();
        match words.next() {
            Some("newmtl") => {
                let name = clean_name(line.trim_start().trim_start_matches("newmtl"));
                if name.is_empty() {
                    return Err(failed(LineFault::NoName("newmtl")));
                }
                names.insert(name);
            }
            Some(word) if NUMBERS.contains(&word) => {
                // `Kd spectral FILE` and `Kd xyz`, `d -halo` are other ways to say it.
                let is_other = |word: &str| ["spectral", "xyz", "-halo"].contains(&word);
                for word in words.take_while(|word| !is_other(word) && !word.starts_with('#')) {
                    if !word.parse::<f64>().is_ok_and(f64::is_finite) {
                        let shown = clean_name(word).chars().take(40).collect();
                        return Err(failed(LineFault::Number(shown)));
                    }
                }
            }
            _ => {}
        }
    }
    Ok(names)
}
