//! Foreign models as a user imports them.

use std::fs;
use std::path::Path;

use expect_test::{Expect, expect};

use super::{check, run};

/// A box with two wheels, in centimetres, z up, front at -y.
const OBJ: &str = "\
o Car
v -90 -200 30
v 90 -200 30
v 90 200 30
v -90 200 30
v -90 -200 150
v 90 -200 150
v 90 200 150
v -90 200 150
g Body
usemtl Paint
f 1 4 3 2
f 5 6 7 8
f 1 2 6 5
f 3 4 8 7
g Glass
usemtl Clear
f 2 3 7 6
f 4 1 5 8
v -80 100 0
v -80 120 60
v -80 80 60
v 80 100 0
v 80 120 60
v 80 80 60
g Wheels
f 9 10 11
f 12 13 14
";

const HEAD: &str = "\
name = \"box\"
category = \"Car\"
body_style = \"sedan\"
scale = 0.01
forward = \"-y\"
up = \"+z\"
";

fn check_map(map: &str, arguments: &[&str], expected: &Expect) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ).unwrap();
    fs::write(folder.path().join("map.toml"), map).unwrap();
    let mut all = vec!["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"];
    all.extend(arguments);
    check(folder.path(), &all, expected);
}

#[test]
fn a_model_whose_names_tell_all_parts_is_written() {
    let map = format!(
        "{HEAD}[parts]\nroof = [\"Body\"]\nwindshield_F = [\"material:Clear\"]\n\"wheels_RL|wheels_RR\" = [\"Wheels\"]\n"
    );
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ).unwrap();
    fs::write(folder.path().join("map.toml"), map).unwrap();
    let arguments = ["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"];
    for _ in 0..2 {
        check(folder.path(), &arguments, &expect![[r""]]);
    }
    let mut files: Vec<_> = fs::read_dir(folder.path().join("zoo"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    files.sort();
    assert_eq!(files, ["box.glb", "imported.json"]);
    let text = run(folder.path(), &["zoo", "list", "zoo"]);
    assert!(text.contains("box") && text.contains("1.80    1.50    4.00"), "{text}");
}

#[test]
fn faces_that_no_name_tells_apart_make_a_partial_model() {
    let map = format!(
        "{HEAD}unlabeled = [\"Body\", \"Glass\"]\n[parts]\n\"wheels_RL|wheels_RR\" = [\"Wheels\"]\n"
    );
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ).unwrap();
    fs::write(folder.path().join("map.toml"), map).unwrap();
    let arguments = ["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"];
    check(folder.path(), &arguments, &expect![[r""]]);
    check(folder.path(), &["zoo", "list", "zoo"], &expect![[r""]]);
}

#[test]
fn unknown_names_are_listed_with_lines_to_paste() {
    let map = format!("{HEAD}[parts]\nroof = [\"Body\"]\nhood = [\n  \"Bonnet\",\n]\n");
    check_map(&map, &[], &expect![[r""]]);
    check_map(&map, &["--allow-unknown"], &expect![[r""]]);
}

#[test]
fn faults_of_a_map_are_told_with_their_line() {
    for (map, expected) in [
        (format!("{HEAD}[parts]\nbonnet = [\"Body\"]\n"), expect![[r""]]),
        (format!("{HEAD}[parts]\n\"hood|roof\" = [\"Body\"]\n"), expect![[r""]]),
        (HEAD.replace("+z", "up"), expect![[r""]]),
        (HEAD.replace("+z", "+y"), expect![[r""]]),
        (HEAD.replace("0.01", "1.0") + "unlabeled = [\"*\"]\n", expect![[r""]]),
        (HEAD.replace("scale = 0.01\n", ""), expect![[r""]]),
        (format!("{HEAD}ignored = []\n"), expect![[r""]]),
        (format!("{HEAD}sides = \"left\"\n"), expect![[r""]]),
        (format!("{HEAD}ignore = [\"\"]\n"), expect![[r""]]),
        (HEAD.replace("\"box\"", "\"../box\"") + "unlabeled = [\"*\"]\n", expect![[r""]]),
    ] {
        check_map(&map, &[], &expected);
    }
}

