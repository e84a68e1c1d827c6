//! Cuboids as most other formats have them: about their centre, x forward, y left, z up.

use nalgebra::UnitQuaternion;

use crate::geometry::{Cuboid, Extent, Pose, Rotation3, Vector3};

/// Takes the frame x forward, y left, z up to the vehicle frame x right, y down, z forward.
fn vehicle_from_upright() -> UnitQuaternion<f64> {
    let axes = [-Vector3::x(), -Vector3::y()];
    let rotation = Rotation3::from_basis_unchecked(&[Vector3::z(), axes[0], axes[1]]);
    UnitQuaternion::from_rotation_matrix(&rotation)
}

/// The centre in the camera frame, the quaternion that takes the upright frame to the camera's, and the sides along
/// the upright axes: length, width, height.
pub(super) fn to_upright(cuboid: &Cuboid) -> (Vector3, UnitQuaternion<f64>, [f64; 3]) {
    let Extent { width, height, length } = cuboid.extent;
    let rotation = cuboid.camera_from_vehicle.rotation * vehicle_from_upright();
    (cuboid.center().coords, rotation, [length, width, height])
}

/// The cuboid that [`to_upright`] was given.
pub(super) fn from_upright(
    center: &Vector3,
    rotation: &UnitQuaternion<f64>,
    [length, width, height]: [f64; 3],
) -> Cuboid {
    let rotation = rotation * vehicle_from_upright().inverse();
    let place = center + rotation * Vector3::new(0.0, 0.5 * height, 0.0);
    Cuboid {
        camera_from_vehicle: Pose::from_parts(place.into(), rotation),
        extent: Extent::new(width, height, length),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_results::tests::posed;

    #[test]
    fn forward_left_and_up_are_where_they_belong() {
        let q = vehicle_from_upright();
        assert!((q * Vector3::x() - Vector3::z()).norm() < 1e-12);
        assert!((q * Vector3::y() + Vector3::x()).norm() < 1e-12);
        assert!((q * Vector3::z() + Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn a_cuboid_comes_back_as_it_was() {
        for vehicle in posed().vehicles {
            let (center, rotation, sides) = to_upright(&vehicle.cuboid);
            let back = from_upright(&center, &rotation, sides);
            assert!((back.iou(&vehicle.cuboid) - 1.0).abs() < 1e-9);
            let turned = back.camera_from_vehicle.rotation;
            assert!(turned.angle_to(&vehicle.cuboid.camera_from_vehicle.rotation) < 1e-7);
        }
    }
}
