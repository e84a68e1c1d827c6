//! People on foot and on bicycles: low figures in clothes, enough to be passed at a distance.

use std::sync::Arc;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::random;
use super::shapes::{P, Shape, V, p};
use super::stuff::{Prop, matt, metal, smooth};
use crate::scene::{Material, SegmentClass};

const SKIN: u16 = 0;
const TOP: u16 = 1;
const TROUSERS: u16 = 2;
const SHOES: u16 = 3;
const HAIR: u16 = 4;
const FRAME: u16 = 5;

/// Somebody who walks along z, in one moment of the stride; `seed` chooses figure and clothes.
pub(crate) fn pedestrian(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x9ed]);
    let mut shape = Shape::default();
    let stride = rng.random_range(-0.38_f32..0.38);
    let skirt = rng.random_bool(0.2);
    let hip = p(0.0, -0.92, 0.0);
    for (side, swing) in [(-1.0_f32, stride), (1.0, -stride)] {
        leg(&mut shape, hip + V::new(0.09 * side, 0.0, 0.0), swing, skirt);
        let shoulder = p(0.20 * side, -1.42, 0.0);
        let elbow = shoulder + V::new(0.04 * side, 0.28, swing * 0.35);
        let hand = elbow + V::new(0.0, 0.24, swing * 0.4 - 0.02 + 0.06);
        shape.tube([shoulder, elbow], [0.055, 0.045], 6, TOP);
        shape.tube([elbow, hand], [0.042, 0.032], 6, TOP);
        shape.ellipsoid(hand, V::new(0.035, 0.06, 0.045), 4, SKIN);
    }
    if skirt {
        shape.tube([hip - V::y() * 0.12, hip + V::y() * 0.42], [0.15, 0.26], 10, TROUSERS);
    }
    torso(&mut shape, hip);
    if rng.random_bool(0.35) {
        // A bag or a rucksack.
        shape.ellipsoid(p(0.0, -1.25, -0.18), V::new(0.14, 0.2, 0.09), 5, HAIR);
    }
    Prop { mesh: shape.finish(), materials: clothes(&mut rng), class: SegmentClass::Misc }
}

fn torso(shape: &mut Shape, hip: P) {
    shape.ellipsoid(hip - V::y() * 0.02, V::new(0.165, 0.14, 0.12), 5, TROUSERS);
    shape.ellipsoid(hip - V::y() * 0.30, V::new(0.185, 0.30, 0.125), 6, TOP);
    shape.ellipsoid(hip - V::y() * 0.47, V::new(0.215, 0.10, 0.11), 5, TOP);
    head(shape, hip - V::y() * 0.70);
}

fn head(shape: &mut Shape, at: P) {
    shape.tube([at + V::y() * 0.14, at], [0.055, 0.055], 6, SKIN);
    shape.ellipsoid(at, V::new(0.078, 0.12, 0.095), 6, SKIN);
    shape.ellipsoid(at + V::new(0.0, -0.035, -0.018), V::new(0.086, 0.10, 0.098), 6, HAIR);
}

fn leg(shape: &mut Shape, hip: P, swing: f32, bare: bool) {
    let knee = hip + V::new(0.0, 0.44, swing * 0.45);
    let foot = knee + V::new(0.0, 0.42 - swing.abs() * 0.1, swing * 0.5 - 0.05 * swing.abs());
    shape.tube([hip, knee], [0.085, 0.06], 7, TROUSERS);
    shape.tube([knee, foot], [0.06, 0.042], 7, if bare { SKIN } else { TROUSERS });
    shape.ellipsoid(foot + V::new(0.0, 0.02, 0.06), V::new(0.045, 0.045, 0.13), 4, SHOES);
}

