//! Patterns, computed where they are seen.
//!
//! What is finer than a pixel fades into its mean, which keeps far surfaces calm without stored levels.

use nalgebra::Vector3;

use crate::scene::{Material, Texture};

use super::leaves;
use super::noise::{cell, cell_share, floor, fractal, smooth};

type V = Vector3<f32>;

/// A surface at one place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) color: V,
    pub(super) roughness: f32,
    pub(super) metallic: f32,
    pub(super) clear_coat: f32,
    pub(super) emission: V,
}

/// The material at texture coordinates, which `footprint` metres share a pixel.
pub(super) fn local(material: &Material, [u, v]: [f32; 2], footprint: f32) -> Local {
    let mut local = Local {
        color: V::from(material.color),
        roughness: material.roughness,
        metallic: material.metallic,
        clear_coat: material.clear_coat,
        emission: V::from(material.emission),
    };
    match material.texture {
        Texture::Plain | Texture::Nothing => {}
        Texture::Noise { other, size } => {
            let scale = 1.0 / size.max(1e-3);
            let share = fractal(u * scale, v * scale, 5, footprint * scale, 3);
            let share = (0.5 + 1.9 * (share - 0.5)).clamp(0.0, 1.0);
            local.color = local.color.lerp(&V::from(other), share);
        }
        Texture::Asphalt => asphalt(&mut local, u, v, footprint),
        Texture::Slabs { size, joint } => slabs(&mut local, [u, v], size, joint, footprint),
        Texture::Facade { field, window, seed } => {
            facade(&mut local, [u, v], field, window, seed, footprint);
        }
        Texture::Leaves { size, .. } => {
            // A leaf has its own shade; from afar only clumps have.
            let seen = sharpness(footprint, 0.6 * size);
            let own = if seen > 0.0 { leaves::shade(u, v, size) - 0.5 } else { 0.0 };
            let clump = fractal(u / 0.6, v / 0.6, 2, footprint / 0.6, 5) - 0.5;
            local.color *= 1.0 + 0.9 * own * seen + 0.7 * clump;
            // Young and dry leaves are yellower than others.
            local.color.x *= 1.0 + 0.7 * clump + 0.5 * own * seen;
        }
        Texture::Grass => {
            let fine = fractal(u * 14.0, v * 14.0, 3, footprint * 14.0, 7);
            let coarse = fractal(0.4 * u, 0.4 * v, 4, 0.4 * footprint, 8);
            let dry = ((coarse - 0.45) * 3.0).clamp(0.0, 1.0);
            let yellow = V::new(local.color.y * 1.25, local.color.y * 1.05, local.color.z);
            local.color = local.color.lerp(&yellow, 0.6 * dry) * (0.45 + 1.1 * fine);
        }
        Texture::Grille { pitch } => {
            let seen = sharpness(footprint, 0.3 * pitch);
            let from_slat = (v / pitch).rem_euclid(1.0) - 0.5;
            let edge = (0.21 - from_slat.abs()) * pitch / footprint.max(1e-4);
            let slat = 0.12 + 0.88 * (edge + 0.5).clamp(0.0, 1.0);
            local.color *= 0.49 + seen * (slat - 0.49);
            // Nothing shines between the slats.
            local.roughness += seen * (1.0 - slat) * (0.9 - local.roughness);
        }
        Texture::Rim { spokes, cover } => rim(&mut local, [u, v], spokes, cover),
        Texture::Plate { seed } => plate(&mut local, [u, v], seed, footprint),
        Texture::Lining { leather } => lining(&mut local, v, V::from(leather), footprint),
        Texture::Lamp { cell } => {
            let seen = sharpness(footprint, 0.5 * cell);
            let wave = |x: f32| (x / cell).rem_euclid(1.0);
            let rib = 0.65 + 0.7 * wave(u) * wave(v + 0.3 * cell);
            local.color *= 1.0 + seen * (rib - 0.85);
            // Bulbs and diodes are brighter than what is between them.
            local.emission *= 1.0 + 1.2 * seen * (rib - 0.83);
        }
    }
    local
}

