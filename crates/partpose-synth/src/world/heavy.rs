//! Lorries and buses: other traffic that bears no part labels.
//!
//! Frames are those of vehicles: x to the right, y down, z forward, origin on the ground under the middle.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::random;
use super::shapes::{Shape, V, p};
use super::stuff::{Prop, dark_glass, metal, shade, smooth};
use crate::scene::{Material, SegmentClass};

const PAINT: u16 = 0;
const BOX: u16 = 1;
const GLASS: u16 = 2;
const TYRE: u16 = 3;
const STEEL: u16 = 4;
const BLACK: u16 = 5;
const TAIL: u16 = 6;
const LAMP: u16 = 7;
const STRIPE: u16 = 8;

/// A lorry, an articulated lorry, a bus or a coach.
pub(crate) fn heavy(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x6ea7]);
    let mut shape = Shape::default();
    match rng.random_range(0..4) {
        0 => bus(&mut shape, &mut rng),
        1 => articulated(&mut shape),
        _ => lorry(&mut shape, &mut rng),
    }
    Prop { mesh: shape.finish(), materials: materials(&mut rng), class: SegmentClass::Truck }
}

fn materials(rng: &mut ChaCha8Rng) -> std::sync::Arc<[Material]> {
    const PAINTS: [[f32; 3]; 7] = [
        [0.70, 0.70, 0.68],
        [0.45, 0.02, 0.02],
        [0.02, 0.07, 0.28],
        [0.60, 0.38, 0.02],
        [0.04, 0.16, 0.06],
        [0.30, 0.31, 0.32],
        [0.02, 0.22, 0.28],
    ];
    let paint = PAINTS[rng.random_range(0..7)];
    let cargo = if rng.random_bool(0.6) {
        [0.68, 0.68, 0.66]
    } else {
        shade(PAINTS[rng.random_range(0..7)], 0.9)
    };
    let gloss = |color| Material { clear_coat: 0.6, dirt: 0.25, ..smooth(color, 0.4) };
    [
        gloss(paint),
        Material { dirt: 0.35, ..smooth(cargo, 0.6) },
        dark_glass(),
        smooth([0.012, 0.012, 0.012], 0.9),
        metal(0.4, 0.45),
        smooth([0.02, 0.02, 0.022], 0.6),
        smooth([0.35, 0.01, 0.012], 0.25),
        smooth([0.7, 0.7, 0.7], 0.1),
        gloss(PAINTS[rng.random_range(0..7)]),
    ]
    .into()
}

fn lorry(shape: &mut Shape, rng: &mut ChaCha8Rng) {
    let length = rng.random_range(6.2_f32..9.0);
    let (front, rear) = (0.5 * length, -0.5 * length);
    let half = rng.random_range(1.05_f32..1.24);
    let height = rng.random_range(2.7_f32..3.6);
    cab(shape, front, half, height.min(2.75));
    let stripe = rng
        .random_bool(0.5)
        .then(|| [rng.random_range(0.5_f32..0.75), rng.random_range(0.25_f32..0.8)]);
    cargo(shape, stripe, [rear + 0.1, front - 1.9], half, height);
    shape.block(p(-0.45, -0.95, rear + 0.2), p(0.45, -0.6, front - 0.4), BLACK);
    for z in [front - 1.2, rear + 1.4] {
        axle(shape, z, half, 0.48);
    }
    rear_end(shape, rear, half);
}

fn articulated(shape: &mut Shape) {
    let length = 15.5;
    let (front, rear) = (0.5 * length, -0.5 * length);
    cab(shape, front, 1.24, 3.6);
    cargo(shape, None, [rear + 0.1, front - 2.7], 1.26, 3.95);
    shape.block(p(-0.5, -1.1, rear + 0.2), p(0.5, -0.6, front - 0.4), BLACK);
    for z in [front - 1.4, front - 4.6, rear + 1.6, rear + 2.9, rear + 4.2] {
        axle(shape, z, 1.24, 0.50);
    }
    for side in [-1.0_f32, 1.0] {
        let x = side * 1.2;
        shape.block(p(x - 0.02, -1.0, rear + 5.2), p(x + 0.02, -0.45, front - 5.6), STEEL);
    }
    rear_end(shape, rear, 1.26);
}

