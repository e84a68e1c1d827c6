//! What stands beside roads: lamp posts, signs, traffic lights, guard rails, bins, signboards with pictures of cars.

use rand::RngExt;

use super::random::random;
use super::shapes::{P, Shape, V, p};
use super::stuff::{Prop, dark_glass, matt, metal, noisy, smooth};
use crate::scene::{Material, SegmentClass};

/// A street lamp whose arm reaches along -x.
pub(crate) fn lamp_post(height: f32) -> Prop {
    let mut shape = Shape::default();
    shape.tube([p(0.0, 0.2, 0.0), p(0.0, -1.2, 0.0)], [0.10, 0.10], 8, 0);
    shape.tube([p(0.0, -1.2, 0.0), p(0.0, -height, 0.0)], [0.075, 0.05], 8, 0);
    shape.tube([p(0.0, -height, 0.0), p(-1.4, -height - 0.25, 0.0)], [0.04, 0.035], 6, 0);
    shape.block(p(-2.0, -height - 0.33, -0.12), p(-1.35, -height - 0.20, 0.12), 1);
    let materials = [metal(0.32, 0.5), matt([0.4, 0.4, 0.38])].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Pole }
}

/// A wire that hangs between two points 1 m apart along z, at its own height; `sag` metres in the middle.
pub(crate) fn wire(sag: f32, radius: f32) -> Prop {
    let mut shape = Shape::default();
    let at = |i: i32| {
        let z = i as f32 / 8.0 - 0.5;
        p(0.0, sag * (1.0 - 4.0 * z * z), z)
    };
    for i in 0..8 {
        shape.tube([at(i), at(i + 1)], [radius; 2], 4, 0);
    }
    let materials = [smooth([0.02, 0.02, 0.02], 0.6)].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Pole }
}

/// A wooden post with a crossbar for wires, 7.5 m high.
pub(crate) fn wire_post() -> Prop {
    let mut shape = Shape::default();
    shape.tube([p(0.0, 0.4, 0.0), p(0.0, -7.8, 0.0)], [0.14, 0.10], 8, 0);
    shape.block(p(-0.8, -7.55, -0.05), p(0.8, -7.43, 0.05), 0);
    for x in [-0.7, 0.7] {
        shape.tube([p(x, -7.55, 0.0), p(x, -7.7, 0.0)], [0.03, 0.03], 6, 1);
    }
    let materials = [noisy([0.12, 0.09, 0.065], [0.07, 0.055, 0.04], 0.4), matt([0.4, 0.3, 0.2])];
    Prop { mesh: shape.finish(), materials: materials.into(), class: SegmentClass::Pole }
}

/// A post as they keep cars off pavements.
pub(crate) fn bollard() -> Prop {
    let mut shape = Shape::default();
    shape.tube([p(0.0, 0.1, 0.0), p(0.0, -0.85, 0.0)], [0.06, 0.06], 8, 0);
    shape.tube([p(0.0, -0.66, 0.0), p(0.0, -0.76, 0.0)], [0.062, 0.062], 8, 1);
    let materials = [smooth([0.05, 0.05, 0.055], 0.5), matt([0.7, 0.7, 0.7])].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Pole }
}

/// A delineator post beside a country road.
pub(crate) fn delineator() -> Prop {
    let mut shape = Shape::default();
    shape.block(p(-0.06, -1.0, -0.05), p(0.06, 0.1, 0.05), 0);
    shape.block(p(-0.063, -0.92, -0.053), p(0.063, -0.70, 0.053), 1);
    let materials = [matt([0.72, 0.72, 0.70]), matt([0.02, 0.02, 0.02])].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Pole }
}

