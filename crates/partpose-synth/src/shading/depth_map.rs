//! Heights of a surface above a plane, seen along its normal: for shadows and for how open a vertex lies.

use nalgebra::Vector3;

use super::noise::{ceil, floor};

/// Triangles whose box is as wide as this or wider are solved for row by row.
const WIDE: i32 = 6;
/// Texels of a row that are looked at together.
const LANES: usize = 8;

/// Heights, row by row; minus infinity where nothing is.
#[derive(Clone, Debug)]
pub(crate) struct DepthMap {
    pub(crate) size: [usize; 2],
    pub(crate) heights: Vec<f32>,
}

impl DepthMap {
    pub(crate) fn new(size: [usize; 2]) -> Self {
        Self { size, heights: vec![f32::NEG_INFINITY; size[0] * size[1]] }
    }

    /// The height at a place in pixels; what lies outside is empty.
    pub(crate) fn at(&self, x: f32, y: f32) -> f32 {
        if !(x >= 0.0 && y >= 0.0) || x as usize >= self.size[0] || y as usize >= self.size[1] {
            return f32::NEG_INFINITY;
        }
        self.heights[y as usize * self.size[0] + x as usize]
    }

    /// Draws a triangle of (x, y, height), keeping the greater heights.
    ///
    /// No care is taken of shared edges, which a shadow does not show.
    #[inline]
    pub(crate) fn draw(&mut self, corners: [Vector3<f32>; 3]) {
        let width = self.size[0];
        let heights = &mut self.heights;
        cover(self.size, &corners, |y, [from, to], plane| {
            let row = &mut heights[y * width + from..=y * width + to];
            let start = plane.at(from, y);
            for (k, old) in row.iter_mut().enumerate() {
                let height = start + plane.slope[0] * k as f32;
                *old = if height > *old { height } else { *old };
            }
        });
    }

    /// As [`Self::draw`], where `is_there` holds of the texture's coordinates.
    #[inline]
    pub(crate) fn draw_where(
        &mut self,
        corners: [Vector3<f32>; 3],
        [a, b, c]: [[f32; 2]; 3],
        is_there: impl Fn([f32; 2]) -> bool,
    ) {
        let width = self.size[0];
        let heights = &mut self.heights;
        cover(self.size, &corners, |y, [from, to], plane| {
            let [start, [wb, wc]] = [[plane.at(from, y), 0.0], plane.weights(from, y)];
            let mix = |i: usize, wb: f32, wc: f32| wb * (b[i] - a[i]) + wc * (c[i] - a[i]);
            let first = [0, 1].map(|i| a[i] + mix(i, wb, wc));
            let change = [0, 1].map(|i| mix(i, plane.second[0], plane.third[0]));
            let row = &mut heights[y * width + from..=y * width + to];
            for (block, row) in row.chunks_mut(LANES).enumerate() {
                // Some at a time: heights first, without a branch, since most rows end behind what is drawn already.
                let k = (block * LANES) as f32;
                let height = start[0] + plane.slope[0] * k;
                let mut new = [0.0_f32; LANES];
                for (lane, new) in new.iter_mut().enumerate() {
                    *new = height + plane.slope[0] * lane as f32;
                }
                if !row.iter().zip(&new).fold(false, |any, (old, new)| any || new > old) {
                    continue;
                }
                let place = [0, 1].map(|i| first[i] + change[i] * k);
                for (lane, (old, new)) in row.iter_mut().zip(new).enumerate() {
                    let there = is_there([0, 1].map(|i| place[i] + change[i] * lane as f32));
                    *old = if there && new > *old { new } else { *old };
                }
            }
        });
    }
}

/// What varies over a triangle.
struct Plane {
    corner: Vector3<f32>,
    /// Weight of the second and of the third corner, a pixel to the right and down.
    second: [f32; 2],
    third: [f32; 2],
    /// Height a pixel to the right and down.
    slope: [f32; 2],
}

impl Plane {
    fn offset(&self, x: usize, y: usize) -> [f32; 2] {
        [x as f32 + 0.5 - self.corner.x, y as f32 + 0.5 - self.corner.y]
    }

    fn at(&self, x: usize, y: usize) -> f32 {
        let [dx, dy] = self.offset(x, y);
        self.corner.z + self.slope[0] * dx + self.slope[1] * dy
    }

    fn weights(&self, x: usize, y: usize) -> [f32; 2] {
        let [dx, dy] = self.offset(x, y);
        [self.second[0] * dx + self.second[1] * dy, self.third[0] * dx + self.third[1] * dy]
    }
}

/// Calls `set` with every row and its first and last covered column.
#[inline]
fn cover(
    size: [usize; 2],
    [a, b, c]: &[Vector3<f32>; 3],
    mut set: impl FnMut(usize, [usize; 2], &Plane),
) {
    let low = |p: f32, q: f32, r: f32| ceil(p.min(q).min(r) - 0.5).max(0);
    let high =
        |p: f32, q: f32, r: f32, size: usize| floor(p.max(q).max(r) - 0.5).min(size as i32 - 1);
    let [x0, x1] = [low(a.x, b.x, c.x), high(a.x, b.x, c.x, size[0])];
    let [y0, y1] = [low(a.y, b.y, c.y), high(a.y, b.y, c.y, size[1])];
    let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if x0 > x1 || y0 > y1 || !(area.abs() > 0.0) {
        return;
    }
    let scale = 1.0 / area;
    let second = [(c.y - a.y) * scale, -(c.x - a.x) * scale];
    let third = [-(b.y - a.y) * scale, (b.x - a.x) * scale];
    let [rise_b, rise_c] = [b.z - a.z, c.z - a.z];
    let slope = [0, 1].map(|i| second[i] * rise_b + third[i] * rise_c);
    let plane = Plane { corner: *a, second, third, slope };
    for y in y0..=y1 {
        let dy = y as f32 + 0.5 - a.y;
        let [row_b, row_c] = [second[1] * dy, third[1] * dy];
        let [mut from, mut to] = [x0, x1];
        if x1 - x0 < WIDE {
            let is_in = |x: i32| {
                let dx = x as f32 + 0.5 - a.x;
                let [wb, wc] = [second[0] * dx + row_b, third[0] * dx + row_c];
                wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0
            };
            while from <= to && !is_in(from) {
                from += 1;
            }
            while from < to && !is_in(to) {
                to -= 1;
            }
        } else {
            // The span where all three weights are not negative.
            let mut clip = |slope: f32, at_zero: f32| {
                // slope * (x + 0.5 - a.x) + at_zero >= 0
                let root = a.x - 0.5 - at_zero / slope;
                if slope > 0.0 {
                    from = from.max(ceil(root));
                } else if slope < 0.0 {
                    to = to.min(floor(root));
                } else if at_zero < 0.0 {
                    to = -1;
                }
            };
            clip(second[0], row_b);
            clip(third[0], row_c);
            clip(-second[0] - third[0], 1.0 - row_b - row_c);
        }
        if from <= to {
            set(y as usize, [from as usize, to as usize], &plane);
        }
    }
}
