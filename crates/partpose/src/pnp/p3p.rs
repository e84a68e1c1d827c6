//! P3P: the up to four poses that three points allow.
//!
//! Persson and Nordberg: *Lambda Twist: An Accurate Fast Robust Perspective Three Point (P3P) Solver*, ECCV 2018. The
//! three distances between the points make two quadratic forms in the depths; the pencil's degenerate member, from one
//! real root of a cubic, splits into two planes, and each plane leaves a quadratic for the ratio of two depths. Depths
//! are polished by Newton's method.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{Correspondence, PnpError, check};
use crate::geometry::{Camera, Pose};

/// Newton steps on the depths; two bring a good start to rounding.
const POLISH_STEPS: usize = 4;
/// Largest error of a squared side, as a share of the longest, in a solution.
const FITS: f64 = 1e-6;
/// Area of the triangle over its squared side, below which the points count as a line.
const LINE: f64 = 1e-7;

/// Up to four poses.
#[derive(Clone, Copy, Debug)]
pub(super) struct UpToFour {
    poses: [Pose; 4],
    len: usize,
}

impl UpToFour {
    pub(super) fn as_slice(&self) -> &[Pose] {
        &self.poses[..self.len]
    }
}

/// All `camera_from_object` that put the three points on their pixels, in front of the camera; possibly none.
pub fn p3p(correspondences: &[Correspondence; 3], camera: &Camera) -> Result<Vec<Pose>, PnpError> {
    check(correspondences, camera, 3)?;
    let rays = correspondences.map(|c| camera.ray(&c.point_in_image).normalize());
    let points = correspondences.map(|c| c.point_in_object.coords);
    let poses = p3p_from_rays(&rays, &points).ok_or(PnpError::Degenerate)?;
    Ok(poses.as_slice().to_vec())
}

/// The same from unit rays; `None` for points on a line.
pub(super) fn p3p_from_rays(
    rays: &[Vector3<f64>; 3],
    points: &[Vector3<f64>; 3],
) -> Option<UpToFour> {
    let side12 = points[0] - points[1];
    let side13 = points[0] - points[2];
    let normal = side12.cross(&side13);
    let (a12, a13) = (side12.norm_squared(), side13.norm_squared());
    let a23 = (points[1] - points[2]).norm_squared();
    if !(normal.norm() > LINE * a12.max(a13)) {
        return None;
    }
    let triangle = Triangle {
        a: [a12, a13, a23],
        c: [rays[0].dot(&rays[1]), rays[0].dot(&rays[2]), rays[1].dot(&rays[2])],
    };
    let inverse = Matrix3::from_columns(&[side12, side13, normal]).try_inverse()?;
    let mut result = UpToFour { poses: [Pose::identity(); 4], len: 0 };
    let mut add = |depths: Vector3<f64>| {
        let depths = triangle.polish(depths);
        if result.len == 4
            || !triangle.fits(&depths)
            || !depths.iter().all(|depth| *depth > 0.0 && depth.is_finite())
        {
            return;
        }
        let first = rays[0] * depths.x;
        let (e12, e13) = (first - rays[1] * depths.y, first - rays[2] * depths.z);
        let rotation = Matrix3::from_columns(&[e12, e13, e12.cross(&e13)]) * inverse;
        let translation = first - rotation * points[0];
        let rotation = Rotation3::from_matrix_unchecked(rotation);
        let rotation = UnitQuaternion::from_rotation_matrix(&rotation).into_inner();
        let rotation = UnitQuaternion::new_normalize(rotation);
        if translation.iter().chain(rotation.coords.iter()).all(|value| value.is_finite()) {
            result.poses[result.len] = Pose::from_parts(translation.into(), rotation);
            result.len += 1;
        }
    };
    triangle.depths(&mut add);
    Some(result)
}

/// Squared sides 12, 13, 23 and cosines between the rays of the same pairs.
struct Triangle {
    a: [f64; 3],
    c: [f64; 3],
}