/// 1 where a pattern of some size can be made out, 0 where it is finer than a pixel.
fn sharpness(footprint: f32, size: f32) -> f32 {
    (1.6 - footprint / size.max(1e-5)).clamp(0.0, 1.0)
}

fn asphalt(local: &mut Local, u: f32, v: f32, footprint: f32) {
    let grain = fractal(u * 70.0, v * 70.0, 2, footprint * 70.0, 11) - 0.5;
    let stones = fractal(u * 22.0, v * 22.0, 2, footprint * 22.0, 12) - 0.5;
    let patches = fractal(u * 0.35, v * 1.1, 4, footprint, 13) - 0.5;
    let broad = smooth(u * 0.06, v * 0.21, 14) - 0.5;
    // Wheels polish two tracks of every lane of 3.5 m.
    let tracks = (std::f32::consts::TAU * v / 1.75).cos();
    let shade = 1.0 + 0.75 * grain + 0.5 * stones + 0.42 * patches + 0.34 * broad - 0.055 * tracks;
    local.color *= shade.max(0.3);
    local.roughness = (local.roughness - 0.12 * patches - 0.05 * tracks).clamp(0.2, 1.0);
    stains(local, [u, v], footprint);
    // Cracks run where a slow noise passes its mean, and only in some regions.
    if footprint < 0.08 {
        let region = smooth(u * 0.08 + 9.0, v * 0.08, 16);
        if region <= 0.55 {
            return;
        }
        let slow = fractal(u * 0.45 + 40.0, v * 0.45, 4, footprint, 15) - 0.5;
        let width = 0.006 + footprint * 0.4;
        let line = (1.0 - slow.abs() / width).clamp(0.0, 1.0) * ((region - 0.55) * 6.0).min(1.0);
        local.color *= 1.0 - 0.55 * line * (0.012 / width).min(1.0);
    }
}

/// Drips of oil, spilt things and trodden gum: round dark spots here and there.
fn stains(local: &mut Local, [u, v]: [f32; 2], footprint: f32) {
    let seen = sharpness(footprint, 0.12);
    // In some places many, in most none.
    let many = if seen > 0.0 { (smooth(0.16 * u, 0.5 * v, 18) - 0.5) * 4.0 } else { 0.0 };
    if many > 0.0 {
        let spot =
            ((fractal(3.3 * u, 4.6 * v, 2, 4.0 * footprint, 17) - 0.70) * 6.0).clamp(0.0, 1.0);
        local.color *= 1.0 - 0.32 * seen * spot * many.min(1.0);
    }
}

fn slabs(local: &mut Local, [u, v]: [f32; 2], size: [f32; 2], joint: f32, footprint: f32) {
    let row = floor(v / size[1]) as f32;
    // Every second row is shifted.
    let u = u + 0.5 * size[0] * row.rem_euclid(2.0);
    let column = floor(u / size[0]) as f32;
    let own = cell_share(column as i32, row as i32, 21) - 0.5;
    let seen = sharpness(footprint, size[0].min(size[1]));
    let speckle = fractal(u * 40.0, v * 40.0, 2, footprint * 40.0, 22) - 0.5;
    let stain = fractal(u * 0.8, v * 0.8, 3, footprint * 0.8, 23) - 0.5;
    local.color *= (1.0 + 0.30 * own * seen + 0.25 * speckle + 0.3 * stain).max(0.2);
    let distance = |x: f32, size: f32| {
        let at = x.rem_euclid(size);
        at.min(size - at)
    };
    let to_joint = distance(u, size[0]).min(distance(v, size[1]));
    let cover = ((0.5 * joint - to_joint) / footprint.max(1e-4) + 0.5).clamp(0.0, 1.0);
    local.color *= 1.0 - 0.55 * cover * (joint / footprint.max(1e-4)).min(1.0);
}

