//! What alignment and transfer use of a vehicle: points of its outside, folded to one side, and a few lengths.
//!
//! Vehicles are symmetric: right half and left half are laid on each other at x >= 0, and parts of the right half are
//! called by their left names. Both halves of the source then vote for both halves of the target, and a point's side
//! is never in doubt: it is that of its x.

use crate::geometry::{Point3, Vector3};
use crate::parts::PartClass;

use super::outside::{self, Seen};
use super::surface::Surface;

/// Longest edge of the triangles whose middles are the points, metres.
pub(super) const GRAIN: f64 = 0.05;
/// A wheel stands on the ground where the outline is lower than this, metres.
const CONTACT: f64 = 0.07;
/// Width of the bins that the lower outline is looked up in, metres.
const BIN: f64 = 0.02;
/// Where axles are if no wheel is found: shares of the length from the front, those of a usual car.
const USUAL_AXLES: [f64; 2] = [0.19, 0.78];

/// A point of the outside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// x is the distance from the plane of symmetry.
    pub(super) point: Point3,
    /// Unit, outwards.
    pub(super) normal: Vector3,
    /// Under its left name.
    pub(super) part: Option<PartClass>,
    /// Square metres.
    pub(super) area: f64,
}

/// Lengths that two vehicles are first brought together by.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    /// Longitudinal positions: rear end, rear axle, front axle, front end.
    pub(super) stations: [f64; 4],
    /// Of the doors below the windows.
    pub(super) half_width: f64,
    /// y of the ground and of the roof.
    pub(super) heights: [f64; 2],
    /// Whether wheels were found; if not, the axles are guessed.
    pub(super) has_axles: bool,
}

/// A vehicle, ready to be compared.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub(super) spots: Vec<Spot>,
    pub(super) frame: Frame,
}

/// What is known of every face of a surface.
#[derive(Clone, Debug)]
pub(super) struct Facets {
    /// Its middle, folded, with the outward normal; the part is the given one.
    pub(super) spots: Vec<Spot>,
    pub(super) seen: Vec<Seen>,
}

/// Points, normals and visibility of a surface's faces.
///
/// `vertices` and `faces` are those of the uncut mesh, which is quicker to draw.
pub(super) fn facets(surface: &Surface, vertices: &[Point3], faces: &[[u32; 3]]) -> Facets {
    let points: Vec<(Point3, Vector3)> = (0..surface.faces.len())
        .map(|i| {
            let normal = surface.cross(i).try_normalize(0.0).unwrap_or(-Vector3::y());
            (surface.center(i), normal)
        })
        .collect();
    let sights = outside::sights(vertices, faces, &points);
    let spot = |i: usize| {
        let (point, normal) = points[i];
        let normal = normal * sights[i].turn;
        let side = if point.x < 0.0 { -1.0 } else { 1.0 };
        Spot {
            point: Point3::new(point.x * side, point.y, point.z),
            normal: Vector3::new(normal.x * side, normal.y, normal.z),
            part: surface.parts[i].map(left_name),
            area: surface.area(i),
        }
    };
    Facets {
        spots: (0..points.len()).map(spot).collect(),
        seen: sights.iter().map(|sight| sight.seen).collect(),
    }
}

impl Shape {
    /// What can be seen of the facets; `None` if there is nothing.
    pub(super) fn of(facets: &Facets) -> Option<Self> {
        let seen = facets.spots.iter().zip(&facets.seen).filter(|(_, seen)| **seen != Seen::Hidden);
        let spots: Vec<Spot> = seen.map(|(spot, _)| *spot).filter(|s| s.area > 0.0).collect();
        let frame = frame(&spots)?;
        Some(Self { spots, frame })
    }

    /// About `count` of the points, spread evenly over the area.
    pub(super) fn spread(&self, count: usize) -> Vec<Spot> {
        let total: f64 = self.spots.iter().map(|spot| spot.area).sum();
        let step = total / count.max(1) as f64;
        let mut waiting = 0.5 * step;
        let mut chosen = Vec::with_capacity(count + 1);
        for spot in &self.spots {
            waiting -= spot.area;
            if waiting < 0.0 {
                chosen.push(*spot);
                waiting += step * (-waiting / step).ceil();
            }
        }
        chosen
    }
}

