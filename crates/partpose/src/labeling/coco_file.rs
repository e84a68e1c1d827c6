//! The annotations of labelled frames as COCO has them, and a sequence's file from those of its blocks.

use std::io;
use std::path::Path;

use serde::Serialize;

use crate::dataset::{Dataset, Frame, SequenceId, VehicleLabel};
use crate::files;
use crate::formats::coco::{
    CocoAnnotation, CocoImage, VEHICLE_CATEGORY, VehicleFacts, annotation, annotation_id,
    write_end, write_list, write_start,
};
use crate::geometry::Rect;
use crate::parts::rle::{Rle, RleBuilder};

use super::block::{Block, BlockHeader};
use super::store::{instances_file, parts_file};
use super::{FrameLabels, LabelError, LabelStore, LabeledVehicle, StandIn};

/// Most objects of a frame: what the annotation ids have room for.
const MAX_OBJECTS: usize = 1 << 16;

/// The head of a sequence's file.
#[derive(Serialize)]
struct Info {
    description: String,
    version: &'static str,
    skipped_frames: Vec<u32>,
    /// What may hide vehicles in these labels.
    occluders: &'static str,
}

/// The record of a frame.
pub(super) fn image(frame: &Frame, dataset_root: &Path) -> CocoImage {
    let picture = frame.image.as_ref().and_then(|path| path.strip_prefix(dataset_root).ok());
    let picture = picture.map(|path| {
        let names = path.components().map(|name| name.as_os_str().to_string_lossy().into_owned());
        names.collect::<Vec<_>>().join("/")
    });
    CocoImage {
        id: u64::from(frame.index) + 1,
        width: frame.camera.size[0],
        height: frame.camera.size[1],
        file_name: picture.unwrap_or_else(|| format!("{}.png", frame.name())),
        world: frame.sequence.world.clone(),
        variation: frame.sequence.variation.clone(),
        frame: frame.index,
        parts_file: parts_file(frame),
        instances_file: instances_file(frame),
    }
}

/// The records of a frame's vehicles and parts, and of the areas to ignore.
pub(super) fn annotations(frame: &Frame, labels: &FrameLabels) -> Vec<CocoAnnotation> {
    let image_id = u64::from(frame.index) + 1;
    let mut list = Vec::new();
    for vehicle in &labels.vehicles {
        let (Some(masks), Some(label)) = (labels.masks(vehicle), frame.vehicles.get(vehicle.row))
        else {
            continue;
        };
        let ignore = u8::from(label.dont_care);
        let id = annotation_id(frame.index, vehicle.row, None);
        let whole = annotation(id, image_id, VEHICLE_CATEGORY, &masks.vehicle);
        let facts = Some(facts(vehicle, label));
        list.push(CocoAnnotation { iscrowd: ignore, ignore, vehicle: facts, ..whole });
        for (part, mask) in masks.parts.iter() {
            let own = annotation_id(frame.index, vehicle.row, Some(part));
            let part = annotation(own, image_id, part.id(), mask);
            list.push(CocoAnnotation { iscrowd: ignore, ignore, parent_id: Some(id), ..part });
        }
    }
    let free = MAX_OBJECTS.saturating_sub(frame.vehicles.len());
    for (at, area) in frame.ignored.iter().take(free).enumerate() {
        let mask = filled(labels.size, area);
        if mask.area() > 0 {
            let id = annotation_id(frame.index, frame.vehicles.len() + at, None);
            let whole = annotation(id, image_id, VEHICLE_CATEGORY, &mask);
            list.push(CocoAnnotation { iscrowd: 1, ignore: 1, ..whole });
        }
    }
    list
}

fn facts(vehicle: &LabeledVehicle, label: &VehicleLabel) -> VehicleFacts {
    let there = label.cuboid.camera_from_vehicle;
    let rotation = there.rotation.to_rotation_matrix();
    let row = |i: usize| [0, 1, 2].map(|j| rotation[(i, j)]);
    VehicleFacts {
        instance_id: vehicle.id,
        track_id: label.track,
        category: label.category.clone(),
        model: vehicle.model.clone(),
        stand_in: vehicle.stand_in.map(|reason| match reason {
            StandIn::Name => "name",
            StandIn::Category => "category",
        }),
        dont_care: label.dont_care,
        truncated: label.truncated,
        occluded: label.occluded,
        total_pixels: vehicle.total_pixels,
        extent: label.cuboid.extent.to_vector().into(),
        translation: there.translation.vector.into(),
        rotation: [row(0), row(1), row(2)],
    }
}

fn filled(size: [u32; 2], area: &Rect) -> Rle {
    let mut mask = RleBuilder::new(size);
    let (x0, y0, x1, y1) = area.pixels(size);
    for x in x0..x1 {
        mask.push(x, y0, y1 - y0);
    }
    mask.finish()
}

/// Writes the file of a sequence if all its blocks are there; returns how many are not.
///
/// `wanted` says for each block which frames it should tell of, labelled or skipped.
pub(super) fn assemble(
    store: &LabelStore,
    dataset: &Dataset,
    sequence: &SequenceId,
    blocks: &[Vec<u32>],
    unread: &[u32],
) -> Result<usize, LabelError> {
    let mut headers = Vec::with_capacity(blocks.len());
    let mut missing = 0;
    for (at, wanted) in blocks.iter().enumerate() {
        match Block::read(&store.block(sequence, at)).map(|block| block.header) {
            Ok(header) if tells_of(&header, wanted) => headers.push(header),
            _ => missing += 1,
        }
    }
    if missing > 0 {
        return Ok(missing);
    }
    let mut skipped: Vec<u32> = headers.iter().flat_map(|h| h.skipped.iter().copied()).collect();
    skipped.extend(unread);
    skipped.sort_unstable();
    let segmented = headers.iter().flat_map(|header| &header.frames).any(|frame| frame.segmented);
    let info = Info {
        description: format!("part labels of {sequence}, {}", dataset.layout()),
        version: env!("CARGO_PKG_VERSION"),
        skipped_frames: skipped,
        occluders: if segmented {
            "vehicles by depth, everything else by the data set's segmentation"
        } else {
            "vehicles by depth; other occluders are unknown"
        },
    };
    let read = |at: usize| {
        let block = Block::read(&store.block(sequence, at));
        block.map_err(|error| io::Error::other(error.to_string()))
    };
    let records = |pick: fn(Block) -> Vec<String>| {
        let count = blocks.len();
        (0..count).flat_map(move |at| match read(at) {
            Ok(block) => pick(block).into_iter().map(Ok).collect::<Vec<_>>(),
            Err(error) => vec![Err(error)],
        })
    };
    files::write_with(&store.coco(sequence), &mut |out| {
        write_start(out, &info)?;
        write_list(out, "images", &mut records(|block| block.images))?;
        write_list(out, "annotations", &mut records(|block| block.annotations))?;
        write_end(out)
    })?;
    Ok(0)
}

fn tells_of(header: &BlockHeader, wanted: &[u32]) -> bool {
    let mut told: Vec<u32> = header.frames.iter().map(|frame| frame.index).collect();
    told.extend(&header.skipped);
    told.sort_unstable();
    told == *wanted
}
