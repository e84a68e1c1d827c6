//! The program as a user runs it: what it writes to stdout and stderr, and how it ends.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]
#![allow(clippy::needless_raw_string_hashes, reason = "`UPDATE_EXPECT=1` writes them")]

mod bad_input;
mod browser;
mod dataset_check;
#[cfg(any(feature = "cuda", feature = "wgpu"))]
mod devices;
mod evaluate_detections;
mod evaluate_others;
mod explain;
mod guide;
mod label;
mod own_detector;
mod poses;
mod report;
mod run_images;
mod synth;
mod train;
mod view;
mod zoo;
mod zoo_annotate;
mod zoo_check;
mod zoo_generate;
mod zoo_import;

use std::path::Path;
use std::process::Command;

use expect_test::Expect;

/// Runs `partpose` in a folder and gives stdout, stderr and the exit code, in one text to compare.
fn run(folder: &Path, arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_partpose"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap();
    let mut text = String::new();
    for (name, bytes) in [("stdout", &output.stdout), ("stderr", &output.stderr)] {
        if !bytes.is_empty() {
            text += "--- ";
            text += name;
            text += "\n";
            text += &String::from_utf8_lossy(bytes);
        }
    }
    text + &format!("--- exit {}\n", output.status.code().unwrap_or(-1))
}

/// Runs `partpose` and compares all that it says.
fn check(folder: &Path, arguments: &[&str], expected: &Expect) {
    expected.assert_eq(&run(folder, arguments));
}
