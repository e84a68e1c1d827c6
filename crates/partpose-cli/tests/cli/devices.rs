//! GPUs find what processors find: `cargo test -p partpose-cli --features wgpu --test cli devices -- --nocapture` (`cuda`
//! alike) prints how far they differ. Any Vulkan device will do, one in software included.

use std::fs;
use std::path::{Path, PathBuf};

use partpose::detection::Detection;
use partpose::formats::read_detections;

use crate::run;

/// The vehicles of the sample's images, two of which are under way at once, best first of each; `None` where there is
/// no such device.
fn found(folder: &Path, device: &str) -> Option<Vec<Detection>> {
    let images =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/world/vkitti_1.3.1_rgb");
    let images = images.display().to_string();
    let rest = ["--device", device, "--out", device, "--no-pictures", "--fit", "sqpnp"];
    let said = run(folder, &[&["run", &images, "--jobs", "2"], &rest[..]].concat());
    if said.contains("no GPU was found") {
        return None;
    }
    assert!(said.ends_with("--- exit 0\n"), "{said}");
    let files = fs::read_dir(folder.join(device).join("detections")).unwrap();
    let mut files: Vec<PathBuf> = files.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 3, "{files:?}");
    let found = files.iter().flat_map(|file| read_detections(file).unwrap().detections);
    Some(found.map(|(_, found)| found).collect())
}

#[test]
#[allow(clippy::print_stderr, reason = "it says how near devices come, or that there is none")]
fn they_find_what_the_processor_finds() {
    let folder = tempfile::tempdir().unwrap();
    let expected = found(folder.path(), "cpu").unwrap();
    assert!(expected.len() >= 4);
    let built = [("cuda", cfg!(feature = "cuda")), ("wgpu", cfg!(feature = "wgpu"))];
    for (device, _) in built.into_iter().filter(|(_, is_built)| *is_built) {
        let Some(found) = found(folder.path(), device) else {
            eprintln!("skipped: no GPU that `{device}` can use");
            continue;
        };
        assert_eq!(found.len(), expected.len(), "{device}");
        let mut most = [0.0f64; 3];
        for (found, expected) in found.iter().zip(&expected) {
            let corners = |d: &Detection| {
                let b = d.bounds;
                [b.x_min, b.y_min, b.x_max, b.y_max]
            };
            let boxes = corners(found).into_iter().zip(corners(expected));
            let parts = found.probabilities.values().iter().zip(expected.probabilities.values());
            let off = [
                (found.score - expected.score).abs(),
                boxes.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max),
                parts.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max),
            ];
            most = [0, 1, 2].map(|i| most[i].max(off[i]));
        }
        let [score, corner, part] = most;
        eprintln!(
            "{device}: {} vehicles; scores to {score:.1e}, boxes to {corner:.1e} px, parts to {part:.1e}",
            found.len()
        );
        assert!(score < 1e-3 && corner < 0.05 && part < 1e-3, "{device}: {most:?}");
    }
}
