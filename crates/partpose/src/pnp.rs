//! Poses from points: where a camera is, given object points and the pixels they appear at.
//!
//! [`sqpnp`] finds every algebraic minimum, [`refine`] takes one to the maximum of the likelihood, [`second_mode`]
//! finds the other pose that explains nearly flat points as well, and [`solve`] does all three. [`ransac`] is for
//! correspondences of which some are wrong. [`epnp`] is the paper's solver, kept for comparison; it is never better.
//!
//! All arithmetic is `f64`. No function here panics or returns a pose with NaN, whatever the numbers it is given; few
//! points (up to 32) are handled without touching the heap.

#![expect(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(a > b)` is also true of NaN, which must fail every test of being usable"
)]
#![expect(
    clippy::needless_range_loop,
    reason = "matrix formulas over fixed arrays are written with their indices, as on paper"
)]

mod buffer;
mod epnp;
mod linalg;
mod linear;
mod loss;
mod modes;
mod p3p;
mod prior;
mod ransac;
mod refine;
mod sqpnp;
pub mod synthetic;

use crate::geometry::{Camera, Point2, Point3, Pose, Vector3};

pub use epnp::epnp;
pub use loss::Loss;
pub use modes::{Mode, Solution, are_distinct, second_mode, solve};
pub use p3p::p3p;
pub use prior::{HeightPrior, Priors, TiltPrior};
pub use ransac::{RansacOptions, RansacSolution, ransac};
pub use refine::{RefineOptions, Refinement, WeightedCorrespondence, refine, refine_weighted};
pub use sqpnp::{AlgebraicMinimum, sqpnp};

/// An object point and the pixel it was seen at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Pixels; pixel centres lie at integer coordinates.
    pub point_in_image: Point2,
    /// Metres, in the object's frame.
    pub point_in_object: Point3,
}

/// Sum of the magnitudes of all numbers beyond which squares and products of them might overflow.
const LARGEST: f64 = 1e100;

/// Why there is no pose.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PnpError {
    /// Fewer correspondences than the solver can work with.
    #[error("{given} correspondences given, at least {needed} needed")]
    TooFewPoints {
        /// How many the solver needs.
        needed: usize,
        /// How many it got.
        given: usize,
    },
    /// A coordinate, a camera parameter or the start is NaN, infinite or beyond 1e100, or a focal length is zero.
    #[error("a coordinate or a camera parameter is not a finite number")]
    NotFinite,
    /// The points lie on a line or on one spot, in space or in the image: infinitely many poses fit.
    #[error("the points lie on a line or on one spot, so that they do not determine a pose")]
    Degenerate,
    /// Every pose found has points that are not in front of the camera.
    #[error("no pose with all points in front of the camera")]
    BehindCamera,
    /// A covariance that is not symmetric and positive definite, or a scale that is not positive.
    #[error("a covariance or a scale is not positive")]
    NotPositive,
}

/// The pixels by which each point misses: projection less measurement. A point behind the camera is an error.
pub fn residuals(
    correspondences: &[Correspondence],
    camera: &Camera,
    camera_from_object: &Pose,
) -> Result<Vec<nalgebra::Vector2<f64>>, PnpError> {
    correspondences.iter().map(|c| residual(c, camera, camera_from_object)).collect()
}

/// Root of the mean squared distance between projections and measurements, pixels.
///
/// A point behind the camera is an error: its projection can look perfect.
pub fn reprojection_rmse(
    correspondences: &[Correspondence],
    camera: &Camera,
    camera_from_object: &Pose,
) -> Result<f64, PnpError> {
    if correspondences.is_empty() {
        return Err(PnpError::TooFewPoints { needed: 1, given: 0 });
    }
    let mut sum = 0.0;
    for correspondence in correspondences {
        sum += residual(correspondence, camera, camera_from_object)?.norm_squared();
    }
    Ok((sum / correspondences.len() as f64).sqrt())
}

fn residual(
    correspondence: &Correspondence,
    camera: &Camera,
    camera_from_object: &Pose,
) -> Result<nalgebra::Vector2<f64>, PnpError> {
    let point_in_camera = camera_from_object * correspondence.point_in_object;
    let pixel = camera.project(&point_in_camera).ok_or(PnpError::BehindCamera)?;
    let residual = pixel - correspondence.point_in_image;
    if residual.iter().all(|value| value.is_finite()) {
        Ok(residual)
    } else {
        Err(PnpError::NotFinite)
    }
}

/// Refuses fewer than `needed` correspondences and everything that is not finite.
fn check(
    correspondences: &[Correspondence],
    camera: &Camera,
    needed: usize,
) -> Result<(), PnpError> {
    if correspondences.len() < needed {
        return Err(PnpError::TooFewPoints { needed, given: correspondences.len() });
    }
    let intrinsics = [camera.focal, camera.principal_point];
    // A NaN or an infinity makes the sum one.
    let mut sum: f64 = intrinsics.iter().flatten().map(|value| value.abs()).sum();
    for c in correspondences {
        sum += c.point_in_image.x.abs() + c.point_in_image.y.abs();
        sum += c.point_in_object.coords.abs().sum();
    }
    let usable = sum < LARGEST && camera.focal.iter().all(|focal| *focal != 0.0);
    if usable { Ok(()) } else { Err(PnpError::NotFinite) }
}

/// The centroid of the object points.
fn centroid(correspondences: &[Correspondence]) -> Vector3 {
    let sum =
        correspondences.iter().fold(Vector3::zeros(), |sum, c| sum + c.point_in_object.coords);
    sum / correspondences.len() as f64
}
