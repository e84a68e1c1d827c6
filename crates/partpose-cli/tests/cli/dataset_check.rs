use std::fs;
use std::path::Path;

use expect_test::expect;

use super::{check, run};

const HEADER: &str = "frame tid label truncated occluded alpha l t r b w3d h3d l3d x3d y3d z3d ry rx rz truncr occupr orig_label moving model color\n";
/// Invented vehicles whose boxes are the projections of their cuboids.
const ROWS: &str = "\
0 0 Car 0 0 0.1 BOX0 1.8 1.4 4.2 -3 1.6 15 0.4 0 0 0 0.7 Car 1 Sedan Red
0 1 DontCare 0 2 0.1 BOX1 2 1.7 4.9 2 1.5 22 -1.5 0 0 0 0.3 Car 1 Wagon Blue
1 0 Car 0 0 0.1 BOX0 1.8 1.4 4.2 -3 1.6 15 0.4 0 0 0 0.7 Car 1 Sedan Red
";

fn write(root: &Path, path: &str, text: &str) {
    let path = root.join(path);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, text).unwrap();
}

fn rows() -> String {
    ROWS.replace("BOX0", "365 196 586 274").replace("BOX1", "651 180 726 243")
}

/// A data set of two frames in the folder `data`.
fn tiny(rows: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("data");
    write(&root, "vkitti_1.3.1_motgt/0001_clone.txt", &format!("{HEADER}{rows}"));
    let pose = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1";
    let extrinsics = format!("frame r1,1\n0 {pose}\n1 {pose}\n");
    write(&root, "vkitti_1.3.1_extrinsicsgt/0001_clone.txt", &extrinsics);
    folder
}

#[test]
fn a_clean_data_set_is_shown_and_ends_with_0() {
    check(
        tiny(&rows()).path(),
        &["dataset", "check", "data"],
        &expect![[r#"
            --- stdout
            Virtual KITTI 1.3.1

            sequence    frames  skipped  rows  counted  vehicles  boxes  mean px  max px  rgb  masks  stray %
            0001/clone       2        0     3        2         2      3     0.20    0.29    0      0        -

            category  model  rows  counted  vehicles
            Car       Sedan     2        2         1
            Car       Wagon     1        0         1

            no part masks: `zoo carve` and `evaluate poses --oracle` need them
            no RGB images: pictures have a dark ground under the masks
            no instance images: vehicles that overlap are told apart by the depth of their models
            no depth images: no command needs them yet
            --- stderr
            checked 2 frames of 1 sequences: 0 problems, 0 frames to skip
            --- exit 0
        "#]],
    );
}

#[test]
fn bad_rows_are_named_and_end_with_1() {
    let bad = rows().replace(" 4.2 -3", " -4.2 -3").replacen("0 1 DontCare", "0 1 Boat", 1);
    check(
        tiny(&bad).path(),
        &["dataset", "check", "data"],
        &expect![[r#"
            --- stdout
            Virtual KITTI 1.3.1

            sequence    frames  skipped  rows  counted  vehicles  boxes  mean px  max px  rgb  masks  stray %
            0001/clone       0        2     0        0         0      0        -       -    0      0        -

            category  model  rows  counted  vehicles
            --- stderr
            warning: `data/vkitti_1.3.1_motgt/0001_clone.txt` line 2: column `l3d` is -4.2, outside 0.01 to 100
            warning: `data/vkitti_1.3.1_motgt/0001_clone.txt` line 3: column `label` is `Boat`, not one of Car, Van, Truck, DontCare
            warning: `data/vkitti_1.3.1_motgt/0001_clone.txt` line 4: column `l3d` is -4.2, outside 0.01 to 100
            checked 0 frames of 1 sequences: 3 problems, 2 frames to skip
            --- exit 1
        "#]],
    );
}

#[test]
fn a_folder_that_is_no_data_set_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("data")).unwrap();
    check(
        folder.path(),
        &["dataset", "check", "data"],
        &expect![[r"
        --- stderr
        error: `data` is not a data set that is known
          caused by: there is none of `vkitti_1.3.1_motgt/<world>_<variation>.txt` (Virtual KITTI 1.3.1), `Scene<nn>/<variation>/bbox.txt` (Virtual KITTI 2.0.3), `training/label_2` (KITTI object)
        --- exit 2
    "]],
    );
    check(
        folder.path(),
        &["dataset", "check", "nowhere"],
        &expect![[r"
        --- stderr
        error: cannot read `nowhere`
          caused by: No such file or directory (os error 2)
        --- exit 2
    "]],
    );
    check(
        folder.path(),
        &["dataset", "check"],
        &expect![[r"
        --- stderr
        error: the following required arguments were not provided:
          <DIR>

        Usage: partpose dataset check <DIR>

        For more information, try '--help'.
        --- exit 2
    "]],
    );
}

#[test]
fn json_holds_what_the_tables_show() {
    let folder = tiny(&rows().replace(" 4.2 -3", " nan -3"));
    let text = run(folder.path(), &["dataset", "check", "--json", "data"]);
    let json = text.strip_prefix("--- stdout\n").unwrap().split("--- stderr").next().unwrap();
    let report: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(report["layout"], "VirtualKitti1");
    assert_eq!(report["sequences"][0]["skipped"], 2);
    assert_eq!(report["problems"][0]["line"], 2);
    assert_eq!(report["problems"][0]["message"], "column `l3d` is `nan`, not a finite number");
    assert!(text.ends_with("--- exit 1\n"));
}