/// A traffic sign that faces -z; `kind` chooses among seven.
pub(crate) fn sign(kind: u32) -> Prop {
    let mut shape = Shape::default();
    shape.tube([p(0.0, 0.2, 0.0), p(0.0, -2.75, 0.0)], [0.032, 0.032], 6, 0);
    let center = p(0.0, -2.4, -0.05);
    let red: Material = smooth([0.45, 0.015, 0.02], 0.4);
    let (white, blue, yellow) = (
        smooth([0.75, 0.75, 0.75], 0.4),
        smooth([0.015, 0.07, 0.35], 0.4),
        smooth([0.75, 0.45, 0.02], 0.4),
    );
    let black = smooth([0.02, 0.02, 0.02], 0.5);
    let (rim, face, ink) = match kind % 7 {
        0 | 1 => (red, white, black),
        2 => (red, white, red),
        3 => (white, blue, white),
        4 => (blue, blue, white),
        5 => (white, yellow, yellow),
        _ => (red, red, white),
    };
    let sides = match kind % 7 {
        2 => 3,
        3 | 5 => 4,
        6 => 8,
        _ => 20,
    };
    let turn = if sides == 4 && kind % 7 == 5 { 0.0 } else { 0.5 };
    disc(&mut shape, center, 0.34, sides, turn, 1);
    disc(&mut shape, center - V::z() * 0.004, 0.28, sides, turn, 2);
    match kind % 7 {
        0 => shape.block(p(-0.16, -2.45, -0.062), p(0.16, -2.35, -0.058), 3),
        1 => {
            shape.block(p(-0.12, -2.5, -0.062), p(-0.03, -2.3, -0.058), 3);
            shape.block(p(0.03, -2.5, -0.062), p(0.12, -2.3, -0.058), 3);
        }
        3 | 4 => shape.block(p(-0.05, -2.58, -0.062), p(0.05, -2.22, -0.058), 3),
        6 => shape.block(p(-0.2, -2.44, -0.062), p(0.2, -2.36, -0.058), 3),
        _ => {}
    }
    let materials = [metal(0.35, 0.45), rim, face, ink].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::TrafficSign }
}

/// A disc with corners that faces -z, with a grey back.
fn disc(shape: &mut Shape, center: P, radius: f32, sides: u32, turn: f32, material: u16) {
    let corner = |i: u32| {
        let angle = std::f32::consts::TAU * (i as f32 + turn) / sides as f32;
        center
            + V::new(angle.sin(), if sides == 3 { angle.cos() } else { -angle.cos() }, 0.0) * radius
    };
    for i in 0..sides {
        for (out, material, behind) in [(-V::z(), material, 0.0), (V::z(), 0, 0.012)] {
            let back = V::z() * behind;
            let (a, b) = (corner(i) + back, corner(i + 1) + back);
            shape.panel([center + back, a, b, b], [0.0, 0.0], out, material);
        }
    }
}

/// A traffic light that faces -z; `lit` is 0 red, 1 amber, 2 green. With an arm it hangs over the road, along -x.
pub(crate) fn traffic_light(lit: usize, arm: bool) -> Prop {
    let mut shape = Shape::default();
    let top = if arm { 5.6 } else { 3.3 };
    shape.tube([p(0.0, 0.2, 0.0), p(0.0, -top, 0.0)], [0.08, 0.07], 8, 0);
    let mut heads = vec![p(0.0, -2.9, -0.15)];
    if arm {
        shape.tube([p(0.0, -top + 0.2, 0.0), p(-4.0, -top, 0.0)], [0.06, 0.05], 8, 0);
        heads.push(p(-3.7, -top + 0.3, -0.12));
    }
    for head in heads {
        shape.block(head + V::new(-0.15, -0.48, -0.10), head + V::new(0.15, 0.48, 0.10), 1);
        for (i, y) in [-0.3, 0.0, 0.3].into_iter().enumerate() {
            let at = head + V::new(0.0, y, -0.105);
            disc(&mut shape, at, 0.11, 14, 0.0, 2 + i as u16);
            shape.block(at + V::new(-0.12, -0.14, -0.14), at + V::new(0.12, -0.12, 0.0), 1);
        }
    }
    let lamp = |i: usize, color: [f32; 3]| Material {
        emission: if i == lit { color.map(|value| value * 1.6) } else { [0.0; 3] },
        ..smooth(color.map(|value| value * 0.08 + 0.01), 0.2)
    };
    let materials = [
        metal(0.3, 0.5),
        smooth([0.015, 0.015, 0.015], 0.6),
        lamp(0, [1.0, 0.05, 0.02]),
        lamp(1, [1.0, 0.5, 0.02]),
        lamp(2, [0.05, 1.0, 0.4]),
    ];
    Prop { mesh: shape.finish(), materials: materials.into(), class: SegmentClass::TrafficLight }
}

