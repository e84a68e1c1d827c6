//! Triangles to samples.
//!
//! Coverage follows integer edge functions (Pineda: *A Parallel Algorithm for Polygon Rasterization*, SIGGRAPH 1988) on
//! vertices rounded to 1/256 px, with the top-left rule: a sample on an edge that two triangles share belongs to
//! exactly one of them. 1 / z, which is affine on the screen, is evaluated afresh at each sample, so that its value
//! does not depend on where a loop started.

use super::clip::clip;
use super::project::{GUARD, OUTSIDE, Projection, STEP_BITS, STEPS, ScreenVertex, TO_CLIP};
use super::{Instance, RenderOptions};

/// Widest bounding box, in samples, whose spans are found by trying; in wider ones they are computed.
const NARROW: i64 = 12;

/// Sides of a bounding box, in samples, below which every sample in it is tried.
const SMALL: i64 = 4;
/// Largest coordinate, in steps.
const GUARD_STEPS: i32 = (GUARD as i32) << STEP_BITS;

/// The buffers that are drawn into.
pub(super) struct Target<'a> {
    /// Columns and rows.
    pub(super) size: [usize; 2],
    pub(super) parts: &'a mut [u8],
    pub(super) instances: &'a mut [u16],
    /// 1 / z, 0 where nothing is.
    pub(super) inverse_depths: &'a mut [f32],
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

/// Draws an instance; `vertices` are those of the instance's mesh.
pub(super) fn draw_instance(
    target: &mut Target,
    instance: &Instance,
    projection: &Projection,
    vertices: &[ScreenVertex],
    options: RenderOptions,
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
            draw_triangle(target, [a, b, c], label, facing);
        } else {
            let vertex =
                |index: u32| projection.homogeneous(&instance.mesh.vertices[index as usize]);
            let polygon = clip(face.map(vertex));
            draw_polygon(target, projection, polygon.corners(), label, facing);
        }
    }
}

/// Draws a convex polygon as a fan.
#[cold]
fn draw_polygon(
    target: &mut Target,
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
        draw_triangle(target, [&first, &last, &next], label, facing);
        last = next;
    }
}

#[inline]
fn draw_triangle(target: &mut Target, corners: [&ScreenVertex; 3], label: Label, facing: Facing) {
    let [a, mut b, mut c] = corners;
    let area = cross(a, b, c);
    match facing {
        Facing::Negative if area > 0 => return,
        Facing::Positive if area < 0 => return,
        _ => {}
    }
    let samples = Samples {
        x0: first_sample(a.x.min(b.x).min(c.x)).max(0),
        x1: last_sample(a.x.max(b.x).max(c.x)).min(target.size[0] as i64 - 1),
        y0: first_sample(a.y.min(b.y).min(c.y)).max(0),
        y1: last_sample(a.y.max(b.y).max(c.y)).min(target.size[1] as i64 - 1),
    };
    if samples.x0 > samples.x1 || samples.y0 > samples.y1 || area == 0 {
        return;
    }
    if area < 0 {
        std::mem::swap(&mut b, &mut c);
    }
    let triangle = Triangle { corners: [a, b, c], area: area.abs(), label };
    if samples.x1 - samples.x0 < SMALL && samples.y1 - samples.y0 < SMALL {
        draw_small(target, &triangle, &samples);
    } else {
        draw_spans(target, &triangle, &samples);
    }
}

/// Samples of the bounding box that lie in the image, ends included.
struct Samples {
    x0: i64,
    x1: i64,
    y0: i64,
    y1: i64,
}

/// A triangle whose corners turn clockwise as seen on the screen.
struct Triangle<'a> {
    corners: [&'a ScreenVertex; 3],
    /// Twice the area, in steps squared.
    area: i64,
    label: Label,
}

impl Triangle<'_> {
    /// Its edges, starting at the first sample of the bounding box.
    fn edges(&self, samples: &Samples) -> [Edge; 3] {
        let [a, b, c] = self.corners;
        [[b, c], [c, a], [a, b]].map(|[from, to]| Edge::new(from, to, samples.x0, samples.y0))
    }

    /// That of the nearest corner.
    fn greatest_inverse_depth(&self) -> f32 {
        let [a, b, c] = self.corners.map(|corner| corner.inverse_depth);
        a.max(b).max(c)
    }
}

