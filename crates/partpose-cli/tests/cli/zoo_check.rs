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
    expect![[r#"
        --- stdout
        zoo/a.glb:
          error    cannot read the model `zoo/a.glb`: truncated: 8 bytes are announced, 4 are there
                   -> copy or export the file again
        wedge:
          error    the vehicle is 16.000 x 14.000 x 40.000 m large (width, height, length)
                   -> correct the `scale` of the map, and `ignore` what does not belong to the vehicle
          warning  there is no `lights_FL`, `lights_FR`, `lights_RL`, `lights_RR`, `wheels_FL`, `wheels_FR`, `wheels_RL`, `wheels_RR`, `apron_F`, `apron_R`, `doors_FL`, `doors_FR`, `side_L`, `side_R`, `windshield_F`, `windshield_R`, `glass_FL`, `glass_FR`, `roof`, `trunk`, `mirror_L`, `mirror_R`
    "#]].assert_eq(&head);
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
    check(
        folder.path(),
        &["zoo", "check", "empty"],
        &expect![[r#"
        --- stderr
        error: the zoo `empty` holds no `.glb` file
        hint: a zoo is a folder of `.glb` models or one of them: `partpose zoo carve` makes one from part masks, `partpose demo --out DIR` writes one to begin with into `DIR/zoo`
        --- exit 2
    "#]],
    );
    check(
        folder.path(),
        &["zoo", "check", "none"],
        &expect![[r#"
        --- stderr
        error: cannot read `none`
          caused by: No such file or directory (os error 2)
        hint: a zoo is a folder of `.glb` models or one of them: `partpose zoo carve` makes one from part masks, `partpose demo --out DIR` writes one to begin with into `DIR/zoo`
        --- exit 2
    "#]],
    );
}
