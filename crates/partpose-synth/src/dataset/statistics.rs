//! How a data set is distributed: class shares, distances, occlusion, truncation.

use std::fmt::Write;

use partpose::dataset::{Dataset, DatasetError, Frame};
use partpose::parts::PartClass;
use rayon::prelude::*;

/// Upper ends of the ranges of distances, metres.
const DISTANCES: [f64; 7] = [5.0, 10.0, 20.0, 30.0, 45.0, 70.0, f64::INFINITY];
/// Upper ends of the ranges of the ratios.
const RATIOS: [f64; 5] = [0.2, 0.4, 0.6, 0.8, f64::INFINITY];

/// Counts over a data set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// Frames.
    pub frames: usize,
    /// Rows of vehicles.
    pub rows: usize,
    /// Rows that are to be judged.
    pub counted: usize,
    /// Pixels of every part, by its id; the first is background.
    pub pixels: [u64; 30],
    /// Rows by distance, up to 5, 10, 20, 30, 45, 70 m and beyond.
    pub distances: [usize; 7],
    /// Rows by share of visible pixels in the box, in fifths.
    pub occupancy: [usize; 5],
    /// Rows without truncation, then by truncation in fifths.
    pub truncation: [usize; 6],
    /// Rows by direction of view, in eighths of a turn from alpha = -pi.
    pub alpha: [usize; 8],
}

/// Counts a data set; part masks are read.
pub fn statistics(dataset: &Dataset) -> Result<Statistics, DatasetError> {
    let mut total = Statistics::default();
    for id in dataset.sequences() {
        let frames = dataset.frames(id)?;
        let counted =
            frames.par_iter().map(frame).try_reduce(Statistics::default, |a, b| Ok(a.plus(&b)))?;
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
        self.rows += other.rows;
        self.counted += other.counted;
        self.pixels.iter_mut().zip(&other.pixels).for_each(|(to, from)| *to += from);
        add(&mut self.distances, &other.distances);
        add(&mut self.occupancy, &other.occupancy);
        add(&mut self.truncation, &other.truncation);
        add(&mut self.alpha, &other.alpha);
        self
    }

    /// Share of a part among all pixels that show a part.
    pub fn share(&self, part: PartClass) -> f64 {
        let all: u64 = self.pixels[1..].iter().sum();
        self.pixels[usize::from(part.id())] as f64 / all.max(1) as f64
    }
}

fn frame(frame: &Frame) -> Result<Statistics, DatasetError> {
    let mut found = Statistics { frames: 1, ..Statistics::default() };
    if frame.parts.is_some() {
        for label in &frame.read_parts()?.labels {
            found.pixels[usize::from(*label).min(29)] += 1;
        }
    }
    for vehicle in &frame.vehicles {
        found.rows += 1;
        found.counted += usize::from(!vehicle.dont_care);
        let at = vehicle.cuboid.camera_from_vehicle.translation.vector;
        let range =
            |limits: &[f64], value: f64| limits.iter().take_while(|limit| value >= **limit).count();
        found.distances[range(&DISTANCES, at.norm()).min(6)] += 1;
        found.occupancy[range(&RATIOS, vehicle.occupancy.unwrap_or(0.0)).min(4)] += 1;
        let truncation = vehicle.truncation;
        let bin = if truncation > 0.0 { 1 + range(&RATIOS, truncation).min(4) } else { 0 };
        found.truncation[bin] += 1;
        let ahead = vehicle.cuboid.camera_from_vehicle.rotation * nalgebra::Vector3::z();
        // The yaw of the data set is 0 for a vehicle that faces right.
        let ry = ahead.x.atan2(ahead.z) - std::f64::consts::FRAC_PI_2;
        let alpha = partpose::geometry::wrap_angle(ry - at.x.atan2(at.z));
        let eighth = (alpha + std::f64::consts::PI) / std::f64::consts::TAU * 8.0;
        found.alpha[(eighth as usize).min(7)] += 1;
    }
    Ok(found)
}

/// The figures of one data set, or of two beside each other, as a text table.
pub fn statistics_table(sets: &[(&str, &Statistics)]) -> String {
    let mut text = String::new();
    let mut line = |name: &str, cells: Vec<String>| {
        let _ = write!(text, "{name:<24}");
        for cell in cells {
            let _ = write!(text, "{cell:>14}");
        }
        text.push('\n');
    };
    let ratio = |values: Vec<f64>| -> Vec<String> {
        let mut cells: Vec<String> =
            values.iter().map(|value| format!("{:.2} %", 100.0 * value)).collect();
        if let [a, b] = values[..] {
            cells.push(if b > 0.0 { format!("{:.2}", a / b) } else { "-".to_owned() });
        }
        cells
    };
    let mut header: Vec<String> = sets.iter().map(|(name, _)| (*name).to_owned()).collect();
    if sets.len() == 2 {
        header.push("ratio".to_owned());
    }
    line("", header);
    let count =
        |of: fn(&Statistics) -> usize| sets.iter().map(|(_, set)| of(set).to_string()).collect();
    line("frames", count(|set| set.frames));
    line("rows", count(|set| set.rows));
    line("rows that count", count(|set| set.counted));
    line(
        "vehicle pixels",
        sets.iter().map(|(_, set)| set.pixels[1..].iter().sum::<u64>().to_string()).collect(),
    );
    for part in PartClass::ALL {
        let name = format!("{} {}", part.id(), part.name());
        line(&name, ratio(sets.iter().map(|(_, set)| set.share(part)).collect()));
    }
    let mut bins = |title: &str, names: &[&str], of: fn(&Statistics) -> Vec<usize>| {
        for (i, name) in names.iter().enumerate() {
            let share = |set: &Statistics| of(set)[i] as f64 / set.rows.max(1) as f64;
            line(
                &format!("{title} {name}"),
                ratio(sets.iter().map(|(_, set)| share(set)).collect()),
            );
        }
    };
    bins("distance m", &["0-5", "5-10", "10-20", "20-30", "30-45", "45-70", "70-"], |set| {
        set.distances.to_vec()
    });
    let fifths = ["0.0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8", "0.8-1.0"];
    bins("occupancy", &fifths, |set| set.occupancy.to_vec());
    let cut = ["0", "0.0-0.2", "0.2-0.4", "0.4-0.6", "0.6-0.8", "0.8-1.0"];
    bins("truncation", &cut, |set| set.truncation.to_vec());
    let turns =
        ["-180..-135", "-135..-90", "-90..-45", "-45..0", "0..45", "45..90", "90..135", "135..180"];
    bins("alpha deg", &turns, |set| set.alpha.to_vec());
    text
}
