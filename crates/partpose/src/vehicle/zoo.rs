//! The models that a pose is chosen from.

use crate::geometry::Extent;

use super::VehicleModel;

/// Models in a fixed order; where errors tie, the first wins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelZoo {
    /// The models.
    pub models: Vec<VehicleModel>,
}

impl ModelZoo {
    /// The model with a name.
    pub fn get(&self, name: &str) -> Option<&VehicleModel> {
        self.models.iter().find(|model| model.name() == name)
    }

    /// The model of a category whose extent is nearest in the L1 sense (paper, § III-A).
    pub fn closest(&self, category: &str, extent: &Extent) -> Option<&VehicleModel> {
        let candidates = self.models.iter().filter(|model| model.category() == category);
        candidates.min_by(|a, b| {
            a.extent().l1_distance(extent).total_cmp(&b.extent().l1_distance(extent))
        })
    }
}
