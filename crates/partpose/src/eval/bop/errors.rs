//! Distances between an object at two poses.

use nalgebra::Matrix3;

use crate::geometry::{Point3, Vector3};

use super::{BopObject, BopPose};

/// Largest distance of a vertex, least over the symmetries, millimetres.
pub fn mssd(estimate: &BopPose, truth: &BopPose, object: &BopObject) -> f64 {
    least(object, truth, |truth| {
        largest(object, |point| (place(estimate, point) - place(truth, point)).norm())
    })
}

/// Largest distance of a vertex in the image, least over the symmetries, pixels.
pub fn mspd(estimate: &BopPose, truth: &BopPose, camera: &Matrix3<f64>, object: &BopObject) -> f64 {
    let project = |pose: &BopPose, point: &Point3| {
        let pixel = camera * place(pose, point);
        nalgebra::Vector2::new(pixel.x / pixel.z, pixel.y / pixel.z)
    };
    least(object, truth, |truth| {
        largest(object, |point| (project(estimate, point) - project(truth, point)).norm())
    })
}

/// Mean distance of the vertices, millimetres.
pub fn add(estimate: &BopPose, truth: &BopPose, points: &[Point3]) -> f64 {
    let distance = |point| (place(estimate, point) - place(truth, point)).norm();
    points.iter().map(distance).sum::<f64>() / points.len().max(1) as f64
}

/// Mean distance of the vertices at the true pose to the nearest one at the estimate, millimetres.
pub fn adi(estimate: &BopPose, truth: &BopPose, points: &[Point3]) -> f64 {
    let mut found: Vec<Vector3> = points.iter().map(|point| place(estimate, point)).collect();
    found.sort_by(|a, b| a.x.total_cmp(&b.x));
    let total: f64 = points.iter().map(|point| nearest(&found, &place(truth, point))).sum();
    total / points.len().max(1) as f64
}

fn place(pose: &BopPose, point: &Point3) -> Vector3 {
    pose.rotation * point.coords + pose.translation
}

/// The least value over all poses that look like the true one.
fn least(object: &BopObject, truth: &BopPose, error: impl Fn(&BopPose) -> f64) -> f64 {
    let alike = |symmetry: &BopPose| BopPose {
        rotation: truth.rotation * symmetry.rotation,
        translation: truth.rotation * symmetry.translation + truth.translation,
    };
    object.symmetries.iter().map(|symmetry| error(&alike(symmetry))).fold(f64::INFINITY, f64::min)
}

/// The largest value over all vertices; infinite where one has none, as a point in the plane of the camera.
fn largest(object: &BopObject, distance: impl Fn(&Point3) -> f64) -> f64 {
    object
        .points
        .iter()
        .map(distance)
        .fold(0.0, |largest, value| if value.is_nan() { f64::INFINITY } else { largest.max(value) })
}

/// Distance to the nearest of points that are sorted by x: to both sides until x alone is too far.
fn nearest(sorted: &[Vector3], point: &Vector3) -> f64 {
    let start = sorted.partition_point(|other| other.x < point.x);
    let mut best = f64::INFINITY;
    for other in &sorted[start..] {
        if other.x - point.x >= best {
            break;
        }
        best = best.min((other - point).norm());
    }
    for other in sorted[..start].iter().rev() {
        if point.x - other.x >= best {
            break;
        }
        best = best.min((other - point).norm());
    }
    best
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;

    fn pose(angle: f64, x: f64) -> BopPose {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), angle).into_inner();
        BopPose { rotation, translation: Vector3::new(x, 0.0, 1000.0) }
    }

    fn object(symmetries: Vec<BopPose>) -> BopObject {
        let points = vec![Point3::new(50.0, 0.0, 0.0), Point3::new(-50.0, 0.0, 0.0)];
        BopObject { diameter: 100.0, points, symmetries }
    }

    fn identity() -> BopPose {
        BopPose { translation: Vector3::zeros(), ..pose(0.0, 0.0) }
    }

    #[test]
    fn half_a_turn_is_nothing_to_an_object_that_looks_the_same_then() {
        let half = BopPose { translation: Vector3::zeros(), ..pose(std::f64::consts::PI, 0.0) };
        let (a, b) = (pose(std::f64::consts::PI, 0.0), pose(0.0, 0.0));
        assert!((mssd(&a, &b, &object(vec![identity()])) - 100.0).abs() < 1e-9);
        let object = object(vec![identity(), half]);
        assert!(mssd(&a, &b, &object) < 1e-9);
        assert!(mspd(&a, &b, &Matrix3::identity(), &object) < 1e-9);
        assert!((add(&a, &b, &object.points) - 100.0).abs() < 1e-9);
        assert!(adi(&a, &b, &object.points) < 1e-9);
    }

    #[test]
    fn a_shift_shows_in_millimetres_and_in_pixels() {
        let camera = Matrix3::new(500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0);
        let object = object(vec![identity()]);
        let (a, b) = (pose(0.0, 20.0), pose(0.0, 0.0));
        assert!((mssd(&a, &b, &object) - 20.0).abs() < 1e-9);
        assert!((mspd(&a, &b, &camera, &object) - 10.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn nearest_is_the_least_of_all_distances(
            points in prop::collection::vec([-9.0..9.0f64, -9.0..9.0, -9.0..9.0], 1..30),
            at in [-9.0..9.0f64, -9.0..9.0, -9.0..9.0],
        ) {
            let mut points: Vec<Vector3> = points.into_iter().map(Vector3::from).collect();
            points.sort_by(|a, b| a.x.total_cmp(&b.x));
            let at = Vector3::from(at);
            let all = points.iter().map(|point| (point - at).norm());
            let least = all.fold(f64::INFINITY, f64::min);
            prop_assert!((nearest(&points, &at) - least).abs() < 1e-12);
        }
    }
}
