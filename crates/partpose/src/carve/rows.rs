//! Which rows of a data set become views, and reading them.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::dataset::{Frame, SequenceId};
use crate::pose::dense::MaskBias;

use super::view::{View, view_of_row};
use super::{CarveError, CarveOptions, Progress, Skipped};

/// A row of a frame, chosen as a view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    frame: usize,
    vehicle: usize,
    model: usize,
    track: usize,
}

pub(super) fn model_names(
    frames: &[Frame],
    asked: Option<&[String]>,
) -> Result<Vec<String>, CarveError> {
    let vehicles = frames.iter().flat_map(|frame| &frame.vehicles);
    let mut known: Vec<String> = vehicles.filter_map(|vehicle| vehicle.model.clone()).collect();
    known.sort();
    known.dedup();
    if known.is_empty() {
        return Err(CarveError::NoModelNames);
    }
    let Some(asked) = asked else { return Ok(known) };
    match asked.iter().find(|name| !known.contains(name)) {
        Some(name) => Err(CarveError::UnknownModel { name: name.clone(), known }),
        None => Ok(asked.to_vec()),
    }
}

/// The category of the first vehicle that shows a model.
pub(super) fn category_of(frames: &[Frame], name: &str) -> String {
    let mut vehicles = frames.iter().flat_map(|frame| &frame.vehicles);
    let shown = vehicles.find(|vehicle| vehicle.model.as_deref() == Some(name));
    shown.map_or_else(String::new, |vehicle| vehicle.category.clone())
}

/// The rows to use, sorted by model, track and frame.
pub(super) fn choose_rows(
    frames: &[Frame],
    names: &[String],
    leave_out: &dyn Fn(&SequenceId, u32) -> bool,
    options: &CarveOptions,
) -> Vec<Row> {
    let mut tracks: BTreeMap<(usize, String, u32, usize), Vec<(usize, usize)>> = BTreeMap::new();
    for (f, frame) in frames.iter().enumerate().filter(|(_, frame)| frame.parts.is_some()) {
        for (v, vehicle) in frame.vehicles.iter().enumerate() {
            let model = names.iter().position(|name| Some(name) == vehicle.model.as_ref());
            let Some(model) = model else { continue };
            let small = vehicle.bounds.height() < options.min_height;
            if small || vehicle.truncation > options.max_truncation {
                continue;
            }
            // A row without a track id is a vehicle of its own.
            let (track, alone) = vehicle.track.map_or((0, f * 65_536 + v + 1), |track| (track, 0));
            if vehicle.track.is_some_and(|track| leave_out(&frame.sequence, track)) {
                continue;
            }
            tracks
                .entry((model, frame.sequence.world.clone(), track, alone))
                .or_default()
                .push((f, v));
        }
    }
    let mut rows = Vec::new();
    for (track, ((model, ..), list)) in tracks.into_iter().enumerate() {
        let count = list.len().min(options.views_per_track.max(1));
        for n in 0..count {
            // The last row is the nearest one of a parked car, so it is always taken.
            let (frame, vehicle) = list[(n + 1) * list.len() / count - 1];
            rows.push(Row { frame, vehicle, model, track });
        }
    }
    rows
}

/// The views of every model, sorted by track.
pub(super) fn read_views(
    frames: &[Frame],
    rows: &[Row],
    names: &[String],
    bias: Option<&MaskBias>,
    skipped: &mut Vec<Skipped>,
    observer: &mut dyn FnMut(Progress),
) -> Vec<Vec<View>> {
    const BATCH: usize = 32;
    let mut by_frame: BTreeMap<usize, Vec<Row>> = BTreeMap::new();
    for row in rows {
        by_frame.entry(row.frame).or_default().push(*row);
    }
    let jobs: Vec<(usize, Vec<Row>)> = by_frame.into_iter().collect();
    let mut views: Vec<Vec<View>> = vec![Vec::new(); names.len()];
    let mut done = 0;
    for batch in jobs.chunks(BATCH) {
        let read: Vec<Result<Vec<(usize, View)>, Skipped>> = batch
            .par_iter()
            .map(|(f, rows)| {
                let frame = &frames[*f];
                let mask = frame.read_parts().map_err(|source| Skipped::Frame {
                    sequence: frame.sequence.clone(),
                    index: frame.index,
                    source: Box::new(source),
                })?;
                let made = rows.iter().filter_map(|row| {
                    let mut view = view_of_row(frame, &mask, row.vehicle, bias)?;
                    view.track = row.track;
                    Some((row.model, view))
                });
                Ok(made.collect())
            })
            .collect();
        for result in read {
            match result {
                Ok(made) => made.into_iter().for_each(|(model, view)| views[model].push(view)),
                Err(error) => skipped.push(error),
            }
        }
        done += batch.len();
        observer(Progress::Reading { done, total: jobs.len() });
    }
    for list in &mut views {
        // Stable, so frames stay in order.
        list.sort_by_key(|view| view.track);
    }
    views
}
