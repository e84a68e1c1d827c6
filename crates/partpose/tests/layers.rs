//! Modules may use only the modules below them.

use std::{fs, path::Path};

/// Bottom to top, as in ARCHITECTURE.md.
const LAYERS: &[&str] = &[
    "files",
    "geometry",
    "parts",
    "pnp",
    "vehicle",
    "render",
    "annotate",
    "dataset",
    "detection",
    "oracle",
    "pose",
    "track",
    "eval",
    "carve",
    "formats",
    "labeling",
    "viz",
];

#[test]
fn no_module_uses_one_above_it() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut offences = Vec::new();
    for (height, layer) in LAYERS.iter().enumerate() {
        let mut files = Vec::new();
        collect(&src.join(format!("{layer}.rs")), &mut files);
        collect(&src.join(layer), &mut files);
        assert!(!files.is_empty(), "{layer} has no file");
        for (file, text) in files {
            for name in names_after_crate(&text) {
                match LAYERS.iter().position(|other| *other == name) {
                    Some(other) if other <= height => {}
                    Some(_) => offences.push(format!("{file}: {layer} uses {name}")),
                    None => offences.push(format!("{file}: write the module, not `crate::{name}`")),
                }
            }
        }
    }
    assert!(offences.is_empty(), "{}", offences.join("\n"));
}

#[test]
fn every_module_has_a_layer() {
    let lib = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs");
    let lib = fs::read_to_string(lib).expect("lib.rs is readable");
    for line in lib.lines() {
        let line = line.strip_prefix("pub ").unwrap_or(line);
        if let Some(module) = line.strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';')) {
            assert!(LAYERS.contains(&module), "{module} has no layer");
        }
    }
}

/// The first name of every path that starts at `crate::`; comments do not count.
fn names_after_crate(text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let code = code.collect::<Vec<_>>().join("\n");
    code.split("crate::").skip(1).flat_map(first_names).collect()
}

/// `a::b` gives a; `{a::{b, c}, d}` gives a and d.
fn first_names(path: &str) -> Vec<String> {
    let word = |s: &str| s.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    if !path.starts_with('{') {
        return vec![word(path)];
    }
    let (mut depth, mut names) = (0, Vec::<String>::new());
    for (at, c) in path.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            _ => {}
        }
        match c {
            '{' | ',' if depth == 1 => names.push(word(path[at + 1..].trim_start())),
            '}' if depth == 0 => break,
            _ => {}
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

fn collect(path: &Path, files: &mut Vec<(String, String)>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).expect("a readable directory") {
            collect(&entry.expect("a readable entry").path(), files);
        }
    } else if let Ok(text) = fs::read_to_string(path) {
        files.push((path.display().to_string(), text));
    }
}
