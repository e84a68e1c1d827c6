//! Symmetries of an object as a list of poses.
//!
//! An axis of rotation becomes as many steps as keep the farthest vertex from moving more than a share of the diameter
//! between two of them, as in `get_symmetry_transformations` of the `bop_toolkit`.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Matrix4, Rotation3, Unit};

use crate::geometry::Vector3;

use super::BopPose;

/// The share of the diameter that the benchmark uses.
pub const MAX_STEP: f64 = 0.01;

/// An axis about which the object may turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContinuousSymmetry {
    /// Its direction.
    pub axis: Unit<Vector3>,
    /// A point on it, millimetres.
    pub offset: Vector3,
}

/// All poses that look alike, the identity among them.
pub fn symmetries(discrete: &[Matrix4<f64>], continuous: &[ContinuousSymmetry]) -> Vec<BopPose> {
    let identity = BopPose { rotation: Matrix3::identity(), translation: Vector3::zeros() };
    let fixed = |matrix: &Matrix4<f64>| BopPose {
        rotation: matrix.fixed_view::<3, 3>(0, 0).into_owned(),
        translation: matrix.fixed_view::<3, 1>(0, 3).into_owned(),
    };
    let discrete: Vec<BopPose> =
        std::iter::once(identity).chain(discrete.iter().map(fixed)).collect();
    let steps = (PI / MAX_STEP).ceil() as usize;
    let turn = |(axis, step): (&ContinuousSymmetry, usize)| {
        let angle = step as f64 * TAU / steps as f64;
        let rotation = Rotation3::from_axis_angle(&axis.axis, angle).into_inner();
        BopPose { rotation, translation: axis.offset - rotation * axis.offset }
    };
    let turns: Vec<BopPose> = continuous
        .iter()
        .flat_map(|axis| (0..steps).map(move |step| (axis, step)))
        .map(turn)
        .collect();
    if turns.is_empty() {
        return discrete;
    }
    let both = |(first, then): (&BopPose, &BopPose)| BopPose {
        rotation: then.rotation * first.rotation,
        translation: then.rotation * first.translation + then.translation,
    };
    discrete
        .iter()
        .flat_map(|first| turns.iter().map(move |then| (first, then)))
        .map(both)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_gives_315_steps_that_leave_it_in_place() {
        let offset = Vector3::new(10.0, 20.0, 0.0);
        let axis = ContinuousSymmetry { axis: Vector3::z_axis(), offset };
        let found = symmetries(&[], &[axis]);
        assert_eq!(found.len(), 315);
        for pose in &found {
            assert!((pose.rotation * offset + pose.translation - offset).norm() < 1e-9);
        }
        let mut mirror = Matrix4::identity();
        mirror[(0, 0)] = -1.0;
        mirror[(1, 1)] = -1.0;
        assert_eq!(symmetries(&[mirror], &[]).len(), 2);
        assert_eq!(symmetries(&[mirror], &[axis]).len(), 630);
    }
}
