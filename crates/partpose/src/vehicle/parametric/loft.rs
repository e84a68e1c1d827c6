//! The body's surface as rings from nose to tail.
//!
//! Ring t joins the point t of the upper curve to a point of the lower curve. Seen from the front, it leaves the middle
//! of the floor, turns round the sill's edge, climbs the side, turns round the upper edge and ends in the middle of the
//! top. At nose and tail both curves meet, and the ring has pinched to a line across the vehicle.

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::curves::{lower_curve, upper_curve};
use super::half::{Half, Vertex, Zone};
use super::path::{Edge, Path, Point};
use super::stations::stations;

/// Parameters of the upper curve that seams follow.
pub(super) mod knots {
    /// Upper edge of the front bumper.
    pub(in super::super) const BUMPER_FRONT: f64 = 1.0;
    /// Front edge of the hood.
    pub(in super::super) const HOOD: f64 = 2.0;
    /// Foot of the windscreen.
    pub(in super::super) const COWL: f64 = 4.0;
    /// Upper edge of the windscreen.
    pub(in super::super) const HEADER: f64 = 5.0;
    /// Upper edge of the rear window.
    pub(in super::super) const ROOF_END: f64 = 7.0;
    /// Foot of the rear window.
    pub(in super::super) const DECK: f64 = 8.0;
    /// Rear edge of the trunk lid.
    pub(in super::super) const LIP: f64 = 9.0;
    /// Upper edge of the rear bumper.
    pub(in super::super) const BUMPER_REAR: f64 = 10.0;
}

/// Steps along a half ring: side below and above the belt, either corner.
const LOWER_STEPS: usize = 8;
const UPPER_STEPS: usize = 5;
const CORNER_STEPS: usize = 4;
/// Where the columns of top and floor run, as shares of its half width; the first strip is the rim.
const TOP_SHARES: [f64; 5] = [1.0, 0.9, 0.62, 0.31, 0.0];
/// Most of a corner's depth that is sloped rather than round.
const MOST_SLOPE: f64 = 0.35;

/// The left half of the body's surface; all of it is side for now.
pub(super) fn body(vehicle: &ParametricVehicle) -> Half {
    let (top, bottom) = (upper_curve(vehicle), lower_curve(vehicle));
    let mut half = Half::default();
    let mut zones = Vec::new();
    let rings = stations(vehicle, &top, &bottom);
    for [t, b] in &rings {
        zones.clear();
        push_ring(vehicle, [&top, &bottom], [*t, *b], &mut half.vertices, &mut zones);
    }
    let columns = zones.len() as u32;
    for ring in 0..rings.len() as u32 - 1 {
        for column in 0..columns - 1 {
            let a = ring * columns + column;
            let [b, c, d] = [a + 1, a + columns + 1, a + columns];
            let zone = zones[column as usize + 1];
            // The shorter diagonal follows curved seams better.
            let distance = |i: u32, j: u32| {
                let [p, q] = [i, j].map(|i| half.vertices[i as usize]);
                (p.lateral - q.lateral).hypot(p.h - q.h).hypot(p.z - q.z)
            };
            let triangles = if distance(a, c) <= distance(b, d) {
                [[a, c, b], [a, d, c]]
            } else {
                [[a, d, b], [b, d, c]]
            };
            for triangle in triangles {
                half.push(triangle, zone, PartClass::SideLeft);
            }
        }
    }
    half.merge();
    half
}

