//! The labels of one frame.

use crate::dataset::Frame;
use crate::parts::BACKGROUND;
use crate::render::LabelRenderer;

use super::assign::{Assignment, StandIn, Zoos, assign};
use super::layers::{self, Layer};
use super::{LabelError, LabelOptions, Segmentation};

/// Most pixels that a frame and the windows of its vehicles may have together: a hundred that fill an image of a
/// million.
const MAX_PIXELS: usize = 100 << 20;

/// Labels of every pixel of a frame, and of its vehicles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameLabels {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Part ids row by row; 0 is background.
    pub parts: Vec<u8>,
    /// Ids of vehicles row by row, as [`instance_ids`] gives them; 0 is background.
    pub instances: Vec<u16>,
    /// The labelled vehicles that lie in the image at least partly, hidden ones included, in the order of their rows.
    pub vehicles: Vec<LabeledVehicle>,
    /// Whether a segmentation of the image was used; without one, occluders other than vehicles are unknown.
    pub segmented: bool,
}

/// What is known of a labelled vehicle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LabeledVehicle {
    /// Its position in [`Frame::vehicles`].
    pub row: usize,
    /// Its id in [`FrameLabels::instances`].
    pub id: u16,
    /// The name of its model.
    pub model: String,
    /// Why another model than the one asked for.
    pub stand_in: Option<StandIn>,
    /// Whether the zoo has the model that the data set names, and another was chosen by size.
    pub named_otherwise: bool,
    /// Pixels that show it.
    pub visible_pixels: u32,
    /// Pixels of the image that would show it if nothing stood before it.
    pub total_pixels: u32,
    /// Upper left pixel, width and height of a window that holds all its pixels.
    pub window: [[u32; 2]; 2],
}

/// The instance id of every vehicle of a frame: track + 1; or 1 + its position, if one has no track or one past 65533.
pub fn instance_ids(frame: &Frame) -> Vec<u16> {
    let id = |track: Option<u32>| track.and_then(|track| u16::try_from(track.checked_add(1)?).ok());
    let fits = |id: &Option<u16>| id.is_some_and(|id| id < u16::MAX);
    let by_track: Vec<Option<u16>> = frame.vehicles.iter().map(|v| id(v.track)).collect();
    if by_track.iter().all(fits) {
        return by_track.into_iter().flatten().collect();
    }
    // Readers refuse frames with more vehicles than ids.
    (1..=u16::MAX).take(frame.vehicles.len()).collect()
}

/// Labels a frame; the result depends on nothing but the arguments.
///
/// `renderer` only lends its buffers. Fails where the vehicles would take too much memory.
pub fn label_frame(
    frame: &Frame,
    zoos: &Zoos,
    options: &LabelOptions,
    segmentation: Option<&Segmentation>,
    renderer: &mut LabelRenderer,
) -> Result<FrameLabels, LabelError> {
    let size = frame.camera.size;
    let assignments: Vec<Option<Assignment>> =
        frame.vehicles.iter().map(|vehicle| assign(frame, vehicle, zoos, options)).collect();
    let mut pixels = size[0] as usize * size[1] as usize;
    let mut drawn: Vec<Option<Layer>> = Vec::with_capacity(assignments.len());
    for (vehicle, assignment) in frame.vehicles.iter().zip(&assignments) {
        let placed = assignment.as_ref().and_then(|assignment| {
            let instance = layers::place(assignment.model, &vehicle.cuboid);
            Some((instance, layers::window(&frame.camera, &instance)?))
        });
        pixels += placed.map_or(0, |(_, (_, size))| size[0] as usize * size[1] as usize);
        if pixels > MAX_PIXELS {
            return Err(LabelError::TooCrowded { vehicles: frame.vehicles.len(), size });
        }
        drawn.push(placed.and_then(|(instance, window)| {
            layers::draw(renderer, &frame.camera, &instance, window)
        }));
    }
    let mut owners = layers::compose(size, &drawn);
    if let Some(segmentation) = segmentation {
        segmentation.overrule(&mut owners, frame, &drawn);
    }
    let ids = instance_ids(frame);
    let mut labels = FrameLabels {
        size,
        parts: vec![BACKGROUND; owners.len()],
        instances: vec![0; owners.len()],
        vehicles: Vec::new(),
        segmented: segmentation.is_some(),
    };
    let labelled: Vec<bool> =
        assignments.iter().map(|a| a.as_ref().is_some_and(|a| a.labelled)).collect();
    let mut visible = vec![0; drawn.len()];
    for (at, owner) in owners.iter().enumerate().filter(|(_, owner)| **owner != 0) {
        let row = usize::from(*owner) - 1;
        let (x, y) = (at as u32 % size[0], at as u32 / size[0]);
        let part = drawn[row].as_ref().and_then(|layer| layer.at(x, y)).filter(|_| labelled[row]);
        if let Some((part, _)) = part {
            labels.parts[at] = part;
            labels.instances[at] = ids[row];
            visible[row] += 1;
        }
    }
    for (row, (assignment, layer)) in assignments.iter().zip(&drawn).enumerate() {
        let (Some(assignment), Some(layer)) = (assignment, layer) else { continue };
        if labelled[row] {
            labels.vehicles.push(LabeledVehicle {
                row,
                id: ids[row],
                model: assignment.model.name().to_owned(),
                stand_in: assignment.stand_in,
                named_otherwise: assignment.named_otherwise,
                visible_pixels: visible[row],
                total_pixels: layer.pixels(),
                window: [layer.origin, layer.size],
            });
        }
    }
    Ok(labels)
}
