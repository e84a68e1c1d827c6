//! Foreign models: what is read is right, and nothing that is read can do harm.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic like tests")]

use std::path::{Path, PathBuf};

use partpose::geometry::Extent;
use partpose::parts::PartClass;
use partpose::vehicle::check::check_partial;
use partpose::vehicle::import::{
    Axis, ForeignScene, ImportError, ImportMap, Imported, LineFault, MapError, PathFault, Pattern,
    PlyFault, Remark, Rule, Sides, Target, apply_map, read_scene,
};
use partpose::vehicle::{GlbError, ModelZoo, from_partial_glb, to_glb, to_partial_glb};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A box of 180 x 150 x 400 cm with z up and the front towards -y, one polygon concave, and two wheels in one group.
const OBJ: &str = "\
# a car
mtllib car.mtl
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
f 1/1/1 2/2/1 6/3/1 5/4/1
f -6//1 -5//1 \\
  -1//1 -2//1
g Glass
usemtl Glass
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
l 1 2
";

const MTL: &str = "newmtl Paint\nKd 0.8 0.1 0.1\nmap_Kd ../../../secret.png\nnewmtl Glass\nd 0.5\n";

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    }
}

fn rule(pattern: &str, target: &str) -> Rule {
    let target = match target {
        "ignore" => Target::Ignore,
        "unlabeled" => Target::Unlabeled,
        parts => Target::parse(parts).unwrap(),
    };
    Rule { pattern: Pattern::parse(pattern).unwrap(), target }
}

fn map(scale: f64, forward: &str, up: &str, rules: &[(&str, &str)]) -> ImportMap {
    ImportMap {
        name: "car".to_owned(),
        category: "Car".to_owned(),
        body_style: "sedan".to_owned(),
        scale,
        forward: Axis::parse(forward).unwrap(),
        up: Axis::parse(up).unwrap(),
        mirror: false,
        sides: Sides::Names,
        extent: None,
        mirrors_in_extent: false,
        rules: rules.iter().map(|(pattern, target)| rule(pattern, target)).collect(),
    }
}

fn obj_scene(text: &str) -> Result<ForeignScene, ImportError> {
    let folder = Folder::new();
    folder.write("car.mtl", MTL);
    read_scene(&folder.write("car.obj", text))
}

fn import_obj(map: &ImportMap) -> Imported {
    apply_map(&obj_scene(OBJ).unwrap(), map).unwrap()
}

/// Middle of the faces of a part, in the vehicle frame.
fn center(imported: &Imported, part: PartClass) -> [f64; 3] {
    let model = &imported.model;
    let faces = model.faces.iter().zip(&model.parts).filter(|(_, of)| **of == Some(part));
    let points: Vec<_> =
        faces.flat_map(|(f, _)| f).map(|at| model.vertices[*at as usize]).collect();
    assert!(!points.is_empty(), "no {}", part.name());
    [0, 1, 2].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / points.len() as f64)
}

#[test]
fn an_obj_is_read_in_groups_with_names_and_its_polygons_cut() {
    let scene = obj_scene(OBJ).unwrap();
    let seen: Vec<_> = scene
        .groups
        .iter()
        .map(|g| (g.path.as_str(), g.material.as_str(), g.faces.len()))
        .collect();
    assert_eq!(
        seen,
        [("Car/Body", "Paint", 8), ("Car/Glass", "Glass", 4), ("Car/Wheels", "Glass", 2)]
    );
    assert_eq!(scene.remarks, [Remark::NotTriangles(1)]);
}

