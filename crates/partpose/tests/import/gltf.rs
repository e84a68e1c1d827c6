//! glTF files with their buffers.

use partpose::vehicle::GlbError;
use partpose::vehicle::import::{ForeignScene, ImportError, PathFault, read_scene};
use serde_json::{Value, json};

use crate::Folder;

/// A square of two triangles in a buffer, below two nodes that move and scale it.
pub(crate) fn gltf(uri: &str) -> Value {
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

pub(crate) fn gltf_bytes() -> Vec<u8> {
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
        if let Some(place) = json.pointer_mut(pointer) {
            *place = value.clone();
        } else {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            json.pointer_mut(parent).unwrap()[key] = value.clone();
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
    // Objects of three bytes take hundreds in memory; a long string is only a string.
    let objects = format!("{{\"nodes\": [{}{{}}]}}", "{},".repeat(1_100_000));
    let folder = Folder::new();
    let error = read_scene(&folder.write("a.gltf", objects)).unwrap_err();
    assert!(matches!(error, ImportError::TooMany { what: "objects in its JSON", .. }), "{error}");
    let mut json = gltf("buffers/a%20b.bin");
    json["asset"]["generator"] = json!("{\"[\\".repeat(1_100_000));
    assert!(read_gltf(&json, &gltf_bytes()).is_ok());
    // A chain of nodes, each below the one before: their paths together would take gigabytes.
    let name = "n".repeat(200);
    let chain = (0..5000).map(|at| json!({"name": name, "children": [at + 1], "mesh": 0}));
    let mut json = gltf("buffers/a%20b.bin");
    json["nodes"] = json!(chain.chain([json!({"mesh": 0})]).collect::<Vec<_>>());
    let error = read_gltf(&json, &gltf_bytes()).unwrap_err();
    assert!(matches!(error, ImportError::TooMany { what: "groups", .. }), "{error}");
}
