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
    let girth = rng.random_range(0.9_f32..1.2);
    // A jacket reaches over the hips, a coat to the knees.
    let hem = [0.02, 0.12, 0.42][rng.random_range(0..3)];
    let hip = p(0.0, -0.92, 0.0);
    for (side, swing) in [(-1.0_f32, stride), (1.0, -stride)] {
        leg(&mut shape, hip + V::new(0.085 * side, 0.0, 0.0), swing, skirt);
        arm(&mut shape, p(0.195 * girth * side, -1.43, -0.01), side, swing);
    }
    if skirt {
        let ring = |down: f32, half: [f32; 2]| (hip + V::y() * down, half);
        shape.loft(&[ring(0.45, [0.24, 0.22]), ring(-0.14, [0.15, 0.11])], 10, TROUSERS);
    }
    torso(&mut shape, hip, girth, if skirt { 0.02 } else { hem });
    head(&mut shape, hip - V::y() * 0.70, rng.random_range(0.0_f32..1.0));
    if rng.random_bool(0.35) {
        // A rucksack.
        let ring = |y: f32, half: [f32; 2]| (p(0.0, y, -0.2), half);
        let rings = [ring(-1.02, [0.13, 0.07]), ring(-1.1, [0.16, 0.1]), ring(-1.4, [0.14, 0.09])];
        shape.loft(&rings, 8, HAIR);
    }
    Prop { mesh: shape.finish(), materials: clothes(&mut rng), class: SegmentClass::Misc }
}

/// Hips in trousers and what is worn over them, from the hem to the neck.
fn torso(shape: &mut Shape, hip: P, girth: f32, hem: f32) {
    let ring = |up: f32, width: f32, depth: f32, ahead: f32| {
        (hip + V::new(0.0, -up, ahead), [width * girth, depth * girth])
    };
    let hips =
        [ring(-0.12, 0.12, 0.09, 0.0), ring(0.0, 0.165, 0.115, -0.01), ring(0.14, 0.15, 0.1, 0.0)];
    shape.loft(&hips, 10, TROUSERS);
    let flare = 0.178 + 0.12 * hem;
    let rings = [
        ring(-hem, flare, 0.125 + 0.1 * hem, -0.01),
        ring(0.10, 0.166, 0.118, 0.0),
        ring(0.22, 0.158, 0.112, 0.005),
        ring(0.36, 0.178, 0.122, 0.012),
        ring(0.46, 0.19, 0.115, 0.0),
        ring(0.525, 0.165, 0.09, -0.01),
        ring(0.565, 0.085, 0.065, -0.005),
        ring(0.60, 0.06, 0.06, 0.005),
    ];
    shape.loft(&rings, 12, TOP);
}

/// Neck, a face with chin, nose and brow, ears, and hair, `long` or short.
fn head(shape: &mut Shape, at: P, long: f32) {
    let ring = |up: f32, ahead: f32, width: f32, depth: f32| {
        (at + V::new(0.0, -up, ahead), [width, depth])
    };
    shape.tube(
        [at + V::new(0.0, 0.16, -0.02), at + V::new(0.0, 0.05, -0.005)],
        [0.058, 0.05],
        8,
        SKIN,
    );
    let face = [
        ring(-0.115, 0.03, 0.028, 0.035),
        ring(-0.085, 0.022, 0.05, 0.062),
        ring(-0.03, 0.008, 0.066, 0.085),
        ring(0.03, 0.002, 0.074, 0.096),
        ring(0.085, -0.005, 0.068, 0.09),
        ring(0.12, -0.01, 0.04, 0.055),
    ];
    shape.loft(&face, 10, SKIN);
    shape.ellipsoid(at + V::new(0.0, 0.02, 0.096), V::new(0.012, 0.026, 0.018), 3, SKIN);
    for side in [-1.0, 1.0] {
        shape.ellipsoid(at + V::new(0.076 * side, 0.005, -0.01), V::new(0.01, 0.03, 0.02), 3, SKIN);
    }
    let back = if long > 0.55 { -0.16 } else { -0.06 };
    let hair = [
        ring(back, -0.06, 0.062, 0.045),
        ring(-0.02, -0.042, 0.08, 0.066),
        ring(0.05, -0.026, 0.084, 0.086),
        ring(0.095, -0.012, 0.078, 0.098),
        ring(0.13, -0.014, 0.05, 0.066),
        ring(0.14, -0.016, 0.02, 0.03),
    ];
    shape.loft(&hair, 10, HAIR);
}

/// An arm that hangs from the shoulder, bent at the elbow, with a hand.
fn arm(shape: &mut Shape, shoulder: P, side: f32, swing: f32) {
    let elbow = shoulder + V::new(0.045 * side, 0.28, swing * 0.35);
    let wrist = elbow + V::new(-0.01 * side, 0.23, swing * 0.4 + 0.05);
    let middle = elbow + (shoulder - elbow) * 0.5;
    let rings = [
        (wrist, [0.036, 0.038]),
        (elbow + (wrist - elbow) * 0.45, [0.043, 0.046]),
        (elbow, [0.046, 0.05]),
        (middle, [0.053, 0.06]),
        (shoulder + V::new(0.0, 0.03, 0.0), [0.062, 0.07]),
        (shoulder - V::new(0.02 * side, 0.035, 0.0), [0.035, 0.045]),
    ];
    shape.loft(&rings, 8, TOP);
    let hand = [
        (wrist + V::new(0.0, 0.15, 0.03), [0.014, 0.025]),
        (wrist + V::new(0.0, 0.09, 0.02), [0.022, 0.042]),
        (wrist - V::y() * 0.02, [0.024, 0.03]),
    ];
    shape.loft(&hand, 6, SKIN);
}

