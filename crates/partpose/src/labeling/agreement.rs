//! How well labels agree with reference masks.
//!
//! Masks carry no instance ids in the reference, so pixels are compared class by class. What is compared is told apart:
//! where both see a vehicle, whether they see the same part of it; and where only one of them sees a vehicle, which
//! is an error of the outline or of what hides it, and is counted for itself.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::dataset::Frame;
use crate::parts::{CHANNELS, PartClass};

use super::instance_ids;

/// Ends of the bands of distance that are told apart, metres.
const BANDS: [f64; 4] = [10.0, 20.0, 35.0, 60.0];

/// Pixels that both masks give to a vehicle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Tally {
    /// Those where the part is the same.
    pub right: u64,
    /// All of them.
    pub shared: u64,
}

impl Tally {
    /// Share of right ones; `None` without pixels.
    pub fn accuracy(&self) -> Option<f64> {
        (self.shared > 0).then(|| self.right as f64 / self.shared as f64)
    }

    fn add(&mut self, other: Self) {
        self.right += other.right;
        self.shared += other.shared;
    }
}

/// How a class fares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassAgreement {
    /// The class.
    pub class: PartClass,
    /// Its pixels in the reference.
    pub reference: u64,
    /// Its pixels in the labels.
    pub labels: u64,
    /// Intersection over union over all pixels.
    pub iou: Option<f64>,
    /// The same over the pixels that both masks give to a vehicle.
    pub iou_inside: Option<f64>,
}

/// Counts of pixels over frames; sums of whole numbers, so the order of adding changes nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// Frames that were compared.
    pub frames: u64,
    /// `CHANNELS` rows (classes of the reference) of `CHANNELS` columns (those of the labels); 0 is background.
    pub confusion: Vec<u64>,
    /// By the name that the data set gives the vehicle's mesh; where it gives none, by category.
    pub by_model: BTreeMap<String, Tally>,
    /// By distance.
    pub by_distance: BTreeMap<String, Tally>,
    /// By whether the vehicle is to be ignored.
    pub by_care: BTreeMap<String, Tally>,
}

impl Default for Agreement {
    fn default() -> Self {
        Self {
            frames: 0,
            confusion: vec![0; CHANNELS * CHANNELS],
            by_model: BTreeMap::new(),
            by_distance: BTreeMap::new(),
            by_care: BTreeMap::new(),
        }
    }
}

impl Agreement {
    /// Compares the labels of a frame, row by row, with a reference of the same size.
    pub fn of_frame(frame: &Frame, parts: &[u8], instances: &[u16], reference: &[u8]) -> Self {
        let mut sum = Self { frames: 1, ..Self::default() };
        let ids = instance_ids(frame);
        let mut tallies = vec![Tally::default(); usize::from(u16::MAX) + 1];
        for ((part, instance), truth) in parts.iter().zip(instances).zip(reference) {
            let (part, truth) = (usize::from(*part), usize::from(*truth));
            if part < CHANNELS && truth < CHANNELS {
                sum.confusion[truth * CHANNELS + part] += 1;
            }
            if part != 0 && truth != 0 {
                let tally = &mut tallies[usize::from(*instance)];
                tally.shared += 1;
                tally.right += u64::from(part == truth);
            }
        }
        for (id, vehicle) in ids.iter().zip(&frame.vehicles) {
            let tally = tallies[usize::from(*id)];
            if tally.shared == 0 {
                continue;
            }
            let depth = vehicle.cuboid.camera_from_vehicle.translation.z;
            let model = vehicle.model.as_ref().unwrap_or(&vehicle.category).clone();
            let care = if vehicle.dont_care { "DontCare" } else { "counted" };
            sum.by_model.entry(model).or_default().add(tally);
            sum.by_distance.entry(band(depth)).or_default().add(tally);
            sum.by_care.entry(care.to_owned()).or_default().add(tally);
        }
        sum
    }

