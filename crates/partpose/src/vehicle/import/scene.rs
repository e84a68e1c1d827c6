//! What a foreign file holds, before anything is made of it.

use std::path::Path;

use crate::geometry::Point3;
use crate::vehicle::MAX_FACES;

use super::{ImportError, gltf, obj, ply};

/// Most groups of triangles that are read from a file.
pub const MAX_GROUPS: usize = 100_000;
/// Most vertices that are read from a file: those of separate triangles.
pub(super) const MAX_VERTICES: usize = 3 * MAX_FACES;
/// Longest name that is kept, characters.
const MAX_NAME: usize = 200;

/// A model as its file tells it, in the file's axes and unit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignScene {
    /// In the order of the file; none is without faces.
    pub groups: Vec<ForeignGroup>,
    /// What was noticed but does not prevent reading.
    pub remarks: Vec<Remark>,
}

/// Triangles that bear the same names.
///
/// Names that a format does not have are empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForeignGroup {
    /// glTF: names of the nodes from the root, joined by `/`; OBJ: object and group, joined by `/`.
    pub path: String,
    /// glTF: name of the node; OBJ: of the group, else of the object; PLY: the label of the faces, such as `label=7`.
    pub node: String,
    /// glTF: name of the mesh; OBJ: of the object.
    pub mesh: String,
    /// Name of the material; PLY: the colour of the faces, such as `color=255,0,0`.
    pub material: String,
    /// In the file's axes and unit; glTF: after the transforms of the nodes.
    pub vertices: Vec<Point3>,
    /// Indices into `vertices`.
    pub faces: Vec<[u32; 3]>,
}

/// What was noticed but does not prevent reading.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Remark {
    /// A material library that is not there.
    #[error(
        "line {line}: there is no material library `{name}`; materials keep the names they have in the OBJ file"
    )]
    NoLibrary {
        /// Number of the line, from 1.
        line: usize,
        /// The file it names.
        name: String,
    },
    /// A material that no library defines.
    #[error("line {line}: no material library defines the material `{name}`")]
    NoMaterial {
        /// Number of the line, from 1.
        line: usize,
        /// Name of the material.
        name: String,
    },
    /// Points, lines or curves.
    #[error("left out {0} points, lines or curves")]
    NotTriangles(usize),
    /// Polygons too large to be cut with care.
    #[error("cut {0} polygons of more than 64 corners as if they were convex")]
    Fans(usize),
    /// Faces whose vertices have many colours.
    #[error("the vertices have more than 64 colours; no groups were made of them")]
    ManyColors,
}

/// Reads a model; the ending of its name tells the format.
pub fn read_scene(path: &Path) -> Result<ForeignScene, ImportError> {
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let scene = match ending.to_str() {
        Some("glb") => gltf::read_glb(path),
        Some("gltf") => gltf::read_gltf(path),
        Some("obj") => obj::read_obj(path),
        Some("ply") => ply::read_ply(path),
        _ => Err(ImportError::Ending { path: path.to_owned() }),
    }?;
    if scene.groups.is_empty() {
        return Err(ImportError::Empty { path: path.to_owned() });
    }
    Ok(scene)
}

/// A name as it is kept: of bounded length, without control characters.
pub(super) fn clean_name(name: &str) -> String {
    name.trim().chars().filter(|c| !c.is_control()).take(MAX_NAME).collect()
}
