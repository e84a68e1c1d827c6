//! Cuts a surface along an implicit curve and paints one side of it.
//!
//! A region is where some functions of the vertex are negative. Where the sign of one changes along an edge, the edge is
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
    ///
    /// The region is where all of `bounds` are negative. Each is cut by itself, so that corners stay sharp.
    pub(super) fn paint(
        &mut self,
        part: PartClass,
        concerns: impl Fn(Zone, PartClass) -> bool,
        bounds: &[&dyn Fn(&Vertex) -> f64],
    ) {
        let values = self.cut(&concerns, bounds);
        let inside = self.inside(&concerns, bounds, &values);
        for (of, inside) in self.half.parts.iter_mut().zip(inside) {
            if inside {
                *of = part;
            }
        }
    }

    /// Cuts along the bounds of a region without painting it; gives their values at every vertex.
    pub(super) fn cut(
        &mut self,
        concerns: impl Fn(Zone, PartClass) -> bool,
        bounds: &[&dyn Fn(&Vertex) -> f64],
    ) -> Vec<Vec<f64>> {
        // Exactly zero on the seam.
        let mut values: Vec<Vec<f64>> = Vec::new();
        for bound in bounds {
            let value = |vertex: &Vertex| {
                Some(bound(vertex)).filter(|value| value.abs() > ON_SEAM).unwrap_or(0.0)
            };
            values.push(self.half.vertices.iter().map(value).collect());
            let concerned = self.inside(&concerns, bounds, &values[..values.len() - 1]);
            self.fix_zeros(&concerned, &values);
            self.snap(&concerned, &mut values);
            let splits = self.split_edges(&concerned, &mut values);
            let old = std::mem::take(&mut self.half.faces);
            let zones = std::mem::take(&mut self.half.zones);
            let parts = std::mem::take(&mut self.half.parts);
            for ((face, zone), of) in old.into_iter().zip(zones).zip(parts) {
                for triangle in divide(face, &splits) {
                    self.half.push(triangle, zone, of);
                }
            }
        }
        values
    }

    /// Moves the faces of a region that was cut along `bounds`, with their borders, towards the rear.
    pub(super) fn move_back(
        &mut self,
        concerns: impl Fn(Zone, PartClass) -> bool,
        bounds: &[&dyn Fn(&Vertex) -> f64],
        distance: f64,
    ) {
        let value = |bound: &&dyn Fn(&Vertex) -> f64| {
            let at = |vertex: &Vertex| {
                Some(bound(vertex)).filter(|value| value.abs() > ON_SEAM).unwrap_or(0.0)
            };
            self.half.vertices.iter().map(at).collect()
        };
        let values: Vec<Vec<f64>> = bounds.iter().map(value).collect();
        let mut moved = vec![false; self.half.vertices.len()];
        for (face, inside) in self.half.faces.iter().zip(self.inside(&concerns, bounds, &values)) {
            for index in face.iter().filter(|_| inside) {
                moved[*index as usize] = true;
            }
        }
        for (vertex, moved) in self.half.vertices.iter_mut().zip(moved) {
            if moved {
                vertex.z -= distance;
            }
        }
    }

    /// Which faces are concerned and lie inside the bounds of which values are given.
    fn inside(
        &self,
        concerns: &impl Fn(Zone, PartClass) -> bool,
        bounds: &[&dyn Fn(&Vertex) -> f64],
        values: &[Vec<f64>],
    ) -> Vec<bool> {
        let half = &self.half;
        let is_inside = |i: usize| {
            let [a, b, c] = half.faces[i].map(|index| index as usize);
            let negative = |values: &Vec<f64>, bound: &dyn Fn(&Vertex) -> f64| {
                let sum = values[a] + values[b] + values[c];
                if sum != 0.0 {
                    return sum < 0.0;
                }
                let [a, b, c] = [a, b, c].map(|index| half.vertices[index]);
                bound(&a.lerp(&b, 0.5).lerp(&c, 1.0 / 3.0)) < 0.0
            };
            concerns(half.zones[i], half.parts[i])
                && values.iter().zip(bounds).all(|(values, bound)| negative(values, bound))
        };
        (0..half.faces.len()).map(is_inside).collect()
    }

    /// Keeps vertices that already lie on the last bound in their place.
    fn fix_zeros(&mut self, concerned: &[bool], values: &[Vec<f64>]) {
        let Some(last) = values.last() else { return };
        for index in edges(&self.half.faces, concerned).flatten().map(|index| index as usize) {
            self.fixed[index] |= last[index] == 0.0;
        }
    }

    /// Moves vertices to roots of the last bound near them.
    fn snap(&mut self, concerned: &[bool], values: &mut [Vec<f64>]) {
        let Some(last) = values.last() else { return };
        // Per vertex the nearest root: share of the edge, and the edge's other end.
        let mut nearest: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
        for [a, b] in edges(&self.half.faces, concerned) {
            let [from, to] = [last[a as usize], last[b as usize]];
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
        // From where everything was, so that the order does not matter.
        let (vertices, old) = (self.half.vertices.clone(), values.to_vec());
        for (vertex, (share, other)) in nearest {
            let [i, j] = [vertex as usize, other as usize];
            self.half.vertices[i] = vertices[i].lerp(&vertices[j], share);
            self.fixed[i] = true;
            for (values, old) in values.iter_mut().zip(&old) {
                values[i] = old[i] + share * (old[j] - old[i]);
            }
            if let Some(last) = values.last_mut() {
                last[i] = 0.0;
            }
        }
    }

    /// Makes a vertex at every root of the last bound that is left; by edge, smaller index first.
    fn split_edges(
        &mut self,
        concerned: &[bool],
        values: &mut [Vec<f64>],
    ) -> BTreeMap<[u32; 2], u32> {
        let mut splits = BTreeMap::new();
        for [a, b] in edges(&self.half.faces, concerned) {
            let [i, j] = [a as usize, b as usize];
            let Some((last, others)) = values.split_last_mut() else { break };
            let [from, to] = [last[i], last[j]];
            if from * to >= 0.0 || splits.contains_key(&[a, b]) {
                continue;
            }
            let share = from / (from - to);
            splits.insert([a, b], self.half.vertices.len() as u32);
            self.half.vertices.push(self.half.vertices[i].lerp(&self.half.vertices[j], share));
            self.fixed.push(true);
            last.push(0.0);
            for values in others {
                values.push(values[i] + share * (values[j] - values[i]));
            }
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
