//! Vehicles through the frames of a sequence: identities, and poses smoothed by how sure each frame is.
//!
//! [`Tracker`] takes frame after frame and knows only the past; [`smooth_sequence`] has all frames and looks both ways.
//! Both are given what the pose stage says of a frame ([`Observation`]) and work in the frame of the camera, since nobody
//! may know how it moves; whoever does tells it, and vehicles then move with constant velocity in the world.
//!
//! One image tells a vehicle's distance only as a multiple of its size. So the size is a state of its own, the same in
//! all frames, and every sighting is brought to it along its line of sight before the filter sees it: a model that
//! changes from frame to frame moves nothing.

mod assignment;
mod motion;
mod observation;
mod sequence;
mod tracker;
mod vehicle;

pub use motion::{Motion, MotionNoise, Step};
pub use observation::{Observation, Spread};
pub use sequence::{SequenceFrame, smooth_sequence};
pub use tracker::{TrackOptions, TrackedPose, Tracker};