fn cab(shape: &mut Shape, front: f32, half: f32, height: f32) {
    let back = front - 1.8;
    let (waist, brow) = (-1.75_f32.min(height - 0.6), -height + 0.35);
    shape.block(p(-half, waist, back), p(half, -0.45, front), PAINT);
    // Above the waist the front leans back.
    let lean = 0.22;
    let corners = |x: f32| {
        [
            p(x, waist, front),
            p(x, brow, front - lean),
            p(x, -height, front - 0.5),
            p(x, -height, back),
        ]
    };
    for side in [-1.0_f32, 1.0] {
        let [a, b, c, d] = corners(side * half);
        shape.panel([a, b, c, d], [0.0, 0.0], V::x() * side, PAINT);
        let e = p(side * half, waist, back);
        shape.panel([a, d, e, e], [0.0, 0.0], V::x() * side, PAINT);
        let x = side * (half + 0.006);
        shape.panel(
            [
                p(x, waist, front - 0.15),
                p(x, brow, front - lean - 0.15),
                p(x, brow, back + 0.7),
                p(x, waist, back + 0.7),
            ],
            [0.0, 0.0],
            V::x() * side,
            GLASS,
        );
        shape.block(
            p(side * (half + 0.05), -height * 0.78, front - 0.25),
            p(side * (half + 0.28), -height * 0.78 + 0.55, front - 0.15),
            BLACK,
        );
        shape.block(
            p(side * (half - 0.42), -0.95, front - 0.02),
            p(side * (half - 0.06), -0.72, front + 0.02),
            LAMP,
        );
    }
    cab_front(shape, [front, back, lean], half, [waist, brow, -height]);
}

/// What of a cab looks forward, up and back; `front`, `back` and how far the windscreen leans back, and heights of its
/// lower and upper edge and of the roof.
fn cab_front(
    shape: &mut Shape,
    [front, back, lean]: [f32; 3],
    half: f32,
    [waist, brow, top]: [f32; 3],
) {
    let (l, r) = (-half, half);
    shape.panel(
        [
            p(l, waist, front),
            p(r, waist, front),
            p(r, brow, front - lean),
            p(l, brow, front - lean),
        ],
        [0.0, 0.0],
        V::z(),
        PAINT,
    );
    let out = V::new(0.0, -0.2, 1.0);
    let (gl, gr) = (-half * 0.93, half * 0.93);
    shape.panel(
        [
            p(gl, waist + 0.05, front + 0.012),
            p(gr, waist + 0.05, front + 0.012),
            p(gr, brow + 0.05, front - lean + 0.014),
            p(gl, brow + 0.05, front - lean + 0.014),
        ],
        [0.0, 0.0],
        out,
        GLASS,
    );
    shape.panel(
        [
            p(l, brow, front - lean),
            p(r, brow, front - lean),
            p(r, top, front - 0.5),
            p(l, top, front - 0.5),
        ],
        [0.0, 0.0],
        out,
        PAINT,
    );
    shape.panel(
        [p(l, top, front - 0.5), p(r, top, front - 0.5), p(r, top, back), p(l, top, back)],
        [0.0, 0.0],
        -V::y(),
        PAINT,
    );
    shape.panel(
        [p(l, waist, back), p(r, waist, back), p(r, top, back), p(l, top, back)],
        [0.0, 0.0],
        -V::z(),
        PAINT,
    );
    shape.block(p(l * 0.8, -1.5, front), p(r * 0.8, -1.05, front + 0.03), BLACK);
    shape.block(p(l, -0.6, front - 0.1), p(r, -0.35, front + 0.06), BLACK);
}

/// A box with doors at the back; the stripe is given by its height as a share and its width.
fn cargo(
    shape: &mut Shape,
    stripe: Option<[f32; 2]>,
    [back, front]: [f32; 2],
    half: f32,
    height: f32,
) {
    shape.block(p(-half, -height, back), p(half, -1.05, front), BOX);
    if let Some([share, tall]) = stripe {
        let y = -height * share;
        let x = half + 0.006;
        shape.block(p(-x, y - tall, back + 0.5), p(x, y, front - 0.5), STRIPE);
    }
    // The frame of the doors and their bars.
    let z = back - 0.01;
    for x in [-half + 0.04, half - 0.04, 0.0] {
        shape.block(p(x - 0.04, -height, z - 0.03), p(x + 0.04, -1.05, z), STEEL);
    }
    for x in [-0.5 * half, -0.25 * half, 0.25 * half, 0.5 * half] {
        shape.tube([p(x, -height + 0.1, z - 0.03), p(x, -1.1, z - 0.03)], [0.02, 0.02], 5, STEEL);
    }
    shape.block(p(-half, -height, z - 0.03), p(half, -height + 0.1, z), STEEL);
}

