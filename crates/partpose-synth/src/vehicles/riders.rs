//! People in the seats, as far as they show above the windows' lower edges.
//!
//! Three of them are in every surface: who drives, who sits beside, and one behind. Those that are not there have a
//! material that is not drawn. Like all that is inside they have no part: what is seen through glass counts as glass.

use std::f32::consts::TAU;

use nalgebra::Vector3;

use super::patchwork::{Corner, Facet, Patchwork};
use super::slots::Slot;

type V = Vector3<f32>;

/// Corners round a limb, a body, a head.
const SIDES: usize = 8;

/// Materials of somebody: skin, hair and clothes.
pub(super) type Wears = [Slot; 3];

/// Where somebody sits.
pub(super) struct Place {
    /// Lateral.
    pub(super) x: f32,
    /// Front of the head rest.
    pub(super) back: f32,
    /// Height of the middle of the head.
    pub(super) head: f32,
    /// What the hands hold: the middle of the steering wheel, for who drives.
    pub(super) wheel: Option<V>,
}

/// Adds somebody.
pub(super) fn sit(work: &mut Patchwork, place: &Place, [skin, hair, clothes]: Wears) {
    let at = |x: f32, up: f32, ahead: f32| {
        V::new(place.x + x, -(place.head + up), place.back + 0.11 + ahead)
    };
    // Heights from the middle of the head; half widths across and along.
    let head = [
        (-0.20, [0.052, 0.055], -0.01),
        (-0.115, [0.050, 0.060], 0.0),
        (-0.10, [0.048, 0.072], 0.012),
        (-0.03, [0.072, 0.092], 0.005),
        (0.05, [0.077, 0.096], 0.0),
        (0.10, [0.055, 0.070], -0.005),
        (0.122, [0.004, 0.004], -0.005),
    ];
    let middle = at(0.0, 0.0, 0.0);
    lathe(work, &head.map(|(up, half, ahead)| (at(0.0, up, ahead), half)), |p| {
        // The hairline runs from the forehead to the nape.
        let [up, ahead] = [middle.y - p.y, p.z - middle.z];
        if up > 0.85 * ahead && up > -0.10 { hair } else { skin }
    });
    let body = [
        (-0.66, [0.18, 0.12], 0.0),
        (-0.46, [0.18, 0.12], 0.03),
        (-0.26, [0.215, 0.105], 0.02),
        (-0.205, [0.195, 0.085], 0.01),
        (-0.17, [0.11, 0.065], 0.0),
        (-0.145, [0.055, 0.055], -0.005),
    ];
    lathe(work, &body.map(|(up, half, ahead)| (at(0.0, up, ahead), half)), |_| clothes);
    for side in [-1.0, 1.0] {
        let shoulder = at(0.20 * side, -0.235, 0.01);
        let (elbow, hand) = match place.wheel {
            Some(wheel) => {
                let hand = wheel + V::new(0.165 * side, -0.05, -0.02);
                (shoulder.lerp(&hand, 0.5) + V::new(0.05 * side, 0.12, -0.02), hand)
            }
            None => (at(0.24 * side, -0.50, 0.08), at(0.10 * side, -0.62, 0.30)),
        };
        limb(work, [shoulder, elbow], [0.058, 0.046], clothes);
        limb(work, [elbow, hand], [0.045, 0.034], clothes);
        limb(work, [hand, hand + V::new(-0.02 * side, -0.06, 0.04)], [0.040, 0.030], skin);
    }
}

/// A skin over level rings, from below: their middles and half widths.
fn lathe(work: &mut Patchwork, rings: &[(V, [f32; 2])], slot: impl Fn(&V) -> Slot) {
    let point = |(middle, half): (V, [f32; 2]), step: usize| {
        let (sin, cos) = (TAU * step as f32 / SIDES as f32).sin_cos();
        (
            middle + V::new(half[0] * cos, 0.0, half[1] * sin),
            V::new(half[1] * cos, 0.0, half[0] * sin),
        )
    };
    let slope = |i: usize| {
        // How fast the skin widens upwards, for its normals.
        let [low, high] = [rings[i.saturating_sub(1)], rings[(i + 1).min(rings.len() - 1)]];
        (high.1[0] - low.1[0]) / (low.0.y - high.0.y).max(1e-3)
    };
    let rings: Vec<Vec<(V, V)>> = rings
        .iter()
        .enumerate()
        .map(|(i, ring)| {
            let tilt = V::new(0.0, slope(i), 0.0);
            let side = |step| {
                let (p, normal) = point(*ring, step);
                (p, (normal.try_normalize(1e-6).unwrap_or_default() + tilt).normalize())
            };
            (0..SIDES).map(side).collect()
        })
        .collect();
    skin(work, &rings, slot);
}

/// A tapering tube.
fn limb(work: &mut Patchwork, [from, to]: [V; 2], radii: [f32; 2], slot: Slot) {
    let along = (to - from).normalize();
    let across = along.cross(&V::new(0.1, 0.3, 1.0)).normalize();
    let other = along.cross(&across);
    let ring = |middle: V, radius: f32| {
        let side = |step: usize| {
            let (sin, cos) = (TAU * step as f32 / SIDES as f32).sin_cos();
            let normal = across * cos + other * sin;
            (middle + normal * radius, normal)
        };
        (0..SIDES).map(side).collect::<Vec<_>>()
    };
    skin(work, &[ring(from, radii[0]), ring(to, radii[1])], |_| slot);
}

/// Facets between neighbouring rings of points with their normals, which decide which side is outside.
fn skin(work: &mut Patchwork, rings: &[Vec<(V, V)>], slot: impl Fn(&V) -> Slot) {
    let start = work.points.len() as u32;
    work.points.extend(rings.iter().flatten().map(|(p, _)| *p));
    let corner = |ring: usize, step: usize| {
        let step = step % SIDES;
        Corner { point: start + (ring * SIDES + step) as u32, normal: rings[ring][step].1 }
    };
    for ring in 1..rings.len() {
        for step in 0..SIDES {
            let [a, b] = [corner(ring - 1, step), corner(ring - 1, step + 1)];
            let [c, d] = [corner(ring, step + 1), corner(ring, step)];
            for mut corners in [[a, b, c], [a, c, d]] {
                let [p, q, r] = corners.map(|corner| work.points[corner.point as usize]);
                let outside = corners.iter().map(|corner| corner.normal).sum::<V>();
                if (q - p).cross(&(r - p)).dot(&outside) < 0.0 {
                    corners.swap(1, 2);
                }
                let middle = (p + q + r) / 3.0;
                work.facets.push(Facet { corners, part: None, slot: slot(&middle) });
            }
        }
    }
}