/// The name of a part on the left half.
pub(super) fn left_name(part: PartClass) -> PartClass {
    // Left ids come first in every pair.
    if part.opposite().id() < part.id() { part.opposite() } else { part }
}

/// The name of a part of the left half on the half where x is.
pub(super) fn name_at(part: PartClass, x: f64) -> PartClass {
    if x > 0.0 { part.opposite() } else { part }
}

fn frame(spots: &[Spot]) -> Option<Frame> {
    let range = |axis: usize| {
        let values = spots.iter().map(|spot| spot.point[axis]);
        values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((rear, front), (_, ground)) = (range(2), range(1));
    if !(front > rear) {
        return None;
    }
    let roof = quantile(spots, 0.005, |spot| spot.point.y)?;
    if !(ground > roof) {
        return None;
    }
    let middle = 0.5 * (front + rear);
    let is_flank = |spot: &&Spot| {
        let height = (ground - spot.point.y) / (ground - roof);
        (0.25..0.5).contains(&height) && (spot.point.z - middle).abs() < 0.3 * (front - rear)
    };
    let flank = spots.iter().filter(is_flank).map(|spot| spot.point.x).fold(0.0, f64::max);
    let half_width = if flank > 0.0 { flank } else { range(0).1.max(1e-3) };
    let labelled = [PartClass::WheelRearLeft, PartClass::WheelFrontLeft].map(|wheel| {
        let of_wheel = spots.iter().filter(|spot| spot.part == Some(wheel));
        let (low, high) = of_wheel.fold((f64::MAX, f64::MIN), |(low, high), spot| {
            (low.min(spot.point.z), high.max(spot.point.z))
        });
        (low <= high).then_some(0.5 * (low + high))
    });
    let [rear_axle, front_axle] = touching(spots, ground, middle);
    let found = [labelled[0].or(rear_axle), labelled[1].or(front_axle)];
    let plausible = |share: f64, at: f64| ((front - at) / (front - rear) - share).abs() < 0.13;
    let usual = USUAL_AXLES.map(|share| front - share * (front - rear));
    let (axles, has_axles) = match found {
        [Some(b), Some(a)] if plausible(USUAL_AXLES[0], a) && plausible(USUAL_AXLES[1], b) => {
            ([b, a], true)
        }
        _ => ([usual[1], usual[0]], false),
    };
    let stations = [rear, axles[0], axles[1], front];
    Some(Frame { stations, half_width, heights: [ground, roof], has_axles })
}

/// Where the rear and the front half touch the ground: the middles of the longest runs of the lower outline.
fn touching(spots: &[Spot], ground: f64, middle: f64) -> [Option<f64>; 2] {
    [false, true].map(|is_front| {
        let here =
            |spot: &&Spot| (spot.point.z > middle) == is_front && ground - spot.point.y < CONTACT;
        let mut bins: Vec<i64> =
            spots.iter().filter(here).map(|spot| (spot.point.z / BIN).floor() as i64).collect();
        bins.sort_unstable();
        bins.dedup();
        // Coarse wheels leave gaps.
        let runs = bins.chunk_by(|a, b| b - a <= 6);
        let longest = runs.max_by_key(|run| run[run.len() - 1] - run[0])?;
        Some(0.5 * BIN * (longest[0] + longest[longest.len() - 1] + 1) as f64)
    })
}

/// The value below which a share of the area lies.
fn quantile(spots: &[Spot], share: f64, value: impl Fn(&Spot) -> f64) -> Option<f64> {
    let mut values: Vec<(f64, f64)> = spots.iter().map(|spot| (value(spot), spot.area)).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut left = share * values.iter().map(|(_, area)| area).sum::<f64>();
    for (value, area) in &values {
        left -= area;
        if left <= 0.0 {
            return Some(*value);
        }
    }
    values.last().map(|(value, _)| *value)
}
