//! Which vehicle each part pixel belongs to.
//!
//! The released masks carry no instance ids, so the models are drawn at their true poses and the nearest one owns the
//! pixel. Outlines differ by a pixel here and there: part pixels that no model covers go to the owner next to them,
//! and, where there is none within reach, to the nearest vehicle whose box holds them.

use crate::dataset::{Frame, VehicleLabel};
use crate::parts::{BACKGROUND, PartMask};
use crate::render::{Instance, render_labels};
use crate::vehicle::{ModelZoo, VehicleModel};

/// The category whose parts every mask shows.
const CAR: &str = "Car";
/// How far, in pixels, a part pixel may lie outside the drawn model that owns it.
const REACH: usize = 4;

/// One value a pixel: 0 for background, else 1 + the index of the vehicle.
///
/// Vehicles that the masks leave out (vans and trucks in Virtual KITTI) own the unlabelled pixels they cover: they hide
/// what is behind.
pub(super) fn assign(frame: &Frame, parts: &PartMask, zoo: &ModelZoo) -> Vec<u16> {
    let instances: Vec<Instance> = frame
        .vehicles
        .iter()
        .enumerate()
        .filter_map(|(index, vehicle)| {
            let model = model_for(vehicle, zoo)?;
            Some(Instance {
                mesh: model.mesh(),
                scale: vehicle.cuboid.extent.ratio(&model.extent()),
                camera_from_vehicle: vehicle.cuboid.camera_from_vehicle,
                id: index as u16 + 1,
            })
        })
        .collect();
    let rendered = render_labels(&frame.camera, &instances).instances;
    let labelled = labels_others(frame, parts, &rendered);
    let has_parts = |vehicle: &VehicleLabel| labelled || vehicle.category == CAR;
    let mut owners: Vec<u16> = vec![0; rendered.len()];
    for ((owner, rendered), label) in owners.iter_mut().zip(&rendered).zip(&parts.labels) {
        if *rendered != 0
            && has_parts(&frame.vehicles[usize::from(*rendered) - 1]) == (*label != BACKGROUND)
        {
            *owner = *rendered;
        }
    }
    spread(&mut owners, parts);
    claim_by_box(&mut owners, parts, frame, &has_parts);
    owners
}

/// Whether masks show the parts of vehicles that are no cars, too: most of what is drawn of them has labels.
fn labels_others(frame: &Frame, parts: &PartMask, rendered: &[u16]) -> bool {
    let mut counts = [0usize; 2];
    for (rendered, label) in rendered.iter().zip(&parts.labels) {
        if *rendered != 0 && frame.vehicles[usize::from(*rendered) - 1].category != CAR {
            counts[usize::from(*label != BACKGROUND)] += 1;
        }
    }
    counts[1] > counts[0]
}

/// The vehicle's own model, or the one nearest in size.
fn model_for<'a>(vehicle: &VehicleLabel, zoo: &'a ModelZoo) -> Option<&'a VehicleModel> {
    let extent = &vehicle.cuboid.extent;
    let own = vehicle.model.as_deref().and_then(|name| zoo.get(name));
    own.or_else(|| zoo.closest(&vehicle.category, extent)).or_else(|| {
        zoo.models.iter().min_by(|a, b| {
            a.extent().l1_distance(extent).total_cmp(&b.extent().l1_distance(extent))
        })
    })
}

/// Gives part pixels without an owner the owner of a neighbour, [`REACH`] times over.
fn spread(owners: &mut [u16], parts: &PartMask) {
    let [width, height] = parts.size.map(|side| side as usize);
    let mut open: Vec<usize> = (0..owners.len())
        .filter(|at| parts.labels[*at] != BACKGROUND && owners[*at] == 0)
        .collect();
    for _ in 0..REACH {
        let claimed: Vec<(usize, u16)> = open
            .iter()
            .filter_map(|at| {
                let (x, y) = (at % width, at / width);
                let neighbours = [
                    (x > 0).then(|| at - 1),
                    (x + 1 < width).then(|| at + 1),
                    (y > 0).then(|| at - width),
                    (y + 1 < height).then(|| at + width),
                ];
                let owned = |at: &usize| owners[*at] != 0 && parts.labels[*at] != BACKGROUND;
                neighbours.into_iter().flatten().find(owned).map(|other| (*at, owners[other]))
            })
            .collect();
        if claimed.is_empty() {
            return;
        }
        for (at, owner) in claimed {
            owners[at] = owner;
        }
        open.retain(|at| owners[*at] == 0);
    }
}

/// Gives what is left to the nearest vehicle whose box holds it.
fn claim_by_box(
    owners: &mut [u16],
    parts: &PartMask,
    frame: &Frame,
    has_parts: &dyn Fn(&VehicleLabel) -> bool,
) {
    let mut by_depth: Vec<usize> =
        (0..frame.vehicles.len()).filter(|i| has_parts(&frame.vehicles[*i])).collect();
    let depth = |i: &usize| frame.vehicles[*i].cuboid.camera_from_vehicle.translation.z;
    by_depth.sort_by(|a, b| depth(a).total_cmp(&depth(b)));
    let width = parts.size[0] as usize;
    for index in by_depth {
        let (x0, y0, x1, y1) = frame.vehicles[index].bounds.pixels(parts.size);
        for y in y0..y1 {
            for x in x0..x1 {
                let at = y as usize * width + x as usize;
                if owners[at] == 0 && parts.labels[at] != BACKGROUND {
                    owners[at] = index as u16 + 1;
                }
            }
        }
    }
}
