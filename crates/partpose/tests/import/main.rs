//! Foreign models: what is read is right, and nothing that is read can do harm.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic like tests")]

mod gltf;
mod map;
mod mutated;
mod obj;
mod ply;

use std::path::{Path, PathBuf};

use partpose::parts::PartClass;
use partpose::vehicle::import::{
    Axis, ForeignScene, ImportError, ImportMap, Imported, Pattern, Rule, Sides, Target, apply_map,
    read_scene,
};

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
fn a_file_of_another_kind_is_told() {
    let folder = Folder::new();
    for name in ["car.fbx", "car", "car.obj.zip"] {
        let error = read_scene(&folder.write(name, "x")).unwrap_err();
        assert!(matches!(error, ImportError::Ending { .. }), "{error}");
    }
    assert!(matches!(read_scene(Path::new("/none/car.obj")), Err(ImportError::File(_))));
    let error = read_scene(&folder.write("car.glb", gltf::gltf("x").to_string())).unwrap_err();
    assert!(error.remedy().unwrap().contains(".gltf"), "{error}");
}
