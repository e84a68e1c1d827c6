//! The paper's Fig. 4: one vehicle by kernels of several sizes, scaled in both ways.

use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::files;
use partpose::geometry::Rect;
use partpose::oracle::Oracle;
use partpose::parts::PartMask;
use partpose::vehicle::ModelZoo;
use partpose::viz::{MaskCell, mask_grid};

use super::{Arguments, SCALINGS};
use crate::commands::evaluate::source::{Source, best_match};
use crate::report::{hint, warn, warn_error};

/// Height of the vehicle that is chosen if none is named, pixels: cells of large kernels are still seen.
const HEIGHT: f64 = 110.0;
/// Share of its box that a car fills of which nothing is hidden.
const WHOLE: f64 = 0.75;
/// Free pixels around the vehicle's box.
const MARGIN: f64 = 4.0;

/// Writes `figure-4.png`; nothing where every vehicle is cut by the image's border.
pub(super) fn write(
    arguments: &Arguments,
    frames: &[Frame],
    zoo: &ModelZoo,
    sources: &[Source],
) -> anyhow::Result<()> {
    let chosen = match &arguments.vehicle {
        Some(name) => Some(named(frames, name)?),
        None => typical(frames),
    };
    let Some((frame, vehicle)) = chosen else { return Ok(()) };
    let oracle = match frame.read_parts() {
        Ok(parts) => Oracle::new(frame, parts, zoo),
        Err(error) => {
            warn_error("drew no `figure-4.png`", &error);
            return Ok(());
        }
    };
    let image = match frame.image.as_deref().map(files::read_rgb).transpose() {
        Ok(image) => image,
        Err(error) => {
            warn_error("drew `figure-4.png` without the image", &error);
            None
        }
    };
    let bounds = frame.vehicles[vehicle].bounds;
    let found = find(sources, frame, &oracle, &bounds);
    let around = around(&bounds, &found);
    let [width, height] = frame.camera.size.map(f64::from);
    let low = |value: f64| (value - MARGIN).max(0.0).floor() as i32;
    let high = |value: f64, most: f64| (value + MARGIN).min(most).ceil() as i32;
    let pixels = [
        low(around.x_min),
        low(around.y_min),
        high(around.x_max, width),
        high(around.y_max, height),
    ];
    let truth = oracle.vehicle_mask(vehicle, &bounds);
    let masks: Vec<Vec<PartMask>> = SCALINGS
        .iter()
        .map(|(scaling, _)| {
            found.iter().map(|(_, found)| found.part_mask(frame.camera.size, *scaling)).collect()
        })
        .collect();
    let rows: Vec<Vec<MaskCell>> = SCALINGS
        .iter()
        .zip(&masks)
        .enumerate()
        .map(|(row, ((_, scaling), masks))| {
            let first = match row {
                0 => MaskCell { title: "truth".to_owned(), mask: Some(&truth) },
                _ => MaskCell { title: "image".to_owned(), mask: None },
            };
            let cells = found.iter().zip(masks).map(|((name, _), mask)| {
                let accuracy = 100.0 * mask.agreement(&truth);
                MaskCell { title: format!("{name}, {scaling}: {accuracy:.1} %"), mask: Some(mask) }
            });
            std::iter::once(first).chain(cells).collect()
        })
        .collect();
    let track = frame.vehicles[vehicle].track.map_or(String::new(), |track| format!(":{track}"));
    let title =
        format!("{}{track}: part masks by kernel and scaling, pixel accuracy", frame.name());
    let picture = mask_grid(&title, image.as_ref(), pixels, &rows);
    Ok(files::write_png(&arguments.out.join("figure-4.png"), &picture)?)
}

/// What every source says of the vehicle in the box, with its name.
fn find(
    sources: &[Source],
    frame: &Frame,
    oracle: &Oracle,
    bounds: &Rect,
) -> Vec<(String, Detection)> {
    let mut found = Vec::new();
    for source in sources {
        let detections = match source.detect_one(frame, oracle) {
            Ok(detections) => detections,
            Err(error) => {
                warn(format_args!("`{}` is not in `figure-4.png`: {error:#}", source.name));
                continue;
            }
        };
        if let Some(detection) = best_match(&detections, bounds) {
            let m = detection.probabilities.size();
            let name = if source.is_oracle() {
                source.name.clone()
            } else {
                format!("{}, {m} x {m}", source.name)
            };
            found.push((name, detection.clone()));
        }
    }
    found
}

/// The rectangle around a box and the boxes of detections.
fn around(bounds: &Rect, found: &[(String, Detection)]) -> Rect {
    found.iter().fold(*bounds, |around, (_, detection)| Rect {
        x_min: around.x_min.min(detection.bounds.x_min),
        y_min: around.y_min.min(detection.bounds.y_min),
        x_max: around.x_max.max(detection.bounds.x_max),
        y_max: around.y_max.max(detection.bounds.y_max),
    })
}

/// The vehicle FRAME:TRACK.
fn named<'a>(frames: &'a [Frame], name: &str) -> anyhow::Result<(&'a Frame, usize)> {
    let parts = name.rsplit_once(':');
    let found = parts.and_then(|(frame, track)| {
        let frame = frames.iter().find(|other| other.name() == frame)?;
        let track: u32 = track.parse().ok()?;
        let vehicle = frame.vehicles.iter().position(|vehicle| vehicle.track == Some(track))?;
        Some((frame, vehicle))
    });
    found.ok_or_else(|| {
        let first = frames.first().map_or(String::new(), Frame::name);
        hint(
            anyhow::anyhow!("there is no vehicle `{name}` among the frames"),
            format!("write frame and track as in `{first}:3`"),
        )
    })
}

/// The vehicle within the image, as little hidden and as near to [`HEIGHT`] as there is.
fn typical(frames: &[Frame]) -> Option<(&Frame, usize)> {
    let all = frames.iter().flat_map(|frame| (0..frame.vehicles.len()).map(move |v| (frame, v)));
    let inside = all.filter(|(frame, vehicle)| {
        let label = &frame.vehicles[*vehicle];
        !label.dont_care && label.truncated == 0
    });
    let distance = |(frame, vehicle): &(&Frame, usize)| {
        let label = &frame.vehicles[*vehicle];
        // A whole car fills about three quarters of its box; a hidden tenth weighs as much as a fifth of the height.
        let hidden = match label.occupancy {
            Some(occupancy) => (WHOLE - occupancy).max(0.0),
            None => 0.5 * f64::from(label.occluded),
        };
        (label.bounds.height() - HEIGHT).abs() / HEIGHT + 2.0 * hidden
    };
    inside.min_by(|a, b| distance(a).total_cmp(&distance(b)))
}