#[test]
fn axes_unit_and_ground_follow_the_map_and_wheels_are_split_by_side() {
    let rules = [("Body", "roof"), ("Glass", "windshield_F"), ("Wheels", "wheels_RL|wheels_RR")];
    let imported = import_obj(&map(0.01, "-y", "+z", &rules));
    let extent = imported.model.extent;
    assert!((extent.to_vector() - Extent::new(1.8, 1.5, 4.0).to_vector()).norm() < 1e-6);
    // The file's front is -y and its up is +z: +x is the vehicle's left, which is -x in the vehicle frame.
    let left = center(&imported, PartClass::WheelRearLeft);
    assert!((left[0] + 0.8).abs() < 1e-6 && (left[2] + 1.0).abs() < 1e-6, "{left:?}");
    assert!(center(&imported, PartClass::WheelRearRight)[0] > 0.7);
    let lowest = imported.model.vertices.iter().map(|p| p.y).fold(f64::MIN, f64::max);
    assert!(lowest.abs() < 1e-9);
    assert!(imported.unknown.is_empty() && imported.unused.is_empty());
    // Right-handed axes keep faces outwards; a mirror turns them.
    let volume = |imported: &Imported| {
        let model = imported.model.filled_with(PartClass::Roof).unwrap();
        model.mesh().volume()
    };
    assert!((volume(&imported) - 8.64).abs() < 0.1);
    let mirrored = import_obj(&ImportMap { mirror: true, ..map(0.01, "-y", "+z", &rules) });
    assert!((volume(&mirrored) - 8.64).abs() < 0.1);
}

#[test]
fn the_closest_pattern_decides_and_equal_ones_are_refused() {
    let split = ("Wheels", "wheels_RL|wheels_RR");
    // Both the material and the group are called Glass: the group's name is nearer.
    let rules =
        [("material:Glass", "trunk"), ("node:Glass", "windshield_F"), ("Body", "roof"), split];
    let imported = import_obj(&map(0.01, "-y", "+z", &rules));
    assert!(imported.model.parts.contains(&Some(PartClass::WindshieldFront)));
    assert!(!imported.model.parts.contains(&Some(PartClass::Trunk)));
    let rules = [("Gl*", "trunk"), ("G*", "windshield_F"), ("*", "roof")];
    let error = apply_map(&obj_scene(OBJ).unwrap(), &map(0.01, "-y", "+z", &rules)).unwrap_err();
    assert!(matches!(error, MapError::Ambiguous { .. }), "{error}");
    assert!(error.to_string().contains("`Gl*` and `G*` name the group `Car/Glass`"));
}

#[test]
fn unknown_and_unused_names_are_listed_and_not_guessed() {
    let imported = import_obj(&map(0.01, "-y", "+z", &[("Body", "roof"), ("Bonnet", "hood")]));
    assert_eq!((imported.unknown.as_slice(), imported.unused.as_slice()), (&[1, 2][..], &[1][..]));
    assert_eq!(imported.model.unlabeled(), 6);
}

#[test]
fn a_wrong_side_is_told_and_put_right_by_geometry() {
    let text = OBJ.replace("f 12 13 14", "g Wheel_Right\nf 12 13 14");
    let scene = obj_scene(&text).unwrap();
    // +x is left, so `Wheels` at -x is the right one.
    let rules = [("Wheels", "wheels_RL"), ("Wheel_Right", "wheels_RR"), ("*", "unlabeled")];
    let mut map = map(0.01, "-y", "+z", &rules);
    let imported = apply_map(&scene, &map).unwrap();
    let told: Vec<_> =
        imported.wrong_sides.iter().map(|fault| (fault.part, fault.x > 0.0)).collect();
    assert_eq!(told, [(PartClass::WheelRearLeft, true), (PartClass::WheelRearRight, false)]);
    map.sides = Sides::Geometry;
    let imported = apply_map(&scene, &map).unwrap();
    assert!(imported.wrong_sides.is_empty());
    assert!(center(&imported, PartClass::WheelRearLeft)[0] < -0.7);
}

