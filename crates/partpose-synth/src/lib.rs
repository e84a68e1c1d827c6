//! Synthetic driving scenes with part labels, in Virtual KITTI's format.
//!
//! [`world`] makes a [`scene::Scene`] of roads, houses, trees and traffic for a moment of a sequence, [`shading`] turns
//! it into an image and its labels, [`camera`] makes a photograph of the image, [`dataset`] writes files. Everything
//! random follows from a seed; the same seed gives the same bytes on any number of threads.
//!
//! The world frame is Virtual KITTI's: y down, metres. Colours are linear RGB until the camera has exposed them.

pub mod camera;
pub mod dataset;
pub mod scene;
pub mod shading;
pub mod vehicles;
pub mod world;
