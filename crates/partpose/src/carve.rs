//! Annotated models from part masks with known poses (shape from silhouette).
//!
//! Each mesh name of the data set becomes one model: every row that shows it, whatever its size, is a view of the same
//! shape in *cuboid coordinates* (each axis divided by the row's extent), and each view is also its own mirror image. A
//! vote over voxels gives the hull ([`hull`]), surface nets its surface ([`surface`]); what the masks cut out of
//! a vehicle is found by comparison and the hull carved again ([`occluders`]); then the surface is moved until outlines
//! agree on average ([`contour`]), and views vote on the part of every face ([`labels`]).
//!
//! Limits: cameras at one height see no roof from above, so concavities there stay filled; a model needs views from
//! several sides.

mod contour;
mod distance;
mod half;
mod hull;
mod labels;
mod occluders;
mod quality;
mod simplify;
mod surface;
mod view;

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::dataset::{DatasetError, Frame, SequenceId};
use crate::geometry::Extent;
use crate::vehicle::{Mesh, ModelError, VehicleModel};

pub use quality::{FILL_SLACK, QualityOptions, SIDES, ViewQuality, measure_quality};

use contour::ContourOptions;
use hull::{Grid, VoteOptions};
use view::View;

/// How models are carved.
#[derive(Clone, Debug)]
pub struct CarveOptions {
    /// Least height of the annotated box, pixels.
    pub min_height: f64,
    /// Largest share of the box that the image may cut off.
    pub max_truncation: f64,
    /// Voxels over width, height and length.
    pub voxels: [usize; 3],
    /// Most views that are used of one track, evenly spaced over it.
    pub views_per_track: usize,
    /// Least number of tracks that a model needs.
    pub min_tracks: usize,
    /// Most faces of a model.
    pub max_faces: usize,
}

impl Default for CarveOptions {
    fn default() -> Self {
        Self {
            min_height: 25.0,
            max_truncation: 0.6,
            voxels: [96, 84, 176],
            views_per_track: 24,
            min_tracks: 2,
            max_faces: 10_000,
        }
    }
}

/// What is being done.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Part masks are read: so many of so many.
    Reading {
        /// Masks read.
        done: usize,
        /// Masks to read.
        total: usize,
    },
    /// A model is carved.
    Carving {
        /// Its name.
        model: String,
        /// What is done with it.
        step: &'static str,
    },
}

/// Why nothing could be carved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CarveError {
    /// No row names a mesh.
    #[error("no vehicle of the chosen frames has a model name")]
    NoModelNames,
    /// A model was asked for that no row shows.
    #[error("no vehicle shows the model `{name}`; there are {known:?}")]
    UnknownModel {
        /// What was asked for.
        name: String,
        /// The names that occur.
        known: Vec<String>,
    },
    /// No frame has a part mask.
    #[error("none of the {frames} chosen frames has a part mask")]
    NoMasks {
        /// How many frames there are.
        frames: usize,
    },
}

/// Why one model was left out, or one frame.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Skipped {
    /// Too few vehicles show it.
    #[error(
        "model `{name}`: {tracks} tracks with {views} usable views, but {needed} tracks are needed"
    )]
    TooFewViews {
        /// The model.
        name: String,
        /// Tracks that show it.
        tracks: usize,
        /// Views of them.
        views: usize,
        /// Tracks that are needed.
        needed: usize,
    },
    /// The views leave nothing over.
    #[error("model `{name}`: the {views} views have no volume in common")]
    Empty {
        /// The model.
        name: String,
        /// Views of it.
        views: usize,
    },
    /// The carved mesh is no model.
    #[error("model `{name}`")]
    Model {
        /// The model.
        name: String,
        /// What is wrong with it.
        source: ModelError,
    },
    /// A mask could not be read.
    #[error("frame {sequence} {index} is left out")]
    Frame {
        /// Its sequence.
        sequence: SequenceId,
        /// Its index.
        index: u32,
        /// What is wrong with it.
        source: DatasetError,
    },
}

/// A carved model and how it came about.
#[derive(Clone, Debug)]
pub struct CarvedModel {
    /// The model; its extent is the median over the tracks used.
    pub model: VehicleModel,
    /// Tracks that were used.
    pub tracks: usize,
    /// Views that were used.
    pub views: usize,
    /// Mean absolute distance of the outlines before each round of the fit, pixels.
    pub outline_error: Vec<f64>,
}

/// What came of it.
#[derive(Debug, Default)]
pub struct Carved {
    /// The models, in the order asked for.
    pub models: Vec<CarvedModel>,
    /// What was left out.
    pub skipped: Vec<Skipped>,
}

/// A row of a frame, chosen as a view.
#[derive(Clone, Copy, Debug)]
struct Row {
    frame: usize,
    vehicle: usize,
    model: usize,
    track: usize,
}

