//! PLY files as text and as bytes.

use partpose::vehicle::import::{ForeignScene, ImportError, PlyFault, read_scene};

use crate::Folder;

/// Two triangles with labels and colours, as text.
pub(crate) const PLY: &str = "\
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

pub(crate) fn binary_ply(is_big: bool) -> Vec<u8> {
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
