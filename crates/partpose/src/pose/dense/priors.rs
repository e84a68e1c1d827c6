//! What is known of a vehicle before its mask is seen: it stands upright, on the ground, and has a likely size.

use nalgebra::{Matrix3, SMatrix, SVector};

use crate::detection::DetectedSize;
use crate::geometry::{Extent, Vector3};

use super::jacobian::NormalEquations;
use super::state::{PARAMETERS, State};

/// The vehicle's down axis is that of gravity, give or take `sigma`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityPrior {
    /// Direction of gravity in the camera frame, unit length; `(0, 1, 0)` for a level camera.
    pub down_in_camera: Vector3,
    /// Standard deviation of roll and of pitch, radians.
    pub sigma: f64,
}

/// The centre of the vehicle's bottom face lies on a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPrior {
    /// The plane's normal in the camera frame, unit length, pointing down.
    pub normal_in_camera: Vector3,
    /// Distance of the plane from the camera along the normal: the camera's height above the road, metres.
    pub offset: f64,
    /// Standard deviation of the bottom's height above the plane, metres.
    pub sigma: f64,
}

/// A Gaussian on the logarithms of width, height and length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizePrior {
    /// The likely size; `None` for each model's own.
    pub mean: Option<Extent>,
    /// Covariance of the logarithms.
    pub covariance: Matrix3<f64>,
}

impl SizePrior {
    /// Spread of the scale that width, height and length share.
    const SCALE: f64 = 0.04;
    /// Spread of each of them besides.
    const SHAPE: [f64; 3] = [0.05, 0.05, 0.08];

    /// Around a size, or each model's own, with a spread of 4 % in scale, 5 % more in width and height and 8 % in length.
    ///
    /// That is how much the 89 cars of four meshes differ in world 0001 of Virtual KITTI.
    pub fn around(mean: Option<Extent>) -> Self {
        let shared = Matrix3::repeat(Self::SCALE * Self::SCALE);
        let own = Matrix3::from_diagonal(&Vector3::from(Self::SHAPE).map(|sigma| sigma * sigma));
        Self { mean, covariance: shared + own }
    }
}

/// What the dense fit knows beforehand besides sizes; nothing by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DensePriors {
    /// Which way is down.
    pub gravity: Option<GravityPrior>,
    /// Where the ground is.
    pub ground: Option<GroundPrior>,
}

impl DensePriors {
    /// Those that can be used: with finite numbers, normals of a length and positive deviations.
    pub(super) fn usable(&self) -> Self {
        let unit = |v: &Vector3| v.try_normalize(1e-9).filter(|v| v.iter().all(|x| x.is_finite()));
        let positive = |sigma: f64| sigma > 0.0 && sigma.is_finite();
        let gravity = self.gravity.filter(|prior| positive(prior.sigma)).and_then(|prior| {
            Some(GravityPrior { down_in_camera: unit(&prior.down_in_camera)?, ..prior })
        });
        let ground = self
            .ground
            .filter(|prior| positive(prior.sigma) && prior.offset.is_finite())
            .and_then(|prior| {
                Some(GroundPrior { normal_in_camera: unit(&prior.normal_in_camera)?, ..prior })
            });
        Self { gravity, ground }
    }
}

/// Deviation of roll and pitch from the camera's own that is believed where no gravity is given: vehicles and the
/// camera stand on roads. Wide enough not to matter where the mask says anything of them.
const UPRIGHT: f64 = 0.15;

/// How much more sizes count than other priors. What a mask says of a length seen at a slant is read off a few seams and
/// outlines, which lie off along their whole length: their cells are no independent witnesses, and with weight 1 they
/// stretched cars of 3.7 m to 6.5 m. Found on world 0001 (`docs/dense-fit.md`). Where the size is free the ground counts
/// as much, since the two settle the distance between them.
const SIZE_WEIGHT: f64 = 10.0;

/// The size prior of one model, ready to use.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizeTerm {
    mean: Vector3,
    information: Matrix3<f64>,
    /// The squared length of what the detector sees against what is likely of the model.
    conflict: f64,
}

