//! Vehicles of a made-up street for tests and benches.

use partpose::dataset::VehicleLabel;
use partpose::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Vector3};
use partpose::vehicle::ModelZoo;

/// The camera of the street, 1.6 m above it.
pub(crate) const CAMERA: Camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);

/// A vehicle of the zoo at a place (right and forward, in metres), turned, 4 % longer and 3 % narrower than its model.
pub(crate) fn vehicle(zoo: &ModelZoo, index: usize, place: [f64; 2], yaw: f64) -> VehicleLabel {
    let model = &zoo.models[index];
    let e = model.extent();
    let rotation = EulerAngles { x: 0.015, y: yaw, z: -0.01 }.to_rotation();
    let cuboid = Cuboid {
        camera_from_vehicle: Pose::from_parts(
            Vector3::new(place[0], 1.6, place[1]).into(),
            nalgebra::UnitQuaternion::from_rotation_matrix(&rotation),
        ),
        extent: Extent::new(0.97 * e.width, e.height, 1.04 * e.length),
    };
    let whole = cuboid.project(&CAMERA).expect("the vehicle is in front of the camera");
    let bounds = whole.intersection(&CAMERA.image_rect()).expect("the vehicle is in the image");
    VehicleLabel {
        track: Some(index as u32),
        category: "Car".to_owned(),
        dont_care: false,
        truncated: u8::from(bounds != whole),
        occluded: 0,
        truncation: 1.0 - bounds.area() / whole.area(),
        occupancy: None,
        bounds,
        cuboid,
        model: Some(model.name().to_owned()),
        color: None,
    }
}