#[test]
fn mirrors_do_not_widen_the_cuboid_unless_asked() {
    let text =
        OBJ.to_owned() + "g Mirror\nv -110 -50 100\nv -90 -50 100\nv -90 -50 110\nf 15 16 17\n";
    let scene = obj_scene(&text).unwrap();
    let rules = [("Mirror", "mirror_R"), ("*", "unlabeled")];
    let mut map = map(0.01, "-y", "+z", &rules);
    let width = |map: &ImportMap| apply_map(&scene, map).unwrap().model.extent.width;
    assert!((width(&map) - 1.8).abs() < 1e-6);
    map.mirrors_in_extent = true;
    assert!((width(&map) - 2.0).abs() < 1e-6);
    map.extent = Some(Extent::new(1.7, 1.4, 3.9));
    assert!((width(&map) - 1.7).abs() < 1e-12);
}

#[test]
fn maps_that_make_no_model_say_why() {
    let scene = obj_scene(OBJ).unwrap();
    let check = |map: &ImportMap, expected: &str| {
        let error = apply_map(&scene, map).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
        assert!(!error.remedy().is_empty());
    };
    let all = [("*", "unlabeled")];
    check(&map(0.01, "+y", "-y", &all), "the same axis");
    check(&map(1.0, "-y", "+z", &all), "180 x 150 x 400 m large");
    check(&map(100.0, "-y", "+z", &all), "more than 1000 m");
    check(&map(f64::NAN, "-y", "+z", &all), "not a positive number");
    check(&map(0.01, "-y", "+z", &[("*", "ignore")]), "leaves no face");
    let name = ImportMap { name: "a\u{1b}[2J".to_owned(), ..map(0.01, "-y", "+z", &all) };
    check(&name, "the name is");
}

#[test]
fn our_own_models_come_back_through_the_import() {
    let folder = Folder::new();
    for model in ModelZoo::embedded().models {
        let path = folder.write("car.glb", to_glb(&model));
        let scene = read_scene(&path).unwrap();
        let names: Vec<&str> = PartClass::ALL.iter().map(|part| part.name()).collect();
        let rules: Vec<_> = names.iter().map(|name| (*name, *name)).collect();
        let imported = apply_map(&scene, &map(1.0, "+z", "+y", &rules)).unwrap();
        let back = imported.model.to_model().unwrap();
        assert!(imported.wrong_sides.is_empty() && imported.unknown.is_empty());
        assert_eq!(back.missing_parts(), model.missing_parts());
        assert!((back.mesh().volume() - model.mesh().volume()).abs() < 1e-3);
        for (part, area) in model.mesh().areas().iter() {
            assert!((back.mesh().areas().get(part).unwrap() - area).abs() < 1e-4);
        }
    }
}

/// A square of two triangles in a buffer, below two nodes that move and scale it.
fn gltf(uri: &str) -> Value {
    json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "Root", "children": [1], "scale": [2.0, 2.0, 2.0]},
            {"name": "Door", "mesh": 0, "translation": [1.0, 0.0, 0.0]}
        ],
        "meshes": [{"name": "DoorMesh", "primitives": [
            {"attributes": {"POSITION": 0}, "indices": 1, "material": 0}
        ]}],
        "materials": [{"name": "Paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "../../bomb.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12}
        ],
        "buffers": [{"uri": uri, "byteLength": 60}]
    })
}

