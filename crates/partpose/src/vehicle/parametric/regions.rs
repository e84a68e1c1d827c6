//! Where on the body the parts are.
//!
//! What follows rings and columns of the loft (hood, windscreens, roof, trunk) is painted face by face; everything else
//! is cut out as regions of the side view (z, h), or, for lamps, which run round a corner, of (angle round the corner,
//! h). Later regions paint over earlier ones.

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::half::{Half, Vertex, Zone};
use super::loft::{knots, side_top, upper_curve};
use super::path::Path;
use super::seams::Painter;

/// Distance of side windows from the body's upper edge, metres.
const GLASS_GAP: f64 = 0.025;
/// Half the width of the B-pillar.
const HALF_PILLAR: f64 = 0.045;
/// Lower edge of the doors above the sills' lower edge.
const SILL_HEIGHT: f64 = 0.11;
/// Distance of the rear door from the wheel arch.
const ARCH_GAP: f64 = 0.06;

/// Angles at which headlamps begin and end, from ahead to the side.
const FRONT_LAMP: [f64; 2] = [0.38, 1.45];
/// The same for tail lamps.
const REAR_LAMP: [f64; 2] = [0.52, 1.72];

/// Gives the faces of the body their parts.
pub(super) fn paint(v: &ParametricVehicle, half: &mut Half) {
    paint_top(half);
    let top = upper_curve(v);
    let mut painter = Painter::new(half);
    painter.fix_seams();
    paint_ends(v, &top, &mut painter);
    paint_side(v, &top, &mut painter);
    paint_lamps(v, &mut painter);
}

/// The parts that end at rings and columns.
fn paint_top(half: &mut Half) {
    for (i, face) in half.faces.iter().enumerate() {
        let t = face.iter().map(|index| half.vertices[*index as usize].t).sum::<f64>() / 3.0;
        let between = |from: f64, to: f64| from < t && t < to;
        half.parts[i] = match half.zones[i] {
            Zone::Corner | Zone::Rim | Zone::Top if between(knots::HEADER, knots::ROOF_END) => {
                PartClass::Roof
            }
            Zone::Rim | Zone::Top if between(knots::HOOD, knots::COWL) => PartClass::Hood,
            Zone::Top if between(knots::COWL, knots::HEADER) => PartClass::WindshieldFront,
            Zone::Top if between(knots::ROOF_END, knots::DECK) => PartClass::WindshieldRear,
            Zone::Rim | Zone::Top if between(knots::DECK, knots::BUMPER_REAR) => PartClass::Trunk,
            _ => PartClass::SideLeft,
        };
    }
}

/// Aprons: the bumpers' skirts and, in front, what lies between the lamps.
fn paint_ends(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let [front, rear] = v.axles();
    // Where the rounded curve has the rings of the bumpers' upper edges.
    let [front_edge, rear_edge] = [knots::BUMPER_FRONT, knots::BUMPER_REAR].map(|t| top.at(t).h);
    let body = |zone: Zone, part: PartClass| zone != Zone::Fitting && part == PartClass::SideLeft;
    painter.paint(PartClass::ApronFront, body, &[&|p| front + 0.1 - p.z, &|p| p.h - front_edge]);
    let between_lamps = FRONT_LAMP[0] + 0.1;
    let face = move |zone: Zone, part: PartClass| body(zone, part) && zone != Zone::Side;
    painter.paint(
        PartClass::ApronFront,
        face,
        &[&|p| p.t - knots::HOOD, &|p| angle_front(v, p) - between_lamps],
    );
    painter.paint(PartClass::ApronRear, body, &[&|p| p.z - (rear - 0.1), &|p| p.h - rear_edge]);
}

