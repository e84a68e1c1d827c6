//! Results as ASAM `OpenLABEL` 1.0: a frame an image, a cuboid, a box and a score a vehicle.
//!
//! ASAM: *`OpenLABEL` V1.0.0*, 2021. Cuboids are `x, y, z, qx, qy, qz, qw, sx, sy, sz` in the camera's frame about their
//! centre, axes x forward, y left, z up; boxes are `x, y, width, height` about their centre. Cameras stand in the
//! properties of each frame. Vehicles are not tracked, so every one is an object of its own.

use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::{Map, Value, json};

use super::read_results::PosedImage;
use super::upright::{from_upright, to_upright};
use crate::geometry::{Camera, Cuboid, Vector3};

/// Name of the coordinate system and of the stream.
const CAMERA: &str = "camera";

/// The file of all images.
pub fn openlabel(images: &[PosedImage]) -> Value {
    let (mut objects, mut frames) = (Map::new(), Map::new());
    for (number, image) in images.iter().enumerate() {
        let mut present = Map::new();
        for (i, vehicle) in image.vehicles.iter().enumerate() {
            let id = objects.len().to_string();
            let name = format!("{} {number}-{i}", vehicle.model);
            objects.insert(id.clone(), json!({ "name": name, "type": vehicle.category }));
            let (center, q, sides) = to_upright(&vehicle.cuboid);
            let cuboid: Vec<f64> =
                center.iter().copied().chain([q.i, q.j, q.k, q.w]).chain(sides).collect();
            let middle = vehicle.bounds.center();
            let bounds = [middle.x, middle.y, vehicle.bounds.width(), vehicle.bounds.height()];
            let data = json!({
                "cuboid": [{ "name": "cuboid", "val": cuboid, "coordinate_system": CAMERA }],
                "bbox": [{ "name": "box", "val": bounds, "coordinate_system": CAMERA }],
                "num": [{ "name": "score", "val": vehicle.score }],
                "text": [{ "name": "model", "val": vehicle.model }],
            });
            present.insert(id, json!({ "object_data": data }));
        }
        let stream = json!({ "uri": image.image, "stream_properties": properties(&image.camera) });
        let frame = json!({
            "frame_properties": { "streams": { CAMERA: stream } },
            "objects": present,
        });
        frames.insert(number.to_string(), frame);
    }
    let mut root = json!({
        "metadata": { "schema_version": "1.0.0", "annotator": "partpose" },
        "coordinate_systems": { CAMERA: { "type": "sensor_cs", "parent": "", "children": [] } },
        "streams": { CAMERA: { "type": "camera" } },
        "objects": objects,
    });
    // The format wants at least one frame where it has any.
    if !frames.is_empty() {
        root["frame_intervals"] = json!([{ "frame_start": 0, "frame_end": frames.len() - 1 }]);
        root["frames"] = Value::Object(frames);
    }
    json!({ "openlabel": root })
}

fn properties(camera: &Camera) -> Value {
    let ([fx, fy], [cx, cy]) = (camera.focal, camera.principal_point);
    json!({ "intrinsics_pinhole": {
        "camera_matrix_3x4": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        "distortion_coeffs_1xN": [0.0, 0.0, 0.0, 0.0, 0.0],
        "width_px": camera.size[0],
        "height_px": camera.size[1],
    } })
}

/// The cuboids of every frame, by the number of the frame and the id of the object; what is none is left out.
pub fn openlabel_cuboids(file: &Value) -> Vec<(usize, String, Cuboid)> {
    let mut found = Vec::new();
    let empty = Map::new();
    let map = |value: &Value| value.as_object().unwrap_or(&empty).clone();
    for (number, frame) in map(&file["openlabel"]["frames"]) {
        let Ok(number) = number.parse::<usize>() else { continue };
        for (id, object) in map(&frame["objects"]) {
            let cuboids = object["object_data"]["cuboid"].as_array().cloned().unwrap_or_default();
            let read = cuboids.iter().filter_map(|data| cuboid(&data["val"]));
            found.extend(read.map(|cuboid| (number, id.clone(), cuboid)));
        }
    }
    found.sort_by_key(|(frame, id, _)| (*frame, id.parse::<usize>().ok()));
    found
}

fn cuboid(value: &Value) -> Option<Cuboid> {
    let values: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    let [x, y, z, i, j, k, w, length, width, height] = <[f64; 10]>::try_from(values).ok()?;
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6)?;
    let cuboid = from_upright(&Vector3::new(x, y, z), &rotation, [length, width, height]);
    cuboid.extent.is_valid().then_some(cuboid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_results::tests::posed;

    #[test]
    fn cuboids_come_back_as_they_were() {
        let images = [posed(), posed()];
        let text = openlabel(&images).to_string();
        let found = openlabel_cuboids(&serde_json::from_str(&text).unwrap());
        assert_eq!(found.iter().map(|(frame, ..)| *frame).collect::<Vec<_>>(), [0, 0, 1, 1]);
        let vehicles = images.iter().flat_map(|image| &image.vehicles);
        for ((_, _, cuboid), vehicle) in found.iter().zip(vehicles) {
            assert!((cuboid.iou(&vehicle.cuboid) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn other_json_has_no_cuboids() {
        for text in [
            "1",
            "{}",
            r#"{"openlabel": {"frames": {"0": {"objects": {"a": {"object_data":
            {"cuboid": [{"val": [1, 2]}, {"val": "x"}, 3]}}}}}}}"#,
        ] {
            assert_eq!(openlabel_cuboids(&serde_json::from_str(text).unwrap()), []);
        }
        assert_eq!(openlabel_cuboids(&openlabel(&[])), []);
    }
}
