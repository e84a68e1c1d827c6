//! Runs: threads, shards, resuming, and what they leave in the folder.

use std::fs;

use partpose::files::{read_gray16, read_indices};
use partpose::labeling::{LabelError, LabelJob, LabelStore, ModelChoice, label_dataset};

use super::{ROWS, add_sequence, assert_same_files, dataset, files, job, run, zoo};

#[test]
fn number_of_threads_changes_no_byte() {
    let (_folder, dataset) = dataset();
    let zoo = zoo();
    let with = |threads| {
        let out = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| run(&dataset, &job(dataset.sequences(), &zoo), out.path()));
        files(out.path())
    };
    let one = with(1);
    // 40 frames of two images, three and one blocks, two COCO files, the settings.
    assert_eq!(one.len(), 2 * 40 + 4 + 2 + 1);
    for threads in [2, 4] {
        assert_same_files(&one, &with(threads));
    }
}

#[test]
fn shards_in_any_order_write_the_same_bytes_as_one_run() {
    let (_folder, dataset) = dataset();
    let zoo = zoo();
    let whole = tempfile::tempdir().unwrap();
    let job = job(dataset.sequences(), &zoo);
    run(&dataset, &job, whole.path());
    let shared = tempfile::tempdir().unwrap();
    for (done, index) in [3, 1, 2].into_iter().enumerate() {
        let shard = Some(format!("{index}/3").parse().unwrap());
        let report = run(&dataset, &LabelJob { shard, ..job.clone() }, shared.path());
        let missing: usize = report.sequences.iter().map(|sequence| sequence.missing_blocks).sum();
        assert_eq!(missing == 0, done == 2);
    }
    assert_same_files(&files(whole.path()), &files(shared.path()));
}

#[test]
fn a_killed_run_resumes_to_the_same_bytes() {
    let (_folder, dataset) = dataset();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let at = |path: &str| out.path().join(path);
    let job = job(dataset.sequences(), &zoo);
    run(&dataset, &job, out.path());
    let whole = files(out.path());
    // As if killed: the last block and its file are not there, nor a frame of the one before, whose block is; a
    // temporary file is left, and a computer that lost its power kept half of an image.
    fs::remove_file(at("coco/0001_clone.json")).unwrap();
    fs::remove_file(at("coco/blocks/0001/clone/00002.jsonl")).unwrap();
    fs::remove_file(at("parts/0001/clone/00034.png")).unwrap();
    fs::remove_file(at("instances/0001/clone/00020.png")).unwrap();
    fs::write(at("parts/0001/clone/.tmpXyz123"), b"half").unwrap();
    let half = &whole["parts/0001/clone/00003.png"];
    fs::write(at("parts/0001/clone/00003.png"), &half[..half.len() / 2]).unwrap();
    let report = run(&dataset, &LabelJob { resume: true, ..job.clone() }, out.path());
    assert_same_files(&whole, &files(out.path()));
    assert_eq!((report.sequences[0].written, report.sequences[1].kept), (35, 5));
    let report = run(&dataset, &LabelJob { resume: true, ..job }, out.path());
    assert_eq!((report.sequences[0].written, report.sequences[0].kept), (0, 35));
    assert_same_files(&whole, &files(out.path()));
}

#[test]
fn folder_of_another_run_is_refused_and_what_differs_is_said() {
    let (_folder, dataset) = dataset();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let store = LabelStore::new(out.path());
    let mut job = job(&dataset.sequences()[1..], &zoo);
    run(&dataset, &job, out.path());
    let before = files(out.path());
    let error = label_dataset(&dataset, &job, &store, &|_| {}).unwrap_err();
    assert!(matches!(error, LabelError::Occupied { .. }), "{error}");
    job.resume = true;
    job.stride = 2;
    job.options.models = ModelChoice::Name;
    let error = label_dataset(&dataset, &job, &store, &|_| {}).unwrap_err().to_string();
    let expected = "holds the labels of another run: `models` was \"size\" and is now \"name\"; `stride` was 1 and is now 2";
    assert!(error.ends_with(expected), "{error}");
    assert_same_files(&before, &files(out.path()));
}

#[test]
fn folder_with_anything_else_is_left_alone() {
    let (folder, dataset) = dataset();
    let zoo = zoo();
    let before = files(folder.path());
    for resume in [false, true] {
        let job = LabelJob { resume, ..job(dataset.sequences(), &zoo) };
        let store = LabelStore::new(folder.path());
        let error = label_dataset(&dataset, &job, &store, &|_| {}).unwrap_err();
        assert!(matches!(error, LabelError::Occupied { .. }), "{error}");
    }
    assert_same_files(&before, &files(folder.path()));
}

#[test]
fn labels_are_read_as_masks_of_the_data_set() {
    let (folder, dataset) = dataset();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    run(&dataset, &job(&dataset.sequences()[1..], &zoo), out.path());
    let parts = out.path().join("parts/0002/clone/00002.png");
    let target = folder.path().join("parts/0002/clone/00002.png");
    fs::create_dir_all(target.parent().unwrap()).unwrap();
    fs::copy(&parts, &target).unwrap();
    let frames = dataset.frames(&dataset.sequences()[1]).unwrap();
    let mask = frames[2].read_parts().unwrap();
    assert!(mask.labels == read_indices(&parts).unwrap().values);
    let instances = read_gray16(&out.path().join("instances/0002/clone/00002.png")).unwrap();
    assert!(instances.values.iter().zip(&mask.labels).all(|(id, part)| (*id != 0) == (*part != 0)));
}

#[test]
fn labels_agree_with_themselves_and_less_with_others() {
    let (_folder, dataset) = dataset();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let base = job(&dataset.sequences()[1..], &zoo);
    run(&dataset, &base, out.path());
    let reference = Some(out.path().join("parts"));
    let resumed = LabelJob { resume: true, reference: reference.clone(), ..base.clone() };
    let same = run(&dataset, &resumed, out.path()).agreement.unwrap();
    assert_eq!(same.frames, 5);
    assert_eq!((same.inside().accuracy(), same.missed(), same.surplus()), (Some(1.0), 0, 0));
    assert_eq!(same.mean_iou(), Some(1.0));
    let other = tempfile::tempdir().unwrap();
    let long = partpose::vehicle::ModelZoo { models: vec![zoo.models[1].clone()] };
    let mut turned = base;
    turned.zoos = partpose::labeling::Zoos::single(&long);
    turned.reference = reference;
    turned.options.dont_care = partpose::labeling::DontCare::Occlude;
    let fresh = run(&dataset, &turned, other.path());
    let agreement = fresh.agreement.unwrap();
    assert!(agreement.missed() > 1000, "the vehicle to ignore");
    assert_eq!(fresh.compared.len(), 5);
    // Fresh and kept labels are compared alike.
    turned.resume = true;
    assert_eq!(run(&dataset, &turned, other.path()).agreement.unwrap(), agreement);
}

#[test]
fn frames_of_a_stride_are_those_whose_index_it_divides() {
    let folder = tempfile::tempdir().unwrap();
    add_sequence(folder.path(), "0001", 10, &ROWS[..1]);
    let dataset = partpose::dataset::Dataset::open(folder.path()).unwrap();
    let zoo = zoo();
    let out = tempfile::tempdir().unwrap();
    let mut job = job(dataset.sequences(), &zoo);
    job.stride = 4;
    run(&dataset, &job, out.path());
    let names: Vec<String> =
        files(out.path()).into_keys().filter(|name| name.starts_with("parts")).collect();
    assert_eq!(names, [0, 4, 8].map(|at| format!("parts/0001/clone/{at:05}.png")));
}
