//! Which model stands for a labelled vehicle.

use serde::Serialize;

use crate::dataset::folds::Folds;
use crate::dataset::{Frame, VehicleLabel};
use crate::vehicle::{ModelZoo, VehicleModel};

use super::{Categories, DontCare, LabelOptions, ModelChoice};

/// The zoos that models come from.
///
/// With folds there is one zoo for each, in their order, and a vehicle's model comes from the zoo that was carved
/// without its track; without folds there is one zoo.
#[derive(Clone, Copy, Debug)]
pub struct Zoos<'a> {
    /// One zoo, or one for each fold.
    pub zoos: &'a [ModelZoo],
    /// The folds of the tracks.
    pub folds: Option<&'a Folds>,
}

impl<'a> Zoos<'a> {
    /// A single zoo for all vehicles.
    pub fn single(zoo: &'a ModelZoo) -> Self {
        Self { zoos: std::slice::from_ref(zoo), folds: None }
    }

    /// The zoo for a vehicle; `None` where there is none for its fold.
    pub fn of(&self, frame: &Frame, vehicle: &VehicleLabel) -> Option<&'a ModelZoo> {
        let fold = match (self.folds, vehicle.track) {
            (Some(folds), Some(track)) => folds.fold_of(&frame.sequence, track),
            _ => 1,
        };
        self.zoos.get(fold - 1)
    }
}

/// Why a model that was not asked for stands for a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum StandIn {
    /// The zoo has no model of the vehicle's name; the nearest in size of its category stands in.
    Name,
    /// The zoo has no model of the vehicle's category; the nearest in size of any stands in.
    Category,
}

/// The model of a vehicle and what it is drawn for.
#[derive(Clone, Copy, Debug)]
pub struct Assignment<'a> {
    /// The model.
    pub model: &'a VehicleModel,
    /// Whether the vehicle gets labels, or only hides what is behind it.
    pub labelled: bool,
    /// Why another model than the one asked for.
    pub stand_in: Option<StandIn>,
    /// Whether the zoo has the model that the data set names, and another was chosen by size.
    pub named_otherwise: bool,
}

/// The model for a vehicle; `None` if the zoo is empty or lacks the fold.
pub fn assign<'a>(
    frame: &Frame,
    vehicle: &VehicleLabel,
    zoos: &Zoos<'a>,
    options: &LabelOptions,
) -> Option<Assignment<'a>> {
    let zoo = zoos.of(frame, vehicle)?;
    let of_zoo = zoo.models.iter().any(|model| model.category() == vehicle.category);
    let category = match &options.categories {
        Categories::OfZoo => of_zoo,
        Categories::All => true,
        Categories::Named(names) => names.contains(&vehicle.category),
    };
    let labelled = category && !(vehicle.dont_care && options.dont_care == DontCare::Occlude);
    let extent = &vehicle.cuboid.extent;
    let own = vehicle.model.as_deref().and_then(|name| zoo.get(name));
    let by_name = options.models == ModelChoice::Name;
    let chosen = |model: &'a VehicleModel, stand_in| Assignment {
        model,
        labelled,
        stand_in,
        named_otherwise: own.is_some_and(|own| own.name() != model.name()),
    };
    if let Some(own) = own.filter(|_| by_name) {
        return Some(chosen(own, None));
    }
    if let Some(model) = zoo.closest(&vehicle.category, extent) {
        let lacking = by_name && vehicle.model.is_some();
        return Some(chosen(model, lacking.then_some(StandIn::Name)));
    }
    let distance = |model: &VehicleModel| model.extent().l1_distance(extent);
    let model = zoo.models.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    Some(chosen(model, Some(StandIn::Category)))
}
