//! What every command that estimates poses writes for an image: JSON, KITTI text, a picture.

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

/// One vehicle to draw.
pub(crate) struct Pictured<'a> {
    pub(crate) detection: &'a Detection,
    pub(crate) estimate: Option<&'a PoseEstimate>,
    pub(crate) truth: Option<Cuboid>,
}

/// The name of an image without its ending, safe as a file's name: folders become part of it.
pub(crate) fn stem(image: &str) -> String {
    let path = Path::new(image).with_extension("");
    let parts = path.components().filter_map(|component| match component {
        Component::Normal(part) => Some(part.to_string_lossy().into_owned()),
        _ => None,
    });
    let name = parts.collect::<Vec<_>>().join("_");
    if name.is_empty() { "image".to_owned() } else { name }
}

/// Writes `STEM.json` and `STEM.txt`.
pub(crate) fn write_results(
    folder: &Path,
    stem: &str,
    result: &ImageResult,
    estimates: &[(&Detection, Option<&PoseEstimate>)],
    zoo: &ModelZoo,
) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(result)?;
    files::write(&folder.join(format!("{stem}.json")), json.as_bytes())?;
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
    Ok(())
}

/// The image with boxes, masks, points and models, and the scene from above beside it.
pub(crate) fn picture(
    title: &str,
    camera: &Camera,
    zoo: &ModelZoo,
    image: Option<&RgbImage>,
    (vehicles, scaling): (&[Pictured], Scaling),
) -> RgbImage {
    let masks: Vec<PartMask> =
        vehicles.iter().map(|vehicle| vehicle.detection.part_mask(camera.size, scaling)).collect();
    let vehicles = vehicles
        .iter()
        .zip(&masks)
        .enumerate()
        .map(|(index, (vehicle, mask))| vehicle_picture(index, vehicle, mask, camera, zoo))
        .collect();
    let scene = ScenePicture { camera: *camera, image, title: title.to_owned(), vehicles };
    side_by_side(&scene, &BirdsEyeOptions::default())
}

fn vehicle_picture<'a>(
    index: usize,
    vehicle: &Pictured,
    mask: &'a PartMask,
    camera: &Camera,
    zoo: &'a ModelZoo,
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
    picture.model = zoo.models.get(estimate.model_index).map(|model| Instance {
        mesh: model.mesh(),
        scale: estimate.scale,
        camera_from_vehicle: estimate.camera_from_vehicle,
        id: index as u16 + 1,
    });
    picture.predicted = Some(estimate.cuboid());
    let depth = estimate.camera_from_vehicle.translation.z;
    picture.text = format!("{} z={depth:.1}m", estimate.model);
    if let Some(truth) = &vehicle.truth {
        picture.text += &format!(" IoU {:.2}", estimate.cuboid().iou(truth));
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stem_cannot_leave_its_folder() {
        assert_eq!(stem("a/b/0001.png"), "a_b_0001");
        assert_eq!(stem("../../etc/passwd"), "etc_passwd");
        assert_eq!(stem(""), "image");
    }
}
