//! PLY: groups by the label and the colour of faces.
//!
//! PLY has no names. Faces with a whole-numbered property `part`, `label`, `class`, `category_id` or `object` are grouped by it,
//! faces with colours, or with three vertices of one colour each, by these; a map then names `label=7` or
//! `color=255,0,0`. A file with neither is one group.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use crate::files;
use crate::geometry::Point3;
use crate::vehicle::MAX_FACES;

use super::{
    ForeignGroup, ForeignScene, ImportError, MAX_GROUPS, PlyFault, Remark,
    ply_body::{Cursor, NoValue},
    ply_header::{Element, Header, Scalar, read_header},
    polygon::{MAX_CORNERS, triangulate},
    scene::MAX_VERTICES,
};

const LABELS: [&str; 5] = ["part", "label", "class", "category_id", "object"];
const COLORS: [&str; 3] = ["red", "green", "blue"];
/// Most colours of vertices that make groups; with more the file is a coloured scan.
const MAX_COLORS: usize = 64;

type Color = [u8; 3];

/// Reads a `.ply` file.
pub(super) fn read_ply(path: &Path) -> Result<ForeignScene, ImportError> {
    let bytes = files::read(path)?;
    let failed = |source| ImportError::Ply { path: path.to_owned(), source };
    let header = read_header(&bytes).map_err(failed)?;
    let mut cursor = Cursor { bytes: &bytes[header.end..], encoding: header.encoding };
    check_announced(path, &header, cursor.bytes.len())?;
    let mut vertices: Option<Vertices> = None;
    let mut faces: Option<Faces> = None;
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" if vertices.is_none() => {
                vertices = Some(read_vertices(element, &mut cursor).map_err(failed)?);
            }
            "face" if faces.is_none() => {
                let found = read_faces(element, &mut cursor).map_err(failed)?;
                faces = Some(found.ok_or_else(|| ImportError::faces(path))?);
            }
            "tristrips" => return Err(failed(PlyFault::Strips)),
            _ => skip(element, &mut cursor).map_err(failed)?,
        }
    }
    let vertices = vertices.ok_or(PlyFault::Missing("vertices")).map_err(failed)?;
    let faces = faces.ok_or(PlyFault::Missing("faces")).map_err(failed)?;
    group(path, &vertices, &faces)
}

#[derive(Default)]
struct Vertices {
    points: Vec<Point3>,
    /// One a vertex, or none at all.
    colors: Vec<Color>,
}

#[derive(Default)]
struct Faces {
    /// Corners of all polygons, one after another.
    corners: Vec<i64>,
    /// Where each polygon ends in `corners`.
    ends: Vec<usize>,
    labels: Vec<Option<i64>>,
    colors: Vec<Option<Color>>,
}

/// A forged count must not make work or fill memory: what is announced must fit into what is there.
fn check_announced(path: &Path, header: &Header, given: usize) -> Result<(), ImportError> {
    for element in &header.elements {
        match element.name.as_str() {
            "vertex" if element.count > MAX_VERTICES as u64 => {
                return Err(ImportError::vertices(path));
            }
            "face" if element.count > MAX_FACES as u64 => return Err(ImportError::faces(path)),
            _ => {}
        }
        let needed = element.count.checked_mul(element.least_size(header.encoding) as u64);
        if needed.is_none_or(|needed| needed > given as u64) {
            let (name, count) = (element.name.clone(), element.count);
            let source = PlyFault::Truncated { element: name, index: 0, count };
            return Err(ImportError::Ply { path: path.to_owned(), source });
        }
    }
    Ok(())
}

fn read_vertices(element: &Element, cursor: &mut Cursor) -> Result<Vertices, PlyFault> {
    let axis = |name| element.property(&[name]).ok_or(PlyFault::Missing("x, y and z of vertices"));
    let axes = [axis("x")?, axis("y")?, axis("z")?];
    let colors = COLORS.map(|name| element.property(&[name]));
    let mut vertices = Vertices::default();
    let mut values = vec![0.0; element.properties.len()];
    for index in 0..element.count {
        for (at, property) in element.properties.iter().enumerate() {
            values[at] = match property.count {
                None => value(element, index, cursor, property.scalar)?,
                Some(count) => {
                    for _ in 0..length(element, index, cursor, count)? {
                        value(element, index, cursor, property.scalar)?;
                    }
                    0.0
                }
            };
        }
        vertices.points.push(Point3::from(axes.map(|at| values[at])));
        if let [Some(r), Some(g), Some(b)] = colors {
            vertices.colors.push([r, g, b].map(|at| values[at] as u8));
        }
    }
    Ok(vertices)
}

/// `None` if polygons have more corners than triangles may be made of.
fn read_faces(element: &Element, cursor: &mut Cursor) -> Result<Option<Faces>, PlyFault> {
    let corners = element.property(&["vertex_indices", "vertex_index"]);
    let corners = corners.filter(|at| element.properties[*at].count.is_some());
    let corners = corners.ok_or(PlyFault::Missing("`vertex_indices` of faces"))?;
    let label = element.property(&LABELS);
    let colors = COLORS.map(|name| element.property(&[name]));
    let mut faces = Faces::default();
    let mut values = vec![0.0; element.properties.len()];
    for index in 0..element.count {
        for (at, property) in element.properties.iter().enumerate() {
            let Some(count) = property.count else {
                values[at] = value(element, index, cursor, property.scalar)?;
                continue;
            };
            for _ in 0..length(element, index, cursor, count)? {
                let value = value(element, index, cursor, property.scalar)?;
                if at == corners {
                    faces.corners.push(value as i64);
                }
            }
            if faces.corners.len() > MAX_VERTICES {
                return Ok(None);
            }
        }
        faces.ends.push(faces.corners.len());
        faces.labels.push(label.map(|at| values[at] as i64));
        faces.colors.push(match colors {
            [Some(r), Some(g), Some(b)] => Some([r, g, b].map(|at| values[at] as u8)),
            _ => None,
        });
    }
    Ok(Some(faces))
}

