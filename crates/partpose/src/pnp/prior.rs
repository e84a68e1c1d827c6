//! What is known of a pose before a point is seen: the object stands on the ground.

use nalgebra::{Matrix3, Vector3};

use crate::geometry::{Point3, Pose};

/// The object's up axis is opposite to gravity, give or take `sigma`.
///
/// Blind to an object upside down; the start decides that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TiltPrior {
    /// Up axis in the object's frame, unit length.
    pub up_in_object: Vector3<f64>,
    /// Direction of gravity in the camera frame, unit length; `(0, 1, 0)` for a level camera.
    pub down_in_camera: Vector3<f64>,
    /// Standard deviation of roll and of pitch, radians.
    pub sigma: f64,
}

/// A point of the object lies at a known height below the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightPrior {
    /// The point in the object's frame, metres: the centre of the bottom face for contact with the ground.
    pub point_in_object: Point3,
    /// Direction of gravity in the camera frame, unit length.
    pub down_in_camera: Vector3<f64>,
    /// How far below the camera the point lies, metres.
    pub below_camera: f64,
    /// Standard deviation, metres.
    pub sigma: f64,
}

/// Independent Gaussian priors; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Priors {
    /// Roll and pitch.
    pub tilt: Option<TiltPrior>,
    /// Height below the camera.
    pub height: Option<HeightPrior>,
}

/// A whitened residual and its derivatives by a rotation vector in camera axes, turning about the object's origin, and
/// by the translation.
pub(super) struct PriorTerm {
    pub(super) residual: f64,
    pub(super) by_rotation: Vector3<f64>,
    pub(super) by_translation: Vector3<f64>,
}

impl Priors {
    /// At most three terms.
    pub(super) fn terms(
        &self,
        rotation: &Matrix3<f64>,
        translation: &Vector3<f64>,
    ) -> [Option<PriorTerm>; 3] {
        let mut terms = [None, None, None];
        if let Some(prior) = &self.tilt {
            let up = rotation * prior.up_in_object;
            let (a, b) = across(&prior.down_in_camera);
            for (slot, axis) in terms.iter_mut().zip([a, b]) {
                *slot = Some(PriorTerm {
                    residual: axis.dot(&up) / prior.sigma,
                    // axis . (omega x up) = omega . (up x axis)
                    by_rotation: up.cross(&axis) / prior.sigma,
                    by_translation: Vector3::zeros(),
                });
            }
        }
        if let Some(prior) = &self.height {
            let arm = rotation * prior.point_in_object.coords;
            let down = prior.down_in_camera;
            terms[2] = Some(PriorTerm {
                residual: (down.dot(&(arm + translation)) - prior.below_camera) / prior.sigma,
                by_rotation: arm.cross(&down) / prior.sigma,
                by_translation: down / prior.sigma,
            });
        }
        terms
    }

    /// Whether all numbers are finite and the standard deviations positive.
    pub(super) fn is_valid(&self) -> bool {
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        let positive = |sigma: f64| sigma > 0.0 && sigma.is_finite();
        let tilt = self.tilt.as_ref().is_none_or(|p| {
            positive(p.sigma) && finite(&p.up_in_object) && finite(&p.down_in_camera)
        });
        let height = self.height.as_ref().is_none_or(|p| {
            let point = finite(&p.point_in_object.coords) && finite(&p.down_in_camera);
            positive(p.sigma) && point && p.below_camera.is_finite()
        });
        tilt && height
    }

    /// The sum of squares at a pose.
    pub fn cost(&self, camera_from_object: &Pose) -> f64 {
        let rotation = camera_from_object.rotation.to_rotation_matrix();
        let terms = self.terms(rotation.matrix(), &camera_from_object.translation.vector);
        terms.iter().flatten().map(|term| term.residual * term.residual).sum()
    }
}

/// Two unit vectors orthogonal to a unit vector and to each other.
fn across(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let helper = if axis.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
    let a = (helper - axis * axis.dot(&helper)).normalize();
    (a, axis.cross(&a))
}
