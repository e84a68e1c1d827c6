//! Properties of the `PnP` solvers on made-up problems.

use partpose::{
    geometry::{Camera, Point2, Point3, Pose},
    pnp::{
        Correspondence, HeightPrior, PnpError, Priors, RansacOptions, RefineOptions, TiltPrior,
        WeightedCorrespondence, epnp, p3p, ransac, refine, refine_weighted, reprojection_rmse,
        solve, sqpnp,
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

proptest! {
    #[test]
    fn refinement_returns_to_the_truth(seed: u64, points in 6..40usize) {
        let p = problem(seed, points, false);
        let turn = nalgebra::UnitQuaternion::from_euler_angles(0.05, -0.1, 0.07);
        let truth = p.camera_from_object;
        let start = Pose::from_parts((truth.translation.vector * 1.05).into(), turn * truth.rotation);
        let refined = refine(&p.correspondences, &p.camera, &start, &RefineOptions::default()).unwrap();
        prop_assert!(refined.converged);
        prop_assert!(error(&refined.pose, &truth) < 1e-6);
    }

    #[test]
    fn ransac_ignores_outliers(seed: u64, points in 12..30usize) {
        let options = SyntheticOptions { points, sigma: 0.3, outliers: points / 5, ..Default::default() };
        let p = synthetic_problem(seed, &options);
        let found = ransac(&p.correspondences, &p.camera, &RansacOptions::default()).unwrap();
        let true_inliers = points - points / 5;
        prop_assert!(found.inliers[..true_inliers].iter().all(|inlier| *inlier));
    }

    #[test]
    fn same_seed_gives_the_same_ransac(seed: u64) {
        let options = SyntheticOptions { points: 20, sigma: 1.0, outliers: 4, ..Default::default() };
        let p = synthetic_problem(seed, &options);
        let run = || ransac(&p.correspondences, &p.camera, &RansacOptions::default()).unwrap();
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn probabilities_sum_to_one_and_the_cheaper_mode_comes_first(seed: u64, points in 4..12usize) {
        let mut options = SyntheticOptions { points, sigma: 1.0, ..Default::default() };
        options.half_extent[2] = 0.02;
        let p = synthetic_problem(seed, &options);
        let Ok(solution) = solve(&p.correspondences, &p.camera, &RefineOptions::default()) else {
            return Ok(());
        };
        let mut sum = solution.best.probability;
        if let Some(second) = solution.second {
            sum += second.probability;
            prop_assert!(solution.best.refinement.cost <= second.refinement.cost);
        }
        prop_assert!((sum - 1.0).abs() < 1e-12);
    }

    #[test]
    fn nothing_panics_or_returns_nan_on_arbitrary_input(points in absurd_points(), seed: u64) {
        check_all_solvers(&points, &synthetic_problem(seed, &SyntheticOptions::default()).camera_from_object);
    }
}

/// A number of any magnitude, often one that repeats.
fn absurd_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        3 => -3.0..3.0f64,
        1 => Just(0.0),
        1 => Just(1.0),
        1 => (-300.0..300.0f64, any::<bool>())
            .prop_map(|(power, sign)| if sign { 10f64.powf(power) } else { -10f64.powf(power) }),
    ]
}

/// Scattered, coincident, collinear or flat points of any scale, with pixels that have nothing to do with them.
fn absurd_points() -> impl Strategy<Value = Vec<Correspondence>> {
    let numbers = proptest::collection::vec([(); 5].map(|()| absurd_number()), 0..12);
    (numbers, 0..6u8, -150.0..150.0f64).prop_map(|(rows, kind, power)| {
        let scale = if kind == 5 { 10f64.powf(power) } else { 1.0 };
        let first = rows.first().copied().unwrap_or([0.0; 5]);
        rows.iter()
            .map(|&[u, v, x, y, z]| {
                let point = match kind {
                    1 => [first[2], first[3], first[4]],
                    2 => [x, 2.0 * x, -x],
                    3 => [x, y, 0.0],
                    _ => [x, y, z],
                };
                let pixel = if kind == 4 { [first[0], first[1]] } else { [u * 300.0, v * 300.0] };
                Correspondence {
                    point_in_image: Point2::new(pixel[0], pixel[1]),
                    point_in_object: Point3::from(point.map(|value| value * scale)),
                }
            })
            .collect()
    })
}

/// Every solver either fails with a reason or gives a finite pose with all points in front, where it promises that.
fn check_all_solvers(points: &[Correspondence], start: &Pose) {
    let camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
    let finite = |pose: &Pose| {
        assert!(pose.translation.vector.iter().all(|value| value.is_finite()), "{points:?}");
        assert!((pose.rotation.norm() - 1.0).abs() < 1e-9, "{points:?}");
    };
    let in_front = |pose: &Pose| points.iter().all(|c| (pose * c.point_in_object).z > 0.0);
    if let Ok(pose) = epnp(points, &camera) {
        finite(&pose);
        assert!(in_front(&pose));
    }
    if let Ok(minima) = sqpnp(points, &camera) {
        assert!(!minima.is_empty());
        for minimum in minima {
            finite(&minimum.pose);
            assert!(minimum.error.is_finite());
            assert!(in_front(&minimum.pose));
        }
    }
    if let [a, b, c, ..] = *points
        && let Ok(poses) = p3p(&[a, b, c], &camera)
    {
        poses.iter().for_each(finite);
    }
    if let Ok(refined) = refine(points, &camera, start, &RefineOptions::default()) {
        finite(&refined.pose);
        assert!(refined.cost.is_finite());
        assert!(refined.covariance.iter().all(|value| !value.is_nan()));
    }
    if let Ok(solution) = solve(points, &camera, &RefineOptions::default()) {
        finite(&solution.best.refinement.pose);
        assert!(!solution.best.probability.is_nan());
    }
    if let Ok(found) = ransac(points, &camera, &RansacOptions::default()) {
        finite(&found.refinement.pose);
    }
}

#[test]
fn epnp_keeps_all_points_in_front_when_the_null_vector_flips() {
    // The same problem mirrored through the image centre flips the sign of every null vector's depth.
    for seed in 0..200 {
        let options = SyntheticOptions { points: 8, sigma: 1.0, ..Default::default() };
        let p = synthetic_problem(seed, &options);
        let pose = epnp(&p.correspondences, &p.camera).unwrap();
        assert!(p.correspondences.iter().all(|c| (pose * c.point_in_object).z > 0.0));
        let det = pose.rotation.to_rotation_matrix().matrix().determinant();
        assert!((det - 1.0).abs() < 1e-9);
    }
}

#[test]
fn epnp_solves_a_chessboard_seen_head_on() {
    // A fronto-parallel grid: equal spreads, a null vector without depth differences, divisions by small betas.
    let camera = Camera::pinhole(500.0, [320.0, 240.0], [640, 480]);
    let truth = Pose::translation(0.05, -0.02, 1.0);
    let points: Vec<Correspondence> = (0..25)
        .map(|i| {
            let point_in_object =
                Point3::new(f64::from(i % 5) * 0.03 - 0.06, f64::from(i / 5) * 0.03 - 0.06, 0.0);
            let point_in_image = camera.project(&(truth * point_in_object)).unwrap();
            Correspondence { point_in_image, point_in_object }
        })
        .collect();
    assert!(error(&epnp(&points, &camera).unwrap(), &truth) < EXACT);
    assert!(error(&sqpnp(&points, &camera).unwrap()[0].pose, &truth) < EXACT);
}

#[test]
fn both_poses_of_a_tilted_rear_are_returned() {
    let mut options = SyntheticOptions { points: 8, sigma: 1.0, ..Default::default() };
    options.half_extent[2] = 0.02;
    options.distance = [25.0, 40.0];
    let (mut two, mut truth_among_them) = (0, 0);
    for seed in 0..100 {
        let p = synthetic_problem(seed, &options);
        let Ok(solution) = solve(&p.correspondences, &p.camera, &RefineOptions::default()) else {
            continue;
        };
        two += usize::from(solution.second.is_some());
        let modes = [Some(solution.best), solution.second];
        let near = |pose: &Pose| pose.rotation.angle_to(&p.camera_from_object.rotation) < 0.6;
        truth_among_them +=
            usize::from(modes.iter().flatten().any(|mode| near(&mode.refinement.pose)));
    }
    assert!(two > 60, "{two}");
    assert!(truth_among_them > 80, "{truth_among_them}");
}

#[test]
fn bad_input_is_refused_with_its_reason() {
    let p = problem(1, 8, false);
    let few = &p.correspondences[..3];
    assert_eq!(epnp(few, &p.camera), Err(PnpError::TooFewPoints { needed: 4, given: 3 }));
    let mut broken = p.correspondences.clone();
    broken[2].point_in_image.x = f64::NAN;
    assert_eq!(epnp(&broken, &p.camera), Err(PnpError::NotFinite));
    let no_focal = Camera { focal: [0.0, 700.0], ..p.camera };
    assert_eq!(sqpnp(&p.correspondences, &no_focal), Err(PnpError::NotFinite));
    let line: Vec<_> = (0..8)
        .map(|i| Correspondence {
            point_in_object: Point3::new(f64::from(i), 2.0 * f64::from(i), 0.0),
            ..p.correspondences[0]
        })
        .collect();
    assert_eq!(epnp(&line, &p.camera), Err(PnpError::Degenerate));
    let behind = Pose::translation(0.0, 0.0, -20.0);
    assert_eq!(
        reprojection_rmse(&p.correspondences, &p.camera, &behind),
        Err(PnpError::BehindCamera)
    );
}

#[test]
fn sqpnp_finds_the_exact_pose_after_a_descent_that_ran_out_of_steps() {
    let p = problem(14_662_815_187_039_381_954, 17, false);
    let minima = sqpnp(&p.correspondences, &p.camera).unwrap();
    assert!(error(&minima[0].pose, &p.camera_from_object) < EXACT);
}

#[test]
fn covariance_tells_the_true_spread() {
    // e' C^-1 e of the error (w, dt) has the median 5.35 of a chi-square with 6 degrees of freedom.
    let mut squares = Vec::new();
    for seed in 0..600 {
        let options = SyntheticOptions { points: 12, sigma: 0.7, ..Default::default() };
        let p = synthetic_problem(seed, &options);
        let options = RefineOptions { sigma: 0.7, ..Default::default() };
        let truth = p.camera_from_object;
        let refined = refine(&p.correspondences, &p.camera, &truth, &options).unwrap();
        let turn = (truth.rotation * refined.pose.rotation.inverse()).scaled_axis();
        let shift = truth.translation.vector - refined.pose.translation.vector;
        let error = nalgebra::Vector6::new(turn.x, turn.y, turn.z, shift.x, shift.y, shift.z);
        let solved = refined.covariance.lu().solve(&error).unwrap();
        squares.push(error.dot(&solved));
    }
    squares.sort_by(f64::total_cmp);
    let median = squares[squares.len() / 2];
    // Its standard deviation over 600 trials is about 0.17.
    assert!((4.8..6.0).contains(&median), "{median}");
}

#[test]
fn equal_covariances_refine_like_one_sigma() {
    let options = SyntheticOptions { points: 9, sigma: 2.0, ..Default::default() };
    let p = synthetic_problem(7, &options);
    let weighted: Vec<_> = p
        .correspondences
        .iter()
        .map(|c| WeightedCorrespondence {
            correspondence: *c,
            covariance: nalgebra::Matrix2::from_diagonal_element(4.0),
        })
        .collect();
    let options = RefineOptions { sigma: 2.0, ..Default::default() };
    let plain = refine(&p.correspondences, &p.camera, &p.camera_from_object, &options).unwrap();
    let weighted = refine_weighted(&weighted, &p.camera, &p.camera_from_object, &options).unwrap();
    assert!(error(&plain.pose, &weighted.pose) < 1e-9);
    assert!((plain.cost - weighted.cost).abs() < 1e-9);
}

#[test]
fn a_point_known_along_one_direction_only_pulls_along_it_only() {
    let p = problem(3, 8, false);
    let mut weighted: Vec<_> = p
        .correspondences
        .iter()
        .map(|c| WeightedCorrespondence {
            correspondence: *c,
            covariance: nalgebra::Matrix2::identity(),
        })
        .collect();
    // The first pixel is off by 50 along (1, 1), the direction in which nothing is known of it.
    weighted[0].correspondence.point_in_image += nalgebra::Vector2::new(50.0, 50.0);
    let (along, across) = (1e8, 1.0);
    let (mean, half) = (0.5 * (along + across), 0.5 * (along - across));
    weighted[0].covariance = nalgebra::Matrix2::new(mean, half, half, mean);
    let options = RefineOptions::default();
    let refined = refine_weighted(&weighted, &p.camera, &p.camera_from_object, &options).unwrap();
    assert!(error(&refined.pose, &p.camera_from_object) < 1e-4);
    weighted[0].covariance = nalgebra::Matrix2::new(1.0, 2.0, 2.0, 1.0);
    let refused = refine_weighted(&weighted, &p.camera, &p.camera_from_object, &options);
    assert_eq!(refused, Err(PnpError::NotPositive));
}

#[test]
fn priors_pull_towards_what_is_known() {
    let (mut with, mut without) = (0.0, 0.0);
    for seed in 0..100 {
        let mut options = SyntheticOptions { points: 6, sigma: 2.0, ..Default::default() };
        options.distance = [20.0, 40.0];
        let p = synthetic_problem(seed, &options);
        let truth = p.camera_from_object;
        let up_in_object = -nalgebra::Vector3::y();
        let priors = Priors {
            // Gravity is chosen such that the prior is true.
            tilt: Some(TiltPrior {
                up_in_object,
                down_in_camera: -(truth.rotation * up_in_object),
                sigma: 0.02,
            }),
            height: Some(HeightPrior {
                point_in_object: Point3::new(0.1, 0.7, -0.2),
                down_in_camera: nalgebra::Vector3::y(),
                below_camera: (truth * Point3::new(0.1, 0.7, -0.2)).y,
                sigma: 0.05,
            }),
        };
        assert!(priors.cost(&truth) < 1e-18);
        let plain = RefineOptions { sigma: 2.0, ..Default::default() };
        let known = RefineOptions { priors, ..plain };
        let angle = |options: &RefineOptions| {
            let refined = refine(&p.correspondences, &p.camera, &truth, options).unwrap();
            assert!(refined.converged);
            refined.pose.rotation.angle_to(&truth.rotation)
        };
        with += angle(&known);
        without += angle(&plain);
    }
    assert!(with < 0.8 * without, "{with} {without}");
}
