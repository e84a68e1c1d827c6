//! Results in other people's formats.

pub mod kitti;