/// Least standard deviation of a side's logarithm that is believed of a detector.
const LEAST_SIGMA: f64 = 1e-3;

impl SizeTerm {
    /// What is likely of a model, and what a detector sees of the vehicle: the product of two Gaussians.
    ///
    /// `None` where the prior is none; what is seen is left out where it makes no sense.
    pub(super) fn new(
        prior: &SizePrior,
        model: &Extent,
        seen: Option<&DetectedSize>,
    ) -> Option<Self> {
        let logarithms = |extent: &Extent| {
            let half = (extent.to_vector() * 0.5).map(f64::ln);
            half.iter().all(|value| value.is_finite()).then_some(half)
        };
        let mean = logarithms(&prior.mean.unwrap_or(*model))?;
        let information = prior.covariance.cholesky()?.inverse();
        if !information.iter().all(|value| value.is_finite()) {
            return None;
        }
        let likely = Self { mean, information, conflict: 0.0 };
        let seen = seen.filter(|seen| seen.sigma.iter().all(|sigma| sigma.is_finite()));
        Some(seen.and_then(|seen| likely.and(logarithms(&seen.extent)?, seen)).unwrap_or(likely))
    }

    fn and(&self, mean: Vector3, seen: &DetectedSize) -> Option<Self> {
        let sigma = Vector3::from(seen.sigma).map(|sigma| sigma.max(LEAST_SIGMA));
        let weight = sigma.map(|sigma| sigma.powi(-2));
        let information = self.information + Matrix3::from_diagonal(&weight);
        let sum = self.information * self.mean + weight.component_mul(&mean);
        let away = mean - self.mean;
        let spread = self.covariance()? + Matrix3::from_diagonal(&sigma.map(|s| s * s));
        let conflict = away.dot(&spread.cholesky()?.solve(&away));
        Some(Self { mean: information.cholesky()?.solve(&sum), information, conflict })
    }

    /// The likeliest half-sides.
    pub(super) fn half(&self) -> Vector3 {
        self.mean.map(f64::exp)
    }

    /// Covariance of the logarithms.
    pub(super) fn covariance(&self) -> Option<Matrix3<f64>> {
        self.information.try_inverse()
    }
}

/// All priors of one model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Terms {
    pub(super) priors: DensePriors,
    /// `None` where the size is fixed.
    pub(super) size: Option<SizeTerm>,
    /// Variance of the data: priors count `noise` times as much against it.
    pub(super) noise: f64,
}

/// A whitened residual and its derivatives.
struct Term {
    residual: f64,
    by: SVector<f64, PARAMETERS>,
}

impl Terms {
    /// How many increments are free.
    pub(super) fn count(&self) -> usize {
        if self.size.is_some() { PARAMETERS } else { 6 }
    }

    /// Which way is down in the camera frame.
    pub(super) fn down(&self) -> Vector3 {
        self.priors.gravity.map_or(Vector3::y(), |prior| prior.down_in_camera)
    }

    /// Half the sum of squares, in units of the data term.
    pub(super) fn energy(&self, state: &State) -> f64 {
        let squares: f64 = self.upright(state).iter().map(|t| t.residual * t.residual).sum();
        let ground = self.ground(state).map_or(0.0, |t| t.residual * t.residual);
        let size = self.size.map_or(0.0, |size| {
            let away = state.half.map(f64::ln) - size.mean;
            away.dot(&(size.information * away)) + size.conflict
        });
        0.5 * self.noise * (squares + self.ground_weight() * ground + SIZE_WEIGHT * size)
    }

    /// The largest difference of a side from the likely size, in standard deviations; 0 where the size is fixed.
    pub(super) fn size_deviation(&self, state: &State) -> f64 {
        self.size.map_or(0.0, |size| {
            let away = state.half.map(f64::ln) - size.mean;
            let covariance = size.information.try_inverse().unwrap_or_default();
            (0..3).map(|i| away[i].abs() / covariance[(i, i)].sqrt()).fold(0.0, f64::max)
        })
    }

