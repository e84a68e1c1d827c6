//! Light from all directions as a small image, for reflections and for what surfaces get from the sky.
//!
//! Directions are mapped to a square by an octahedron (Praun and Hoppe 2003), zenith in the middle, so that looking up a
//! direction takes no angle. Coarser levels stand for rougher reflections. The light on a matt surface is kept as nine
//! spherical harmonics (Ramamoorthi and Hanrahan: *An Efficient Representation for Irradiance Environment Maps*,
//! SIGGRAPH 2001).

use nalgebra::Vector3;
use rayon::prelude::*;

type V = Vector3<f32>;

/// Coarser levels than the finest, and itself.
const LEVELS: usize = 6;

/// Radiance all round.
#[derive(Clone, Debug)]
pub(super) struct Environment {
    /// Texels along a side of the finest level.
    size: usize,
    levels: Vec<Vec<V>>,
    irradiance: [V; 9],
}

impl Environment {
    /// Samples a function of unit directions, y down, at `size` x `size` places; a multiple of 32.
    pub(super) fn new(size: usize, radiance: impl Fn(&V) -> V + Sync) -> Self {
        let mut finest = vec![V::zeros(); size * size];
        finest.par_chunks_mut(size).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                *value = radiance(&direction(x, y, size));
            }
        });
        let mut levels = vec![finest];
        while levels.len() < LEVELS {
            let next = halved(&levels[levels.len() - 1], size >> (levels.len() - 1));
            levels.push(next);
        }
        // The second level has the same light in a quarter of the texels.
        let irradiance = project(&levels[1], size / 2);
        Self { size, levels, irradiance }
    }

    /// Radiance seen in a mirror of some roughness.
    pub(super) fn reflected(&self, direction: &V, roughness: f32) -> V {
        let level = (roughness.clamp(0.0, 1.0) * 7.0).min(LEVELS as f32 - 1.0);
        let low = level as usize;
        let fine = self.at(direction, low);
        let share = level - low as f32;
        if share < 0.01 || low + 1 >= LEVELS {
            return fine;
        }
        fine.lerp(&self.at(direction, low + 1), share)
    }

    fn at(&self, direction: &V, level: usize) -> V {
        let size = self.size >> level;
        let [u, v] = octahedral(direction);
        let scale = |u: f32| (u * size as f32 - 0.5).clamp(0.0, size as f32 - 1.001);
        let [x, y] = [scale(u), scale(v)];
        let [ix, iy] = [x as usize, y as usize];
        let [fx, fy] = [x - ix as f32, y - iy as f32];
        let texels = &self.levels[level];
        let i = iy * size + ix;
        let low = texels[i].lerp(&texels[i + 1], fx);
        low.lerp(&texels[i + size].lerp(&texels[i + size + 1], fx), fy)
    }

    /// Radiance of a white matt surface that looks in a direction: 1 under an even sky and ground of 1.
    pub(super) fn irradiance(&self, normal: &V) -> V {
        let [x, y, z] = [normal.x, normal.y, normal.z];
        let c = &self.irradiance;
        // Factors of the paper over pi: 1, 2/3, 1/4.
        let sum = c[0] * 0.282_095
            + (c[1] * y + c[2] * z + c[3] * x) * (0.488_603 * 2.0 / 3.0)
            + (c[4] * (x * y) + c[5] * (y * z) + c[7] * (x * z)) * (1.092_548 * 0.25)
            + c[6] * ((3.0 * z * z - 1.0) * 0.315_392 * 0.25)
            + c[8] * ((x * x - y * y) * 0.546_274 * 0.25);
        sum.sup(&V::zeros())
    }
}

fn octahedral(d: &V) -> [f32; 2] {
    let norm = d.x.abs() + d.y.abs() + d.z.abs();
    let scale = 1.0 / norm.max(1e-9);
    let [x, z] = [d.x * scale, d.z * scale];
    // y points down, so that what is above the horizon has negative y.
    let [x, z] = if d.y <= 0.0 {
        [x, z]
    } else {
        [(1.0 - z.abs()) * 1.0_f32.copysign(x), (1.0 - x.abs()) * 1.0_f32.copysign(z)]
    };
    [0.5 * x + 0.5, 0.5 * z + 0.5]
}

fn direction(x: usize, y: usize, size: usize) -> V {
    let [u, w] = [x, y].map(|i| (2.0 * (i as f32 + 0.5)) / size as f32 - 1.0);
    let up = 1.0 - u.abs() - w.abs();
    let [u, w] = if up >= 0.0 {
        [u, w]
    } else {
        [(1.0 - w.abs()) * 1.0_f32.copysign(u), (1.0 - u.abs()) * 1.0_f32.copysign(w)]
    };
    V::new(u, -up, w).normalize()
}

fn halved(texels: &[V], size: usize) -> Vec<V> {
    let half = size / 2;
    let mean = |i: usize| {
        let at = 2 * (i / half) * size + 2 * (i % half);
        (texels[at] + texels[at + 1] + texels[at + size] + texels[at + size + 1]) * 0.25
    };
    (0..half * half).map(mean).collect()
}

fn project(texels: &[V], size: usize) -> [V; 9] {
    let mut sums = [V::zeros(); 9];
    let mut all = 0.0;
    for i in 0..size {
        for j in 0..size {
            let d = direction(j, i, size);
            // Solid angle of an octahedron's texel, up to a factor.
            let weight = (d.x.abs() + d.y.abs() + d.z.abs()).powi(3);
            let value = texels[i * size + j] * weight;
            all += weight;
            let [x, y, z] = [d.x, d.y, d.z];
            let basis = [
                0.282_095,
                0.488_603 * y,
                0.488_603 * z,
                0.488_603 * x,
                1.092_548 * x * y,
                1.092_548 * y * z,
                0.315_392 * (3.0 * z * z - 1.0),
                1.092_548 * x * z,
                0.546_274 * (x * x - y * y),
            ];
            for (sum, basis) in sums.iter_mut().zip(basis) {
                *sum += value * basis;
            }
        }
    }
    sums.map(|sum| sum * (4.0 * std::f32::consts::PI / all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_white_surface_under_an_even_sky_is_as_bright_as_the_sky() {
        let environment = Environment::new(64, |_| V::repeat(1.0));
        for normal in [V::x(), -V::y(), V::z(), V::new(1.0, -1.0, 1.0).normalize()] {
            let error = (environment.irradiance(&normal) - V::repeat(1.0)).norm();
            assert!(error < 0.01, "{normal:?}: {error}");
        }
    }

    #[test]
    fn a_mirror_shows_what_lies_in_its_direction() {
        let environment = Environment::new(64, |d| d.map(|value| 0.5 + 0.5 * value));
        for direction in [V::x(), -V::y(), V::z(), V::new(0.3, -0.5, -0.8).normalize()] {
            let seen = environment.reflected(&direction, 0.0);
            assert!((seen - direction.map(|value| 0.5 + 0.5 * value)).norm() < 0.03, "{seen:?}");
        }
    }

    #[test]
    fn directions_and_texels_are_inverse() {
        for [x, y] in [[0, 0], [10, 150], [96, 96], [180, 20]] {
            let [u, v] = octahedral(&direction(x, y, 192));
            let scale = 192.0;
            assert!((u * scale - x as f32 - 0.5).abs() < 1e-2);
            assert!((v * scale - y as f32 - 0.5).abs() < 1e-2);
        }
    }
}
