//! Which triangle each sample of the picture sees.
//!
//! A visibility buffer (Burns and Hunt 2013): triangles leave only their number and 1 / z, and light is computed later
//! for what is seen. Coverage follows integer edge functions with the top-left rule on corners rounded to 1/256 px, as in
//! the label renderer. Rows are drawn in bands, each by one thread and in the order of the triangles, so that the number
//! of threads does not show. What lies behind all that is drawn already in every block of samples that it touches is
//! left out before its edges are looked at (Greene, Kass and Miller: *Hierarchical Z-Buffer Visibility*, SIGGRAPH 1993,
//! with one level).

use rayon::prelude::*;

use crate::scene::Texture;

use super::hidden::Blocks;
use super::leaves::{self, Mask};
use super::visible::{STEPS, Seen, Triangle, Triangles, material_of};

/// Sample rows a band.
const BAND: usize = 32;
/// Triangles after which it is looked again what they hide.
const LOOK: usize = 512;
/// Number of a sample that sees nothing.
pub(super) const NOTHING: u32 = u32::MAX;

/// What the samples see.
#[derive(Debug, Default)]
pub(super) struct Visibility {
    /// Samples along a row and a column.
    pub(super) size: [usize; 2],
    /// Samples a pixel along each axis; sample 0 of a pixel lies in its centre.
    pub(super) rate: usize,
    /// Triangle seen.
    pub(super) ids: Vec<u32>,
    /// Its 1 / z.
    pub(super) inverse_depths: Vec<f32>,
    /// Pane of glass in front of it, or [`NOTHING`].
    pub(super) glass: Vec<u32>,
    /// Number of panes in front of it.
    pub(super) panes: Vec<u8>,
    /// At pixel centres, what would be seen without the objects that have part labels.
    pub(super) background: Vec<u32>,
    /// Its 1 / z.
    pub(super) background_depths: Vec<f32>,
}

/// Draws the triangles at `rate` x `rate` samples a pixel.
pub(super) fn draw(
    size: [u32; 2],
    rate: usize,
    seen: &[Seen],
    triangles: &Triangles,
) -> Visibility {
    let [width, height] = size.map(|side| side as usize * rate);
    let step = STEPS / rate as i32;
    let bands = height.div_ceil(BAND).max(1);
    let opaque = bins(&triangles.opaque, step, height, bands);
    let glass = bins(&triangles.glass, step, height, bands);
    let count = width * height;
    let mut all = Visibility {
        size: [width, height],
        rate,
        ids: vec![NOTHING; count],
        inverse_depths: vec![0.0; count],
        glass: vec![NOTHING; count],
        panes: vec![0; count],
        background: vec![NOTHING; count / (rate * rate)],
        background_depths: vec![0.0; count / (rate * rate)],
    };
    let rows = width * BAND;
    let pixels = rows / (rate * rate);
    let parts = all
        .ids
        .par_chunks_mut(rows)
        .zip(all.inverse_depths.par_chunks_mut(rows))
        .zip(all.glass.par_chunks_mut(rows).zip(all.panes.par_chunks_mut(rows)))
        .zip(
            all.background.par_chunks_mut(pixels).zip(all.background_depths.par_chunks_mut(pixels)),
        );
    parts.enumerate().for_each(
        |(i, (((ids, depths), (glass_ids, panes)), (background, background_depths)))| {
            let y0 = i * BAND;
            let y1 = (y0 + BAND).min(height);
            let coordinates = &triangles.coordinates;
            let band = Band {
                width,
                y: [y0 as i32, y1 as i32],
                shift: step.trailing_zeros(),
                seen,
                coordinates,
            };
            let split = opaque[i].partition_point(|id| (*id as usize) < triangles.unlabelled);
            let mut blocks = Blocks::new(width, y1 - y0);
            let mut draw = |list: &[u32], ids: &mut [u32], depths: &mut [f32]| {
                for (count, id) in list.iter().enumerate() {
                    if count % LOOK == LOOK - 1 {
                        blocks.look(depths);
                    }
                    band.draw(&triangles.opaque[*id as usize], &blocks, |span, holes| {
                        let depths = &mut depths[span.from..span.to];
                        let ids = &mut ids[span.from..span.to];
                        match holes {
                            None => span.set(depths, ids, *id),
                            Some(holes) => span.set_where(holes, depths, ids, *id),
                        }
                    });
                }
            };
            draw(&opaque[i][..split], ids, depths);
            let columns = width / rate;
            for (at, (id, depth)) in background.iter_mut().zip(background_depths).enumerate() {
                let sample = at / columns * rate * width + at % columns * rate;
                *id = ids[sample];
                *depth = depths[sample];
            }
            draw(&opaque[i][split..], ids, depths);
            blocks.look(depths);
            band.panes(&triangles.glass, &glass[i], &blocks, depths, (glass_ids, panes));
        },
    );
    all
}

