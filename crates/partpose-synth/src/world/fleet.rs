//! The part-labelled vehicles that drive and park: models of a zoo, each with a size, a look and a name for its colour.

use std::sync::Arc;

use nalgebra::Vector3;
use partpose::geometry::{Extent, Pose};
use partpose::vehicle::{ModelZoo, VehicleModel};
use rand::RngExt;
use rayon::prelude::*;

use super::random::random;
use crate::scene::{Object, SegmentClass};
use crate::vehicles::{
    Lamps, Look, Opening, Riders, VehicleKind, materials, opened_kind, random_look, vehicle_kind,
};

/// Share of vans where the zoo has any.
const VANS: f64 = 0.10;
/// How much the sides of vehicles differ from their model's, either way.
const SPREAD: [f64; 3] = [0.04, 0.05, 0.07];

/// Vehicle kinds, made once and shared by all worlds.
#[derive(Clone, Debug)]
pub struct Fleet {
    kinds: Vec<VehicleKind>,
    /// Kinds with something open.
    opened: Vec<VehicleKind>,
}

/// A vehicle, the same in every frame of its track.
#[derive(Clone, Debug)]
pub(crate) struct Vehicle {
    kind: usize,
    /// Which of the fleet's opened kinds it is, if it is one.
    opened: Option<usize>,
    /// Its size.
    pub(crate) extent: Extent,
    look: Look,
}

impl Fleet {
    /// The vehicles of a zoo; those that are neither cars nor vans are left out. Models that are named as opened ones
    /// are those of their closed models.
    pub fn new(zoo: &ModelZoo) -> Self {
        let known = |model: &&VehicleModel| matches!(model.category(), "Car" | "Van");
        let closed = |model: &&VehicleModel| Opening::of_name(model.name()).is_none();
        let models = || zoo.models.iter().filter(known);
        let closed: Vec<&VehicleModel> = models().filter(closed).collect();
        let kinds: Vec<VehicleKind> = closed.into_par_iter().map(vehicle_kind).collect();
        let opened = |model: &VehicleModel| {
            let (name, opening) = Opening::of_name(model.name())?;
            let closed = kinds.iter().find(|kind| kind.name == name)?;
            Some(opened_kind(model, closed, opening))
        };
        let opened = models().filter_map(opened).collect();
        Self { kinds, opened }
    }

    /// Whether no vehicle can be made.
    pub fn is_empty(&self) -> bool {
        self.kinds.is_empty()
    }

    /// The vehicle that a seed and words stand for.
    pub(crate) fn vehicle(&self, seed: u64, words: &[i64]) -> Vehicle {
        let mut rng = random(seed, words);
        let is_van = rng.random_bool(VANS);
        let of = |category: &str| -> Vec<usize> {
            (0..self.kinds.len()).filter(|i| self.kinds[*i].category == category).collect()
        };
        let (vans, cars) = (of("Van"), of("Car"));
        let choice = if (is_van && !vans.is_empty()) || cars.is_empty() { &vans } else { &cars };
        let kind = choice[rng.random_range(0..choice.len())];
        let mut factor = |spread: f64| 1.0 + rng.random_range(-spread..spread);
        let extent = self.kinds[kind].extent;
        let extent = Extent::new(
            extent.width * factor(SPREAD[0]),
            extent.height * factor(SPREAD[1]),
            extent.length * factor(SPREAD[2]),
        );
        Vehicle { kind, opened: None, extent, look: random_look(&mut rng) }
    }

    /// One with something open in a vehicle's stead, of the same look and as much larger than its model; the vehicle
    /// itself where there is no such model. `choice` chooses among several.
    pub(crate) fn opened(&self, vehicle: Vehicle, choice: u64) -> Vehicle {
        let count = self.opened.len().max(1) as u64;
        let opened = (choice % count) as usize;
        let Some(kind) = self.opened.get(opened) else { return vehicle };
        let factor = vehicle.extent.ratio(&self.kind(&vehicle).extent);
        let extent = kind.extent.to_vector().component_mul(&factor);
        let extent = Extent::new(extent.x, extent.y, extent.z);
        Vehicle { opened: Some(opened), extent, ..vehicle }
    }

