//! Results as COCO's list of detections, for its evaluators.
//!
//! Lin et al.: *Microsoft COCO: Common Objects in Context*, ECCV 2014. Boxes only: the JSON results keep no masks.

use serde::{Deserialize, Serialize};

use super::coco::VEHICLE_CATEGORY;
use super::read_results::PosedImage;

/// One detection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CocoDetection {
    /// The image's id.
    pub image_id: u64,
    /// The category of whole vehicles, as in our annotations.
    pub category_id: u8,
    /// `x, y, width, height` from the upper left corner of the first pixel.
    pub bbox: [f64; 4],
    /// The more certain the higher.
    pub score: f64,
}

/// The detections of images with their ids.
pub fn coco_results(images: &[(u64, PosedImage)]) -> Vec<CocoDetection> {
    let of_image = |(image_id, image): &(u64, PosedImage)| {
        let detection = |vehicle: &super::PosedVehicle| {
            let bounds = &vehicle.bounds;
            CocoDetection {
                image_id: *image_id,
                category_id: VEHICLE_CATEGORY,
                bbox: [bounds.x_min + 0.5, bounds.y_min + 0.5, bounds.width(), bounds.height()],
                score: vehicle.score,
            }
        };
        image.vehicles.iter().map(detection).collect::<Vec<_>>()
    };
    images.iter().flat_map(of_image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_results::tests::posed;

    #[test]
    fn the_first_pixel_begins_at_zero_in_coco() {
        let found = coco_results(&[(7, posed())]);
        assert_eq!((found.len(), found[0].image_id), (2, 7));
        assert_eq!(found[0].bbox.to_vec(), [10.5, 20.5, 100.5, 60.25]);
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Vec<CocoDetection>>(&text).unwrap(), found);
    }
}
