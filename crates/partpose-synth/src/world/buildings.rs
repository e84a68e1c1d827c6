//! Houses: walls with windows, a ground floor with a door or a shop, roofs, chimneys; and free-standing walls.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::random::random;
use super::shapes::{Shape, V, p};
use super::stuff::{Prop, dark_glass, matt, metal, noisy, shade, smooth, textured};
use crate::scene::{Material, SegmentClass, Texture};

/// Colours of plaster and brick, linear RGB.
const WALLS: [[f32; 3]; 9] = [
    [0.55, 0.50, 0.40],
    [0.62, 0.60, 0.55],
    [0.48, 0.40, 0.28],
    [0.36, 0.16, 0.10],
    [0.50, 0.34, 0.22],
    [0.40, 0.42, 0.42],
    [0.60, 0.52, 0.44],
    [0.30, 0.20, 0.15],
    [0.52, 0.46, 0.46],
];

/// What a house may look like.
#[derive(Clone, Copy, Debug)]
pub(crate) struct House {
    /// Along the street, metres.
    pub(crate) width: f32,
    /// Away from the street, metres.
    pub(crate) depth: f32,
    /// Number of storeys.
    pub(crate) storeys: u32,
}

const STOREY: f32 = 3.0;

/// A house whose front lies in the plane x = 0 and looks along -x; it reaches from 0 to `depth` along x and
/// `width` / 2 to either side along z.
pub(crate) fn house(seed: u64, house: &House) -> Prop {
    let mut rng = random(seed, &[0x400]);
    let House { width, depth, storeys } = *house;
    let half = 0.5 * width;
    let ground = if rng.random_bool(0.4) { 3.6 } else { 3.0 };
    let eaves = ground + STOREY * (storeys.max(1) - 1) as f32;
    let mut shape = Shape::default();
    // Walls stand in the ground a little, since it may slope.
    shape.block_faces(
        p(0.0, -eaves, -half),
        p(depth, -ground, half),
        [true, true, false, false, true, true],
        0,
    );
    shape.block_faces(
        p(0.0, -ground, -half),
        p(depth, 0.8, half),
        [true, true, false, false, true, true],
        1,
    );
    let plinth = rng.random_range(0.25_f32..0.8);
    shape.block(p(-0.025, -plinth, -half), p(0.0, 0.8, half), 10);
    ground_floor(&mut shape, &mut rng, half, ground);
    // A string course and the cornice catch light.
    shape.block(p(-0.07, -ground - 0.1, -half), p(0.0, -ground + 0.08, half), 2);
    shape.block(p(-0.22, -eaves - 0.18, -half), p(0.0, -eaves, half), 2);
    if rng.random_bool(0.55) {
        gable_roof(&mut shape, half, depth, eaves, rng.random_range(0.35_f32..0.8));
        let z = rng.random_range(-0.7..0.7) * half;
        let top = eaves + 0.5 * depth * 0.8;
        shape.block(p(depth * 0.4, -top - 1.2, z), p(depth * 0.4 + 0.6, -eaves, z + 0.9), 4);
    } else {
        shape.block(p(-0.1, -eaves - 0.7, -half), p(depth, -eaves, half), 3);
    }
    for i in 0..storeys.saturating_sub(1) {
        if rng.random_bool(0.25) {
            balcony(&mut shape, &mut rng, half, ground + STOREY * i as f32);
        }
    }
    // A drainpipe.
    let z = half - 0.15;
    shape.tube([p(-0.08, -eaves, z), p(-0.08, 0.2, z)], [0.05, 0.05], 6, 6);
    Prop { mesh: shape.finish(), materials: materials(&mut rng), class: SegmentClass::Building }
}

