//! Annotated vehicle models and the zoo that holds them.

pub mod check;
mod glb;
mod glb_read;
mod glb_schema;
mod glb_write;
mod gltf_scene;
pub(crate) mod half;
pub mod import;
mod mesh;
mod model;
mod parametric;
mod partial;
mod place;
pub(crate) mod simplify;
mod zoo;

pub(crate) use glb::join as join_glb;
pub use glb::{GlbError, MAX_COORDINATE, MAX_FACES, MAX_SIDE, MIN_SIDE, PrimitiveFault};
pub use glb_read::{from_glb, from_partial_glb};
pub(crate) use glb_write::linear_from_srgb;
pub use glb_write::{to_glb, to_partial_glb};
pub use mesh::Mesh;
pub use model::{ModelError, VehicleModel};
pub use parametric::ParametricVehicle;
pub use partial::{PartialModel, UNLABELED};
pub use zoo::{ModelZoo, ZooError};