/// A gantry with blue signs over a motorway, from x = 0 to `-width`, facing -z.
pub(crate) fn gantry(seed: u64, width: f32) -> Prop {
    let mut rng = random(seed, &[0x6a47]);
    let mut shape = Shape::default();
    for x in [0.0, -width] {
        shape.tube([p(x, 0.5, 0.0), p(x, -7.2, 0.0)], [0.16, 0.14], 10, 0);
    }
    for y in [-7.1, -6.3] {
        shape.tube([p(0.0, y, 0.0), p(-width, y, 0.0)], [0.08, 0.08], 6, 0);
    }
    let mut x = -1.5;
    while x > -width + 4.0 {
        let wide = rng.random_range(3.0_f32..4.5);
        let tall = rng.random_range(1.6_f32..2.6);
        shape.block(p(x - wide, -8.0, -0.25), p(x, -8.0 + tall, -0.18), 1);
        shape.block(p(x - wide + 0.08, -7.92, -0.262), p(x - 0.08, -8.08 + tall, -0.25), 2);
        for line in 0..rng.random_range(1..4) {
            let y = -7.7 + 0.5 * line as f32;
            let far = rng.random_range(0.4_f32..0.85) * wide;
            let mut at = 0.3;
            while at < far {
                let letter = rng.random_range(0.10_f32..0.22);
                shape.block(p(x - at - letter, y, -0.272), p(x - at, y + 0.26, -0.262), 1);
                at += letter + 0.06;
            }
        }
        x -= wide + rng.random_range(0.8_f32..2.0);
    }
    let materials =
        [metal(0.33, 0.5), smooth([0.7, 0.7, 0.7], 0.4), smooth([0.015, 0.07, 0.33], 0.4)];
    Prop { mesh: shape.finish(), materials: materials.into(), class: SegmentClass::TrafficSign }
}

/// A piece of guard rail, 4 m along z, its rail towards -x.
pub(crate) fn guard_rail() -> Prop {
    let mut shape = Shape::default();
    shape.block(p(0.0, -0.72, -0.06), p(0.1, 0.4, 0.06), 0);
    // The profile of the beam: two waves.
    let profile = [
        [-0.02, -0.75],
        [-0.10, -0.68],
        [-0.10, -0.62],
        [-0.03, -0.58],
        [-0.10, -0.54],
        [-0.10, -0.48],
        [-0.02, -0.42],
    ];
    for pair in profile.windows(2) {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        let corners = [p(x0, y0, -2.0), p(x0, y0, 2.0), p(x1, y1, 2.0), p(x1, y1, -2.0)];
        let across = V::new(x1 - x0, y1 - y0, 0.0);
        let out = V::new(-across.y, across.x, 0.0);
        shape.panel(corners, [0.0, 0.0], out, 0);
        let back = corners.map(|corner| corner + V::new(0.006, 0.0, 0.0));
        shape.panel(back, [0.0, 0.0], -out, 0);
    }
    let materials = [Material { dirt: 0.3, ..metal(0.42, 0.55) }].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::GuardRail }
}

/// A concrete barrier, 4 m along z.
pub(crate) fn concrete_barrier() -> Prop {
    let mut shape = Shape::default();
    for side in [-1.0_f32, 1.0] {
        let profile = [[0.30, 0.2], [0.30, -0.08], [0.18, -0.30], [0.10, -0.90]];
        for pair in profile.windows(2) {
            let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
            let corners = [
                p(side * x0, y0, -2.0),
                p(side * x0, y0, 2.0),
                p(side * x1, y1, 2.0),
                p(side * x1, y1, -2.0),
            ];
            shape.panel(corners, [0.0, 0.0], V::new(side, -0.3, 0.0), 0);
        }
    }
    shape.panel(
        [p(-0.1, -0.9, -2.0), p(0.1, -0.9, -2.0), p(0.1, -0.9, 2.0), p(-0.1, -0.9, 2.0)],
        [0.0, 0.0],
        -V::y(),
        0,
    );
    let materials = [noisy([0.38, 0.37, 0.35], [0.26, 0.25, 0.24], 1.2)].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::GuardRail }
}

