//! Fewer faces by collapsing edges (Garland and Heckbert: *Surface Simplification Using Quadric Error Metrics*, SIGGRAPH
//! 1997).
//!
//! Keeps the mirror plane: vertices on it stay on it, and their quadrics contain the mirrored faces. Borders between
//! parts count as features: planes through the border, perpendicular to the faces, are added to the quadrics. A collapse
//! is done only where the surface stays a manifold (link condition) and no face turns over.

use std::cmp::{Ordering, Reverse};
use std::collections::{BTreeMap, BinaryHeap};

use nalgebra::{Matrix3, Vector3};

use crate::geometry::Point3;
use crate::parts::PartClass;

use super::Mesh;
use super::half::{HalfMesh, edges};

/// Weight of a border between parts against the surface itself.
const BORDER_WEIGHT: f64 = 0.6;
/// Least cosine between the normals of a face before and after a collapse.
const LEAST_COSINE: f64 = 0.3;
/// Least ratio of a face's area to that of an equilateral one with the same longest edge.
const LEAST_SHAPE: f64 = 0.05;

/// Squared distance to a set of weighted planes: `x A x + 2 b x + c`.
#[derive(Clone, Copy, Debug, Default)]
struct Quadric {
    a: Matrix3<f64>,
    b: Vector3<f64>,
    c: f64,
}

impl Quadric {
    fn plane(normal: &Vector3<f64>, point: &Point3, weight: f64) -> Self {
        let d = -normal.dot(&point.coords);
        Self {
            a: normal * normal.transpose() * weight,
            b: normal * (d * weight),
            c: d * d * weight,
        }
    }

    fn add(&mut self, other: &Self) {
        self.a += other.a;
        self.b += other.b;
        self.c += other.c;
    }

    fn at(&self, p: &Vector3<f64>) -> f64 {
        (p.dot(&(self.a * p)) + 2.0 * self.b.dot(p) + self.c).max(0.0)
    }
}

#[derive(PartialEq)]
struct Candidate {
    cost: f64,
    edge: [u32; 2],
    stamps: [u32; 2],
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.cost
            .total_cmp(&other.cost)
            .then(self.edge.cmp(&other.edge))
            .then(self.stamps.cmp(&other.stamps))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

struct Collapser {
    /// Whether vertices must keep to x > 0 or stay on the mirror plane.
    is_half: bool,
    vertices: Vec<Point3>,
    on_plane: Vec<bool>,
    quadrics: Vec<Quadric>,
    stamps: Vec<u32>,
    faces: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Faces that are alive.
    left: usize,
    around: Vec<Vec<u32>>,
    heap: BinaryHeap<Reverse<Candidate>>,
}

/// Collapses edges until at most `most` faces are left in the half; `labels` belong to the faces, or are empty.
pub(crate) fn simplify(half: &HalfMesh, labels: &[u8], most: usize) -> (HalfMesh, Vec<u8>) {
    let mut collapser = Collapser::new(half, labels, true);
    collapser.run(most);
    collapser.half(labels)
}

/// A mesh that loses more and more of its faces; the mirror plane has no part in it.
pub(crate) struct Simplifier {
    collapser: Collapser,
    labels: Vec<u8>,
}

impl Simplifier {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let on_plane = vec![false; mesh.vertices.len()];
        let (vertices, faces) = (mesh.vertices.clone(), mesh.faces.clone());
        let labels: Vec<u8> = mesh.parts.iter().map(|part| part.id()).collect();
        let whole = HalfMesh { vertices, on_plane, faces };
        Self { collapser: Collapser::new(&whole, &labels, false), labels }
    }

    /// The mesh with at most `most` faces, where the rules of collapsing allow it: the same whether it had more of them
    /// at first or has been made simpler before.
    pub(crate) fn down_to(&mut self, most: usize) -> Mesh {
        self.collapser.run(most);
        let (whole, labels) = self.collapser.half(&self.labels);
        let parts = labels.into_iter().filter_map(PartClass::from_id).collect();
        Mesh { vertices: whole.vertices, faces: whole.faces, parts }
    }
}

