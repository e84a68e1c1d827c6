//! Images: which are there, whether they have the right size, and whether part masks fit the labels.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use crate::files;
use crate::geometry::{Point2, Rect};

use super::super::{DatasetError, Fault, Frame, Layout, Problem, SequenceFrames};
use super::{Missing, SequenceReport};

/// Share of a sequence's part pixels outside of all boxes beyond which masks and labels do not belong together;
/// published masks stay below 1e-4.
const STRAY: f64 = 1e-3;

/// Images of a sequence.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Archives {
    /// Frames with an RGB image.
    pub images: usize,
    /// Frames with a part mask.
    pub parts: usize,
    /// Frames with a depth image.
    pub depth: usize,
    /// Frames with a class image.
    pub classes: usize,
    /// Frames with an instance image.
    pub instances: usize,
    /// Frames whose camera pose is known.
    pub world: usize,
    /// Part masks that were decoded.
    pub masks_read: usize,
    /// Their pixels that show a part.
    pub mask_pixels: usize,
    /// Those of them that lie in no annotated box.
    pub mask_pixels_outside: usize,
}

/// Counts and checks the images of a sequence; decodes `masks` of the part masks, or all.
pub(super) fn check(
    layout: Layout,
    read: &SequenceFrames,
    masks: Option<usize>,
) -> (Archives, Vec<Problem>) {
    let frames = &read.frames;
    let count = |has: fn(&Frame) -> bool| frames.iter().filter(|frame| has(frame)).count();
    let mut archives = Archives {
        images: count(|frame| frame.image.is_some()),
        parts: count(|frame| frame.parts.is_some()),
        depth: count(|frame| frame.depth.is_some()),
        classes: count(|frame| frame.classes.is_some()),
        instances: count(|frame| frame.instances.is_some()),
        world: count(|frame| frame.world_from_camera.is_some()),
        ..Archives::default()
    };
    let mut problems: Vec<Problem> = frames.par_iter().flat_map_iter(wrong_sizes).collect();
    if layout != Layout::Kitti {
        problems.extend(gaps(frames));
    }
    let masked: Vec<&Frame> = frames.iter().filter(|frame| frame.parts.is_some()).collect();
    let step = masks.map_or(1, |masks| masked.len().div_ceil(masks.max(1)).max(1));
    let chosen: Vec<&Frame> =
        if masks == Some(0) { Vec::new() } else { masked.into_iter().step_by(step).collect() };
    let results: Vec<Result<[usize; 2], Problem>> =
        chosen.par_iter().map(|frame| mask_pixels(frame)).collect();
    for result in results {
        match result {
            Ok([pixels, outside]) => {
                archives.masks_read += 1;
                archives.mask_pixels += pixels;
                archives.mask_pixels_outside += outside;
            }
            // Sizes have been compared for all masks already.
            Err(problem) => {
                if !problems.iter().any(|known| known.path == problem.path) {
                    problems.push(problem);
                }
            }
        }
    }
    let share = archives.mask_pixels_outside as f64 / archives.mask_pixels.max(1) as f64;
    if let Some(path) = chosen.first().and_then(|frame| frame.parts.as_deref()?.parent())
        && share > STRAY
    {
        let finding = format!(
            "{:.2} % of the part pixels lie outside of all boxes: masks and labels seem to be of \
             different frames",
            100.0 * share
        );
        problems.push(Problem::of_file(path, None, Fault::Contradiction { finding }));
    }
    (archives, problems)
}

