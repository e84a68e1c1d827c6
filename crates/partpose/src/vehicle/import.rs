//! Anybody's CAD models: read as they are, then made ours by a map from names to parts.
//!
//! [`read_scene`] reads glTF, GLB, OBJ and PLY into a [`ForeignScene`]: triangles in groups that bear names, in the
//! file's own axes and unit. [`apply_map`] turns, scales and places them and gives each group the part that an
//! [`ImportMap`] names; nothing is guessed from a name that the map does not hold. Textures are never opened.
//!
//! The files are not trusted: every number is checked before it is used, nothing is allocated that a file does not
//! fill, and no file outside the model's folder is opened.

mod assign;
mod error;
mod gltf;
mod map;
mod mtl;
mod obj;
mod pattern;
mod ply;
mod ply_body;
mod ply_header;
mod polygon;
mod resolve;
mod scene;
mod split;

pub use assign::{Imported, MapError, SideFault, apply_map};
pub use error::{ImportError, LineFault, PathFault, PlyFault};
pub use map::{Axis, ImportMap, Rule, Sides, Target, TargetError};
pub use pattern::{Field, Pattern, PatternError, Term};
pub use scene::{ForeignGroup, ForeignScene, MAX_GROUPS, Remark, read_scene};
