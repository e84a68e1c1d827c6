//! Scores against ground truth.

pub mod pnp;