fn facade(
    local: &mut Local,
    [u, v]: [f32; 2],
    field: [f32; 2],
    window: [f32; 2],
    seed: u32,
    footprint: f32,
) {
    let [column, row] = [floor(u / field[0]) as f32, floor(v / field[1]) as f32];
    let [x, y] = [u - (column + 0.5) * field[0], v - (row + 0.5) * field[1]];
    let inside = |half_x: f32, half_y: f32| {
        let soft = footprint.max(1e-3);
        let edge = |d: f32| (d / soft + 0.5).clamp(0.0, 1.0);
        edge(half_x - x.abs()) * edge(half_y - y.abs())
    };
    let plaster = fractal(u * 0.7, v * 0.7, 5, footprint * 0.7, seed ^ 31) - 0.5;
    // Rain leaves streaks below the sills.
    let streaks = smooth(u * 3.0, v * 0.35, seed ^ 32) - 0.5;
    local.color *= 1.0 + 0.22 * plaster + 0.08 * streaks;
    let [half_x, half_y] = [0.5 * window[0], 0.5 * window[1]];
    if seed % 4 == 1 {
        bricks(local, [u, v], footprint);
    }
    // The sill stands out: light above, its shade below; rain washes dirt down from it.
    let below = y + half_y;
    let edge = |d: f32| (d / footprint.max(1e-3) + 0.5).clamp(0.0, 1.0);
    let beside = edge(half_x + 0.06 - x.abs());
    let sill = beside * edge(-below) * edge(below + 0.07);
    let shade = beside * edge(-below - 0.07) * edge(below + 0.15);
    let washed = beside * (1.0 + below).clamp(0.0, 1.0) * edge(-below - 0.07);
    local.color *= (1.0 + 0.25 * sill) * (1.0 - 0.45 * shade) * (1.0 - 0.12 * washed);
    let frame = inside(half_x, half_y);
    if frame <= 0.0 {
        return;
    }
    let pick = cell(column as i32, row as i32, seed);
    let white = V::repeat(if seed.is_multiple_of(3) { 0.12 } else { 0.62 });
    local.color = local.color.lerp(&white, frame);
    let border = 0.055;
    let bar = ((x.abs() - 0.02) / footprint.max(1e-3) + 0.5).clamp(0.0, 1.0);
    let pane = inside(half_x - border, half_y - border) * if window[0] > 0.8 { bar } else { 1.0 };
    let curtain = match pick % 5 {
        0 => V::new(0.5, 0.48, 0.42),
        1 => V::repeat(0.28),
        _ => V::repeat(0.015),
    };
    // Blinds are let down by different lengths.
    let blind = (pick >> 8) % 100;
    let is_covered = blind < 30 && y > half_y * (1.0 - 0.05 * blind as f32);
    let pane_color = if is_covered { V::repeat(0.4) } else { curtain };
    local.color = local.color.lerp(&pane_color, pane);
    // Windows stand back in the wall, so that its edge shades them from above and from one side.
    let reveal = (1.0 - edge(half_y - 0.14 - y)).max(1.0 - edge(half_x - 0.07 - x));
    local.color *= 1.0 - 0.6 * frame * reveal;
    local.clear_coat = pane * (1.0 - 0.7 * reveal) * if is_covered { 0.1 } else { 1.0 };
    local.roughness = 0.5;
}

/// Courses of bricks with mortar between them.
fn bricks(local: &mut Local, [u, v]: [f32; 2], footprint: f32) {
    let size = [0.25, 0.083];
    let seen = sharpness(footprint, size[1]);
    if seen <= 0.0 {
        return;
    }
    let row = floor(v / size[1]);
    let u = u + 0.5 * size[0] * (row & 1) as f32;
    let own = cell_share(floor(u / size[0]), row, 33) - 0.5;
    let to_joint = |x: f32, size: f32| {
        let at = x.rem_euclid(size);
        at.min(size - at)
    };
    let distance = to_joint(u, size[0]).min(to_joint(v, size[1]));
    let joint = ((0.006 - distance) / footprint.max(1e-4) + 0.5).clamp(0.0, 1.0);
    local.color *= 1.0 + seen * 0.5 * own;
    local.color = local.color.lerp(&V::repeat(0.32), 0.6 * seen * joint);
}

