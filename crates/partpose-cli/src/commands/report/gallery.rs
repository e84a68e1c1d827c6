//! Which vehicles are shown: the best, the middle and the worst of those that there is a picture of.

use std::path::{Path, PathBuf};

use super::folder::{Run, Vehicle};
use crate::commands::result_files::stem;

/// A row of the gallery.
pub(super) struct Row<'a> {
    pub(super) title: &'static str,
    pub(super) vehicles: Vec<(&'a Vehicle, &'a Path)>,
}

/// Three rows of at most `most` vehicles, no picture twice in a row; empty rows are left out.
pub(super) fn rows(run: &Run, most: usize) -> Vec<Row<'_>> {
    let mut shown: Vec<(&Vehicle, &Path)> =
        run.vehicles.iter().filter_map(|vehicle| Some((vehicle, picture(run, vehicle)?))).collect();
    let quality = |vehicle: &Vehicle| vehicle.iou.unwrap_or(-1.0);
    shown.sort_by(|a, b| quality(b.0).total_cmp(&quality(a.0)));
    let half = shown.len() / 2;
    let from_middle = |i: &usize| i.abs_diff(half);
    let mut middle: Vec<usize> = (0..shown.len()).collect();
    middle.sort_by_key(from_middle);
    let pick = |title, order: &mut dyn Iterator<Item = usize>| {
        let mut vehicles: Vec<(&Vehicle, &Path)> = Vec::new();
        for (vehicle, path) in order.map(|i| shown[i]) {
            if vehicles.len() < most && vehicles.iter().all(|(_, other)| *other != path) {
                vehicles.push((vehicle, path));
            }
        }
        Row { title, vehicles }
    };
    let mut rows = vec![
        pick("Best", &mut (0..shown.len())),
        pick("Median", &mut middle.into_iter()),
        pick("Worst", &mut (0..shown.len()).rev()),
    ];
    rows.retain(|row| !row.vehicles.is_empty());
    rows
}

/// The vehicle's own picture, as `explain` draws one, or else that of its frame.
fn picture<'a>(run: &'a Run, vehicle: &Vehicle) -> Option<&'a Path> {
    let called = |wanted: &str| {
        let has_name = |path: &&PathBuf| path.file_stem().is_some_and(|name| name == wanted);
        run.pictures.iter().find(has_name).map(PathBuf::as_path)
    };
    let frame = stem(&vehicle.frame);
    let own = vehicle.number.and_then(|number| called(&format!("{frame}-{number}")));
    own.or_else(|| called(&frame))
}
