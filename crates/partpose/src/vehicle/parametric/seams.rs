//! Cuts a surface along an implicit curve and paints one side of it.
//!
//! A region is a function of the vertex that is negative inside. Where its sign changes along an edge, the edge is
//! split at the linear root, or, if the root lies near an end, that end is moved there, so that no slivers arise; the
//! triangles are divided accordingly. The seam then runs along edges, as cleanly as the grid is fine. Neighbours share
//! the split edges, so that a closed surface stays closed. (The marching-squares cases, on triangles.)

use std::collections::BTreeMap;

use crate::parts::PartClass;

use super::half::{Half, Vertex, Zone};

/// A root nearer to an end of the edge than this share of it moves the end.
const SNAP: f64 = 0.25;

/// Values nearer to zero count as on the seam, metres; grid lines that a seam follows are exact up to rounding.
const ON_SEAM: f64 = 1e-6;

/// Paints regions, keeping vertices that lie on earlier seams where they are.
pub(super) struct Painter<'a> {
    half: &'a mut Half,
    fixed: Vec<bool>,
}

impl<'a> Painter<'a> {
    pub(super) fn new(half: &'a mut Half) -> Self {
        let fixed = vec![false; half.vertices.len()];
        Self { half, fixed }
    }

    /// Keeps every vertex between faces of different parts in its place.
    pub(super) fn fix_seams(&mut self) {
        let mut part_of: Vec<Option<PartClass>> = vec![None; self.half.vertices.len()];
        for (face, part) in self.half.faces.iter().zip(&self.half.parts) {
            for index in face.map(|index| index as usize) {
                match part_of[index] {
                    Some(other) if other != *part => self.fixed[index] = true,
                    _ => part_of[index] = Some(*part),
                }
            }
        }
    }

    /// Gives `part` to the faces for which `concerns` holds and that lie inside the region.
    pub(super) fn paint(
        &mut self,
        part: PartClass,
        concerns: impl Fn(Zone, PartClass) -> bool,
        region: impl Fn(&Vertex) -> f64,
    ) {
        let count = self.half.faces.len();
        let concerned: Vec<bool> =
            (0..count).map(|i| concerns(self.half.zones[i], self.half.parts[i])).collect();
        let value =
            |vertex: &Vertex| Some(region(vertex)).filter(|v| v.abs() > ON_SEAM).unwrap_or(0.0);
        let mut values: Vec<f64> = self.half.vertices.iter().map(value).collect();
        self.snap(&concerned, &mut values);
        let splits = self.split_edges(&concerned, &mut values);
        let old = std::mem::take(&mut self.half.faces);
        let zones = std::mem::take(&mut self.half.zones);
        let parts = std::mem::take(&mut self.half.parts);
        for (i, face) in old.into_iter().enumerate() {
            for triangle in divide(face, &splits) {
                let sum: f64 = triangle.iter().map(|index| values[*index as usize]).sum();
                let painted = if concerned[i] && sum < 0.0 { part } else { parts[i] };
                self.half.push(triangle, zones[i], painted);
            }
        }
    }

    /// Moves vertices to roots near them.
    fn snap(&mut self, concerned: &[bool], values: &mut [f64]) {
        // Per vertex the nearest root: share of the edge, and the edge's other end.
        let mut nearest: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        for [a, b] in edges(&self.half.faces, concerned) {
            let [from, to] = [values[a as usize], values[b as usize]];
            if from * to >= 0.0 {
                continue;
            }
            let root = from / (from - to);
            for (vertex, other, share) in [(a, b, root), (b, a, 1.0 - root)] {
                let on_plane = |i: u32| self.half.vertices[i as usize].lateral == 0.0;
                let leaves_plane = on_plane(vertex) && !on_plane(other);
                if share < SNAP && !self.fixed[vertex as usize] && !leaves_plane {
                    let best = nearest.entry(vertex).or_insert((share, other));
                    if share < best.0 {
                        *best = (share, other);
                    }
                }
            }
        }
        let moved: Vec<(u32, Vertex)> = nearest
            .iter()
            .map(|(vertex, (share, other))| {
                let [from, to] = [*vertex, *other].map(|i| self.half.vertices[i as usize]);
                (*vertex, from.lerp(&to, *share))
            })
            .collect();
        for (vertex, place) in moved {
            self.half.vertices[vertex as usize] = place;
            self.fixed[vertex as usize] = true;
            values[vertex as usize] = 0.0;
        }
    }

    /// Makes a vertex at every root that is left; by edge, smaller index first.
    fn split_edges(
        &mut self,
        concerned: &[bool],
        values: &mut Vec<f64>,
    ) -> BTreeMap<[u32; 2], u32> {
        let mut splits = BTreeMap::new();
        for [a, b] in edges(&self.half.faces, concerned) {
            let [from, to] = [values[a as usize], values[b as usize]];
            if from * to >= 0.0 || splits.contains_key(&[a, b]) {
                continue;
            }
            let [p, q] = [a, b].map(|i| self.half.vertices[i as usize]);
            splits.insert([a, b], self.half.vertices.len() as u32);
            self.half.vertices.push(p.lerp(&q, from / (from - to)));
            self.fixed.push(true);
            values.push(0.0);
        }
        splits
    }
}

/// The edges of the concerned faces, smaller index first; inner ones come twice.
fn edges<'a>(faces: &'a [[u32; 3]], concerned: &'a [bool]) -> impl Iterator<Item = [u32; 2]> {
    let faces = faces.iter().zip(concerned).filter(|(_, concerned)| **concerned);
    faces
        .flat_map(|([a, b, c], _)| [[*a, *b], [*b, *c], [*c, *a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
}

/// The triangles that a face becomes when some of its edges are split.
fn divide([a, b, c]: [u32; 3], splits: &BTreeMap<[u32; 2], u32>) -> Vec<[u32; 3]> {
    let split = |i: u32, j: u32| splits.get(&[i.min(j), i.max(j)]).copied();
    match [split(a, b), split(b, c), split(c, a)] {
        [None, None, None] => vec![[a, b, c]],
        [Some(p), None, None] => vec![[a, p, c], [p, b, c]],
        [None, Some(p), None] => vec![[b, p, a], [p, c, a]],
        [None, None, Some(p)] => vec![[c, p, b], [p, a, b]],
        [Some(p), Some(q), None] => vec![[p, b, q], [a, p, q], [a, q, c]],
        [None, Some(p), Some(q)] => vec![[p, c, q], [b, p, q], [b, q, a]],
        [Some(q), None, Some(p)] => vec![[p, a, q], [c, p, q], [c, q, b]],
        [Some(p), Some(q), Some(r)] => vec![[a, p, r], [p, b, q], [r, q, c], [p, q, r]],
    }
}
