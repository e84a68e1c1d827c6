//! Triangles to samples.
//!
//! Coverage follows integer edge functions (Pineda: *A Parallel Algorithm for Polygon Rasterization*, SIGGRAPH 1988) on
//! vertices rounded to 1/256 px, with the top-left rule: a sample on an edge that two triangles share belongs to
//! exactly one of them. 1 / z, which is affine on the screen, is evaluated afresh at each sample, so that its value
//! does not depend on where a loop started.

use super::clip::clip;
use super::project::{GUARD, OUTSIDE, Projection, STEP_BITS, STEPS, ScreenVertex, TO_CLIP};
use super::{Instance, RenderOptions};

/// Widest triangle, in samples, whose samples are tested one by one; wider ones have their spans computed.
const NARROW: i64 = 12;

/// Largest coordinate, in steps.
const GUARD_STEPS: i32 = (GUARD as i32) << STEP_BITS;

/// Rows of the image, drawn by one thread.
pub(super) struct Band<'a> {
    /// Row of the image that the buffers start with.
    pub(super) first_row: usize,
    /// Pixels in a row.
    pub(super) width: usize,
    pub(super) parts: &'a mut [u8],
    pub(super) instances: &'a mut [u16],
    /// 1 / z until [`Band::finish`], z afterwards.
    pub(super) inverse_depths: &'a mut [f32],
}

impl Band<'_> {
    /// Turns 1 / z into z.
    pub(super) fn finish(&mut self) {
        for value in &mut *self.inverse_depths {
            *value = 1.0 / *value;
        }
    }

    fn rows(&self) -> std::ops::Range<i64> {
        let first = self.first_row as i64;
        first..first + (self.parts.len() / self.width) as i64
    }
}

/// Which triangles are drawn, by the sign of their area on the screen.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Facing {
    Any,
    Negative,
    Positive,
}

/// What the samples of a triangle are set to.
#[derive(Clone, Copy)]
struct Label {
    part: u8,
    instance: u16,
}

/// Draws the rows of a band; `vertices` are those of the instance's mesh.
pub(super) fn draw_instance(
    band: &mut Band,
    instance: &Instance,
    projection: &Projection,
    vertices: &[ScreenVertex],
    options: &RenderOptions,
) {
    // Seen from outside a face runs counter-clockwise, which is a negative area where y points down.
    let facing = match (options.cull_back_faces, projection.mirrored) {
        (false, _) => Facing::Any,
        (true, false) => Facing::Negative,
        (true, true) => Facing::Positive,
    };
    for (face, part) in instance.mesh.faces.iter().zip(&instance.mesh.parts) {
        let [Some(a), Some(b), Some(c)] = face.map(|index| vertices.get(index as usize)) else {
            continue;
        };
        if a.code & b.code & c.code & OUTSIDE != 0 {
            continue;
        }
        let label = Label { part: part.id(), instance: instance.id };
        if (a.code | b.code | c.code) & TO_CLIP == 0 {
            draw_triangle(band, [a, b, c], label, facing);
        } else {
            let vertex =
                |index: u32| projection.homogeneous(&instance.mesh.vertices[index as usize]);
            let polygon = clip(face.map(vertex));
            draw_polygon(band, projection, polygon.corners(), label, facing);
        }
    }
}

/// Draws a convex polygon as a fan.
#[cold]
fn draw_polygon(
    band: &mut Band,
    projection: &Projection,
    corners: &[nalgebra::Vector3<f64>],
    label: Label,
    facing: Facing,
) {
    let mut corners = corners.iter().map(|corner| {
        // Rounding may leave a corner just outside of the plane it was cut at.
        let mut vertex = projection.vertex(corner);
        vertex.x = vertex.x.clamp(-GUARD_STEPS, GUARD_STEPS);
        vertex.y = vertex.y.clamp(-GUARD_STEPS, GUARD_STEPS);
        vertex
    });
    let (Some(first), Some(mut last)) = (corners.next(), corners.next()) else { return };
    for next in corners {
        draw_triangle(band, [&first, &last, &next], label, facing);
        last = next;
    }
}

#[inline]
fn draw_triangle(band: &mut Band, corners: [&ScreenVertex; 3], label: Label, facing: Facing) {
    let [a, mut b, mut c] = corners;
    let area = cross(a, b, c);
    match facing {
        Facing::Negative if area > 0 => return,
        Facing::Positive if area < 0 => return,
        _ => {}
    }
    // The samples within the bounding box.
    let rows = band.rows();
    let x0 = first_sample(a.x.min(b.x).min(c.x)).max(0);
    let x1 = last_sample(a.x.max(b.x).max(c.x)).min(band.width as i64 - 1);
    let y0 = first_sample(a.y.min(b.y).min(c.y)).max(rows.start);
    let y1 = last_sample(a.y.max(b.y).max(c.y)).min(rows.end - 1);
    if x0 > x1 || y0 > y1 || area == 0 {
        return;
    }
    if area < 0 {
        std::mem::swap(&mut b, &mut c);
    }
    let edges = [Edge::new(b, c, x0, y0), Edge::new(c, a, x0, y0), Edge::new(a, b, x0, y0)];
    let depth = InverseDepth::new([a, b, c], area.abs());
    let mut rows = edges.map(|edge| edge.start);
    for y in y0..=y1 {
        let (from, to) = if x1 - x0 < NARROW {
            narrow_span(rows, &edges, x0, x1)
        } else {
            wide_span(rows, &edges, x0, x1)
        };
        if from <= to {
            fill(band, y, from, to, &depth, label);
        }
        for (value, edge) in rows.iter_mut().zip(&edges) {
            *value += edge.down;
        }
    }
}

