//! Lines along which panels meet, and which of them run near a face.
//!
//! A face knows all lines that come near it, not only those along its own edges: a seal is wider than many of the faces
//! beside it, and would have gaps and teeth otherwise.

use std::collections::{BTreeMap, HashMap};

use nalgebra::Vector3;
use partpose::parts::{CoarseClass, PartClass};

use crate::scene::{Joint, JointLine, Joints, SurfaceMesh};

use super::patchwork::Facet;

/// Lines further from a face than this do not concern it, metres.
const REACH: f32 = 0.022;
/// Side of the cells by which lines are found, metres.
const CELL: f32 = 0.08;

type V = Vector3<f32>;

/// What runs along the edges between parts; edges are two points of the patchwork, the smaller number first.
pub(super) fn edges_between_parts(facets: &[Facet]) -> BTreeMap<[u32; 2], Joint> {
    let is_glass = |part: PartClass| part.coarse() == CoarseClass::Glass;
    let mut owners: HashMap<[u32; 2], Option<PartClass>> = HashMap::new();
    let mut found = BTreeMap::new();
    for facet in facets {
        let [a, b, c] = facet.corners.map(|corner| corner.point);
        for edge in [[a, b], [b, c], [c, a]].map(|[a, b]| [a.min(b), a.max(b)]) {
            let Some(other) = owners.insert(edge, facet.part) else { continue };
            if let (Some(a), Some(b)) = (other, facet.part)
                && a != b
            {
                // The plane of symmetry divides nothing.
                let is_seal = is_glass(a) != is_glass(b);
                found.insert(edge, if is_seal { Joint::Seal } else { Joint::Gap });
            }
        }
    }
    found
}

/// The lines near every face of a surface.
pub(super) fn near_faces(surface: &SurfaceMesh, lines: &[JointLine]) -> Joints {
    let at = |vertex: u32| surface.vertices[vertex as usize].coords;
    let mut cells: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    for (i, line) in lines.iter().enumerate() {
        let [a, b] = line.ends.map(at);
        for cell in cells_between(&a.inf(&b), &a.sup(&b)) {
            cells.entry(cell).or_default().push(i as u32);
        }
    }
    let mut joints = Joints { starts: vec![0], lines: Vec::new() };
    for (face, part) in surface.faces.iter().zip(&surface.parts) {
        let corners = face.map(at);
        let reach = V::repeat(REACH);
        let low = corners.iter().fold(corners[0], |low, p| low.inf(p)) - reach;
        let high = corners.iter().fold(corners[0], |high, p| high.sup(p)) + reach;
        let mut near: Vec<u32> = cells_between(&low, &high)
            .filter(|_| *part != 0)
            .filter_map(|cell| cells.get(&cell))
            .flatten()
            .copied()
            .collect();
        near.sort_unstable();
        near.dedup();
        near.retain(|i| {
            let [a, b] = lines[*i as usize].ends.map(at);
            let is_beside = (0..3).all(|i| a[i].min(b[i]) < high[i] && low[i] < a[i].max(b[i]));
            is_beside && comes_near([a, b], &corners)
        });
        joints.lines.extend(near.into_iter().map(|i| lines[i as usize]));
        joints.starts.push(joints.lines.len() as u32);
    }
    joints
}

fn cells_between(low: &V, high: &V) -> impl Iterator<Item = [i32; 3]> + use<> {
    let [from, to] = [low, high].map(|p| p.map(|x| (x / CELL).floor() as i32));
    (from.x..=to.x).flat_map(move |x| {
        (from.y..=to.y).flat_map(move |y| (from.z..=to.z).map(move |z| [x, y, z]))
    })
}

/// Whether a line may come nearer to a triangle than the reach: by places on it, an eighth of its length apart.
fn comes_near([a, b]: [V; 2], triangle: &[V; 3]) -> bool {
    let limit = REACH + (b - a).norm() / 16.0;
    (0..=8).any(|i| distance_to_triangle(&a.lerp(&b, i as f32 / 8.0), triangle) < limit)
}

fn distance_to_triangle(p: &V, [a, b, c]: &[V; 3]) -> f32 {
    let normal = (b - a).cross(&(c - a));
    let is_left = |from: &V, to: &V| (to - from).cross(&(p - from)).dot(&normal) >= 0.0;
    if is_left(a, b) && is_left(b, c) && is_left(c, a) {
        return normal.dot(&(p - a)).abs() / normal.norm().max(1e-12);
    }
    [[a, b], [b, c], [c, a]].map(|[a, b]| to_line(p, a, b).norm()).into_iter().fold(1e9, f32::min)
}

/// From a place to the nearest place between two others.
fn to_line(p: &V, a: &V, b: &V) -> V {
    let along = b - a;
    let share = (along.dot(&(p - a)) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
    a + along * share - p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_that_pass_a_face_without_touching_it_concern_it() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(V::from);
        let near = [V::new(0.3, -0.02, 0.0), V::new(0.5, -0.02, 0.0)];
        assert!(comes_near(near, &corners));
        assert!(comes_near(near.map(|p| p + V::new(0.0, 0.2, 0.01)), &corners));
        assert!(!comes_near(near.map(|p| p - V::new(0.0, 0.1, 0.0)), &corners));
        assert!(!comes_near(near.map(|p| p + V::new(0.0, 0.2, 0.1)), &corners));
    }
}
