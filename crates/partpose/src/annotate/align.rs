//! Where each point of the target would be on a source.
//!
//! First the lengths that tell vehicles apart: each axis is scaled, along the vehicle in three pieces so that bumpers
//! and axles fall on each other. Then a smooth displacement is found as nearest points with like normals are drawn
//! together, at first by a stiff field and mostly by their normals (a windscreen finds the windscreen even if it is
//! half a metre further back), later by a soft one and by their positions. After Amberg, Romdhani and Vetter:
//! *Optimal Step Nonrigid ICP Algorithms for Surface Registration*, CVPR 2007, with a lattice for the vertices.
//!
//! Where the target's parts are known they are drawn only to the same part of the source, and the rest only to parts
//! that the target does not name: given doors then place the seams around them.

use crate::geometry::{Point3, Vector3};
use crate::parts::{PartClass, PartMap};

use super::lattice::{Lattice, Pull};
use super::profile;
use super::shape::{Frame, Shape, Spot};
use super::tree::{Key, Tree, key};

/// Points of the source and the target that the displacement is found from.
const POINTS: usize = 2500;
/// Spacing of the lattice, metres.
const SPACING: f64 = 0.3;
/// Rounds of matching and bending.
const ROUNDS: usize = 24;
/// Metres that a unit of difference between normals counts, first and last.
const REACH: [f64; 2] = [0.7, 0.25];
/// Stiffness of the field against a weight of 1 a pull, first and last.
const STIFFNESS: [f64; 2] = [300.0, 2.0];
/// Distance at which a pull loses half its weight, metres, first and last.
const SCALE: [f64; 2] = [0.6, 0.06];
/// Weight of the matched outlines against that of a point, first and last.
const OUTLINE: [f64; 2] = [5.0, 2.0];
/// Share of a pull that acts along the surface.
const ACROSS: f64 = 0.1;

/// The target laid on a source.
pub(super) struct Alignment {
    target: Frame,
    source: Frame,
    lattice: Lattice,
    /// Mean distance that is left, metres; normals count as at the end.
    pub(super) residual: f64,
}

impl Alignment {
    /// Finds it; both shapes are folded.
    pub(super) fn new(target: &Shape, source: &Shape) -> Self {
        let moving = target.spread(POINTS);
        let fixed = source.spread(POINTS);
        let matcher = Matcher::new(&moving, &fixed);
        let placed: Vec<Point3> =
            moving.iter().map(|spot| scaled(&target.frame, &source.frame, &spot.point)).collect();
        let (low, high) = bounds(&placed);
        let lattice = Lattice::new(low, high, SPACING);
        let outline = profile::pulls(
            &placed_spots(target, &target.frame, &source.frame),
            &source.spots,
            source.frame.half_width,
        );
        let mut alignment =
            Self { target: target.frame, source: source.frame, lattice, residual: f64::INFINITY };
        alignment.lattice.solve(&outline, STIFFNESS[1]);
        for round in 0..ROUNDS {
            let share = round as f64 / (ROUNDS - 1) as f64;
            let between = |[from, to]: [f64; 2]| from * (to / from).powf(share);
            let (reach, scale) = (between(REACH), between(SCALE));
            let trees = matcher.trees(reach);
            let mut pulls = Vec::with_capacity(moving.len() + outline.len());
            let mut sum = 0.0;
            for (spot, start) in moving.iter().zip(&placed) {
                let here = start + alignment.lattice.at(start);
                let Some(other) = matcher.nearest(&trees, spot, &here, reach) else { continue };
                let wanted = other.point - start;
                let distance = (other.point - here).norm();
                let turn = reach * (other.normal - spot.normal).norm();
                sum += distance.hypot(turn);
                let weight = scale.powi(2) / (scale.powi(2) + distance.powi(2) + turn.powi(2));
                pulls.push(Pull {
                    point: *start,
                    wanted,
                    normal: other.normal,
                    across: ACROSS,
                    weight: weight * weight,
                });
            }
            alignment.residual = sum / pulls.len().max(1) as f64;
            let weight = between(OUTLINE);
            pulls.extend(outline.iter().map(|pull| Pull { weight, ..*pull }));
            alignment.lattice.solve(&pulls, between(STIFFNESS));
        }
        alignment
    }

    /// The place on the source of a folded point of the target.
    pub(super) fn source_from_target(&self, point: &Point3) -> Point3 {
        let start = scaled(&self.target, &self.source, point);
        start + self.lattice.at(&start)
    }
}

