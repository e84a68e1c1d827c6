//! A model on its way into the zoo: some of its faces have no part yet.
//!
//! `zoo import` makes one where names do not tell all parts, `zoo annotate` gives the rest of the faces theirs. Its
//! file is the GLB of a model with one more primitive, named [`UNLABELED`]; by convention it is called
//! `NAME.partial.glb`.

use crate::geometry::{Extent, Point3};
use crate::parts::PartClass;

use super::{Mesh, ModelError, VehicleModel};

/// The name of the primitive that holds the faces without a part: that of id 0 in the author's class list.
pub const UNLABELED: &str = "unlabeled";

/// A model of which some faces, or all, have no part.
///
/// Plain data: [`PartialModel::check`] tells whether it is consistent, as what [`super::from_partial_glb`] gives is.
#[derive(Clone, Debug, PartialEq)]
pub struct PartialModel {
    /// The name that identifies it in its zoo.
    pub name: String,
    /// The data set's kind of vehicle, such as `Car`.
    pub category: String,
    /// The body style, such as `sedan`.
    pub body_style: String,
    /// The extent of the cuboid in whose coordinates the mesh is placed.
    pub extent: Extent,
    /// V, in metres in the vehicle frame (x right, y down, z forward, origin at the cuboid's bottom-face centre).
    pub vertices: Vec<Point3>,
    /// F, counter-clockwise seen from outside; indices into `vertices`.
    pub faces: Vec<[u32; 3]>,
    /// Z, as far as it is known, one entry a face.
    pub parts: Vec<Option<PartClass>>,
}

impl PartialModel {
    /// How many faces have no part.
    pub fn unlabeled(&self) -> usize {
        self.parts.iter().filter(|part| part.is_none()).count()
    }

    /// Whether extent, vertices, faces and labels are such as a model may have, labels left out of account.
    pub fn check(&self) -> Result<(), ModelError> {
        self.filled_with(PartClass::SideLeft).map(drop)
    }

    /// The model, if every face has a part; the error counts those that have none.
    pub fn to_model(&self) -> Result<VehicleModel, ModelError> {
        match self.unlabeled() {
            0 => self.filled_with(PartClass::SideLeft),
            unlabeled => Err(ModelError::Unlabeled { faces: unlabeled, of: self.faces.len() }),
        }
    }

    /// The model in which every face without a part has the one given; for looking at it, not for use.
    pub fn filled_with(&self, part: PartClass) -> Result<VehicleModel, ModelError> {
        let mesh = Mesh {
            vertices: self.vertices.clone(),
            faces: self.faces.clone(),
            parts: self.parts.iter().map(|known| known.unwrap_or(part)).collect(),
        };
        VehicleModel::new(&self.name, &self.category, &self.body_style, self.extent, mesh)
    }
}

impl From<&VehicleModel> for PartialModel {
    fn from(model: &VehicleModel) -> Self {
        let mesh = model.mesh();
        Self {
            name: model.name().to_owned(),
            category: model.category().to_owned(),
            body_style: model.body_style().to_owned(),
            extent: model.extent(),
            vertices: mesh.vertices.clone(),
            faces: mesh.faces.clone(),
            parts: mesh.parts.iter().copied().map(Some).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::{
        GlbError, ParametricVehicle, from_glb, from_partial_glb, to_glb, to_partial_glb,
    };

    fn half_labeled() -> PartialModel {
        let mut partial = PartialModel::from(&ParametricVehicle::sedan().build().unwrap());
        partial.parts.iter_mut().step_by(2).for_each(|part| *part = None);
        partial
    }

    #[test]
    fn a_partial_model_survives_its_file() {
        let partial = half_labeled();
        let read = from_partial_glb(&to_partial_glb(&partial)).unwrap();
        assert_eq!(read.unlabeled(), partial.unlabeled());
        assert_eq!(read.faces.len(), partial.faces.len());
        assert_eq!((&read.name, read.extent), (&partial.name, partial.extent));
        let again = from_partial_glb(&to_partial_glb(&read)).unwrap();
        assert_eq!(again.unlabeled(), partial.unlabeled());
    }

    #[test]
    fn a_file_with_unlabeled_faces_is_no_model_and_says_what_to_do() {
        let partial = half_labeled();
        let error = from_glb(&to_partial_glb(&partial)).unwrap_err();
        assert!(matches!(error, GlbError::Model(ModelError::Unlabeled { .. })), "{error}");
        assert!(error.remedy().contains("partpose zoo annotate"));
    }

    #[test]
    fn a_partial_file_without_unlabeled_faces_is_a_model() {
        let model = ParametricVehicle::sedan().build().unwrap();
        let bytes = to_partial_glb(&PartialModel::from(&model));
        assert_eq!(bytes, to_glb(&model));
        assert!(from_partial_glb(&bytes).unwrap().to_model().is_ok());
    }
}
