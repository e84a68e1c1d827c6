//! The body's surface as rings from nose to tail.
//!
//! Ring t joins the point t of the upper curve to a point of the lower curve. Seen from the front, it leaves the middle
//! of the floor, turns round the sill's edge, climbs the side, turns round the upper edge and ends in the middle of the
//! top. At nose and tail both curves meet, and the ring has pinched to a line across the vehicle.

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::half::{Half, Vertex, Zone};
use super::path::{Edge, Knot, Path, Point};

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
/// Longest distance between rings along either curve, metres.
const RING_DISTANCE: f64 = 0.1;

/// The left half of the body's surface; all of it is side for now.
pub(super) fn body(vehicle: &ParametricVehicle) -> Half {
    let (top, bottom) = (upper_curve(vehicle), lower_curve(vehicle));
    let mut half = Half::default();
    let mut zones = Vec::new();
    let rings = stations(&top, &bottom);
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
    let mut width = 0.5 * vehicle.width - taper - 0.07 * below.powi(2) - 0.035 * above.powi(2);
    let rise = p.h - belt;
    if rise > 0.0 {
        let shoulder = (rise / 0.05).min(1.0);
        width -= vehicle.shoulder * shoulder * shoulder * (3.0 - 2.0 * shoulder);
        width -= rise * vehicle.tumblehome.to_radians().tan() + 0.12 * rise * rise;
    }
    // However it is shaped, there is something between the sides.
    width.max(0.1)
}

/// Where the side ends above: the upper curve lowered by crown and corner.
pub(super) fn side_top(path: &Path, t: f64) -> Point {
    let edge = path.edge(t);
    edge.below(path.at(t), edge.depth())
}

/// The upper curve of the side view, from the nose over hood, windscreen, roof and trunk to the tail.
pub(super) fn upper_curve(v: &ParametricVehicle) -> Path {
    let nose = v.nose();
    let cowl = v.axles()[0] - v.cowl_setback;
    let header_height = v.height - v.header_drop;
    let header = cowl - (header_height - v.cowl_height) * v.windscreen_rake.to_radians().tan();
    let foot = v.rear_window_foot();
    let roof_end_height = v.height - v.roof_end_drop;
    let roof_end = foot + (roof_end_height - v.deck_height) * v.rear_window_rake.to_radians().tan();
    let hood_start = nose - v.hood_setback;
    let hood_middle = hood_start + 0.45 * (cowl - hood_start);
    let hood_middle_height = v.hood_front_height + 0.62 * (v.cowl_height - v.hood_front_height);
    let [crown_f, along_f, across_f] = v.front_corner;
    let [crown_r, along_r, across_r] = v.rear_corner;
    let front = |inwards| Edge::new(inwards, crown_f, [along_f, across_f]);
    let rear = |inwards| Edge::new(inwards, crown_r, [along_r, across_r]);
    // Shallower than the bumper's, so that rings stay in order where the corner runs out along the hood.
    let hood_edge = Edge::new([-1.0, -0.3], 0.8 * crown_f, [0.75 * along_f, across_f]);
    let down = [0.0, -1.0];
    // Without a notch the rear window wraps round the corners like the panel below it.
    let notch = (v.deck_length / 0.3).min(1.0);
    let foot_edge =
        Edge::new([0.2, -1.0], 0.06, [0.06, 0.10]).lerp(&rear([1.0, -0.3]), 1.0 - notch);
    let roof_end_edge = Edge::new([0.1, -1.0], 0.05, [0.06, 0.10])
        .lerp(&Edge::new([0.6, -1.0], 0.06, [0.08, 0.13]), 1.0 - notch);
    let knot = |z, h, round, edge| Knot { at: Point { z, h }, round, edge, arch: None };
    let mut path = Path(vec![
        knot(nose, v.nose_height, 0.0, front([-1.0, 0.0])),
        knot(nose - 0.02, v.front_bumper_height, 0.05, front([-1.0, 0.0])),
        knot(hood_start, v.hood_front_height, 0.07, hood_edge),
        knot(hood_middle, hood_middle_height, 0.5, Edge::new(down, 0.05, [0.07, 0.12])),
        knot(cowl, v.cowl_height, 0.06, Edge::new(down, 0.05, [0.04, 0.07])),
        knot(header, header_height, 0.22, Edge::new(down, 0.05, [0.06, 0.09])),
        knot(0.5 * (header + roof_end), v.height, 0.6, Edge::new(down, 0.05, [0.06, 0.11])),
        knot(roof_end, roof_end_height, 0.2, roof_end_edge),
        knot(foot, v.deck_height, 0.05, foot_edge),
        knot(v.lip_setback - nose, v.lip_height, 0.035, rear([1.0, -0.3])),
        knot(0.025 - nose, v.rear_bumper_height, 0.04, rear([1.0, 0.0])),
        knot(-nose, v.tail_height, 0.0, rear([1.0, 0.0])),
    ]);
    // Rounding lowers the roof; each step at least halves what is missing.
    for _ in 0..60 {
        path.0[6].at.h += v.height - path.at(6.0).h;
    }
    path
}

