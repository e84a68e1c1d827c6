//! Where on the body the parts are.
//!
//! What follows rings and columns of the loft (hood, windscreens, roof, trunk) is painted face by face; everything else
//! is cut out as regions of the side view (z, h), or, for lamps, which run round a corner, of (angle round the corner,
//! h). Later regions paint over earlier ones.

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::curves::upper_curve;
use super::half::{Half, Vertex, Zone};
use super::loft::{bed_rings, knots, side_top};
use super::path::Path;
use super::relief;
use super::seams::Painter;

/// Distance of side windows from the body's upper edge, metres.
const GLASS_GAP: f64 = 0.025;
/// Half the width of the B-pillar.
const HALF_PILLAR: f64 = 0.045;
/// Lower edge of the doors above the sills' lower edge.
const SILL_HEIGHT: f64 = 0.11;
/// Distance of the rear door from the wheel arch.
const ARCH_GAP: f64 = 0.06;

/// Gives the faces of the body their parts.
pub(super) fn paint(v: &ParametricVehicle, half: &mut Half) {
    paint_top(half);
    if v.has_bed() {
        paint_bed(v, half);
    }
    let top = upper_curve(v);
    let mut painter = Painter::new(half);
    painter.fix_seams();
    paint_ends(v, &top, &mut painter);
    paint_rear_window(v, &top, &mut painter);
    paint_side(v, &top, &mut painter);
    paint_lamps(v, &mut painter);
    relief::press_grille(v, &mut painter);
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

/// The load bed: floor and tailgate count as trunk, rails and inner walls as side.
fn paint_bed(v: &ParametricVehicle, half: &mut Half) {
    let Some([start, _, floor_end, _]) = bed_rings(v) else { return };
    let floor = v.deck_height - v.bed_depth;
    for (i, face) in half.faces.iter().enumerate() {
        let corners = face.map(|index| half.vertices[index as usize]);
        let t = corners.iter().map(|corner| corner.t).sum::<f64>() / 3.0;
        let is_inner = matches!(half.zones[i], Zone::Rim | Zone::Top);
        if !is_inner || !(knots::DECK < t && t < knots::LIP) {
            continue;
        }
        let is_floor = corners.iter().all(|corner| corner.h < floor + 1e-6);
        let is_gate = t > floor_end && half.zones[i] == Zone::Top;
        let is_ledge = t < start;
        half.parts[i] =
            if (is_floor || is_gate) && !is_ledge { PartClass::Trunk } else { PartClass::SideLeft };
    }
}

/// The strip between the end of the roof and the glass belongs to the tailgate.
fn paint_rear_window(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let [from, to] = [top.at(knots::ROOF_END), top.at(knots::DECK)];
    let share = v.rear_window_gap / from.distance(to).max(1e-6);
    let glass = |_: Zone, part: PartClass| part == PartClass::WindshieldRear;
    if share > 1e-6 {
        let end = knots::ROOF_END + share.min(0.9);
        painter.paint(PartClass::Trunk, glass, &[&|p| p.t - end]);
    }
}

/// Aprons: the bumpers' skirts and, in front, what lies between the lamps.
fn paint_ends(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let [front, rear] = v.axles();
    // Where the rounded curve has the rings of the bumpers' upper edges.
    let [front_edge, rear_edge] = [knots::BUMPER_FRONT, knots::BUMPER_REAR].map(|t| top.at(t).h);
    let body = |zone: Zone, part: PartClass| zone != Zone::Fitting && part == PartClass::SideLeft;
    painter.paint(PartClass::ApronFront, body, &[&|p| front + 0.1 - p.z, &|p| p.h - front_edge]);
    let between_lamps = v.headlamp_inner.to_radians() + 0.1;
    let face = move |zone: Zone, part: PartClass| body(zone, part) && zone != Zone::Side;
    painter.paint(
        PartClass::ApronFront,
        face,
        &[&|p| p.t - knots::HOOD, &|p| angle_front(v, p) - between_lamps],
    );
    painter.paint(PartClass::ApronRear, body, &[&|p| p.z - (rear - 0.1), &|p| p.h - rear_edge]);
}

fn paint_side(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let front = v.axles()[0];
    let [start, pillar] = [front - v.door_start, front - v.b_pillar];
    let sill = v.ground_clearance + SILL_HEIGHT;
    let side = |zone: Zone, _: PartClass| zone == Zone::Side;
    let rise = |p: &Vertex| p.h - v.belt(p.z);
    painter.paint(
        PartClass::DoorFrontLeft,
        side,
        &[&rise, &|p| sill - p.h, &|p| p.z - start, &|p| pillar - p.z],
    );
    if v.rear_doors {
        paint_rear_door(v, painter);
    }
    paint_side_windows(v, top, painter);
}

fn paint_rear_door(v: &ParametricVehicle, painter: &mut Painter) {
    let [front, rear] = v.axles();
    let [pillar, end] = [front - v.b_pillar, rear + v.rear_door_end];
    let [hub, sill] = [0.5 * v.wheel_diameter, v.ground_clearance + SILL_HEIGHT];
    let near_arch = |p: &Vertex| v.arch_radius() + ARCH_GAP - (p.z - rear).hypot(p.h - hub);
    painter.paint(
        PartClass::DoorRearLeft,
        |zone, _| zone == Zone::Side,
        &[&|p| p.h - v.belt(p.z), &|p| sill - p.h, &|p| p.z - pillar, &|p| end - p.z, &near_arch],
    );
}

/// The side windows, from the windscreen's pillar to the last.
fn paint_side_windows(v: &ParametricVehicle, top: &Path, painter: &mut Painter) {
    let [front, rear] = v.axles();
    let pillar = front - v.b_pillar;
    let door_end = rear + v.rear_door_end;
    let quarter_end = rear + v.quarter_glass_end;
    let rise = |p: &Vertex| p.h - v.belt(p.z);
    let side = |zone: Zone, _: PartClass| zone == Zone::Side;
    let outline = Outline::new(top);
    let above_belt = |p: &Vertex| -rise(p);
    let below_roof = |p: &Vertex| outline.above(p.z, p.h) + GLASS_GAP;
    // Pillars lean with the windows: this much forward going down, per metre.
    let upright = |p: &Vertex| p.z + 0.12 * rise(p);
    let rear_pillar = |p: &Vertex| door_end + 0.25 * rise(p);
    let slope = v.quarter_glass_rake.to_radians().tan();
    let last_pillar = |p: &Vertex| quarter_end + slope * rise(p) - p.z;
    painter.paint(
        PartClass::GlassFrontLeft,
        side,
        &[&above_belt, &below_roof, &|p| pillar + HALF_PILLAR - upright(p)],
    );
    if !v.rear_side_windows {
        return;
    }
    let behind_door = |p: &Vertex| upright(p) - (pillar - HALF_PILLAR);
    // Without rear doors there is one window behind the front doors'.
    if !v.rear_doors {
        let bounds: [&dyn Fn(&Vertex) -> f64; 4] =
            [&above_belt, &below_roof, &behind_door, &last_pillar];
        painter.paint(PartClass::GlassRearLeft, side, &bounds);
        return;
    }
    painter.paint(
        PartClass::GlassRearLeft,
        side,
        &[&above_belt, &below_roof, &behind_door, &|p| rear_pillar(p) + 0.02 - p.z],
    );
    if v.rear_door_end - v.c_pillar - v.quarter_glass_end > 0.03 {
        let behind_pillar = |p: &Vertex| p.z - (rear_pillar(p) + 0.02 - v.c_pillar);
        painter.paint(
            PartClass::GlassCornerLeft,
            side,
            &[&above_belt, &below_roof, &behind_pillar, &last_pillar],
        );
    }
}

fn paint_lamps(v: &ParametricVehicle, painter: &mut Painter) {
    let body = |zone: Zone, part: PartClass| {
        !matches!(zone, Zone::Bottom | Zone::Fitting)
            && !matches!(part, PartClass::WindshieldRear | PartClass::Roof)
    };
    // Narrow beside the grille, rising towards the side.
    let [inner, outer] = [v.headlamp_inner, v.headlamp_outer].map(f64::to_radians);
    let share = |p: &Vertex| ((angle_front(v, p) - inner) / (outer - inner)).clamp(0.0, 1.0);
    let bottom = |p: &Vertex| v.front_bumper_height + 0.005 + v.headlamp_sweep * share(p).powi(2);
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
    let [inner, outer] = [v.tail_lamp_inner, v.tail_lamp_outer].map(f64::to_radians);
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
pub(super) fn angle_front(v: &ParametricVehicle, p: &Vertex) -> f64 {
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