fn materials(rng: &mut ChaCha8Rng) -> std::sync::Arc<[Material]> {
    let wall = shade(WALLS[rng.random_range(0..WALLS.len())], rng.random_range(0.75_f32..1.15));
    let field = [rng.random_range(1.6_f32..2.9), STOREY];
    let window = [field[0] * rng.random_range(0.38_f32..0.62), rng.random_range(1.3_f32..1.8)];
    let facade = Texture::Facade { field, window, seed: rng.random() };
    let base = shade(wall, rng.random_range(0.55_f32..1.0));
    let roof =
        [[0.20, 0.075, 0.045], [0.09, 0.085, 0.085], [0.13, 0.09, 0.07]][rng.random_range(0..3)];
    [
        textured(wall, facade),
        noisy(base, shade(base, 0.8), 1.5),
        matt(shade(wall, 1.2)),
        textured(roof, Texture::Slabs { size: [0.25, 0.33], joint: 0.02 }),
        textured([0.24, 0.10, 0.07], Texture::Slabs { size: [0.24, 0.08], joint: 0.01 }),
        dark_glass(),
        metal(0.35, 0.5),
        smooth(
            [[0.05, 0.09, 0.05], [0.10, 0.04, 0.03], [0.05, 0.05, 0.07], [0.2, 0.15, 0.1]]
                [rng.random_range(0..4)],
            0.4,
        ),
        smooth(
            [[0.30, 0.03, 0.03], [0.03, 0.10, 0.25], [0.35, 0.30, 0.22], [0.03, 0.03, 0.03]]
                [rng.random_range(0..4)],
            0.5,
        ),
        smooth(shade([0.5, 0.49, 0.45], rng.random_range(0.4_f32..1.2)), 0.45),
        noisy(shade(base, 0.62), shade(base, 0.45), 0.8),
    ]
    .into()
}

/// Doors, shop windows with an awning or a sign, or windows.
fn ground_floor(shape: &mut Shape, rng: &mut ChaCha8Rng, half: f32, ground: f32) {
    let is_shop = rng.random_bool(0.4);
    let mut z = -half + rng.random_range(0.6_f32..1.2);
    let mut has_door = false;
    while z < half - 1.6 {
        let wide =
            if is_shop { rng.random_range(1.8_f32..2.8) } else { rng.random_range(0.9_f32..1.3) };
        let wide = wide.min(half - 0.4 - z);
        let door = !has_door && rng.random_bool(0.4);
        let (low, high, material) = if door {
            has_door = true;
            (0.0, 2.25, 7)
        } else if is_shop {
            (0.35, 2.6, 5)
        } else {
            (0.95, 2.3, 5)
        };
        // The frame stands out of the wall and the pane in the frame: no hole is needed.
        let end = if door { z + 1.05_f32.min(wide) } else { z + wide };
        shape.block(p(-0.05, -high - 0.08, z - 0.08), p(0.0, -low, end + 0.08), 2);
        shape.block(p(-0.06, -high, z), p(-0.02, -low - 0.05, end), material);
        if !door {
            furnish_window(shape, rng, [-high, -low - 0.05], [z, end], is_shop);
        }
        z = end + rng.random_range(0.5_f32..1.4);
    }
    if is_shop {
        shape.block(p(-0.12, -ground + 0.15, -half * 0.9), p(0.0, -ground + 0.75, half * 0.9), 8);
        if rng.random_bool(0.4) {
            let y = -ground + 0.85;
            let corners = [
                p(0.0, y, -half * 0.7),
                p(0.0, y, half * 0.7),
                p(-1.1, y + 0.45, half * 0.7),
                p(-1.1, y + 0.45, -half * 0.7),
            ];
            shape.panel(corners, [0.0, 0.0], -V::y(), 8);
        }
    }
}

/// What is seen in a window: bars, curtains and blinds, or posters in that of a shop. All of it lies a finger's width
/// before the pane, where nobody sees the difference.
fn furnish_window(
    shape: &mut Shape,
    rng: &mut ChaCha8Rng,
    [top, bottom]: [f32; 2],
    [from, to]: [f32; 2],
    is_shop: bool,
) {
    let middle = 0.5 * (from + to);
    if is_shop {
        for _ in 0..rng.random_range(0..3) {
            let z = rng.random_range(from..to - 0.5);
            let y = rng.random_range(top + 0.1..bottom - 0.8);
            let size = rng.random_range(0.25_f32..0.5);
            let material = [2, 8, 9][rng.random_range(0..3)];
            shape.block(p(-0.065, y, z), p(-0.06, y + 1.4 * size, z + size), material);
        }
        return;
    }
    match rng.random_range(0..4) {
        // Blinds let down some way, or net curtains over all of it.
        0 => {
            let end = top + (bottom - top) * rng.random_range(0.15_f32..0.9);
            shape.block(p(-0.065, top, from), p(-0.06, end, to), 9);
        }
        1 => shape.block(p(-0.065, top, from), p(-0.06, bottom, to), 9),
        _ => {}
    }
    if rng.random_bool(0.7) {
        shape.block(p(-0.075, top, middle - 0.03), p(-0.05, bottom, middle + 0.03), 2);
    }
    // The sill.
    shape.block(p(-0.14, bottom + 0.05, from - 0.1), p(0.0, bottom + 0.10, to + 0.1), 2);
}

