//! How a data set is distributed: shares of parts, sizes, distances, occlusion, truncation, directions of view.

mod table;

use std::collections::BTreeSet;

use partpose::dataset::{Dataset, DatasetError, Frame, SequenceId};
use partpose::parts::PartClass;
use rayon::prelude::*;

pub use table::statistics_table;

/// Upper ends of the ranges of distances, metres.
const DISTANCES: [f64; 6] = [5.0, 10.0, 20.0, 30.0, 45.0, 70.0];
/// Upper ends of the ranges of the ratios.
const RATIOS: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// Counts over a data set; rows are those of cars, since other vehicles bear no parts in Virtual KITTI's masks.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames.
    pub frames: usize,
    /// Rows of vehicles that are no cars.
    pub others: usize,
    /// Rows of cars.
    pub rows: usize,
    /// Those of them that are to be judged.
    pub counted: usize,
    /// Pixels of every part, by its id; the first is background.
    pub pixels: [u64; 30],
    /// Rows by distance, up to 5, 10, 20, 30, 45, 70 m and beyond.
    pub distances: [usize; 7],
    /// Rows by share of visible pixels in the box, in fifths.
    pub occupancy: [usize; 5],
    /// Rows without truncation, then by truncation in fifths.
    pub truncation: [usize; 6],
    /// Rows by the observation angle alpha, in eighths of a turn from -pi.
    pub alpha: [usize; 8],
    /// Width, height and length of all rows, summed up, in millimetres.
    pub sizes: [usize; 3],
}

/// Counts a data set; part masks are read.
pub fn statistics(dataset: &Dataset) -> Result<Statistics, DatasetError> {
    count(dataset, &BTreeSet::new())
}

/// Counts two data sets. Where they have frames of the same sequence and number, as one made by the other's layout
/// has, only those are counted.
pub fn statistics_beside(
    dataset: &Dataset,
    other: &Dataset,
) -> Result<[Statistics; 2], DatasetError> {
    let (own, others) = (frames_of(dataset)?, frames_of(other)?);
    let common: BTreeSet<_> = own.intersection(&others).cloned().collect();
    Ok([count(dataset, &common)?, count(other, &common)?])
}

fn frames_of(dataset: &Dataset) -> Result<BTreeSet<(SequenceId, u32)>, DatasetError> {
    let mut found = BTreeSet::new();
    for id in dataset.sequences() {
        found.extend(dataset.frames(id)?.iter().map(|frame| (id.clone(), frame.index)));
    }
    Ok(found)
}

/// Counts the frames named, or all of them where none is.
fn count(
    dataset: &Dataset,
    only: &BTreeSet<(SequenceId, u32)>,
) -> Result<Statistics, DatasetError> {
    let mut total = Statistics::default();
    for id in dataset.sequences() {
        let mut frames = dataset.frames(id)?;
        frames.retain(|frame| only.is_empty() || only.contains(&(id.clone(), frame.index)));
        let counted = frames
            .par_iter()
            .map(of_frame)
            .try_reduce(Statistics::default, |a, b| Ok(a.plus(&b)))?;
        total = total.plus(&counted);
    }
    Ok(total)
}

impl Statistics {
    fn plus(mut self, other: &Self) -> Self {
        fn add<const N: usize>(to: &mut [usize; N], from: &[usize; N]) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
        }
        self.frames += other.frames;
        self.others += other.others;
        self.rows += other.rows;
        self.counted += other.counted;
        self.pixels.iter_mut().zip(&other.pixels).for_each(|(to, from)| *to += from);
        add(&mut self.distances, &other.distances);
        add(&mut self.occupancy, &other.occupancy);
        add(&mut self.truncation, &other.truncation);
        add(&mut self.alpha, &other.alpha);
        add(&mut self.sizes, &other.sizes);
        self
    }

    /// Pixels that show a part.
    pub fn part_pixels(&self) -> u64 {
        self.pixels[1..].iter().sum()
    }

    /// Mean width, height and length of the rows, metres.
    pub fn mean_size(&self) -> [f64; 3] {
        self.sizes.map(|sum| sum as f64 / 1000.0 / self.rows.max(1) as f64)
    }

    /// Share of a part among all pixels that show a part.
    pub fn share(&self, part: PartClass) -> f64 {
        self.pixels[usize::from(part.id())] as f64 / self.part_pixels().max(1) as f64
    }
}

fn of_frame(frame: &Frame) -> Result<Statistics, DatasetError> {
    let mut found = Statistics { frames: 1, ..Statistics::default() };
    if frame.parts.is_some() {
        for label in &frame.read_parts()?.labels {
            found.pixels[usize::from(*label).min(29)] += 1;
        }
    }
    for vehicle in &frame.vehicles {
        if vehicle.category != "Car" {
            found.others += 1;
            continue;
        }
        found.rows += 1;
        found.counted += usize::from(!vehicle.dont_care);
        let extent = vehicle.cuboid.extent;
        for (sum, side) in found.sizes.iter_mut().zip([extent.width, extent.height, extent.length])
        {
            *sum += (1000.0 * side).round() as usize;
        }
        let at = vehicle.cuboid.camera_from_vehicle.translation.vector;
        found.distances[range(&DISTANCES, at.norm())] += 1;
        found.occupancy[range(&RATIOS, vehicle.occupancy.unwrap_or(0.0))] += 1;
        let cut = vehicle.truncation;
        found.truncation[if cut > 0.0 { 1 + range(&RATIOS, cut) } else { 0 }] += 1;
        let ahead = vehicle.cuboid.camera_from_vehicle.rotation * nalgebra::Vector3::z();
        // The yaw of the data set is 0 for a vehicle that faces right.
        let ry = ahead.x.atan2(ahead.z) - std::f64::consts::FRAC_PI_2;
        let alpha = partpose::geometry::wrap_angle(ry - at.x.atan2(at.z));
        let eighth = (alpha + std::f64::consts::PI) / std::f64::consts::TAU * 8.0;
        found.alpha[(eighth as usize).min(7)] += 1;
    }
    Ok(found)
}

/// The number of the range of a value.
fn range(ends: &[f64], value: f64) -> usize {
    ends.iter().take_while(|end| value >= **end).count()
}
