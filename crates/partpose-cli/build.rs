//! Puts the shipped weights into the program where they are in the repository.

use std::path::Path;

fn main() {
    let manifest = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    let weights = Path::new(&manifest).join("../../weights/partpose-r18.safetensors");
    println!("cargo::rustc-check-cfg=cfg(shipped_weights)");
    println!("cargo::rerun-if-changed={}", weights.display());
    if weights.is_file() {
        println!("cargo::rustc-cfg=shipped_weights");
        println!("cargo::rustc-env=PARTPOSE_WEIGHTS={}", weights.display());
    }
}
