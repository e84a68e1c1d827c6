//! Softness, colour fringes, dark corners and glare.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::scene::Scene;

use super::Frame;

/// Blurs by a Gaussian of some pixels.
pub(super) fn soften(frame: &mut Frame, deviation: f32) {
    let side = (-0.5 / (deviation * deviation)).exp();
    let scale = 1.0 / (1.0 + 2.0 * side);
    let weights = [side * scale, scale, side * scale];
    let [width, height] = frame.size;
    frame.pixels.par_chunks_mut(width.max(1)).for_each(|row| {
        let Some(first) = row.first() else { return };
        let mut before = *first;
        for x in 0..row.len() {
            let here = row[x];
            let after = row[(x + 1).min(row.len() - 1)];
            for i in 0..3 {
                row[x][i] = weights[0] * before[i] + weights[1] * here[i] + weights[2] * after[i];
            }
            before = here;
        }
    });
    frame.old.clone_from(&frame.pixels);
    let old = &frame.old;
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let [above, below] = [y.saturating_sub(1), (y + 1).min(height - 1)]
            .map(|y| old[y * width..(y + 1) * width].as_flattened());
        for ((value, above), below) in row.as_flattened_mut().iter_mut().zip(above).zip(below) {
            *value = weights[0] * above + weights[1] * *value + weights[2] * below;
        }
    });
}

/// Red is imaged a little larger than green, blue a little smaller.
pub(super) fn part_colors(frame: &mut Frame, corner: f32) {
    let [width, height] = frame.size;
    let middle = [0.5 * width as f32, 0.5 * height as f32];
    let scale = corner / middle[0].hypot(middle[1]).max(1.0);
    // A place's neighbour and its share depend on the column alone or on the row alone.
    let places = |side: usize, middle: f32, sign: f32| -> Vec<(usize, f32)> {
        let place = |i: usize| {
            let at = i as f32 + sign * (i as f32 - middle) * scale;
            let at = at.clamp(0.0, (side as f32 - 1.001).max(0.0));
            (at as usize, at - (at as usize) as f32)
        };
        (0..side).map(place).collect()
    };
    let tables =
        [-1.0, 1.0].map(|sign| [places(width, middle[0], sign), places(height, middle[1], sign)]);
    frame.old.clone_from(&frame.pixels);
    let old = &frame.old;
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for ([columns, rows], channel) in tables.iter().zip([0, 2]) {
            let (iy, fy) = rows[y];
            let upper = &old[iy * width..];
            let lower = &old[(iy + 1).min(height - 1) * width..];
            for (value, (ix, fx)) in row.iter_mut().zip(columns) {
                let right = (ix + 1).min(width - 1);
                let mix = |row: &[[f32; 3]]| {
                    let [a, b] = [row[*ix][channel], row[right][channel]];
                    a + fx * (b - a)
                };
                let above = mix(upper);
                value[channel] = above + fy * (mix(lower) - above);
            }
        }
    });
}

/// The picture between pixels.
#[inline]
pub(super) fn between(pixels: &[[f32; 3]], size: [usize; 2], at: [f32; 2]) -> [f32; 3] {
    let x = at[0].clamp(0.0, size[0] as f32 - 1.001);
    let y = at[1].clamp(0.0, size[1] as f32 - 1.001);
    let [ix, iy] = [x as usize, y as usize];
    let [fx, fy] = [x - ix as f32, y - iy as f32];
    let i = iy * size[0] + ix;
    let right = usize::from(ix + 1 < size[0]);
    let below = if iy + 1 < size[1] { size[0] } else { 0 };
    let corners = [i, i + right, i + below, i + below + right].map(|i| pixels[i]);
    let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
    [0, 1, 2].map(|c| {
        let above = mix(corners[0][c], corners[1][c], fx);
        mix(above, mix(corners[2][c], corners[3][c], fx), fy)
    })
}

