//! EPnP: the camera coordinates of four control points, from the null space of a linear system.
//!
//! Lepetit, Moreno-Noguer and Fua: *EPnP: An Accurate O(n) Solution to the PnP Problem*, IJCV 2009. The control points
//! are the centroid and one point along each principal axis. Each object point, written in their barycentric
//! coordinates, puts two linear equations on their camera coordinates; the solution is a combination of the weakest
//! N = 1..4 singular vectors whose control points keep their distances. Three control points when the points are flat.
//!
//! What differs from the public implementations: the centroid's camera coordinates, which no distance constrains, are
//! eliminated first, so that the eigenproblem has 9 unknowns (6 for flat points) instead of 12; all four cases are
//! solved, N = 4 by relinearisation; Gauss-Newton is damped and runs until it converges; a pose must have all points in
//! front of the camera; the rotation is the nearest proper one.
//!
//! Limits: the constraints weigh distances, not pixels, so the result is not the most likely pose; with 4 or 5 points
//! the null space has several dimensions and failures are common. Refine it, or use [`super::sqpnp()`].

mod betas;

use nalgebra::{Matrix3, Vector3};

use super::{
    Correspondence, PnpError, check,
    linalg::{nearest_rotation, symmetric_eigen},
    linear::{LinearForm, Nine},
};
use crate::geometry::{Camera, Pose};
use betas::Distances;

/// Fewest correspondences.
const MIN_POINTS: usize = 4;
/// Third spread over first spread below which three control points are used alone.
const FLAT: f64 = 1e-3;
/// Third spread over first spread below which three control points are tried too.
const NEARLY_FLAT: f64 = 0.1;

/// Solves for `camera_from_object` with EPnP; at least 4 correspondences, not all on a line.
pub fn epnp(correspondences: &[Correspondence], camera: &Camera) -> Result<Pose, PnpError> {
    check(correspondences, camera, MIN_POINTS)?;
    let form = LinearForm::new(correspondences, camera)?;
    let mut best = Candidates { correspondences, camera, form: &form, best: None };
    let flatness = form.spread[2];
    if flatness > FLAT {
        let scales = form.spread;
        let omega: [Nine; 9] = std::array::from_fn(|i| {
            std::array::from_fn(|j| form.omega[i][j] / (scales[i / 3] * scales[j / 3]))
        });
        let (_, vectors) = symmetric_eigen(omega);
        let weakest = [vectors[0], vectors[1], vectors[2], vectors[3]];
        let distances = Distances::<4, 6>::new(&weakest, &scales);
        for betas in distances.starts_of_four().into_iter().flatten() {
            let betas = distances.gauss_newton(betas);
            best.offer(&combine(&weakest, &betas));
        }
    }
    if flatness < NEARLY_FLAT {
        let scales = [form.spread[0], form.spread[1], 1.0];
        let omega: [[f64; 6]; 6] = std::array::from_fn(|i| {
            std::array::from_fn(|j| form.omega[i][j] / (scales[i / 3] * scales[j / 3]))
        });
        let (_, vectors) = symmetric_eigen(omega);
        let weakest: [Nine; 3] = std::array::from_fn(|k| {
            let v = &vectors[k];
            [v[0], v[1], v[2], v[3], v[4], v[5], 0.0, 0.0, 0.0]
        });
        let distances = Distances::<3, 3>::new(&weakest, &scales);
        for betas in distances.starts_of_three().into_iter().flatten() {
            let betas = distances.gauss_newton(betas);
            best.offer(&combine(&weakest, &betas));
        }
    }
    best.best.map(|(_, pose)| pose).ok_or(PnpError::BehindCamera)
}

fn combine<const K: usize>(vectors: &[Nine; K], betas: &[f64; K]) -> Nine {
    let mut x = [0.0; 9];
    for (vector, beta) in vectors.iter().zip(betas) {
        for (sum, entry) in x.iter_mut().zip(vector) {
            *sum += beta * entry;
        }
    }
    x
}

/// The best pose so far.
struct Candidates<'a> {
    correspondences: &'a [Correspondence],
    camera: &'a Camera,
    form: &'a LinearForm,
    best: Option<(f64, Pose)>,
}

impl Candidates<'_> {
    /// Turns control points (relative to the centroid, one per axis) into a pose and keeps it if it reprojects best.
    fn offer(&mut self, control: &Nine) {
        let form = self.form;
        // The alignment of all points depends on the control points alone: axis j counts by its variance.
        let column = |j: usize| {
            let c = Vector3::new(control[3 * j], control[3 * j + 1], control[3 * j + 2]);
            c * form.spread[j]
        };
        let mut correlation = Matrix3::from_columns(&[column(0), column(1), column(2)]);
        // The depth of the centroid is the mean of all depths; the null vectors' sign is arbitrary.
        let images: Nine = std::array::from_fn(|i| {
            if form.spread[i / 3] > FLAT { control[i] / form.spread[i / 3] } else { 0.0 }
        });
        if form.centroid_in_camera(&images).z < 0.0 {
            correlation.neg_mut();
        }
        let Some(camera_from_axes) = nearest_rotation(&correlation) else { return };
        let rotation = camera_from_axes.to_rotation_matrix();
        let matrix = rotation.matrix();
        let images: Nine = std::array::from_fn(|i| matrix[(i % 3, i / 3)]);
        let center = form.centroid_in_camera(&images) * form.scale;
        let camera_from_object = matrix * form.axes.transpose();
        let translation = center - camera_from_object * form.center;
        let limit = self.best.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        let cost = self.cost(&camera_from_object, &translation, limit);
        if cost < limit {
            let rotation = nalgebra::Rotation3::from_matrix_unchecked(camera_from_object);
            let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
            self.best = Some((cost, Pose::from_parts(translation.into(), rotation)));
        }
    }

    /// Sum of squared pixel distances; infinite for a point behind the camera, anything above `limit` beyond it.
    fn cost(&self, rotation: &Matrix3<f64>, translation: &Vector3<f64>, limit: f64) -> f64 {
        let camera = self.camera;
        let mut cost = 0.0;
        for c in self.correspondences {
            let p = rotation * c.point_in_object.coords + translation;
            if !(p.z > 0.0) {
                return f64::INFINITY;
            }
            let inverse = 1.0 / p.z;
            let dx =
                camera.focal[0] * p.x * inverse + camera.principal_point[0] - c.point_in_image.x;
            let dy =
                camera.focal[1] * p.y * inverse + camera.principal_point[1] - c.point_in_image.y;
            cost += dx * dx + dy * dy;
            if !(cost < limit) {
                return f64::INFINITY;
            }
        }
        cost
    }
}
