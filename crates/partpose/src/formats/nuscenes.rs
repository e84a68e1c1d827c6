//! Results as the JSON of the nuScenes detection task.
//!
//! Caesar et al.: *nuScenes: A Multimodal Dataset for Autonomous Driving*, CVPR 2020. It differs from theirs in one
//! thing: boxes are in the camera's frame, since nothing is known of the world's, and the samples are images. Axes of a
//! box: x forward, y left, z up; sizes are width, length, height; quaternions have the real part first.

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::read_results::PosedImage;
use super::upright::{from_upright, to_upright};
use crate::geometry::{Cuboid, Vector3};

/// A file of results.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NuScenesResults {
    /// What was used.
    pub meta: NuScenesMeta,
    /// Boxes by the name of their image.
    pub results: BTreeMap<String, Vec<NuScenesBox>>,
}

/// What the results rest on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "the format has them")]
pub struct NuScenesMeta {
    /// Images.
    pub use_camera: bool,
    /// Laser scans.
    pub use_lidar: bool,
    /// Radar.
    pub use_radar: bool,
    /// Maps.
    pub use_map: bool,
    /// Other data.
    pub use_external: bool,
}

impl Default for NuScenesMeta {
    fn default() -> Self {
        Self {
            use_camera: true,
            use_lidar: false,
            use_radar: false,
            use_map: false,
            use_external: false,
        }
    }
}

/// One box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NuScenesBox {
    /// Name of the image.
    pub sample_token: String,
    /// The centre in the camera frame, metres.
    pub translation: [f64; 3],
    /// Width, length, height, metres.
    pub size: [f64; 3],
    /// Real part first.
    pub rotation: [f64; 4],
    /// Nothing is known of it.
    pub velocity: [f64; 2],
    /// `car`, `truck` and so on.
    pub detection_name: String,
    /// The more certain the higher.
    pub detection_score: f64,
    /// Nothing is known of it.
    pub attribute_name: String,
}

impl NuScenesBox {
    /// The box as a cuboid; `None` if its numbers make none.
    pub fn cuboid(&self) -> Option<Cuboid> {
        let [w, i, j, k] = self.rotation;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6)?;
        let [width, length, height] = self.size;
        let center = Vector3::from(self.translation);
        let cuboid = from_upright(&center, &rotation, [length, width, height]);
        (cuboid.extent.is_valid() && center.iter().all(|value| value.is_finite())).then_some(cuboid)
    }
}

/// The boxes of all images.
pub fn nuscenes_results(images: &[PosedImage]) -> NuScenesResults {
    let mut results: BTreeMap<String, Vec<NuScenesBox>> = BTreeMap::new();
    for image in images {
        let boxes = results.entry(image.image.clone()).or_default();
        for vehicle in &image.vehicles {
            let (center, rotation, [length, width, height]) = to_upright(&vehicle.cuboid);
            boxes.push(NuScenesBox {
                sample_token: image.image.clone(),
                translation: center.into(),
                size: [width, length, height],
                rotation: [rotation.w, rotation.i, rotation.j, rotation.k],
                velocity: [0.0; 2],
                detection_name: name(&vehicle.category),
                detection_score: vehicle.score,
                attribute_name: String::new(),
            });
        }
    }
    NuScenesResults { meta: NuScenesMeta::default(), results }
}

/// The task has no vans; they are cars there.
fn name(category: &str) -> String {
    match category.to_lowercase().as_str() {
        "van" => "car".to_owned(),
        other => other.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::read_results::tests::posed;

    #[test]
    fn boxes_come_back_as_the_cuboids_they_were() {
        let image = posed();
        let text = serde_json::to_string(&nuscenes_results(std::slice::from_ref(&image))).unwrap();
        let back: NuScenesResults = serde_json::from_str(&text).unwrap();
        let boxes = &back.results[&image.image];
        assert_eq!((boxes.len(), boxes[0].size), (2, [1.8, 4.4, 1.5]));
        for (found, vehicle) in boxes.iter().zip(&image.vehicles) {
            assert!((found.cuboid().unwrap().iou(&vehicle.cuboid) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_box_without_size_or_rotation_is_none() {
        let good = nuscenes_results(&[posed()]).results["frames/0007.png"][0].clone();
        assert_eq!(NuScenesBox { rotation: [0.0; 4], ..good.clone() }.cuboid(), None);
        assert_eq!(NuScenesBox { size: [0.0, 1.0, 1.0], ..good }.cuboid(), None);
    }
}
