use std::fs;

use expect_test::expect;

use super::{check, run};

#[test]
fn embedded_models_are_listed_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let text = run(folder.path(), &["zoo", "list", "--json"]);
    let json = text.strip_prefix("--- stdout\n").unwrap().split("--- ").next().unwrap();
    let models: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(models[0]["name"], "sedan");
    assert_eq!(models[1]["missing_parts"], serde_json::json!([]));
    check(
        folder.path(),
        &["zoo", "show", "--out", "pictures"],
        &expect![[r"
            --- stderr
            drew `pictures/sedan.png`
            drew `pictures/hatchback.png`
            drew `pictures/city-car.png`
            drew `pictures/supermini.png`
            drew `pictures/hatchback-3-door.png`
            drew `pictures/sedan-compact.png`
            drew `pictures/sedan-large.png`
            drew `pictures/estate.png`
            drew `pictures/coupe.png`
            drew `pictures/suv-compact.png`
            drew `pictures/suv-large.png`
            drew `pictures/mpv.png`
            drew `pictures/minivan.png`
            drew `pictures/van-small.png`
            drew `pictures/panel-van.png`
            drew `pictures/panel-van-large.png`
            drew `pictures/pickup.png`
            --- exit 0
        "]],
    );
    assert!(fs::read(folder.path().join("pictures/sedan.png")).unwrap().starts_with(b"\x89PNG"));
}

#[test]
fn a_model_that_the_zoo_lacks_ends_with_2() {
    let folder = tempfile::tempdir().unwrap();
    check(
        folder.path(),
        &["zoo", "show", "--model", "tank", "--out", "x.png"],
        &expect![[r"
            --- stderr
            error: the zoo has no model `tank`
            hint: it has `sedan`, `hatchback`, `city-car`, `supermini`, `hatchback-3-door`, `sedan-compact`, `sedan-large`, `estate`, `coupe`, `suv-compact`, `suv-large`, `mpv`, `minivan`, `van-small`, `panel-van`, `panel-van-large`, `pickup`
            --- exit 2
        "]],
    );
    check(
        folder.path(),
        &["zoo", "show", "--out", "x.png"],
        &expect![[r"
            --- stderr
            error: 17 models do not fit into one file
            hint: choose one with `--model`, or give a folder
            --- exit 2
        "]],
    );
}

#[test]
fn bad_zoos_end_with_2_and_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("zoo")).unwrap();
    check(
        folder.path(),
        &["zoo", "list", "zoo"],
        &expect![[r"
            --- stderr
            error: the zoo `zoo` holds no `.glb` file
            hint: a zoo is a folder of `.glb` models or one of them: `partpose zoo carve` makes one from part masks, `partpose demo --out DIR` writes one to begin with into `DIR/zoo`
            --- exit 2
        "]],
    );
    check(
        folder.path(),
        &["zoo", "list", "none"],
        &expect![[r"
            --- stderr
            error: cannot read `none`
              caused by: No such file or directory (os error 2)
            hint: a zoo is a folder of `.glb` models or one of them: `partpose zoo carve` makes one from part masks, `partpose demo --out DIR` writes one to begin with into `DIR/zoo`
            --- exit 2
        "]],
    );
    fs::write(folder.path().join("zoo/car.glb"), b"glTF\x02\0\0\0\xff\0\0\0").unwrap();
    check(
        folder.path(),
        &["zoo", "list", "zoo"],
        &expect![[r"
            --- stderr
            error: cannot read the model `zoo/car.glb`
              caused by: truncated: 255 bytes are announced, 12 are there
            hint: copy or export the file again
            --- exit 2
        "]],
    );
}
