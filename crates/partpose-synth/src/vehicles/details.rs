//! What sits on panels and panes: emblems, wipers, the third brake lamp, reflectors, fog lamps, the flap of the tank.

use nalgebra::Vector3;
use partpose::parts::PartClass as P;

use super::patchwork::{Facet, Patchwork};
use super::slots::Slot;

type V = Vector3<f32>;

/// Radius of emblems, metres.
const EMBLEM: f32 = 0.04;
/// Half the breadth of a wiper as seen from ahead, metres; panes lean, so that it is broader along them.
const WIPER: f32 = 0.006;

/// Paints them over what is there; `grille` is the height of the middle of the grille.
pub(super) fn add(work: &mut Patchwork, grille: f32) {
    emblem(work, &[P::ApronFront, P::Hood], grille, 1.0);
    let above_plate = work.plates[1] + 0.125;
    emblem(work, &[P::Trunk], above_plate, -1.0);
    wipers(work);
    third_brake_lamp(work);
    fog_lamps(work);
    reflectors(work);
    flap(work);
    mirror_feet(work);
}

fn is_part(part: P) -> impl Fn(&Facet) -> bool {
    move |facet| facet.part == Some(part)
}

fn emblem(work: &mut Patchwork, parts: &[P], height: f32, ahead: f32) {
    let looks_there = |facet: &Facet| {
        facet.part.is_some_and(|part| parts.contains(&part))
            && facet.corners.iter().all(|corner| corner.normal.z * ahead > 0.3)
    };
    disc(work, Slot::Emblem, looks_there, [0.0, height], EMBLEM);
    work.bend(
        |facet| looks_there(facet) && facet.slot == Slot::Emblem,
        |p, _| V::new(p.x, p.y + height, 0.0) * (0.6 / EMBLEM),
    );
}

/// An octagon round a place to the right (lateral, height), and for places beside the middle the same to the left: its
/// straight bounds cut faces that are larger than itself.
fn disc(
    work: &mut Patchwork,
    slot: Slot,
    concerns: impl Fn(&Facet) -> bool,
    [x, height]: [f32; 2],
    radius: f32,
) {
    let at = |p: &V| [if x == 0.0 { p.x } else { p.x.abs() - x }, -p.y - height];
    let across = |p: &V| at(p)[0];
    let up = |p: &V| at(p)[1];
    let corner = radius * std::f32::consts::SQRT_2 * 0.97;
    work.paint(
        slot,
        concerns,
        &[
            &|p| up(p) - radius,
            &|p| -up(p) - radius,
            &|p| across(p) - radius,
            &|p| -across(p) - radius,
            &|p| across(p) + up(p) - corner,
            &|p| across(p) - up(p) - corner,
            &|p| up(p) - across(p) - corner,
            &|p| -across(p) - up(p) - corner,
        ],
    );
}

/// A strip between two places of the view along the vehicle: lateral and height.
fn strip(work: &mut Patchwork, part: P, [a, b]: [[f32; 2]; 2], half: f32) {
    let [dx, dh] = [b[0] - a[0], b[1] - a[1]];
    let length = dx.hypot(dh).max(1e-3);
    let along = |p: &V| ((p.x - a[0]) * dx + (-p.y - a[1]) * dh) / length;
    let across = |p: &V| ((-p.y - a[1]) * dx - (p.x - a[0]) * dh) / length;
    work.paint(
        Slot::BlackPlastic,
        is_part(part),
        &[&|p| -along(p), &|p| along(p) - length, &|p| across(p) - half, &|p| -across(p) - half],
    );
}

fn wipers(work: &mut Patchwork) {
    if let Some([_, high]) = work.bounds(&[P::WindshieldFront]) {
        let [reach, foot] = [0.86 * high.x, -high.y];
        let blades = [
            [[-0.02 * reach, foot + 0.050], [-0.84 * reach, foot + 0.100]],
            [[0.76 * reach, foot + 0.060], [0.04 * reach, foot + 0.085]],
        ];
        for ends in blades {
            strip(work, P::WindshieldFront, ends, WIPER);
        }
    }
    // Upright panes behind have one, too.
    if let Some([low, high]) = work.bounds(&[P::WindshieldRear])
        && high.z - low.z < 0.7 * (high.y - low.y)
    {
        let foot = -high.y;
        let ends = [[0.0, foot + 0.03], [-0.62 * high.x, foot + 0.065]];
        strip(work, P::WindshieldRear, ends, WIPER);
    }
}

fn third_brake_lamp(work: &mut Patchwork) {
    let Some([low, _]) = work.bounds(&[P::WindshieldRear]) else { return };
    let top = -low.y - 0.035;
    work.paint(
        Slot::HighBrakeLamp,
        is_part(P::WindshieldRear),
        &[&|p| p.x.abs() - 0.13, &|p| -p.y - top, &|p| top - 0.014 + p.y],
    );
}

fn fog_lamps(work: &mut Patchwork) {
    let Some([_, high]) = work.bounds(&[P::ApronFront]) else { return };
    let [x, height] = [0.68 * high.x, -high.y + 0.155];
    let looks_ahead = |facet: &Facet| {
        facet.part == Some(P::ApronFront)
            && facet.corners.iter().all(|corner| corner.normal.z > 0.2)
    };
    for (slot, radius) in [(Slot::BlackPlastic, 0.056), (Slot::HeadLamp, 0.042)] {
        disc(work, slot, looks_ahead, [x, height], radius);
    }
}

fn reflectors(work: &mut Patchwork) {
    let Some([_, high]) = work.bounds(&[P::ApronRear]) else { return };
    let [inner, outer, height] = [0.58 * high.x, 0.78 * high.x, -high.y + 0.20];
    let looks_back = |facet: &Facet| {
        facet.part == Some(P::ApronRear)
            && facet.corners.iter().all(|corner| corner.normal.z < -0.2)
    };
    work.paint(
        Slot::TailLamp,
        looks_back,
        &[&|p| -p.y - height - 0.014, &|p| height - 0.014 + p.y, &|p| inner - p.x.abs(), &|p| {
            p.x.abs() - outer
        }],
    );
}

/// Behind the rear wheel's top on the right.
fn flap(work: &mut Patchwork) {
    let (Some([low, high]), Some([_, belt])) = (
        work.bounds(&[P::WheelRearRight]),
        work.bounds(&[P::GlassRearRight]).or_else(|| work.bounds(&[P::GlassFrontRight])),
    ) else {
        return;
    };
    let [z, height] = [0.5 * (low.z + high.z) - 0.16, -belt.y - 0.10];
    let is_side = |facet: &Facet| facet.part == Some(P::SideRight) && facet.slot == Slot::Paint;
    let square = move |p: &V, half: f32| {
        let [x, y] = [(p.z - z) / half, (-p.y - height) / half];
        half * ((x.powi(4) + y.powi(4)).powf(0.25) - 1.0)
    };
    work.divide_along(is_side, &|p| square(p, 0.068));
    work.paint(Slot::BlackPlastic, is_side, &[&|p| square(p, 0.072), &|p| -square(p, 0.068)]);
}

/// Mirrors stand on black feet.
fn mirror_feet(work: &mut Patchwork) {
    for mirror in [P::MirrorLeft, P::MirrorRight] {
        let Some([low, high]) = work.bounds(&[mirror]) else { continue };
        let edge = -high.y + 0.30 * (high.y - low.y);
        work.paint(
            Slot::BlackPlastic,
            |facet| facet.part == Some(mirror) && facet.slot == Slot::Paint,
            &[&|p| -p.y - edge],
        );
    }
}
