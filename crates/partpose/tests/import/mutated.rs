//! Random changes to readable files.

use partpose::vehicle::check::check_partial;
use partpose::vehicle::import::{apply_map, read_scene};
use partpose::vehicle::{ModelZoo, from_partial_glb, to_glb, to_partial_glb};
use proptest::prelude::*;
use serde_json::json;

use crate::gltf::{gltf, gltf_bytes};
use crate::ply::{PLY, binary_ply};
use crate::{Folder, MTL, OBJ, map};

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