    /// How far the bottom lies off the ground, in standard deviations; 0 where none is given.
    pub(super) fn ground_deviation(&self, state: &State) -> f64 {
        self.ground(state).map_or(0.0, |term| term.residual.abs())
    }

    fn ground_weight(&self) -> f64 {
        if self.size.is_some() { SIZE_WEIGHT } else { 1.0 }
    }

    /// How much the gradient of the priors varies if what they believe has the spread that they state.
    pub(super) fn spread(&self, state: &State) -> SMatrix<f64, PARAMETERS, PARAMETERS> {
        let mut spread = SMatrix::zeros();
        let mut add = |term: &Term, weight: f64| {
            spread += term.by * term.by.transpose() * (weight * self.noise).powi(2);
        };
        self.upright(state).iter().for_each(|term| add(term, 1.0));
        self.ground(state).iter().for_each(|term| add(term, self.ground_weight()));
        if let Some(size) = &self.size {
            let mut block = spread.fixed_view_mut::<3, 3>(6, 6);
            block += size.information * (SIZE_WEIGHT * self.noise).powi(2);
        }
        spread
    }

    /// Adds derivatives, in units of the data term.
    pub(super) fn add(&self, state: &State, equations: &mut NormalEquations) {
        let noise = self.noise;
        let mut add = |term: &Term, weight: f64| {
            equations.hessian += term.by * term.by.transpose() * (weight * noise);
            equations.gradient += term.by * (term.residual * weight * noise);
        };
        self.upright(state).iter().for_each(|term| add(term, 1.0));
        self.ground(state).iter().for_each(|term| add(term, self.ground_weight()));
        if let Some(size) = &self.size {
            let noise = noise * SIZE_WEIGHT;
            let slope = size.information * (state.half.map(f64::ln) - size.mean);
            let mut hessian = SMatrix::<f64, PARAMETERS, PARAMETERS>::zeros();
            hessian.fixed_view_mut::<3, 3>(6, 6).copy_from(&(size.information * noise));
            equations.hessian += hessian;
            for i in 0..3 {
                equations.gradient[6 + i] += noise * slope[i];
            }
        }
    }

    fn upright(&self, state: &State) -> [Term; 2] {
        let (down, sigma) = match &self.priors.gravity {
            Some(prior) => (prior.down_in_camera, prior.sigma),
            None => (Vector3::y(), UPRIGHT),
        };
        let own = state.rotation * Vector3::y();
        across(&down).map(|axis| {
            // axis . (omega x own) = omega . (own x axis)
            let turn = own.cross(&axis) / sigma;
            let mut by = SVector::<f64, PARAMETERS>::zeros();
            by.fixed_rows_mut::<3>(0).copy_from(&turn);
            Term { residual: axis.dot(&own) / sigma, by }
        })
    }

    fn ground(&self, state: &State) -> Option<Term> {
        let prior = self.priors.ground?;
        let normal = prior.normal_in_camera;
        let arm = state.rotation * Vector3::new(0.0, state.half.y, 0.0);
        let mut by = SVector::<f64, PARAMETERS>::zeros();
        by.fixed_rows_mut::<3>(0).copy_from(&arm.cross(&normal));
        by[3] = normal.x;
        by[4] = normal.y;
        by[5] = normal.dot(&state.center);
        if self.size.is_some() {
            by[7] = normal.dot(&arm);
        }
        let residual = (normal.dot(&(state.center + arm)) - prior.offset) / prior.sigma;
        Some(Term { residual, by: by / prior.sigma })
    }
}

/// Two unit vectors orthogonal to a unit vector and to each other.
pub(in crate::pose) fn across(axis: &Vector3) -> [Vector3; 2] {
    let helper = if axis.x.abs() < 0.5 { Vector3::x() } else { Vector3::z() };
    let a = (helper - axis * axis.dot(&helper)).normalize();
    [a, axis.cross(&a)]
}
