//! The road under the vehicles of a frame, from their own fits.
//!
//! A mask tells a vehicle's direction and shape, not its scale: size and distance together are free along the viewing
//! ray (`docs/dense-fit.md`). All vehicles of a frame stand on one plane, though. With b the centre of a bottom face at
//! the likely size, `n . b = H` holds up to the size's own spread, and the fitted down axes say what n is. Few numbers
//! (two of the normal, one of the height) are found from all vehicles by robust least squares; the plane then says what
//! each one's scale is.

use nalgebra::{Matrix3, Vector3 as Column};

use crate::geometry::{Point3, Vector3};

use super::dense::{GravityPrior, GroundPrior, across};

/// What is known of the road and the camera above it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundOptions {
    /// Height of the camera above the road in metres and its standard deviation as a share of it; without it sizes alone
    /// tell the scale.
    pub camera_height: Option<[f64; 2]>,
    /// Standard deviation of the logarithm of a vehicle's likely size.
    pub size_sigma: f64,
    /// Standard deviation of a fitted vehicle's roll and pitch, radians.
    pub tilt_sigma: f64,
    /// Standard deviation of the road's direction where no gravity is given: against the camera's own down axis, radians.
    pub level_sigma: f64,
    /// Standard deviation of a vehicle's bottom above the road, metres.
    pub contact_sigma: f64,
}

impl Default for GroundOptions {
    /// Sizes as in [`super::dense::SizePrior::around`]; the others chosen, not fitted.
    fn default() -> Self {
        Self {
            camera_height: None,
            size_sigma: 0.05,
            tilt_sigma: 0.015,
            level_sigma: 0.05,
            contact_sigma: 0.03,
        }
    }
}

/// One vehicle as the plane sees it, camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footing {
    /// Centre of the bottom face, metres.
    pub bottom: Point3,
    /// The vehicle's down axis, unit length.
    pub down: Vector3,
}

/// A plane with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    /// Pointing down, camera frame, unit length.
    pub normal: Vector3,
    /// Distance of the camera from the plane, metres.
    pub height: f64,
    /// Covariance of the normal's two tilts (radians, about [`Self::tilts`]) and the height's logarithm.
    covariance: Matrix3<f64>,
    tilts: [Vector3; 2],
    contact_sigma: f64,
}

/// Rounds of weighting and solving.
const ROUNDS: usize = 12;
/// Residuals beyond this many standard deviations lose weight (Cauchy).
const ROBUST: f64 = 2.0;

impl GroundPlane {
    /// The plane under some vehicles; `None` without any, and without gravity for fewer than two.
    pub fn of(
        footings: &[Footing],
        gravity: Option<&GravityPrior>,
        options: &GroundOptions,
    ) -> Option<Self> {
        let (start, sigma) = match gravity {
            Some(prior) => (prior.down_in_camera.try_normalize(1e-9)?, prior.sigma),
            None => (Vector3::y(), options.level_sigma),
        };
        let least = usize::from(gravity.is_none() || options.camera_height.is_none());
        if footings.len() < least {
            return None;
        }
        let tilts = across(&start);
        let normal = |x: &Column<f64>| (start + tilts[0] * x[0] + tilts[1] * x[1]).normalize();
        let mut heights: Vec<f64> = footings.iter().map(|f| start.dot(&f.bottom.coords)).collect();
        heights.sort_by(f64::total_cmp);
        let likely = options.camera_height.map(|[height, _]| height);
        let first = likely.or_else(|| heights.get(heights.len() / 2).copied())?;
        if !(first > 0.05) {
            return None;
        }
        // Tilts of the normal, and the logarithm of the height.
        let mut x = Column::new(0.0, 0.0, first.ln());
        let mut covariance = Matrix3::identity();
        for _ in 0..ROUNDS {
            let mut information = Matrix3::zeros();
            let mut gradient = Column::zeros();
            let mut add = |row: Column<f64>, residual: f64, robust: bool| {
                let square = (residual / ROBUST).powi(2);
                let weight = if robust { 1.0 / (1.0 + square) } else { 1.0 };
                information += row * row.transpose() * weight;
                gradient += row * (residual * weight);
            };
            for axis in 0..2 {
                let mut row = Column::zeros();
                row[axis] = 1.0 / sigma;
                add(row, x[axis] / sigma, false);
            }
            if let Some([height, share]) = options.camera_height {
                add(Column::z() / share, (x[2] - height.ln()) / share, false);
            }
            let (n, height) = (normal(&x), x[2].exp());
            for footing in footings {
                let b = &footing.bottom.coords;
                let above = n.dot(b) / height;
                let spread = options.size_sigma.hypot(options.contact_sigma / height);
                let by = Column::new(tilts[0].dot(b) / height, tilts[1].dot(b) / height, -above);
                add(by / spread, (above - 1.0) / spread, true);
                for axis in 0..2 {
                    let mut row = Column::zeros();
                    row[axis] = 1.0 / options.tilt_sigma;
                    let away = x[axis] - tilts[axis].dot(&footing.down);
                    add(row, away / options.tilt_sigma, true);
                }
            }
            covariance = information.try_inverse()?;
            x -= covariance * gradient;
        }
        x.iter().all(|value| value.is_finite()).then(|| Self {
            normal: normal(&x),
            height: x[2].exp(),
            covariance,
            tilts,
            contact_sigma: options.contact_sigma,
        })
    }