impl Triangle {
    /// Hands every triple of depths with two equal-signed ratios to `found`.
    fn depths(&self, found: &mut impl FnMut(Vector3<f64>)) {
        let [a12, a13, a23] = self.a;
        let [c12, c13, c23] = self.c;
        let root = self.pencil_root();
        // The degenerate member of the pencil, in the depths of points 1, 2, 3.
        let d = Matrix3::new(
            a23 * (1.0 - root),
            -a23 * c12,
            a23 * c13 * root,
            -a23 * c12,
            a23 - a12 + a13 * root,
            -c23 * (a13 * root - a12),
            a23 * c13 * root,
            -c23 * (a13 * root - a12),
            root * (a13 - a23) - a12,
        );
        let Some((values, vectors)) = eigen_of_singular(&d) else { return };
        let slope = (-values[1] / values[0]).max(0.0).sqrt();
        let (first, second) = (vectors[0], vectors[1]);
        for slope in [slope, -slope] {
            // The plane through the origin: (first - slope * second) . depths = 0, solved for depth 1.
            let plane = first - second * slope;
            let scale = -1.0 / plane.x;
            let (w0, w1) = (plane.y * scale, plane.z * scale);
            if !(w0.is_finite() && w1.is_finite()) {
                continue;
            }
            let lead = (a13 - a12) * w1 * w1 + 2.0 * a12 * c13 * w1 - a12;
            let half = -a13 * c12 * w1 + a12 * c13 * w0 - w0 * w1 * (a12 - a13);
            let constant = (a13 - a12) * w0 * w0 - 2.0 * a13 * c12 * w0 + a13;
            for ratio in quadratic_roots(lead, half, constant) {
                if !(ratio > 0.0 && ratio.is_finite()) {
                    continue;
                }
                let l2 = (a23 / (ratio * (ratio - 2.0 * c23) + 1.0)).sqrt();
                let l3 = ratio * l2;
                let l1 = w0 * l2 + w1 * l3;
                if l1 >= 0.0 {
                    found(Vector3::new(l1, l2, l3));
                }
            }
        }
    }

    /// A real root of the cubic that makes the pencil's member singular.
    fn pencil_root(&self) -> f64 {
        let [a12, a13, a23] = self.a;
        let [c12, c13, c23] = self.c;
        let (s12, s13, s23) = (1.0 - c12 * c12, 1.0 - c13 * c13, 1.0 - c23 * c23);
        let blob = c12 * c23 * c13 - 1.0;
        let p3 = a13 * (a23 * s13 - a13 * s23);
        let p2 = 2.0 * blob * a23 * a13 + a13 * (2.0 * a12 + a13) * s23 + a23 * (a23 - a12) * s13;
        let p1 = a23 * (a13 - a23) * s12 - a12 * a12 * s23 - 2.0 * a12 * (blob * a23 + a13 * s23);
        let p0 = a12 * (a12 * s23 - a23 * s12);
        real_root(p3, p2, p1, p0)
    }

    /// By how much the squared distances between points at these depths miss.
    fn errors(&self, l: &Vector3<f64>) -> Vector3<f64> {
        let [c12, c13, c23] = self.c;
        Vector3::new(
            l.x * l.x + l.y * l.y - 2.0 * c12 * l.x * l.y - self.a[0],
            l.x * l.x + l.z * l.z - 2.0 * c13 * l.x * l.z - self.a[1],
            l.y * l.y + l.z * l.z - 2.0 * c23 * l.y * l.z - self.a[2],
        )
    }

    /// Whether the depths solve the problem; degenerate rays leave roots that do not.
    fn fits(&self, depths: &Vector3<f64>) -> bool {
        self.errors(depths).abs().max() < FITS * self.a.iter().fold(0.0, |max, a| a.max(max))
    }

