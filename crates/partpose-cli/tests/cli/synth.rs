//! `synth`: what it says, that it goes on after a kill, and how it ends where it cannot write.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use expect_test::expect;

use crate::{check, run};

/// A folder with a small camera and two small models.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = "width = 160\nheight = 48\nfx = 90\nfy = 90\ncx = 79.5\ncy = 23.5\n";
    fs::write(folder.path().join("camera.toml"), camera).unwrap();
    let zoo = partpose::vehicle::ModelZoo::embedded();
    let few: Vec<_> = zoo.models.into_iter().take(2).collect();
    partpose::vehicle::ModelZoo { models: few }.save(&folder.path().join("models")).unwrap();
    folder
}

const BASE: [&str; 10] = [
    "synth",
    "--fast",
    "--camera",
    "camera.toml",
    "--zoo",
    "models",
    "--scenes",
    "urban",
    "--variations",
    "clone,fog",
];

fn arguments<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&BASE[..], more].concat()
}

/// All files below a folder with their bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn a_data_set_is_made_checked_counted_and_shown() {
    let folder = folder();
    check(
        folder.path(),
        &arguments(&["--out", "world", "--frames", "2"]),
        &expect![[r#"
            --- stderr
            drew 4 frames of 2 sequences into `world`
            --- exit 0
        "#]],
    );
    let text = run(folder.path(), &["dataset", "check", "--deep", "world"]);
    assert!(text.ends_with("0 problems, 0 frames to skip\n--- exit 0\n"), "{text}");
    let text = run(folder.path(), &["synth", "verify", "world"]);
    assert!(text.contains("1001/fog"), "{text}");
    assert!(text.ends_with("agree in every pixel\n--- exit 0\n"), "{text}");
    let text = run(folder.path(), &["synth", "statistics", "world", "--against", "world"]);
    assert!(
        text.contains("ratio")
            && text.contains("mean length m")
            && text.contains("alpha deg 135..180"),
        "{text}"
    );
    assert!(text.ends_with("--- exit 0\n"), "{text}");
    check(
        folder.path(),
        &["synth", "sheet", "world", "--out", "all"],
        &expect![[r#"
            --- stderr
            drew `all-rgb.jpg`
            drew `all-parts.jpg`
            --- exit 0
        "#]],
    );
    let [width, _] = partpose::files::image_size(&folder.path().join("all-parts.jpg")).unwrap();
    // Two variations beside each other.
    assert_eq!(width, 2 * 480 + 4);
}

#[test]
fn a_killed_run_goes_on_to_the_same_bytes() {
    let folder = folder();
    run(folder.path(), &arguments(&["--frames", "12", "--out", "whole"]));
    let mut child = Command::new(env!("CARGO_BIN_EXE_partpose"))
        .args(arguments(&["--frames", "12", "--out", "cut", "--threads", "1"]))
        .current_dir(folder.path())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = folder.path().join("cut/.unfinished/1001_clone/00001.txt");
    let started = Instant::now();
    while !begun.exists() && started.elapsed() < Duration::from_mins(2) {
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    let _ = child.wait().unwrap();
    let cut = folder.path().join("cut");
    assert!(!cut.join("vkitti_1.3.1_motgt/1001_fog.txt").exists(), "killed too late");
    let text = run(folder.path(), &arguments(&["--frames", "12", "--out", "cut", "--resume"]));
    assert!(text.contains("of 2 sequences into `cut`, "), "{text}");
    let (whole, cut) = (files(&folder.path().join("whole")), files(&cut));
    assert_eq!(whole.keys().collect::<Vec<_>>(), cut.keys().collect::<Vec<_>>());
    for (name, bytes) in &whole {
        assert!(bytes == &cut[name], "`{}` differs", name.display());
    }
}

#[cfg(unix)]
#[test]
fn a_picture_that_finds_no_room_is_named_and_the_run_goes_on_later() {
    let folder = folder();
    let options = ["--fast", "--zoo", "models", "--scenes", "urban", "--variations", "clone"];
    let command = [&["synth", "--frames", "1", "--open", "0"][..], &options].concat();
    run(folder.path(), &[&command[..], &["--out", "whole"]].concat());
    // Files of at most 400 KB, which models are and pictures are not, in place of a disk that fills up.
    let output = Command::new("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 800; exec \"$0\" \"$@\""])
        .arg(env!("CARGO_BIN_EXE_partpose"))
        .args(&command)
        .args(["--out", "full"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert_eq!(
        lines[0], "error: cannot write `full/vkitti_1.3.1_rgb/1001/clone/00000.png`",
        "{told}"
    );
    assert!(lines[2].contains("repeat the command with `--resume`"), "{told}");
    let left = files(&folder.path().join("full"));
    assert!(left.keys().all(|path| !path.to_string_lossy().contains("tmp")), "{:?}", left.keys());
    assert!(!left.keys().any(|path| path.extension() == Some("png".as_ref())));
    run(folder.path(), &[&command[..], &["--out", "full", "--resume"]].concat());
    assert!(files(&folder.path().join("whole")) == files(&folder.path().join("full")));
}

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = folder();
    let text = run(folder.path(), &arguments(&["--out", "/proc/world", "--frames", "1"]));
    assert!(text.contains("error: cannot write `/proc/world`\n"), "{text}");
    assert!(text.contains("see that the folder may be written"), "{text}");
    assert!(text.ends_with("--- exit 2\n"), "{text}");
}

#[test]
fn folders_that_hold_something_are_left_alone() {
    let folder = folder();
    fs::create_dir(folder.path().join("photos")).unwrap();
    fs::write(folder.path().join("photos/a.jpg"), b"mine").unwrap();
    fs::write(folder.path().join("file"), b"mine").unwrap();
    for resume in [None, Some("--resume")] {
        let more: Vec<&str> = ["--out", "photos"].into_iter().chain(resume).collect();
        check(
            folder.path(),
            &arguments(&more),
            &expect![[r#"
                --- stderr
                error: `photos` holds something else already: `a.jpg`
                hint: choose a new or empty folder
                --- exit 2
            "#]],
        );
    }
    check(
        folder.path(),
        &arguments(&["--out", "file/world"]),
        &expect![[r#"
            --- stderr
            error: `file` is a file, not a folder
            hint: choose a folder that is new or empty
            --- exit 2
        "#]],
    );
}

#[test]
fn a_data_set_is_not_mixed_with_another() {
    let folder = folder();
    let run_once = |more: &[&str]| {
        run(folder.path(), &arguments(&[&["--out", "world", "--frames", "1"][..], more].concat()))
    };
    assert!(run_once(&[]).ends_with("--- exit 0\n"));
    expect![[r#"
        --- stderr
        error: `world` holds a synthetic data set already
        hint: add `--resume` to go on with it, or choose an empty folder
        --- exit 2
    "#]]
    .assert_eq(&run_once(&[]));
    expect![[r#"
        --- stderr
        error: `world` was begun with `seed` 1, but now it is 2
        hint: repeat the options it was begun with, or choose an empty folder
        --- exit 2
    "#]]
    .assert_eq(&run_once(&["--resume", "--seed", "2"]));
    expect![[r#"
        --- stderr
        drew 0 frames of 2 sequences into `world`, 2 were there
        --- exit 0
    "#]]
    .assert_eq(&run_once(&["--resume"]));
    fs::write(folder.path().join("world/synth.json"), b"{").unwrap();
    let text = run_once(&["--resume"]);
    assert!(text.contains("`world/synth.json` is not the manifest"), "{text}");
}

#[test]
fn options_that_make_no_data_set_are_named() {
    let folder = folder();
    let cases: [(&[&str], &str); 12] = [
        (&["--frames", "0"], "the number of frames must be 1 to 100000"),
        (&["--fps", "0"], "`--fps` is 0, but must be 0.1 to 1000"),
        (&["--worlds", "1000"], "the number of worlds of a kind must be 1 to 999"),
        (&["--camera-height", "0"], "the height of the camera must be 0.3 to 10 metres"),
        (&["--camera-pitch", "60"], "pitch and roll of the camera must be within 28 degrees"),
        (&["--camera-roll", "nan"], "pitch and roll of the camera must be within 28 degrees"),
        (&["--open", "1.5"], "the share of parked vehicles with something open must be 0 to 1"),
        (&["--threads", "5000"], "at most 1024 threads"),
        (&["--effects", "noise,glow"], "`glow` is no effect; there are fog, rain, motion-blur"),
        (&["--zoo", "nowhere"], "cannot read `nowhere`"),
        (&["--models", "tank"], "there is no model `tank`"),
        (&["--camera", "nowhere"], "cannot read `nowhere`"),
    ];
    for (more, expected) in cases {
        let mut all = arguments(&["--out", "world"]);
        // Later values of the same option would be a second one.
        if let Some(at) = all.iter().position(|argument| *argument == more[0]) {
            all.drain(at..at + 2);
        }
        all.extend(more);
        let text = run(folder.path(), &all);
        assert!(text.contains(expected) && text.ends_with("--- exit 2\n"), "{more:?}: {text}");
        assert!(!folder.path().join("world").exists(), "{more:?} left a folder");
    }
    let unparsed: [(&[&str], &str); 4] = [
        (&["--out", "world", "--scenes", "moon"], "`moon` is no kind of scene"),
        (&["--out", "world", "--variations", "clone,dusk"], "`dusk` is no variation"),
        (&["--out", "world", "--layout-from", "x", "--scenes", "urban"], "cannot be used with"),
        (&[], "--out <DIR>"),
    ];
    for (wrong, expected) in unparsed {
        let text = run(folder.path(), &[&["synth"][..], wrong].concat());
        assert!(text.contains(expected) && text.ends_with("--- exit 2\n"), "{wrong:?}: {text}");
    }
    let text = run(folder.path(), &["synth", "--out", "world", "--layout-from", "models"]);
    assert!(text.contains("`models` is not a data set that is known"), "{text}");
}

#[test]
fn help_shows_examples() {
    let text = run(tempfile::tempdir().unwrap().path(), &["synth", "--help"]);
    assert!(text.contains("Examples:") && text.contains("--layout-from vkitti"), "{text}");
}
