//! Cameras, poses, boxes: the geometry everything else is written in.
//!
//! A transform is named `target_from_source`, a point `point_in_frame`, so that a product can be checked by reading.

mod angles;
mod camera;
mod cuboid;
mod rect;

pub use angles::{EulerAngles, wrap_angle};
pub use camera::Camera;
pub use cuboid::{Cuboid, Extent};
pub use rect::Rect;

/// A rigid transform; the direction is in the name of the variable, as in `camera_from_vehicle`.
pub type Pose = nalgebra::Isometry3<f64>;
/// A point in the image, pixels.
pub type Point2 = nalgebra::Point2<f64>;
/// A point in space, metres.
pub type Point3 = nalgebra::Point3<f64>;
/// A direction or a displacement in space.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A rotation matrix.
pub type Rotation3 = nalgebra::Rotation3<f64>;