/// Carves the models with the given names (all that occur, if `None`) from frames with part masks.
///
/// `leave_out` names the tracks that must not be used, by world and track id.
pub fn carve_models(
    frames: &[Frame],
    names: Option<&[String]>,
    leave_out: &dyn Fn(&SequenceId, u32) -> bool,
    options: &CarveOptions,
    observer: &mut dyn FnMut(Progress),
) -> Result<Carved, CarveError> {
    let names = model_names(frames, names)?;
    if frames.iter().all(|frame| frame.parts.is_none()) {
        return Err(CarveError::NoMasks { frames: frames.len() });
    }
    let rows = choose_rows(frames, &names, leave_out, options);
    let mut carved = Carved::default();
    let mut views = read_views(frames, &rows, &names, &mut carved.skipped, observer);
    let mut shapes: Vec<Option<Shape>> = Vec::new();
    for (name, views) in names.iter().zip(&mut views) {
        let tracks = views.chunk_by(|a, b| a.track == b.track).count();
        if tracks < options.min_tracks {
            carved.skipped.push(Skipped::TooFewViews {
                name: name.clone(),
                tracks,
                views: views.len(),
                needed: options.min_tracks,
            });
            shapes.push(None);
            continue;
        }
        let shape = first_shape(name, views, options, observer);
        if shape.is_none() {
            carved.skipped.push(Skipped::Empty { name: name.clone(), views: views.len() });
        }
        shapes.push(shape);
    }
    let drawn: Vec<(String, Mesh, Extent)> = names
        .iter()
        .zip(&shapes)
        .filter_map(|(name, shape)| {
            shape.as_ref().map(|s| (name.clone(), s.half.mirrored(&[]), s.extent))
        })
        .collect();
    let others: Vec<(&str, &Mesh, Extent)> =
        drawn.iter().map(|(name, mesh, e)| (name.as_str(), mesh, *e)).collect();
    for ((name, views), shape) in names.iter().zip(&mut views).zip(shapes) {
        let Some(shape) = shape else { continue };
        let category = category_of(frames, name);
        match finish((name, &category), views, shape, &others, options, observer) {
            Ok(model) => carved.models.push(model),
            Err(skipped) => carved.skipped.push(skipped),
        }
    }
    Ok(carved)
}

