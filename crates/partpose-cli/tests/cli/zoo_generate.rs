use std::fs;

use expect_test::expect;

use super::{check, run};

#[test]
fn a_chosen_model_is_written_drawn_and_described() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    check(
        folder.path(),
        &[
            "zoo",
            "generate",
            "--models",
            "pickup",
            "--out",
            "zoo",
            "--report",
            "pictures",
            "--parameters",
            "parameters",
            "--contact-sheet",
            "sheet.png",
        ],
        &expect![[r#"
            --- stderr
            wrote 1 model to `zoo`
            wrote parameters to `parameters`
            drew turntables to `pictures`
            drew `sheet.png`
            --- exit 0
        "#]],
    );
    assert!(fs::read(at("pictures/pickup.png")).unwrap().starts_with(b"\x89PNG"));
    assert!(fs::read(at("sheet.png")).unwrap().starts_with(b"\x89PNG"));
    // The parameters make the same model again.
    run(folder.path(), &["zoo", "generate", "--from", "parameters/pickup.toml", "--out", "again"]);
    assert_eq!(fs::read(at("zoo/pickup.glb")).unwrap(), fs::read(at("again/pickup.glb")).unwrap());
}

#[test]
fn a_file_that_changes_a_vehicle_makes_another() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("mine.toml"),
        "base = \"hatchback\"\nbody_style = \"hatchback-3-door\"\nlength = 4.1\nwheelbase = 2.51\nrear_doors = false\nb_pillar = 1.7\n",
    )
    .unwrap();
    check(
        folder.path(),
        &["zoo", "generate", "--from", "mine.toml", "--out", "zoo"],
        &expect![[r#"
            --- stderr
            wrote 1 model to `zoo`
            --- exit 0
        "#]],
    );
    check(
        folder.path(),
        &["zoo", "list", "zoo"],
        &expect![[r#"
            --- stdout
            name  category  body style        width  height  length  faces  missing
            mine  Car       hatchback-3-door   1.80    1.45    4.10  14326  doors_RL doors_RR glass_CL glass_CR
            --- exit 0
        "#]],
    );
}

#[test]
fn bad_parameter_files_end_with_2_and_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.toml");
    let arguments = ["zoo", "generate", "--from", "mine.toml", "--out", "zoo"];
    for (text, expected) in [
        (
            "base = \"hatchback\"\nheigth = 1.5\n",
            expect![[r#"
                --- stderr
                error: `mine.toml` line 2: there is no parameter `heigth`
                hint: docs/vehicles.md lists the parameters
                --- exit 2
            "#]],
        ),
        (
            "base = \"hatchback\"\nwheel_size = 0.6\n",
            expect![[r#"
                --- stderr
                error: `mine.toml` line 2: there is no parameter `wheel_size`
                hint: near it is `wheel_diameter`
                --- exit 2
            "#]],
        ),
        (
            "base = \"hatchback\"\n\nlength = \"long\"\n",
            expect![[r#"
                --- stderr
                error: `mine.toml` line 3: `length` must be a number
                hint: for example `length = 4.77`
                --- exit 2
            "#]],
        ),
        (
            "base = \"tank\"\n",
            expect![[r#"
                --- stderr
                error: `mine.toml`: there is no vehicle "tank"
                hint: choose among `sedan`, `hatchback`, `city-car`, `supermini`, `hatchback-3-door`, `sedan-compact`, `sedan-large`, `estate`, `coupe`, `suv-compact`, `suv-large`, `mpv`, `minivan`, `van-small`, `panel-van`, `panel-van-large`, `pickup`
                --- exit 2
            "#]],
        ),
        (
            "length = 4.5\n",
            expect![[r#"
                --- stderr
                error: `mine.toml` has no `arch_flare`
                hint: add it, or `base = "sedan"` to take what is missing from there
                --- exit 2
            "#]],
        ),
        (
            "base = \"sedan\"\nname = \"../sedan\"\n",
            expect![[r#"
                --- stderr
                error: `mine.toml`: the name "../sedan" cannot name a file
                hint: use letters, digits, `_`, `-` and `.`
                --- exit 2
            "#]],
        ),
        (
            "base = \"sedan\"\nwheelbase = 9\n",
            expect![[r#"
                --- stderr
                error: `mine.toml`: overhangs, wheelbase and wheel diameter make no vehicle
                hint: docs/vehicles.md explains the parameters; begin with a vehicle of `partpose zoo generate --parameters DIR` and change little at a time
                --- exit 2
            "#]],
        ),
        (
            "base = sedan\n",
            expect![[r#"
                --- stderr
                error: `mine.toml` line 1: string values must be quoted, expected literal string
                hint: a parameter file has lines like `length = 4.5`; `partpose zoo generate --parameters DIR` writes whole ones
                --- exit 2
            "#]],
        ),
    ] {
        fs::write(&file, text).unwrap();
        check(folder.path(), &arguments, &expected);
    }
}

#[test]
fn a_folder_with_other_models_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    run(folder.path(), &["zoo", "generate", "--models", "sedan", "--out", "zoo"]);
    check(
        folder.path(),
        &["zoo", "generate", "--models", "coupe", "--out", "zoo"],
        &expect![[r#"
            --- stderr
            error: the folder holds `zoo/sedan.glb`, which is not of this zoo
            hint: choose an empty folder
            --- exit 2
        "#]],
    );
    check(
        folder.path(),
        &["zoo", "generate"],
        &expect![[r#"
            --- stderr
            error: nothing to write
            hint: give `--out ZOO`, or `--list` to see what there is
            --- exit 2
        "#]],
    );
    check(
        folder.path(),
        &["zoo", "generate", "--list", "--models", "sedan"],
        &expect![[r#"
            --- stdout
            name	category	body_style	length	width	height	wheelbase
            sedan	Car	sedan	4.77	1.83	1.46	2.79
            --- exit 0
        "#]],
    );
}

#[test]
fn pairs_that_are_none_end_with_2() {
    let folder = tempfile::tempdir().unwrap();
    let compare = |pairs: &str| {
        run(folder.path(), &["zoo", "compare", "--dataset", "none", "--pairs", pairs])
    };
    expect![[r#"
        --- stderr
        error: `sedan` is no pair
        hint: write MODEL=NAME, for example `sedan=Sedan4Door`
        --- exit 2
    "#]]
    .assert_eq(&compare("sedan"));
    assert!(compare("tank=Tank").contains("error: the zoo has no model `tank`\nhint: it has `"));
}
