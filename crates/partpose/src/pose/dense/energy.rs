//! How far the drawn model is from the probabilities: half the weighted Brier score, cell by cell.
//!
//! `D = 1/2 sum_c w_c sum_k (f_ck - q_ck)^2`, where f is the share of the cell's samples with label k and q the
//! probability; background is a label like the others. A cell's term is bounded by its weight, which is all the
//! robustness that the fit needs while it searches.

use pulp::{Simd, WithSimd};

use super::cell::Packed;
use super::raster::Raster;
use super::target::{LANES, Target};
use super::vector;

/// The data term for the last picture of `raster`, whose size is a multiple of the target's.
pub(super) fn data_energy(target: &Target, raster: &Raster) -> f64 {
    match raster.size / target.cells {
        1 => vector::dispatch(Sum::<1> { target, raster }),
        2 => vector::dispatch(Sum::<2> { target, raster }),
        3 => vector::dispatch(Sum::<3> { target, raster }),
        4 => vector::dispatch(Sum::<4> { target, raster }),
        _ => of_many_samples(target, raster),
    }
}

/// Cells of S x S samples.
struct Sum<'a, const S: usize> {
    target: &'a Target,
    raster: &'a Raster,
}

// Only what is inlined is compiled for the chosen vectors.
#[allow(clippy::inline_always)]
impl<const S: usize> WithSimd for Sum<'_, S> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<V: Simd>(self, _: V) -> f64 {
        let Self { target, raster } = self;
        let (m, n) = (target.cells, raster.size);
        let scale = 1.0 / (S * S) as f32;
        let mut sum = 0.0f64;
        for cell_y in 0..m {
            let of_row = cell_y * m..(cell_y + 1) * m;
            let weights = &target.weights[of_row.clone()];
            let squares = &target.squares[of_row.clone()];
            let probabilities = &target.probabilities[of_row];
            let labels = &raster.labels[cell_y * S * n..][..S * n];
            let mut of_row = 0.0f32;
            for cell_x in 0..m {
                let weight = weights[cell_x];
                if weight == 0.0 {
                    continue;
                }
                let q = &probabilities[cell_x];
                let cell = Packed::<S>::new(labels, n, cell_x * S);
                let brier = if let Some(label) = cell.uniform() {
                    1.0 - 2.0 * q[usize::from(label) & (LANES - 1)]
                } else {
                    let (mut pairs, mut hits) = (0, 0.0f32);
                    cell.tally(|label, count| {
                        pairs += count * count;
                        hits += count as f32 * q[usize::from(label) & (LANES - 1)];
                    });
                    (pairs as f32 * scale - 2.0 * hits) * scale
                };
                of_row += weight * (brier + squares[cell_x]);
            }
            sum += f64::from(of_row);
        }
        0.5 * sum
    }
}

/// The same for cells of any number of samples.
fn of_many_samples(target: &Target, raster: &Raster) -> f64 {
    let m = target.cells;
    let s = raster.size / m;
    let scale = 1.0 / (s * s) as f32;
    let mut counts = [0u16; LANES];
    let mut sum = 0.0f64;
    for cell in 0..m * m {
        let weight = target.weights[cell];
        if weight == 0.0 {
            continue;
        }
        let q = &target.probabilities[cell];
        let start = super::cell::start(raster, m, cell);
        let rows = || (0..s).map(|y| &raster.labels[start + y * raster.size..][..s]);
        // The sum of squared counts grows by 2 n + 1 with each sample, n being those before it.
        let (mut pairs, mut hits) = (0u32, 0.0f32);
        for label in rows().flatten() {
            let label = usize::from(*label) & (LANES - 1);
            pairs += 2 * u32::from(counts[label]) + 1;
            counts[label] += 1;
            hits += q[label];
        }
        for label in rows().flatten() {
            counts[usize::from(*label) & (LANES - 1)] = 0;
        }
        let brier = (pairs as f32 * scale - 2.0 * hits) * scale + target.squares[cell];
        sum += f64::from(weight * brier);
    }
    0.5 * sum
}