fn paint_side(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let [front, rear] = v.axles();
    let hub = 0.5 * v.wheel_diameter;
    let [start, pillar] = [front - v.door_start, front - v.b_pillar];
    let end = rear + v.rear_door_end;
    let quarter_end = rear + v.quarter_glass_end;
    let sill = v.ground_clearance + SILL_HEIGHT;
    let side = |zone: Zone, _: PartClass| zone == Zone::Side;
    let rise = |p: &Vertex| p.h - v.belt(p.z);
    painter.paint(
        PartClass::DoorFrontLeft,
        side,
        &[&rise, &|p| sill - p.h, &|p| p.z - start, &|p| pillar - p.z],
    );
    let near_arch = |p: &Vertex| v.arch_radius() + ARCH_GAP - (p.z - rear).hypot(p.h - hub);
    painter.paint(
        PartClass::DoorRearLeft,
        side,
        &[&rise, &|p| sill - p.h, &|p| p.z - pillar, &|p| end - p.z, &near_arch],
    );
    let outline = Outline::new(top);
    let above_belt = |p: &Vertex| -rise(p);
    let below_roof = |p: &Vertex| outline.above(p.z, p.h) + GLASS_GAP;
    // Pillars lean with the windows: this much forward going down, per metre.
    let upright = |p: &Vertex| p.z + 0.12 * rise(p);
    let rear_pillar = |p: &Vertex| end + 0.25 * rise(p);
    painter.paint(
        PartClass::GlassFrontLeft,
        side,
        &[&above_belt, &below_roof, &|p| pillar + HALF_PILLAR - upright(p)],
    );
    painter.paint(
        PartClass::GlassRearLeft,
        side,
        &[&above_belt, &below_roof, &|p| upright(p) - (pillar - HALF_PILLAR), &|p| {
            rear_pillar(p) + 0.02 - p.z
        }],
    );
    painter.paint(
        PartClass::GlassCornerLeft,
        side,
        &[&above_belt, &below_roof, &|p| p.z - (rear_pillar(p) - 0.025), &|p| {
            quarter_end + 0.9 * rise(p) - p.z
        }],
    );
}

fn paint_lamps(v: &ParametricVehicle, painter: &mut Painter) {
    let body = |zone: Zone, _: PartClass| !matches!(zone, Zone::Bottom | Zone::Fitting);
    // Narrow beside the grille, rising towards the side.
    let [inner, outer] = FRONT_LAMP;
    let share = |p: &Vertex| ((angle_front(v, p) - inner) / (outer - inner)).clamp(0.0, 1.0);
    let bottom = |p: &Vertex| v.front_bumper_height + 0.005 + 0.10 * share(p).powi(2);
    let top = |p: &Vertex| v.hood_front_height - 0.035 + 0.07 * share(p);
    painter.paint(
        PartClass::LightFrontLeft,
        body,
        &[
            &|p| v.nose() - 1.2 - p.z,
            &|p| p.h - top(p),
            &|p| bottom(p) - p.h,
            &|p| 0.5 * (inner - angle_front(v, p)),
            &|p| 0.5 * (angle_front(v, p) - outer),
        ],
    );
    let [inner, outer] = REAR_LAMP;
    let share = |p: &Vertex| ((angle_rear(v, p) - inner) / (outer - inner)).clamp(0.0, 1.0);
    let bottom = |p: &Vertex| v.tail_lamp_bottom + 0.05 * share(p);
    let top = |p: &Vertex| v.tail_lamp_top - 0.03 * (1.0 - share(p));
    painter.paint(
        PartClass::LightRearLeft,
        body,
        &[
            &|p| p.z + v.nose() - 1.0,
            &|p| p.h - top(p),
            &|p| bottom(p) - p.h,
            &|p| 0.5 * (inner - angle_rear(v, p)),
            &|p| 0.5 * (angle_rear(v, p) - outer),
        ],
    );
}

/// Angle round an upright axis inside the front corner: 0 ahead, a right angle to the side.
fn angle_front(v: &ParametricVehicle, p: &Vertex) -> f64 {
    let axis = [0.5 * v.width - 0.62, v.nose() - 0.55];
    (p.lateral - axis[0]).atan2(p.z - axis[1])
}

/// The same for the rear corner.
fn angle_rear(v: &ParametricVehicle, p: &Vertex) -> f64 {
    let axis = [0.5 * v.width - 0.62, 0.50 - v.nose()];
    (p.lateral - axis[0]).atan2(axis[1] - p.z)
}

/// The upper edge of the side as a polyline with falling z, to stay below of.
struct Outline(Vec<[f64; 2]>);

impl Outline {
    fn new(path: &Path) -> Self {
        let [from, to] = [knots::COWL - 0.5, knots::DECK + 0.5];
        let steps = 200;
        let points = (0..=steps).map(|i| {
            let point = side_top(path, from + (to - from) * f64::from(i) / f64::from(steps));
            [point.z, point.h]
        });
        Self(points.collect())
    }

    /// Distance above the outline; negative below it.
    fn above(&self, z: f64, h: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut sign = 1.0;
        for pair in self.0.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let [dz, dh] = [to[0] - from[0], to[1] - from[1]];
            let length = dz.hypot(dh).max(1e-9);
            let along = ((z - from[0]) * dz + (h - from[1]) * dh) / length;
            let foot = (along / length).clamp(0.0, 1.0);
            let distance = (z - from[0] - foot * dz).hypot(h - from[1] - foot * dh);
            if distance < nearest {
                nearest = distance;
                // z falls along the outline, so that above is to the right of it.
                sign = ((h - from[1]) * -dz + (z - from[0]) * dh).signum();
            }
        }
        sign * nearest
    }
}