/// The lower curve, from the nose under the bumper, over the wheel arches and along the sills to the tail.
fn lower_curve(v: &ParametricVehicle) -> Path {
    let nose = v.nose();
    let hub = 0.5 * v.wheel_diameter;
    let low = v.ground_clearance;
    let [crown_f, along_f, across_f] = v.front_corner;
    let [crown_r, along_r, across_r] = v.rear_corner;
    let front = |inwards| Edge::new(inwards, crown_f, [along_f, across_f]);
    let rear = |inwards| Edge::new(inwards, crown_r, [along_r, across_r]);
    // Shallower corners below, so that rings do not cross those at the wheel arches.
    let tucked = |inwards, [crown, along, across]: [f64; 3]| {
        Edge::new(inwards, 0.8 * crown, [0.8 * along, across])
    };
    let sill = Edge::new([0.0, 1.0], 0.0, [0.025, 0.025]);
    let knot = |z, h, round, edge| Knot { at: Point { z, h }, round, edge, arch: None };
    let reach = v.arch_radius();
    let arch = |z: f64| {
        let start = knot(z + reach, low, 0.0, sill);
        [Knot { arch: Some(hub + reach - low), ..start }, knot(z - reach, low, 0.0, sill)]
    };
    let mut path = vec![
        knot(nose, v.nose_height, 0.0, front([-1.0, 0.0])),
        knot(nose - 0.015, v.nose_height - 0.13, 0.05, front([-1.0, 0.0])),
        knot(nose - 0.11, low + 0.03, 0.08, tucked([-1.0, 0.3], v.front_corner)),
    ];
    path.extend(v.axles().into_iter().flat_map(arch));
    path.push(knot(0.13 - nose, low + 0.08, 0.08, tucked([1.0, 0.3], v.rear_corner)));
    path.push(knot(0.02 - nose, v.tail_height - 0.13, 0.05, rear([1.0, 0.0])));
    path.push(knot(-nose, v.tail_height, 0.0, rear([1.0, 0.0])));
    Path(path)
}

/// The rings, as parameters of the upper and the lower curve.
///
/// Rings are upright between the outer ends of the wheel arches and fan out from there to nose and tail.
fn stations(top: &Path, bottom: &Path) -> Vec<[f64; 2]> {
    let (arches_begin, arches_end) = (bottom.at(3.0).z, bottom.at(6.0).z);
    let upright = |z: f64| [top.parameter_at(z), bottom.parameter_at(z)];
    let mut anchors = vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
    anchors.extend((3..=6).map(|b| [top.parameter_at(bottom.at(f64::from(b)).z), f64::from(b)]));
    let lip = top.at(knots::LIP).z;
    for t in 3..9 {
        let (t, z) = (f64::from(t), top.at(f64::from(t)).z);
        if z > arches_begin {
            let share = (t - 2.0) / (top.parameter_at(arches_begin) - 2.0);
            anchors.push([t, 2.0 + share]);
        } else if z > arches_end {
            anchors.push([t, upright(z)[1]]);
        } else {
            anchors.push([t, 6.0 + (arches_end - z) / (arches_end - lip)]);
        }
    }
    anchors.extend([[9.0, 7.0], [10.0, 8.0], [11.0, 9.0]]);
    anchors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // Anchors that nearly coincide would make slivers; those at knots of the upper curve stay.
    let is_knot = |t: f64| (t - t.round()).abs() < 1e-9;
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for anchor in anchors {
        let near = kept.last().filter(|last| {
            top.at(last[0]).distance(top.at(anchor[0])) < 0.02 && anchor[0] - last[0] < 0.5
        });
        match near.map(|last| is_knot(last[0])) {
            Some(true) if !is_knot(anchor[0]) => {}
            Some(false) => *kept.last_mut().expect("it has a last one") = anchor,
            _ => kept.push(anchor),
        }
    }
    let mut rings = vec![kept[0]];
    for pair in kept.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let length = |path: &Path, k: usize| {
            let at = |share: f64| path.at(from[k] + share * (to[k] - from[k]));
            (0..8).map(|i| at(f64::from(i) / 8.0).distance(at(f64::from(i + 1) / 8.0))).sum::<f64>()
        };
        let distance = if from[0] < 2.0 || to[0] > 9.0 { 0.6 } else { 1.0 } * RING_DISTANCE;
        let steps = (length(top, 0).max(length(bottom, 1)) / distance).ceil().max(1.0);
        for step in 1..=steps as usize {
            let share = step as f64 / steps;
            rings.push([0, 1].map(|k| from[k] + share * (to[k] - from[k])));
        }
    }
    rings
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
    for (i, share) in TOP_SHARES.into_iter().enumerate() {
        let zone = [Zone::Corner, Zone::Rim].get(i).copied().unwrap_or(Zone::Top);
        push(share * corner.inner, upper_edge.below(upper, upper_edge.crown * share * share), zone);
    }
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
