//! The Euler angles of the data sets and of the paper's tables.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::Rotation3;

/// Angles about the camera's axes with `R = R_y(y) R_x(x) R_z(z)`, radians.
///
/// The order is that of Virtual KITTI, where a vehicle's yaw is `y`: its `ry` plus a quarter turn, since `ry = 0`
/// faces right while our vehicles face along z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EulerAngles {
    /// Pitch, about the axis that points right.
    pub x: f64,
    /// Yaw, about the axis that points down.
    pub y: f64,
    /// Roll, about the viewing axis.
    pub z: f64,
}

impl EulerAngles {
    /// The angles of a rotation; at |x| = 90 degrees, where they are not unique, z is 0.
    pub fn from_rotation(rotation: &Rotation3) -> Self {
        let m = rotation.matrix();
        let sin_x = (-m[(1, 2)]).clamp(-1.0, 1.0);
        let x = sin_x.asin();
        if sin_x.abs() > 1.0 - 1e-12 {
            return Self { x, y: (-m[(2, 0)]).atan2(m[(0, 0)]), z: 0.0 };
        }
        Self { x, y: m[(0, 2)].atan2(m[(2, 2)]), z: m[(1, 0)].atan2(m[(1, 1)]) }
    }

    /// The rotation with these angles.
    pub fn to_rotation(self) -> Rotation3 {
        use nalgebra::Vector3;
        Rotation3::from_axis_angle(&Vector3::y_axis(), self.y)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), self.x)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), self.z)
    }
}

/// The same angle in (-pi, pi].
pub fn wrap_angle(angle: f64) -> f64 {
    let wrapped = (angle + PI).rem_euclid(TAU) - PI;
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angles_survive_a_round_trip(x in -1.5..1.5f64, y in -3.1..3.1f64, z in -3.1..3.1f64) {
            let back = EulerAngles::from_rotation(&EulerAngles { x, y, z }.to_rotation());
            prop_assert!((back.x - x).abs() + (back.y - y).abs() + (back.z - z).abs() < 1e-9);
        }

        #[test]
        fn wrapped_angle_lies_in_the_half_open_turn(angle in -50.0..50.0f64) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped > -PI && wrapped <= PI);
            prop_assert!((wrapped.sin() - angle.sin()).abs() < 1e-9);
        }
    }

    #[test]
    fn straight_down_still_gives_the_rotation_back() {
        let rotation = EulerAngles { x: PI / 2.0, y: 0.4, z: 0.3 }.to_rotation();
        let back = EulerAngles::from_rotation(&rotation).to_rotation();
        assert!(rotation.angle_to(&back) < 1e-6);
    }
}