/// Half the width of the body at a point of the side view.
pub(super) fn half_width(vehicle: &ParametricVehicle, p: Point) -> f64 {
    let [front, rear] = vehicle.axles();
    let nose = vehicle.nose();
    let towards = |z: f64, from: f64, to: f64| ((z - from) / (to - from)).clamp(0.0, 1.0);
    let taper = vehicle.front_taper * towards(p.z, front - 0.5, nose - 0.2).powi(2)
        + vehicle.rear_taper * towards(p.z, rear + 0.6, 0.2 - nose).powi(2);
    let widest = vehicle.ground_clearance + 0.55 * (vehicle.belt_front - vehicle.ground_clearance);
    let belt = vehicle.belt(p.z);
    // Below the widest line the side tucks in, above it leans in a little.
    let below = ((widest - p.h) / (widest - vehicle.ground_clearance)).clamp(0.0, 1.2);
    let above = ((p.h - widest) / (belt - widest)).clamp(0.0, 1.0);
    let mut width =
        0.5 * vehicle.width - taper - vehicle.side_tuck * below.powi(2) - 0.035 * above.powi(2);
    width += flare(vehicle, p);
    let rise = p.h - belt;
    if rise > 0.0 {
        let shoulder = (rise / 0.05).min(1.0);
        width -= vehicle.shoulder * shoulder * shoulder * (3.0 - 2.0 * shoulder);
        width -= rise * vehicle.tumblehome.to_radians().tan() + vehicle.side_curve * rise * rise;
    }
    // However it is shaped, there is something between the sides.
    width.max(0.1)
}

/// How far the edge of a wheel arch stands out from the side.
fn flare(vehicle: &ParametricVehicle, p: Point) -> f64 {
    let [hub, reach] = [0.5 * vehicle.wheel_diameter, vehicle.arch_radius()];
    let strength = |axle: f64| {
        let beyond = ((p.z - axle).hypot(p.h - hub) - reach) / (0.45 * reach);
        let share = (1.0 - beyond.max(0.0)).max(0.0);
        share * share * (3.0 - 2.0 * share)
    };
    vehicle.arch_flare * vehicle.axles().map(strength).into_iter().fold(0.0, f64::max)
}

/// Where the side ends above: the upper curve lowered by crown and corner.
pub(super) fn side_top(path: &Path, t: f64) -> Point {
    let edge = path.edge(t);
    edge.below(path.at(t), edge.depth())
}

/// Appends the vertices of one half ring and the zones between them (`zones[i]` is before vertex i).
fn push_ring(
    v: &ParametricVehicle,
    [top, bottom]: [&Path; 2],
    [t, b]: [f64; 2],
    vertices: &mut Vec<Vertex>,
    zones: &mut Vec<Zone>,
) {
    let (upper, upper_edge) = (top.at(t), top.edge(t));
    let (lower, lower_edge) = (bottom.at(b), bottom.edge(b));
    let mut push = |lateral: f64, p: Point, zone: Zone| {
        vertices.push(Vertex { lateral, h: p.h, z: p.z, t });
        zones.push(zone);
    };
    // From the middle of the floor to the sill.
    let side_bottom = lower_edge.below(lower, lower_edge.depth());
    let corner = Corner::new(v, &lower_edge, lower);
    for share in TOP_SHARES.into_iter().rev() {
        push(
            share * corner.inner,
            lower_edge.below(lower, lower_edge.crown * share * share),
            Zone::Bottom,
        );
    }
    for step in (1..CORNER_STEPS).rev() {
        let (lateral, point) = corner.at(step as f64 / CORNER_STEPS as f64);
        push(lateral, point, Zone::Bottom);
    }
    // Up the side, with a row of vertices along the belt where the side reaches it.
    let upper_end = side_top(top, t);
    let rise = upper_end.h - side_bottom.h;
    let mut split = 0.5;
    for _ in 0..20 {
        let belt = v.belt(side_bottom.lerp(upper_end, split).z);
        split = ((belt - side_bottom.h) / rise.max(1e-6)).clamp(0.3, 0.78);
    }
    for step in 0..=LOWER_STEPS + UPPER_STEPS {
        let share = if step <= LOWER_STEPS {
            split * step as f64 / LOWER_STEPS as f64
        } else {
            split + (1.0 - split) * (step - LOWER_STEPS) as f64 / UPPER_STEPS as f64
        };
        let point = side_bottom.lerp(upper_end, share);
        push(half_width(v, point), point, if step == 0 { Zone::Bottom } else { Zone::Side });
    }
    // Round the edge and to the middle.
    let corner = Corner::new(v, &upper_edge, upper);
    for step in 1..CORNER_STEPS {
        let (lateral, point) = corner.at(step as f64 / CORNER_STEPS as f64);
        push(lateral, point, Zone::Corner);
    }
    let bed = Bed::at(v, t, corner.inner);
    for (i, share) in TOP_SHARES.into_iter().enumerate() {
        let zone = [Zone::Corner, Zone::Rim].get(i).copied().unwrap_or(Zone::Top);
        let share = bed.as_ref().map_or(share, |bed| bed.shares[i]);
        let mut point = upper_edge.below(upper, upper_edge.crown * share * share);
        if let Some(floor) = bed.as_ref().filter(|_| i > 1).and_then(|bed| bed.floor) {
            point.h = floor;
        }
        push(share * corner.inner, point, zone);
    }
}

