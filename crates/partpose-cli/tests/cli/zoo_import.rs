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
    let expected = expect![[r"
        --- stdout
        part	faces
        wheels_RL	1
        wheels_RR	1
        windshield_F	4
        roof	8
        --- stderr
        wrote `zoo/box.glb`: 14 faces, 1.80 x 1.50 x 4.00 m (width, height, length); left out 0 ignored and 0 without area
        hint: look for faults with `partpose zoo check zoo/box.glb`
        --- exit 0
    "]];
    // A second time it replaces what it wrote.
    for _ in 0..2 {
        check(folder.path(), &arguments, &expected);
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
    check(
        folder.path(),
        &arguments,
        &expect![[r#"
        --- stdout
        part	faces
        wheels_RL	1
        wheels_RR	1
        unlabeled	12
        --- stderr
        wrote `zoo/box.partial.glb`: 14 faces, 1.80 x 1.50 x 4.00 m (width, height, length); left out 0 ignored and 0 without area
        hint: 12 faces have no part yet: `partpose zoo annotate` gives them theirs
        hint: look for faults with `partpose zoo check zoo/box.partial.glb`
        --- exit 0
    "#]],
    );
    check(
        folder.path(),
        &["zoo", "list", "zoo"],
        &expect![[r#"
        --- stderr
        error: cannot read the model `zoo/box.partial.glb`
          caused by: the parts make no model
          caused by: 12 of 14 faces have no part
        hint: give the other faces their parts with `partpose zoo annotate`
        --- exit 2
    "#]],
    );
}

#[test]
fn unknown_names_are_listed_with_lines_to_paste() {
    let map = format!("{HEAD}[parts]\nroof = [\"Body\"]\nhood = [\n  \"Bonnet\",\n]\n");
    check_map(
        &map,
        &[],
        &expect![[r#"
        --- stderr
        warning: `map.toml` line 10: no name in `car.obj` fits `Bonnet`
        warning: the map does not know `Car/Glass` (material `Clear`, 4 faces)
        warning: the map does not know `Car/Wheels` (material `Clear`, 2 faces)
        error: the map `map.toml` and the names in `car.obj` do not fit: 2 unknown, 1 without a use
        hint: give each a part under `[parts]`, or put it into `ignore` (interior) or `unlabeled` (parts that no name tells apart); `--allow-unknown` takes all for unlabeled. To begin with:
          unlabeled = ["Glass", "Wheels"]
        --- exit 2
    "#]],
    );
    check_map(
        &map,
        &["--allow-unknown"],
        &expect![[r#"
        --- stdout
        part	faces
        roof	8
        unlabeled	6
        --- stderr
        warning: `map.toml` line 10: no name in `car.obj` fits `Bonnet`
        warning: the map does not know `Car/Glass` (material `Clear`, 4 faces)
        warning: the map does not know `Car/Wheels` (material `Clear`, 2 faces)
        wrote `zoo/box.partial.glb`: 14 faces, 1.80 x 1.50 x 4.00 m (width, height, length); left out 0 ignored and 0 without area
        hint: 6 faces have no part yet: `partpose zoo annotate` gives them theirs
        hint: look for faults with `partpose zoo check zoo/box.partial.glb`
        --- exit 1
    "#]],
    );
}

#[test]
fn faults_of_a_map_are_told_with_their_line() {
    for (map, expected) in [
        (
            format!("{HEAD}[parts]\nbonnet = [\"Body\"]\n"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 8: `bonnet` is no part
            hint: docs/cad.md lists the 29 parts; `ignore` and `unlabeled` stand above `[parts]`
            --- exit 2
        "#]],
        ),
        (
            format!("{HEAD}[parts]\n\"hood|roof\" = [\"Body\"]\n"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 8: `hood|roof` cannot be told apart by side and end
            hint: join a left and a right part, a front and a rear one, or all four
            --- exit 2
        "#]],
        ),
        (
            HEAD.replace("+z", "up"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 6: `up` is no axis
            hint: axes are `+x`, `-x`, `+y`, `-y`, `+z` and `-z`
            --- exit 2
        "#]],
        ),
    ] {
        check_map(&map, &[], &expected);
    }
}

#[test]
fn settings_that_make_no_model_are_told() {
    for (map, expected) in [
        (
            HEAD.replace("+z", "+y"),
            expect![[r#"
            --- stderr
            error: cannot use the map `map.toml`
              caused by: `forward` and `up` lie along the same axis
            hint: give the axes of the file that point to the front and to the roof, such as `forward = "+x"`, `up = "+z"`
            --- exit 2
        "#]],
        ),
        (
            HEAD.replace("0.01", "1.0") + "unlabeled = [\"*\"]\n",
            expect![[r#"
            --- stderr
            error: cannot use the map `map.toml`
              caused by: the model would be 180 x 150 x 400 m large (width, height, length), where sides are 0.01 to 100 m
            hint: `scale` is the length of the file's unit in metres: 1 for metres, 0.01 for centimetres, 0.001 for millimetres, 0.0254 for inches; `ignore` leaves out what does not belong to the vehicle
            --- exit 2
        "#]],
        ),
        (
            HEAD.replace("scale = 0.01\n", ""),
            expect![[r#"
            --- stderr
            error: `map.toml` line 1: missing field `scale`
            hint: `partpose zoo import FILE --template` prints a map to begin with; docs/cad.md tells the format
            --- exit 2
        "#]],
        ),
        (
            format!("{HEAD}ignored = []\n"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 7: unknown field `ignored`, expected one of `name`, `category`, `body_style`, `scale`, `forward`, `up`, `mirror`, `sides`, `extent`, `mirrors_in_extent`, `ignore`, `unlabeled`, `parts`
            hint: `partpose zoo import FILE --template` prints a map to begin with; docs/cad.md tells the format
            --- exit 2
        "#]],
        ),
        (
            format!("{HEAD}sides = \"left\"\n"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 7: `left` tells no sides
            hint: `sides` is "names" or "geometry"
            --- exit 2
        "#]],
        ),
        (
            format!("{HEAD}ignore = [\"\"]\n"),
            expect![[r#"
            --- stderr
            error: `map.toml` line 7: the pattern `` has an empty term
            hint: write a name, or several terms joined by ` + `
            --- exit 2
        "#]],
        ),
        (
            HEAD.replace("\"box\"", "\"../box\"") + "unlabeled = [\"*\"]\n",
            expect![[r#"
            --- stderr
            error: the model name `../box` cannot name a file of its own
            hint: use letters, digits, `_`, `-` and `.`, each name once
            --- exit 2
        "#]],
        ),
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
    check(
        folder.path(),
        &arguments,
        &expect![[r#"
        --- stdout
        part	faces
        wheels_RL	1
        roof	8
        unlabeled	4
        --- stderr
        warning: `Car/Wheels` is mapped to `wheels_RL`, but lies 0.80 m on the right
        hint: if `forward` and `up` are right, the names are wrong: exchange them, or write `sides = "geometry"` into the map; `mirror = true` is for files with left-handed axes
        wrote `zoo/box.partial.glb`: 13 faces, 1.80 x 1.50 x 4.00 m (width, height, length); left out 0 ignored and 0 without area
        hint: 4 faces have no part yet: `partpose zoo annotate` gives them theirs
        hint: look for faults with `partpose zoo check zoo/box.partial.glb`
        --- exit 1
    "#]],
    );
    fs::write(folder.path().join("map.toml"), format!("sides = \"geometry\"\n{map}")).unwrap();
    let text = run(folder.path(), &arguments);
    assert!(text.contains("wheels_RR\t1") && text.ends_with("--- exit 0\n"), "{text}");
}

#[test]
fn names_are_listed_and_a_template_is_itself_a_map() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("car.obj"), OBJ.replace("g Wheels", "g hood")).unwrap();
    check(
        folder.path(),
        &["zoo", "import", "car.obj", "--list"],
        &expect![[r#"
        --- stdout
        node	mesh	material	faces	center	size	path
        Body	Car	Paint	8	0.000 0.000 90.000	180.000 400.000 120.000	Car/Body
        Glass	Car	Clear	4	0.000 0.000 90.000	180.000 400.000 120.000	Car/Glass
        hood	Car	Clear	2	0.000 100.000 30.000	160.000 40.000 60.000	Car/hood
        --- exit 0
    "#]],
    );
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
    import(
        "a.obj",
        "v 0 0 0\nv 1 0 0\nf 1 2 9\n",
        &expect![[r#"
        --- stderr
        error: cannot read `a.obj`, line 3
          caused by: the face refers to vertex 9, but there are 2
        hint: the file is damaged or made by a faulty program: export it again
        --- exit 2
    "#]],
    );
    import(
        "b.obj",
        "mtllib ../../x.mtl\n",
        &expect![[r#"
        --- stderr
        error: cannot read `b.obj`, line 1
          caused by: `../../x.mtl` leads out of the model's folder
        hint: name the material library by its path within the model's folder, or remove the line: of materials only the names are used
        --- exit 2
    "#]],
    );
    import(
        "c.gltf",
        r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "file:///etc/passwd", "byteLength": 9}]}"#,
        &expect![[r#"
            --- stderr
            error: cannot read buffer 0 of the model `c.gltf`
              caused by: `file:///etc/passwd` is a URI with a scheme
            hint: put the buffer beside the model and name it by its path within that folder, or export one `.glb` file
            --- exit 2
        "#]],
    );
}

#[test]
fn other_files_than_models_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let import = |name: &str, content: &str, expected: &Expect| {
        fs::write(folder.path().join(name), content).unwrap();
        check(folder.path(), &["zoo", "import", name, "--list"], expected);
    };
    import(
        "d.ply",
        "ply\nformat ascii 1.0\nelement vertex 99999\nproperty float x\nend_header\n",
        &expect![[r#"
            --- stderr
            error: cannot read the model `d.ply`
              caused by: vertex 0: the file ends within it, 99999 are announced
            hint: the file is damaged or made by a faulty program: export it again
            --- exit 2
        "#]],
    );
    import(
        "e.stl",
        "solid\n",
        &expect![[r#"
        --- stderr
        error: `e.stl` ends in none of `.glb`, `.gltf`, `.obj` and `.ply`
        hint: export the model as glTF 2.0, OBJ or PLY
        --- exit 2
    "#]],
    );
    import(
        "f.glb",
        "glTF",
        &expect![[r#"
        --- stderr
        error: cannot read the model `f.glb`
          caused by: truncated: 8 bytes are announced, 4 are there
        hint: copy or export the file again
        --- exit 2
    "#]],
    );
    check(
        folder.path(),
        &["zoo", "import", "none.obj", "--list"],
        &expect![[r#"
        --- stderr
        error: cannot read `none.obj`
          caused by: No such file or directory (os error 2)
        --- exit 2
    "#]],
    );
    check(
        folder.path(),
        &["zoo", "import", "e.stl", "--map", "none.toml", "--out", "zoo"],
        &expect![[r#"
            --- stderr
            error: cannot read `none.toml`
              caused by: No such file or directory (os error 2)
            --- exit 2
        "#]],
    );
    assert!(!folder.path().join("zoo").exists());
}

/// The free models of the issue, where they are: names, sides and sizes.
#[test]
#[expect(
    clippy::print_stderr,
    reason = "whoever runs the tests should know what they did not test"
)]
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
