//! Operations of our own, where they beat what burn brings or burn has none.
//!
//! Each file holds the arithmetic on slices and the function on tensors; gradients are registered with burn in one place.
//! On devices that are no processors chains of burn's operations stand in for them.

pub mod attach;
pub mod conv;
pub mod conv2d;
pub mod linear;
pub mod norm;
pub mod pool;
pub mod resize;
pub mod roi_align;

mod apply;
mod chains;
#[cfg(test)]
mod gradients;
mod vector;
mod winograd;

pub use attach::attach;
pub(crate) use chains::in_memory;
pub use conv2d::{ConvOptions, conv2d, conv2d_prepared};
pub use linear::linear;
pub use norm::{Normalised, batch_norm, fixed_norm, group_norm};
pub use pool::{average, max_pool};
pub use resize::{resize, upsample_add};
pub use roi_align::read_regions;
pub use winograd::Prepared;
