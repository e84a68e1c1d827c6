//! Relief of the panels that the models' shapes lack: creases, dishes, rounded strips.
//!
//! Only normals change, so that light falls as on a pressed sheet while places, and with them labels, stay. A crease is
//! where the normal turns within a centimetre or two: on either side of a line it leans towards or away from it and swings
//! back within a hand's breadth. (Perturbed normals: J. Blinn, *Simulation of Wrinkled Surfaces*, 1978, here at the corners of faces that are
//! cut along the line.)

use nalgebra::Vector3;
use partpose::parts::PartClass as P;

use super::patchwork::{Facet, Patchwork};
use super::slots::Slot;

type V = Vector3<f32>;

/// Breadth below which the swing back of a crease needs faces of its own, metres.
const NARROW: f32 = 0.03;

/// How normals lean beside a line.
#[derive(Clone, Copy)]
struct Lean {
    /// Where the line's function is negative: by how much, up the function's slope, right at the line.
    below: f32,
    /// Where it is positive.
    above: f32,
    /// Over what breadth on either side, metres.
    breadth: [f32; 2],
    /// Half the breadth over which one turns into the other.
    round: f32,
}

/// Presses creases into sides, hood and rear, and dishes for the plates.
pub(super) fn press(work: &mut Patchwork) {
    for side in [Side::LEFT, Side::RIGHT] {
        sides(work, &side);
    }
    hood(work);
    rear(work);
}

/// The parts of a side of the body.
struct Side {
    front_door: P,
    rear_door: P,
    body: P,
    front_glass: P,
    rear_glass: P,
    wheels: [P; 2],
    lamps: [P; 2],
}

impl Side {
    const LEFT: Self = Self {
        front_door: P::DoorFrontLeft,
        rear_door: P::DoorRearLeft,
        body: P::SideLeft,
        front_glass: P::GlassFrontLeft,
        rear_glass: P::GlassRearLeft,
        wheels: [P::WheelFrontLeft, P::WheelRearLeft],
        lamps: [P::LightFrontLeft, P::LightRearLeft],
    };
    const RIGHT: Self = Self {
        front_door: P::DoorFrontRight,
        rear_door: P::DoorRearRight,
        body: P::SideRight,
        front_glass: P::GlassFrontRight,
        rear_glass: P::GlassRearRight,
        wheels: [P::WheelFrontRight, P::WheelRearRight],
        lamps: [P::LightFrontRight, P::LightRearRight],
    };
}

/// The shoulder, from lamp to lamp through the handles, and a line above the sill.
fn sides(work: &mut Patchwork, side: &Side) {
    let (Some([door_low, door_high]), Some([glass_low, glass_high])) =
        (work.bounds(&[side.front_door]), work.bounds(&[side.front_glass]))
    else {
        return;
    };
    let is_panel = |facet: &Facet| {
        facet.part.is_some_and(|part| [side.front_door, side.rear_door, side.body].contains(&part))
            && matches!(facet.slot, Slot::Paint)
    };
    let lamps = side.lamps.map(|lamp| work.bounds(&[lamp]));
    let [front, rear] = [
        lamps[0].map_or(door_high.z + 0.8, |[low, _]| low.z - 0.03),
        lamps[1].map_or(door_low.z - 1.2, |[_, high]| high.z + 0.03),
    ];
    // The line rises towards the rear with the windows' lower edges.
    let belts = [
        (0.5 * (glass_low.z + glass_high.z), -glass_high.y),
        work.bounds(&[side.rear_glass])
            .map_or((glass_low.z - 0.9, -glass_high.y), |[low, high]| {
                (0.5 * (low.z + high.z), -high.y)
            }),
    ];
    let slope = (belts[1].1 - belts[0].1) / (belts[1].0 - belts[0].0).min(-0.3);
    let shoulder = move |p: &V| -p.y - (belts[0].1 - 0.125 + slope * (p.z - belts[0].0));
    let fades = move |z: f32| ((front - z).min(z - rear) / 0.25).clamp(0.0, 1.0);
    let lean = Lean { below: -0.28, above: 0.18, breadth: [0.17, 0.06], round: 0.012 };
    crease(work, is_panel, &shoulder, lean, |p| fades(p.z));
    let wheels = side.wheels.map(|wheel| work.bounds(&[wheel]));
    let [Some([front_wheel, _]), Some([_, rear_wheel])] = wheels else { return };
    let sill = -door_high.y;
    let above_sill = move |p: &V| -p.y - (sill + 0.105 - 0.025 * (p.z - door_low.z));
    let ends = [front_wheel.z - 0.05, rear_wheel.z + 0.05];
    let lean = Lean { below: 0.22, above: -0.12, breadth: [0.08, 0.16], round: 0.018 };
    crease(work, is_panel, &above_sill, lean, |p| {
        ((ends[0] - p.z).min(p.z - ends[1]) / 0.2).clamp(0.0, 1.0)
    });
}

/// Two lines that run together towards the front.
fn hood(work: &mut Patchwork) {
    let Some([low, high]) = work.bounds(&[P::Hood]) else { return };
    let [wide, narrow] = [0.62 * high.x, 0.40 * high.x];
    let length = (high.z - low.z).max(0.1);
    let is_hood = |facet: &Facet| facet.part == Some(P::Hood) && facet.slot == Slot::Paint;
    let beside = move |p: &V| p.x.abs() - narrow - (wide - narrow) * (high.z - p.z) / length;
    let lean = Lean { below: -0.10, above: 0.16, breadth: [0.12, 0.06], round: 0.008 };
    crease(work, is_hood, &beside, lean, |p| ((high.z - p.z) / 0.15).clamp(0.0, 1.0));
}

