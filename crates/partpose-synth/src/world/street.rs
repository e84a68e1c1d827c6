//! Ground that follows a path: a cross-section of strips, drawn along it.

use nalgebra::Point3;
use partpose::geometry::Pose;

use super::path::Path;
use super::shapes::{P, Shape, V};
use super::stuff::Prop;
use crate::scene::{Material, Object, SegmentClass};

/// A strip of ground between two lines along a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strip {
    /// Metres to the right of the path and above it.
    pub(crate) from: [f64; 2],
    /// The other edge.
    pub(crate) to: [f64; 2],
    /// Index of its material.
    pub(crate) material: u16,
}

/// A strip at a height.
pub(crate) fn flat(from: f64, to: f64, up: f64, material: u16) -> Strip {
    Strip { from: [from, up], to: [to, up], material }
}

/// The upright side of a kerb.
pub(crate) fn riser(at: f64, low: f64, high: f64, material: u16) -> Strip {
    Strip { from: [at, low], to: [at, high], material }
}

/// Strips along a piece of a path, as one object; `lift` raises a point given by its length along the path and its
/// distance from it.
pub(crate) fn ribbon(
    path: &Path,
    [start, end]: [f64; 2],
    step: f64,
    strips: &[Strip],
    lift: &dyn Fn(f64, f64) -> f64,
    look: (&[Material], SegmentClass),
) -> Option<Object> {
    if end - start < 1e-3 || strips.is_empty() {
        return None;
    }
    let world_from_piece = path.pose(0.5 * (start + end));
    let piece_from_world = world_from_piece.inverse();
    let count = ((end - start) / step).ceil().max(1.0) as usize;
    let lengths: Vec<f64> =
        (0..=count).map(|i| start + (end - start) * i as f64 / count as f64).collect();
    let poses: Vec<Pose> = lengths.iter().map(|s| piece_from_world * path.pose(*s)).collect();
    let mut shape = Shape::default();
    for strip in strips {
        let line = |[right, up]: [f64; 2], across: f64| -> Vec<(P, [f32; 2])> {
            let point = |(s, pose): (&f64, &Pose)| {
                let at = pose * Point3::new(right, -up - lift(*s, right), 0.0);
                // The start keeps small numbers in the texture, which f32 cannot hold for a path of kilometres.
                (
                    at.cast::<f32>(),
                    [(s - start) as f32 + (start.rem_euclid(1000.0)) as f32, across as f32],
                )
            };
            lengths.iter().zip(&poses).map(point).collect()
        };
        let upright = (strip.to[0] - strip.from[0]).abs() < 1e-6;
        let out = if upright {
            // Kerbs face the road, which is where the path is.
            V::new(if strip.from[0] > 0.0 { -1.0 } else { 1.0 }, 0.0, 0.0)
        } else {
            -V::y()
        };
        let [a, b] =
            if upright { [strip.from[1], strip.to[1]] } else { [strip.from[0], strip.to[0]] };
        shape.strip([&line(strip.from, a), &line(strip.to, b)], out, strip.material);
    }
    let (materials, class) = look;
    Some(Prop { mesh: shape.finish(), materials: materials.into(), class }.at(world_from_piece))
}

/// Where dashes lie in a piece of a path: `length` of every `period` metres.
pub(crate) fn dashes([start, end]: [f64; 2], length: f64, period: f64) -> Vec<[f64; 2]> {
    let first = (start / period).floor() as i64;
    let last = (end / period).ceil() as i64;
    let dash = |i: i64| {
        let from = i as f64 * period;
        [from.max(start), (from + length).min(end)]
    };
    (first..last).map(dash).filter(|[from, to]| to - from > 0.05).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_meet_at_the_seams_of_pieces() {
        let total = |range| dashes(range, 3.0, 9.0).iter().map(|[a, b]| b - a).sum::<f64>();
        assert!((total([0.0, 90.0]) - 30.0).abs() < 1e-9);
        assert!((total([0.0, 1.0]) + total([1.0, 90.0]) - 30.0).abs() < 1e-9);
    }
}