fn skip(element: &Element, cursor: &mut Cursor) -> Result<(), PlyFault> {
    // Elements without properties take no room, however many are announced.
    if element.properties.is_empty() {
        return Ok(());
    }
    for index in 0..element.count {
        for property in &element.properties {
            let count = match property.count {
                Some(count) => length(element, index, cursor, count)?,
                None => 1,
            };
            for _ in 0..count {
                // What is skipped may hold NaN.
                match cursor.value(property.scalar) {
                    Err(NoValue::End) => return Err(truncated(element, index)),
                    Ok(_) | Err(NoValue::Unreadable(_)) => {}
                }
            }
        }
    }
    Ok(())
}

fn truncated(element: &Element, index: u64) -> PlyFault {
    PlyFault::Truncated { element: element.name.clone(), index, count: element.count }
}

fn value(
    element: &Element,
    index: u64,
    cursor: &mut Cursor,
    scalar: Scalar,
) -> Result<f64, PlyFault> {
    cursor.value(scalar).map_err(|error| match error {
        NoValue::End => truncated(element, index),
        NoValue::Unreadable(value) => {
            PlyFault::Number { element: element.name.clone(), index, value }
        }
    })
}

/// The length of a list; each of its values takes at least a byte.
fn length(
    element: &Element,
    index: u64,
    cursor: &mut Cursor,
    scalar: Scalar,
) -> Result<usize, PlyFault> {
    let length = value(element, index, cursor, scalar)?;
    if !(0.0..=cursor.bytes.len() as f64).contains(&length) {
        return Err(truncated(element, index));
    }
    Ok(length as usize)
}

/// The label and the colour that make a face's group.
type Key = (Option<i64>, Option<Color>);

fn group(path: &Path, vertices: &Vertices, faces: &Faces) -> Result<ForeignScene, ImportError> {
    let mut remarks = Vec::new();
    let mut keys: Vec<Key> =
        faces.labels.iter().copied().zip(faces.colors.iter().copied()).collect();
    let has_colors = faces.colors.first().is_some_and(Option::is_some);
    if !has_colors && !vertices.colors.is_empty() {
        match colors_of_faces(vertices, faces) {
            Some(colors) => keys.iter_mut().zip(colors).for_each(|(key, color)| key.1 = color),
            None => remarks.push(Remark::ManyColors),
        }
    }
    let mut groups: BTreeMap<Key, (ForeignGroup, HashMap<u32, u32>)> = BTreeMap::new();
    let (mut start, mut total, mut fans, mut not_triangles) = (0, 0, 0, 0);
    for (at, (end, key)) in faces.ends.iter().zip(&keys).enumerate() {
        let corners = &faces.corners[start..*end];
        start = *end;
        let count = vertices.points.len();
        if let Some(index) = corners.iter().find(|at| !(0..count as i64).contains(*at)) {
            let source = PlyFault::Vertex { face: at as u64, index: *index, count };
            return Err(ImportError::Ply { path: path.to_owned(), source });
        }
        if corners.len() < 3 {
            not_triangles += 1;
            continue;
        }
        total += corners.len() - 2;
        if total > MAX_FACES {
            return Err(ImportError::faces(path));
        }
        fans += usize::from(corners.len() > MAX_CORNERS);
        if groups.len() == MAX_GROUPS && !groups.contains_key(key) {
            return Err(ImportError::groups(path));
        }
        let (group, local) = groups.entry(*key).or_insert_with(|| (named(key), HashMap::new()));
        let points: Vec<Point3> =
            corners.iter().map(|corner| vertices.points[*corner as usize]).collect();
        for triangle in triangulate(&points) {
            let face = triangle.map(|corner| {
                *local.entry(corners[corner] as u32).or_insert_with(|| {
                    group.vertices.push(points[corner]);
                    group.vertices.len() as u32 - 1
                })
            });
            group.faces.push(face);
        }
    }
    if not_triangles > 0 {
        remarks.push(Remark::NotTriangles(not_triangles));
    }
    if fans > 0 {
        remarks.push(Remark::Fans(fans));
    }
    Ok(ForeignScene { groups: groups.into_values().map(|(group, _)| group).collect(), remarks })
}

/// The colour that all corners of a face share; `None` if there are too many colours to be labels.
fn colors_of_faces(vertices: &Vertices, faces: &Faces) -> Option<Vec<Option<Color>>> {
    let mut seen: Vec<Color> = Vec::new();
    for color in &vertices.colors {
        if !seen.contains(color) {
            seen.push(*color);
            if seen.len() > MAX_COLORS {
                return None;
            }
        }
    }
    let mut start = 0;
    let color = |end: &usize| {
        let corners = &faces.corners[start..*end];
        start = *end;
        let of =
            |at: &i64| usize::try_from(*at).ok().and_then(|at| vertices.colors.get(at).copied());
        let first = corners.first().and_then(of)?;
        corners.iter().all(|corner| of(corner) == Some(first)).then_some(first)
    };
    Some(faces.ends.iter().map(color).collect())
}

fn named((label, color): &Key) -> ForeignGroup {
    let node = label.map_or_else(|| "mesh".to_owned(), |label| format!("label={label}"));
    let material = color.map_or_else(String::new, |[r, g, b]| format!("color={r},{g},{b}"));
    ForeignGroup { path: node.clone(), node, material, ..ForeignGroup::default() }
}
