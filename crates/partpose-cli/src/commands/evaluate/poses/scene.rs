//! Vehicles of a frame fitted together: flags, and the height of the camera over the road.

use partpose::dataset::Frame;
use partpose::eval::{Configuration, EvaluationOptions, SceneProtocol, measure_camera_height};
use partpose::pose::ground::GroundOptions;

use crate::report::{hint, note};
use crate::scene_flags::{HEIGHT_SIGMA, height};

#[derive(clap::Args, Clone)]
pub(super) struct Flags {
    /// Estimate the road from the frame's own fits and put the vehicles on it (dense fit only): with `--extent free` it
    /// says how large they are
    #[arg(long)]
    ground: bool,
    /// Height of the camera above the road, metres; if not given it is estimated from the likely sizes of all vehicles
    /// of every fifth frame
    #[arg(long, value_name = "METRES", requires = "ground", value_parser = height)]
    camera_height: Option<f64>,
    /// Which way is down: as the data set's camera poses say, as an IMU would, or as the fitted vehicles stand
    #[arg(long, value_enum, default_value = "poses", requires = "ground")]
    gravity: Gravity,
    /// Let nearer vehicles' fits tell the farther ones what is hidden
    #[arg(long)]
    joint: bool,
    /// Detections do not say what is unknown, as a network's do not
    #[arg(long)]
    without_unknown: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Gravity {
    Poses,
    Vehicles,
}

/// How well a height is known that is estimated over a sequence, as a share of it.
const ESTIMATED: f64 = 0.01;
/// Every how many frames the height is estimated.
const STRIDE: usize = 5;

impl Flags {
    /// What is asked for, in words; nothing if vehicles are fitted each alone.
    pub(super) fn in_words(&self) -> Vec<String> {
        let height = self.camera_height.map(|height| format!("camera height {height} m"));
        let gravity = match self.gravity {
            Gravity::Poses => "gravity of the camera's poses",
            Gravity::Vehicles => "gravity of the vehicles",
        };
        let ground = ["ground", gravity].map(str::to_owned).into_iter().filter(|_| self.ground);
        let joint = self.joint.then(|| "joint".to_owned());
        let without = self.without_unknown.then(|| "without unknown".to_owned());
        ground.chain(height).chain(joint).chain(without).collect()
    }

    /// What the flags ask for; `None` if vehicles are fitted each alone.
    pub(super) fn protocol(&self) -> Option<SceneProtocol> {
        let camera_height = self.camera_height.map(|height| [height, HEIGHT_SIGMA]);
        let protocol = SceneProtocol {
            ground: self.ground.then(|| GroundOptions { camera_height, ..Default::default() }),
            gravity_from_poses: self.ground && self.gravity == Gravity::Poses,
            occlusion: self.joint,
            hide_unknown: self.without_unknown,
        };
        (protocol != SceneProtocol::default()).then_some(protocol)
    }
}

/// Finds the height of the camera where the road is asked for and the height was not given.
pub(super) fn measure(
    options: &mut EvaluationOptions,
    frames: &[Frame],
    configuration: &Configuration,
) -> anyhow::Result<()> {
    let Some(mut protocol) = options.scene else { return Ok(()) };
    let Some(ground) = protocol.ground.filter(|ground| ground.camera_height.is_none()) else {
        return Ok(());
    };
    let few: Vec<Frame> = frames.iter().step_by(STRIDE).cloned().collect();
    let height =
        measure_camera_height(&few, options, configuration, &protocol).ok_or_else(|| {
            hint(
                anyhow::anyhow!("no frame shows where the road is"),
                "give the height of the camera with `--camera-height`",
            )
        })?;
    note(format_args!("the camera stands {height:.3} m above the road, by the vehicles' sizes"));
    protocol.ground = Some(GroundOptions { camera_height: Some([height, ESTIMATED]), ..ground });
    options.scene = Some(protocol);
    Ok(())
}