/// The same at a place that has pixels on all sides.
#[inline]
pub(super) fn between_four(pixels: &[[f32; 3]], width: usize, at: [f32; 2]) -> [f32; 3] {
    let [ix, iy] = at.map(|x| x as u32);
    let [fx, fy] = [at[0] - ix as f32, at[1] - iy as f32];
    let i = iy as usize * width + ix as usize;
    let (upper, lower) = (&pixels[i..i + 2], &pixels[i + width..i + width + 2]);
    let mix = |a: f32, b: f32, share: f32| a + share * (b - a);
    [0, 1, 2].map(|c| {
        let above = mix(upper[0][c], upper[1][c], fx);
        mix(above, mix(lower[0][c], lower[1][c], fx), fy)
    })
}

/// Less light towards the corners.
pub(super) fn vignette(frame: &mut Frame, loss: f32) {
    let [width, height] = frame.size;
    let middle = [0.5 * width as f32, 0.5 * height as f32];
    let scale = 1.0 / (middle[0] * middle[0] + middle[1] * middle[1]).max(1.0);
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let dy = y as f32 - middle[1];
        for (x, value) in row.iter_mut().enumerate() {
            let dx = x as f32 - middle[0];
            let share = 1.0 - loss * (dx * dx + dy * dy) * scale;
            *value = value.map(|v| v * share);
        }
    });
}

/// Side of the cells in which glare is computed, pixels.
const CELL: usize = 8;

/// Light that is scattered round bright places, and the sun's ghosts.
pub(super) fn flare(frame: &mut Frame, scene: &Scene, gain: [f32; 3], strength: f32) {
    let [width, height] = frame.size;
    let [columns, rows] = [width.div_ceil(CELL), height.div_ceil(CELL)];
    let mut cells = vec![[0.0_f32; 3]; columns * rows];
    cells.par_chunks_mut(columns.max(1)).enumerate().for_each(|(j, row)| {
        for (i, cell) in row.iter_mut().enumerate() {
            for y in j * CELL..((j + 1) * CELL).min(height) {
                for x in i * CELL..((i + 1) * CELL).min(width) {
                    let pixel = frame.pixels[y * width + x];
                    for (sum, value) in cell.iter_mut().zip(pixel) {
                        *sum += (value - 0.9).clamp(0.0, 30.0);
                    }
                }
            }
            *cell = cell.map(|sum| sum / (CELL * CELL) as f32);
        }
    });
    // Three boxes are nearly a Gaussian; twice, for a narrow and a wide glow.
    let near = boxed(&boxed(&cells, [columns, rows], 1), [columns, rows], 2);
    let wide = boxed(&boxed(&near, [columns, rows], 6), [columns, rows], 10);
    let veil = sun_veil(scene, gain, frame.size);
    let glow: Vec<[f32; 3]> = near
        .iter()
        .zip(&wide)
        .map(|(near, wide)| [0, 1, 2].map(|i| strength * (0.10 * near[i] + 0.12 * wide[i])))
        .collect();
    frame.pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let v = ((y as f32 + 0.5) / CELL as f32 - 0.5).clamp(0.0, rows as f32 - 1.0);
        let upper = v as usize;
        let lower = (upper + 1).min(rows - 1);
        let share = v - upper as f32;
        let between_rows = |column: usize| {
            let [a, b] = [glow[upper * columns + column], glow[lower * columns + column]];
            [0, 1, 2].map(|i| a[i] + share * (b[i] - a[i]))
        };
        let glow: Vec<[f32; 3]> = (0..columns).map(between_rows).collect();
        for (x, value) in row.iter_mut().enumerate() {
            let u = ((x as f32 + 0.5) / CELL as f32 - 0.5).clamp(0.0, columns as f32 - 1.0);
            let left = u as usize;
            let [a, b] = [glow[left], glow[(left + 1).min(columns - 1)]];
            let share = u - left as f32;
            let veil = veil.as_ref().map_or([0.0; 3], |veil| veil.at([x as f32, y as f32]));
            for i in 0..3 {
                value[i] += a[i] + share * (b[i] - a[i]) + strength * veil[i];
            }
        }
    });
}

