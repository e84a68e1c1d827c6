//! Puts into the program what the repository ships: the network's weights, and the sample that the demo looks at.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Files and folders of the sample that the demo needs.
const SAMPLE: [&str; 6] = [
    "camera.json",
    "parts",
    "vkitti_1.3.1_extrinsicsgt",
    "vkitti_1.3.1_motgt",
    "vkitti_1.3.1_rgb",
    "vkitti_1.3.1_scenegt",
];

fn main() -> io::Result<()> {
    let root = Path::new(&env::var("CARGO_MANIFEST_DIR").unwrap_or_default()).join("../..");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(shipped_weights)");
    let weights = root.join("weights/partpose-r18.safetensors");
    watch(&root.join("weights"));
    if weights.is_file() {
        println!("cargo::rustc-cfg=shipped_weights");
        println!("cargo::rustc-env=PARTPOSE_WEIGHTS={}", weights.display());
    }
    let sample = root.join("examples/world");
    watch(&sample);
    let out = PathBuf::from(env::var("OUT_DIR").unwrap_or_default());
    fs::write(out.join("sample.rs"), sample_source(&sample)?)
}

/// A path that is not there would make every build a new one.
fn watch(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}

/// A list of the sample's files with their contents; empty where the repository's sample is not beside this crate.
fn sample_source(folder: &Path) -> io::Result<String> {
    let mut files = Vec::new();
    for name in SAMPLE {
        collect(&folder.join(name), &mut files)?;
    }
    files.sort();
    let mut text = "const SAMPLE: &[(&str, &[u8])] = &[\n".to_owned();
    for path in files {
        let name = path.strip_prefix(folder).unwrap_or(&path);
        let name = name.to_string_lossy().replace('\\', "/");
        let _ = writeln!(text, "    ({name:?}, include_bytes!({:?})),", path.to_string_lossy());
    }
    text += "];\n";
    Ok(text)
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    if path.is_file() {
        files.push(path.to_owned());
    } else if path.is_dir() {
        for entry in fs::read_dir(path)? {
            collect(&entry?.path(), files)?;
        }
    }
    Ok(())
}
