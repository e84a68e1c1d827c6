//! Errors like a network's, by a chosen amount and from a seed.
//!
//! Four kinds, all growing with one strength: part boundaries are warped by a smooth field and frayed, the classes are
//! blurred into each other, the box is off, small parts are missed. At strength 1 the sizes are those of the noise
//! model in the literature study (1.1 and 0.6 cells of a 28-cell kernel, 0.7 cells of blur, 2.5 % of the box); the
//! fraying is what a decoder with a stride leaves, the warp what an uncertain outline looks like.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::detection::Detection;
use crate::geometry::Rect;
use crate::parts::CHANNELS;

use super::Oracle;
use super::kernel::Kernel;

/// Standard deviation of the smooth warp at strength 1, in shares of the box (1.1 cells of 28).
const WARP: f64 = 1.1 / 28.0;
/// Standard deviation of each sample's own displacement at strength 1, in shares of the box (0.6 cells of 28).
const FRAY: f64 = 0.6 / 28.0;
/// Standard deviation of the blur at strength 1, in shares of the box (0.7 cells of 28).
const BLUR: f64 = 0.7 / 28.0;
/// Standard deviation of each box edge at strength 1, in shares of the box's side.
const BOX_JITTER: f64 = 0.025;
/// Chance at strength 1 that a part of vanishing size is missed.
const MISS: f64 = 0.5;
/// Share of the box at which a part is missed 1/e times as often as a vanishing one.
const MISS_SIZE: f64 = 0.004;
/// Samples a side of each cell.
const SAMPLES: usize = 4;
/// Control points a side of the warp field.
const FIELD: usize = 8;

/// How much detections err.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Degradation {
    /// 0 for none; about 0.9 makes pixel accuracy 0.85 with 28 cells. `eval::calibrate` finds it for another.
    pub strength: f64,
    /// Same seed, same errors, whatever the order or the number of threads.
    pub seed: u64,
}

