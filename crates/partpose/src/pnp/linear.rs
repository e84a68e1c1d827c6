//! The linear form of the problem, which EPnP and SQPnP share.
//!
//! A point `p` with the ray `(u, v, 1)` puts `x - u z = 0` and `y - v z = 0` on its camera coordinates `M a + t`, where
//! `a` are the coordinates of `p` about the centroid along the principal axes. The sum of squares is a quadratic form in
//! `(M, t)`; `t` is free, so it is eliminated, and what is left is `x' omega x` with `x` the nine entries of `M`.

use nalgebra::{Matrix3, Vector3};

use super::{Correspondence, PnpError, centroid, linalg::symmetric_eigen};
use crate::geometry::Camera;

/// Points whose second spread is below this share of the first count as a line.
const LINE: f64 = 1e-7;

/// Extent, metres, below which the points count as one.
const SMALLEST: f64 = 1e-100;

/// Nine numbers: entry `3 j + c` is component `c` of the image of principal axis `j`.
pub(super) type Nine = [f64; 9];

/// The problem as a quadratic form in the images of the principal axes.
pub(super) struct LinearForm {
    /// Centroid of the object points, metres.
    pub(super) center: Vector3<f64>,
    /// Principal axes as columns, by decreasing spread, right-handed.
    pub(super) axes: Matrix3<f64>,
    /// Standard deviation of the points along the axes, in units of `scale`; the first is 1.
    pub(super) spread: [f64; 3],
    /// Metres in one unit of length of the form.
    pub(super) scale: f64,
    /// The form, symmetric.
    pub(super) omega: [Nine; 9],
    /// The centroid in the camera frame is `translation * x`, in units of `scale`.
    pub(super) translation: [Nine; 3],
}

impl LinearForm {
    /// Sums the form up; `Degenerate` for points on a line and for rays that all coincide.
    pub(super) fn new(
        correspondences: &[Correspondence],
        camera: &Camera,
    ) -> Result<Self, PnpError> {
        let n = correspondences.len() as f64;
        let center = centroid(correspondences);
        let (axes, spread) = principal_axes(correspondences, &center)?;
        let scale = spread[0];
        let to_axes = axes.transpose() / scale;
        let inverse_focal = [1.0 / camera.focal[0], 1.0 / camera.focal[1]];
        // Sums over the points of (1, u, v, u^2 + v^2), and the same times a_j and a_j a_k.
        let mut zeroth = [0.0; 4];
        let mut first = [[0.0; 4]; 3];
        let mut second = [[0.0; 4]; 6];
        for c in correspondences {
            let a = to_axes * (c.point_in_object.coords - center);
            let u = (c.point_in_image.x - camera.principal_point[0]) * inverse_focal[0];
            let v = (c.point_in_image.y - camera.principal_point[1]) * inverse_focal[1];
            let ray = [1.0, u, v, u * u + v * v];
            let products = [a.x * a.x, a.x * a.y, a.x * a.z, a.y * a.y, a.y * a.z, a.z * a.z];
            for q in 0..4 {
                zeroth[q] += ray[q];
                first[0][q] += a.x * ray[q];
                first[1][q] += a.y * ray[q];
                first[2][q] += a.z * ray[q];
                for (sum, product) in second.iter_mut().zip(&products) {
                    sum[q] += product * ray[q];
                }
            }
        }
        let inverse = block(&zeroth).try_inverse().ok_or(PnpError::Degenerate)?;
        let cross = first.map(|sums| block(&sums));
        let minus_t = cross.map(|b| inverse * b);
        let index = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
        let mut omega = [[0.0; 9]; 9];
        let mut translation = [[0.0; 9]; 3];
        for j in 0..3 {
            for k in j..3 {
                let entry = (block(&second[index[j][k]]) - cross[j] * minus_t[k]) / n;
                for row in 0..3 {
                    for column in 0..3 {
                        omega[3 * j + row][3 * k + column] = entry[(row, column)];
                        omega[3 * k + column][3 * j + row] = entry[(row, column)];
                    }
                }
            }
            for row in 0..3 {
                for column in 0..3 {
                    translation[row][3 * j + column] = -minus_t[j][(row, column)];
                }
            }
        }
        let usable = omega.iter().chain(&translation).flatten().all(|value| value.is_finite());
        let spread = spread.map(|value| value / scale);
        let form = Self { center, axes, spread, scale, omega, translation };
        if usable { Ok(form) } else { Err(PnpError::Degenerate) }
    }

    /// The centroid in the camera frame that goes with `x`, in units of `scale`.
    pub(super) fn centroid_in_camera(&self, x: &Nine) -> Vector3<f64> {
        let dot = |row: &Nine| row.iter().zip(x).map(|(a, b)| a * b).sum();
        Vector3::new(
            dot(&self.translation[0]),
            dot(&self.translation[1]),
            dot(&self.translation[2]),
        )
    }
}

/// `Q = A' A` for the two rows `A = (1, 0, -u; 0, 1, -v)`, from the sums of 1, u, v and u^2 + v^2.
fn block(sums: &[f64; 4]) -> Matrix3<f64> {
    let [one, u, v, r] = *sums;
    Matrix3::new(one, 0.0, -u, 0.0, one, -v, -u, -v, r)
}

/// Principal axes as columns and standard deviations along them, largest first.
pub(super) fn principal_axes(
    correspondences: &[Correspondence],
    center: &Vector3<f64>,
) -> Result<(Matrix3<f64>, [f64; 3]), PnpError> {
    let mut extent = 0.0_f64;
    for c in correspondences {
        extent = extent.max((c.point_in_object.coords - center).amax());
    }
    if !(extent > SMALLEST) {
        return Err(PnpError::Degenerate);
    }
    let mut covariance = [[0.0; 3]; 3];
    for c in correspondences {
        let p = (c.point_in_object.coords - center) / extent;
        for row in 0..3 {
            for column in 0..3 {
                covariance[row][column] += p[row] * p[column];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(covariance);
    let n = correspondences.len() as f64;
    let spread = [2, 1, 0].map(|i: usize| extent * (values[i].max(0.0) / n).sqrt());
    if !(spread[1] > LINE * spread[0]) {
        return Err(PnpError::Degenerate);
    }
    let (a, b) = (Vector3::from(vectors[2]), Vector3::from(vectors[1]));
    Ok((Matrix3::from_columns(&[a, b, a.cross(&b)]), spread))
}
