//! How well models agree with masks that were not used to make them.
//!
//! A view counts as free of occluders by criteria that know nothing of the model: its box is not truncated, no nearer
//! vehicle's cuboid overlaps its own, no farther one's covers much of it, the rows of the mask's upper part have no
//! gaps, and its part pixels fill the cuboid's projection about as well (within
//! [`FILL_SLACK`]) as those of the better views of the same mesh from the same direction. Pixels that another vehicle
//! may have drawn are left out.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::dataset::{Frame, SequenceId};
use crate::parts::{PartClass, PartMask};
use crate::pose::dense::MaskBias;
use crate::vehicle::VehicleModel;

use super::Progress;
use super::contour::{MeshEdges, Outline, offsets};
use super::hull::part_of;
use super::view::{AMBIGUOUS, UNKNOWN, View, view_of_row};

/// Views may fill their cuboid this much less than the usual and still count as free of occluders.
pub const FILL_SLACK: f64 = 0.06;
/// Directions in which the usual fill is found, over half a turn.
const DIRECTIONS: f64 = 9.0;
/// The rank of the usual fill among those of one direction.
const USUAL: f64 = 0.7;
/// Share of the cuboid's projection that nearer vehicles may hide.
const MAX_HIDDEN: f64 = 0.02;
/// Share of it where farther vehicles may have drawn, so that the outline cannot be told.
const MAX_AMBIGUOUS: f64 = 0.35;
/// Upper share of a mask in which rows have no gaps.
const UPPER: f64 = 0.7;
/// Share of the part pixels that gaps in rows may amount to.
const MAX_GAPS: f64 = 0.02;
/// Offsets beyond this share of the box height are no offsets of the same outline.
const REACH: f64 = 0.15;

/// Which views are measured.
#[derive(Clone, Copy, Debug)]
pub struct QualityOptions {
    /// Least height of the annotated box, pixels.
    pub min_height: f64,
    /// How far masks lie off the true outlines.
    pub mask_bias: Option<MaskBias>,
}

impl Default for QualityOptions {
    fn default() -> Self {
        Self { min_height: 60.0, mask_bias: None }
    }
}

/// The sides of an outline, in the order of [`ViewQuality::offsets`].
pub const SIDES: [&str; 4] = ["left", "top", "right", "bottom"];

/// One model in one view at its true pose and extent.
#[derive(Clone, Debug)]
pub struct ViewQuality {
    /// The model's name.
    pub model: String,
    /// The frame's sequence.
    pub sequence: SequenceId,
    /// The frame's index.
    pub frame: u32,
    /// The vehicle's track.
    pub track: Option<u32>,
    /// Height of the annotated box, pixels.
    pub box_height: f64,
    /// Where the camera stands about the vehicle: 0 ahead, positive to its right, radians.
    pub azimuth: f64,
    /// Intersection over union of rendered and observed silhouette.
    pub iou: f64,
    /// Mean distance from the rendered to the observed outline on each of the [`SIDES`], pixels, positive outwards: where
    /// it is positive the model is too small. `None` where no edge of that side could be measured.
    pub offsets: [Option<f64>; 4],
    /// Share of right labels among the pixels that both silhouettes cover.
    pub label_accuracy: f64,
    /// Width and height of the window that was compared.
    pub size: [u32; 2],
    /// Labels observed in it; 255 where nothing is known.
    pub observed: Vec<u8>,
    /// Labels rendered in it.
    pub rendered: Vec<u8>,
}

/// A row and its view.
struct Candidate<'a> {
    frame: &'a Frame,
    row: usize,
    model: usize,
    view: View,
}

/// Compares models with all views that are free of occluders and of chosen tracks.
///
/// Frames whose mask cannot be read are passed over.
pub fn measure_quality(
    frames: &[Frame],
    models: &[VehicleModel],
    chosen: &dyn Fn(&SequenceId, u32) -> bool,
    options: &QualityOptions,
    observer: &mut dyn FnMut(Progress),
) -> Vec<ViewQuality> {
    const BATCH: usize = 32;
    let model_of = |name: Option<&str>| models.iter().position(|model| Some(model.name()) == name);
    let wanted: Vec<(&Frame, Vec<(usize, usize)>)> = frames
        .iter()
        .filter(|frame| frame.parts.is_some())
        .filter_map(|frame| {
            let rows = frame.vehicles.iter().enumerate().filter_map(|(row, vehicle)| {
                let large = vehicle.bounds.height() >= options.min_height && vehicle.truncated == 0;
                large.then(|| model_of(vehicle.model.as_deref()).map(|model| (row, model)))?
            });
            let rows: Vec<_> = rows.collect();
            (!rows.is_empty()).then_some((frame, rows))
        })
        .collect();
    let edges: Vec<MeshEdges> = models.iter().map(|model| MeshEdges::of(model.mesh())).collect();
    let mut fills: BTreeMap<(usize, i64), Vec<f64>> = BTreeMap::new();
    let mut candidates = Vec::new();
    for (n, batch) in wanted.chunks(BATCH).enumerate() {
        let read: Vec<Vec<Candidate>> = batch
            .par_iter()
            .map(|(frame, rows)| {
                frame.read_parts().map_or_else(
                    |_| Vec::new(),
                    |mask| free_views(frame, &mask, rows, options.mask_bias.as_ref()),
                )
            })
            .collect();
        for candidate in read.into_iter().flatten() {
            let direction = direction(&candidate.view);
            fills.entry((candidate.model, direction)).or_default().push(candidate.view.fill);
            let track = candidate.frame.vehicles[candidate.row].track;
            if track.is_none_or(|track| chosen(&candidate.frame.sequence, track)) {
                candidates.push(candidate);
            }
        }
        observer(Progress::Reading {
            done: (n * BATCH + batch.len()).min(wanted.len()),
            total: wanted.len(),
        });
    }
    for list in fills.values_mut() {
        list.sort_by(f64::total_cmp);
    }
    candidates.retain(|candidate| {
        let list = &fills[&(candidate.model, direction(&candidate.view))];
        let usual = list[((list.len() - 1) as f64 * USUAL) as usize];
        candidate.view.fill >= usual - FILL_SLACK
    });
    candidates.par_iter().map(|candidate| judge(candidate, models, &edges)).collect()
}