/// What commands cannot do with these sequences.
pub(super) fn missing(layout: Layout, sequences: &[SequenceReport]) -> Vec<Missing> {
    type Has = fn(&Archives) -> bool;
    let wanted: [(&str, Has, &'static str); 5] = [
        (
            "part masks",
            |archives| archives.parts > 0,
            "`zoo carve` and `evaluate poses --oracle` need them",
        ),
        (
            "RGB images",
            |archives| archives.images > 0,
            "pictures have a dark ground under the masks",
        ),
        (
            "camera poses",
            |archives| archives.world > 0,
            "nothing can be related to the world, and frames without vehicles are not known",
        ),
        (
            "instance images",
            |archives| archives.instances > 0,
            "vehicles that overlap are told apart by the depth of their models",
        ),
        ("depth images", |archives| archives.depth > 0, "no command needs them yet"),
    ];
    let mut missing = Vec::new();
    for (name, has, consequence) in wanted {
        // KITTI has none of these by nature.
        if layout == Layout::Kitti && !matches!(name, "part masks" | "RGB images") {
            continue;
        }
        // A sequence of which no frame could be read says nothing about its archives.
        let read = || sequences.iter().filter(|sequence| sequence.frames > 0);
        let lacking = read().filter(|sequence| !has(&sequence.archives)).count();
        if lacking > 0 {
            let what = match (lacking, read().count()) {
                (lacking, all) if lacking == all => format!("no {name}"),
                (lacking, all) => format!("no {name} in {lacking} of {all} sequences"),
            };
            missing.push(Missing { what, consequence });
        }
    }
    missing
}

fn wrong_sizes(frame: &Frame) -> Vec<Problem> {
    let mut paths: Vec<&Path> =
        [&frame.image, &frame.parts, &frame.depth, &frame.classes, &frame.instances]
            .into_iter()
            .filter_map(|path| path.as_deref())
            .collect();
    paths.dedup();
    let fault = |path: &Path| match files::image_size(path) {
        Ok(found) if found == frame.camera.size => None,
        Ok(found) => Some(Fault::ImageSize { found, expected: frame.camera.size }),
        Err(error) => Some(Fault::unreadable(&error)),
    };
    let problem = |path: &Path| Some(Problem::of_file(path, Some(frame.index), fault(path)?));
    paths.into_iter().filter_map(problem).collect()
}

/// Files that single frames lack while others of the sequence have them.
fn gaps(frames: &[Frame]) -> Vec<Problem> {
    type File = fn(&Frame) -> Option<&PathBuf>;
    let kinds: [File; 5] = [
        |frame| frame.image.as_ref(),
        |frame| frame.parts.as_ref(),
        |frame| frame.depth.as_ref(),
        |frame| frame.classes.as_ref(),
        |frame| frame.instances.as_ref(),
    ];
    let mut problems: Vec<Problem> = Vec::new();
    for file in kinds {
        let Some(folder) = frames.iter().find_map(|frame| file(frame)?.parent()) else { continue };
        let lacking: Vec<u32> =
            frames.iter().filter(|frame| file(frame).is_none()).map(|frame| frame.index).collect();
        let (Some(first), false) =
            (lacking.first(), problems.iter().any(|problem| problem.path == folder))
        else {
            continue;
        };
        let finding = format!(
            "{} of {} frames have no file here, the first of them frame {first}",
            lacking.len(),
            frames.len()
        );
        problems.push(Problem::of_file(folder, None, Fault::Contradiction { finding }));
    }
    problems
}

/// Pixels that show a part, and those of them that lie in no box.
fn mask_pixels(frame: &Frame) -> Result<[usize; 2], Problem> {
    let mask = frame.read_parts().map_err(|error| {
        let path = frame.parts.clone().unwrap_or_default();
        let fault = match error {
            DatasetError::Image { reason, .. } => Fault::Unreadable { reason },
            other => Fault::unreadable(&other),
        };
        Problem::of_file(&path, Some(frame.index), fault)
    })?;
    let boxes: Vec<&Rect> = frame.vehicles.iter().map(|vehicle| &vehicle.bounds).collect();
    let mut counts = [0, 0];
    for (y, row) in mask.rows().enumerate() {
        for (x, _) in row.iter().enumerate().filter(|(_, label)| **label != 0) {
            let pixel = Point2::new(x as f64, y as f64);
            counts[0] += 1;
            counts[1] += usize::from(!boxes.iter().any(|rect| rect.contains(&pixel)));
        }
    }
    Ok(counts)
}