/// How far two shapes are apart after scaling alone: mean distance in metres, normals counted.
pub(super) fn distance(target: &Shape, source: &Shape) -> f64 {
    const COUNT: usize = 600;
    const REACH: f64 = 0.3;
    let one_way = |from: &Shape, to: &Shape| {
        let keys: Vec<Key> =
            to.spread(2 * COUNT).iter().map(|s| key(&s.point, &s.normal, REACH)).collect();
        let tree = Tree::new(&keys);
        let mut found = Vec::new();
        let spots = from.spread(COUNT);
        let distance = |spot: &Spot| {
            let point = scaled(&from.frame, &to.frame, &spot.point);
            tree.nearest(&key(&point, &spot.normal, REACH), 1, &mut found);
            found.first().map_or(REACH, |(square, _)| square.sqrt())
        };
        spots.iter().map(distance).sum::<f64>() / spots.len().max(1) as f64
    };
    0.5 * (one_way(target, source) + one_way(source, target))
}

/// A point of one vehicle where scaling puts it on another.
fn scaled(from: &Frame, to: &Frame, point: &Point3) -> Point3 {
    let x = point.x * to.half_width / from.half_width;
    let height = (from.heights[0] - point.y) / (from.heights[0] - from.heights[1]);
    let y = to.heights[0] - height * (to.heights[0] - to.heights[1]);
    let piece = (1..3).filter(|i| point.z > from.stations[*i]).count();
    let [a, b] = [from.stations[piece], from.stations[piece + 1]];
    let [c, d] = [to.stations[piece], to.stations[piece + 1]];
    let z = c + (point.z - a) / (b - a) * (d - c);
    Point3::new(x, y, z)
}

/// The shape's points as [`scaled`] puts them.
fn placed_spots(shape: &Shape, from: &Frame, to: &Frame) -> Vec<Spot> {
    let placed = |spot: &Spot| Spot { point: scaled(from, to, &spot.point), ..*spot };
    shape.spots.iter().map(placed).collect()
}

fn bounds(points: &[Point3]) -> (Point3, Point3) {
    let first = points.first().copied().unwrap_or_default();
    points.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// Which points of the source a point of the target may be drawn to.
struct Matcher {
    fixed: Vec<Spot>,
    /// Indices into `fixed` for the given parts of the target that the source has.
    of_part: PartMap<Vec<u32>>,
    /// Those of parts that the target does not name.
    rest: Vec<u32>,
}

struct Trees {
    of_part: PartMap<Tree>,
    rest: Tree,
}

impl Matcher {
    fn new(moving: &[Spot], fixed: &[Spot]) -> Self {
        let mut of_part: PartMap<Vec<u32>> = PartMap::default();
        for part in moving.iter().filter_map(|spot| spot.part) {
            of_part.insert(part, Vec::new());
        }
        let mut rest = Vec::new();
        for (i, spot) in fixed.iter().enumerate() {
            match spot.part.and_then(|part: PartClass| of_part.get_mut(part)) {
                Some(list) => list.push(i as u32),
                None => rest.push(i as u32),
            }
        }
        of_part.retain(|_, list| !list.is_empty());
        Self { fixed: fixed.to_vec(), of_part, rest }
    }

    fn trees(&self, reach: f64) -> Trees {
        let tree = |list: &Vec<u32>| {
            let spots = list.iter().map(|i| &self.fixed[*i as usize]);
            let keys: Vec<Key> = spots.map(|s| key(&s.point, &s.normal, reach)).collect();
            Tree::new(&keys)
        };
        Trees { of_part: self.of_part.map(|_, list| tree(list)), rest: tree(&self.rest) }
    }

    fn nearest(&self, trees: &Trees, spot: &Spot, here: &Point3, reach: f64) -> Option<&Spot> {
        let (tree, list) = match spot.part {
            None => (&trees.rest, &self.rest),
            Some(part) => (trees.of_part.get(part)?, self.of_part.get(part)?),
        };
        let mut found = Vec::with_capacity(2);
        tree.nearest(&key(here, &spot.normal, reach), 1, &mut found);
        let (_, index) = found.first()?;
        Some(&self.fixed[list[*index as usize] as usize])
    }
}

/// The direction of a vector turned to the other end of the vehicle, for telling whether it stands backwards.
pub(super) fn turned(shape: &Shape) -> Shape {
    let spots = shape.spots.iter().map(|spot| Spot {
        point: Point3::new(spot.point.x, spot.point.y, -spot.point.z),
        normal: Vector3::new(spot.normal.x, spot.normal.y, -spot.normal.z),
        ..*spot
    });
    let [a, b, c, d] = shape.frame.stations;
    let frame = Frame { stations: [-d, -c, -b, -a], ..shape.frame };
    Shape { spots: spots.collect(), frame }
}
