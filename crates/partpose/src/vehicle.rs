//! Annotated vehicle models and the zoo that holds them.

mod model;
mod zoo;

pub use model::{Mesh, ModelError, VehicleModel};
pub use zoo::ModelZoo;
