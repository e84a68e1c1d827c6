//! A labelled image to learn from: picture, part and vehicle of each pixel.
//!
//! Owners of pixels come from the data set's instance image where it has one; else the models of the zoo are drawn at the
//! true poses ([`Oracle`]).

use std::collections::HashMap;
use std::sync::Arc;

use partpose::dataset::{Dataset, DatasetError, Frame};
use partpose::files::{self, RgbImage};
use partpose::oracle::Oracle;
use partpose::vehicle::ModelZoo;

/// A frame with what its instance image's colours stand for.
#[derive(Clone, Debug)]
pub struct Item {
    /// The frame; it has an image and a part mask.
    pub frame: Frame,
    /// Track of each colour; empty where the data set has no instance images.
    tracks: Arc<HashMap<[u8; 3], u32>>,
}

/// A labelled vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleVehicle {
    /// Corners of the annotated box, pixel (i, j) covering `i..i+1`, `j..j+1`.
    pub corners: [f32; 4],
    /// Whether it is an example; else neither example nor counter-example.
    pub learn: bool,
    /// Name of its model.
    pub model: Option<String>,
    /// Width, height and length, metres.
    pub extent: [f32; 3],
}

/// A decoded frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Name of the frame, for messages.
    pub name: String,
    /// The picture.
    pub image: RgbImage,
    /// Part of each pixel, 0 background.
    pub labels: Vec<u8>,
    /// 0, or 1 + the index of the vehicle that is seen at each pixel.
    pub owners: Vec<u16>,
    /// All labelled vehicles.
    pub vehicles: Vec<SampleVehicle>,
    /// Areas to learn nothing from.
    pub ignored: Vec<[f32; 4]>,
}

/// The frames of a data set that can be learnt from, and how many of its frames cannot.
pub fn items(dataset: &Dataset) -> Result<(Vec<Item>, usize), DatasetError> {
    let mut found = Vec::new();
    let mut left_out = 0;
    for sequence in dataset.sequences() {
        let frames = dataset.read(sequence)?;
        left_out += frames.skipped.len();
        let has_instances = frames.frames.iter().any(|frame| frame.instances.is_some());
        let colors = if has_instances { dataset.segment_colors(sequence)? } else { Vec::new() };
        let tracks = colors.iter().filter_map(|color| Some((color.rgb, color.track?))).collect();
        let tracks = Arc::new(tracks);
        for frame in frames.frames {
            if frame.image.is_some() && frame.parts.is_some() && !frame.vehicles.is_empty() {
                found.push(Item { frame, tracks: Arc::clone(&tracks) });
            } else {
                left_out += 1;
            }
        }
    }
    Ok((found, left_out))
}

/// Reads a frame's images.
///
/// With `dont_care` cars that the data set asks to ignore are examples too; other vehicles to ignore never are, since
/// part masks leave them out.
pub fn read(item: &Item, dont_care: bool, zoo: &ModelZoo) -> Result<Sample, DatasetError> {
    let frame = &item.frame;
    let image = match &frame.image {
        Some(path) => files::read_rgb(path)?,
        None => return Err(wrong(frame, "the frame has no image")),
    };
    let parts = frame.read_parts()?;
    if image.size != parts.size {
        return Err(wrong(frame, "image and part mask differ in size"));
    }
    let owners = match &frame.instances {
        Some(path) if !item.tracks.is_empty() => {
            let colors = files::read_rgb(path)?;
            if colors.size != image.size {
                return Err(wrong(frame, "image and instance image differ in size"));
            }
            owners_by_color(frame, &item.tracks, &colors)
        }
        _ => Oracle::new(frame, parts.clone(), zoo).owners().to_vec(),
    };
    let vehicles = frame.vehicles.iter().map(|vehicle| {
        let b = vehicle.bounds;
        let e = vehicle.cuboid.extent;
        SampleVehicle {
            corners: [b.x_min, b.y_min, b.x_max, b.y_max].map(|value| value as f32 + 0.5),
            learn: !vehicle.dont_care || (dont_care && vehicle.category == "Car"),
            model: vehicle.model.clone(),
            extent: [e.width, e.height, e.length].map(|value| value as f32),
        }
    });
    let corner = |value: f64| value as f32 + 0.5;
    let ignored = frame.ignored.iter().map(|b| [b.x_min, b.y_min, b.x_max, b.y_max].map(corner));
    Ok(Sample {
        name: frame.name(),
        vehicles: vehicles.collect(),
        ignored: ignored.collect(),
        image,
        labels: parts.labels,
        owners,
    })
}

fn owners_by_color(frame: &Frame, tracks: &HashMap<[u8; 3], u32>, colors: &RgbImage) -> Vec<u16> {
    let owner_of = |color: [u8; 3]| {
        let track = tracks.get(&color)?;
        let index = frame.vehicles.iter().position(|vehicle| vehicle.track == Some(*track))?;
        u16::try_from(index + 1).ok()
    };
    // Neighbours mostly share a colour.
    let mut last = ([0; 3], owner_of([0; 3]).unwrap_or(0));
    let pixels = colors.pixels.chunks_exact(3).map(|rgb| {
        let color = [rgb[0], rgb[1], rgb[2]];
        if color != last.0 {
            last = (color, owner_of(color).unwrap_or(0));
        }
        last.1
    });
    pixels.collect()
}

fn wrong(frame: &Frame, reason: &str) -> DatasetError {
    let path = frame.image.clone().unwrap_or_else(|| frame.name().into());
    DatasetError::Image { path, reason: reason.to_owned() }
}
