//! What the parts are made of in detail, from where they lie.
//!
//! Parts say "front apron"; that its middle is a grille and that a plate hangs below is a matter of place. All places
//! follow from the bounds of the parts, so that any annotated model can be dressed. Heights are above the ground.

use nalgebra::Vector3;
use partpose::parts::{CoarseClass, PartClass as P};

use super::details;
use super::patchwork::{Facet, Patchwork};
use super::relief;
use super::slots::Slot;

/// Half the width and height of a plate (520 mm x 110 mm, the European standard).
const PLATE: [f32; 2] = [0.26, 0.055];
/// Outer radius of the rims as a share of the tyres'.
const RIM: f32 = 0.67;

type V = Vector3<f32>;

/// Gives the facets their slots.
pub(super) fn paint(work: &mut Patchwork) {
    wheels(work);
    underside(work);
    lower_trim(work);
    let grille = front(work);
    rear(work);
    for side in [[P::LightFrontLeft, P::LightRearLeft], [P::LightFrontRight, P::LightRearRight]] {
        head_lamp(work, side[0]);
        tail_lamp(work, side[1]);
    }
    windows(work);
    relief::press(work);
    relief::handles(work);
    details::add(work, grille);
    mirrors(work);
}

fn is_one_of(facet: &Facet, parts: &[P]) -> bool {
    facet.part.is_some_and(|part| parts.contains(&part))
}

fn wheels(work: &mut Patchwork) {
    for part in [P::WheelFrontLeft, P::WheelFrontRight, P::WheelRearLeft, P::WheelRearRight] {
        let Some([low, high]) = work.bounds(&[part]) else { continue };
        let middle = 0.5 * (low + high);
        let radius = RIM * 0.5 * (high.y - low.y);
        let outside = middle.x.signum();
        // A tyre's inner side stays black.
        work.paint(
            Slot::Rim,
            |facet| is_one_of(facet, &[part]) && facet.corners[0].normal.x * outside > -0.5,
            &[&|p| (p.z - middle.z).hypot(p.y - middle.y) - radius, &|p| {
                (middle.x - p.x) * outside
            }],
        );
    }
}

/// Floor, and the tunnels of the wheels.
fn underside(work: &mut Patchwork) {
    let Some([low, high]) = work.bounds(&P::ALL) else { return };
    let half_width = high.x.min(-low.x);
    let axles = [[P::WheelFrontLeft, P::WheelFrontRight], [P::WheelRearLeft, P::WheelRearRight]]
        .map(|wheels| work.bounds(&wheels));
    for i in 0..work.facets.len() {
        let facet = work.facets[i];
        if facet.slot != Slot::Paint {
            continue;
        }
        let (normal, p) = (work.normal(&facet), work.middle(&facet));
        let near_wheel = axles.iter().flatten().any(|[low, high]| {
            let [z, h] = [0.5 * (low.z + high.z), 0.5 * (low.y + high.y)];
            // Bumpers that end by a wheel look away from it.
            let faces = normal.z * (z - p.z) + normal.y * (h - p.y) > -0.05;
            faces && (p.z - z).hypot(p.y - h) < 0.5 * (high.y - low.y) + 0.12
        });
        let looks_down = normal.y > 0.45 && p.y > -0.55;
        let in_tunnel = near_wheel && p.x.abs() < 0.80 * half_width && normal.y > -0.2;
        let lip = near_wheel && normal.x.abs() < 0.35 && normal.y > 0.0;
        if looks_down || in_tunnel || lip {
            work.facets[i].slot = Slot::Underside;
        }
    }
}

fn lower_trim(work: &mut Patchwork) {
    let body = [P::SideLeft, P::SideRight, P::ApronFront, P::ApronRear];
    let Some([_, high]) = work.bounds(&body) else { return };
    let edge = -high.y + 0.10;
    work.paint(
        Slot::LowerTrim,
        |facet| facet.slot == Slot::Paint && is_one_of(facet, &body),
        &[&|p| -p.y - edge],
    );
}

