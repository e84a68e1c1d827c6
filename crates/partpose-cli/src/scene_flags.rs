//! The flags of what is known of all vehicles of an image together.

use nalgebra::Vector3;
use partpose::pose::dense::GravityPrior;
use partpose::pose::ground::GroundOptions;
use partpose::pose::scene::SceneOptions;
use serde_json::{Value, json};

#[derive(clap::Args, Clone, Debug)]
pub(crate) struct SceneFlags {
    /// Estimate the road from the image's own fits and put the vehicles on it (dense fit only): with `--extent free` it
    /// says how large they are
    #[arg(long)]
    ground: bool,
    /// Height of the camera above the road, metres; if not given, the likely sizes of the image's vehicles tell it
    #[arg(long, value_name = "METRES", requires = "ground", value_parser = height)]
    camera_height: Option<f64>,
    /// Direction of gravity in the camera frame (x right, y down, z forward), as an IMU knows it; if not given, the
    /// vehicles' own tilts tell it
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    gravity: Option<Vector3<f64>>,
    /// Fit every detection by itself: nearer vehicles do not tell the farther ones what they hide
    #[arg(long)]
    alone: bool,
}

/// How well a given height is known, as a share of it.
pub(crate) const HEIGHT_SIGMA: f64 = 0.01;
/// How well a given direction of gravity is known, radians.
const GRAVITY_SIGMA: f64 = 0.005;

pub(crate) fn height(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.1..=20.0).contains(&value) => Ok(value),
        _ => Err("a height from 0.1 to 20 metres is meant, such as 1.65".to_owned()),
    }
}

fn direction(text: &str) -> Result<Vector3<f64>, String> {
    let sides: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    let vector = match sides.as_deref() {
        Ok([x, y, z]) => Vector3::new(*x, *y, *z).try_normalize(1e-6),
        _ => None,
    };
    vector
        .filter(|v| v.iter().all(|value| value.is_finite()))
        .ok_or_else(|| "three numbers are meant, such as 0.01,0.999,-0.03".to_owned())
}

impl SceneFlags {
    /// What was asked for, for records.
    pub(crate) fn settings(&self) -> Value {
        json!({
            "ground": self.ground,
            "camera_height": self.camera_height,
            "gravity": self.gravity.map(<[f64; 3]>::from),
            "alone": self.alone,
        })
    }

    /// The options that the flags ask for.
    pub(crate) fn options(&self) -> SceneOptions {
        let camera_height = self.camera_height.map(|height| [height, HEIGHT_SIGMA]);
        let gravity = self
            .gravity
            .map(|down_in_camera| GravityPrior { down_in_camera, sigma: GRAVITY_SIGMA });
        SceneOptions {
            occlusion: !self.alone,
            gravity,
            ground: self.ground.then(|| GroundOptions { camera_height, ..Default::default() }),
        }
    }
}
