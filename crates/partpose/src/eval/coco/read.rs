//! COCO's JSON of annotations and its list of results.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::eval::input::{InputError, shown};
use crate::files;

use super::segmentation::{Segmentation, segmentation_rle};
use super::{CocoImage, CocoOverlap, CocoResult, CocoTruth};
use crate::parts::rle::Rle;

/// Annotations and results by image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CocoSet {
    /// Ids and names, by id.
    pub categories: Vec<(i64, String)>,
    /// By id.
    pub images: Vec<CocoImage>,
    /// Results of categories that the annotations do not have, which are left out.
    pub unknown_categories: usize,
}

impl CocoSet {
    /// Whether all annotations and results have what the overlap is measured by.
    pub fn has(&self, overlap: CocoOverlap) -> bool {
        self.images.iter().all(|image| match overlap {
            CocoOverlap::Boxes => {
                image.truths.iter().all(|truth| truth.bounds.is_some())
                    && image.results.iter().all(|result| result.bounds.is_some())
            }
            CocoOverlap::Masks => {
                image.truths.iter().all(|truth| truth.mask.is_some())
                    && image.results.iter().all(|result| result.mask.is_some())
            }
        })
    }
}

#[derive(Deserialize)]
struct Labels {
    images: Vec<Image>,
    annotations: Vec<Annotation>,
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: i64,
    width: Option<u32>,
    height: Option<u32>,
}

#[derive(Deserialize)]
struct Category {
    id: i64,
    #[serde(default)]
    name: String,
}

#[derive(Deserialize)]
struct Annotation {
    image_id: i64,
    category_id: i64,
    bbox: Option<Vec<f64>>,
    area: f64,
    #[serde(default)]
    iscrowd: i64,
    segmentation: Option<Segmentation>,
}

#[derive(Deserialize)]
struct Found {
    image_id: i64,
    category_id: i64,
    score: f64,
    bbox: Option<Vec<f64>>,
    segmentation: Option<Segmentation>,
}

/// Reads a file of annotations and a file of results.
pub fn read_coco(labels: &Path, results: &Path) -> Result<CocoSet, InputError> {
    parse_coco((labels, &files::read(labels)?), (results, &files::read(results)?))
}

/// The same from the files' bytes; the paths are for messages only.
pub fn parse_coco(
    (labels, label_bytes): (&Path, &[u8]),
    (results, result_bytes): (&Path, &[u8]),
) -> Result<CocoSet, InputError> {
    let json = |path: &Path, source| InputError::Json { path: path.to_owned(), source };
    let file: Labels = serde_json::from_slice(label_bytes).map_err(|e| json(labels, e))?;
    let found: Vec<Found> = serde_json::from_slice(result_bytes).map_err(|e| json(results, e))?;
    let categories: BTreeMap<i64, String> =
        file.categories.into_iter().map(|category| (category.id, category.name)).collect();
    let index: BTreeMap<i64, usize> =
        categories.keys().enumerate().map(|(index, id)| (*id, index)).collect();
    let mut images: BTreeMap<i64, (Option<[u32; 2]>, CocoImage)> = BTreeMap::new();
    for image in file.images {
        let size = image.width.zip(image.height).map(|(width, height)| [width, height]);
        images.insert(image.id, (size, CocoImage::default()));
    }
    for (at, annotation) in file.annotations.into_iter().enumerate() {
        let wrong = |reason: String| InputError::entry(labels, format!("annotation {at}"), reason);
        let id = annotation.image_id;
        let Some((size, image)) = images.get_mut(&id) else {
            return Err(wrong(format!("belongs to image {id}, which is not there")));
        };
        let Some(category) = index.get(&annotation.category_id) else {
            let id = annotation.category_id;
            return Err(wrong(format!("belongs to category {id}, which is not there")));
        };
        image.truths.push(CocoTruth {
            category: *category,
            bounds: bounds(annotation.bbox).map_err(wrong)?,
            area: annotation.area,
            crowd: annotation.iscrowd != 0,
            mask: mask(annotation.segmentation.as_ref(), *size).map_err(wrong)?,
        });
    }
    let mut unknown_categories = 0;
    // As in pycocotools the first result says whether areas are those of boxes.
    let box_areas = found.first().is_some_and(|first| has_box(first.bbox.as_ref()));
    for (at, result) in found.into_iter().enumerate() {
        let wrong = |reason: String| InputError::entry(results, format!("result {at}"), reason);
        let id = result.image_id;
        let Some((size, image)) = images.get_mut(&id) else {
            return Err(wrong(format!("belongs to image {id}, which the annotations do not have")));
        };
        let Some(category) = index.get(&result.category_id) else {
            unknown_categories += 1;
            continue;
        };
        let mask = mask(result.segmentation.as_ref(), *size).map_err(wrong)?;
        let mut bounds = bounds(result.bbox).map_err(wrong)?;
        let area = match (box_areas, bounds, &mask) {
            (true, Some(bounds), _) => bounds[2] * bounds[3],
            (true, None, _) => return Err(wrong("has no `bbox`, but the first has".to_owned())),
            (false, _, Some(mask)) => mask.area() as f64,
            (false, _, None) => {
                return Err(wrong("has neither `bbox` nor `segmentation`".to_owned()));
            }
        };
        if let (None, Some(mask)) = (bounds, &mask) {
            bounds = Some(mask.bounds().map(f64::from));
        }
        let category = *category;
        image.results.push(CocoResult { category, bounds, area, score: result.score, mask });
    }
    let images = images.into_values().map(|(_, image)| image).collect();
    Ok(CocoSet { categories: categories.into_iter().collect(), images, unknown_categories })
}

