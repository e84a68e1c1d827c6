//! Detections made from ground truth: what a perfect network would say, or one that errs by a chosen amount.
//!
//! With them the pose stage is built and measured before, and apart from, any network (Tables III to V).

mod degrade;
mod heads;
mod kernel;
mod owners;

pub use degrade::{Degradation, strength_for_accuracy};
pub use heads::HeadErrors;

use std::sync::Arc;

use crate::dataset::Frame;
use crate::detection::Detection;
use crate::geometry::{Extent, Rect};
use crate::parts::{BACKGROUND, PartMask};
use crate::vehicle::ModelZoo;

/// What a label image says of a box: the shares of background and parts on size x size cells.
///
/// All parts in the box count as its vehicle's; what lies outside the image is unknown. For masks that come from
/// elsewhere: label images of one vehicle each, or boxes that do not overlap.
pub fn detection_from_labels(labels: &PartMask, bounds: &Rect, size: usize) -> Detection {
    let owners: Vec<u16> = labels.labels.iter().map(|label| u16::from(*label != 0)).collect();
    kernel::fractions(labels, &owners, 1, bounds, size).into_detection(*bounds)
}

/// Which 2D box an oracle detection gets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OracleBox {
    /// The annotated box, which is the projection of the cuboid.
    #[default]
    Annotated,
    /// The tight box of the vehicle's own pixels, 4 to 9 % smaller on most sides.
    Tight,
}

/// What kind of detections the oracle makes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OracleOptions {
    /// Cells a side: the paper's m.
    pub kernel: usize,
    /// Which box.
    pub bounds: OracleBox,
    /// How the detections err; `None` for perfect ones.
    pub degradation: Option<Degradation>,
    /// What the detections say of sizes and models; nothing unless asked for.
    pub heads: HeadErrors,
}

impl Default for OracleOptions {
    fn default() -> Self {
        Self {
            kernel: 28,
            bounds: OracleBox::Annotated,
            degradation: None,
            heads: HeadErrors::default(),
        }
    }
}

/// A frame whose part pixels are told apart by vehicle.
#[derive(Clone, Debug)]
pub struct Oracle {
    parts: PartMask,
    /// One value a pixel: 0 for background, else 1 + the index of the vehicle that is seen there.
    owners: Vec<u16>,
    bounds: Vec<Rect>,
    extents: Vec<Extent>,
    /// Places of the vehicles' models in the zoo.
    models: Vec<Option<usize>>,
    names: Arc<[String]>,
    /// Distinguishes the frame where errors are drawn.
    frame_seed: u64,
}

impl Oracle {
    /// Assigns the pixels of a frame's part mask to its vehicles by the depth order of models at the true poses.
    ///
    /// A vehicle whose model the zoo lacks is stood in for by the one nearest in size.
    pub fn new(frame: &Frame, parts: PartMask, zoo: &ModelZoo) -> Self {
        let owners = owners::assign(frame, &parts, zoo);
        let bounds = frame.vehicles.iter().map(|vehicle| vehicle.bounds).collect();
        let name = format!("{}/{}", frame.sequence, frame.index);
        let place = |name: &str| zoo.models.iter().position(|model| model.name() == name);
        let models = frame.vehicles.iter().map(|v| v.model.as_deref().and_then(place));
        Self {
            parts,
            owners,
            bounds,
            extents: frame.vehicles.iter().map(|vehicle| vehicle.cuboid.extent).collect(),
            models: models.collect(),
            names: zoo.models.iter().map(|model| model.name().to_owned()).collect(),
            frame_seed: degrade::hash(name.as_bytes()),
        }
    }

    /// The owner of each pixel, row by row: 0 for background, else 1 + the index of the vehicle.
    pub fn owners(&self) -> &[u16] {
        &self.owners
    }

    /// The part mask of the whole frame.
    pub fn parts(&self) -> &PartMask {
        &self.parts
    }

    /// The vehicle's own parts on the pixels of a rectangle; everything else is background.
    pub fn vehicle_mask(&self, vehicle: usize, bounds: &Rect) -> PartMask {
        let size = self.parts.size;
        let (x0, y0, x1, y1) = bounds.pixels(size);
        let mut mask = PartMask::background([x0 as i32, y0 as i32], [x1 - x0, y1 - y0]);
        let id = vehicle as u16 + 1;
        let width = size[0] as usize;
        for (label, (y, x)) in
            mask.labels.iter_mut().zip((y0..y1).flat_map(|y| (x0..x1).map(move |x| (y, x))))
        {
            let at = y as usize * width + x as usize;
            *label = if self.owners[at] == id { self.parts.labels[at] } else { BACKGROUND };
        }
        mask
    }

    /// The tight rectangle around the vehicle's own pixels; `None` where none is seen.
    pub fn tight_bounds(&self, vehicle: usize) -> Option<Rect> {
        let mask = self.vehicle_mask(vehicle, &self.bounds[vehicle]);
        let [x0, y0] = mask.origin.map(f64::from);
        let mut bounds: Option<Rect> = None;
        for (j, row) in mask.rows().enumerate() {
            let Some(first) = row.iter().position(|label| *label != BACKGROUND) else { continue };
            let last = row.iter().rposition(|label| *label != BACKGROUND).unwrap_or(first);
            let (left, right, y) = (x0 + first as f64, x0 + last as f64, y0 + j as f64);
            let line = Rect::from_inclusive(left, y, right, y);
            bounds = Some(bounds.map_or(line, |b| Rect {
                x_min: b.x_min.min(line.x_min),
                y_min: b.y_min,
                x_max: b.x_max.max(line.x_max),
                y_max: line.y_max,
            }));
        }
        bounds
    }

    /// The detection of a vehicle; `None` if its box covers no pixel of the image or none of the vehicle's own is seen.
    pub fn detection(&self, vehicle: usize, options: &OracleOptions) -> Option<Detection> {
        let tight = self.tight_bounds(vehicle)?;
        let bounds = match options.bounds {
            OracleBox::Annotated => self.bounds[vehicle],
            OracleBox::Tight => tight,
        };
        if bounds.area() <= 0.0 {
            return None;
        }
        let id = vehicle as u16 + 1;
        let seed = degrade::mix(self.frame_seed, u64::from(id));
        let seen = match &options.degradation {
            None => {
                let kernel =
                    kernel::fractions(&self.parts, &self.owners, id, &bounds, options.kernel);
                kernel.into_detection(bounds)
            }
            Some(degradation) => {
                degrade::detection(self, id, &bounds, options.kernel, degradation, seed)
            }
        };
        let size = options.heads.size(&self.extents[vehicle], seed);
        let models = self.models[vehicle];
        let models = models.and_then(|own| options.heads.models(own, &self.names, seed));
        Some(Detection { size, models, ..seen })
    }
}
