//! Pictures: models from all sides, results over their image, and the scene from above.
//!
//! Everything returns an [`RgbImage`](crate::files::RgbImage); nothing here is used by what computes results.

mod birds_eye;
mod canvas;
mod confidence;
mod confusion;
mod contact_sheet;
mod contours;
mod embed;
mod explain;
mod font;
mod labels;
mod mask_grid;
mod overlay;
mod page;
mod plot;
mod scene;
mod scene3d;
mod scene_glb;
mod shade;
mod svg;
mod turntable;

pub use birds_eye::{BirdsEyeOptions, birds_eye};
pub use confidence::confidence_turntable;
pub use confusion::{ConfusionClass, confusion_picture};
pub use contact_sheet::{ContactSheetOptions, contact_sheet};
pub use embed::{base64, html_escape, json_for_html, picture_uri};
pub use explain::{Explanation, explain};
pub use mask_grid::{MaskCell, mask_grid};
pub use overlay::{overlay, side_by_side};
pub use page::scene_page;
pub use plot::{Axis, Mark, Plot, Series, panels, plot};
pub use scene::{PointPair, ScenePicture, VehiclePicture};
pub use scene_glb::scene_glb;
pub use scene3d::SceneFrame;
pub use shade::{ShadeOptions, shade};
pub use svg::{svg_matrix, svg_plot};
pub use turntable::{TurntableOptions, turntable};