/// Tries sample by sample: of a fine mesh far away most triangles have one or two in their bounding box, and as often
/// as not cover none, or lie behind what is drawn already. The slopes are computed when a sample needs them.
#[inline]
fn draw_small(target: &mut Target, triangle: &Triangle, samples: &Samples) {
    let edges = triangle.edges(samples);
    let greatest = triangle.greatest_inverse_depth();
    let mut depth = None;
    let mut row_values = edges.map(|edge| edge.start);
    for y in samples.y0..=samples.y1 {
        let row = y as usize * target.size[0];
        let mut values = row_values;
        for x in samples.x0..=samples.x1 {
            let i = row + x as usize;
            if (values[0] | values[1] | values[2]) >= 0 && greatest > target.inverse_depths[i] {
                let depth = depth.get_or_insert_with(|| InverseDepth::new(triangle));
                let value = depth.along(depth.of_row(y), depth.offset(x));
                if value > target.inverse_depths[i] {
                    target.inverse_depths[i] = value;
                    target.parts[i] = triangle.label.part;
                    target.instances[i] = triangle.label.instance;
                }
            }
            for (value, edge) in values.iter_mut().zip(&edges) {
                *value += edge.right;
            }
        }
        for (value, edge) in row_values.iter_mut().zip(&edges) {
            *value += edge.down;
        }
    }
}

/// Solves for the covered samples of each row and sets them at once.
fn draw_spans(target: &mut Target, triangle: &Triangle, samples: &Samples) {
    let edges = triangle.edges(samples);
    let depth = InverseDepth::new(triangle);
    let mut values = edges.map(|edge| edge.start);
    for y in samples.y0..=samples.y1 {
        let (from, to) = if samples.x1 - samples.x0 < NARROW {
            narrow_span(values, &edges, samples.x0, samples.x1)
        } else {
            wide_span(values, &edges, samples.x0, samples.x1)
        };
        if from <= to {
            fill(target, y, from, to, &depth, triangle.label);
        }
        for (value, edge) in values.iter_mut().zip(&edges) {
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
    fn new(triangle: &Triangle) -> Self {
        let [a, b, c] = triangle.corners;
        let [wa, wb, wc] = [a, b, c].map(|vertex| f64::from(vertex.inverse_depth));
        let delta = |from: i32, to: i32| f64::from(to) - f64::from(from);
        let scale = 1.0 / triangle.area as f64;
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

    /// Its value in a row, left or right of the first corner.
    fn of_row(&self, y: i64) -> f64 {
        self.at_corner + self.slope[1] * (y * STEPS - self.corner[1]) as f64
    }

    /// How far right of the first corner a sample lies: an integer, hence exact however it was come by.
    fn offset(&self, x: i64) -> f64 {
        (x * STEPS - self.corner[0]) as f64
    }

    fn along(&self, of_row: f64, offset: f64) -> f32 {
        (of_row + self.slope[0] * offset).max(self.range[0]).min(self.range[1]) as f32
    }
}

/// Sets the samples `from..=to` of a row where nothing nearer is.
fn fill(target: &mut Target, y: i64, from: i64, to: i64, depth: &InverseDepth, label: Label) {
    let row = y as usize * target.size[0];
    let span = row + from as usize..row + to as usize + 1;
    let of_row = depth.of_row(y);
    let mut offset = depth.offset(from);
    let nearest = &mut target.inverse_depths[span.clone()];
    let parts = &mut target.parts[span.clone()];
    let instances = &mut target.instances[span];
    for ((nearest, part), instance) in nearest.iter_mut().zip(parts).zip(instances) {
        let value = depth.along(of_row, offset);
        if value > *nearest {
            *nearest = value;
            *part = label.part;
            *instance = label.instance;
        }
        offset += STEPS as f64;
    }
}