fn has_box(values: Option<&Vec<f64>>) -> bool {
    values.is_some_and(|values| !values.is_empty())
}

/// An empty list stands for no box.
fn bounds(values: Option<Vec<f64>>) -> Result<Option<[f64; 4]>, String> {
    let Some(values) = values.filter(|values| !values.is_empty()) else { return Ok(None) };
    match <[f64; 4]>::try_from(values) {
        Ok(bounds) if bounds[2] >= 0.0 && bounds[3] >= 0.0 => Ok(Some(bounds)),
        Ok(bounds) => Err(format!("has the box {bounds:?}, whose size is negative")),
        Err(values) => Err(format!("has the box {}", shown(&format!("{values:?}")))),
    }
}

fn mask(given: Option<&Segmentation>, size: Option<[u32; 2]>) -> Result<Option<Rle>, String> {
    match given {
        None => Ok(None),
        // An empty list stands for no mask.
        Some(Segmentation::Polygons(polygons)) if polygons.is_empty() => Ok(None),
        Some(given) => segmentation_rle(given, size).map(Some).map_err(|error| error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::eval::coco::score_coco;

    const LABELS: &str = r#"{"images": [{"id": 3, "width": 20, "height": 10}],
        "categories": [{"id": 2, "name": "car"}],
        "annotations": [{"id": 1, "image_id": 3, "category_id": 2, "bbox": [1, 1, 4, 5], "area": 20,
                         "iscrowd": 0, "segmentation": [[1, 1, 5, 1, 5, 6, 1, 6]]}]}"#;
    const RESULTS: &str =
        r#"[{"image_id": 3, "category_id": 2, "bbox": [1, 1, 4, 5], "score": 0.5}]"#;

    fn parse(labels: &str, results: &str) -> Result<CocoSet, String> {
        let [labels, results] = [("l.json", labels), ("r.json", results)]
            .map(|(path, text)| (Path::new(path), text.as_bytes()));
        parse_coco(labels, results).map_err(|error| error.to_string())
    }

    #[test]
    fn boxes_can_be_scored_where_masks_are_missing() {
        let set = parse(LABELS, RESULTS).unwrap();
        assert!(set.has(CocoOverlap::Boxes) && !set.has(CocoOverlap::Masks));
        assert_eq!(set.images[0].truths[0].mask.as_ref().unwrap().area(), 20);
        let scores = score_coco(&set, CocoOverlap::Boxes);
        assert!((scores.figures[0].1.unwrap() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let message = |labels: &str, results: &str| parse(labels, results).unwrap_err();
        let other = RESULTS.replace("\"image_id\": 3", "\"image_id\": 4");
        let said = "`r.json`: result 0 belongs to image 4, which the annotations do not have";
        assert_eq!(message(LABELS, &other), said);
        let other = RESULTS.replace("[1, 1, 4, 5]", "[1, 1, -4, 5]");
        assert!(message(LABELS, &other).contains("negative"));
        let other = LABELS.replace("[[1, 1, 5, 1, 5, 6, 1, 6]]", "[[1, 1]]");
        assert!(message(&other, RESULTS).contains("annotation 0 has a polygon"));
        assert_eq!(message("[", "[]"), "`l.json` is not the JSON that is expected here");
        let other = RESULTS.replace("\"category_id\": 2", "\"category_id\": 9");
        assert_eq!(parse(LABELS, &other).unwrap().unknown_categories, 1);
    }

    proptest! {
        #[test]
        fn damaged_json_is_read_or_refused(
            at in 0usize..300, byte in any::<u8>(), cut in 0usize..600, labels in any::<bool>(),
        ) {
            let damage = |text: &str| {
                let mut bytes = text.as_bytes().to_vec();
                let at = at % bytes.len();
                bytes[at] = byte;
                bytes.truncate(cut);
                bytes
            };
            let [a, b] = if labels {
                [damage(LABELS), RESULTS.as_bytes().to_vec()]
            } else {
                [LABELS.as_bytes().to_vec(), damage(RESULTS)]
            };
            if let Ok(set) = parse_coco((Path::new("a"), &a), (Path::new("b"), &b)) {
                score_coco(&set, CocoOverlap::Boxes);
                score_coco(&set, CocoOverlap::Masks);
            }
        }
    }
}
