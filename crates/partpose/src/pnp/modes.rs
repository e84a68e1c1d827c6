//! The second pose that explains nearly flat points almost as well.
//!
//! Seen from afar, a flat set of points tilted towards the camera looks like one tilted away: the plane's normal is
//! mirrored about the line of sight (Schweighofer and Pinz: *Robust Pose Estimation from a Planar Target*, PAMI 2006).
//! Reflecting the pose found so and descending from there finds the other minimum, for sets that are not flat too. No
//! solver can tell the two apart where noise drowns the perspective; a caller with other evidence can.

use nalgebra::{Matrix6, Unit, UnitQuaternion, Vector3};

use super::{
    Correspondence, PnpError, RefineOptions, Refinement, centroid,
    linalg::{cholesky, symmetric_eigen},
    refine, sqpnp,
};
use crate::geometry::{Camera, Pose};

/// Rotation (radians) above which two poses are different modes.
const DISTINCT_ANGLE: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Displacement, as a share of the distance, above which two poses are different modes.
const DISTINCT_SHARE: f64 = 0.1;
/// Algebraic minima that [`solve`] refines.
const REFINED: usize = 3;

/// A pose that explains the points, and how likely it is the right one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// The refined pose.
    pub refinement: Refinement,
    /// Probability among the modes, by the volume under each one's Gaussian: `exp(-cost / 2) / sqrt(det H)`.
    pub probability: f64,
}

/// What [`solve`] found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// The mode of least cost.
    pub best: Mode,
    /// The other one, if there is a distinct one.
    pub second: Option<Mode>,
}

/// The most likely pose and, if there is one, the other mode.
///
/// The three best minima of [`sqpnp()`] and the mirror image of the best pose, each refined. At least 3
/// correspondences; the probabilities suppose that `options.sigma` is the true noise.
pub fn solve(
    correspondences: &[Correspondence],
    camera: &Camera,
    options: &RefineOptions,
) -> Result<Solution, PnpError> {
    let minima = sqpnp(correspondences, camera)?;
    let mut best: Option<Refinement> = None;
    let mut second: Option<Refinement> = None;
    let mut failure = PnpError::BehindCamera;
    for minimum in minima.iter().take(REFINED) {
        match refine(correspondences, camera, &minimum.pose, options) {
            Ok(refined) => place(&refined, &mut best, &mut second),
            Err(error) => failure = error,
        }
    }
    let Some(first) = best else { return Err(failure) };
    if let Some(refined) = second_mode(correspondences, camera, &first, options) {
        place(&refined, &mut best, &mut second);
    }
    Ok(weigh(&best.unwrap_or(first), second.as_ref()))
}

/// The mode on the other side of the line of sight, refined; `None` if it falls back onto the first or does not exist.
pub fn second_mode(
    correspondences: &[Correspondence],
    camera: &Camera,
    first: &Refinement,
    options: &RefineOptions,
) -> Option<Refinement> {
    let start = mirrored(correspondences, &first.pose)?;
    let second = refine(correspondences, camera, &start, options).ok()?;
    are_distinct(&first.pose, &second.pose, &centroid(correspondences)).then_some(second)
}

/// Whether two poses are modes of their own: more than 5 degrees apart, or a tenth of the distance.
///
/// `center` is the centroid of the object points, metres.
pub fn are_distinct(a: &Pose, b: &Pose, center: &Vector3<f64>) -> bool {
    let (in_a, in_b) = (a * nalgebra::Point3::from(*center), b * nalgebra::Point3::from(*center));
    a.rotation.angle_to(&b.rotation) > DISTINCT_ANGLE
        || (in_a - in_b).norm() > DISTINCT_SHARE * in_a.coords.norm()
}

/// The turn that mirrors a normal about the line of sight to `center`; `None` if it already lies along it.
pub(super) fn mirror(normal: &Vector3<f64>, center: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let sight = center.try_normalize(0.0)?;
    let cosine = normal.dot(&sight);
    // The nearer of the two directions along the line of sight.
    let sight = if cosine < 0.0 { -sight } else { sight };
    let axis = Unit::try_new(normal.cross(&sight), 1e-9)?;
    Some(UnitQuaternion::from_axis_angle(&axis, 2.0 * cosine.abs().min(1.0).acos()))
}

fn mirrored(correspondences: &[Correspondence], pose: &Pose) -> Option<Pose> {
    let center = centroid(correspondences);
    let mut covariance = [[0.0; 3]; 3];
    for c in correspondences {
        let p = c.point_in_object.coords - center;
        for i in 0..3 {
            for j in 0..3 {
                covariance[i][j] += p[i] * p[j];
            }
        }
    }
    let normal_in_object = Vector3::from(symmetric_eigen(covariance).1[0]);
    let in_camera = pose.rotation * center + pose.translation.vector;
    let rotation = mirror(&(pose.rotation * normal_in_object), &in_camera)? * pose.rotation;
    Some(Pose::from_parts((in_camera - rotation * center).into(), rotation))
}

/// Files a refined pose as best, as second, or nowhere. The distance rule of two modes refers to the object's origin.
fn place(refined: &Refinement, best: &mut Option<Refinement>, second: &mut Option<Refinement>) {
    let distinct =
        |a: &Refinement, b: &Refinement| are_distinct(&a.pose, &b.pose, &Vector3::zeros());
    match best {
        None => *best = Some(*refined),
        Some(first) if refined.cost < first.cost => {
            if distinct(first, refined) {
                *second = Some(*first);
            } else if second.as_ref().is_some_and(|second| !distinct(second, refined)) {
                *second = None;
            }
            *best = Some(*refined);
        }
        Some(first) if distinct(first, refined) => {
            if second.as_ref().is_none_or(|second| refined.cost < second.cost) {
                *second = Some(*refined);
            }
        }
        Some(_) => {}
    }
}

fn weigh(best: &Refinement, second: Option<&Refinement>) -> Solution {
    let Some(second) = second else {
        return Solution { best: Mode { refinement: *best, probability: 1.0 }, second: None };
    };
    let log_odds = 0.5 * (best.cost - second.cost) + log_volume(&second.covariance)
        - log_volume(&best.covariance);
    let probability = if log_odds.is_finite() { 1.0 / (1.0 + (-log_odds).exp()) } else { 0.0 };
    Solution {
        best: Mode { refinement: *best, probability: 1.0 - probability },
        second: Some(Mode { refinement: *second, probability }),
    }
}

/// Half the logarithm of the determinant; NaN if the covariance is not finite.
fn log_volume(covariance: &Matrix6<f64>) -> f64 {
    let rows: [[f64; 6]; 6] = std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)]));
    cholesky(&rows).map_or(f64::NAN, |(l, _)| (0..6).map(|i| l[i][i].ln()).sum())
}