/// A door's inner side by height: a pocket below, an upholstered field, an armrest with light on its upper side.
fn lining(local: &mut Local, height: f32, leather: V, footprint: f32) {
    let soft = footprint.max(2e-3);
    let between = |low: f32, high: f32| {
        let edge = |d: f32| (d / soft + 0.5).clamp(0.0, 1.0);
        edge(height - low) * edge(high - height)
    };
    local.color = local.color.lerp(&leather, between(0.52, 0.78));
    local.color = local.color.lerp(&(leather * 1.6), between(0.64, 0.665));
    local.color *= 1.0 - 0.8 * between(0.60, 0.64);
    local.color *= 1.0 - 0.7 * between(0.36, 0.40);
}

/// Coordinates are shares of the wheel's radius.
fn rim(local: &mut Local, [u, v]: [f32; 2], spokes: u8, cover: f32) {
    let radius = u.hypot(v);
    let turn = v.atan2(u) / std::f32::consts::TAU * f32::from(spokes.max(1));
    let at = (turn.rem_euclid(1.0) - 0.5).abs() * 2.0;
    let is_hub = radius < 0.13;
    let is_ring = radius > 0.60;
    // Spokes are as wide at the ring as at the hub, or nearly.
    let width = cover * (0.25 / radius.max(0.1)).clamp(0.45, 1.5);
    if !is_hub && !is_ring && at > width {
        // The brake's disc far behind.
        let is_disc = radius < 0.45;
        local.color = V::repeat(if is_disc { 0.05 } else { 0.012 });
        local.metallic = 0.0;
        local.clear_coat = 0.0;
        local.roughness = 0.6;
    } else if radius < 0.09 {
        local.color *= 0.3;
    }
}

/// Letters and digits of three by five strokes, rows from the top, the left stroke in the highest of three bits.
const GLYPHS: [[u8; 5]; 20] = [
    [7, 5, 5, 5, 7], // 0
    [2, 6, 2, 2, 7], // 1
    [7, 1, 7, 4, 7], // 2
    [7, 1, 3, 1, 7], // 3
    [5, 5, 7, 1, 1], // 4
    [7, 4, 7, 1, 7], // 5
    [7, 4, 7, 5, 7], // 6
    [7, 1, 2, 2, 2], // 7
    [7, 5, 7, 5, 7], // 8
    [7, 5, 7, 1, 7], // 9
    [2, 5, 7, 5, 5], // A
    [6, 5, 6, 5, 6], // B
    [7, 4, 4, 4, 7], // C
    [7, 4, 6, 4, 7], // E
    [5, 5, 7, 5, 5], // H
    [5, 5, 6, 5, 5], // K
    [4, 4, 4, 4, 7], // L
    [7, 5, 7, 4, 4], // P
    [7, 2, 2, 2, 2], // T
    [5, 5, 5, 5, 7], // U
];

fn plate(local: &mut Local, [u, v]: [f32; 2], seed: u32, footprint: f32) {
    let blue = u < -0.222;
    if blue {
        local.color = V::new(0.01, 0.05, 0.35);
        return;
    }
    // Eight fields: letters, a gap, then digits.
    let column = ((u + 0.205) / 0.051).floor();
    let x = (u + 0.205) - column * 0.051;
    if v.abs() > 0.04 || !(0.0..8.0).contains(&column) || x > 0.0405 {
        return;
    }
    let seen = sharpness(footprint, 0.02);
    let column = column as u32;
    let gap = 2 + seed % 2;
    let pick = cell(column as i32, 0, seed) % 10;
    let glyph = GLYPHS[if column < gap { 10 + pick } else { pick } as usize];
    let [stroke, row] = [(x / 0.0135) as usize, ((0.04 - v) / 0.016) as usize];
    let is_ink = glyph[row.min(4)] >> (2 - stroke.min(2)) & 1 == 1;
    let ink = if column == gap { 0.0 } else { 0.62 + seen * (f32::from(u8::from(is_ink)) - 0.62) };
    local.color *= 1.0 - 0.95 * ink;
}
