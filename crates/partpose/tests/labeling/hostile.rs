//! Data sets with holes, and names that lead elsewhere: told and skipped, never a panic or a file outside.

use std::fs;

use partpose::dataset::Dataset;
use partpose::labeling::LabelStore;
use partpose::labeling::label_dataset;

use super::{MOTGT, ROWS, add_sequence, files, job, run, write, zoo};

#[test]
fn a_data_set_with_half_its_files_gives_half_its_labels() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for world in ["0001", "0002", "0003"] {
        add_sequence(root, world, 3, &ROWS);
    }
    // No cameras: frames come from the rows. No rows at all. A row cut off in the middle.
    fs::remove_file(root.join("vkitti_1.3.1_extrinsicsgt/0001_clone.txt")).unwrap();
    write(root, "vkitti_1.3.1_motgt/0002_clone.txt", MOTGT);
    let path = root.join("vkitti_1.3.1_motgt/0003_clone.txt");
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, &text[..text.len() - 30]).unwrap();
    // A label file that is no text.
    fs::write(root.join("vkitti_1.3.1_motgt/0004_clone.txt"), [0xff, 0xfe, 0x00]).unwrap();
    let dataset = Dataset::open(root).unwrap();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let report = run(&dataset, &job(dataset.sequences(), &zoo), out.path());
    let written: Vec<usize> = report.sequences.iter().map(|sequence| sequence.written).collect();
    assert_eq!(written, [3, 3, 2, 0]);
    assert_eq!(report.sequences[1].vehicles, 0);
    let reasons: Vec<String> =
        report.skipped.iter().map(|s| format!("{}: {}", s.name, s.error)).collect();
    assert_eq!(reasons.len(), 2, "{reasons:?}");
    assert!(
        reasons[0].starts_with("0003/clone: ") && reasons[0].contains("0003_clone.txt` line 16"),
        "{reasons:?}"
    );
    assert!(reasons[1].contains("not text"), "{reasons:?}");
    let coco = fs::read_to_string(out.path().join("coco/0003_clone.json")).unwrap();
    assert!(coco.contains("\"skipped_frames\":[2]"));
    assert!(!out.path().join("coco/0004_clone.json").exists());
}

#[test]
fn sequences_named_after_parent_folders_write_nothing_outside() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("data");
    add_sequence(&root, "0001", 1, &ROWS[..1]);
    let rows = fs::read_to_string(root.join("vkitti_1.3.1_motgt/0001_clone.txt")).unwrap();
    write(&root, "vkitti_1.3.1_motgt/.._...txt", &rows);
    write(&root, "vkitti_1.3.1_motgt/.._clone.txt", &rows);
    let dataset = Dataset::open(&root).unwrap();
    let zoo = zoo();
    let out = folder.path().join("deep/er/out");
    let report = run(&dataset, &job(dataset.sequences(), &zoo), &out);
    assert_eq!(report.skipped.len(), 2);
    assert!(report.skipped.iter().all(|s| s.error.to_string().ends_with("cannot name folders")));
    let outside: Vec<String> = files(folder.path())
        .into_keys()
        .filter(|name| !name.starts_with("data/") && !name.starts_with("deep/er/out/"))
        .collect();
    assert!(outside.is_empty(), "{outside:?}");
    assert_eq!(files(&out).keys().filter(|name| name.starts_with("parts/")).count(), 1);
}

#[test]
fn a_file_in_the_place_of_a_folder_stops_the_run_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    add_sequence(folder.path(), "0001", 1, &ROWS[..1]);
    let dataset = Dataset::open(folder.path()).unwrap();
    let zoo = zoo();
    let out = folder.path().join("out");
    fs::write(&out, "text").unwrap();
    let job = job(dataset.sequences(), &zoo);
    let error = label_dataset(&dataset, &job, &LabelStore::new(&out), &|_| {}).unwrap_err();
    assert_eq!(error.to_string(), format!("`{}` is a file, not a folder", out.display()));
}