#[test]
fn parts_on_the_wrong_side_are_told_and_end_with_1() {
    let map = format!(
        "{HEAD}unlabeled = [\"Glass\"]\n[parts]\nroof = [\"Body\"]\nwheels_RL = [\"Wheels\"]\n"
    );
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ.replace("f 12 13 14\n", "")).unwrap();
    fs::write(folder.path().join("map.toml"), &map).unwrap();
    let arguments = ["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"];
    check(folder.path(), &arguments, &expect![[r""]]);
    fs::write(folder.path().join("map.toml"), format!("sides = \"geometry\"\n{map}")).unwrap();
    let text = run(folder.path(), &arguments);
    assert!(text.contains("wheels_RR\t1") && text.ends_with("--- exit 0\n"), "{text}");
}

#[test]
fn names_are_listed_and_a_template_is_itself_a_map() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ.replace("g Wheels", "g hood")).unwrap();
    check(folder.path(), &["zoo", "import", "car.obj", "--list"], &expect![[r""]]);
    let text = run(folder.path(), &["zoo", "import", "car.obj", "--template"]);
    let map = text.strip_prefix("--- stdout\n").unwrap().split("--- exit").next().unwrap();
    assert!(map.contains("\nhood = [\"hood\"]\n") && map.contains("\"Body\", # 8 faces"), "{map}");
    fs::write(folder.path().join("map.toml"), map.replace("scale = 1.0", "scale = 0.01")).unwrap();
    let text =
        run(folder.path(), &["zoo", "import", "car.obj", "--map", "map.toml", "--out", "zoo"]);
    assert!(text.ends_with("--- exit 0\n") && text.contains("car.partial.glb"), "{text}");
}

#[test]
fn what_cannot_be_read_is_told_with_file_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let import = |name: &str, content: &str, expected: &Expect| {
        fs::write(folder.path().join(name), content).unwrap();
        check(folder.path(), &["zoo", "import", name, "--list"], expected);
    };
    import("a.obj", "v 0 0 0\nv 1 0 0\nf 1 2 9\n", &expect![[r""]]);
    import("b.obj", "mtllib ../../x.mtl\n", &expect![[r""]]);
    import(
        "c.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "file:///etc/passwd", "byteLength": 9}]}"#,
        &expect![[r""]],
    );
    import(
        "d.ply",
        "ply\nformat ascii 1.0\nelement vertex 99999\nproperty float x\nend_header\n",
        &expect![[r""]],
    );
    import("e.stl", "solid\n", &expect![[r""]]);
    import("f.glb", "glTF", &expect![[r""]]);
    check(folder.path(), &["zoo", "import", "none.obj", "--list"], &expect![[r""]]);
    check(
        folder.path(),
        &["zoo", "import", "a.obj", "--map", "none.toml", "--out", "zoo"],
        &expect![[r""]],
    );
    assert!(!folder.path().join("zoo").exists());
}

/// The free models of the issue, where they are: names, sides and sizes.
#[test]
fn the_example_maps_fit_their_models() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let meshes = root.join("../shared/data/meshes");
    if !meshes.is_dir() {
        eprintln!("skipped: there is no {}", meshes.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for (map, model, line) in [
        ("asam-coupe", "asam-vehicle/vehicle_example.gltf", "1.62 x 1.30 x 3.85 m"),
        ("gazebo-hatchback", "gazebo/hatchback/meshes/hatchback.obj", "2.14 x 1.57 x 4.00 m"),
        ("gazebo-suv", "gazebo/suv/meshes/suv.obj", "2.60 x 2.16 x 5.02 m"),
        ("gazebo-prius", "gazebo/prius_hybrid/meshes/Hybrid.obj", "2.01 x 1.54 x 4.62 m"),
    ] {
        let map = root.join(format!("examples/maps/{map}.toml"));
        let model = meshes.join(model);
        let [map, model] = [&map, &model].map(|path| path.to_str().unwrap());
        let text = run(folder.path(), &["zoo", "import", model, "--map", map, "--out", "zoo"]);
        assert!(text.contains(line) && text.ends_with("--- exit 0\n"), "{text}");
        for wheel in ["wheels_FL", "wheels_FR", "wheels_RL", "wheels_RR"] {
            assert!(text.contains(&format!("{wheel}\t")), "{text}");
        }
    }
    let text = run(folder.path(), &["zoo", "check", "zoo", "--json"]);
    for kind in ["wrong-side", "wrong-end", "size", "upside-down", "backwards", "swapped"] {
        assert!(!text.contains(kind), "{text}");
    }
}
