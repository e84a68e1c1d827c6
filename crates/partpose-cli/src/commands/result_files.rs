//! What every command that estimates poses writes for an image: JSON, KITTI text, a picture.

use std::collections::BTreeMap;
use std::path::{Component, Path};

use partpose::detection::Detection;
use partpose::files::{self, RgbImage};
use partpose::formats::{ImageResult, KittiRow, kitti_text};
use partpose::geometry::{Camera, Cuboid, Vector3};
use partpose::parts::{PartMask, Scaling};
use partpose::pose::PoseEstimate;
use partpose::render::Instance;
use partpose::vehicle::ModelZoo;
use partpose::viz::{BirdsEyeOptions, PointPair, ScenePicture, VehiclePicture, side_by_side};

use crate::report::hint;

/// One vehicle to draw.
pub(crate) struct Pictured<'a> {
    pub(crate) detection: &'a Detection,
    pub(crate) estimate: Option<&'a PoseEstimate>,
    /// The zoo that the estimate's model is of.
    pub(crate) zoo: &'a ModelZoo,
    pub(crate) truth: Option<Cuboid>,
}

/// Endings that are not part of an image's name.
const IMAGE_ENDINGS: [&str; 7] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp"];

/// JSON files, without their ending, that are no results but may lie beside them.
pub(crate) const OTHERS: [&str; 5] = ["metrics", "carved", "images", "objects", "run"];

/// The name of an image without its ending, safe as a file's name: folders become part of it, and an underscore follows
/// where other files are called so.
pub(crate) fn stem(image: &str) -> String {
    let name = Path::new(image);
    let ending = name.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let is_image = ending.is_some_and(|ending| IMAGE_ENDINGS.contains(&ending.as_str()));
    let path = if is_image { name.with_extension("") } else { name.to_owned() };
    let parts = path.components().filter_map(|component| match component {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    });
    let name = parts.collect::<Vec<_>>().join("_");
    match name.as_str() {
        "" => "image".to_owned(),
        // Some file systems do not tell capitals from small letters.
        other if OTHERS.iter().any(|taken| taken.eq_ignore_ascii_case(other)) => {
            format!("{other}_")
        }
        _ => name,
    }
}

/// The stems of all images; an error if two would write the same files.
pub(crate) fn stems(images: &[String]) -> anyhow::Result<Vec<String>> {
    let mut seen: BTreeMap<String, &String> = BTreeMap::new();
    let mut stems = Vec::with_capacity(images.len());
    for image in images {
        let stem = stem(image);
        if let Some(other) = seen.insert(stem.to_lowercase(), image) {
            return Err(hint(
                anyhow::anyhow!(
                    "the images `{other}` and `{image}` would both be written to `{stem}.json`"
                ),
                "give the images names that differ in more than their folder's separators and endings",
            ));
        }
        stems.push(stem);
    }
    Ok(stems)
}

/// Writes `STEM.txt` and, as what tells that all is there, `STEM.json`.
pub(crate) fn write_results(
    folder: &Path,
    stem: &str,
    result: &ImageResult,
    estimates: &[(&Detection, Option<&PoseEstimate>)],
    zoo: &ModelZoo,
) -> anyhow::Result<()> {
    let rows: Vec<KittiRow> = estimates
        .iter()
        .filter_map(|(detection, estimate)| {
            let estimate = (*estimate)?;
            let model = zoo.models.get(estimate.model_index)?;
            Some(KittiRow {
                category: model.category().to_owned(),
                bounds: detection.bounds,
                cuboid: estimate.cuboid(),
                truncation: None,
                occluded: None,
                score: detection.score,
            })
        })
        .collect();
    let text = kitti_text(&rows, &Vector3::zeros());
    files::write(&folder.join(format!("{stem}.txt")), text.as_bytes())?;
    let json = serde_json::to_string_pretty(result)?;
    files::write(&folder.join(format!("{stem}.json")), json.as_bytes())?;
    Ok(())
}

/// The image with boxes, masks, points and models, and the scene from above beside it.
pub(crate) fn picture(
    title: &str,
    camera: &Camera,
    image: Option<&RgbImage>,
    (vehicles, scaling): (&[Pictured], Scaling),
) -> RgbImage {
    let masks: Vec<PartMask> =
        vehicles.iter().map(|vehicle| vehicle.detection.part_mask(camera.size, scaling)).collect();
    let vehicles = vehicles
        .iter()
        .zip(&masks)
        .enumerate()
        .map(|(index, (vehicle, mask))| vehicle_picture(index, vehicle, mask, camera))
        .collect();
    let scene = ScenePicture { camera: *camera, image, title: title.to_owned(), vehicles };
    side_by_side(&scene, &BirdsEyeOptions::default())
}

fn vehicle_picture<'a>(
    index: usize,
    vehicle: &Pictured<'a>,
    mask: &'a PartMask,
    camera: &Camera,
) -> VehiclePicture<'a> {
    let mut picture = VehiclePicture {
        id: (index + 1).to_string(),
        bounds: Some(vehicle.detection.bounds),
        mask: Some(mask),
        truth: vehicle.truth,
        text: "no pose".to_owned(),
        ..Default::default()
    };
    let Some(estimate) = vehicle.estimate else { return picture };
    picture.points = estimate
        .correspondences
        .iter()
        .filter_map(|c| {
            let reprojected =
                camera.project(&(estimate.camera_from_vehicle * c.point_in_vehicle))?;
            let (observed, inlier) = (c.point_in_image, c.inlier);
            Some(PointPair { observed, reprojected, class: c.part, inlier })
        })
        .collect();
    picture.model = vehicle.zoo.models.get(estimate.model_index).map(|model| Instance {
        mesh: model.mesh(),
        scale: estimate.scale,
        camera_from_vehicle: estimate.camera_from_vehicle,
        id: index as u16 + 1,
    });
    picture.predicted = Some(estimate.cuboid());
    let depth = estimate.camera_from_vehicle.translation.z;
    picture.text = format!("{} z={depth:.1}m", estimate.model);
    if let Some(truth) = &vehicle.truth {
        let iou = estimate.cuboid().iou(truth);
        picture.text = format!("{} IoU {iou:.2}", picture.text);
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stem_cannot_leave_its_folder() {
        assert_eq!(stem("a/b/0001.PNG"), "a_b_0001");
        assert_eq!(stem("frame.0001"), "frame.0001");
        assert_eq!(stem("../../etc/passwd"), "etc_passwd");
        assert_eq!(stem(""), "image");
    }

    #[test]
    fn results_are_not_called_like_other_files_beside_them() {
        assert_eq!(stem("run.png"), "run_");
        assert_eq!(stem("Metrics"), "Metrics_");
        assert_eq!(stem("a/run.png"), "a_run");
    }

    #[test]
    fn images_that_would_overwrite_each_other_are_refused() {
        let names =
            |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        assert_eq!(stems(&names(&["f.0001", "f.0002", "g.png"])).unwrap().len(), 3);
        for clash in [
            ["x/a.png", "x_a.jpg"],
            ["a.png", "a.png"],
            ["A.png", "a.png"],
            ["run.png", "run_.png"],
        ] {
            let said = stems(&names(&clash)).unwrap_err().to_string();
            assert!(said.contains(clash[0]) && said.contains(clash[1]), "{said}");
        }
    }
}
