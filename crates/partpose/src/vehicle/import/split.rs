//! One group that holds several parts, told apart by where its pieces lie.
//!
//! Models often have both rear wheels, or all four lamps, in one group. A group is taken apart into connected pieces;
//! each piece goes to the side, and to the end, where its middle lies. A piece on both sides, such as wheels with
//! their axle, is cut face by face.

use crate::geometry::{Point3, Vector3};
use crate::parts::PartClass;
use crate::vehicle::place::{end_of, pieces, side_of};

/// How far a piece must reach to either side to be cut, metres.
const MIN_REACH: f64 = 0.05;

/// Whether side and end tell each of these parts from the others.
pub(super) fn can_tell_apart(parts: &[PartClass]) -> bool {
    let places: Vec<(i8, i8)> = parts.iter().map(|part| (side_of(*part), end_of(*part))).collect();
    let all = |test: &dyn Fn(&(i8, i8)) -> bool| places.iter().all(test);
    match places.as_slice() {
        [_] => true,
        // One from each side at one end, or one from each end at one side.
        [a, b] => (a.0 * b.0 == -1 && a.1 == b.1) || (a.1 * b.1 == -1 && a.0 == b.0),
        [_, _, _, _] => {
            all(&|place| place.0 != 0 && place.1 != 0)
                && [(-1, -1), (-1, 1), (1, -1), (1, 1)].iter().all(|place| places.contains(place))
        }
        _ => false,
    }
}

/// The part of every face, in the vehicle frame; `middle` is where front and rear meet (z).
pub(super) fn split(
    parts: &[PartClass],
    vertices: &[Point3],
    faces: &[[u32; 3]],
    middle: f64,
) -> Vec<PartClass> {
    if let [part] = parts {
        return vec![*part; faces.len()];
    }
    let piece_of = pieces(vertices, faces);
    let count = piece_of.iter().max().map_or(0, |last| last + 1);
    // Sum of corners, their number, and the reach to both sides.
    let mut sums = vec![(Vector3::zeros(), 0_usize, [f64::INFINITY, f64::NEG_INFINITY]); count];
    for (face, piece) in faces.iter().zip(&piece_of) {
        for p in face.map(|at| vertices[at as usize]) {
            let (sum, corners, [low, high]) = &mut sums[*piece];
            *sum += p.coords;
            *corners += 1;
            (*low, *high) = (low.min(p.x), high.max(p.x));
        }
    }
    // What all parts have in common tells nothing: both rear wheels lie at the rear.
    let differ =
        |place: fn(PartClass) -> i8| parts.iter().any(|part| place(*part) != place(parts[0]));
    let (by_side, by_end) = (differ(side_of), differ(end_of));
    let part_at = |center: &Vector3| {
        let fits = |part: &&PartClass| {
            (!by_side || f64::from(side_of(**part)) * center.x >= 0.0)
                && (!by_end || f64::from(end_of(**part)) * (center.z - middle) >= 0.0)
        };
        parts.iter().find(fits).copied().unwrap_or(parts[0])
    };
    let part_of = |(face, piece): (&[u32; 3], &usize)| {
        let (sum, corners, [low, high]) = &sums[*piece];
        if by_side && *low < -MIN_REACH && *high > MIN_REACH {
            let corners = face.map(|at| vertices[at as usize].coords);
            return part_at(&((corners[0] + corners[1] + corners[2]) / 3.0));
        }
        part_at(&(sum / *corners as f64))
    };
    faces.iter().zip(&piece_of).map(part_of).collect()
}