fn gltf_bytes() -> Vec<u8> {
    let points = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

fn read_gltf(json: &Value, bytes: &[u8]) -> Result<ForeignScene, ImportError> {
    let folder = Folder::new();
    folder.write("secret.bin", gltf_bytes());
    folder.write("model/buffers/a b.bin", bytes);
    read_scene(&folder.write("model/car.gltf", json.to_string()))
}

#[test]
fn a_gltf_with_a_buffer_beside_it_is_read_with_its_transforms() {
    let scene = read_gltf(&gltf("buffers/a%20b.bin"), &gltf_bytes()).unwrap();
    let group = &scene.groups[0];
    assert_eq!((group.path.as_str(), group.node.as_str()), ("Root/Door", "Door"));
    assert_eq!((group.mesh.as_str(), group.material.as_str()), ("DoorMesh", "Paint"));
    let x: Vec<f64> = group.vertices.iter().map(|p| p.x).collect();
    assert_eq!(x, [2.0, 4.0, 4.0, 2.0]);
    assert_eq!(group.faces, [[0, 1, 2], [0, 2, 3]]);
}

#[test]
fn strips_and_fans_keep_the_sense_of_their_triangles() {
    for (mode, indices, expected) in
        [(5, [0_u16, 1, 3, 2], [[0, 1, 2], [2, 1, 3]]), (6, [0, 1, 2, 3], [[0, 1, 2], [0, 2, 3]])]
    {
        let mut json = gltf("buffers/a%20b.bin");
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        json["accessors"][1]["count"] = json!(4);
        let mut bytes = gltf_bytes()[..48].to_vec();
        bytes.extend(indices.iter().flat_map(|v| v.to_le_bytes()));
        bytes.resize(60, 0);
        let group = read_gltf(&json, &bytes).unwrap().groups.remove(0);
        // All triangles of the square face one way, whatever their first corner.
        let normal = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|at| group.vertices[at as usize]);
            (b - a).cross(&(c - a)).z
        };
        assert!(group.faces.iter().all(|face| normal(face) > 0.0), "mode {mode}");
        assert_eq!(group.faces.len(), expected.len());
    }
}

#[test]
fn no_buffer_outside_the_folder_is_opened() {
    for uri in [
        "../secret.bin",
        "%2e%2e/secret.bin",
        "buffers/../../secret.bin",
        "file:///etc/passwd",
        "file:../secret.bin",
        "https://example.org/car.bin",
        "/etc/passwd",
        "C:\\secret.bin",
        "..\\secret.bin",
    ] {
        let error = read_gltf(&gltf(uri), &gltf_bytes()).unwrap_err();
        let ImportError::Buffer { buffer: 0, source, .. } = &error else { panic!("{error:?}") };
        assert!(matches!(source, PathFault::Outside(_) | PathFault::Scheme(_)), "{uri}: {source}");
        assert!(error.to_string().contains("car.gltf") && error.remedy().is_some());
    }
    for uri in ["%", "%zz", "buffers", "none.bin", "data:,x", "data:text/plain;base64,?"] {
        assert!(read_gltf(&gltf(uri), &gltf_bytes()).is_err(), "{uri}");
    }
}

#[test]
fn every_corrupted_gltf_is_an_error() {
    let cases = [
        ("/accessors/0/componentType", json!(5125)),
        ("/accessors/0/type", json!("VEC2")),
        ("/accessors/0/count", json!(u64::MAX)),
        ("/accessors/0/count", json!(5)),
        ("/accessors/0/sparse", json!({"count": 1})),
        ("/accessors/1/componentType", json!(5126)),
        ("/accessors/1/componentType", json!(5120)),
        ("/accessors/1/type", json!("VEC3")),
        ("/accessors/1/count", json!(1_u64 << 62)),
        ("/accessors/1/count", json!(5)),
        ("/accessors/1/byteOffset", json!(u64::MAX)),
        ("/bufferViews/0/byteLength", json!(u64::MAX)),
        ("/bufferViews/0/buffer", json!(9)),
        ("/bufferViews/0/byteStride", json!(4)),
        ("/buffers/0/byteLength", json!(1_u64 << 40)),
        ("/buffers/0/byteLength", json!(59)),
        ("/nodes/1/children", json!([0])),
        ("/nodes/0/children", json!([1, 1])),
        ("/nodes/0/children", json!([77])),
        ("/nodes/0/scale", json!([0.0, 1.0, 1.0])),
        ("/nodes/0/scale", json!([1e200, 1e200, 1e200])),
        ("/nodes/1/mesh", json!(3)),
        ("/scenes/0/nodes", json!([9])),
        ("/scene", json!(9)),
        ("/meshes/0/primitives/0/mode", json!(7)),
        ("/meshes/0/primitives/0/mode", json!(1)),
        ("/meshes/0/primitives/0/attributes", json!({})),
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"])),
        ("/extensionsRequired", json!(["KHR_mesh_quantization"])),
    ];
    for (pointer, value) in cases {
        let mut json = gltf("buffers/a%20b.bin");
        match json.pointer_mut(pointer) {
            Some(place) => *place = value.clone(),
            None => {
                let (parent, key) = pointer.rsplit_once('/').unwrap();
                json.pointer_mut(parent).unwrap()[key] = value.clone();
            }
        }
        let error = read_gltf(&json, &gltf_bytes()).map(|_| ());
        let error = error.expect_err(&format!("{pointer} = {value} passed"));
        assert!(error.to_string().contains("car.gltf"), "{error}");
        assert!(error.remedy().is_some());
    }
    let mut json = gltf("buffers/a%20b.bin");
    json["extensionsRequired"] = json!(["KHR_materials_unlit", "KHR_texture_transform"]);
    assert!(read_gltf(&json, &gltf_bytes()).is_ok());
}