/// Mean over a square of cells, edges repeated.
fn boxed(cells: &[[f32; 3]], [columns, rows]: [usize; 2], reach: i64) -> Vec<[f32; 3]> {
    let along = |cells: &[[f32; 3]], count: usize, stride: usize, other: usize, jump: usize| {
        let mut out = vec![[0.0; 3]; cells.len()];
        for line in 0..other {
            for i in 0..count {
                let mut sum = [0.0; 3];
                for k in -reach..=reach {
                    let at = (i as i64 + k).clamp(0, count as i64 - 1) as usize;
                    let cell = cells[line * jump + at * stride];
                    for (sum, value) in sum.iter_mut().zip(cell) {
                        *sum += value;
                    }
                }
                out[line * jump + i * stride] = sum.map(|v: f32| v / (2 * reach + 1) as f32);
            }
        }
        out
    };
    let rows_done = along(cells, columns, 1, rows, columns);
    along(&rows_done, rows, columns, columns, 1)
}

/// What the sun, in the picture or near it, spreads over the picture.
struct Veil {
    sun: [f32; 2],
    color: [f32; 3],
    width: f32,
    ghosts: [([f32; 2], f32, [f32; 3]); 4],
}

fn sun_veil(scene: &Scene, gain: [f32; 3], [width, height]: [usize; 2]) -> Option<Veil> {
    let clear = (1.0 - 1.15 * scene.light.overcast).clamp(0.0, 1.0) as f32;
    let camera_from_world = scene.world_from_camera.inverse();
    let direction: Vector3<f64> = camera_from_world * scene.light.to_sun;
    if clear <= 0.0 || direction.z < 0.2 || scene.light.to_sun.y > -0.02 {
        return None;
    }
    let at = scene.camera.project(&Point3::from(direction))?;
    let sun = [at.x as f32, at.y as f32];
    let middle = [0.5 * width as f32, 0.5 * height as f32];
    let size = width as f32;
    let outside = (sun[0] - middle[0]).abs().max((sun[1] - middle[1]).abs()) / size;
    let level = clear * (1.2 - outside).clamp(0.0, 1.0) * 0.12;
    let color = [1.0, 0.93, 0.8].map(|value: f32| value * level);
    let color = [0, 1, 2].map(|i| color[i] * gain[i].min(6.0));
    let ghost = |share: f32, radius: f32, tint: [f32; 3]| {
        let at = [0, 1].map(|i| middle[i] + share * (sun[i] - middle[i]));
        (at, radius * size, [0, 1, 2].map(|i| 0.14 * color[i] * tint[i]))
    };
    let ghosts = [
        ghost(-0.35, 0.018, [0.6, 1.0, 0.7]),
        ghost(-0.7, 0.04, [0.5, 0.6, 1.0]),
        ghost(0.45, 0.012, [1.0, 0.7, 0.4]),
        ghost(-1.15, 0.07, [0.8, 0.5, 0.9]),
    ];
    Some(Veil { sun, color, width: 0.22 * size, ghosts })
}

impl Veil {
    fn at(&self, [x, y]: [f32; 2]) -> [f32; 3] {
        let distance_to = |[u, v]: [f32; 2]| ((x - u) * (x - u) + (y - v) * (y - v)).sqrt();
        let distance = distance_to(self.sun) / self.width;
        let share = 1.0 / (1.0 + 4.0 * distance * distance);
        let mut sum = self.color.map(|value| value * share);
        for (at, radius, color) in &self.ghosts {
            let distance = distance_to(*at) / radius;
            if distance < 1.0 {
                let edge = ((1.0 - distance) * 8.0).min(1.0) * (0.4 + 0.6 * distance);
                for (sum, value) in sum.iter_mut().zip(color) {
                    *sum += value * edge;
                }
            }
        }
        sum
    }
}
