//! Properties of the `PnP` solvers on made-up problems.

use partpose::{
    geometry::{Camera, Point2, Point3, Pose},
    pnp::{
        Correspondence, PnpError, RansacOptions, RefineOptions, epnp, p3p, ransac, refine,
        reprojection_rmse, solve, sqpnp,
        synthetic::{SyntheticOptions, SyntheticProblem, synthetic_problem},
    },
};
use proptest::prelude::*;

/// Without noise a pose comes back to rounding, magnified by a squared condition number of about 1e8.
const EXACT: f64 = 1e-5;

fn problem(seed: u64, points: usize, flat: bool) -> SyntheticProblem {
    let mut options = SyntheticOptions { points, ..SyntheticOptions::default() };
    if flat {
        options.half_extent[2] = 0.0;
    }
    synthetic_problem(seed, &options)
}

/// Largest of the rotation error in radians and the relative translation error.
fn error(pose: &Pose, truth: &Pose) -> f64 {
    let t = truth.translation.vector;
    pose.rotation.angle_to(&truth.rotation).max((pose.translation.vector - t).norm() / t.norm())
}

proptest! {
    #[test]
    fn epnp_recovers_any_pose(seed: u64, points in 6..40usize) {
        let p = problem(seed, points, false);
        let pose = epnp(&p.correspondences, &p.camera).unwrap();
        prop_assert!(error(&pose, &p.camera_from_object) < EXACT);
    }

    #[test]
    fn epnp_recovers_the_pose_of_flat_points(seed: u64, points in 5..20usize) {
        let p = problem(seed, points, true);
        let pose = epnp(&p.correspondences, &p.camera).unwrap();
        prop_assert!(error(&pose, &p.camera_from_object) < EXACT);
    }

    #[test]
    fn sqpnp_finds_the_pose_among_its_minima(seed: u64, points in 4..40usize, flat: bool) {
        let p = problem(seed, points, flat);
        let minima = sqpnp(&p.correspondences, &p.camera).unwrap();
        let nearest = minima.iter().map(|m| error(&m.pose, &p.camera_from_object)).fold(9.0, f64::min);
        prop_assert!(nearest < EXACT, "{nearest}");
    }

    #[test]
    fn p3p_finds_the_pose(seed: u64) {
        let p = problem(seed, 3, false);
        let three = [p.correspondences[0], p.correspondences[1], p.correspondences[2]];
        let poses = p3p(&three, &p.camera).unwrap();
        let nearest = poses.iter().map(|pose| error(pose, &p.camera_from_object)).fold(9.0, f64::min);
        prop_assert!(nearest < 1e-4, "{nearest}");
        for pose in &poses {
            prop_assert!(reprojection_rmse(&three, &p.camera, pose).unwrap() < 1e-4);
        }
    }
}
