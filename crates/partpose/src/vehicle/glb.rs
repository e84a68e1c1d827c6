//! The GLB container: a header, a JSON chunk and a chunk of bytes.
//!
//! Khronos Group: *glTF 2.0 Specification*, 2021, § 4. What the chunks hold is told in `glb_write.rs` and
//! `glb_read.rs`; `docs/formats.md` (Zoo) describes the whole for others.

use crate::geometry::{Extent, Point3};

use super::ModelError;

/// Most faces that a file may give a model; far above any use, low enough for any memory.
pub const MAX_FACES: usize = 4_000_000;
/// Largest coordinate of a vertex that is believed, metres.
pub const MAX_COORDINATE: f64 = 1000.0;
/// Smallest side of a vehicle that is believed, metres.
pub const MIN_SIDE: f64 = 0.01;
/// Largest side of a vehicle that is believed, metres.
pub const MAX_SIDE: f64 = 100.0;

/// Longest name, category or body style, bytes.
pub(super) const MAX_TEXT: usize = 100;

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BIN_CHUNK: &[u8; 4] = b"BIN\0";

/// Why bytes are not a model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GlbError {
    /// The first bytes are not those of a GLB.
    #[error("not a GLB file: it does not begin with `glTF`")]
    Magic,
    /// A GLB of another version.
    #[error("GLB version {0}, where 2 is read")]
    Version(u32),
    /// Shorter than it says.
    #[error("truncated: {needed} bytes are announced, {given} are there")]
    Truncated {
        /// Bytes that the header or a chunk announces, counted from the start of the file.
        needed: u64,
        /// Bytes in the file.
        given: u64,
    },
    /// No JSON chunk where it must be.
    #[error("the first chunk is not JSON")]
    NoJson,
    /// JSON that is none, or not glTF.
    #[error("the JSON chunk is not glTF 2.0")]
    Json(#[source] serde_json::Error),
    /// An extension without which the file cannot be understood.
    #[error("the file requires the extension `{0}`")]
    Extension(String),
    /// No `extras.partpose` on a root node, the scene or the asset.
    #[error("no `extras.partpose` with name, category, body style and extent")]
    NoExtras,
    /// An `extras.partpose` that lacks something.
    #[error("`extras.partpose` is not name, category, body style and extent")]
    Extras(#[source] serde_json::Error),
    /// A text that is empty, long or holds control characters.
    #[error("the {field} in `extras.partpose` is empty, longer than 100 bytes or not printable")]
    Text {
        /// `name`, `category` or `body style`.
        field: &'static str,
    },
    /// A reference to something that does not exist.
    #[error("{what} {index} does not exist: there are {count}")]
    Missing {
        /// The kind of thing.
        what: &'static str,
        /// The number by which it was asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A node that is its own ancestor or has two parents.
    #[error("node {0} is reached twice")]
    NodeTwice(usize),
    /// A transform that is not finite, flattens space or has a perspective.
    #[error("the transform of node {0} is not affine or cannot be inverted")]
    Transform(usize),
    /// A buffer outside the file.
    #[error("buffer {buffer} is not inside the file but at a URI")]
    Uri {
        /// Number of the buffer.
        buffer: usize,
    },
    /// A primitive that is no part.
    #[error("{primitive}: neither material, mesh nor node is named after a part")]
    UnknownPart {
        /// Mesh, primitive and the names it has.
        primitive: String,
    },
    /// A primitive whose data cannot be used.
    #[error("{primitive}: {fault}")]
    Primitive {
        /// Mesh, primitive and the names it has.
        primitive: String,
        /// What is wrong with it.
        fault: PrimitiveFault,
    },
    /// More faces than a model may have.
    #[error("more than {MAX_FACES} faces")]
    TooManyFaces,
    /// An extent beyond belief.
    #[error("an extent of {} x {} x {} m, where sides are {MIN_SIDE} to {MAX_SIDE} m", .0.width, .0.height, .0.length)]
    Extent(Extent),
    /// The parts make no model.
    #[error("the parts make no model")]
    Model(#[source] ModelError),
}

/// What can be wrong with a primitive.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PrimitiveFault {
    /// Strips, fans, lines or points.
    #[error("mode {0} instead of 4, separate triangles")]
    Mode(u32),
    /// No positions.
    #[error("it has no POSITION")]
    NoPosition,
    /// A sparse accessor, or one without a buffer view.
    #[error("accessor {0} is sparse or has no buffer view")]
    Sparse(usize),
    /// Data of a kind that positions or indices cannot have.
    #[error("accessor {accessor} holds {shape} of component type {component_type}")]
    Type {
        /// Number of the accessor.
        accessor: usize,
        /// Its `type`.
        shape: String,
        /// Its `componentType`.
        component_type: u32,
    },
    /// Data beyond the end of what holds it.
    #[error("accessor {accessor} reaches beyond its buffer view, or that beyond its buffer")]
    Range {
        /// Number of the accessor.
        accessor: usize,
    },
    /// A stride that cannot be.
    #[error("accessor {accessor} has a stride of {stride} bytes")]
    Stride {
        /// Number of the accessor.
        accessor: usize,
        /// The stride.
        stride: usize,
    },
    /// Indices that are not triples.
    #[error("{0} indices are not a multiple of 3")]
    NotTriples(usize),
    /// An index without a vertex.
    #[error("index {index} has no vertex: there are {count}")]
    Index {
        /// The index.
        index: usize,
        /// How many vertices there are.
        count: usize,
    },
    /// A position that is not finite.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Number of the vertex in its accessor.
        vertex: usize,
    },
    /// A position that is not finite or absurdly far away.
    #[error("vertex {vertex} lies at {position}, not within {MAX_COORDINATE} m")]
    Position {
        /// Number of the vertex in its accessor.
        vertex: usize,
        /// Its position in the vehicle frame.
        position: Point3,
    },
}

impl GlbError {
    /// What the owner of the file can do about it.
    pub fn remedy(&self) -> &'static str {
        use PrimitiveFault as Fault;
        match self {
            Self::Magic | Self::NoJson | Self::Version(_) => "export it as binary glTF 2.0 (.glb)",
            Self::Truncated { .. } => "copy or export the file again",
            Self::Extension(_) => "export it without compression and extensions",
            Self::NoExtras | Self::Extras(_) | Self::Text { .. } | Self::Extent(_) => {
                "give a root node extras such as {\"partpose\": {\"name\": \"Golf\", \"category\": \"Car\", \
                 \"body_style\": \"hatchback\", \"extent\": {\"width\": 1.8, \"height\": 1.5, \"length\": 4.3}}}, \
                 lengths in metres"
            }
            Self::Uri { .. } => "export it as one .glb file with its buffers inside",
            Self::UnknownPart { .. } => {
                "name the material after one of the 29 parts, such as `wheels_FL`"
            }
            Self::Primitive { fault: Fault::Position { .. }, .. } => {
                "export it in metres, without broken vertices"
            }
            Self::Primitive { fault: Fault::Mode(_), .. } => "triangulate the mesh",
            Self::Model(ModelError::Unlabeled { .. }) => {
                "give the other faces their parts with `partpose zoo annotate`"
            }
            Self::TooManyFaces => "decimate the mesh",
            _ => "the file is damaged or made by a faulty program: export it again",
        }
    }
}