fn clothes(rng: &mut ChaCha8Rng) -> Arc<[Material]> {
    let skin = [[0.50, 0.31, 0.22], [0.42, 0.24, 0.15], [0.20, 0.11, 0.07], [0.09, 0.05, 0.035]]
        [rng.random_range(0..4)];
    let mut cloth = |dark: f32| {
        let hue = rng.random_range(0..6);
        let bright = rng.random_range(0.02_f32..0.35) * dark;
        let tint = [
            [1.0, 1.0, 1.0],
            [1.0, 0.3, 0.25],
            [0.3, 0.45, 1.0],
            [0.5, 0.6, 0.4],
            [1.0, 0.85, 0.6],
            [0.4, 0.4, 0.45],
        ][hue];
        matt(tint.map(|value: f32| value * bright + 0.01))
    };
    let (top, trousers, shoes) = (cloth(1.2), cloth(0.45), cloth(0.3));
    let hair = matt(
        [[0.015, 0.012, 0.010], [0.06, 0.035, 0.02], [0.25, 0.18, 0.09], [0.2, 0.2, 0.2]]
            [rng.random_range(0..4)],
    );
    let frame = smooth(
        [[0.3, 0.02, 0.02], [0.02, 0.02, 0.02], [0.05, 0.12, 0.3], [0.4, 0.4, 0.4]]
            [rng.random_range(0..4)],
        0.3,
    );
    [
        matt(skin),
        top,
        trousers,
        shoes,
        hair,
        frame,
        smooth([0.015, 0.015, 0.015], 0.8),
        metal(0.5, 0.35),
    ]
    .into()
}

/// Somebody who rides a bicycle along z.
pub(crate) fn cyclist(seed: u64) -> Prop {
    let mut rng = random(seed, &[0xc7c1]);
    let mut shape = Shape::default();
    for z in [-0.52_f32, 0.52] {
        wheel(&mut shape, p(0.0, -0.34, z), 0.33);
    }
    let (rear, front, crank) = (p(0.0, -0.34, -0.52), p(0.0, -0.34, 0.52), p(0.0, -0.30, -0.05));
    let (seat, bar) = (p(0.0, -0.95, -0.20), p(0.0, -0.98, 0.40));
    for (a, b) in [
        (rear, crank),
        (rear, seat),
        (crank, seat),
        (crank, bar),
        (seat + V::y() * 0.12, bar),
        (front, bar),
    ] {
        shape.tube([a, b], [0.018, 0.018], 5, FRAME);
    }
    shape.tube([bar - V::x() * 0.28, bar + V::x() * 0.28], [0.014, 0.014], 5, 6);
    shape.ellipsoid(seat - V::y() * 0.03, V::new(0.07, 0.03, 0.13), 4, 6);
    let phase = rng.random_range(0.0_f32..std::f32::consts::TAU);
    for (side, turn) in [(-1.0_f32, phase), (1.0, phase + std::f32::consts::PI)] {
        let hip = seat + V::new(0.09 * side, -0.08, 0.02);
        let pedal = crank + V::new(0.1 * side, 0.17 * turn.sin(), 0.17 * turn.cos());
        let knee = p(0.11 * side, 0.5 * (hip.y + pedal.y) - 0.12, 0.5 * (hip.z + pedal.z) + 0.25);
        shape.tube([hip, knee], [0.08, 0.06], 6, TROUSERS);
        shape.tube([knee, pedal], [0.058, 0.04], 6, TROUSERS);
        shape.ellipsoid(pedal + V::new(0.0, -0.02, 0.04), V::new(0.045, 0.04, 0.12), 4, SHOES);
        let (shoulder, hand) = (p(0.19 * side, -1.48, 0.10), bar + V::new(0.25 * side, -0.02, 0.0));
        shape.tube([shoulder, hand], [0.05, 0.035], 6, TOP);
    }
    shape.tube([seat - V::y() * 0.05, p(0.0, -1.48, 0.08)], [0.15, 0.17], 9, TOP);
    shape.ellipsoid(p(0.0, -1.48, 0.09), V::new(0.20, 0.10, 0.12), 5, TOP);
    head(&mut shape, p(0.0, -1.70, 0.18));
    Prop { mesh: shape.finish(), materials: clothes(&mut rng), class: SegmentClass::Misc }
}

/// A thin wheel that rolls along z.
fn wheel(shape: &mut Shape, center: P, radius: f32) {
    let at = |i: u32| {
        let (s, c) = (std::f32::consts::TAU * i as f32 / 14.0).sin_cos();
        center + V::new(0.0, radius * s, radius * c)
    };
    for i in 0..14 {
        shape.tube([at(i), at(i + 1)], [0.02, 0.02], 4, 6);
        if i % 2 == 0 {
            shape.tube([center, at(i)], [0.004, 0.004], 3, 7);
        }
    }
}
