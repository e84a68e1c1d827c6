//! A vehicle model M = (V, F, E, Z): vertices, faces, extent and the part of every face.

use crate::geometry::{Extent, Point3};
use crate::parts::PartClass;

use super::Mesh;

/// Why a model is none.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The extent is not three positive numbers.
    #[error("the extent {0:?} is not three positive lengths")]
    Extent(Extent),
    /// No face at all.
    #[error("the mesh has no face")]
    Empty,
    /// As many parts as faces are needed.
    #[error("the mesh has {faces} faces but {parts} part labels")]
    Labels {
        /// Number of faces.
        faces: usize,
        /// Number of labels.
        parts: usize,
    },
    /// A face names a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}, but there are {count}")]
    Vertex {
        /// Index of the face.
        face: usize,
        /// The index it holds.
        vertex: u32,
        /// How many vertices there are.
        count: usize,
    },
    /// Parameters that make no vehicle.
    #[error("{0} make no vehicle")]
    Parameters(&'static str),
    /// Faces without a part, where each must have one.
    #[error("{faces} of {of} faces have no part")]
    Unlabeled {
        /// How many have none.
        faces: usize,
        /// How many there are.
        of: usize,
    },
    /// A vertex is not a finite point.
    #[error("vertex {vertex} is not finite")]
    NotFinite {
        /// Index of the vertex.
        vertex: usize,
    },
}

/// An annotated model.
///
/// Invariant, which is why the fields are private: the extent is positive, there is at least one face, every face has
/// a part and existing vertices, and every vertex is finite. The mesh need not fill the extent: the extent is that of
/// the annotated cuboid in whose coordinates the mesh is placed.
#[derive(Clone, Debug, PartialEq)]
pub struct VehicleModel {
    name: String,
    category: String,
    body_style: String,
    extent: Extent,
    mesh: Mesh,
}

impl VehicleModel {
    /// Checks the invariant.
    ///
    /// `category` is a data set's word for the kind of vehicle (`Car`, `Van`), `body_style` a finer one (`sedan`).
    pub fn new(
        name: &str,
        category: &str,
        body_style: &str,
        extent: Extent,
        mesh: Mesh,
    ) -> Result<Self, ModelError> {
        if !extent.is_valid() {
            return Err(ModelError::Extent(extent));
        }
        if mesh.faces.is_empty() {
            return Err(ModelError::Empty);
        }
        if mesh.faces.len() != mesh.parts.len() {
            return Err(ModelError::Labels { faces: mesh.faces.len(), parts: mesh.parts.len() });
        }
        let finite = |p: &Point3| p.coords.iter().all(|value| value.is_finite());
        if let Some(vertex) = mesh.vertices.iter().position(|p| !finite(p)) {
            return Err(ModelError::NotFinite { vertex });
        }
        let count = mesh.vertices.len();
        for (face, corners) in mesh.faces.iter().enumerate() {
            if let Some(vertex) = corners.iter().find(|index| **index as usize >= count) {
                return Err(ModelError::Vertex { face, vertex: *vertex, count });
            }
        }
        let [name, category, body_style] = [name, category, body_style].map(str::to_owned);
        Ok(Self { name, category, body_style, extent, mesh })
    }

    /// The name that identifies it in its zoo.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The data set's kind of vehicle, such as `Car`.
    pub fn category(&self) -> &str {
        &self.category
    }

    /// The body style, such as `sedan`.
    pub fn body_style(&self) -> &str {
        &self.body_style
    }

    /// E: the extent of the cuboid in whose coordinates the mesh is placed.
    pub fn extent(&self) -> Extent {
        self.extent
    }

    /// The parts that the model has no face of, in the order of ids.
    pub fn missing_parts(&self) -> Vec<PartClass> {
        let mut missing = PartClass::ALL.to_vec();
        missing.retain(|part| !self.mesh.parts.contains(part));
        missing
    }

    /// V, F and Z.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }
}