fn rear_end(shape: &mut Shape, rear: f32, half: f32) {
    shape.block(p(-half * 0.95, -0.62, rear + 0.05), p(half * 0.95, -0.46, rear + 0.15), BLACK);
    for side in [-1.0_f32, 1.0] {
        let x = side * (half - 0.25);
        shape.block(p(x - 0.18, -0.98, rear + 0.02), p(x + 0.18, -0.82, rear + 0.1), TAIL);
        shape.block(p(x - 0.3, -0.85, rear + 0.9), p(x + 0.3, -0.2, rear + 0.92), BLACK);
    }
    shape.block(p(-0.26, -0.80, rear + 0.03), p(0.26, -0.69, rear + 0.05), LAMP);
}

fn axle(shape: &mut Shape, z: f32, half: f32, radius: f32) {
    for side in [-1.0_f32, 1.0] {
        let (inner, outer) = (side * (half - 0.45), side * (half - 0.02));
        shape.tube([p(inner, -radius, z), p(outer, -radius, z)], [radius, radius], 16, TYRE);
        shape.tube(
            [p(outer, -radius, z), p(outer + side * 0.015, -radius, z)],
            [radius * 0.58, radius * 0.5],
            12,
            STEEL,
        );
    }
}

fn bus(shape: &mut Shape, rng: &mut ChaCha8Rng) {
    let length = rng.random_range(10.5_f32..12.2);
    let (front, rear) = (0.5 * length, -0.5 * length);
    let (half, height) = (1.26, rng.random_range(2.95_f32..3.5));
    shape.block(p(-half, -height, rear), p(half, -0.32, front), PAINT);
    let x = half + 0.006;
    shape.block(p(-x, -0.75, rear + 0.1), p(x, -0.5, front - 0.1), STRIPE);
    // Windows between posts, doors on the right.
    let mut z = rear + 0.9;
    while z < front - 1.4 {
        let end = (z + 1.35).min(front - 0.4);
        for side in [-1.0_f32, 1.0] {
            let corners = [
                p(side * x, -1.15, z),
                p(side * x, -1.15, end),
                p(side * x, -height + 0.45, end),
                p(side * x, -height + 0.45, z),
            ];
            shape.panel(corners, [0.0, 0.0], V::x() * side, GLASS);
        }
        z = end + 0.08;
    }
    for z in [front - 1.5, 0.2] {
        let corners = [
            p(x + 0.01, -0.4, z),
            p(x + 0.01, -0.4, z + 1.2),
            p(x + 0.01, -2.6, z + 1.2),
            p(x + 0.01, -2.6, z),
        ];
        shape.panel(corners, [0.0, 0.0], V::x(), GLASS);
    }
    for (z, out, low) in [(front + 0.008, 1.0_f32, -1.0), (rear - 0.008, -1.0, -1.7)] {
        let w = half * 0.92;
        shape.panel(
            [p(-w, low, z), p(w, low, z), p(w, -height + 0.35, z), p(-w, -height + 0.35, z)],
            [0.0, 0.0],
            V::z() * out,
            GLASS,
        );
        for side in [-1.0_f32, 1.0] {
            let at = side * (half - 0.25);
            let material = if out > 0.0 { LAMP } else { TAIL };
            shape.block(p(at - 0.16, -0.9, z - 0.02), p(at + 0.16, -0.68, z + 0.02), material);
        }
        shape.block(p(-half, -0.45, z - 0.04), p(half, -0.3, z + 0.04), BLACK);
    }
    shape.block(p(-0.8, -height - 0.2, -2.0), p(0.8, -height, 0.5), BOX);
    for z in [front - 2.6, rear + 2.9] {
        // The arch hides in black.
        for side in [-1.0_f32, 1.0] {
            let at = side * (half + 0.002);
            shape.block(p(at - 0.002, -1.05, z - 0.6), p(at + 0.002, -0.3, z + 0.6), BLACK);
        }
        axle(shape, z, half + 0.03, 0.48);
    }
}
