//! Six-degree-of-freedom vehicle poses from part masks.
//!
//! ```no_run
//! use partpose::formats::read_detections;
//! use partpose::geometry::Camera;
//! use partpose::pose::{ExtentSource, PoseEstimator, PoseOptions};
//! use partpose::vehicle::ModelZoo;
//!
//! let zoo = ModelZoo::load("zoo".as_ref())?;
//! let estimator = PoseEstimator::new(&zoo, &PoseOptions::default());
//! let camera = Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]);
//! for (_, detection) in read_detections("detections.safetensors".as_ref())?.detections {
//!     match estimator.estimate(&camera, &detection, &ExtentSource::Model) {
//!         Ok(found) => println!("{} at {}", found.model, found.camera_from_vehicle.translation),
//!         Err(reason) => println!("no pose: {reason}"),
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The way of one frame: a [`dataset::Frame`] holds an image's camera and its labelled vehicles; a detector, or
//! the [`oracle`] in its place, turns it into [`detection::Detection`]s; [`pose`] turns each detection into a
//! [`pose::PoseEstimate`] with the models of a [`vehicle::ModelZoo`]; [`eval`] scores the estimates against the frame.
//!
//! Conventions, everywhere: metres, radians, pixels; camera frame x right, y down, z forward; vehicle frame x to the
//! vehicle's right, y down, z forward, origin at the centre of the bottom face of its cuboid; **pixel centres lie at
//! integer coordinates**, so the first pixel covers -0.5 to 0.5.
//!
//! The modules form layers, listed bottom to top in `ARCHITECTURE.md`; each uses only those below it, which
//! `tests/layers.rs` enforces.

pub mod annotate;
pub mod carve;
pub mod dataset;
pub mod detection;
pub mod eval;
pub mod files;
pub mod formats;
pub mod geometry;
pub mod labeling;
pub mod oracle;
pub mod parts;
pub mod pnp;
pub mod pose;
pub mod render;
pub mod track;
pub mod vehicle;
pub mod viz;
