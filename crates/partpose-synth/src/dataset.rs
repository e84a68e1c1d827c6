//! Writes sequences in the layout of Virtual KITTI 1.3.1.