fn model_names(frames: &[Frame], asked: Option<&[String]>) -> Result<Vec<String>, CarveError> {
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
fn category_of(frames: &[Frame], name: &str) -> String {
    let mut vehicles = frames.iter().flat_map(|frame| &frame.vehicles);
    let shown = vehicles.find(|vehicle| vehicle.model.as_deref() == Some(name));
    shown.map_or_else(String::new, |vehicle| vehicle.category.clone())
}

/// The rows to use, sorted by model, track and frame.
fn choose_rows(
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
fn read_views(
    frames: &[Frame],
    rows: &[Row],
    names: &[String],
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
                    source,
                })?;
                let made = rows.iter().filter_map(|row| {
                    let mut view = view::view_of_row(frame, &mask, row.vehicle)?;
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

/// A shape without labels.
struct Shape {
    half: half::HalfMesh,
    extent: Extent,
}

/// The median extent over tracks.
fn median_extent(views: &[View]) -> Extent {
    let tracks = views.chunk_by(|a, b| a.track == b.track);
    let extents: Vec<Extent> = tracks.map(|track| track[0].extent).collect();
    let median = |side: fn(&Extent) -> f64| {
        let mut sides: Vec<f64> = extents.iter().map(side).collect();
        sides.sort_by(f64::total_cmp);
        sides[sides.len() / 2]
    };
    Extent::new(median(|e| e.width), median(|e| e.height), median(|e| e.length))
}

/// Beyond the cuboid that voxels reach, shares of width, height and length: mirrors stick out of it.
const MARGIN: [f64; 3] = [0.14, 0.02, 0.02];

/// Least area of a patch of one part, square metres.
const LEAST_PATCH: f64 = 0.004;

/// Longest edge of a face that is labelled, metres.
const LABEL_EDGE: f64 = 0.03;

/// Faces of the half whose outlines are fitted.
const FIT_FACES: usize = 10_000;

/// Least share of the cuboid's pixels that show parts if nothing is in front.
const MIN_FILL: f64 = 0.5;

/// Least share of the cuboid's pixels of which a view must know something.
const MIN_KNOWN: f64 = 0.3;

/// Hull from the views that look unoccluded.
fn first_shape(
    name: &str,
    views: &[View],
    options: &CarveOptions,
    observer: &mut dyn FnMut(Progress),
) -> Option<Shape> {
    observer(Progress::Carving { model: name.to_owned(), step: "first hull" });
    let extent = median_extent(views);
    let clean = clean_views(views);
    let half = hull_surface(&extent, &clean, options, 2, 1.2)?;
    Some(Shape { half, extent })
}

/// The views that fill their cuboid about as well as the best of their kind do.
fn clean_views(views: &[View]) -> Vec<&View> {
    const BINS: usize = 9;
    const SLACK: f64 = 0.06;
    let bin = |view: &View| {
        ((view.azimuth().abs() / std::f64::consts::PI * BINS as f64) as usize).min(BINS - 1)
    };
    let mut fills: Vec<Vec<f64>> = vec![Vec::new(); BINS];
    for view in views.iter().filter(|view| view.known >= MIN_KNOWN) {
        fills[bin(view)].push(view.fill);
    }
    let usual: Vec<f64> = fills
        .iter_mut()
        .map(|list| {
            list.sort_by(f64::total_cmp);
            list.get(list.len() * 7 / 10).copied().unwrap_or(1.0)
        })
        .collect();
    views
        .iter()
        .filter(|view| view.known >= MIN_KNOWN)
        .filter(|view| view.fill >= MIN_FILL.max(usual[bin(view)] - SLACK))
        .collect()
}

fn hull_surface(
    extent: &Extent,
    views: &[&View],
    options: &CarveOptions,
    coarseness: usize,
    least: f32,
) -> Option<half::HalfMesh> {
    let voxels = options.voxels.map(|n| n.div_ceil(coarseness));
    let grid = Grid::over(extent, voxels, MARGIN);
    let vote = VoteOptions { tolerance: 0.3, full_height: 60.0, least };
    let mut scores = hull::votes(&grid, extent, views, &vote);
    hull::cut_sides(&grid, extent, views, &mut scores);
    let mut field: Vec<f32> = scores.iter().map(|score| 1.0 - 0.5 * score.min(2.0)).collect();
    surface::keep_largest(&grid, &mut field, 0.5);
    surface::blur(&grid, &mut field, 1);
    surface::keep_largest(&grid, &mut field, 0.5);
    let half = surface::extract(&grid, &field, 0.5);
    (!half.faces.is_empty()).then_some(half)
}

/// The body style that a mesh name speaks of; `other` where it speaks of none.
pub fn body_style(name: &str) -> &'static str {
    const STYLES: [&str; 8] =
        ["hatchback", "sedan", "suv", "wagon", "coupe", "van", "pickup", "truck"];
    let name = name.to_lowercase();
    STYLES.into_iter().find(|style| name.contains(style)).unwrap_or("other")
}

/// Occluders, second hull, outlines, labels.
fn finish(
    (name, category): (&str, &str),
    views: &mut [View],
    first: Shape,
    others: &[(&str, &Mesh, Extent)],
    options: &CarveOptions,
    observer: &mut dyn FnMut(Progress),
) -> Result<CarvedModel, Skipped> {
    let mut tell = |step| observer(Progress::Carving { model: name.to_owned(), step });
    let extent = first.extent;
    let mut half = first.half;
    for (depth, least, coarseness) in [(0.12, 4.0, 2), (0.07, 3.0, 1)] {
        tell("occluders");
        let mesh = half.mirrored(&[]);
        let hidden: Vec<f64> = views
            .par_iter_mut()
            .map(|view| {
                view::mark_foreign(view, others);
                let depth = (depth * view.box_height).max(least) as f32;
                occluders::mark_occluders(view, &mesh, &extent, depth)
            })
            .collect();
        let usable: Vec<&View> = views
            .iter()
            .zip(&hidden)
            .filter(|(view, hidden)| view.known >= 0.15 && **hidden < 0.4)
            .map(|(view, _)| view)
            .collect();
        tell("hull");
        half = hull_surface(&extent, &usable, options, coarseness, 0.6)
            .ok_or_else(|| Skipped::Empty { name: name.to_owned(), views: usable.len() })?;
    }
    tell("outlines");
    half = simplify::simplify(&half, &[], FIT_FACES).0;
    let mesh = half.mirrored(&[]);
    let hidden: Vec<f64> = views
        .par_iter_mut()
        .map(|view| {
            view::mark_foreign(view, others);
            let depth = (0.05 * view.box_height).max(2.5) as f32;
            occluders::mark_occluders(view, &mesh, &extent, depth)
        })
        .collect();
    let usable: Vec<&View> = views
        .iter()
        .zip(&hidden)
        .filter(|(view, hidden)| view.known >= 0.15 && **hidden < 0.4)
        .map(|(view, _)| view)
        .collect();
    let contour = ContourOptions {
        rounds: 10,
        reach: 0.08,
        stiffness: 1.0,
        membrane_rounds: 40,
        membrane_weight: 2.0,
        unit_resolution: 40.0,
    };
    let outline_error = contour::fit(&mut half, &usable, &extent, &contour);
    tell("labels");
    let half = simplify::refine(&half, LABEL_EDGE);
    let votes = labels::votes(&half, &usable, &extent);
    let mut labels = labels::labels(&half, &votes, 20, 1.0);
    labels::merge_patches(&half, &mut labels, LEAST_PATCH);
    tell("simplify");
    let (half, labels) = simplify::simplify(&half, &labels, options.max_faces / 2);
    let mesh = half.mirrored(&labels);
    let tracks = usable.chunk_by(|a, b| a.track == b.track).count();
    let model = VehicleModel::new(name, category, body_style(name), extent, mesh)
        .map_err(|source| Skipped::Model { name: name.to_owned(), source })?;
    Ok(CarvedModel { model, tracks, views: usable.len(), outline_error })
}
