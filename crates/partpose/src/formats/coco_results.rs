//! Results as COCO's list of detections, for its evaluators.
//!
//! Lin et al.: *Microsoft COCO: Common Objects in Context*, ECCV 2014. Boxes only: the JSON results keep no masks.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::coco::VEHICLE_CATEGORY;
use super::read_results::PosedImage;
use crate::eval::InputError;
use crate::files;

/// What all vehicles may be called where a file of annotations has no category for each kind.
const ANY_VEHICLE: [&str; 2] = ["vehicle", "car"];

/// One detection.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CocoDetection {
    /// The image's id.
    pub image_id: u64,
    /// Its category's id.
    pub category_id: u64,
    /// `x, y, width, height` from the upper left corner of the first pixel.
    pub bbox: [f64; 4],
    /// The more certain the higher.
    pub score: f64,
}

/// The ids that a file of annotations gave its images and categories.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CocoIds {
    /// By file name.
    pub images: BTreeMap<String, u64>,
    /// By name in lower case; empty for our own annotations' category of whole vehicles.
    pub categories: BTreeMap<String, u64>,
}

impl CocoIds {
    /// The id of an image: by its whole name, or else by the only file name that ends like it.
    pub fn image(&self, name: &str) -> Option<u64> {
        if let Some(id) = self.images.get(name) {
            return Some(*id);
        }
        let last = |name: &str| name.rsplit('/').next().unwrap_or_default().to_owned();
        let mut same = self.images.iter().filter(|(other, _)| last(other) == last(name));
        match (same.next(), same.next()) {
            (Some((_, id)), None) => Some(*id),
            _ => None,
        }
    }

    fn category(&self, name: &str) -> Option<u64> {
        if self.categories.is_empty() {
            return Some(u64::from(VEHICLE_CATEGORY));
        }
        let name = name.to_lowercase();
        let found = self.categories.get(name.as_str());
        let any = || ANY_VEHICLE.iter().find_map(|name| self.categories.get(*name));
        found.or_else(any).copied()
    }
}

#[derive(Deserialize)]
struct Annotations {
    images: Vec<Image>,
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: u64,
    file_name: String,
}

#[derive(Deserialize)]
struct Category {
    id: u64,
    name: String,
}

/// The ids of a file of annotations.
pub fn read_coco_ids(path: &Path) -> Result<CocoIds, InputError> {
    let file: Annotations = serde_json::from_slice(&files::read(path)?)
        .map_err(|source| InputError::Json { path: path.to_owned(), source })?;
    Ok(CocoIds {
        images: file.images.into_iter().map(|image| (image.file_name, image.id)).collect(),
        categories: file
            .categories
            .into_iter()
            .map(|category| (category.name.to_lowercase(), category.id))
            .collect(),
    })
}

/// The detections of images with their ids; vehicles that no category fits are left out.
pub fn coco_results(images: &[(u64, PosedImage)], ids: &CocoIds) -> Vec<CocoDetection> {
    let of_image = |(image_id, image): &(u64, PosedImage)| {
        let detection = |vehicle: &super::PosedVehicle| {
            let bounds = &vehicle.bounds;
            Some(CocoDetection {
                image_id: *image_id,
                category_id: ids.category(&vehicle.category)?,
                bbox: [bounds.x_min + 0.5, bounds.y_min + 0.5, bounds.width(), bounds.height()],
                score: vehicle.score,
            })
        };
        image.vehicles.iter().filter_map(detection).collect::<Vec<_>>()
    };
    images.iter().flat_map(of_image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_results::tests::posed;

    #[test]
    fn the_first_pixel_begins_at_zero_in_coco() {
        let found = coco_results(&[(7, posed())], &CocoIds::default());
        assert_eq!((found.len(), found[0].image_id, found[0].category_id), (2, 7, 30));
        assert_eq!(found[0].bbox.to_vec(), [10.5, 20.5, 100.5, 60.25]);
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(serde_json::from_str::<Vec<CocoDetection>>(&text).unwrap(), found);
    }

    #[test]
    fn ids_are_found_by_names() {
        let ids = |names: [&str; 2], categories: [&str; 2]| CocoIds {
            images: names.iter().zip(3..).map(|(name, id)| ((*name).to_owned(), id)).collect(),
            categories: categories.iter().zip(8..).map(|(n, id)| ((*n).to_owned(), id)).collect(),
        };
        let own = ids(["a/0001.png", "b/0002.png"], ["car", "person"]);
        assert_eq!((own.image("a/0001.png"), own.image("x/0002.png")), (Some(3), Some(4)));
        assert_eq!(ids(["a/1.png", "b/1.png"], ["car", "x"]).image("1.png"), None);
        assert_eq!((own.category("Car"), own.category("Van")), (Some(8), Some(8)));
        assert!(coco_results(&[(1, posed())], &ids(["a", "b"], ["cat", "dog"])).is_empty());
    }
}
