//! Tiles to points and back, as many side by side as a vector holds.
//!
//! Written without closures: only plain functions are sure to be compiled for the chosen vectors.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use pulp::Simd;

use super::{IN, OUT};

/// A vector from the beginning of a slice.
#[inline(always)]
pub(super) fn load<S: Simd>(_: S, from: &[f32]) -> S::f32s {
    S::as_simd_f32s(&from[..S::F32_LANES]).0[0]
}

#[inline(always)]
pub(super) fn store<S: Simd>(_: S, to: &mut [f32], value: S::f32s) {
    S::as_mut_simd_f32s(&mut to[..S::F32_LANES]).0[0] = value;
}

/// `factor * value + plus`.
#[inline(always)]
pub(super) fn times<S: Simd>(simd: S, factor: f32, value: S::f32s, plus: S::f32s) -> S::f32s {
    simd.mul_add_f32s(simd.splat_f32s(factor), value, plus)
}

/// Transforms as many tiles as a vector holds; elements lie `columns` apart, points `step`.
#[inline(always)]
pub(super) fn tile_of_input<S: Simd>(
    simd: S,
    from: &[f32],
    columns: usize,
    to: &mut [f32],
    step: usize,
) {
    let mut half = [[simd.splat_f32s(0.0); IN]; IN];
    for x in 0..IN {
        let mut column = [simd.splat_f32s(0.0); IN];
        for y in 0..IN {
            column[y] = load(simd, &from[(y * IN + x) * columns..]);
        }
        let points = points_from_input(simd, column);
        for y in 0..IN {
            half[y][x] = points[y];
        }
    }
    for y in 0..IN {
        let points = points_from_input(simd, half[y]);
        for x in 0..IN {
            store(simd, &mut to[(y * IN + x) * step..], points[x]);
        }
    }
}

/// The same for tiles of the output's gradient.
#[inline(always)]
pub(super) fn tile_of_output<S: Simd>(
    simd: S,
    from: &[f32],
    columns: usize,
    to: &mut [f32],
    step: usize,
) {
    let mut half = [[simd.splat_f32s(0.0); OUT]; IN];
    for x in 0..OUT {
        let mut column = [simd.splat_f32s(0.0); OUT];
        for y in 0..OUT {
            column[y] = load(simd, &from[(y * OUT + x) * columns..]);
        }
        let points = points_from_output(simd, column);
        for y in 0..IN {
            half[y][x] = points[y];
        }
    }
    for y in 0..IN {
        let points = points_from_output(simd, half[y]);
        for x in 0..IN {
            store(simd, &mut to[(y * IN + x) * step..], points[x]);
        }
    }
}

/// Back from points, `step` apart, to elements, `columns` apart.
#[inline(always)]
pub(super) fn tile_from_points<S: Simd>(
    simd: S,
    (from, step): (&[f32], usize),
    bias: S::f32s,
    (to, columns): (&mut [f32], usize),
) {
    let mut half = [[simd.splat_f32s(0.0); IN]; OUT];
    for x in 0..IN {
        let mut column = [simd.splat_f32s(0.0); IN];
        for y in 0..IN {
            column[y] = load(simd, &from[(y * IN + x) * step..]);
        }
        let values = output_from_points(simd, column);
        for y in 0..OUT {
            half[y][x] = values[y];
        }
    }
    for y in 0..OUT {
        let values = output_from_points(simd, half[y]);
        for x in 0..OUT {
            let value = simd.add_f32s(values[x], bias);
            store(simd, &mut to[(y * OUT + x) * columns..], value);
        }
    }
}

#[inline(always)]
fn points_from_input<S: Simd>(simd: S, d: [S::f32s; IN]) -> [S::f32s; IN] {
    let a = times(simd, -4.0, d[2], d[4]);
    let b = times(simd, -4.0, d[1], d[3]);
    let c = simd.sub_f32s(d[4], d[2]);
    let e = simd.sub_f32s(d[3], d[1]);
    [
        times(simd, 4.0, d[0], times(simd, -5.0, d[2], d[4])),
        simd.add_f32s(a, b),
        simd.sub_f32s(a, b),
        times(simd, 2.0, e, c),
        times(simd, -2.0, e, c),
        times(simd, 4.0, d[1], times(simd, -5.0, d[3], d[5])),
    ]
}

/// The transpose of [`output_from_points`].
#[inline(always)]
fn points_from_output<S: Simd>(simd: S, y: [S::f32s; OUT]) -> [S::f32s; IN] {
    let even = simd.add_f32s(y[0], y[2]);
    let odd = simd.add_f32s(y[1], y[3]);
    let far_even = times(simd, 4.0, y[2], y[0]);
    let far_odd = times(simd, 4.0, y[3], y[1]);
    [
        y[0],
        simd.add_f32s(even, odd),
        simd.sub_f32s(even, odd),
        times(simd, 2.0, far_odd, far_even),
        times(simd, -2.0, far_odd, far_even),
        y[3],
    ]
}

#[inline(always)]
fn output_from_points<S: Simd>(simd: S, m: [S::f32s; IN]) -> [S::f32s; OUT] {
    let sum = simd.add_f32s(m[1], m[2]);
    let difference = simd.sub_f32s(m[1], m[2]);
    let far_sum = simd.add_f32s(m[3], m[4]);
    let far_difference = simd.sub_f32s(m[3], m[4]);
    [
        simd.add_f32s(m[0], simd.add_f32s(sum, far_sum)),
        times(simd, 2.0, far_difference, difference),
        times(simd, 4.0, far_sum, sum),
        times(simd, 8.0, far_difference, simd.add_f32s(difference, m[5])),
    ]
}
