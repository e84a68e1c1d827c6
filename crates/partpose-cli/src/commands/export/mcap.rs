//! One MCAP file for ROS 2 and Foxglove: camera image, calibration and 3D detections.
//!
//! Messages are those of ROS 2, with their definitions in the file (`ros2msg`) and in its encoding (CDR), so that nobody
//! needs a ROS installation to write or to read them. Boxes follow REP 103, as its tools expect: x forward, y to the
//! left, z up, the centre in the middle of the box; the frame `camera` is an optical frame, x right, y down, z forward.

mod cdr;
mod schemas;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use anyhow::Context;
use mcap::WriteOptions;
use mcap::records::MessageHeader;
use partpose::files;
use partpose::formats::PosedVehicle;
use partpose::geometry::{Camera, Rotation3};
use partpose::viz::SceneFrame;

use self::cdr::Message;

/// The frame that everything is in.
const FRAME: &str = "camera";
/// The file that is written.
const FILE: &str = "results.mcap";
/// Nanoseconds of a second.
const SECOND: f64 = 1e9;

/// Writes all frames, `fps` a second from time 0.
pub(super) fn write(out: &Path, frames: &[SceneFrame], fps: f64) -> anyhow::Result<()> {
    let bytes = encode(frames, fps).context("the results cannot be written as MCAP")?;
    Ok(files::write(&out.join(FILE), &bytes)?)
}

fn encode(frames: &[SceneFrame], fps: f64) -> anyhow::Result<Vec<u8>> {
    let options = WriteOptions::new()
        .compression(None)
        .profile("ros2")
        .library(concat!("partpose ", env!("CARGO_PKG_VERSION")));
    let mut file = options.create(Cursor::new(Vec::new()))?;
    let mut channel = |topic: &str, kind: &str, schema: &str| -> anyhow::Result<u16> {
        let schema = file.add_schema(kind, "ros2msg", schema.as_bytes())?;
        Ok(file.add_channel(schema, topic, "cdr", &BTreeMap::new())?)
    };
    let image = channel(
        "/camera/image/compressed",
        "sensor_msgs/msg/CompressedImage",
        schemas::COMPRESSED_IMAGE,
    )?;
    let info = channel("/camera/camera_info", "sensor_msgs/msg/CameraInfo", schemas::CAMERA_INFO)?;
    let found = channel("/detections", "vision_msgs/msg/Detection3DArray", schemas::DETECTIONS)?;
    let truth = channel("/truth", "vision_msgs/msg/Detection3DArray", schemas::DETECTIONS)?;
    for (number, frame) in (0u32..).zip(frames) {
        let time = (f64::from(number) / fps * SECOND).round() as u64;
        let mut put = |channel: u16, message: Option<Message>| -> anyhow::Result<()> {
            let Some(message) = message else { return Ok(()) };
            let header = MessageHeader {
                channel_id: channel,
                sequence: number,
                log_time: time,
                publish_time: time,
            };
            Ok(file.write_to_known_channel(&header, &message.finish())?)
        };
        put(image, frame.photo.as_deref().and_then(|photo| compressed_image(time, photo)))?;
        put(info, Some(camera_info(time, &frame.found.camera)))?;
        put(found, Some(detections(time, &frame.found.vehicles)))?;
        put(truth, (!frame.truths.is_empty()).then(|| detections(time, &frame.truths)))?;
    }
    file.finish()?;
    Ok(file.into_inner().into_inner())
}

/// `std_msgs/Header`.
fn header(message: &mut Message, time: u64) {
    message.i32((time / SECOND as u64) as i32);
    message.u32((time % SECOND as u64) as u32);
    message.text(FRAME);
}

fn compressed_image(time: u64, photo: &[u8]) -> Option<Message> {
    let format = match photo {
        [0x89, b'P', b'N', b'G', ..] => "png",
        [0xff, 0xd8, ..] => "jpeg",
        _ => return None,
    };
    let mut message = Message::new();
    header(&mut message, time);
    message.text(format);
    message.bytes(photo);
    Some(message)
}