/// The triangles that touch each band, in order.
fn bins(triangles: &[Triangle], step: i32, height: usize, bands: usize) -> Vec<Vec<u32>> {
    let mut bins = vec![Vec::new(); bands];
    for (id, triangle) in triangles.iter().enumerate() {
        let [a, b, c] = triangle.y;
        let first = ((a.min(b).min(c) + step - 1) >> step.trailing_zeros()).max(0);
        let last = (a.max(b).max(c) >> step.trailing_zeros()).min(height as i32 - 1);
        if first > last {
            continue;
        }
        for bin in &mut bins[first as usize / BAND..=last as usize / BAND] {
            bin.push(id as u32);
        }
    }
    bins
}

/// Some rows of samples.
struct Band<'a> {
    width: usize,
    /// First row, and the one behind the last.
    y: [i32; 2],
    /// Steps a sample, as a power of two.
    shift: u32,
    seen: &'a [Seen<'a>],
    coordinates: &'a [[[f32; 2]; 3]],
}

impl Band<'_> {
    /// Calls `set` with the covered samples of every row.
    #[inline]
    fn draw(
        &self,
        triangle: &Triangle,
        blocks: &Blocks,
        mut set: impl FnMut(&Span, Option<&HolesRow>),
    ) {
        let [x, y] = [&triangle.x, &triangle.y];
        let step = 1 << self.shift;
        let first = |v: &[i32; 3]| (v[0].min(v[1]).min(v[2]) + step - 1) >> self.shift;
        let last = |v: &[i32; 3]| v[0].max(v[1]).max(v[2]) >> self.shift;
        let [x0, x1] = [first(x).max(0), last(x).min(self.width as i32 - 1)];
        let [y0, y1] = [first(y).max(self.y[0]), last(y).min(self.y[1] - 1)];
        if x0 > x1 || y0 > y1 {
            return;
        }
        let rows = [y0, y1].map(|y| (y - self.y[0]) as usize);
        if blocks.hide([x0, x1].map(|x| x as usize), rows, &triangle.inverse_depth) {
            return;
        }
        let mut corners = [0, 1, 2];
        let delta = |v: &[i32; 3], from: usize, to: usize| i64::from(v[to]) - i64::from(v[from]);
        let mut area = delta(x, 0, 1) * delta(y, 0, 2) - delta(y, 0, 1) * delta(x, 0, 2);
        if area == 0 {
            return;
        }
        if area < 0 {
            area = -area;
            corners = [0, 2, 1];
        }
        let step = i64::from(step);
        let edges = [[1, 2], [2, 0], [0, 1]].map(|[from, to]| {
            let [from, to] = [corners[from], corners[to]];
            let [dx, dy] = [delta(x, from, to), delta(y, from, to)];
            let owns_edge = dy < 0 || (dy == 0 && dx > 0);
            let value = dx * (i64::from(y0) * step - i64::from(y[from]))
                - dy * (i64::from(x0) * step - i64::from(x[from]));
            [value - i64::from(!owns_edge), -dy * step, dx * step]
        });
        // Most triangles of far objects cover nothing, so that their slopes are computed when needed.
        let mut planes = None;
        let mut values = edges.map(|edge| edge[0]);
        for row in y0..=y1 {
            let (from, to) = span(values, &edges, i64::from(x0), i64::from(x1));
            if from <= to {
                let at = (row - self.y[0]) as usize * self.width;
                let row_steps = i64::from(row) * step;
                let (plane, holes) = planes.get_or_insert_with(|| {
                    let plane = Plane::new(triangle, corners, area);
                    (plane, self.holes(triangle, corners, area))
                });
                let columns = [from * step, row_steps];
                let holes = holes.as_ref().map(|holes| holes.row(columns, step));
                let span = Span {
                    from: at + from as usize,
                    to: at + to as usize + 1,
                    start: plane.unlimited(columns) as f32,
                    slope: (plane.slope[0] * step as f64) as f32,
                    range: plane.range.map(|value| value as f32),
                };
                set(&span, holes.as_ref());
            }
            for (value, edge) in values.iter_mut().zip(&edges) {
                *value += edge[2];
            }
        }
    }

    /// Notes the nearest pane before each sample and how many there are.
    fn panes(
        &self,
        triangles: &[Triangle],
        list: &[u32],
        blocks: &Blocks,
        depths: &[f32],
        (ids, panes): (&mut [u32], &mut [u8]),
    ) {
        let mut nearest = vec![0.0; if list.is_empty() { 0 } else { ids.len() }];
        for id in list {
            self.draw(&triangles[*id as usize], blocks, |span, _| {
                for at in span.from..span.to {
                    let value = span.at(at - span.from);
                    if value > depths[at] {
                        panes[at] = panes[at].saturating_add(1);
                        if value > nearest[at] {
                            nearest[at] = value;
                            ids[at] = *id;
                        }
                    }
                }
            });
        }
    }

    fn holes(&self, triangle: &Triangle, corners: [usize; 3], area: i64) -> Option<Holes> {
        let coordinates = self.coordinates.get(triangle.holes as usize)?;
        let seen = &self.seen[triangle.seen as usize];
        let Texture::Leaves { cover, size } = material_of(seen, triangle.face).texture else {
            return None;
        };
        let scale = f64::from(leaves::texels(size));
        let value = |axis: usize| {
            [0, 1, 2].map(|i| {
                scale * f64::from(coordinates[i][axis]) * f64::from(triangle.inverse_depth[i])
            })
        };
        let planes = [0, 1].map(|axis| Plane::of(triangle, corners, area, value(axis)));
        Some(Holes { planes, mask: Mask::of(cover) })
    }
}

