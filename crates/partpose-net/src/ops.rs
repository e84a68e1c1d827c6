//! Operations of our own, where they beat what burn brings or burn has none.

pub mod conv;
pub mod roi_align;

mod dispatch;

pub use dispatch::{conv2d, roi_align};