    /// Adds the counts of others.
    pub fn add(&mut self, other: &Self) {
        self.frames += other.frames;
        for (sum, count) in self.confusion.iter_mut().zip(&other.confusion) {
            *sum += count;
        }
        let pairs = [
            (&mut self.by_model, &other.by_model),
            (&mut self.by_distance, &other.by_distance),
            (&mut self.by_care, &other.by_care),
        ];
        for (sums, others) in pairs {
            for (name, tally) in others {
                sums.entry(name.clone()).or_default().add(*tally);
            }
        }
    }

    /// Pixels of a class of the reference that bear a label.
    pub fn count(&self, reference: usize, label: usize) -> u64 {
        self.confusion[reference * CHANNELS + label]
    }

    /// Pixels that both masks give to a vehicle, and those of them whose part is the same.
    pub fn inside(&self) -> Tally {
        let classes = || 1..CHANNELS;
        Tally {
            right: classes().map(|class| self.count(class, class)).sum(),
            shared: classes().flat_map(|a| classes().map(move |b| self.count(a, b))).sum(),
        }
    }

    /// Pixels that the reference gives to a vehicle and the labels to the background.
    pub fn missed(&self) -> u64 {
        (1..CHANNELS).map(|class| self.count(class, 0)).sum()
    }

    /// Pixels that the labels give to a vehicle and the reference to the background.
    pub fn surplus(&self) -> u64 {
        (1..CHANNELS).map(|class| self.count(0, class)).sum()
    }

    /// Share of right parts among the pixels that the reference gives to a vehicle: missed ones are wrong.
    pub fn accuracy_on_reference(&self) -> Option<f64> {
        let Tally { right, shared } = self.inside();
        Tally { right, shared: shared + self.missed() }.accuracy()
    }

    /// Intersection over union of vehicle and background, whatever the parts.
    pub fn vehicle_iou(&self) -> Option<f64> {
        let shared = self.inside().shared;
        Tally { right: shared, shared: shared + self.missed() + self.surplus() }.accuracy()
    }

    /// How each class fares, in the order of ids.
    pub fn classes(&self) -> Vec<ClassAgreement> {
        let class = |class: PartClass| {
            let id = usize::from(class.id());
            let both = self.count(id, id);
            let sum = |first: usize, pick: &dyn Fn(usize) -> u64| (first..CHANNELS).map(pick).sum();
            // In the reference and in the labels, over all pixels and over those inside vehicles.
            let [all, inside] = [0, 1].map(|first| -> [u64; 2] {
                let row = sum(first, &|other| self.count(id, other));
                [row, sum(first, &|other| self.count(other, id))]
            });
            let iou = |[reference, labels]: [u64; 2]| {
                Tally { right: both, shared: reference + labels - both }.accuracy()
            };
            let [reference, labels] = all;
            ClassAgreement { class, reference, labels, iou: iou(all), iou_inside: iou(inside) }
        };
        PartClass::ALL.into_iter().map(class).collect()
    }

    /// Mean over the classes of the reference of their intersection over union, over all pixels.
    pub fn mean_iou(&self) -> Option<f64> {
        mean(self.classes().iter().filter(|class| class.reference > 0).map(|class| class.iou))
    }

    /// The same over the pixels that both masks give to a vehicle.
    pub fn mean_iou_inside(&self) -> Option<f64> {
        mean(self.classes().iter().filter(|class| class.reference > 0).map(|c| c.iou_inside))
    }
}

fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let values: Vec<f64> = values.map(|value| value.unwrap_or(0.0)).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The name of a band of distance; names are in the order of distance.
fn band(depth: f64) -> String {
    let at = BANDS.iter().position(|end| depth < *end).unwrap_or(BANDS.len());
    let start = if at == 0 { 0.0 } else { BANDS[at - 1] };
    match BANDS.get(at) {
        Some(end) => format!("{start:02.0} to {end:02.0} m"),
        None => format!("{start:02.0} m and more"),
    }
}
