//! Where parts belong on a vehicle, and which faces hang together.

use std::collections::HashMap;

use crate::geometry::Point3;
use crate::parts::PartClass;

/// -1 for parts of the vehicle's left, 1 for those of its right, 0 for those of both: the sign of x.
pub(super) fn side_of(part: PartClass) -> i8 {
    // Ids run from left to right.
    match part.id().cmp(&part.opposite().id()) {
        std::cmp::Ordering::Less => -1,
        std::cmp::Ordering::Equal => 0,
        std::cmp::Ordering::Greater => 1,
    }
}

/// 1 for parts of the front, -1 for those of the rear, 0 for those of neither: the sign of z.
///
/// The C-pillar's windows count as rear.
pub(super) fn end_of(part: PartClass) -> i8 {
    use PartClass as P;
    match part {
        P::SideLeft | P::SideRight | P::MirrorLeft | P::MirrorRight | P::Roof => 0,
        P::Hood => 1,
        P::Trunk => -1,
        _ => {
            let place = part.name().rsplit('_').next().unwrap_or_default();
            if place.starts_with('F') { 1 } else { -1 }
        }
    }
}

/// The connected piece that each face belongs to, numbered in the order of faces.
///
/// Faces hang together that share a position, whether or not they share its index.
pub(super) fn pieces(vertices: &[Point3], faces: &[[u32; 3]]) -> Vec<usize> {
    let mut at_position: HashMap<[u64; 3], u32> = HashMap::new();
    let mut parent: Vec<u32> = Vec::with_capacity(vertices.len());
    for (at, p) in vertices.iter().enumerate() {
        let key = [p.x, p.y, p.z].map(|value| (value + 0.0).to_bits());
        parent.push(*at_position.entry(key).or_insert(at as u32));
    }
    for [a, b, c] in faces {
        for other in [b, c] {
            let [a, b] = [*a, *other].map(|at| root_of(&mut parent, at));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number_of: HashMap<u32, usize> = HashMap::new();
    let mut piece = |face: &[u32; 3]| {
        let root = root_of(&mut parent, face[0]);
        let next = number_of.len();
        *number_of.entry(root).or_insert(next)
    };
    faces.iter().map(&mut piece).collect()
}

/// The vertex that stands for a piece; the way there is shortened by halving.
fn root_of(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        parent[at as usize] = parent[parent[at as usize] as usize];
        at = parent[at as usize];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_and_ends_follow_from_names() {
        for part in PartClass::ALL {
            assert_eq!(side_of(part.opposite()), -side_of(part));
            assert_eq!(end_of(part.opposite()), end_of(part));
        }
        assert_eq!((side_of(PartClass::DoorFrontLeft), end_of(PartClass::DoorFrontLeft)), (-1, 1));
        assert_eq!((side_of(PartClass::ApronRear), end_of(PartClass::ApronRear)), (0, -1));
        assert_eq!((side_of(PartClass::SideRight), end_of(PartClass::SideRight)), (1, 0));
        assert_eq!(end_of(PartClass::from_name("windshield_F").unwrap()), 1);
    }

    #[test]
    fn faces_that_share_a_position_are_one_piece() {
        let x = |x: f64| Point3::new(x, 0.0, 0.0);
        let vertices = [x(0.0), x(1.0), x(2.0), x(2.0), x(3.0), x(4.0), x(7.0), x(8.0), x(9.0)];
        let faces = [[6, 7, 8], [0, 1, 2], [3, 4, 5]];
        assert_eq!(pieces(&vertices, &faces), [0, 1, 1]);
    }
}