fn gable_roof(shape: &mut Shape, half: f32, depth: f32, eaves: f32, pitch: f32) {
    let ridge = eaves + 0.5 * depth * pitch;
    let (x0, x1, over) = (-0.4, depth + 0.4, 0.1);
    let eave = eaves - 0.4 * pitch;
    let middle = 0.5 * depth;
    let z = half + over;
    shape.panel(
        [p(x0, -eave, -z), p(x0, -eave, z), p(middle, -ridge, z), p(middle, -ridge, -z)],
        [0.0, 0.0],
        V::new(-1.0, -1.0, 0.0),
        3,
    );
    shape.panel(
        [p(x1, -eave, z), p(x1, -eave, -z), p(middle, -ridge, -z), p(middle, -ridge, z)],
        [0.0, 0.0],
        V::new(1.0, -1.0, 0.0),
        3,
    );
    for side in [-1.0, 1.0] {
        let z = side * half;
        let corners =
            [p(0.0, -eaves, z), p(depth, -eaves, z), p(middle, -ridge, z), p(middle, -ridge, z)];
        shape.panel(corners, [0.0, 0.0], V::z() * side, 1);
    }
}

fn balcony(shape: &mut Shape, rng: &mut ChaCha8Rng, half: f32, floor: f32) {
    let width = rng.random_range(1.2_f32..2.2).min(half);
    let z = rng.random_range(-1.0_f32..1.0) * (half - width);
    let (a, b) = (z - width, z + width);
    shape.block(p(-1.0, -floor, a), p(0.0, -floor + 0.16, b), 2);
    shape.block(
        p(-1.0, -floor - 1.0, a),
        p(-0.97, -floor, b),
        if rng.random_bool(0.5) { 6 } else { 2 },
    );
    shape.block(p(-1.0, -floor - 1.0, a), p(0.0, -floor, a + 0.03), 6);
    shape.block(p(-1.0, -floor - 1.0, b - 0.03), p(0.0, -floor, b), 6);
}

/// A garden or retaining wall, 6 m long along z.
pub(crate) fn wall(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x3a11]);
    let mut shape = Shape::default();
    let height = rng.random_range(0.9_f32..2.2);
    shape.block(p(-0.15, -height, -3.0), p(0.15, 0.6, 3.0), 0);
    shape.block(p(-0.20, -height - 0.08, -3.0), p(0.20, -height, 3.0), 1);
    let color = shade(WALLS[rng.random_range(0..WALLS.len())], 0.8);
    let bricks = Texture::Slabs { size: [0.4, 0.2], joint: 0.012 };
    let materials = [textured(color, bricks), matt([0.35, 0.34, 0.32])].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Building }
}

/// Noise barrier along motorways, 6 m long along z, facing -x.
pub(crate) fn barrier(seed: u64) -> Prop {
    let mut rng = random(seed, &[0xba22]);
    let mut shape = Shape::default();
    shape.block(p(-0.06, -3.2, -3.0), p(0.06, 0.6, 3.0), 0);
    shape.block(p(-0.14, -3.4, -3.08), p(0.14, 0.6, -2.92), 1);
    let color =
        [[0.16, 0.20, 0.13], [0.30, 0.30, 0.29], [0.24, 0.19, 0.13]][rng.random_range(0..3)];
    let boards = Texture::Slabs { size: [3.0, 0.5], joint: 0.02 };
    let materials = [textured(color, boards), metal(0.3, 0.5)].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Building }
}