/// The covered samples of a row: tried in narrow boxes, solved for in wide ones.
#[inline]
fn span(mut values: [i64; 3], edges: &[[i64; 3]; 3], x0: i64, x1: i64) -> (i64, i64) {
    if x1 - x0 >= 12 {
        let [mut from, mut to] = [x0, x1];
        for (value, [_, right, _]) in values.into_iter().zip(edges) {
            if *right > 0 {
                from = from.max(x0 - value.div_euclid(*right));
            } else if *right < 0 {
                to = to.min(x0 + value.div_euclid(-right));
            } else if value < 0 {
                return (x0, x0 - 1);
            }
        }
        return (from, to);
    }
    let advance = |values: &mut [i64; 3]| {
        for (value, edge) in values.iter_mut().zip(edges) {
            *value += edge[1];
        }
    };
    let mut x = x0;
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

/// A value that is affine on the screen.
struct Plane {
    at_corner: f64,
    corner: [i64; 2],
    slope: [f64; 2],
    range: [f64; 2],
}

impl Plane {
    fn new(triangle: &Triangle, corners: [usize; 3], area: i64) -> Self {
        Self::of(triangle, corners, area, triangle.inverse_depth.map(f64::from))
    }

    /// `area`: twice that of the triangle, its corners taken in such an order that it is positive.
    fn of(triangle: &Triangle, [a, b, c]: [usize; 3], area: i64, values: [f64; 3]) -> Self {
        let delta = |v: &[i32; 3], to: usize| f64::from(v[to]) - f64::from(v[a]);
        let scale = 1.0 / area as f64;
        let [ab, ac] = [(values[b] - values[a]) * scale, (values[c] - values[a]) * scale];
        let [x, y] = [&triangle.x, &triangle.y];
        Self {
            at_corner: values[a],
            corner: [i64::from(x[a]), i64::from(y[a])],
            slope: [ab * delta(y, c) - ac * delta(y, b), ac * delta(x, b) - ab * delta(x, c)],
            range: [
                values[a].min(values[b]).min(values[c]),
                values[a].max(values[b]).max(values[c]),
            ],
        }
    }

    fn unlimited(&self, [x, y]: [i64; 2]) -> f64 {
        self.at_corner
            + self.slope[0] * (x - self.corner[0]) as f64
            + self.slope[1] * (y - self.corner[1]) as f64
    }
}

/// Covered samples of a row.
struct Span {
    /// Places in the band, the last one excluded.
    from: usize,
    to: usize,
    /// 1 / z at the first sample, its change to the next, and its range.
    start: f32,
    slope: f32,
    range: [f32; 2],
}

/// Samples of a row that are looked at together.
const LANES: usize = 8;

impl Span {
    #[inline]
    fn at(&self, k: usize) -> f32 {
        self.limited(self.start + self.slope * k as f32)
    }

    /// Within the range; a number that is none stays so.
    #[inline]
    fn limited(&self, value: f32) -> f32 {
        let value = if value < self.range[0] { self.range[0] } else { value };
        if value > self.range[1] { self.range[1] } else { value }
    }

    /// Notes a triangle where it lies before what was there.
    #[inline]
    fn set(&self, depths: &mut [f32], ids: &mut [u32], id: u32) {
        for (k, (depth, old)) in depths.iter_mut().zip(ids).enumerate() {
            let value = self.at(k);
            let is_nearer = value > *depth;
            *depth = if is_nearer { value } else { *depth };
            *old = if is_nearer { id } else { *old };
        }
    }

    /// The same for a triangle with holes. Whether there is a leaf is only asked for blocks of samples of which some
    /// lie before what was there, and then without branches, which nothing could foretell.
    #[inline]
    fn set_where(&self, holes: &HolesRow, depths: &mut [f32], ids: &mut [u32], id: u32) {
        let blocks = depths.chunks_mut(LANES).zip(ids.chunks_mut(LANES));
        for (block, (depths, ids)) in blocks.enumerate() {
            let first = (block * LANES) as f32;
            let start = self.start + self.slope * first;
            let mut values = [0.0_f32; LANES];
            for (lane, value) in values.iter_mut().enumerate() {
                *value = self.limited(start + self.slope * lane as f32);
            }
            let nearer = depths.iter().zip(&values);
            if !nearer.fold(false, |any, (depth, value)| any || value > depth) {
                continue;
            }
            let mut places = [[0.0_f32; LANES]; 2];
            for (axis, places) in places.iter_mut().enumerate() {
                let start = holes.start[axis] + holes.slope[axis] * first;
                for (lane, place) in places.iter_mut().enumerate() {
                    *place = (start + holes.slope[axis] * lane as f32) / values[lane];
                }
            }
            for (lane, (depth, old)) in depths.iter_mut().zip(ids).enumerate() {
                let is_leaf = holes.mask.is_leaf([places[0][lane], places[1][lane]]);
                let is_seen = is_leaf && values[lane] > *depth;
                *depth = if is_seen { values[lane] } else { *depth };
                *old = if is_seen { id } else { *old };
            }
        }
    }
}

/// Leaves: their coordinates over depth, in texels of the mask.
struct Holes {
    planes: [Plane; 2],
    mask: &'static Mask,
}

impl Holes {
    fn row(&self, place: [i64; 2], step: i64) -> HolesRow {
        HolesRow {
            start: [0, 1].map(|i| self.planes[i].unlimited(place) as f32),
            slope: [0, 1].map(|i| (self.planes[i].slope[0] * step as f64) as f32),
            mask: self.mask,
        }
    }
}

/// The same along a row of samples.
struct HolesRow {
    start: [f32; 2],
    slope: [f32; 2],
    mask: &'static Mask,
}
