//! The fit of every pixel and every probability.
