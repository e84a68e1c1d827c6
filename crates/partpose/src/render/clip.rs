//! Clipping of the few triangles that the near plane or the guard band cuts.
//!
//! Sutherland and Hodgman: *Reentrant Polygon Clipping*, CACM 1974, in homogeneous pixel coordinates, in which both
//! are linear. A cut is always computed from the end that is kept to the one that is not, so two triangles get the
//! same point on the edge they share, and no crack opens between them.

use nalgebra::Vector3;

use super::NEAR;
use super::project::GUARD;

/// Corners of a clipped triangle: three, and at most one more for each of the five planes.
pub(super) const MAX_CORNERS: usize = 8;

/// A convex polygon of homogeneous pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Polygon {
    corners: [Vector3<f64>; MAX_CORNERS],
    count: usize,
}

impl Polygon {
    pub(super) fn corners(&self) -> &[Vector3<f64>] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: Vector3<f64>) {
        // A triangle that is not finite can cross a plane more than twice; what does not fit is left out.
        if self.count < MAX_CORNERS {
            self.corners[self.count] = corner;
            self.count += 1;
        }
    }
}

/// What lies in front of the near plane and within the guard band; fewer than three corners if nothing does.
pub(super) fn clip(triangle: [Vector3<f64>; 3]) -> Polygon {
    let mut polygon = Polygon { corners: [Vector3::zeros(); MAX_CORNERS], count: 0 };
    for corner in triangle {
        polygon.push(corner);
    }
    // The near plane first: the others are half-spaces of the screen only where z > 0.
    let polygon = clip_plane(&polygon, |p| p.z - NEAR);
    let polygon = clip_plane(&polygon, |p| GUARD * p.z - p.x);
    let polygon = clip_plane(&polygon, |p| GUARD * p.z + p.x);
    let polygon = clip_plane(&polygon, |p| GUARD * p.z - p.y);
    clip_plane(&polygon, |p| GUARD * p.z + p.y)
}

/// The part where `height` is not negative.
fn clip_plane(polygon: &Polygon, height: impl Fn(&Vector3<f64>) -> f64) -> Polygon {
    let corners = polygon.corners();
    let mut kept = Polygon { corners: [Vector3::zeros(); MAX_CORNERS], count: 0 };
    for (i, corner) in corners.iter().enumerate() {
        let next = &corners[(i + 1) % corners.len()];
        let (here, there) = (height(corner), height(next));
        if here >= 0.0 {
            kept.push(*corner);
            if there < 0.0 {
                kept.push(cut(corner, here, next, there));
            }
        } else if there >= 0.0 {
            kept.push(cut(next, there, corner, here));
        }
    }
    kept
}

fn cut(inside: &Vector3<f64>, above: f64, outside: &Vector3<f64>, below: f64) -> Vector3<f64> {
    inside + (outside - inside) * (above / (above - below))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_in_front_stays() {
        let triangle =
            [Vector3::new(0.0, 0.0, 1.0), Vector3::x() + Vector3::z(), Vector3::z() * 2.0];
        assert_eq!(clip(triangle).corners(), &triangle);
    }

    #[test]
    fn triangle_behind_vanishes() {
        let triangle = [Vector3::zeros(), Vector3::x(), -Vector3::z()];
        assert!(clip(triangle).corners().is_empty());
    }

    #[test]
    fn shared_edge_is_cut_at_the_same_point_from_both_sides() {
        let (a, b) = (Vector3::new(0.3, 0.7, 2.0), Vector3::new(-0.9, 0.1, -1.7));
        let one = clip([a, b, Vector3::new(5.0, 0.0, 3.0)]);
        let other = clip([b, a, Vector3::new(-5.0, 0.0, 3.0)]);
        let shared = one.corners().iter().filter(|p| other.corners().contains(p)).count();
        assert_eq!(shared, 2);
    }
}
