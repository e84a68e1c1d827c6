//! How far the drawn model is from the probabilities: half the weighted Brier score, cell by cell.
//!
//! `D = 1/2 sum_c w_c sum_k (f_ck - q_ck)^2`, where f is the share of the cell's samples with label k and q the
//! probability; background is a label like the others. A cell's term is bounded by its weight, which is all the
//! robustness that the fit needs while it searches.

use super::raster::Raster;
use super::target::{LANES, Target};

/// The data term for the last picture of `raster`, whose size is a multiple of the target's.
pub(super) fn data_energy(target: &Target, raster: &Raster) -> f64 {
    let m = target.cells;
    let s = raster.size / m;
    let scale = 1.0 / (s * s) as f32;
    let mut counts = [0u16; LANES];
    let mut sum = 0.0f64;
    for cell_y in 0..m {
        let mut of_row = 0.0f32;
        for cell_x in 0..m {
            let cell = cell_y * m + cell_x;
            let weight = target.weights[cell];
            if weight == 0.0 {
                continue;
            }
            let q = &target.probabilities[cell];
            let start = cell_y * s * raster.size + cell_x * s;
            let first = raster.labels[start];
            let mut is_uniform = true;
            for y in 0..s {
                is_uniform &= is_all(&raster.labels[start + y * raster.size..][..s], first);
            }
            let brier = if is_uniform {
                1.0 - 2.0 * q[usize::from(first) & (LANES - 1)] + target.squares[cell]
            } else {
                // The sum of squared counts grows by 2 n + 1 with each sample, n being those before it.
                let (mut pairs, mut hits) = (0u32, 0.0f32);
                for y in 0..s {
                    for label in &raster.labels[start + y * raster.size..][..s] {
                        let label = usize::from(*label) & (LANES - 1);
                        pairs += 2 * u32::from(counts[label]) + 1;
                        counts[label] += 1;
                        hits += q[label];
                    }
                }
                for y in 0..s {
                    for label in &raster.labels[start + y * raster.size..][..s] {
                        counts[usize::from(*label) & (LANES - 1)] = 0;
                    }
                }
                pairs as f32 * scale * scale - 2.0 * hits * scale + target.squares[cell]
            };
            of_row += weight * brier;
        }
        sum += f64::from(of_row);
    }
    0.5 * sum
}

/// Whether all labels of a short row are the same as `first`.
#[inline]
fn is_all(row: &[u8], first: u8) -> bool {
    match row {
        [a, b] => *a == first && *b == first,
        [a, b, c, d] => u32::from_le_bytes([*a, *b, *c, *d]) == u32::from(first) * 0x0101_0101,
        _ => row.iter().all(|label| *label == first),
    }
}
