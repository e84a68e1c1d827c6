//! Puts the shipped weights into the package where they are in the repository, as the command line's build does.

use std::path::Path;

fn main() {
    // What an interpreter's linker needs to be told on systems other than Linux.
    pyo3_build_config::add_extension_module_link_args();
    let manifest = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    let folder = Path::new(&manifest).join("../../weights");
    let weights = folder.join("partpose-r18.safetensors");
    println!("cargo::rustc-check-cfg=cfg(shipped_weights)");
    println!("cargo::rerun-if-changed=build.rs");
    // A path that is not there would make every build a new one.
    if folder.is_dir() {
        println!("cargo::rerun-if-changed={}", folder.display());
    }
    if weights.is_file() {
        println!("cargo::rustc-cfg=shipped_weights");
        println!("cargo::rustc-env=PARTPOSE_WEIGHTS={}", weights.display());
    }
}