#[test]
fn nan_vertices_and_wild_indices_are_told_with_their_place() {
    let mut bytes = gltf_bytes();
    bytes[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    let error = read_gltf(&gltf("buffers/a%20b.bin"), &bytes).unwrap_err();
    let ImportError::Gltf { source: GlbError::Primitive { primitive, fault }, .. } = error else {
        panic!("{error:?}")
    };
    assert!(primitive.contains("node `Door`"), "{primitive}");
    assert_eq!(fault.to_string(), "vertex 1 is not finite");
    let mut bytes = gltf_bytes();
    bytes[50..52].copy_from_slice(&9_u16.to_le_bytes());
    let ImportError::Gltf { source, .. } =
        read_gltf(&gltf("buffers/a%20b.bin"), &bytes).unwrap_err()
    else {
        panic!()
    };
    assert!(source.to_string().contains("index 9 has no vertex: there are 4"), "{source}");
}

#[test]
fn a_small_gltf_cannot_make_endless_work_or_names() {
    // A hundred thousand nodes that each show a million triangles from the same bytes.
    let mut json = gltf("buffers/a%20b.bin");
    let node = json!({"mesh": 0});
    let mut nodes = vec![json!({"children": (1..=100_000).collect::<Vec<usize>>()})];
    nodes.extend(vec![node; 100_000]);
    json["nodes"] = json!(nodes);
    json["accessors"][1] =
        json!({"bufferView": 1, "componentType": 5121, "count": 3_000_000, "type": "SCALAR"});
    json["bufferViews"][1] = json!({"buffer": 0, "byteLength": 3_000_000});
    json["buffers"][0]["byteLength"] = json!(3_000_000);
    let error = read_gltf(&json, &vec![0; 3_000_000]).unwrap_err();
    assert!(matches!(error, ImportError::TooMany { what: "triangles", .. }), "{error}");
    // A chain of nodes, each below the one before: their paths together would take gigabytes.
    let name = "n".repeat(200);
    let chain = (0..5000).map(|at| json!({"name": name, "children": [at + 1], "mesh": 0}));
    let mut json = gltf("buffers/a%20b.bin");
    json["nodes"] = json!(chain.chain([json!({"mesh": 0})]).collect::<Vec<_>>());
    let error = read_gltf(&json, &gltf_bytes()).unwrap_err();
    assert!(matches!(error, ImportError::TooMany { what: "groups", .. }), "{error}");
}

#[test]
fn every_broken_obj_line_is_told_with_its_number() {
    for (line, expected) in [
        ("v 1 2", "2 numbers, where 3 are needed"),
        ("v 1 2 nan", "`nan` is not a finite number"),
        ("v 1 2 inf", "`inf` is not a finite number"),
        ("v 1 2 1e999", "`1e999` is not a finite number"),
        ("v a b c", "`a` is not a finite number"),
        ("f 1 2", "2 numbers, where 3 are needed"),
        ("f 1 2 99", "the face refers to vertex 99, but there are 14"),
        ("f 1 2 -99", "the face refers to vertex -99, but there are 14"),
        ("f 1 2 0", "`0` is not the number of a vertex"),
        ("f 1 2 x", "`x` is not the number of a vertex"),
        ("f 1 2 99999999999999999999", "is not the number of a vertex"),
        ("f 1 2 9223372036854775807", "the face refers to vertex 9223372036854775807"),
        ("f 1 2 -9223372036854775808", "the face refers to vertex -9223372036854775808"),
        ("mtllib", "`mtllib` without a name"),
        ("mtllib ../../etc/passwd", "leads out of the model's folder"),
        ("mtllib /etc/passwd", "leads out of the model's folder"),
        ("mtllib file:///etc/passwd", "leads out of the model's folder"),
    ] {
        let text = format!("{OBJ}{line}\n");
        let error = obj_scene(&text).unwrap_err();
        assert!(
            error.to_string().ends_with(&format!("car.obj`, line {}", text.lines().count())),
            "{error}"
        );
        let source = std::error::Error::source(&error).unwrap().to_string();
        assert!(source.contains(expected), "{line}: {source}");
        assert!(error.remedy().is_some());
    }
    let error = obj_scene("<html>\n<body>\n").unwrap_err();
    assert!(matches!(error, ImportError::Line { line: 1, source: LineFault::Keyword(_), .. }));
    assert!(matches!(obj_scene("v 1 2 3\n").unwrap_err(), ImportError::Empty { .. }));
}

#[test]
fn a_material_library_may_be_missing_but_not_broken() {
    let folder = Folder::new();
    let path = folder.write("car.obj", OBJ);
    let remark = &read_scene(&path).unwrap().remarks[0];
    assert!(remark.to_string().starts_with("line 2: there is no material library `car.mtl`"));
    for (text, expected) in [
        ("newmtl\n", "`newmtl` without a name"),
        ("newmtl a\nKd red\n", "`red` is not a finite number"),
        ("newmtl a\nKd 1 nan 0\n", "`nan` is not a finite number"),
    ] {
        folder.write("car.mtl", text);
        let error = read_scene(&path).unwrap_err();
        let line = text.lines().count();
        assert!(error.to_string().ends_with(&format!("car.mtl`, line {line}")), "{error}");
        assert!(std::error::Error::source(&error).unwrap().to_string().contains(expected));
    }
    folder.write("car.mtl", "newmtl Other\nmap_Kd /dev/zero\nmap_Ka file:///etc/passwd\n");
    let remarks = read_scene(&path).unwrap().remarks;
    assert!(
        remarks.iter().any(|remark| matches!(remark, Remark::NoMaterial { line: 13, .. })),
        "{remarks:?}"
    );
}

/// Two triangles with labels and colours, as text.
const PLY: &str = "\
ply
format ascii 1.0
comment made by hand
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
property int label
property uchar red
property uchar green
property uchar blue
element edge 1
property int vertex1
end_header
0 0 0
1 0 0
1 1 0
0 1 0
3 0 1 2 7 255 160 122
3 0 2 3 8 0 0 0
5
";

fn binary_ply(is_big: bool) -> Vec<u8> {
    let name = if is_big { "binary_big_endian" } else { "binary_little_endian" };
    let (header, _) = PLY.split_at(PLY.find("end_header").unwrap() + 11);
    let mut bytes = header.replace("ascii", name).into_bytes();
    let mut push = |word: [u8; 4]| {
        let mut word = word;
        if is_big {
            word.reverse();
        }
        bytes.extend(word);
    };
    for value in [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        push(value.to_le_bytes());
    }
    for (corners, label, color) in [([0, 1, 2], 7_i32, [255, 160, 122]), ([0, 2, 3], 8, [0; 3])] {
        bytes.push(3);
        for value in [corners[0], corners[1], corners[2], label] {
            bytes.extend(if is_big { value.to_be_bytes() } else { value.to_le_bytes() });
        }
        bytes.extend(color);
    }
    bytes.extend(if is_big { 5_i32.to_be_bytes() } else { 5_i32.to_le_bytes() });
    bytes
}

fn read_ply(bytes: impl AsRef<[u8]>) -> Result<ForeignScene, ImportError> {
    let folder = Folder::new();
    read_scene(&folder.write("car.ply", bytes))
}

#[test]
fn a_ply_is_read_alike_as_text_and_as_bytes_of_either_order() {
    let scene = read_ply(PLY).unwrap();
    let names: Vec<_> =
        scene.groups.iter().map(|g| (g.node.as_str(), g.material.as_str())).collect();
    assert_eq!(names, [("label=7", "color=255,160,122"), ("label=8", "color=0,0,0")]);
    assert_eq!(scene.groups[0].vertices.len(), 3);
    for is_big in [false, true] {
        assert_eq!(read_ply(binary_ply(is_big)).unwrap(), scene);
    }
}

#[test]
fn every_broken_ply_is_an_error_with_its_place() {
    for (from, to, expected) in [
        ("ply\n", "plx\n", "does not begin with `ply`"),
        ("format ascii 1.0", "format utf8 1.0", "header line 2: `format utf8 1.0`"),
        ("format ascii 1.0\n", "", "announces no `format`"),
        ("element vertex 4", "element vertex 4000000000", "more than 12000000 vertices"),
        ("element vertex 4", "element vertex 90000", "vertex 0: the file ends within it, 90000"),
        ("element vertex 4", "element vertex -1", "header line 4"),
        ("element face 2", "element face 18446744073709551615", "more than 4000000 triangles"),
        ("element edge 1", "element edge 99999999999999999", "edge 0: the file ends"),
        ("property float x", "property float w", "no x, y and z of vertices"),
        (
            "property list uchar int vertex_indices",
            "property int vertex_indices",
            "no `vertex_indices`",
        ),
        ("property list uchar int", "property list float int", "header line 9"),
        ("property list uchar int", "property list uchar complex", "header line 9"),
        ("end_header", "end", "header line 16: `end` is not understood"),
        ("1 1 0\n", "1 nan 0\n", "vertex 2: `NaN` is not a finite number"),
        ("1 1 0\n", "1 x 0\n", "vertex 2: `x` is not a finite number"),
        ("3 0 1 2", "3 0 1 4", "face 0 refers to vertex 4, but there are 4"),
        ("3 0 1 2", "3 0 1 -1", "face 0 refers to vertex -1"),
        ("3 0 1 2", "900 0 1 2", "face 0: the file ends within it"),
        ("3 0 1 2", "-3 0 1 2", "face 0: the file ends within it"),
        ("element face 2", "element tristrips 2", "triangle strips"),
        ("element face 2", "element faces 2", "announces no faces"),
    ] {
        let text = PLY.replacen(from, to, 1);
        assert_ne!(text, PLY, "{from}");
        let error = read_ply(&text).map(|_| ()).expect_err(to);
        let cause = std::error::Error::source(&error).map(ToString::to_string).unwrap_or_default();
        assert!(format!("{error}: {cause}").contains(expected), "{to}: {error}: {cause}");
        assert!(error.to_string().contains("car.ply") && error.remedy().is_some());
    }
    let full = binary_ply(false);
    for length in 0..full.len() {
        assert!(read_ply(&full[..length]).is_err(), "{length} bytes passed");
    }
    let error = read_ply("ply\n".to_owned() + &"comment\n".repeat(2000)).unwrap_err();
    assert!(matches!(error, ImportError::Ply { source: PlyFault::NoEnd(_), .. }));
}

#[test]
fn a_file_of_another_kind_is_told() {
    let folder = Folder::new();
    for name in ["car.fbx", "car", "car.obj.zip"] {
        let error = read_scene(&folder.write(name, "x")).unwrap_err();
        assert!(matches!(error, ImportError::Ending { .. }), "{error}");
    }
    assert!(matches!(read_scene(Path::new("/none/car.obj")), Err(ImportError::File(_))));
    let error = read_scene(&folder.write("car.glb", gltf("x").to_string())).unwrap_err();
    assert!(error.remedy().unwrap().contains(".gltf"), "{error}");
}

/// Reads, imports, checks and writes: whatever the bytes are, nothing panics, and what is written can be read.
fn survive(folder: &Folder, name: &str, bytes: &[u8]) -> bool {
    let path = folder.write(name, bytes);
    let Ok(scene) = read_scene(&path) else { return false };
    let rules = [("Wheels", "wheels_RL|wheels_RR"), ("*", "unlabeled")];
    for scale in [1.0, 0.01] {
        if let Ok(imported) = apply_map(&scene, &map(scale, "-y", "+z", &rules)) {
            for finding in check_partial(&imported.model) {
                assert!(!finding.to_string().is_empty() && !finding.remedy().is_empty());
            }
            from_partial_glb(&to_partial_glb(&imported.model)).unwrap();
        }
    }
    true
}

fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let model = &ModelZoo::embedded().models[0];
    let mut glb = to_glb(model);
    glb.truncate(40_000);
    let json = gltf(
        "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA",
    );
    let small = {
        let mut json = json.clone();
        json["buffers"][0] = json!({"byteLength": 60});
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut glb = b"glTF\x02\0\0\0".to_vec();
        glb.extend((28 + text.len() as u32 + 60).to_le_bytes());
        for (kind, chunk) in [(b"JSON", &text[..]), (b"BIN\0", &gltf_bytes()[..])] {
            glb.extend((chunk.len() as u32).to_le_bytes());
            glb.extend(kind);
            glb.extend(chunk);
        }
        glb
    };
    vec![
        ("a.gltf", json.to_string().into_bytes()),
        ("a.glb", small),
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("a.ply", PLY.as_bytes().to_vec()),
        ("b.ply", binary_ply(false)),
        ("c.ply", binary_ply(true)),
    ]
}

