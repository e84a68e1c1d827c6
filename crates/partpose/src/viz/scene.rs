//! What a picture of results shows, as plain data: whoever has results fills it in.

use crate::files::RgbImage;
use crate::geometry::{Camera, Cuboid, Point2, Rect};
use crate::parts::{PartClass, PartMask};
use crate::render::Instance;

/// A frame with the vehicles found or known in it.
#[derive(Clone, Debug)]
pub struct ScenePicture<'a> {
    /// The camera of the frame; its size is that of the picture.
    pub camera: Camera,
    /// The photograph; the vehicles stand on dark ground where there is none or it has another size.
    pub image: Option<&'a RgbImage>,
    /// Written into the margin, such as the name of the frame.
    pub title: String,
    /// The vehicles, in any order.
    pub vehicles: Vec<VehiclePicture<'a>>,
}

/// One vehicle of a picture; what is missing is not drawn.
#[derive(Clone, Debug, Default)]
pub struct VehiclePicture<'a> {
    /// A short name that both views show, such as a track id.
    pub id: String,
    /// The detection's box.
    pub bounds: Option<Rect>,
    /// The detection's part mask, in image coordinates.
    pub mask: Option<&'a PartMask>,
    /// Correspondences of the pose.
    pub points: Vec<PointPair>,
    /// The fitted model at its pose.
    pub model: Option<Instance<'a>>,
    /// The annotated cuboid.
    pub truth: Option<Cuboid>,
    /// The fitted cuboid.
    pub predicted: Option<Cuboid>,
    /// What the label says after the id, such as `sedan z=12.3m IoU 0.71`.
    pub text: String,
}

/// A part's centre in the mask and where the pose puts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// In the mask.
    pub observed: Point2,
    /// The 3D centre projected with the estimated pose.
    pub reprojected: Point2,
    /// The part.
    pub class: PartClass,
    /// Whether the estimator kept it.
    pub inlier: bool,
}

/// The colours that both views share.
pub(super) mod palette {
    /// Ground of pictures without a photograph and of the view from above.
    pub(in crate::viz) const GROUND: [u8; 3] = [22, 24, 29];
    /// Margins with legends.
    pub(in crate::viz) const MARGIN: [u8; 3] = [36, 39, 46];
    /// Text on dark.
    pub(in crate::viz) const TEXT: [u8; 3] = [232, 235, 240];
    /// Lesser text and lines on dark.
    pub(in crate::viz) const DIM: [u8; 3] = [128, 134, 146];
    /// Detections.
    pub(in crate::viz) const DETECTION: [u8; 3] = [255, 214, 10];
    /// Ground truth.
    pub(in crate::viz) const TRUTH: [u8; 3] = [60, 240, 100];
    /// Estimates.
    pub(in crate::viz) const PREDICTED: [u8; 3] = [255, 255, 255];
    /// Residuals.
    pub(in crate::viz) const RESIDUAL: [u8; 3] = [255, 64, 64];

    pub(in crate::viz) const fn with_opacity([r, g, b]: [u8; 3], opacity: u8) -> [u8; 4] {
        [r, g, b, opacity]
    }
}
