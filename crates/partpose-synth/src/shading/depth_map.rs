//! Heights of a surface above a plane, seen along its normal: for shadows and for how open a vertex lies.

use nalgebra::Vector3;

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
    pub(crate) fn draw(&mut self, corners: [Vector3<f32>; 3]) {
        self.draw_where(corners, |_| true);
    }

    /// As [`Self::draw`], where `is_there` holds of the weights of the second and third corner.
    pub(crate) fn draw_where(
        &mut self,
        [a, b, c]: [Vector3<f32>; 3],
        is_there: impl Fn([f32; 2]) -> bool,
    ) {
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        let low = |p: f32, q: f32, r: f32| (p.min(q).min(r) - 0.5).ceil().max(0.0);
        let high = |p: f32, q: f32, r: f32, size: usize| {
            (p.max(q).max(r) - 0.5).floor().min(size as f32 - 1.0)
        };
        let [x0, x1] = [low(a.x, b.x, c.x), high(a.x, b.x, c.x, self.size[0])];
        let [y0, y1] = [low(a.y, b.y, c.y), high(a.y, b.y, c.y, self.size[1])];
        if !(x0 <= x1 && y0 <= y1) || area == 0.0 {
            return;
        }
        let scale = 1.0 / area;
        // Weights of b and c as functions of the pixel.
        let slope_b = [(c.y - a.y) * scale, -(c.x - a.x) * scale];
        let slope_c = [-(b.y - a.y) * scale, (b.x - a.x) * scale];
        for y in y0 as usize..=y1 as usize {
            let row = y * self.size[0];
            let dy = y as f32 + 0.5 - a.y;
            // The span where all three weights are not negative.
            let [mut from, mut to] = [x0, x1];
            let mut clip = |slope: f32, at_zero: f32| {
                // slope * (x + 0.5 - a.x) + at_zero >= 0
                let root = a.x - 0.5 - at_zero / slope;
                if slope > 0.0 {
                    from = from.max(root.ceil());
                } else if slope < 0.0 {
                    to = to.min(root.floor());
                } else if at_zero < 0.0 {
                    to = -1.0;
                }
            };
            let [row_b, row_c] = [slope_b[1] * dy, slope_c[1] * dy];
            clip(slope_b[0], row_b);
            clip(slope_c[0], row_c);
            clip(-slope_b[0] - slope_c[0], 1.0 - row_b - row_c);
            if !(from <= to) {
                continue;
            }
            for x in from as usize..=to as usize {
                let dx = x as f32 + 0.5 - a.x;
                let [wb, wc] = [slope_b[0] * dx + row_b, slope_c[0] * dx + row_c];
                let height = a.z + wb * (b.z - a.z) + wc * (c.z - a.z);
                let old = &mut self.heights[row + x];
                if height > *old && is_there([wb, wc]) {
                    *old = height;
                }
            }
        }
    }
}
