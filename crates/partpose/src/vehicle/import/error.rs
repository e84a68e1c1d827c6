//! Why a foreign model could not be read.

use std::path::PathBuf;

use crate::files::FileError;
use crate::vehicle::{GlbError, MAX_FACES};

use super::scene::{MAX_GROUPS, MAX_VERTICES};

/// Why a foreign model could not be read: the file, the place in it, and the fault.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A name that tells no format.
    #[error("`{path}` ends in none of `.glb`, `.gltf`, `.obj` and `.ply`")]
    Ending {
        /// The file.
        path: PathBuf,
    },
    /// A glTF or GLB that cannot be used.
    #[error("cannot read the model `{path}`")]
    Gltf {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: GlbError,
    },
    /// A buffer of a glTF that cannot be had.
    #[error("cannot read buffer {buffer} of the model `{path}`")]
    Buffer {
        /// The glTF file.
        path: PathBuf,
        /// Number of the buffer.
        buffer: usize,
        /// Why.
        source: PathFault,
    },
    /// A line of an OBJ or MTL file.
    #[error("cannot read `{path}`, line {line}")]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        source: LineFault,
    },
    /// A PLY file that cannot be used.
    #[error("cannot read the model `{path}`")]
    Ply {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: PlyFault,
    },
    /// More than any model has.
    #[error("`{path}` holds more than {limit} {what}")]
    TooMany {
        /// The file.
        path: PathBuf,
        /// The kind of thing.
        what: &'static str,
        /// How many are read.
        limit: usize,
    },
    /// No triangle at all.
    #[error("`{path}` holds no triangle")]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Why a reference from one file to another is not followed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PathFault {
    /// A URI with a scheme, such as `file:` or `https:`.
    #[error("`{0}` is a URI with a scheme")]
    Scheme(String),
    /// An absolute path, or one through a parent folder or a link out of the folder.
    #[error("`{0}` leads out of the model's folder")]
    Outside(String),
    /// A `%` that is not followed by two hexadecimal digits, or escapes that are not UTF-8.
    #[error("`{0}` holds a broken percent escape")]
    Escape(String),
    /// A `data:` URI that is not base64.
    #[error("the `data:` URI is not base64: fault at character {0}")]
    Base64(usize),
    /// Neither a file of that name nor data.
    #[error("`{0}` is no file")]
    NotAFile(String),
    /// Fewer bytes than announced.
    #[error("{needed} bytes are announced, {given} are there")]
    Short {
        /// Bytes announced.
        needed: usize,
        /// Bytes there.
        given: usize,
    },
    /// The file could not be read.
    #[error(transparent)]
    File(FileError),
}

/// What can be wrong with a line of an OBJ or MTL file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineFault {
    /// Not a finite number.
    #[error("`{0}` is not a finite number")]
    Number(String),
    /// Too few numbers.
    #[error("{given} numbers, where {needed} are needed")]
    Few {
        /// How many are needed.
        needed: usize,
        /// How many there are.
        given: usize,
    },
    /// An index that is none.
    #[error("`{0}` is not the number of a vertex")]
    Index(String),
    /// A vertex that does not exist.
    #[error("the face refers to vertex {index}, but there are {count}")]
    Vertex {
        /// As the file says it: from 1, or from -1 backwards.
        index: i64,
        /// How many vertices there are.
        count: usize,
    },
    /// A statement without its name.
    #[error("`{0}` without a name")]
    NoName(&'static str),
    /// A reference that is not followed.
    #[error(transparent)]
    Path(PathFault),
    /// A statement that no OBJ file has, in a file without faces.
    #[error("`{0}` is no statement of an OBJ file")]
    Keyword(String),
}

/// What can be wrong with a PLY file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlyFault {
    /// The first line is not `ply`.
    #[error("not a PLY file: it does not begin with `ply`")]
    Magic,
    /// The header does not end.
    #[error("the header has no `end_header` within its first {0} lines")]
    NoEnd(usize),
    /// A line of the header.
    #[error("header line {line}: `{text}` is not understood")]
    Header {
        /// Number of the line, from 1.
        line: usize,
        /// Its text.
        text: String,
    },
    /// No vertices with x, y and z, or no faces with `vertex_indices`.
    #[error("the header announces no {0}")]
    Missing(&'static str),
    /// Triangle strips.
    #[error("the faces are triangle strips")]
    Strips,
    /// The file ends before its content.
    #[error("{element} {index}: the file ends within it, {count} are announced")]
    Truncated {
        /// Name of the element.
        element: String,
        /// Number of the element, from 0.
        index: u64,
        /// How many the header announces.
        count: u64,
    },
    /// A value that is none.
    #[error("{element} {index}: `{value}` is not a finite number")]
    Number {
        /// Name of the element.
        element: String,
        /// Number of the element, from 0.
        index: u64,
        /// The value.
        value: String,
    },
    /// A vertex that does not exist.
    #[error("face {face} refers to vertex {index}, but there are {count}")]
    Vertex {
        /// Number of the face, from 0.
        face: u64,
        /// The index it holds.
        index: i64,
        /// How many vertices there are.
        count: usize,
    },
}

impl ImportError {
    /// Too many of something.
    pub(super) fn faces(path: &std::path::Path) -> Self {
        Self::TooMany { path: path.to_owned(), what: "triangles", limit: MAX_FACES }
    }

    pub(super) fn vertices(path: &std::path::Path) -> Self {
        Self::TooMany { path: path.to_owned(), what: "vertices", limit: MAX_VERTICES }
    }

    pub(super) fn groups(path: &std::path::Path) -> Self {
        Self::TooMany { path: path.to_owned(), what: "groups", limit: MAX_GROUPS }
    }

    /// What the owner of the file can do about it, where the message does not say it already.
    pub fn remedy(&self) -> Option<&'static str> {
        const AGAIN: &str = "the file is damaged or made by a faulty program: export it again";
        Some(match self {
            Self::File(_) => return None,
            Self::Ending { .. } => "export the model as glTF 2.0, OBJ or PLY",
            Self::Gltf { source: GlbError::Magic, .. } => {
                "a `.glb` file is binary glTF; name a file of JSON `.gltf`"
            }
            Self::Gltf { source, .. } => source.remedy(),
            Self::Buffer { source, .. } => path_remedy(source),
            Self::Line { source: LineFault::Path(_), .. } => {
                "name the material library by its path within the model's folder, or remove the line: of materials only \
                 the names are used"
            }
            Self::Line { source: LineFault::Keyword(_), .. } => {
                "is it an OBJ file? export the model as glTF 2.0, OBJ or PLY"
            }
            Self::Ply { source: PlyFault::Magic, .. } => {
                "is it a PLY file? export the model as glTF 2.0, OBJ or PLY"
            }
            Self::Ply { source: PlyFault::Strips, .. } => "export it with separate triangles",
            Self::Line { .. } | Self::Ply { .. } => AGAIN,
            Self::TooMany { what: "groups", .. } => "join nodes or groups before exporting it",
            Self::TooMany { .. } => "decimate the mesh",
            Self::Empty { .. } => "export the mesh itself, not only points, lines or curves",
        })
    }
}

fn path_remedy(fault: &PathFault) -> &'static str {
    match fault {
        PathFault::Scheme(_) | PathFault::Outside(_) => {
            "put the buffer beside the model and name it by its path within that folder, or export one `.glb` file"
        }
        PathFault::NotAFile(_) | PathFault::Short { .. } => {
            "copy all files of the model together, or export one `.glb` file"
        }
        _ => "export it as one `.glb` file",
    }
}