/// A wheeled bin, a skip, or a box of an electric company.
pub(crate) fn bin(seed: u64) -> Prop {
    let mut rng = random(seed, &[0xb14]);
    let mut shape = Shape::default();
    let colors = [[0.02, 0.06, 0.03], [0.03, 0.03, 0.035], [0.02, 0.04, 0.12], [0.35, 0.25, 0.02]];
    let color = colors[rng.random_range(0..4)];
    match rng.random_range(0..3) {
        0 => {
            shape.block(p(-0.28, -0.95, -0.30), p(0.28, -0.05, 0.30), 0);
            shape.block(p(-0.31, -1.05, -0.34), p(0.31, -0.94, 0.32), 0);
        }
        1 => {
            shape.block(p(-0.5, -1.15, -0.65), p(0.5, -0.15, 0.65), 0);
            shape.block(p(-0.54, -1.32, -0.68), p(0.54, -1.14, 0.68), 0);
        }
        _ => shape.block(p(-0.18, -1.25, -0.5), p(0.18, 0.1, 0.5), 1),
    }
    let materials = [smooth(color, 0.5), matt([0.36, 0.37, 0.35])].into();
    Prop { mesh: shape.finish(), materials, class: SegmentClass::Misc }
}

/// A board that shows a car from the side, facing -x: no vehicle, though it looks like one.
pub(crate) fn signboard(seed: u64) -> Prop {
    let mut rng = random(seed, &[0x5167]);
    let mut shape = Shape::default();
    for z in [-1.5, 1.5] {
        shape.tube([p(0.05, 0.3, z), p(0.05, -1.6, z)], [0.06, 0.06], 6, 0);
    }
    shape.block(p(0.0, -3.9, -2.1), p(0.1, -1.4, 2.1), 0);
    shape.block(p(-0.012, -3.8, -2.0), p(0.0, -1.5, 2.0), 1);
    // The car: body, cabin, windows and wheels as flat pieces in layers.
    let scale = rng.random_range(0.55_f32..0.8);
    let at = |z: f32, y: f32, layer: f32| p(-0.014 - 0.003 * layer, -2.0 + y * scale, z * scale);
    let mut piece = |points: [[f32; 2]; 4], layer: f32, material: u16| {
        let corners = points.map(|[z, y]| at(z, y, layer));
        shape.panel(corners, [0.0, 0.0], -V::x(), material);
    };
    piece([[-2.1, -0.25], [2.15, -0.2], [2.1, -0.75], [-2.15, -0.85]], 1.0, 2);
    piece([[-1.6, -0.8], [1.1, -0.75], [0.4, -1.35], [-1.0, -1.38]], 1.0, 2);
    piece([[-1.35, -0.85], [-0.25, -0.82], [-0.25, -1.28], [-0.95, -1.28]], 2.0, 3);
    piece([[-0.15, -0.82], [0.9, -0.80], [0.35, -1.26], [-0.15, -1.28]], 2.0, 3);
    for z in [-1.3, 1.35] {
        for (radius, layer, material) in [(0.36_f32, 2.0, 4), (0.22, 3.0, 5)] {
            let corner = |i: u32| {
                let (s, c) = (std::f32::consts::TAU * i as f32 / 12.0).sin_cos();
                at(z + radius * c, -0.2 + radius * s, layer)
            };
            for i in 0..12 {
                shape.panel(
                    [at(z, -0.2, layer), corner(i), corner(i + 1), corner(i + 1)],
                    [0.0, 0.0],
                    -V::x(),
                    material,
                );
            }
        }
    }
    let paints = [[0.4, 0.02, 0.02], [0.02, 0.08, 0.3], [0.6, 0.6, 0.6], [0.5, 0.35, 0.02]];
    let grounds = [[0.6, 0.65, 0.7], [0.75, 0.72, 0.6], [0.15, 0.3, 0.45], [0.7, 0.2, 0.1]];
    let materials = [
        metal(0.25, 0.5),
        smooth(grounds[rng.random_range(0..4)], 0.5),
        smooth(paints[rng.random_range(0..4)], 0.5),
        dark_glass(),
        smooth([0.02, 0.02, 0.02], 0.7),
        smooth([0.45, 0.45, 0.47], 0.5),
    ];
    Prop { mesh: shape.finish(), materials: materials.into(), class: SegmentClass::Misc }
}