/// Twice the signed area, in steps squared; positive if a, b, c turn clockwise as seen on the screen.
fn cross(a: &ScreenVertex, b: &ScreenVertex, c: &ScreenVertex) -> i64 {
    let delta = |from: i32, to: i32| i64::from(to) - i64::from(from);
    delta(a.x, b.x) * delta(a.y, c.y) - delta(a.y, b.y) * delta(a.x, c.x)
}

/// Index of the first sample at or after a position.
fn first_sample(steps: i32) -> i64 {
    (i64::from(steps) + STEPS - 1) >> STEP_BITS
}

/// Index of the last sample at or before a position.
fn last_sample(steps: i32) -> i64 {
    i64::from(steps) >> STEP_BITS
}

/// A function that is not negative at the samples on the inner side of an edge, those on it included if it is a top
/// or left edge.
#[derive(Clone, Copy)]
struct Edge {
    /// At the first sample of the bounding box.
    start: i64,
    /// Change from one sample to the one to its right.
    right: i64,
    /// Change from one sample to the one below.
    down: i64,
}

impl Edge {
    fn new(from: &ScreenVertex, to: &ScreenVertex, x: i64, y: i64) -> Self {
        let dx = i64::from(to.x) - i64::from(from.x);
        let dy = i64::from(to.y) - i64::from(from.y);
        let owns_edge = dy < 0 || (dy == 0 && dx > 0);
        let value = dx * (y * STEPS - i64::from(from.y)) - dy * (x * STEPS - i64::from(from.x));
        Self { start: value - i64::from(!owns_edge), right: -dy * STEPS, down: dx * STEPS }
    }
}

/// The covered samples of a row, by trying them; they are contiguous as a triangle is convex.
fn narrow_span(mut values: [i64; 3], edges: &[Edge; 3], x0: i64, x1: i64) -> (i64, i64) {
    let mut x = x0;
    let advance = |values: &mut [i64; 3]| {
        for (value, edge) in values.iter_mut().zip(edges) {
            *value += edge.right;
        }
    };
    while x <= x1 && (values[0] | values[1] | values[2]) < 0 {
        advance(&mut values);
        x += 1;
    }
    let from = x;
    while x <= x1 && (values[0] | values[1] | values[2]) >= 0 {
        advance(&mut values);
        x += 1;
    }
    (from, x - 1)
}

/// The covered samples of a row, by solving for the ends.
fn wide_span(values: [i64; 3], edges: &[Edge; 3], x0: i64, x1: i64) -> (i64, i64) {
    let (mut from, mut to) = (x0, x1);
    for (value, edge) in values.into_iter().zip(edges) {
        if edge.right > 0 {
            // value + k * right >= 0
            from = from.max(x0 - value.div_euclid(edge.right));
        } else if edge.right < 0 {
            to = to.min(x0 + value.div_euclid(-edge.right));
        } else if value < 0 {
            return (x0, x0 - 1);
        }
    }
    (from, to)
}

/// 1 / z as a function on the screen.
struct InverseDepth {
    at_corner: f64,
    corner: [i64; 2],
    /// Change per step.
    slope: [f64; 2],
    /// Values at the corners: what rounding adds beyond them is cut off.
    range: [f64; 2],
}

impl InverseDepth {
    fn new([a, b, c]: [&ScreenVertex; 3], area: i64) -> Self {
        let [wa, wb, wc] = [a, b, c].map(|vertex| f64::from(vertex.inverse_depth));
        let delta = |from: i32, to: i32| f64::from(to) - f64::from(from);
        let scale = 1.0 / area as f64;
        let (ab, ac) = ((wb - wa) * scale, (wc - wa) * scale);
        Self {
            at_corner: wa,
            corner: [i64::from(a.x), i64::from(a.y)],
            slope: [
                ab * delta(a.y, c.y) - ac * delta(a.y, b.y),
                ac * delta(a.x, b.x) - ab * delta(a.x, c.x),
            ],
            range: [wa.min(wb).min(wc), wa.max(wb).max(wc)],
        }
    }
}

/// Sets the samples `from..=to` of a row where nothing nearer is.
fn fill(band: &mut Band, y: i64, from: i64, to: i64, depth: &InverseDepth, label: Label) {
    let row = (y as usize - band.first_row) * band.width;
    let span = row + from as usize..row + to as usize + 1;
    let start = depth.at_corner + depth.slope[1] * (y * STEPS - depth.corner[1]) as f64;
    // Exact integers: the sum does not depend on where the span starts.
    let mut dx = (from * STEPS - depth.corner[0]) as f64;
    let nearest = &mut band.inverse_depths[span.clone()];
    let parts = &mut band.parts[span.clone()];
    let instances = &mut band.instances[span];
    for ((nearest, part), instance) in nearest.iter_mut().zip(parts).zip(instances) {
        let value = start + depth.slope[0] * dx;
        let value = value.max(depth.range[0]).min(depth.range[1]) as f32;
        if value > *nearest {
            *nearest = value;
            *part = label.part;
            *instance = label.instance;
        }
        dx += STEPS as f64;
    }
}
