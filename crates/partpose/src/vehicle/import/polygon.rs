//! Polygons cut into triangles by clipping ears.
//!
//! Meisters: *Polygons Have Ears*, American Mathematical Monthly 1975. The polygon is looked at along its normal after
//! Newell (Sutherland, Sproull and Schumacker, 1974), which exists for polygons that are not quite flat too. Convex
//! polygons are cut into a fan at once. Limits: polygons of more than [`MAX_CORNERS`] corners are cut as if they were
//! convex, since clipping takes the third power of their number; crossing edges give triangles that overlap.

use crate::geometry::{Point2, Point3, Vector3};

/// Most corners of a polygon that is cut with care.
pub(super) const MAX_CORNERS: usize = 64;

/// Triangles of a polygon as positions in its list of corners, running the same way round.
pub(super) fn triangulate(corners: &[Point3]) -> Vec<[usize; 3]> {
    let count = corners.len();
    if !(4..=MAX_CORNERS).contains(&count) {
        return fan(count);
    }
    let flat = flatten(corners);
    let is_convex = (0..count)
        .all(|at| turn(&flat[at], &flat[(at + 1) % count], &flat[(at + 2) % count]) >= 0.0);
    if is_convex {
        return fan(count);
    }
    let mut left: Vec<usize> = (0..count).collect();
    let mut triangles = Vec::with_capacity(count - 2);
    while left.len() > 3 {
        let n = left.len();
        let ear = (0..n).find(|at| is_ear(&flat, &left, *at));
        // Where edges cross there may be no ear; the rest is then cut anyhow.
        let at = ear.unwrap_or(0);
        triangles.push([left[(at + n - 1) % n], left[at], left[(at + 1) % n]]);
        left.remove(at);
    }
    triangles.push([left[0], left[1], left[2]]);
    triangles
}

fn fan(count: usize) -> Vec<[usize; 3]> {
    (2..count).map(|at| [0, at - 1, at]).collect()
}

/// Whether the corner sticks out and no other corner lies in the triangle it makes.
fn is_ear(flat: &[Point2], left: &[usize], at: usize) -> bool {
    let n = left.len();
    let three = [left[(at + n - 1) % n], left[at], left[(at + 1) % n]];
    let [a, b, c] = three.map(|corner| flat[corner]);
    if turn(&a, &b, &c) <= 0.0 {
        return false;
    }
    let is_inside =
        |p: &Point2| turn(&a, &b, p) >= 0.0 && turn(&b, &c, p) >= 0.0 && turn(&c, &a, p) >= 0.0;
    let mut others = left.iter().filter(|corner| !three.contains(*corner));
    !others.any(|corner| {
        // A corner at the same place as one of the three, as at the ends of a slit, takes no room.
        let p = &flat[*corner];
        *p != a && *p != b && *p != c && is_inside(p)
    })
}

/// Twice the signed area of a triangle, positive if it runs counter-clockwise.
fn turn(a: &Point2, b: &Point2, c: &Point2) -> f64 {
    (b - a).perp(&(c - a))
}

/// The corners seen against the normal, so that the polygon runs counter-clockwise.
fn flatten(corners: &[Point3]) -> Vec<Point2> {
    let mut normal = Vector3::zeros();
    for (at, p) in corners.iter().enumerate() {
        let q = &corners[(at + 1) % corners.len()];
        normal += (p - corners[0]).cross(&(q - corners[0]));
    }
    // The axis along which the normal is longest is left out; a negative one mirrors.
    let axis = normal.iamax();
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    let [u, v] = if normal[axis] < 0.0 { [v, u] } else { [u, v] };
    corners.iter().map(|p| Point2::new(p[u], p[v])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(corners: &[Point3], triangles: &[[usize; 3]]) -> f64 {
        let flat = flatten(corners);
        triangles.iter().map(|[a, b, c]| 0.5 * turn(&flat[*a], &flat[*b], &flat[*c]).abs()).sum()
    }

    #[test]
    fn triangles_of_a_concave_polygon_cover_it_once() {
        // An L, seen from either side and along each axis.
        let l = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
        for start in 0..6 {
            for axis in 0..3 {
                let mut corners: Vec<Point3> = l
                    .iter()
                    .cycle()
                    .skip(start)
                    .take(6)
                    .map(|[x, y]| {
                        let mut p = Point3::origin();
                        p[axis] = *x;
                        p[(axis + 1) % 3] = *y;
                        p
                    })
                    .collect();
                for _ in 0..2 {
                    let triangles = triangulate(&corners);
                    assert_eq!(triangles.len(), 4);
                    assert!((area(&corners, &triangles) - 3.0).abs() < 1e-12);
                    corners.reverse();
                }
            }
        }
    }

    #[test]
    fn any_polygon_gives_two_triangles_less_than_corners() {
        for count in 3..100 {
            let corners: Vec<Point3> = (0..count)
                .map(|at| Point3::new(f64::from(at * 7 % 5), f64::from(at * 3 % 11), 0.0))
                .collect();
            assert_eq!(triangulate(&corners).len(), count as usize - 2);
        }
    }
}
