//! Triangles on a grid of samples, set up many at a time and filled eight samples at a time.
//!
//! Of each triangle three edge functions and the plane of 1/z are found, which are affine in the sample's place (Pineda:
//! *A Parallel Algorithm for Polygon Rasterization*, SIGGRAPH 1988). A sample on an edge belongs to both neighbours,
//! which compute the same number with opposite signs: no crack opens between them, and the depth test decides.

// Only what is inlined is compiled for the chosen vectors.
#![allow(clippy::inline_always)]

use pulp::Simd;

use super::raster::LABEL_BITS;

/// By how much a row of samples must be longer than the picture: the most samples that are filled at once.
pub(super) const MARGIN: usize = 16;
const STEPS: [f32; MARGIN] =
    [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0, 15.0];
/// Triangles that are set up at once, and room for those that clipping adds.
const FULL: usize = 64;
const ROOM: usize = FULL + 2;

type Line = [f32; ROOM];

/// Triangles that wait to be drawn.
#[derive(Clone, Debug)]
pub(super) struct Batch {
    count: usize,
    /// Of each corner x, y and 1 / z.
    corners: [[Line; 3]; 3],
    labels: [u32; ROOM],
    /// Edge functions `a x + b y + c`, not negative inside.
    edges: [[Line; 3]; 3],
    /// 1 / z as `a x + b y + c`.
    depth: [Line; 3],
    /// Least and largest 1 / z.
    range: [Line; 2],
    /// First and last rows and columns, the last ones excluded.
    rows: [[u32; ROOM]; 2],
    columns: [[u32; ROOM]; 2],
}

impl Default for Batch {
    fn default() -> Self {
        Self {
            count: 0,
            corners: [[[0.0; ROOM]; 3]; 3],
            labels: [0; ROOM],
            edges: [[[0.0; ROOM]; 3]; 3],
            depth: [[0.0; ROOM]; 3],
            range: [[0.0; ROOM]; 2],
            rows: [[0; ROOM]; 2],
            columns: [[0; ROOM]; 2],
        }
    }
}

/// The whole number at or after `value`, give or take what rounding may hide, within `0..=limit`.
#[inline(always)]
fn at_or_after(value: f32, limit: f32) -> u32 {
    // Adding 1.5 * 2^23 leaves the rounded number in the low bits: `ceil` is a call on plain x86-64.
    const SHIFT: f32 = 12_582_912.0;
    let value = value + 0.5;
    let value = if value > 0.0 { value } else { 0.0 };
    let value = if value < limit { value } else { limit };
    (value + SHIFT).to_bits() - SHIFT.to_bits()
}

#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

impl Batch {
    pub(super) fn is_full(&self) -> bool {
        self.count >= FULL
    }

    #[inline(always)]
    pub(super) fn push(&mut self, corners: [[f32; 3]; 3], label: u32) {
        let at = self.count;
        for (line, corner) in self.corners.iter_mut().zip(corners) {
            for (line, value) in line.iter_mut().zip(corner) {
                line[at] = value;
            }
        }
        self.labels[at] = label;
        self.count += 1;
    }

    /// Draws what waits. Of a closed mesh only triangles that turn counter-clockwise are drawn: a negative area where y
    /// points down.
    #[inline(always)]
    pub(super) fn draw<S: Simd>(
        &mut self,
        simd: S,
        keys: &mut [f32],
        size: usize,
        is_closed: bool,
    ) {
        self.set_up(size as f32, is_closed);
        for at in 0..self.count {
            self.fill(simd, at, keys, size + MARGIN);
        }
        self.count = 0;
    }