/// An edge across the boot's lid below the window, and the hollow of the plate.
fn rear(work: &mut Patchwork) {
    let parts = [P::Trunk, P::ApronRear];
    let Some([_, lid_high]) = work.bounds(&[P::Trunk]) else { return };
    let plate = work.plates[1];
    let is_back = |facet: &Facet| {
        facet.part.is_some_and(|part| parts.contains(&part))
            && facet.slot == Slot::Paint
            && facet.corners.iter().all(|corner| corner.normal.z < -0.35)
    };
    let lamps = work.bounds(&[P::LightRearRight]);
    let reach = lamps.map_or(0.5, |[low, _]| low.x.max(0.3));
    if let Some([low, _]) = lamps
        && -lid_high.y < plate
    {
        let edge = (-low.y - 0.01).max(plate + 0.13);
        let lean = Lean { below: -0.30, above: 0.18, breadth: [0.10, 0.05], round: 0.008 };
        crease(work, is_back, &|p| -p.y - edge, lean, |p| {
            ((reach + 0.02 - p.x.abs()) / 0.06).clamp(0.0, 1.0)
        });
    }
    let half = [(reach - 0.04).min(0.40), 0.095];
    let hollow = move |p: &V| {
        let [x, y] = [p.x.abs() - half[0], (-p.y - plate).abs() - half[1]];
        x.max(y)
    };
    crease(
        work,
        is_back,
        &hollow,
        Lean { below: -0.42, above: 0.10, breadth: [0.028, 0.02], round: 0.003 },
        |_| 1.0,
    );
}

/// Handles: a bar over a dish, with its shade below.
pub(super) fn handles(work: &mut Patchwork) {
    for [door, glass] in [
        [P::DoorFrontLeft, P::GlassFrontLeft],
        [P::DoorFrontRight, P::GlassFrontRight],
        [P::DoorRearLeft, P::GlassRearLeft],
        [P::DoorRearRight, P::GlassRearRight],
    ] {
        let (Some([low, high]), Some([_, belt])) = (work.bounds(&[door]), work.bounds(&[glass]))
        else {
            continue;
        };
        if high.z - low.z < 0.5 {
            continue;
        }
        let h = -belt.y - 0.085;
        // The rear door's lower half is cut away by the wheel arch, its upper half is not.
        let from = low.z + 0.07;
        let is_door = |facet: &Facet| facet.part == Some(door);
        let [middle, half] = [from + 0.10, 0.012];
        let dish = move |p: &V| {
            let [z, y] = [(p.z - middle) / 0.078, (-p.y - h + 0.006) / 0.036];
            0.036 * (z.hypot(y) - 1.0)
        };
        let lean = Lean { below: -0.55, above: 0.08, breadth: [0.036, 0.012], round: 0.003 };
        crease(work, is_door, &dish, lean, |_| 1.0);
        // Bounds that are straight in the point cut faces however large they are.
        let ends = [from, from + 0.20];
        let strip = |work: &mut Patchwork, slot, inset: f32, [low, high]: [f32; 2]| {
            let [back, front] = [ends[0] + inset, ends[1] - inset];
            let bounds: [&dyn Fn(&V) -> f32; 4] =
                [&|p| back - p.z, &|p| p.z - front, &|p| p.y + low, &|p| -p.y - high];
            work.paint(slot, is_door, &bounds);
        };
        strip(work, Slot::BlackPlastic, 0.03, [h - half - 0.009, h]);
        strip(work, Slot::Handle, 0.0, [h - half, h + half]);
        let is_bar = |facet: &Facet| is_door(facet) && facet.slot == Slot::Handle;
        work.bend(is_bar, |p, _| {
            let up = ((-p.y - h) / half).clamp(-1.0, 1.0);
            V::new(0.0, -up, 0.0)
        });
    }
}

/// Lets normals lean on both sides of the root of a function, by as much as `strength` leaves.
fn crease(
    work: &mut Patchwork,
    concerns: impl Fn(&Facet) -> bool,
    line: &dyn Fn(&V) -> f32,
    lean: Lean,
    strength: impl Fn(&V) -> f32,
) {
    let [below, above] = lean.breadth;
    // Where it swings back faster than faces are large, it is cut there, too.
    let ends = [-below, above].into_iter().filter(|end| end.abs() < NARROW);
    for level in [-lean.round, lean.round].into_iter().chain(ends) {
        work.divide_along(&concerns, &|p| line(p) - level);
    }
    work.bend(&concerns, |p, normal| {
        let at = line(p);
        let beyond = |breadth: f32| 1.0 - ((at.abs() - lean.round) / breadth).clamp(0.0, 1.0);
        let leans = match at / lean.round {
            ..-1.0 => lean.below * beyond(lean.breadth[0]),
            1.0.. => lean.above * beyond(lean.breadth[1]),
            between => 0.5 * ((1.0 - between) * lean.below + (1.0 + between) * lean.above),
        };
        if leans == 0.0 { V::zeros() } else { slope(line, p, normal) * (leans * strength(p)) }
    });
}

/// The direction on the surface in which a function grows.
fn slope(line: &dyn Fn(&V) -> f32, p: &V, normal: &V) -> V {
    let step = 1e-3;
    let along = |axis: V| (line(&(p + axis * step)) - line(&(p - axis * step))) / (2.0 * step);
    let slope = V::new(along(V::x()), along(V::y()), along(V::z()));
    (slope - normal * slope.dot(normal)).try_normalize(1e-3).unwrap_or_default()
}
