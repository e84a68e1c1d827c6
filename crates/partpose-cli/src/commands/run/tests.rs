use super::*;

use std::sync::atomic::{AtomicUsize, Ordering};

use clap::Parser;
use partpose::files::write_png;
use partpose::formats::read_detections;
use partpose::geometry::Rect;
use partpose::parts::{CHANNELS, PartProbabilities};

#[derive(Parser)]
struct Typed {
    #[command(flatten)]
    arguments: Arguments,
}

/// Runs on images of a folder with a detector that finds one vehicle of the size of the image, and counts its calls.
fn run_in(folder: &Path, more: &[&str]) -> (anyhow::Result<Outcome>, usize) {
    let images = folder.join("images").display().to_string();
    let out = folder.join("out").display().to_string();
    let typed = ["run", &images, "--out", &out].into_iter().chain(more.iter().copied());
    let arguments = Typed::parse_from(typed).arguments;
    let inputs = inputs::collect(&arguments.images, arguments.shard).unwrap();
    let calls = AtomicUsize::new(0);
    let detect = |image: &RgbImage| {
        calls.fetch_add(1, Ordering::Relaxed);
        let [width, height] = image.size.map(f64::from);
        let mut values = vec![0.0; CHANNELS * 4];
        values[4 * 5..4 * 6].fill(1.0);
        let found = |score: f64| {
            let probabilities = PartProbabilities::new(2, values.clone()).unwrap();
            Detection::new(Rect::new(0.0, 0.0, width, height), score, probabilities)
        };
        Ok(vec![found(0.9), found(0.1)])
    };
    let fitter = Fitter::new(&arguments.fit, &arguments.out);
    let outcome =
        fitter.and_then(|fitter| run_with(&arguments, &inputs, ("test", &detect), fitter));
    (outcome, calls.into_inner())
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, size) in [("a", [40, 30]), ("b", [64, 48])] {
        let pixels = vec![90; 3 * size[0] as usize * size[1] as usize];
        let path = folder.path().join("images").join(name).with_extension("png");
        write_png(&path, &RgbImage { size, pixels }).unwrap();
    }
    folder
}

#[test]
fn every_image_has_its_files_and_bad_ones_are_counted() {
    let folder = folder();
    let (outcome, calls) = run_in(folder.path(), &[]);
    assert_eq!((outcome.unwrap(), calls), (Outcome::Done, 2));
    for name in ["a.json", "a.txt", "a.png", "b.json", "detections/b.safetensors", "run.json"] {
        assert!(folder.path().join("out").join(name).is_file(), "{name}");
    }
    let file = read_detections(&folder.path().join("out/detections/a.safetensors")).unwrap();
    assert_eq!((file.images, file.detections.len()), (vec!["a.png".to_owned()], 1));
    files::write(&folder.path().join("images/c.jpg"), b"no picture").unwrap();
    let (outcome, calls) = run_in(folder.path(), &[]);
    assert_eq!((outcome.unwrap(), calls), (Outcome::Skipped, 2));
}

#[test]
fn nothing_but_bad_images_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    files::write(&folder.path().join("images/c.jpg"), b"no picture").unwrap();
    assert!(run_in(folder.path(), &[]).0.is_err());
}

#[test]
fn resumed_run_does_what_is_left_and_nothing_else() {
    let folder = folder();
    assert_eq!(run_in(folder.path(), &["--shard", "1/2"]).1, 1);
    assert_eq!(run_in(folder.path(), &["--resume"]).1, 1);
    assert_eq!(run_in(folder.path(), &["--resume"]).1, 0);
    std::fs::remove_file(folder.path().join("out/b.txt")).unwrap();
    assert_eq!(run_in(folder.path(), &["--resume"]).1, 1);
    let (outcome, calls) = run_in(folder.path(), &["--resume", "--min-score", "0.05"]);
    let said = outcome.unwrap_err().to_string();
    assert!(said.contains("`min_score` was 0.5, now it is 0.05") && calls == 0, "{said}");
    let others = [
        (&["--extent", "model"][..], "`fit.extent` was \"of the detections"),
        (&["--alone"], "`scene."),
    ];
    for (other, told) in others {
        let (outcome, calls) = run_in(folder.path(), &[&["--resume"], other].concat());
        let said = outcome.unwrap_err().to_string();
        assert!(said.contains(told) && calls == 0, "{said}");
    }
}

#[test]
fn results_of_other_settings_are_not_kept_when_a_run_anew_was_interrupted() {
    let folder = folder();
    assert_eq!(run_in(folder.path(), &[]).1, 2);
    // As if it had been stopped after the first image.
    let anew = ["--min-score", "0.05", "--shard", "1/2"];
    assert_eq!(run_in(folder.path(), &anew).1, 1);
    assert_eq!(run_in(folder.path(), &["--min-score", "0.05", "--resume"]).1, 1);
    for name in ["a", "b"] {
        let path = folder.path().join(format!("out/detections/{name}.safetensors"));
        assert_eq!(read_detections(&path).unwrap().detections.len(), 2, "{name}");
    }
    assert_eq!(run_in(folder.path(), &["--min-score", "0.05", "--resume"]).1, 0);
}

#[test]
fn image_of_another_size_than_the_camera_is_skipped() {
    let folder = folder();
    let camera = folder.path().join("camera.toml");
    let text = "width = 40\nheight = 30\nfx = 50\nfy = 50\ncx = 19.5\ncy = 14.5\n";
    files::write(&camera, text.as_bytes()).unwrap();
    let (outcome, calls) = run_in(folder.path(), &["--camera", &camera.display().to_string()]);
    assert_eq!((outcome.unwrap(), calls), (Outcome::Skipped, 1));
    assert!(!folder.path().join("out/b.json").exists());
}