fn direction(view: &View) -> i64 {
    (view.azimuth().abs() / std::f64::consts::PI * DIRECTIONS).floor() as i64
}

fn free_views<'a>(
    frame: &'a Frame,
    mask: &PartMask,
    rows: &[(usize, usize)],
    bias: Option<&MaskBias>,
) -> Vec<Candidate<'a>> {
    let views = rows.iter().filter_map(|(row, model)| {
        let view = view_of_row(frame, mask, *row, bias)?;
        let free = view.known >= 1.0 - MAX_HIDDEN
            && ambiguous(&view) <= MAX_AMBIGUOUS
            && gaps(&view) <= MAX_GAPS;
        free.then_some(Candidate { frame, row: *row, model: *model, view })
    });
    views.collect()
}

/// Share of the cuboid's projection where a farther vehicle may have drawn.
fn ambiguous(view: &View) -> f64 {
    let inside = view.labels.iter().zip(&view.inside_cuboid).filter(|(_, inside)| **inside);
    let (all, unsure) = inside.fold((0.0, 0.0), |(all, unsure), (label, _)| {
        let ambiguous = *label != UNKNOWN && *label & AMBIGUOUS != 0;
        (all + 1.0, unsure + f64::from(u8::from(ambiguous)))
    });
    unsure / f64::max(all, 1.0)
}

/// Background between part pixels of one row, in the upper part of the mask where a vehicle has no gaps but those
/// beside its mirrors, over all part pixels.
fn gaps(view: &View) -> f64 {
    let [width, height] = view.size();
    let is_own = |n: &usize| view.inside_cuboid[*n] && part_of(view.labels[*n]) != 0;
    let rows: Vec<Vec<usize>> =
        (0..height).map(|y| (y * width..(y + 1) * width).filter(is_own).collect()).collect();
    let filled: Vec<usize> = (0..height).filter(|y| !rows[*y].is_empty()).collect();
    let (Some(top), Some(bottom)) = (filled.first(), filled.last()) else { return 1.0 };
    let upper = top + ((bottom - top) as f64 * UPPER) as usize;
    let parts: usize = rows.iter().map(Vec::len).sum();
    let gaps: usize = rows[*top..=upper]
        .iter()
        .filter_map(|row| Some(row.last()? + 1 - row.first()? - row.len()))
        .sum();
    gaps as f64 / parts as f64
}

fn judge(candidate: &Candidate, models: &[VehicleModel], edges: &[MeshEdges]) -> ViewQuality {
    let Candidate { frame, row, model, view } = candidate;
    let (model, edges) = (&models[*model], &edges[*model]);
    let rendered = view.render(model.mesh(), &model.extent()).parts;
    let (mut both, mut either, mut right) = (0.0, 0.0, 0.0f64);
    for (label, rendered) in view.labels.iter().zip(&rendered) {
        if *label == UNKNOWN || *label & AMBIGUOUS != 0 {
            continue;
        }
        both += f64::from(u8::from(*label != 0 && *rendered != 0));
        either += f64::from(u8::from(*label != 0 || *rendered != 0));
        right += f64::from(u8::from(*label != 0 && label == rendered));
    }
    let mut sums = [(0.0, 0.0); 4];
    for offset in offsets(&Outline::new(view), model.mesh(), edges, &model.extent(), REACH) {
        let [x, y] = offset.normal;
        let side = if x.abs() > y.abs() {
            if x < 0.0 { 0 } else { 2 }
        } else if y < 0.0 {
            1
        } else {
            3
        };
        sums[side].0 += f64::from(offset.pixels * offset.length);
        sums[side].1 += f64::from(offset.length);
    }
    let observed = view.labels.iter().map(|label| match *label {
        UNKNOWN => UNKNOWN,
        label => part_of(label).min(PartClass::COUNT as u8),
    });
    let vehicle = &frame.vehicles[*row];
    ViewQuality {
        model: model.name().to_owned(),
        sequence: frame.sequence.clone(),
        frame: frame.index,
        track: vehicle.track,
        box_height: view.box_height,
        azimuth: view.azimuth(),
        iou: if either > 0.0 { both / either } else { 0.0 },
        offsets: sums.map(|(sum, length)| (length > 4.0).then(|| sum / length)),
        label_accuracy: if both > 0.0 { right / both } else { 0.0 },
        size: view.camera.size,
        observed: observed.collect(),
        rendered,
    }
}