    #[inline(always)]
    fn set_up(&mut self, limit: f32, is_closed: bool) {
        /// Rounding may put a sample on either side of an edge that runs through it.
        const SLACK: f32 = 1e-3;
        let [[ax, ay, aw], [bx, by, bw], [cx, cy, cw]] = &self.corners;
        let both = if is_closed { 0.0 } else { f32::INFINITY };
        for i in 0..ROOM {
            let (abx, aby) = (bx[i] - ax[i], by[i] - ay[i]);
            let (acx, acy) = (cx[i] - ax[i], cy[i] - ay[i]);
            let area = abx * acy - aby * acx;
            let turn = if area < 0.0 { -1.0 } else { 1.0 };
            let [p, q, r] = &mut self.edges;
            edge(p, i, [ax[i], ay[i]], [bx[i], by[i]], turn);
            edge(q, i, [bx[i], by[i]], [cx[i], cy[i]], turn);
            edge(r, i, [cx[i], cy[i]], [ax[i], ay[i]], turn);
            let scale = 1.0 / area;
            let (abw, acw) = ((bw[i] - aw[i]) * scale, (cw[i] - aw[i]) * scale);
            let slope_x = abw * acy - acw * aby;
            let slope_y = acw * abx - abw * acx;
            self.depth[0][i] = slope_x;
            self.depth[1][i] = slope_y;
            self.depth[2][i] = aw[i] - slope_x * ax[i] - slope_y * ay[i];
            self.range[0][i] = least(least(aw[i], bw[i]), cw[i]);
            self.range[1][i] = most(most(aw[i], bw[i]), cw[i]);
            // What has no area, or is not a number, is left out too.
            let is_drawn = area < 0.0 || (area > 0.0 && area < both);
            let last = if is_drawn { limit } else { 0.0 };
            let (low, high) = (least(least(ay[i], by[i]), cy[i]), most(most(ay[i], by[i]), cy[i]));
            self.rows[0][i] = at_or_after(low - SLACK, limit);
            self.rows[1][i] = at_or_after(high + SLACK, last);
            let (low, high) = (least(least(ax[i], bx[i]), cx[i]), most(most(ax[i], bx[i]), cx[i]));
            self.columns[0][i] = at_or_after(low - SLACK, limit);
            self.columns[1][i] = at_or_after(high + SLACK, limit);
        }
    }

    #[inline(always)]
    fn fill<S: Simd>(&self, simd: S, at: usize, keys: &mut [f32], stride: usize) {
        let [first, last] = [self.rows[0][at], self.rows[1][at]];
        let [left, right] = [self.columns[0][at], self.columns[1][at]];
        if first >= last || left >= right {
            return;
        }
        let left = left as usize;
        let width = (right as usize - left).next_multiple_of(S::F32_LANES);
        let label = simd.splat_u32s(self.labels[at]);
        let no_label = simd.splat_u32s(!LABEL_BITS);
        let [low, high] = [self.range[0][at], self.range[1][at]].map(|w| simd.splat_f32s(w));
        let (nothing, empty) = (simd.splat_f32s(0.0), simd.splat_u32s(0));
        let steps = S::as_simd_f32s(&STEPS).0[0];
        let start = simd.add_f32s(simd.splat_f32s(left as f32), steps);
        let next = simd.splat_f32s(S::F32_LANES as f32);
        let [p, q, r] = &self.edges;
        let d = &self.depth;
        let along = [p[0][at], q[0][at], r[0][at], d[0][at]];
        let down = [p[1][at], q[1][at], r[1][at], d[1][at]];
        let from = [p[2][at], q[2][at], r[2][at], d[2][at]];
        let splat = |v: [f32; 4]| {
            let [a, b, c, d] = v;
            [simd.splat_f32s(a), simd.splat_f32s(b), simd.splat_f32s(c), simd.splat_f32s(d)]
        };
        let along = splat(along);
        for y in first..last {
            let at_y = y as f32;
            let y = y as usize;
            let of_row = splat([
                down[0] * at_y + from[0],
                down[1] * at_y + from[1],
                down[2] * at_y + from[2],
                down[3] * at_y + from[3],
            ]);
            let row = &mut keys[y * stride + left..][..width];
            let mut x = start;
            for keys in S::as_mut_simd_f32s(row).0 {
                let value = |i: usize| simd.add_f32s(simd.mul_f32s(along[i], x), of_row[i]);
                let inside = simd.min_f32s(simd.min_f32s(value(0), value(1)), value(2));
                let inside = simd.greater_than_or_equal_f32s(inside, nothing);
                let w = simd.max_f32s(simd.min_f32s(value(3), high), low);
                let key = simd.and_u32s(simd.transmute_u32s_f32s(w), no_label);
                let key = simd.select_u32s(inside, simd.or_u32s(key, label), empty);
                *keys = simd.max_f32s(simd.transmute_f32s_u32s(key), *keys);
                x = simd.add_f32s(x, next);
            }
        }
    }
}

/// The line through two corners. Both neighbours of an edge get the same numbers, or the same with opposite signs.
#[inline(always)]
fn edge(lines: &mut [Line; 3], at: usize, from: [f32; 2], to: [f32; 2], turn: f32) {
    lines[0][at] = turn * (from[1] - to[1]);
    lines[1][at] = turn * (to[0] - from[0]);
    lines[2][at] = turn * (from[0] * to[1] - to[0] * from[1]);
}
