//! Frames while their rows come in: any order, any number of files, bad ones left out at the end.

use std::collections::BTreeMap;

use crate::geometry::{Camera, Cuboid};

use super::frame::{Frame, SequenceFrames, VehicleLabel};
use super::problem::{Fault, Problem, Problems};
use super::table::Row;

/// Most vehicles of a frame: instance ids have 16 bits, 0 is background, and 65535 is left free.
pub(super) const MAX_VEHICLES: usize = 65_534;
/// How far a box may reach out of its image, pixels: conventions about the last pixel's edge differ by one.
const EDGE_TOLERANCE: f64 = 1.0;

/// A frame and the lines that filled it.
#[derive(Debug)]
pub(super) struct Draft {
    pub(super) frame: Frame,
    pub(super) lines: Vec<usize>,
    /// The line of each track.
    tracks: BTreeMap<u32, usize>,
    /// Whether a vehicle was refused because there are too many.
    overfull: bool,
}

impl Draft {
    fn new(frame: Frame) -> Self {
        Self { frame, lines: Vec::new(), tracks: BTreeMap::new(), overfull: false }
    }
}

/// The frames of a sequence by index.
#[derive(Debug, Default)]
pub(super) struct Drafts {
    by_index: BTreeMap<u32, Draft>,
    pub(super) problems: Problems,
}

impl Drafts {
    /// The frame of an index, made by `make` if it is new.
    pub(super) fn frame(&mut self, index: u32, make: impl FnOnce() -> Frame) -> &mut Draft {
        self.by_index.entry(index).or_insert_with(|| Draft::new(make()))
    }

    /// Adds a vehicle, unless its track is in the frame already or the frame is full.
    pub(super) fn add(
        &mut self,
        row: &Row,
        index: u32,
        vehicle: VehicleLabel,
        make: impl FnOnce() -> Frame,
    ) {
        let draft = self.frame(index, make);
        if draft.frame.vehicles.len() == MAX_VEHICLES {
            // The frame is lost with the first one too many; the others need no words.
            if !std::mem::replace(&mut draft.overfull, true) {
                let fault = Fault::TooManyVehicles { limit: MAX_VEHICLES };
                self.problems.push(row.problem(fault));
            }
            return;
        }
        if let Some(track) = vehicle.track {
            let first_line = *draft.tracks.entry(track).or_insert(row.line);
            if first_line != row.line {
                self.problems.push(row.problem(Fault::DuplicateTrack { track, first_line }));
                return;
            }
        }
        draft.frame.vehicles.push(vehicle);
        draft.lines.push(row.line);
    }

    /// The frames without those that have a fault.
    pub(super) fn finish(self) -> SequenceFrames {
        let Self { by_index, problems } = self;
        let bad = problems.bad_frames;
        let good = by_index.into_iter().filter(|(index, _)| !bad.contains(index));
        let (frames, lines) = good.map(|(_, draft)| (draft.frame, draft.lines)).unzip();
        SequenceFrames {
            frames,
            problems: problems.list,
            problems_omitted: problems.omitted,
            skipped: bad.into_iter().collect(),
            lines,
        }
    }
}

/// Checks that a box `[l, t, r, b]` lies in the image.
pub(super) fn inside_image(row: &Row, bounds: [f64; 4], size: [u32; 2]) -> Result<(), Problem> {
    let [left, top, right, bottom] = bounds;
    let last = [f64::from(size[0]) - 1.0, f64::from(size[1]) - 1.0];
    let inside = left >= -EDGE_TOLERANCE
        && top >= -EDGE_TOLERANCE
        && right <= last[0] + EDGE_TOLERANCE
        && bottom <= last[1] + EDGE_TOLERANCE;
    if inside { Ok(()) } else { Err(row.problem(Fault::OutsideImage { bounds, size })) }
}

/// Checks that the camera can see something of a cuboid.
pub(super) fn in_front(row: &Row, cuboid: &Cuboid) -> Result<(), Problem> {
    if cuboid.corners().iter().any(|corner| corner.z > 0.0) {
        return Ok(());
    }
    Err(row.problem(Fault::BehindCamera { z: cuboid.camera_from_vehicle.translation.z }))
}

/// The camera that a layout has where nothing says otherwise.
pub(super) const VKITTI_CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
