//! What a data set's segmentation images say, pixel by pixel, and how it overrules the depth order of models.
//!
//! Virtual KITTI 1.3.1 has one image whose colours are classes and vehicles (`Car:12`); 2.0.3 has an image of classes
//! and one of track + 1 as palette index. Where vehicles are told apart, a pixel belongs to the one named, and shows the
//! part that its model has there, even where another model would be nearer; where only classes are known, to the
//! nearest model of a vehicle of the pixel's class. Any other pixel shows an occluder and is cut out.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::dataset::{Frame, SegmentColor};
use crate::files::{self, read_indices};

use super::LabelError;
use super::layers::Layer;

/// Class of pixels that show no known category.
const NO_CLASS: u16 = 0;
/// Colour of pixels that the renderer left undefined.
const UNDEFINED: [u8; 3] = [0; 3];

/// A frame's segmentation.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Names of the classes; pixels hold 1 + the index.
    categories: Vec<String>,
    /// One class a pixel, row by row; empty where the data set tells tracks only.
    classes: Vec<u16>,
    /// 1 + the track a pixel shows, 0 for none; empty where vehicles are not told apart.
    tracks: Vec<u64>,
}

impl Segmentation {
    /// Reads what a frame has; `None` where it has no segmentation at all.
    pub fn read(frame: &Frame, colors: &[SegmentColor]) -> Result<Option<Self>, LabelError> {
        let mut read = Self { categories: Vec::new(), classes: Vec::new(), tracks: Vec::new() };
        let one_image = frame.classes == frame.instances;
        if let Some(path) = &frame.classes {
            read.read_colors(path, frame, colors, one_image)?;
        }
        if let Some(path) = frame.instances.as_ref().filter(|_| !one_image) {
            let image = read_indices(path)?;
            fits(path, image.size, frame)?;
            read.tracks = image.values.into_iter().map(u64::from).collect();
        }
        Ok((!read.classes.is_empty() || !read.tracks.is_empty()).then_some(read))
    }

    fn read_colors(
        &mut self,
        path: &Path,
        frame: &Frame,
        colors: &[SegmentColor],
        with_tracks: bool,
    ) -> Result<(), LabelError> {
        let image = files::read_rgb(path)?;
        fits(path, image.size, frame)?;
        let mut known: BTreeMap<[u8; 3], (u16, u64)> = BTreeMap::new();
        known.insert(UNDEFINED, (NO_CLASS, 0));
        for color in colors {
            let at = self.categories.iter().position(|name| *name == color.category);
            let at = at.unwrap_or_else(|| {
                self.categories.push(color.category.clone());
                self.categories.len() - 1
            });
            let track = color.track.map_or(0, |track| u64::from(track) + 1);
            known.insert(color.rgb, (at as u16 + 1, track));
        }
        // Tables that name no track tell classes only.
        let with_tracks = with_tracks && colors.iter().any(|color| color.track.is_some());
        let mut last = (UNDEFINED, (NO_CLASS, 0));
        for (at, rgb) in image.pixels.chunks_exact(3).enumerate() {
            let color = [rgb[0], rgb[1], rgb[2]];
            if color != last.0 {
                let Some(seen) = known.get(&color) else {
                    let (x, y) = (at as u32 % image.size[0], at as u32 / image.size[0]);
                    return Err(LabelError::Color { path: path.to_owned(), color, x, y });
                };
                last = (color, *seen);
            }
            self.classes.push(last.1.0);
            if with_tracks {
                self.tracks.push(last.1.1);
            }
        }
        Ok(())
    }

    /// Whether vehicles of one class are told apart.
    pub fn tells_vehicles_apart(&self) -> bool {
        !self.tracks.is_empty()
    }

    /// Corrects the owners of pixels: 0 for none, else 1 + the index of vehicle and layer.
    ///
    /// A pixel of a vehicle whose model does not reach it stays without owner: its part is unknown.
    pub(super) fn overrule(&self, owners: &mut [u16], frame: &Frame, layers: &[Option<Layer>]) {
        let width = frame.camera.size[0].max(1);
        let by_track: BTreeMap<u64, usize> = frame
            .vehicles
            .iter()
            .enumerate()
            .filter_map(|(at, vehicle)| Some((u64::from(vehicle.track?) + 1, at)))
            .collect();
        let class_of = |category: &str| {
            let at = self.categories.iter().position(|name| name == category);
            at.map_or(u16::MAX, |at| at as u16 + 1)
        };
        let classes: Vec<u16> =
            frame.vehicles.iter().map(|vehicle| class_of(&vehicle.category)).collect();
        for (at, owner) in owners.iter_mut().enumerate().filter(|(_, owner)| **owner != 0) {
            let (x, y) = (at as u32 % width, at as u32 / width);
            let winner = usize::from(*owner) - 1;
            let covers = |vehicle: usize| layers[vehicle].as_ref()?.at(x, y);
            let corrected = if self.tells_vehicles_apart() {
                let named = by_track.get(&self.tracks[at]).copied();
                named.filter(|vehicle| covers(*vehicle).is_some())
            } else if classes[winner] == self.classes[at] {
                continue;
            } else {
                let same = (0..layers.len()).filter(|n| classes[*n] == self.classes[at]);
                let seen = same.filter_map(|vehicle| Some((covers(vehicle)?.1, vehicle)));
                seen.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, vehicle)| vehicle)
            };
            *owner = corrected.map_or(0, |vehicle| vehicle as u16 + 1);
        }
    }
}

fn fits(path: &Path, found: [u32; 2], frame: &Frame) -> Result<(), LabelError> {
    let expected = frame.camera.size;
    if found == expected {
        return Ok(());
    }
    Err(LabelError::Size { path: PathBuf::from(path), found, expected })
}