fn camera_info(time: u64, camera: &Camera) -> Message {
    let ([fx, fy], [cx, cy], [width, height]) = (camera.focal, camera.principal_point, camera.size);
    let mut message = Message::new();
    header(&mut message, time);
    message.u32(height);
    message.u32(width);
    message.text("plumb_bob");
    message.count(5);
    let (distortion, identity) = ([0.0; 5], [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
    let projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0];
    for values in [&distortion[..], &matrix, &identity, &projection] {
        message.numbers(values);
    }
    // Binning twice, and the region of interest: the whole image, not rectified.
    for _ in 0..6 {
        message.u32(0);
    }
    message.bool(false);
    message
}

/// `vision_msgs/Detection3DArray`.
fn detections(time: u64, vehicles: &[PosedVehicle]) -> Message {
    // Forward, left and up in the vehicle frame.
    let vehicle_from_body = Rotation3::from_matrix_unchecked(nalgebra::Matrix3::new(
        0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0,
    ));
    let mut message = Message::new();
    header(&mut message, time);
    message.count(vehicles.len());
    for vehicle in vehicles {
        let center = vehicle.cuboid.center();
        let rotation = vehicle.cuboid.camera_from_vehicle.rotation.to_rotation_matrix();
        let rotation =
            nalgebra::UnitQuaternion::from_rotation_matrix(&(rotation * vehicle_from_body));
        let pose = [center.x, center.y, center.z, rotation.i, rotation.j, rotation.k, rotation.w];
        header(&mut message, time);
        message.count(1);
        message.text(&vehicle.category);
        message.f64(vehicle.score);
        message.numbers(&pose);
        message.numbers(&covariance(vehicle));
        message.numbers(&pose);
        let extent = &vehicle.cuboid.extent;
        message.numbers(&[extent.length, extent.width, extent.height]);
        message.text(&vehicle.track.as_ref().map_or(String::new(), |track| track.id.to_string()));
    }
    message
}

/// Rows of the covariance of place and rotation in the axes of the message's frame; all 0 where it is not known.
fn covariance(vehicle: &PosedVehicle) -> [f64; 36] {
    let Some(known) = &vehicle.covariance else { return [0.0; 36] };
    // ROS has the place first, we the rotation.
    std::array::from_fn(|at| known[((at / 6 + 3) % 6, (at % 6 + 3) % 6)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use partpose::formats::PosedImage;
    use partpose::geometry::{Cuboid, Extent, Pose, Rect};

    /// A car that faces away, 20 m ahead.
    fn frame() -> SceneFrame {
        let vehicle = PosedVehicle {
            model: "sedan".to_owned(),
            category: "Car".to_owned(),
            bounds: Rect::new(0.0, 0.0, 9.0, 9.0),
            score: 0.75,
            cuboid: Cuboid {
                camera_from_vehicle: Pose::translation(1.0, 1.5, 20.0),
                extent: Extent::new(1.8, 1.5, 4.4),
            },
            confidence: None,
            covariance: None,
            reprojection_rmse: None,
            track: None,
        };
        let camera = Camera::pinhole(700.0, [600.0, 180.0], [1242, 375]);
        SceneFrame {
            found: PosedImage { image: "a.png".to_owned(), camera, vehicles: vec![vehicle] },
            truths: Vec::new(),
            photo: Some(vec![0xff, 0xd8, 1, 2]),
        }
    }

    #[test]
    fn every_frame_has_its_messages_in_time() {
        let bytes = encode(&[frame(), frame()], 10.0).unwrap();
        let messages: Vec<mcap::Message> =
            mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
        let told: Vec<(&str, u64)> =
            messages.iter().map(|m| (m.channel.topic.as_str(), m.log_time)).collect();
        let of = |time| {
            ["/camera/image/compressed", "/camera/camera_info", "/detections"].map(|t| (t, time))
        };
        assert_eq!(told, [of(0), of(100_000_000)].concat());
        let schema = messages[2].channel.schema.as_ref().unwrap();
        assert_eq!(
            (schema.name.as_str(), schema.encoding.as_str()),
            ("vision_msgs/msg/Detection3DArray", "ros2msg")
        );
    }

    #[test]
    fn a_covariance_has_the_place_first_as_ros_has_it() {
        let mut vehicle = frame().found.vehicles.remove(0);
        assert!(covariance(&vehicle).iter().all(|value| *value == 0.0));
        // Rotations about x, y, z, then places along x, y, z.
        vehicle.covariance =
            Some(nalgebra::Matrix6::from_fn(|i, j| f64::from(10 * i as u32 + j as u32)));
        let told = covariance(&vehicle);
        assert_eq!((told[0], told[1], told[3]), (33.0, 34.0, 30.0));
        assert_eq!((told[21], told[18], told[35]), (0.0, 3.0, 22.0));
        let bytes = detections(0, &[vehicle]).finish();
        let value = told[1].to_le_bytes();
        assert!(bytes.windows(8).any(|window| window == value), "the message holds it");
    }

    #[test]
    fn boxes_are_in_the_axes_of_rep_103() {
        let bytes = detections(0, &frame().found.vehicles).finish();
        // The end: the box's pose of 7 values, its size of 3, and an empty text of 5 bytes.
        let end = bytes.len() - 5;
        let values: Vec<f64> = bytes[end - 80..end]
            .chunks_exact(8)
            .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        let expected = [1.0, 0.75, 20.0, 4.4, 1.8, 1.5];
        for (value, expected) in values[..3].iter().chain(&values[7..]).zip(expected) {
            assert!((value - expected).abs() < 1e-12, "{values:?}");
        }
        // Forward is the camera's z, up its -y.
        let q = nalgebra::Quaternion::new(values[6], values[3], values[4], values[5]);
        let q = nalgebra::UnitQuaternion::from_quaternion(q);
        assert!((q * nalgebra::Vector3::x() - nalgebra::Vector3::z()).norm() < 1e-9);
        assert!((q * nalgebra::Vector3::z() + nalgebra::Vector3::y()).norm() < 1e-9);
    }
}
