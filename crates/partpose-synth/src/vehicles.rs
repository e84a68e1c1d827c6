//! Vehicle models with materials: paint, glass, rubber, rims, lamps, plates and what is seen inside.
//!
//! [`vehicle_kind`] turns an annotated model into a surface once; [`random_look`] chooses how one of its kind looks,
//! [`materials`] says what that means for light. An object of the scene is made of all three:
//!
//! ```
//! use partpose::vehicle::ModelZoo;
//! use partpose_synth::vehicles::{Lamps, Riders, materials, random_look, vehicle_kind};
//! use rand::SeedableRng;
//!
//! let kind = vehicle_kind(&ModelZoo::embedded().models[0]);
//! let look = random_look(&mut rand_chacha::ChaCha8Rng::seed_from_u64(1));
//! let lamps = Lamps { brake: true, ..Lamps::default() };
//! let materials = materials(&look, lamps, Riders { driver: true, ..Riders::default() });
//! assert!(kind.surface.materials.iter().all(|slot| usize::from(*slot) < materials.len()));
//! ```

mod bake;
mod coarse;
mod details;
mod hinges;
mod inside;
mod joints;
mod looks;
mod patchwork;
mod regions;
mod relief;
mod riders;
mod slots;

use std::sync::Arc;

use partpose::geometry::{Extent, Point3};
use partpose::vehicle::VehicleModel;

use crate::scene::SurfaceMesh;

pub(crate) use hinges::{Opening, leaf, opened};
pub use looks::{Lamps, Look, Paint, Person, Riders, random_look};
pub use slots::materials;

/// A model, ready to be painted.
#[derive(Clone, Debug)]
pub struct VehicleKind {
    /// The model's name.
    pub name: String,
    /// The data set's kind of vehicle, such as `Car`.
    pub category: String,
    /// The body style, such as `sedan`.
    pub body_style: String,
    /// Extent of the model before it is scaled.
    pub extent: Extent,
    /// Its surface with the slots that [`materials`] fills and with the model's mesh for the labels.
    pub surface: Arc<SurfaceMesh>,
    /// Faces that stand out of the cuboid, before the model is scaled: mirrors, and what stands open.
    pub beyond: Arc<[[Point3; 3]]>,
}

/// The kind of an opened model, from that of the closed one.
pub(crate) fn opened_kind(
    model: &VehicleModel,
    closed: &VehicleKind,
    opening: Opening,
) -> VehicleKind {
    let mut surface = match &closed.surface.labels {
        Some(labels) => {
            hinges::opened_surface(&closed.surface, labels, opening, &closed.body_style)
        }
        None => (*closed.surface).clone(),
    };
    surface.labels = Some(Arc::new(model.mesh().clone()));
    VehicleKind {
        name: model.name().to_owned(),
        surface: Arc::new(surface),
        beyond: beyond(model).into(),
        ..closed.clone()
    }
}

/// The surface of a model: what the parts leave open (grille, plates, rims, seals, inside) follows from their places.
pub fn vehicle_kind(model: &VehicleModel) -> VehicleKind {
    let mut work = patchwork::Patchwork::new(model.mesh());
    regions::paint(&mut work);
    inside::furnish(&mut work);
    let mut surface = work.into_surface();
    surface.openness = bake::openness(&surface);
    surface.coarse = Some(Arc::new(coarse::coarse(&surface)));
    surface.labels = Some(Arc::new(model.mesh().clone()));
    VehicleKind {
        name: model.name().to_owned(),
        category: model.category().to_owned(),
        body_style: model.body_style().to_owned(),
        extent: model.extent(),
        surface: Arc::new(surface),
        beyond: beyond(model).into(),
    }
}

/// Faces of a model that reach out of its cuboid to the sides, and those of what stands open.
fn beyond(model: &VehicleModel) -> Vec<[Point3; 3]> {
    let mesh = model.mesh();
    let half = 0.5 * model.extent().width;
    let faces = mesh.faces.iter().map(|face| face.map(|i| mesh.vertices[i as usize]));
    let mut beyond: Vec<_> =
        faces.filter(|corners| corners.iter().any(|p| p.x.abs() > half)).collect();
    if let Some((_, open)) = leaf(model) {
        beyond.extend(open);
    }
    beyond
}