impl Collapser {
    fn new(half: &HalfMesh, labels: &[u8], is_half: bool) -> Self {
        let count = half.vertices.len();
        let mut quadrics = vec![Quadric::default(); count];
        let mut around = vec![Vec::new(); count];
        for (n, face) in half.faces.iter().enumerate() {
            for v in face {
                around[*v as usize].push(n as u32);
            }
            let [a, b, c] = face.map(|v| half.vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            let area = normal.norm();
            if let Some(normal) = normal.try_normalize(1e-18) {
                add_plane(&mut quadrics, half, face, &normal, area);
            }
        }
        let borders = edges(&half.faces);
        if !labels.is_empty() {
            for (edge, faces) in &borders {
                if let [f, g] = faces[..]
                    && labels[f as usize] != labels[g as usize]
                {
                    for face in [f, g] {
                        let [a, b, c] =
                            half.faces[face as usize].map(|v| half.vertices[v as usize]);
                        let along =
                            half.vertices[edge[1] as usize] - half.vertices[edge[0] as usize];
                        let across = (b - a).cross(&(c - a)).cross(&along);
                        if let Some(normal) = across.try_normalize(1e-18) {
                            let weight = BORDER_WEIGHT * along.norm_squared();
                            add_plane(&mut quadrics, half, &edge[..], &normal, weight);
                        }
                    }
                }
            }
        }
        let mut collapser = Self {
            is_half,
            vertices: half.vertices.clone(),
            on_plane: half.on_plane.clone(),
            quadrics,
            stamps: vec![0; count],
            faces: half.faces.clone(),
            alive: vec![true; half.faces.len()],
            left: half.faces.len(),
            around,
            heap: BinaryHeap::new(),
        };
        for edge in borders.keys() {
            collapser.push(edge[0], edge[1]);
        }
        collapser
    }

    /// Collapses the cheapest edge again and again until at most `most` faces are left.
    fn run(&mut self, most: usize) {
        while self.left > most {
            let Some(Reverse(candidate)) = self.heap.pop() else { break };
            let [a, b] = candidate.edge.map(|n| n as usize);
            if [self.stamps[a], self.stamps[b]] == candidate.stamps {
                self.left -= self.collapse(a, b);
            }
        }
    }

    fn push(&mut self, a: u32, b: u32) {
        let edge = [a.min(b), a.max(b)];
        let [a, b] = edge.map(|n| n as usize);
        let (_, cost) = self.target(a, b);
        self.heap.push(Reverse(Candidate { cost, edge, stamps: [self.stamps[a], self.stamps[b]] }));
    }

    /// Where the joined vertex goes, and what that costs.
    fn target(&self, a: usize, b: usize) -> (Vector3<f64>, f64) {
        let mut quadric = self.quadrics[a];
        quadric.add(&self.quadrics[b]);
        let (p, q) = (self.vertices[a].coords, self.vertices[b].coords);
        let plane = self.on_plane[a] || self.on_plane[b];
        // A weak pull to the middle makes the system regular on flat ground.
        let middle = 0.5 * (p + q);
        let pull = 1e-3 * quadric.a.trace().max(1e-12);
        let system = quadric.a + Matrix3::identity() * pull;
        let solved = system.cholesky().map(|c| c.solve(&(middle * pull - quadric.b)));
        let reach = (p - q).norm();
        let mut best = solved.filter(|x| (x - middle).norm() <= 2.0 * reach).unwrap_or(middle);
        if plane {
            best.x = 0.0;
        }
        let length_cost = 1e-7 * reach * reach;
        (best, quadric.at(&best) + length_cost)
    }

    fn ring(&self, n: usize) -> Vec<u32> {
        let mut ring: Vec<u32> = self.around[n]
            .iter()
            .flat_map(|f| self.faces[*f as usize])
            .filter(|v| *v as usize != n)
            .collect();
        ring.sort_unstable();
        ring.dedup();
        ring
    }

    /// Joins b into a; returns how many faces went.
    fn collapse(&mut self, a: usize, b: usize) -> usize {
        let shared: Vec<u32> = self.around[a]
            .iter()
            .copied()
            .filter(|f| self.faces[*f as usize].contains(&(b as u32)))
            .collect();
        let both = self.on_plane[a] && self.on_plane[b];
        if shared.len() != if both { 1 } else { 2 } {
            return 0;
        }
        let (ring_a, ring_b) = (self.ring(a), self.ring(b));
        let common = ring_a.iter().filter(|v| ring_b.binary_search(v).is_ok()).count();
        if common != shared.len() {
            return 0;
        }
        let (target, _) = self.target(a, b);
        let plane = self.on_plane[a] || self.on_plane[b];
        if self.is_half && !plane && target.x < 1e-4 {
            return 0;
        }
        let bent = |n: usize| {
            self.around[n].iter().any(|f| !shared.contains(f) && self.turns_over(*f, n, &target))
        };
        if bent(a) || bent(b) {
            return 0;
        }
        self.vertices[a] = target.into();
        self.on_plane[a] = plane;
        let other = self.quadrics[b];
        self.quadrics[a].add(&other);
        for f in &shared {
            self.alive[*f as usize] = false;
            for v in self.faces[*f as usize] {
                self.around[v as usize].retain(|g| g != f);
            }
        }
        for f in std::mem::take(&mut self.around[b]) {
            for v in &mut self.faces[f as usize] {
                if *v as usize == b {
                    *v = a as u32;
                }
            }
            self.around[a].push(f);
        }
        self.stamps[a] += 1;
        self.stamps[b] = u32::MAX;
        for v in self.ring(a) {
            self.push(a as u32, v);
        }
        shared.len()
    }

    /// Whether a face would turn over or become a needle if its corner `n` moved.
    fn turns_over(&self, face: u32, n: usize, target: &Vector3<f64>) -> bool {
        let corners = self.faces[face as usize];
        let old = corners.map(|v| self.vertices[v as usize].coords);
        let new = corners
            .map(|v| if v as usize == n { *target } else { self.vertices[v as usize].coords });
        let cross = |p: &[Vector3<f64>; 3]| (p[1] - p[0]).cross(&(p[2] - p[0]));
        let longest = |p: &[Vector3<f64>; 3]| {
            (p[1] - p[0])
                .norm_squared()
                .max((p[2] - p[1]).norm_squared())
                .max((p[0] - p[2]).norm_squared())
        };
        let (before, after) = (cross(&old), cross(&new));
        let shape =
            |cross: &Vector3<f64>, p: &[Vector3<f64>; 3]| cross.norm() / longest(p).max(1e-18);
        let turned = before.dot(&after) < LEAST_COSINE * before.norm() * after.norm();
        turned || shape(&after, &new) < LEAST_SHAPE.min(0.9 * shape(&before, &old))
    }

    /// What is left, and its labels.
    fn half(&self, labels: &[u8]) -> (HalfMesh, Vec<u8>) {
        let mut half = HalfMesh::default();
        let mut kept = Vec::new();
        let mut index = vec![u32::MAX; self.vertices.len()];
        for (n, face) in self.faces.iter().enumerate().filter(|(n, _)| self.alive[*n]) {
            let corners = face.map(|v| {
                let v = v as usize;
                if index[v] == u32::MAX {
                    index[v] = half.vertices.len() as u32;
                    half.vertices.push(self.vertices[v]);
                    half.on_plane.push(self.on_plane[v]);
                }
                index[v]
            });
            half.faces.push(corners);
            kept.extend(labels.get(n));
        }
        (half, kept)
    }
}

/// Adds a plane to the quadrics of some vertices, and its mirror image to those on the mirror plane.
fn add_plane(
    quadrics: &mut [Quadric],
    half: &HalfMesh,
    corners: &[u32],
    normal: &Vector3<f64>,
    weight: f64,
) {
    let point = half.vertices[corners[0] as usize];
    let quadric = Quadric::plane(normal, &point, weight);
    let mirrored = Quadric::plane(
        &Vector3::new(-normal.x, normal.y, normal.z),
        &Point3::new(-point.x, point.y, point.z),
        weight,
    );
    for v in corners {
        quadrics[*v as usize].add(&quadric);
        if half.on_plane[*v as usize] {
            quadrics[*v as usize].add(&mirrored);
        }
    }
}

/// Splits edges at their middles until none is longer than `longest`.
pub(crate) fn refine(half: &HalfMesh, longest: f64) -> HalfMesh {
    let mut mesh = half.clone();
    loop {
        let mut middle = BTreeMap::new();
        for (edge, faces) in edges(&mesh.faces) {
            let [a, b] = edge.map(|n| mesh.vertices[n as usize]);
            if (a - b).norm() > longest {
                middle.insert(edge, mesh.vertices.len() as u32);
                mesh.vertices.push(nalgebra::center(&a, &b));
                mesh.on_plane.push(faces.len() == 1);
            }
        }
        if middle.is_empty() {
            return mesh;
        }
        let at = |a: u32, b: u32| middle.get(&[a.min(b), a.max(b)]).copied();
        let mut faces = Vec::with_capacity(2 * mesh.faces.len());
        for [a, b, c] in mesh.faces {
            match [at(a, b), at(b, c), at(c, a)] {
                [None, None, None] => faces.push([a, b, c]),
                [Some(m), None, None] => faces.extend([[a, m, c], [m, b, c]]),
                [None, Some(m), None] => faces.extend([[b, m, a], [m, c, a]]),
                [None, None, Some(m)] => faces.extend([[c, m, b], [m, a, b]]),
                [Some(m), Some(n), None] => faces.extend([[m, b, n], [a, m, n], [a, n, c]]),
                [None, Some(m), Some(n)] => faces.extend([[m, c, n], [b, m, n], [b, n, a]]),
                [Some(n), None, Some(m)] => faces.extend([[m, a, n], [c, m, n], [c, n, b]]),
                [Some(m), Some(n), Some(o)] => {
                    faces.extend([[a, m, o], [m, b, n], [o, n, c], [m, n, o]]);
                }
            }
        }
        mesh.faces = faces;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::ModelZoo;

    #[test]
    fn a_mesh_is_the_same_in_one_go_and_step_by_step() {
        let zoo = ModelZoo::embedded();
        let mesh = zoo.models[0].mesh();
        let mut simplifier = Simplifier::new(mesh);
        for most in [3000, 800, 250] {
            let step = simplifier.down_to(most);
            assert_eq!(step, Simplifier::new(mesh).down_to(most));
            assert!(step.faces.len() <= most, "{}", step.faces.len());
        }
    }
}