/// Grille, air intake and plate; gives the height of the grille's middle.
fn front(work: &mut Patchwork) -> f32 {
    let Some([low, high]) = work.bounds(&[P::ApronFront]) else { return 0.5 };
    let ground = -high.y;
    let lamps = work.bounds(&[P::LightFrontRight]);
    let [inner, lamp_low, lamp_high] = lamps.map_or([0.4, ground + 0.4, ground + 0.5], |[a, b]| {
        [a.x.max(0.2), -b.y, (-a.y).min(-low.y)]
    });
    let half_width = high.x;
    let ahead = high.z - 0.45;
    let is_front = |facet: &Facet| is_one_of(facet, &[P::ApronFront, P::Hood]);
    let is_ahead = move |p: &V| ahead - p.z;
    let upper = [lamp_low + 0.015, (lamp_high - 0.035).min(lamp_low + 0.20)];
    let reach = inner - 0.03;
    for (slot, grow) in [(Slot::Frame, 0.012), (Slot::Grille, 0.0)] {
        let trapezium = move |p: &V| p.x.abs() - (reach + grow) - 0.25 * (-p.y - upper[1]);
        work.paint(
            slot,
            is_front,
            &[&is_ahead, &trapezium, &|p| upper[0] - grow + p.y, &|p| -p.y - upper[1] - grow],
        );
    }
    let lower = [ground + 0.09, ground + 0.22];
    for (slot, reach, grow) in [(Slot::BlackPlastic, 0.80, 0.012), (Slot::Grille, 0.52, 0.0)] {
        let edge = reach * half_width;
        work.paint(
            slot,
            is_front,
            &[
                &is_ahead,
                &|p| p.x.abs() - edge - 0.3 * (-p.y - lower[1]),
                &|p| lower[0] - grow + p.y,
                &|p| -p.y - lower[1] - grow,
            ],
        );
    }
    let middle = (0.5 * (lower[1] + upper[0])).max(lower[1] + 0.03);
    work.plates[0] = middle;
    plate(work, &[P::ApronFront], middle, 1.0);
    0.5 * (upper[0] + upper[1])
}

fn rear(work: &mut Patchwork) {
    let apron = work.bounds(&[P::ApronRear]);
    if let Some([_, high]) = apron {
        let edge = -high.y + 0.15;
        let inner = 0.72 * high.x;
        work.paint(
            Slot::BlackPlastic,
            |facet| is_one_of(facet, &[P::ApronRear]),
            &[&|p| -p.y - edge, &|p| p.x.abs() - inner, &|p| p.z],
        );
    }
    let trunk = work.bounds(&[P::Trunk]).filter(|[_, high]| -high.y < 0.95);
    let (part, middle) = match (trunk, apron) {
        (Some([low, high]), _) => (P::Trunk, (-high.y + 0.15).min(-0.5 * (low.y + high.y))),
        (None, Some([low, high])) => (P::ApronRear, -0.5 * (low.y + high.y)),
        (None, None) => return,
    };
    work.plates[1] = middle;
    plate(work, &[part], middle, -1.0);
}

fn plate(work: &mut Patchwork, parts: &[P], middle: f32, ahead: f32) {
    for (slot, grow) in [(Slot::BlackPlastic, 0.008), (Slot::Plate, 0.0)] {
        work.paint(
            slot,
            |facet| {
                is_one_of(facet, parts) && facet.corners.iter().all(|c| c.normal.z * ahead > 0.2)
            },
            &[
                &|p| p.x - PLATE[0] - grow,
                &|p| -p.x - PLATE[0] - grow,
                &|p| p.y + middle - PLATE[1] - grow,
                &|p| -p.y - middle - PLATE[1] - grow,
            ],
        );
    }
}