#[test]
fn the_seeds_of_the_mutations_are_readable() {
    let folder = Folder::new();
    folder.write("car.mtl", MTL);
    for (name, bytes) in seeds() {
        assert!(survive(&folder, name, &bytes), "{name}");
    }
}

/// More cases on demand: `PARTPOSE_FUZZ_CASES=200000 cargo test -p partpose --test import mutated`.
fn cases() -> u32 {
    std::env::var("PARTPOSE_FUZZ_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(2000)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn mutated_models_never_make_a_reader_panic(
        seed in 0..6_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4_u8), 0..6),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        thread_local! {
            static SHARED: (Folder, Vec<(&'static str, Vec<u8>)>) = {
                let folder = Folder::new();
                folder.write("car.mtl", MTL);
                (folder, seeds())
            };
        }
        SHARED.with(|(folder, seeds)| {
            let (name, bytes) = &seeds[seed];
            let mut bytes = bytes.clone();
            for (at, value, kind) in &changes {
                let at = at.index(bytes.len());
                match kind {
                    0 => bytes[at] = *value,
                    // Digits for digits keep a text readable and reach deeper.
                    1 => bytes[at] = b'0' + value % 10,
                    2 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, b" -09\ne./"[usize::from(value % 8)]),
                }
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            survive(folder, name, &bytes);
        });
    }

    #[test]
    fn mutated_material_libraries_never_make_a_reader_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        thread_local! {
            static FOLDER: Folder = Folder::new();
        }
        FOLDER.with(|folder| {
            let mut bytes = MTL.as_bytes().to_vec();
            for (at, value) in &changes {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            folder.write("car.mtl", bytes);
            survive(folder, "a.obj", OBJ.as_bytes());
        });
    }
}
