//! OBJ files and their material libraries.

use partpose::vehicle::import::{ImportError, LineFault, Remark, read_scene};

use crate::{Folder, OBJ, obj_scene};

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
