//! The zoo on disk: what is written is read back, and nothing that is read can do harm.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic like tests")]

use std::{collections::BTreeSet, fs, path::Path};

use partpose::geometry::{Extent, Point3};
use partpose::parts::PartClass;
use partpose::vehicle::{
    GlbError, MAX_COORDINATE, Mesh, ModelZoo, PrimitiveFault, VehicleModel, ZooError, from_glb,
    to_glb,
};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Two parts that share an edge.
fn model(name: &str) -> VehicleModel {
    let corners = [[-0.5, 0.0, 1.0], [0.5, 0.0, 1.0], [-0.5, -1.25, 0.75], [0.5, -1.25, -0.5]];
    let mesh = Mesh {
        vertices: corners.map(Point3::from).to_vec(),
        faces: vec![[0, 1, 2], [2, 1, 3]],
        parts: vec![PartClass::Hood, PartClass::WindshieldFront],
    };
    let extent = Extent::new(1.8, 1.45, 4.7);
    VehicleModel::new(name, "Car", "sedan", extent, mesh).unwrap()
}

/// JSON and bytes of a GLB.
fn parts_of(glb: &[u8]) -> (Value, Vec<u8>) {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&glb[20..20 + length]).unwrap(), glb[28 + length..].to_vec())
}

fn glb_of(json: &Value, bytes: &[u8]) -> Vec<u8> {
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    glb.extend((28 + json.len() as u32 + bytes.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", bytes)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

/// The model's GLB after its JSON was changed.
fn changed(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let (mut json, bytes) = parts_of(&to_glb(&model("car")));
    change(&mut json);
    glb_of(&json, &bytes)
}

/// Sets what a JSON pointer points to.
fn with(pointer: &str, value: &Value) -> Vec<u8> {
    changed(|json| {
        if let Some(place) = json.pointer_mut(pointer) {
            *place = value.clone();
        } else {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            json.pointer_mut(parent).unwrap()[key] = value.clone();
        }
    })
}

/// Faces by their corners' coordinates, starting at the smallest corner: independent of any order.
fn face_set(mesh: &Mesh) -> BTreeSet<(u8, [[u64; 3]; 3])> {
    let key = |index: u32| mesh.vertices[index as usize].coords.map(|v| (v + 0.0).to_bits()).into();
    let faces = mesh.faces.iter().zip(&mesh.parts).map(|(face, part)| {
        let mut corners = face.map(key);
        let first = (0..3).min_by_key(|at| corners[*at]).unwrap();
        corners.rotate_left(first);
        (part.id(), corners)
    });
    faces.collect()
}

#[test]
fn axes_on_disk_are_those_of_gltf() {
    let (json, bytes) = parts_of(&to_glb(&model("car")));
    assert_eq!(json["nodes"][0]["extras"]["partpose"]["extent"]["width"], 1.8);
    assert_eq!(json["meshes"][0]["name"], "windshield_F");
    // Vehicle (0.5, -1.25, -0.5), right, up and behind, is (-0.5, 1.25, -0.5) in glTF.
    let words: Vec<f32> =
        bytes[..36].chunks(4).map(|w| f32::from_le_bytes(w.try_into().unwrap())).collect();
    assert_eq!(words[6..], [-0.5, 1.25, -0.5]);
}

#[test]
fn the_same_model_gives_the_same_bytes_and_survives_a_round_trip() {
    let glb = to_glb(&model("car"));
    assert_eq!(glb, to_glb(&model("car")));
    let read = from_glb(&glb).unwrap();
    assert_eq!(read.mesh().vertices.len(), 4, "the shared edge has two vertices, not four");
    assert_eq!(to_glb(&read), glb);
    assert_eq!((read.name(), read.body_style()), ("car", "sedan"));
    assert_eq!(read.extent(), Extent::new(1.8, 1.45, 4.7));
}

#[test]
fn node_transforms_are_applied_and_a_mirror_keeps_faces_outwards() {
    let moved = from_glb(&with("/nodes/0/translation", &json!([1.0, 2.0, 3.0]))).unwrap();
    assert_eq!(moved.mesh().vertices[0], Point3::new(-1.5, -3.25, 3.75));
    let scaled = from_glb(&with("/nodes/0/scale", &json!([-1.0, 1.0, 1.0]))).unwrap();
    let mirrored = model("car").mesh().mirrored();
    let positions = |mesh: &Mesh| face_set(mesh).into_iter().map(|(_, f)| f).collect::<Vec<_>>();
    assert_eq!(positions(scaled.mesh()), positions(&mirrored));
    let half_turn = json!([0.0, 1.0, 0.0, 0.0]);
    let turned = from_glb(&with("/nodes/0/rotation", &half_turn)).unwrap();
    assert!((turned.mesh().vertices[0] - Point3::new(0.5, -1.25, -0.75)).norm() < 1e-12);
}

#[test]
fn a_model_that_is_inside_out_is_turned_round() {
    for model in ModelZoo::embedded().models {
        let (json, mut bytes) = parts_of(&to_glb(&model));
        for accessor in json["accessors"].as_array().unwrap() {
            if accessor["type"] != "SCALAR" {
                continue;
            }
            let size = match accessor["componentType"].as_u64().unwrap() {
                5121 => 1,
                5123 => 2,
                _ => 4,
            };
            let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
            let offset = |of: &Value| of["byteOffset"].as_u64().unwrap_or(0) as usize;
            let start = offset(view) + offset(accessor);
            let length = size * accessor["count"].as_u64().unwrap() as usize;
            for face in bytes[start..start + length].chunks_exact_mut(3 * size) {
                let (first, second) = face.split_at_mut(size);
                first.swap_with_slice(&mut second[..size]);
            }
        }
        let outward = from_glb(&to_glb(&model)).unwrap();
        let turned = from_glb(&glb_of(&json, &bytes)).unwrap();
        assert!(turned.mesh().is_closed() && turned.mesh().volume() > 0.0, "{}", model.name());
        assert_eq!(face_set(turned.mesh()), face_set(outward.mesh()), "{}", model.name());
    }
}

#[test]
fn an_open_model_keeps_its_faces_as_they_are() {
    let plain = model("car");
    let mut mesh = plain.mesh().clone();
    mesh.faces.iter_mut().for_each(|face| face.swap(0, 1));
    let turned = VehicleModel::new("car", "Car", "sedan", plain.extent(), mesh).unwrap();
    for model in [plain, turned] {
        let read = from_glb(&to_glb(&model)).unwrap();
        assert_eq!(face_set(read.mesh()), face_set(model.mesh()));
    }
}

#[test]
fn blenders_counters_and_other_places_for_names_and_extras_are_understood() {
    let model = from_glb(&with("/materials/1/name", &json!("hood.001"))).unwrap();
    assert!(model.mesh().parts.contains(&PartClass::Hood));
    let glb = changed(|json| {
        json["materials"][0]["name"] = json!("Material");
        let extras = json["nodes"][0]["extras"].take();
        json["nodes"][0].as_object_mut().unwrap().remove("extras");
        json["asset"]["extras"] = extras;
    });
    assert!(from_glb(&glb).unwrap().mesh().parts.contains(&PartClass::WindshieldFront));
}

#[test]
fn every_corrupted_file_is_an_error() {
    let cases: Vec<(&str, Value)> = vec![
        ("/accessors/0/componentType", json!(5120)),
        ("/accessors/0/componentType", json!(5125)),
        ("/accessors/0/type", json!("VEC2")),
        ("/accessors/0/count", json!(4)),
        ("/accessors/0/count", json!(u64::MAX)),
        ("/accessors/0/count", json!(0)),
        ("/accessors/0/count", json!(-1)),
        ("/accessors/0/byteOffset", json!(u64::MAX)),
        ("/accessors/0/byteOffset", json!(1_u64 << 40)),
        ("/accessors/0/sparse", json!({"count": 1})),
        ("/accessors/0/bufferView", Value::Null),
        ("/accessors/0/bufferView", json!(99)),
        ("/accessors/1/componentType", json!(5126)),
        ("/accessors/1/componentType", json!(5124)),
        ("/accessors/1/componentType", json!(0)),
        ("/accessors/1/count", json!(2)),
        ("/accessors/1/count", json!(300)),
        ("/accessors/1/count", json!(1u64 << 62)),
        ("/accessors/1/type", json!("VEC3")),
        ("/accessors/1/bufferView", json!(0)),
        ("/bufferViews/0/byteLength", json!(u64::MAX)),
        ("/bufferViews/0/byteLength", json!(3)),
        ("/bufferViews/0/byteOffset", json!(u64::MAX)),
        ("/bufferViews/0/byteStride", json!(4)),
        ("/bufferViews/0/byteStride", json!(0)),
        ("/bufferViews/0/byteStride", json!(u64::MAX)),
        ("/bufferViews/0/buffer", json!(1)),
        ("/bufferViews/1/byteStride", json!(8)),
        ("/buffers/0/uri", json!("../../etc/passwd")),
        ("/buffers/0/uri", json!("data:application/octet-stream;base64,AAAA")),
        ("/buffers/0/uri", json!("%")),
        ("/buffers/0/byteLength", json!(1 << 30)),
        ("/buffers", json!([])),
        ("/accessors", json!([])),
        ("/meshes", json!([])),
        ("/nodes/0/children", json!([0])),
        ("/nodes/0/children", json!([1, 1])),
        ("/nodes/0/children", json!([7])),
        ("/nodes/0/children", json!([])),
        ("/nodes/1/children", json!([0])),
        ("/nodes/1/mesh", json!(2)),
        ("/nodes/0/scale", json!([0.0, 1.0, 1.0])),
        ("/nodes/0/scale", json!([1e300, 1e300, 1.0])),
        ("/nodes/0/rotation", json!([0.0, 0.0, 0.0, 0.0])),
        ("/nodes/0/translation", json!([0.0, 1e9, 0.0])),
        ("/nodes/0/matrix", json!([1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])),
        ("/nodes/0/matrix", json!([1, 2, 3])),
        ("/nodes/0/extras", json!({})),
        ("/nodes/0/extras/partpose/extent/width", json!(-1.0)),
        ("/nodes/0/extras/partpose/extent/width", json!(1e9)),
        ("/nodes/0/extras/partpose/extent/width", json!(101.0)),
        ("/nodes/0/extras/partpose/extent/height", json!(0.009)),
        ("/nodes/0/extras/partpose/extent/length", json!(0.0)),
        ("/nodes/0/extras/partpose/extent/width", json!("wide")),
        ("/nodes/0/extras/partpose/name", json!("")),
        ("/nodes/0/extras/partpose/name", json!("a\u{1b}[2Jb")),
        ("/scenes/0/nodes", json!([3])),
        ("/scene", json!(1)),
        ("/meshes/0/primitives/0/mode", json!(5)),
        ("/meshes/0/primitives/0/attributes", json!({"NORMAL": 0})),
        ("/meshes/0/primitives/0/indices", json!(0)),
        ("/meshes/0/primitives/0/indices", json!(99)),
        ("/extensionsRequired", json!(["KHR_draco_mesh_compression"])),
    ];
    for (pointer, value) in cases {
        let error = from_glb(&with(pointer, &value)).map(|_| ());
        let error = error.expect_err(&format!("{pointer} = {value} passed"));
        assert!(!error.to_string().is_empty() && !error.remedy().is_empty());
    }
}

#[test]
fn nan_and_far_vertices_and_wild_indices_are_errors() {
    let (json, bytes) = parts_of(&to_glb(&model("car")));
    for value in [f32::NAN, f32::INFINITY, 2.0 * MAX_COORDINATE as f32] {
        let mut bytes = bytes.clone();
        bytes[4..8].copy_from_slice(&value.to_le_bytes());
        let error = from_glb(&glb_of(&json, &bytes)).unwrap_err();
        let GlbError::Primitive { fault: PrimitiveFault::Position { vertex: 0, .. }, .. } = error
        else {
            panic!("{error}");
        };
    }
    let mut bytes = bytes;
    bytes[36..40].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = from_glb(&glb_of(&json, &bytes)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "primitive 0 of mesh 0 (material `windshield_F`, mesh `windshield_F`, node `windshield_F`): \
         index 4294967295 has no vertex: there are 3"
    );
}

#[test]
fn a_small_file_cannot_make_endless_work() {
    // A thousand nodes that each show the same mesh of a million triangles without area.
    let triangles = 1_000_000;
    let glb = changed(|json| {
        let children: Vec<usize> = (1..=1000).collect();
        json["nodes"][0]["children"] = json!(children);
        let node = json!({"mesh": 0});
        json["nodes"].as_array_mut().unwrap().truncate(1);
        json["nodes"].as_array_mut().unwrap().extend(vec![node; 1000]);
        json["accessors"][1] = json!({
            "bufferView": 1, "componentType": 5121, "type": "SCALAR", "count": 3 * triangles
        });
        json["bufferViews"][1] =
            json!({"buffer": 0, "byteOffset": 36, "byteLength": 3 * triangles});
        json["buffers"][0]["byteLength"] = json!(36 + 3 * triangles);
    });
    let (json, mut bytes) = parts_of(&glb);
    bytes.truncate(36);
    bytes.resize(36 + 3 * triangles, 0);
    let error = from_glb(&glb_of(&json, &bytes)).unwrap_err();
    assert!(matches!(error, GlbError::TooManyFaces), "{error}");
}

#[test]
fn an_unknown_part_is_named_with_a_remedy() {
    let glb = changed(|json| {
        for place in ["materials", "meshes"] {
            json[place][1]["name"] = json!("bonnet\n");
        }
        json["nodes"][2]["name"] = json!("bonnet");
    });
    let error = from_glb(&glb).unwrap_err();
    assert_eq!(
        error.to_string(),
        "primitive 0 of mesh 1 (material `bonnet\\n`, mesh `bonnet\\n`, node `bonnet`): \
         neither material, mesh nor node is named after a part"
    );
    assert!(error.remedy().contains("`wheels_FL`"));
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let glb = to_glb(&model("car"));
    for length in 0..glb.len() {
        assert!(from_glb(&glb[..length]).is_err(), "{length} of {} bytes passed", glb.len());
    }
}

#[test]
fn a_zoo_is_read_in_the_order_of_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new/zoo");
    let zoo = ModelZoo { models: ["b", "a"].map(model).to_vec() };
    zoo.save(&path).unwrap();
    zoo.save(&path).unwrap();
    let read = ModelZoo::load(&path).unwrap();
    assert_eq!(read.models.iter().map(VehicleModel::name).collect::<Vec<_>>(), ["a", "b"]);
    let single = ModelZoo::load(&path.join("b.glb")).unwrap();
    assert_eq!(single.models.len(), 1);
}

#[test]
fn bad_zoos_are_named_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let check = |outcome: Result<(), ZooError>, expected: &str| {
        let error = outcome.unwrap_err();
        let text = error.to_string().replace(&folder.path().display().to_string(), "ZOO");
        assert_eq!(text, expected);
        error.remedy()
    };
    let load = |path: &Path| ModelZoo::load(path).map(|_| ());
    let remedy = check(load(folder.path()), "the zoo `ZOO` holds no `.glb` file");
    assert!(remedy.unwrap().contains("zoo carve"));
    let remedy = check(load(&folder.path().join("none")), "cannot read `ZOO/none`");
    assert!(remedy.unwrap().contains("zoo carve"));

    fs::write(folder.path().join("x.glb"), to_glb(&model("car"))).unwrap();
    let zoo = ModelZoo { models: vec![model("car")] };
    check(zoo.save(folder.path()), "the folder holds `ZOO/x.glb`, which is not of this zoo");
    fs::write(folder.path().join("y.glb"), to_glb(&model("car"))).unwrap();
    check(load(folder.path()), "`ZOO/x.glb` and `ZOO/y.glb` both hold a model named `car`");
    fs::write(folder.path().join("a.glb"), b"glTF").unwrap();
    check(load(folder.path()), "cannot read the model `ZOO/a.glb`");

    for name in ["../car", "", ".hidden", "a/b", "a\0b"] {
        let zoo = ModelZoo { models: vec![model(name)] };
        assert!(matches!(zoo.save(folder.path()), Err(ZooError::Name { .. })), "{name:?}");
    }
    let twice = ModelZoo { models: vec![model("car"), model("Car")] };
    assert!(matches!(twice.save(folder.path()), Err(ZooError::Name { .. })));
}

/// Meshes of which no two vertices coincide, with coordinates that 32 bits hold.
fn any_mesh() -> impl Strategy<Value = Mesh> {
    let positions = prop::collection::btree_set((-40_i32..40, -40_i32..40, -40_i32..40), 3..40);
    positions.prop_flat_map(|positions| {
        let count = positions.len() as u32;
        let vertices: Vec<Point3> = positions
            .iter()
            .map(|(x, y, z)| Point3::from([x, y, z].map(|v| f64::from(*v) / 16.0)))
            .collect();
        let face = (0..count, 1..count - 1, 1..29_u8, any::<bool>()).prop_map(
            move |(first, step, part, turned)| {
                let corners = [first, (first + step) % count, (first + step + 1) % count];
                let corners = if turned { [corners[0], corners[2], corners[1]] } else { corners };
                (corners, PartClass::from_id(part).unwrap())
            },
        );
        prop::collection::vec(face, 1..60).prop_map(move |faces| {
            let (faces, parts) = faces.into_iter().unzip();
            Mesh { vertices: vertices.clone(), faces, parts }
        })
    })
}

proptest! {
    #[test]
    fn reading_gives_back_what_was_written(mesh in any_mesh()) {
        let extent = Extent::new(1.7, 1.5, 4.1);
        let model = VehicleModel::new("n\"ä", "Car", "suv", extent, mesh).unwrap();
        let glb = to_glb(&model);
        let read = from_glb(&glb).unwrap();
        let used: BTreeSet<u32> = model.mesh().faces.iter().flatten().copied().collect();
        prop_assert_eq!(read.mesh().vertices.len(), used.len());
        prop_assert_eq!(read.mesh().faces.len(), model.mesh().faces.len());
        prop_assert_eq!(face_set(read.mesh()), face_set(model.mesh()));
        prop_assert_eq!(
            (read.name(), read.category(), read.extent()),
            (model.name(), model.category(), model.extent())
        );
        prop_assert_eq!(to_glb(&read), glb);
    }

    #[test]
    fn mutated_bytes_never_make_the_reader_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in any::<prop::sample::Index>(),
        cuts in any::<bool>(),
    ) {
        let mut glb = to_glb(&model("car"));
        for (at, value) in &changes {
            let at = at.index(glb.len());
            glb[at] = *value;
        }
        if cuts {
            glb.truncate(cut.index(glb.len()));
        }
        let _ = from_glb(&glb);
    }

    #[test]
    fn mutated_numbers_never_make_the_reader_panic(
        at in any::<prop::sample::Index>(),
        value in prop_oneof![
            Just(json!(0)), Just(json!(1)), Just(json!(-1)), Just(json!(5121)), Just(json!(5123)),
            Just(json!(u32::MAX)), Just(json!(u64::MAX)), Just(json!(1e300)), Just(json!([])),
            Just(Value::Null), (0..400).prop_map(|v| json!(v)),
        ],
    ) {
        fn leaves<'a>(value: &'a mut Value, found: &mut Vec<&'a mut Value>) {
            match value {
                Value::Array(items) => items.iter_mut().for_each(|item| leaves(item, found)),
                Value::Object(items) => items.values_mut().for_each(|item| leaves(item, found)),
                leaf => found.push(leaf),
            }
        }
        let glb = changed(|json| {
            let mut found = Vec::new();
            leaves(json, &mut found);
            let at = at.index(found.len());
            *found[at] = value;
        });
        let _ = from_glb(&glb);
    }
}