    /// The vehicle of a category scaled to a size: one of the body style that another data set's name of a mesh speaks
    /// of, or else the one nearest in size.
    pub(crate) fn like(
        &self,
        seed: u64,
        words: &[i64],
        mesh: &str,
        category: &str,
        extent: Extent,
    ) -> Option<Vehicle> {
        let mesh = mesh.to_lowercase();
        let of_category =
            || (0..self.kinds.len()).filter(|kind| self.kinds[*kind].category == category);
        let speaks = |kind: &usize| {
            let style = self.kinds[*kind].body_style.to_lowercase();
            !style.is_empty()
                && (mesh.contains(&style)
                    || synonym(&mesh).is_some_and(|word| style.contains(word)))
        };
        let mut fitting: Vec<usize> = of_category().filter(speaks).collect();
        if fitting.is_empty() {
            fitting = of_category().collect();
        }
        let distance = |kind: usize| self.kinds[kind].extent.l1_distance(&extent);
        let kind = fitting.into_iter().min_by(|a, b| distance(*a).total_cmp(&distance(*b)))?;
        let look = random_look(&mut random(seed, words));
        Some(Vehicle { kind, opened: None, extent, look })
    }

    /// The kind of a vehicle.
    pub(crate) fn kind(&self, vehicle: &Vehicle) -> &VehicleKind {
        vehicle.opened.map_or(&self.kinds[vehicle.kind], |opened| &self.opened[opened])
    }

    /// A vehicle in its place; `instance` counts from 1.
    pub(crate) fn object(
        &self,
        vehicle: &Vehicle,
        world_from_vehicle: Pose,
        lamps: Lamps,
        riders: Riders,
        instance: u16,
    ) -> Object {
        let kind = self.kind(vehicle);
        let class = if kind.category == "Van" { SegmentClass::Van } else { SegmentClass::Car };
        let scale: Vector3<f64> = vehicle.extent.ratio(&kind.extent);
        Object {
            mesh: Arc::clone(&kind.surface),
            materials: materials(&vehicle.look, lamps, riders),
            world_from_object: world_from_vehicle,
            scale,
            class,
            instance,
            has_parts: true,
        }
    }
}

/// Body styles of Virtual KITTI's meshes whose names do not say it.
fn synonym(mesh: &str) -> Option<&'static str> {
    match mesh {
        // Their masks show rear doors and the small panes behind them.
        "hatchback" | "hybrid" | "peugeot_207" => Some("hatchback-5-door"),
        _ => None,
    }
}

impl Vehicle {
    /// The name of its colour, as `motgt` has it.
    pub(crate) fn color_name(&self) -> &'static str {
        color_name(self.look.paint.color)
    }
}

/// The word for a paint, linear RGB.
fn color_name(color: [f32; 3]) -> &'static str {
    let [r, g, b] = color;
    let (low, high) = (r.min(g).min(b), r.max(g).max(b));
    let is_grey = high < 0.02 || (high - low) / high < 0.30;
    match (is_grey, high) {
        (true, ..0.035) => "Black",
        (true, ..0.26) => "Grey",
        (true, ..0.56) => "Silver",
        (true, _) => "White",
        (false, _) if r > 1.6 * g && r > 2.5 * b && g < 0.35 * r => "Red",
        (false, _) if b > r && b >= g => "Blue",
        (false, _) if g >= r => "Green",
        (false, _) if r > 0.4 => "Yellow",
        (false, _) => "Brown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paints_are_called_by_their_colour() {
        for (color, name) in [
            ([0.72, 0.73, 0.72], "White"),
            ([0.012, 0.012, 0.014], "Black"),
            ([0.11, 0.115, 0.12], "Grey"),
            ([0.42, 0.43, 0.44], "Silver"),
            ([0.02, 0.055, 0.17], "Blue"),
            ([0.34, 0.02, 0.022], "Red"),
            ([0.20, 0.14, 0.085], "Brown"),
        ] {
            assert_eq!(color_name(color), name);
        }
    }
}