fn head_lamp(work: &mut Patchwork, part: P) {
    let Some([low, high]) = work.bounds(&[part]) else { return };
    let size = high - low;
    let side = (low.x + high.x).signum();
    let inner = if side > 0.0 { low.x } else { -high.x };
    let h = -0.5 * (low.y + high.y);
    let is_lamp = |facet: &Facet| is_one_of(facet, &[part]);
    // Dark housing all round, an indicator at the outer end, two reflectors, a strip of daytime light below.
    work.paint(
        Slot::Daytime,
        is_lamp,
        &[&|p| -p.y - (-high.y + 0.17 * size.y), &|p| (-high.y + 0.06 * size.y) + p.y, &|p| {
            (low.z + 0.45 * size.z) - p.z
        }],
    );
    let indicator = if side < 0.0 { Slot::FrontIndicatorLeft } else { Slot::FrontIndicatorRight };
    work.paint(
        indicator,
        is_lamp,
        &[&|p| p.z - (low.z + 0.24 * size.z), &|p| (-high.y + 0.30 * size.y) + p.y],
    );
    let radius = (0.30 * size.y).min(0.2 * size.x).max(0.03);
    for share in [0.34, 0.70] {
        let x = inner + share * size.x;
        let drop = h + 0.12 * size.y * share;
        work.paint(Slot::HeadCore, is_lamp, &[&|p| (p.x * side - x).hypot(-p.y - drop) - radius]);
        // A bowl: its edge looks towards its middle.
        work.bend(
            |facet| is_lamp(facet) && facet.slot == Slot::HeadCore,
            |p, _| {
                let away = V::new(p.x - x * side, p.y + drop, 0.0) / radius;
                if away.norm_squared() < 1.3 { -0.9 * away } else { V::zeros() }
            },
        );
    }
}

fn tail_lamp(work: &mut Patchwork, part: P) {
    let Some([low, high]) = work.bounds(&[part]) else { return };
    let size = high - low;
    let side = (low.x + high.x).signum();
    let is_lamp = |facet: &Facet| is_one_of(facet, &[part]);
    let level = move |share: f32| -high.y + share * size.y;
    let middle = 0.5 * (low.x + high.x).abs();
    work.paint(Slot::BrakeLamp, is_lamp, &[&|p| level(0.50) + p.y, &|p| -p.y - level(0.90)]);
    let indicator = if side < 0.0 { Slot::RearIndicatorLeft } else { Slot::RearIndicatorRight };
    work.paint(
        indicator,
        is_lamp,
        &[&|p| -p.y - level(0.36), &|p| level(0.14) + p.y, &|p| middle - p.x * side],
    );
    work.paint(
        Slot::Reverse,
        is_lamp,
        &[&|p| -p.y - level(0.36), &|p| level(0.14) + p.y, &|p| p.x * side - middle + 0.01],
    );
}

fn windows(work: &mut Patchwork) {
    for (part, below, above) in [(P::WindshieldFront, 0.055, 0.03), (P::WindshieldRear, 0.03, 0.03)]
    {
        let Some([low, high]) = work.bounds(&[part]) else { continue };
        let is_glass = |facet: &Facet| is_one_of(facet, &[part]);
        work.paint(Slot::Frit, is_glass, &[&|p| -p.y - (-high.y + below)]);
        work.paint(Slot::Frit, is_glass, &[&|p| -low.y - above + p.y]);
    }
    for [front, rear, side] in [
        [P::GlassFrontLeft, P::GlassRearLeft, P::SideLeft],
        [P::GlassFrontRight, P::GlassRearRight, P::SideRight],
    ] {
        let (Some([front_low, front_high]), Some([_, rear_high])) =
            (work.bounds(&[front]), work.bounds(&[rear]))
        else {
            continue;
        };
        let from = front_low.z.min(rear_high.z) - 0.03;
        let to = front_low.z.max(rear_high.z) + 0.03;
        work.paint(
            Slot::Pillar,
            |facet| is_one_of(facet, &[side]) && facet.slot == Slot::Paint,
            &[&|p| p.y - front_high.y, &|p| front_low.y - p.y, &|p| from - p.z, &|p| p.z - to],
        );
    }
}

fn mirrors(work: &mut Patchwork) {
    for i in 0..work.facets.len() {
        let facet = work.facets[i];
        if is_one_of(&facet, &[P::MirrorLeft, P::MirrorRight]) && work.normal(&facet).z < -0.75 {
            work.facets[i].slot = Slot::MirrorGlass;
        }
    }
    debug_assert_eq!(P::MirrorLeft.coarse(), CoarseClass::Body, "mirrors are no glass");
}
