//! The evaluators against what the public ones print, where the sets are there, and against invented ones.

#![allow(
    clippy::float_cmp,
    clippy::format_push_string,
    clippy::print_stderr,
    reason = "in tests, integers in floats, small texts and skips are told"
)]
#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

mod a3dp;
mod bop;
mod coco;
mod kitti;

use std::path::PathBuf;

/// A folder of the shared data, or `None`, said aloud, where it is missing.
fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: there is no `{}`", path.display());
    None
}