    /// What the plane says of a vehicle whose bottom is about there: the farther, the less.
    pub fn prior_at(&self, bottom: &Point3) -> GroundPrior {
        let b = &bottom.coords;
        let by = Column::new(self.tilts[0].dot(b), self.tilts[1].dot(b), -self.height);
        let variance = by.dot(&(self.covariance * by)) + self.contact_sigma.powi(2);
        GroundPrior { normal_in_camera: self.normal, offset: self.height, sigma: variance.sqrt() }
    }

    /// The same as a prior on roll and pitch.
    pub fn gravity(&self) -> GravityPrior {
        let sigma = self.covariance[(0, 0)].max(self.covariance[(1, 1)]).sqrt();
        GravityPrior { down_in_camera: self.normal, sigma: sigma.hypot(UPRIGHT) }
    }
}

/// How far vehicles tilt against the road, radians: springs and cambers. Chosen.
const UPRIGHT: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;

    fn footings(normal: &Vector3, height: f64, scales: &[f64]) -> Vec<Footing> {
        let places =
            [(-3.0, 8.0), (2.0, 14.0), (-6.0, 21.0), (4.0, 27.0), (0.5, 35.0), (-8.0, 41.0)];
        let on_plane = |(x, z): (f64, f64)| {
            let y = (height - normal.x * x - normal.z * z) / normal.y;
            Vector3::new(x, y, z)
        };
        let made = places.into_iter().zip(scales.iter().cycle());
        made.map(|(place, scale)| Footing {
            bottom: Point3::from(on_plane(place) * *scale),
            down: *normal,
        })
        .collect()
    }

    #[test]
    fn a_plane_is_found_under_vehicles_of_other_sizes() {
        let normal = Vector3::new(0.02, 1.0, -0.03).normalize();
        let options = GroundOptions { camera_height: Some([1.6, 0.01]), ..Default::default() };
        let footings = footings(&normal, 1.6, &[1.05, 0.96, 1.0, 0.95, 1.04]);
        let plane = GroundPlane::of(&footings, None, &options).unwrap();
        assert!(plane.normal.angle(&normal) < 0.004, "{}", plane.normal);
        assert!((plane.height - 1.6).abs() < 0.02, "{}", plane.height);
        // Farther bottoms are less sure.
        let sigma = |z: f64| plane.prior_at(&Point3::new(0.0, 1.6, z)).sigma;
        assert!(sigma(40.0) > sigma(8.0));
    }

    #[test]
    fn one_wild_vehicle_does_not_move_the_plane() {
        let normal = Vector3::y();
        let gravity = GravityPrior { down_in_camera: normal, sigma: 0.002 };
        let mut all = footings(&normal, 1.5, &[1.0]);
        all[4].bottom *= 2.0;
        let plane = GroundPlane::of(&all, Some(&gravity), &GroundOptions::default()).unwrap();
        assert!((plane.height - 1.5).abs() < 0.04, "{}", plane.height);
        assert!(GroundPlane::of(&[], None, &GroundOptions::default()).is_none());
    }
}
