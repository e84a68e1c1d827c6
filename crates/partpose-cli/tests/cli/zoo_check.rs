//! What `partpose zoo check` tells.

use std::fs;

use expect_test::expect;

use super::{check, run};

#[test]
fn nothing_is_wrong_with_the_embedded_models() {
    let folder = tempfile::tempdir().unwrap();
    let text = run(folder.path(), &["zoo", "check", "--strict"]);
    assert!(
        text.contains("sedan: nothing found") && text.contains(" 0 errors, 0 warnings, "),
        "{text}"
    );
    assert!(text.ends_with("--- exit 0\n"), "{text}");
}

#[test]
fn one_bad_file_does_not_hide_what_is_wrong_with_the_others() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("zoo")).unwrap();
    fs::write(folder.path().join("zoo/a.glb"), b"glTF").unwrap();
    fs::write(
        folder.path().join("car.obj"),
        "v 0 0 0\nv 160 0 0\nv 160 400 0\nv 0 0 140\ng hood\nf 1 3 2\nf 1 2 4\n",
    )
    .unwrap();
    let map = "name = \"wedge\"\ncategory = \"Car\"\nbody_style = \"sedan\"\nscale = 0.1\nforward = \"+y\"\n\
               up = \"+z\"\n[parts]\nhood = [\"hood\"]\n";
    fs::write(folder.path().join("map.toml"), map).unwrap();
    let text =
        run(folder.path(), &["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"]);
    assert!(text.ends_with("--- exit 0\n"), "{text}");
    let text = run(folder.path(), &["zoo", "check", "zoo"]);
    let head: String = text.lines().take(8).map(|line| line.to_owned() + "\n").collect();
    expect![[r""]].assert_eq(&head);
    assert!(text.ends_with("--- exit 1\n"), "{text}");
    let json = run(folder.path(), &["zoo", "check", "zoo/wedge.glb", "--json"]);
    assert!(
        json.contains("\"kind\": \"size\"") && json.contains("\"severity\": \"error\""),
        "{json}"
    );
}

#[test]
fn no_zoo_ends_with_2_and_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("empty")).unwrap();
    check(folder.path(), &["zoo", "check", "empty"], &expect![[r""]]);
    check(folder.path(), &["zoo", "check", "none"], &expect![[r""]]);
}