/// Where a ring runs over the load bed: rail, inner wall, floor.
struct Bed {
    /// In place of [`TOP_SHARES`].
    shares: [f64; 5],
    /// Height of the floor; `None` on the walls before and behind it.
    floor: Option<f64>,
}

impl Bed {
    fn at(v: &ParametricVehicle, t: f64, inner: f64) -> Option<Self> {
        let [start, floor_start, floor_end, end] = bed_rings(v)?;
        let wall = (1.0 - 0.03 / inner).max(0.5);
        let low = (wall - 0.012 / inner).max(0.45);
        let between = |from: f64, to: f64| from - 1e-9 < t && t < to + 1e-9;
        between(start, end).then_some(Self {
            shares: [1.0, wall, low, 0.5 * low, 0.0],
            floor: between(floor_start, floor_end).then_some(v.deck_height - v.bed_depth),
        })
    }
}

/// Parameters of the rings at the walls of the load bed: upper and lower edge in front, the same behind.
pub(super) fn bed_rings(v: &ParametricVehicle) -> Option<[f64; 4]> {
    let share = |length: f64| length / v.deck_length;
    v.has_bed().then(|| {
        let [from, to] = [knots::DECK, knots::LIP];
        [from + share(0.09), from + share(0.102), to - share(0.077), to - share(0.065)]
    })
}

/// The rounded edge between the side and the top or the floor: a quarter of an ellipse.
struct Corner<'a> {
    edge: &'a Edge,
    on_curve: Point,
    /// Half the width of the side where the corner begins.
    outer: f64,
    /// Half the width of the top.
    inner: f64,
    /// How much the side leans in over the corner's height.
    lean: f64,
}

impl<'a> Corner<'a> {
    fn new(v: &ParametricVehicle, edge: &'a Edge, on_curve: Point) -> Self {
        let start = edge.below(on_curve, edge.depth());
        let outer = half_width(v, start);
        let lean =
            (outer - half_width(v, edge.below(on_curve, edge.crown))).clamp(0.0, edge.radii[0]);
        let inner = (outer - edge.radii[1] - lean).max(0.02);
        Self { edge, on_curve, outer, inner, lean }
    }

    /// Lateral position and point of the side view; 0 is where the side ends, 1 where the top begins.
    fn at(&self, share: f64) -> (f64, Point) {
        let (sin, cos) = (share * std::f64::consts::FRAC_PI_2).sin_cos();
        let lateral = self.outer - self.edge.radii[1] * (1.0 - cos) - self.lean * sin;
        // The crown's slope goes on into the corner, as far as there is depth for it.
        let [along, across] = self.edge.radii;
        let slope = 2.0 * self.edge.crown / self.inner;
        let drop = (slope * across).min(MOST_SLOPE * along);
        let depth = self.edge.crown + drop * cos + (along - drop) * (1.0 - sin);
        (lateral, self.edge.below(self.on_curve, depth))
    }
}
