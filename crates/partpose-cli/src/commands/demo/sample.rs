//! The images that the repository ships, with their truth: `build.rs` puts `examples/world` into the program, so that the
//! demo runs wherever the program is.

use std::path::Path;

use partpose::files;

// `SAMPLE`: names below the data set's folder, and contents.
include!(concat!(env!("OUT_DIR"), "/sample.rs"));

/// Writes the sample as a data set in Virtual KITTI's layout.
pub(super) fn write(folder: &Path) -> anyhow::Result<()> {
    if SAMPLE.is_empty() {
        return Err(super::no_sample());
    }
    for (name, bytes) in SAMPLE {
        files::write(&folder.join(name), bytes)?;
    }
    Ok(())
}
