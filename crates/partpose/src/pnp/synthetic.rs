//! Made-up problems for tests and benchmarks: a car-sized set of points in front of a camera.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::Correspondence;
use crate::geometry::{Camera, EulerAngles, Point2, Point3, Pose, Vector3};

/// What a made-up problem is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SyntheticOptions {
    /// Number of points.
    pub points: usize,
    /// Standard deviation of the pixel noise.
    pub sigma: f64,
    /// Half extents of the set of points, metres; 0 along an axis makes the set flat.
    pub half_extent: [f64; 3],
    /// Nearest and farthest distance of the object, metres.
    pub distance: [f64; 2],
    /// Number of points, the last ones, that get a pixel from anywhere near the object.
    pub outliers: usize,
}

impl Default for SyntheticOptions {
    fn default() -> Self {
        let half_extent = [0.9, 0.75, 2.25];
        Self { points: 8, sigma: 0.0, half_extent, distance: [6.0, 50.0], outliers: 0 }
    }
}

/// Correspondences and the pose that made them.
#[derive(Clone, Debug, PartialEq)]
pub struct SyntheticProblem {
    /// The camera.
    pub camera: Camera,
    /// The points and their pixels.
    pub correspondences: Vec<Correspondence>,
    /// The true pose.
    pub camera_from_object: Pose,
}

/// A problem that depends on the seed and the options alone.
pub fn synthetic_problem(seed: u64, options: &SyntheticOptions) -> SyntheticProblem {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
    let mut within = |half: f64| if half > 0.0 { random.random_range(-half..half) } else { 0.0 };
    let angles = EulerAngles { x: within(0.2), y: within(std::f64::consts::PI), z: within(0.2) };
    let near = options.distance[0];
    let depth = near + (0.5 + within(0.5)) * (options.distance[1] - near);
    let center = Vector3::new(within(0.6) * depth, 1.0 + within(0.5), depth);
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&angles.to_rotation());
    let camera_from_object = Pose::from_parts(center.into(), rotation);
    let mut correspondences = Vec::with_capacity(options.points);
    for index in 0..options.points {
        let [x, y, z] = options.half_extent.map(&mut within);
        let point_in_object = Point3::new(x, y, z);
        let mut pixel = camera.project_unchecked(&(camera_from_object * point_in_object));
        // The sum of twelve uniform numbers is normal enough.
        let mut normal = || (0..12).map(|_| within(0.5)).sum::<f64>() * options.sigma;
        pixel += nalgebra::Vector2::new(normal(), normal());
        if index + options.outliers >= options.points {
            let reach = camera.focal[0] * 3.0 / depth;
            let middle = camera.project_unchecked(&center.into());
            pixel = Point2::new(middle.x + within(reach), middle.y + within(reach));
        }
        correspondences.push(Correspondence { point_in_image: pixel, point_in_object });
    }
    SyntheticProblem { camera, correspondences, camera_from_object }
}