/// Whether a text can be a model's name, category or body style.
pub(super) fn is_text(text: &str) -> bool {
    !text.is_empty() && text.len() <= MAX_TEXT && !text.chars().any(char::is_control)
}

/// The JSON and the bytes of a GLB.
pub(super) fn split(glb: &[u8]) -> Result<(&[u8], &[u8]), GlbError> {
    if glb.get(..4) != Some(MAGIC) {
        return Err(GlbError::Magic);
    }
    let version = u32_at(glb, 4)?;
    if version != 2 {
        return Err(GlbError::Version(version));
    }
    let total = u32_at(glb, 8)? as usize;
    let all = glb.get(..total).ok_or_else(|| truncated(total as u64, glb))?;
    let (kind, json, rest) = chunk(all, 12)?;
    if kind != JSON_CHUNK {
        return Err(GlbError::NoJson);
    }
    // Chunks of other kinds must be ignored; the bytes, if any, come second.
    let bytes = if rest < all.len() {
        match chunk(all, rest)? {
            (kind, bytes, _) if kind == BIN_CHUNK => bytes,
            _ => &[],
        }
    } else {
        &[]
    };
    Ok((json, bytes))
}

/// A GLB of a JSON text and bytes.
pub(crate) fn join(mut json: Vec<u8>, mut bytes: Vec<u8>) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let mut glb = Vec::with_capacity(28 + json.len() + bytes.len());
    glb.extend(MAGIC);
    glb.extend(2_u32.to_le_bytes());
    glb.extend((28 + json.len() as u32 + bytes.len() as u32).to_le_bytes());
    for (kind, chunk) in [(JSON_CHUNK, json), (BIN_CHUNK, bytes)] {
        glb.extend((chunk.len() as u32).to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    glb
}

/// Kind and content of the chunk at `start`, and where the next one would begin.
fn chunk(glb: &[u8], start: usize) -> Result<(&[u8], &[u8], usize), GlbError> {
    let length = u32_at(glb, start)? as usize;
    // Both sums stay below 2^34, and no file that large is read.
    let end = start + 8 + length;
    match (glb.get(start + 4..start + 8), glb.get(start + 8..end)) {
        (Some(kind), Some(content)) => Ok((kind, content, end)),
        _ => Err(truncated(end as u64, glb)),
    }
}

fn u32_at(glb: &[u8], at: usize) -> Result<u32, GlbError> {
    let bytes = glb.get(at..at + 4).and_then(|bytes| bytes.try_into().ok());
    bytes.map(u32::from_le_bytes).ok_or_else(|| truncated(at as u64 + 4, glb))
}

fn truncated(needed: u64, glb: &[u8]) -> GlbError {
    GlbError::Truncated { needed, given: glb.len() as u64 }
}