/// A leg with thigh, knee and calf, and a shoe.
fn leg(shape: &mut Shape, hip: P, swing: f32, bare: bool) {
    let knee = hip + V::new(0.0, 0.44, swing * 0.45);
    let foot = knee + V::new(0.0, 0.42 - swing.abs() * 0.1, swing * 0.5 - 0.05 * swing.abs());
    let part = |a: P, b: P, share: f32| a + (b - a) * share;
    let thigh = [
        (knee, [0.056, 0.062]),
        (part(knee, hip, 0.5), [0.072, 0.08]),
        (hip - V::y() * 0.04, [0.088, 0.1]),
    ];
    shape.loft(&thigh, 8, TROUSERS);
    let calf = if bare { [0.03, 0.034, 0.05, 0.056] } else { [0.052, 0.05, 0.056, 0.062] };
    let lower = [
        (foot, [calf[0], calf[0] * 1.15]),
        (part(foot, knee, 0.25), [calf[1], calf[1] * 1.15]),
        (part(foot, knee, 0.65) - V::z() * 0.015, [calf[2], calf[2] * 1.15]),
        (knee - V::y() * 0.02, [calf[3] * 0.95, calf[3]]),
    ];
    shape.loft(&lower, 8, if bare { SKIN } else { TROUSERS });
    let shoe = [
        (foot + V::new(0.0, 0.06, 0.07), [0.046, 0.135]),
        (foot + V::new(0.0, 0.035, 0.07), [0.048, 0.137]),
        (foot + V::new(0.0, -0.005, 0.035), [0.04, 0.09]),
        (foot + V::new(0.0, -0.04, 0.0), [0.04, 0.048]),
    ];
    shape.loft(&shoe, 8, SHOES);
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

/// A bicycle that stands along z.
pub(crate) fn bicycle(seed: u64) -> Prop {
    let mut shape = Shape::default();
    frame(&mut shape);
    let mut rng = random(seed, &[0xb1c]);
    Prop { mesh: shape.finish(), materials: clothes(&mut rng), class: SegmentClass::Misc }
}

const CRANK: P = P::new(0.0, -0.30, -0.05);
const SEAT: P = P::new(0.0, -0.95, -0.20);
const BAR: P = P::new(0.0, -0.98, 0.40);

/// Wheels, frame, bar and saddle.
fn frame(shape: &mut Shape) {
    let (rear, front) = (p(0.0, -0.34, -0.52), p(0.0, -0.34, 0.52));
    for axle in [rear, front] {
        wheel(shape, axle, 0.33);
    }
    for (a, b) in [
        (rear, CRANK),
        (rear, SEAT),
        (CRANK, SEAT),
        (CRANK, BAR),
        (SEAT + V::y() * 0.12, BAR),
        (front, BAR),
    ] {
        shape.tube([a, b], [0.018, 0.018], 5, FRAME);
    }
    shape.tube([BAR - V::x() * 0.28, BAR + V::x() * 0.28], [0.014, 0.014], 5, 6);
    shape.ellipsoid(SEAT - V::y() * 0.03, V::new(0.07, 0.03, 0.13), 4, 6);
}

/// Somebody who rides a bicycle along z.
pub(crate) fn cyclist(seed: u64) -> Prop {
    let mut rng = random(seed, &[0xc7c1]);
    let mut shape = Shape::default();
    frame(&mut shape);
    let phase = rng.random_range(0.0_f32..std::f32::consts::TAU);
    for (side, turn) in [(-1.0_f32, phase), (1.0, phase + std::f32::consts::PI)] {
        let hip = SEAT + V::new(0.09 * side, -0.08, 0.02);
        let pedal = CRANK + V::new(0.1 * side, 0.17 * turn.sin(), 0.17 * turn.cos());
        let knee = p(0.11 * side, 0.5 * (hip.y + pedal.y) - 0.12, 0.5 * (hip.z + pedal.z) + 0.25);
        shape.tube([hip, knee], [0.085, 0.06], 8, TROUSERS);
        shape.tube([knee, pedal], [0.058, 0.042], 8, TROUSERS);
        shape.ellipsoid(pedal + V::new(0.0, -0.02, 0.04), V::new(0.045, 0.04, 0.12), 4, SHOES);
        let (shoulder, hand) = (p(0.18 * side, -1.46, 0.10), BAR + V::new(0.25 * side, -0.02, 0.0));
        let elbow = shoulder + (hand - shoulder) * 0.5 + V::new(0.03 * side, 0.05, 0.0);
        shape.tube([shoulder, elbow], [0.055, 0.044], 8, TOP);
        shape.tube([elbow, hand], [0.043, 0.034], 8, TOP);
        shape.ellipsoid(hand, V::new(0.03, 0.035, 0.045), 4, SKIN);
    }
    let ring = |y: f32, z: f32, half: [f32; 2]| (p(0.0, y, z), half);
    let back = [
        ring(-0.88, -0.2, [0.16, 0.13]),
        ring(-1.05, -0.15, [0.155, 0.115]),
        ring(-1.3, 0.0, [0.185, 0.125]),
        ring(-1.44, 0.08, [0.19, 0.11]),
        ring(-1.51, 0.11, [0.15, 0.08]),
        ring(-1.55, 0.13, [0.065, 0.06]),
    ];
    shape.loft(&back, 12, TOP);
    head(&mut shape, p(0.0, -1.70, 0.18), 0.0);
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