/// The strength at which `accuracy(strength)`, which falls with it, meets `target`; by bisection in 0 to 8.
pub fn strength_for_accuracy(mut accuracy: impl FnMut(f64) -> f64, target: f64) -> f64 {
    let (mut low, mut high) = (0.0, 8.0);
    // 12 halvings leave 0.002 of strength, about 0.02 points of accuracy.
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        if accuracy(middle) > target { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// FNV-1a: a hash whose result is fixed.
pub(super) fn hash(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

/// Two seeds as one (the finaliser of `SplitMix64`).
pub(super) fn mix(a: u64, b: u64) -> u64 {
    let mut x = a ^ b.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The detection of vehicle `id` with errors.
pub(super) fn detection(
    oracle: &Oracle,
    id: u16,
    truth: &Rect,
    size: usize,
    degradation: &Degradation,
    seed: u64,
) -> Detection {
    let mut rng = ChaCha8Rng::seed_from_u64(mix(degradation.seed, seed));
    let strength = degradation.strength;
    let bounds = jitter(truth, strength * BOX_JITTER, &mut rng);
    let missed = missed_parts(oracle, id, truth, strength, &mut rng);
    let mut kernel = sample(oracle, id, &bounds, size, strength, &mut rng);
    blur(&mut kernel, strength * BLUR * size as f64);
    let cells = size * size;
    for channel in missed {
        // Where something else is seen too, that takes the place of the missed part; elsewhere it stays.
        for cell in 0..cells {
            let part = kernel.areas[channel * cells + cell];
            let sum: f32 = (0..CHANNELS).map(|k| kernel.areas[k * cells + cell]).sum();
            if sum - part > 0.02 * sum {
                kernel.areas[channel * cells + cell] = 0.0;
            }
        }
    }
    kernel.into_detection(bounds)
}

fn jitter(bounds: &Rect, sigma: f64, rng: &mut ChaCha8Rng) -> Rect {
    // Beyond a quarter of the side the detector would have found another box.
    let mut shift = |side: f64| (normal(rng) * sigma).clamp(-0.25, 0.25) * side;
    let (width, height) = (bounds.width(), bounds.height());
    Rect {
        x_min: bounds.x_min + shift(width),
        y_min: bounds.y_min + shift(height),
        x_max: bounds.x_max + shift(width),
        y_max: bounds.y_max + shift(height),
    }
}

fn missed_parts(
    oracle: &Oracle,
    id: u16,
    bounds: &Rect,
    strength: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<usize> {
    let mask = oracle.vehicle_mask(usize::from(id) - 1, bounds);
    let mut counts = [0usize; CHANNELS];
    mask.labels.iter().for_each(|label| counts[usize::from(*label)] += 1);
    (1..CHANNELS)
        .filter(|channel| {
            let share = counts[*channel] as f64 / bounds.area();
            let chance = strength * MISS * (-share / MISS_SIZE).exp();
            // Drawn for every class, so that one part's size does not change another's luck.
            rng.random::<f64>() < chance
        })
        .collect()
}

/// Samples the frame at displaced positions; what falls outside the image or on another vehicle is unknown.
fn sample(
    oracle: &Oracle,
    id: u16,
    bounds: &Rect,
    size: usize,
    strength: f64,
    rng: &mut ChaCha8Rng,
) -> Kernel {
    let mut kernel = Kernel::empty(size);
    let field: Vec<[f64; 2]> = (0..FIELD * FIELD).map(|_| [normal(rng), normal(rng)]).collect();
    let [width, height] = oracle.parts.size.map(f64::from);
    let cells = size * size;
    let side = size * SAMPLES;
    let weight = 1.0 / (SAMPLES * SAMPLES) as f32;
    for (row, column) in (0..side).flat_map(|row| (0..side).map(move |column| (row, column))) {
        let (u, v) = ((column as f64 + 0.5) / side as f64, (row as f64 + 0.5) / side as f64);
        let warp = field_at(&field, u, v);
        let displaced = |at: f64, warp: f64, rng: &mut ChaCha8Rng| {
            at + strength * (WARP * warp + FRAY * normal(rng))
        };
        let (du, dv) = (displaced(u, warp[0], rng), displaced(v, warp[1], rng));
        let x = (bounds.x_min + du * bounds.width()).round();
        let y = (bounds.y_min + dv * bounds.height()).round();
        let cell = row / SAMPLES * size + column / SAMPLES;
        let inside = x >= 0.0 && y >= 0.0 && x < width && y < height;
        let at = if inside { y as usize * width as usize + x as usize } else { 0 };
        let channel = match oracle.owners[at] {
            _ if !inside => None,
            0 => Some(0),
            owner => (owner == id).then(|| oracle.parts.labels[at] as usize),
        };
        match channel {
            Some(channel) => kernel.areas[channel * cells + cell] += weight,
            None => kernel.unknown[cell] += weight,
        }
    }
    kernel
}

/// The warp field between its control points, with cubic smoothing of the distances.
fn field_at(field: &[[f64; 2]], u: f64, v: f64) -> [f64; 2] {
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let at = |x: f64| {
        let x = x.clamp(0.0, 1.0) * (FIELD - 1) as f64;
        let first = (x as usize).min(FIELD - 2);
        (first, smooth(x - first as f64))
    };
    let ((i, a), (j, b)) = (at(u), at(v));
    let value = |i: usize, j: usize, axis: usize| field[j * FIELD + i][axis];
    std::array::from_fn(|axis| {
        (1.0 - b) * ((1.0 - a) * value(i, j, axis) + a * value(i + 1, j, axis))
            + b * ((1.0 - a) * value(i, j + 1, axis) + a * value(i + 1, j + 1, axis))
    })
}

/// Blurs every channel with a Gaussian of `sigma` cells; the unknown share stays where it is.
fn blur(kernel: &mut Kernel, sigma: f64) {
    if sigma < 0.05 {
        return;
    }
    let m = kernel.size;
    let reach = (3.0 * sigma).ceil() as usize;
    let taps: Vec<f32> =
        (0..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp() as f32).collect();
    let line = |values: &[f32], start: usize, step: usize, out: &mut [f32]| {
        for (i, out) in out.iter_mut().enumerate() {
            let (low, high) = (i.saturating_sub(reach), (i + reach).min(m - 1));
            let (mut sum, mut weights) = (0.0, 0.0);
            for j in low..=high {
                let tap = taps[i.abs_diff(j)];
                sum += tap * values[start + j * step];
                weights += tap;
            }
            *out = sum / weights;
        }
    };
    let mut out = vec![0.0; m];
    for plane in kernel.areas.chunks_exact_mut(m * m) {
        if plane.iter().all(|value| *value == 0.0) {
            continue;
        }
        for row in 0..m {
            line(plane, row * m, 1, &mut out);
            plane[row * m..(row + 1) * m].copy_from_slice(&out);
        }
        for column in 0..m {
            line(plane, column, m, &mut out);
            out.iter().enumerate().for_each(|(row, value)| plane[row * m + column] = *value);
        }
    }
}

/// A standard normal number (Box and Muller, *A Note on the Generation of Random Normal Deviates*, 1958).
pub(super) fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let u: f64 = 1.0 - rng.random::<f64>();
    let v: f64 = rng.random();
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Extent;
    use crate::parts::{PartMask, Scaling};

    /// A vehicle of four quadrants with a small lamp, owned by vehicle 0, on a background.
    fn oracle() -> Oracle {
        let (width, height) = (120usize, 80usize);
        let mut parts = PartMask::background([0, 0], [width as u32, height as u32]);
        let mut owners = vec![0; width * height];
        for y in 15..65 {
            for x in 20..100 {
                let part = match (x < 60, y < 40) {
                    _ if (30..33).contains(&x) && (30..33).contains(&y) => 1,
                    (true, true) => 27,
                    (false, true) => 26,
                    (true, false) => 5,
                    (false, false) => 7,
                };
                parts.labels[y * width + x] = part;
                owners[y * width + x] = 1;
            }
        }
        Oracle {
            parts,
            owners,
            bounds: vec![Rect::new(15.0, 10.0, 105.0, 70.0)],
            extents: vec![Extent::new(1.8, 1.5, 4.4)],
            models: vec![None],
            names: [].into(),
            frame_seed: 3,
        }
    }

    fn accuracy(strength: f64, seed: u64) -> f64 {
        let oracle = oracle();
        let options = super::super::OracleOptions {
            degradation: Some(Degradation { strength, seed }),
            ..Default::default()
        };
        let detection = oracle.detection(0, &options).unwrap();
        let mask = detection.part_mask(oracle.parts.size, Scaling::Bilinear);
        let truth = oracle.vehicle_mask(0, &detection.bounds);
        mask.agreement(&truth)
    }

    #[test]
    fn accuracy_falls_with_strength() {
        let mean = |strength| (0..8).map(|seed| accuracy(strength, seed)).sum::<f64>() / 8.0;
        let (none, some, much) = (mean(0.0), mean(1.0), mean(2.5));
        assert!(none > 0.97 && some < none - 0.02 && much < some - 0.05, "{none} {some} {much}");
    }

    #[test]
    fn same_seed_gives_the_same_errors() {
        assert_eq!(accuracy(1.0, 5).to_bits(), accuracy(1.0, 5).to_bits());
        assert_ne!(accuracy(1.0, 5).to_bits(), accuracy(1.0, 6).to_bits());
    }

    #[test]
    fn bisection_finds_the_strength() {
        let strength = strength_for_accuracy(|s| 1.0 - 0.1 * s, 0.85);
        assert!((strength - 1.5).abs() < 0.01);
    }
}
