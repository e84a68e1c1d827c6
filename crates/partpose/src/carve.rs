//! Annotated models from part masks with known poses (shape from silhouette).
//!
//! Each mesh name of the data set becomes one model: every row that shows it, whatever its size, is a view of the same
//! shape in *cuboid coordinates* (each axis divided by the row's extent), and each view is also its own mirror image. A
//! vote over voxels gives the hull (`hull`), surface nets its surface (`surface`); what the masks cut out of
//! a vehicle is found by comparison and the hull carved again (`occluders`); then the surface is moved until outlines
//! agree on average (`contour`), and views vote on the part of every face (`labels`).
//!
//! Limits: cameras at one height see no roof from above, so concavities there stay filled; a model needs views from
//! several sides.

mod contour;
mod distance;
mod hull;
mod labels;
mod occluders;
mod outcome;
mod quality;
mod rows;
mod stand_in;
mod surface;
mod view;

use rayon::prelude::*;

use crate::dataset::{Frame, SequenceId};
use crate::geometry::Extent;
use crate::pose::dense::MaskBias;
use crate::vehicle::{Mesh, VehicleModel, half, simplify};

pub use outcome::{CarveError, Carved, CarvedModel, Progress, Skipped};
pub use quality::{FILL_SLACK, QualityOptions, SIDES, ViewQuality, measure_quality};
pub use stand_in::{PartAgreement, measure_stand_ins, part_agreements};

use contour::ContourOptions;
use hull::{Grid, VoteOptions};
use rows::{category_of, choose_rows, model_names, read_views};
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
    /// How far masks lie off the true outlines.
    pub mask_bias: Option<MaskBias>,
    /// Every how many models one is made, and which is the first, from 0: all of them with `(1, 0)`. The others are drawn
    /// roughly all the same, since they hide what is made.
    pub made: (usize, usize),
}

impl CarveOptions {
    fn makes(&self, index: usize) -> bool {
        index % self.made.0.max(1) == self.made.1
    }
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
            mask_bias: None,
            made: (1, 0),
        }
    }
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
    let bias = options.mask_bias.as_ref();
    let mut views = read_views(frames, &rows, &names, bias, &mut carved.skipped, observer);
    let mut shapes: Vec<Option<Shape>> = Vec::new();
    for (index, (name, views)) in names.iter().zip(&mut views).enumerate() {
        let mut skip = |skipped| {
            if options.makes(index) {
                carved.skipped.push(skipped);
            }
        };
        let tracks = views.chunk_by(|a, b| a.track == b.track).count();
        if tracks < options.min_tracks {
            skip(Skipped::TooFewViews {
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
            skip(Skipped::Empty { name: name.clone(), views: views.len() });
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
    for (index, ((name, views), shape)) in names.iter().zip(&mut views).zip(shapes).enumerate() {
        let Some(shape) = shape.filter(|_| options.makes(index)) else { continue };
        let category = category_of(frames, name);
        match finish((name, &category), views, shape, &others, options, observer) {
            Ok(model) => carved.models.push(model),
            Err(skipped) => carved.skipped.push(skipped),
        }
    }
    Ok(carved)
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

/// The same once occluders are found.
const MIN_USABLE: f64 = 0.15;

/// Largest share of the silhouette that occluders may hide.
const MAX_HIDDEN: f64 = 0.4;

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

/// Marks what hides the vehicle in each view and gives the views of which enough is left.
///
/// `depth`, as a share of the box height, but at least `least` pixels: see [`occluders::mark_occluders`].
fn find_occluders<'a>(
    views: &'a mut [View],
    half: &half::HalfMesh,
    extent: &Extent,
    others: &[(&str, &Mesh, Extent)],
    depth: f64,
    least: f64,
) -> Vec<&'a View> {
    let mesh = half.mirrored(&[]);
    let hidden: Vec<f64> = views
        .par_iter_mut()
        .map(|view| {
            view::mark_foreign(view, others);
            let depth = (depth * view.box_height).max(least) as f32;
            occluders::mark_occluders(view, &mesh, extent, depth)
        })
        .collect();
    let usable = views.iter().zip(&hidden);
    usable
        .filter(|(view, hidden)| view.known >= MIN_USABLE && **hidden < MAX_HIDDEN)
        .map(|(view, _)| view)
        .collect()
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
    let Shape { mut half, extent } = first;
    for (depth, least, coarseness) in [(0.12, 4.0, 2), (0.07, 3.0, 1)] {
        tell("hull");
        let usable = find_occluders(views, &half, &extent, others, depth, least);
        half = hull_surface(&extent, &usable, options, coarseness, 0.6)
            .ok_or_else(|| Skipped::Empty { name: name.to_owned(), views: usable.len() })?;
    }
    half = simplify::simplify(&half, &[], FIT_FACES).0;
    let mut usable = Vec::new();
    let mut outline_error = Vec::new();
    // A bulge of the hull passes for an occluder until the first fit has drawn it in.
    for depth in [0.06, 0.04] {
        tell("outlines");
        usable = find_occluders(views, &half, &extent, others, depth, 2.5);
        let round = contour::fit(&mut half, &usable, &extent, &ContourOptions::default());
        outline_error.extend(round);
    }
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