    /// Newton's method on the three squared distances.
    fn polish(&self, start: Vector3<f64>) -> Vector3<f64> {
        let mut l = start;
        let scale = self.a[0] + self.a[1] + self.a[2];
        let [c12, c13, c23] = self.c;
        for _ in 0..POLISH_STEPS {
            let error = self.errors(&l);
            if error.abs().sum() < 1e-14 * scale {
                break;
            }
            let (xy, yx) = (l.x - c12 * l.y, l.y - c12 * l.x);
            let (xz, zx) = (l.x - c13 * l.z, l.z - c13 * l.x);
            let (yz, zy) = (l.y - c23 * l.z, l.z - c23 * l.y);
            let slope = 2.0 * Matrix3::new(xy, yx, 0.0, xz, 0.0, zx, 0.0, yz, zy);
            let Some(inverse) = slope.try_inverse() else { break };
            let next = l - inverse * error;
            if !next.iter().all(|depth| depth.is_finite()) {
                break;
            }
            l = next;
        }
        l
    }
}

/// Roots of `a x^2 + 2 b x + c`, NaN where they are not real.
fn quadratic_roots(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let q = -(b + discriminant.sqrt().copysign(b));
    if q == 0.0 { [0.0; 2] } else { [q / a, c / q] }
}

/// A real root of `p3 x^3 + p2 x^2 + p1 x + p0`, the sharpest where there are three.
fn real_root(p3: f64, p2: f64, p1: f64, p0: f64) -> f64 {
    let value = |x: f64| ((p3 * x + p2) * x + p1) * x + p0;
    let slope = |x: f64| (3.0 * p3 * x + 2.0 * p2) * x + p1;
    let (b, c, d) = (p2 / p3, p1 / p3, p0 / p3);
    // Depressed: x = y - b / 3, y^3 + p y + q.
    let p = c - b * b / 3.0;
    let q = (2.0 * b * b / 27.0 - c / 3.0) * b + d;
    let discriminant = 0.25 * q * q + p * p * p / 27.0;
    let y = if discriminant >= 0.0 {
        let u = -(0.5 * q.abs() + discriminant.sqrt()).cbrt().copysign(q);
        if u == 0.0 { 0.0 } else { u - p / (3.0 * u) }
    } else {
        // Three real roots; the outermost on the side of q is the simplest and steepest.
        let radius = (-p / 3.0).sqrt();
        let angle = (-0.5 * q / (radius * radius * radius)).clamp(-1.0, 1.0).acos() / 3.0;
        let outer = 2.0 * radius * angle.cos();
        let other = 2.0 * radius * (angle + std::f64::consts::TAU / 3.0).cos();
        let steeper = slope(outer - b / 3.0).abs() >= slope(other - b / 3.0).abs();
        if steeper { outer } else { other }
    };
    let mut x = y - b / 3.0;
    for _ in 0..2 {
        let next = x - value(x) / slope(x);
        if next.is_finite() {
            x = next;
        }
    }
    x
}

/// The two eigenpairs of a symmetric singular matrix that do not vanish, the larger magnitude first.
fn eigen_of_singular(m: &Matrix3<f64>) -> Option<([f64; 2], [Vector3<f64>; 2])> {
    // The null vector is a cross product of two rows: the longest of the three.
    let rows = [m.row(0).transpose(), m.row(1).transpose(), m.row(2).transpose()];
    let crosses = [rows[0].cross(&rows[1]), rows[0].cross(&rows[2]), rows[1].cross(&rows[2])];
    let longest = crosses.iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let null = longest.try_normalize(0.0)?;
    // A 2 x 2 problem in the plane orthogonal to it.
    let helper = if null.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let a = null.cross(&helper).try_normalize(0.0)?;
    let b = null.cross(&a);
    let (ma, mb) = (m * a, m * b);
    let (aa, ab, bb) = (a.dot(&ma), a.dot(&mb), b.dot(&mb));
    let mean = 0.5 * (aa + bb);
    let half = 0.5 * (aa - bb);
    let radius = (half * half + ab * ab).sqrt();
    let angle = 0.5 * ab.atan2(half);
    let (sin, cos) = angle.sin_cos();
    let (upper, lower) = (a * cos + b * sin, b * cos - a * sin);
    let pair = ([mean + radius, mean - radius], [upper, lower]);
    let pair = if pair.0[0].abs() >= pair.0[1].abs() {
        pair
    } else {
        ([pair.0[1], pair.0[0]], [pair.1[1], pair.1[0]])
    };
    (pair.0[0].is_finite() && pair.0[0] != 0.0).then_some(pair)
}
