//! Other programs' vehicles as posed images: KITTI label text, nuScenes-like JSON, ASAM `OpenLABEL`, BOP lines.
//!
//! The first fault ends the reading and is named with its file and place: what is converted must be all there is.
//! Where a format has no camera, one is given for all images; where it has no box, that of the projected cuboid is
//! taken; where it has no model, the nearest of a zoo by category and size, else the category's name.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::{Map, Value};

use super::nuscenes::{NuScenesBox, NuScenesResults};
use super::read_results::{PosedImage, PosedVehicle};
use super::upright::from_upright;
use crate::eval::bop::parse_estimates;
use crate::eval::kitti::{KittiObject, parse_kitti};
use crate::eval::{InputError, files_with_ending};
use crate::files;
use crate::geometry::{Camera, Cuboid, EulerAngles, Extent, Pose, Rect, Rotation3, Vector3};
use crate::vehicle::ModelZoo;

/// Largest magnitude of a coordinate in metres.
const ABSURD: f64 = 1e6;
/// KITTI's words for what has wheels and an engine.
const KITTI_VEHICLES: [&str; 4] = ["Car", "Van", "Truck", "Bus"];

/// What a format does not say.
#[derive(Clone, Copy, Debug, Default)]
pub struct ImportOptions<'a> {
    /// The camera of all images; `OpenLABEL` has cameras of its own, which come first.
    pub camera: Option<Camera>,
    /// Models to name vehicles after; BOP needs their extents.
    pub zoo: Option<&'a ModelZoo>,
}

impl ImportOptions<'_> {
    fn camera(&self, path: &Path) -> Result<Camera, InputError> {
        let missing = || InputError::content(path, "has no camera, and none was given");
        self.camera.ok_or_else(missing)
    }

    /// The model that a vehicle is shown as.
    fn model(&self, category: &str, extent: &Extent) -> String {
        let nearest = self.zoo.and_then(|zoo| zoo.closest(category, extent));
        nearest.map_or_else(|| category.to_lowercase(), |model| model.name().to_owned())
    }
}

/// A folder of KITTI text, one file an image: labels with 15 columns or results with 16.
///
/// Cars, vans, trucks and buses are taken. A label has the score 1. The image is called as the file, with the ending
/// `png`. Locations are taken as they are: in the frame of the camera that is given.
pub fn import_kitti(folder: &Path, options: &ImportOptions) -> Result<Vec<PosedImage>, InputError> {
    let camera = options.camera(folder)?;
    let mut images = Vec::new();
    for path in files_with_ending(folder, "txt")? {
        let text = files::read_text(&path)?;
        let scored = text.lines().any(|line| line.split_ascii_whitespace().count() == 16);
        let objects = parse_kitti(&path, &text, scored)?;
        let wanted = |object: &&KittiObject| KITTI_VEHICLES.contains(&object.category.as_str());
        let mut vehicles = Vec::new();
        for object in objects.iter().filter(wanted) {
            let cuboid = kitti_cuboid(object);
            if !cuboid.extent.is_valid() {
                let entry = format!("a `{}`", object.category);
                return Err(InputError::entry(&path, entry, "has a size that makes no sense"));
            }
            vehicles.push(PosedVehicle {
                model: options.model(&object.category, &cuboid.extent),
                category: object.category.clone(),
                bounds: object.bounds,
                score: if scored { object.score } else { 1.0 },
                cuboid,
                confidence: None,
                covariance: None,
                reprojection_rmse: None,
                track: None,
            });
        }
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        images.push(PosedImage { image: format!("{stem}.png"), camera, vehicles });
    }
    Ok(images)
}

/// The inverse of what `kitti_text` does: a yaw of 0 faces right there, along z here.
fn kitti_cuboid(object: &KittiObject) -> Cuboid {
    let [height, width, length] = object.size;
    let angles = EulerAngles { x: 0.0, y: object.rotation_y + FRAC_PI_2, z: 0.0 };
    let rotation = UnitQuaternion::from_rotation_matrix(&angles.to_rotation());
    let place = Vector3::from(object.location);
    Cuboid {
        camera_from_vehicle: Pose::from_parts(place.into(), rotation),
        extent: Extent::new(width, height, length),
    }
}

/// A file in the form of nuScenes detection results, boxes in the camera's frame.
pub fn import_nuscenes(
    path: &Path,
    options: &ImportOptions,
) -> Result<Vec<PosedImage>, InputError> {
    let camera = options.camera(path)?;
    let file: NuScenesResults = parse(path, &files::read(path)?)?;
    let mut images = Vec::new();
    for (image, boxes) in file.results {
        let mut vehicles = Vec::new();
        for (index, found) in boxes.iter().enumerate() {
            let place = || format!("box {index} of `{image}`");
            let cuboid = found.cuboid().filter(sensible).ok_or_else(|| {
                InputError::entry(path, place(), "has a place, size or rotation that makes none")
            })?;
            let category = capitalized(&found.detection_name);
            vehicles.push(PosedVehicle {
                model: options.model(&category, &cuboid.extent),
                category,
                bounds: bounds(&cuboid, &camera),
                score: score(path, &place, found)?,
                cuboid,
                confidence: None,
                covariance: None,
                reprojection_rmse: None,
                track: None,
            });
        }
        images.push(PosedImage { image, camera, vehicles });
    }
    Ok(images)
}

fn score(path: &Path, place: &dyn Fn() -> String, found: &NuScenesBox) -> Result<f64, InputError> {
    let score = found.detection_score;
    if score.is_finite() {
        return Ok(score);
    }
    Err(InputError::entry(path, place(), "has a score that is no number"))
}

/// An `OpenLABEL` file with cuboids in the frame of a camera.
///
/// Each frame is an image: its name is the `uri` of its stream, or the frame's number; its camera the pinhole of its
/// stream. Objects without a cuboid are passed over. Cuboids may have a quaternion or three angles (`Rz Ry Rx`).
pub fn import_openlabel(
    path: &Path,
    options: &ImportOptions,
) -> Result<Vec<PosedImage>, InputError> {
    let file: Value = parse(path, &files::read(path)?)?;
    let root = &file["openlabel"];
    let Some(frames) = root["frames"].as_object() else {
        return Err(InputError::content(path, "has no `openlabel.frames`"));
    };
    let mut images = Vec::new();
    for (number, frame) in frames {
        let stream = first(&frame["frame_properties"]["streams"]);
        let image = stream["uri"].as_str().unwrap_or(number).to_owned();
        let camera = match openlabel_camera(&stream["stream_properties"]["intrinsics_pinhole"]) {
            Some(camera) => camera,
            None => options.camera(path)?,
        };
        let mut vehicles = Vec::new();
        // Ids that are numbers in their order, so that vehicles keep theirs.
        let mut objects: Vec<_> = frame["objects"].as_object().into_iter().flatten().collect();
        objects.sort_by_key(|(id, _)| id.parse::<u64>().unwrap_or(u64::MAX));
        for (id, object) in objects {
            let entry = || format!("object `{id}` of frame `{number}`");
            let data = &object["object_data"];
            let Some(cuboid) = data["cuboid"].as_array().and_then(|cuboids| cuboids.first()) else {
                continue;
            };
            let cuboid = openlabel_cuboid(&cuboid["val"])
                .filter(sensible)
                .ok_or_else(|| InputError::entry(path, entry(), "has a cuboid that makes none"))?;
            let category = root["objects"][id]["type"].as_str().unwrap_or("Car").to_owned();
            let named = |kind: &str, name: &str| {
                let entries = data[kind].as_array()?.iter();
                entries
                    .clone()
                    .find(|entry| entry["name"] == name)
                    .map(|entry| entry["val"].clone())
            };
            let model = named("text", "model").and_then(|value| value.as_str().map(str::to_owned));
            let rectangle =
                data["bbox"].as_array().and_then(|boxes| numbers(&boxes.first()?["val"]));
            vehicles.push(PosedVehicle {
                model: model.unwrap_or_else(|| options.model(&category, &cuboid.extent)),
                category,
                bounds: rectangle.map_or_else(
                    || bounds(&cuboid, &camera),
                    |[x, y, w, h]| Rect::new(x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h),
                ),
                score: named("num", "score").and_then(|value| value.as_f64()).unwrap_or(1.0),
                cuboid,
                confidence: None,
                covariance: None,
                reprojection_rmse: None,
                track: None,
            });
        }
        images.push((
            number.parse::<u64>().unwrap_or(u64::MAX),
            PosedImage { image, camera, vehicles },
        ));
    }
    images.sort_by_key(|(number, _)| *number);
    Ok(images.into_iter().map(|(_, image)| image).collect())
}

/// A CSV of BOP results, millimetres, with the names that `export --to bop` writes beside it, where they are there.
///
/// `images.json` gives the names of image ids, `objects.json` the ids of models. The zoo must hold the models: BOP has
/// no sizes.
pub fn import_bop(path: &Path, options: &ImportOptions) -> Result<Vec<PosedImage>, InputError> {
    let camera = options.camera(path)?;
    let zoo = options.zoo.ok_or_else(|| {
        InputError::content(path, "has no sizes, and no zoo was given to take them from")
    })?;
    let beside = |name: &str| path.with_file_name(name);
    let names: BTreeMap<u32, String> = optional(&beside("images.json"))?.unwrap_or_default();
    let ids: BTreeMap<String, u32> = match optional(&beside("objects.json"))? {
        Some(ids) => ids,
        None => (1..).zip(&zoo.models).map(|(id, model)| (model.name().to_owned(), id)).collect(),
    };
    let mut images: BTreeMap<[u32; 2], PosedImage> = BTreeMap::new();
    for (index, line) in parse_estimates(path, &files::read_text(path)?)?.iter().enumerate() {
        let model = ids.iter().find(|(_, id)| **id == line.object).map(|(name, _)| name);
        let model = model.and_then(|name| zoo.get(name)).ok_or_else(|| {
            let entry = format!("estimate {index}");
            let reason = format!("is of object {}, which the zoo has no model of", line.object);
            InputError::entry(path, entry, reason)
        })?;
        let rotation = Rotation3::from_matrix_unchecked(line.pose.rotation);
        let cuboid = Cuboid {
            camera_from_vehicle: Pose::from_parts(
                (0.001 * line.pose.translation).into(),
                UnitQuaternion::from_rotation_matrix(&rotation),
            ),
            extent: model.extent(),
        };
        let key = [line.scene, line.image];
        let image = images.entry(key).or_insert_with(|| PosedImage {
            image: names
                .get(&line.image)
                .cloned()
                .unwrap_or_else(|| format!("{:06}/rgb/{:06}.png", line.scene, line.image)),
            camera,
            vehicles: Vec::new(),
        });
        image.vehicles.push(PosedVehicle {
            model: model.name().to_owned(),
            category: model.category().to_owned(),
            bounds: bounds(&cuboid, &camera),
            score: line.score,
            cuboid,
            confidence: None,
            covariance: None,
            reprojection_rmse: None,
            track: None,
        });
    }
    Ok(images.into_values().collect())
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path, bytes: &[u8]) -> Result<T, InputError> {
    serde_json::from_slice(bytes)
        .map_err(|source| InputError::Json { path: path.to_owned(), source })
}

/// The content of a file that need not be there.
fn optional<T: serde::de::DeserializeOwned>(path: &Path) -> Result<Option<T>, InputError> {
    if path.is_file() { parse(path, &files::read(path)?).map(Some) } else { Ok(None) }
}

fn sensible(cuboid: &Cuboid) -> bool {
    let place = &cuboid.camera_from_vehicle.translation.vector;
    cuboid.extent.is_valid() && place.iter().all(|value| value.abs() <= ABSURD)
}

/// The box around the projected cuboid within the image; the whole image where the cuboid reaches behind the camera.
fn bounds(cuboid: &Cuboid, camera: &Camera) -> Rect {
    let image = camera.image_rect();
    cuboid.project(camera).and_then(|rect| rect.intersection(&image)).unwrap_or(image)
}

/// The only member of an object, or the first by name; null where there is none.
fn first(value: &Value) -> &Value {
    value
        .as_object()
        .and_then(|map: &Map<String, Value>| map.values().next())
        .unwrap_or(&Value::Null)
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let values: Vec<f64> = value.as_array()?.iter().map(Value::as_f64).collect::<Option<_>>()?;
    let sensible = |value: &f64| value.abs() <= ABSURD;
    <[f64; N]>::try_from(values).ok().filter(|values| values.iter().all(sensible))
}

fn openlabel_camera(pinhole: &Value) -> Option<Camera> {
    let matrix: [f64; 12] = numbers(&pinhole["camera_matrix_3x4"])?;
    let side = |name: &str| {
        pinhole[name].as_u64().and_then(|side| u32::try_from(side).ok()).filter(|side| *side > 0)
    };
    let camera = Camera {
        focal: [matrix[0], matrix[5]],
        principal_point: [matrix[2], matrix[6]],
        size: [side("width_px")?, side("height_px")?],
    };
    camera.focal.iter().all(|focal| *focal >= 1.0).then_some(camera)
}

fn openlabel_cuboid(value: &Value) -> Option<Cuboid> {
    if let Some([x, y, z, i, j, k, w, a, b, c]) = numbers(value) {
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, i, j, k), 1e-6)?;
        return Some(from_upright(&Vector3::new(x, y, z), &rotation, [a, b, c]));
    }
    let [x, y, z, rx, ry, rz, a, b, c] = numbers(value)?;
    let rotation = UnitQuaternion::from_euler_angles(rx, ry, rz);
    Some(from_upright(&Vector3::new(x, y, z), &rotation, [a, b, c]))
}

/// The categories of zoos begin with a capital.
fn capitalized(name: &str) -> String {
    let mut characters = name.chars();
    characters.next().map_or(String::new(), |c| c.to_uppercase().chain(characters).collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::formats::nuscenes::nuscenes_results;
    use crate::formats::read_results::tests::posed;
    use crate::formats::{KittiRow, kitti_text, openlabel};

    fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        files::write(&path, bytes).unwrap();
        (folder, path)
    }

    fn options() -> ImportOptions<'static> {
        ImportOptions { camera: Some(posed().camera), zoo: None }
    }

    fn check(found: &[PosedImage], least_iou: f64) {
        let expected = posed();
        assert_eq!((found.len(), found[0].camera), (1, expected.camera));
        assert_eq!(found[0].vehicles.len(), expected.vehicles.len());
        for (found, vehicle) in found[0].vehicles.iter().zip(&expected.vehicles) {
            assert!(found.cuboid.iou(&vehicle.cuboid) > least_iou);
            assert_eq!((&found.category, found.score), (&vehicle.category, vehicle.score));
        }
    }

    #[test]
    fn kitti_lines_come_back_but_for_pitch_and_roll() {
        let rows = posed().vehicles.into_iter().map(|vehicle| KittiRow {
            category: vehicle.category,
            truncation: None,
            occluded: None,
            bounds: vehicle.bounds,
            cuboid: vehicle.cuboid,
            score: vehicle.score,
        });
        let text = kitti_text(&rows.collect::<Vec<_>>(), &Vector3::zeros());
        let text = text + "Pedestrian -1 -1 0 1 2 3 4 -1 -1 -1 0 0 9 0 0.5\n";
        let (folder, _) = written("0007.txt", text.as_bytes());
        check(&import_kitti(folder.path(), &options()).unwrap(), 0.85);
    }

    #[test]
    fn nuscenes_boxes_come_back() {
        let text = serde_json::to_string(&nuscenes_results(&[posed()])).unwrap();
        let (_folder, path) = written("a.json", text.as_bytes());
        check(&import_nuscenes(&path, &options()).unwrap(), 1.0 - 1e-6);
        let said = import_nuscenes(&path, &ImportOptions::default()).unwrap_err().to_string();
        assert!(said.ends_with("has no camera, and none was given"), "{said}");
        let (_folder, path) = written("a.json", text.replace("1.8", "-1.8").as_bytes());
        let said = import_nuscenes(&path, &options()).unwrap_err().to_string();
        assert!(said.contains("box 0 of `frames/0007.png`"), "{said}");
    }

    #[test]
    fn openlabel_brings_its_camera_names_boxes_and_models() {
        let text = openlabel(&[posed()]).to_string();
        let (_folder, path) = written("a.json", text.as_bytes());
        let found = import_openlabel(&path, &ImportOptions::default()).unwrap();
        check(&found, 1.0 - 1e-6);
        let expected = posed();
        assert_eq!(found[0].image, expected.image);
        assert_eq!(found[0].vehicles[0].bounds, expected.vehicles[0].bounds);
        assert_eq!(found[0].vehicles[0].model, "sedan");
    }

    #[test]
    fn bop_lines_take_their_sizes_from_the_zoo() {
        let zoo = ModelZoo::embedded();
        let name = zoo.models[2].name().to_owned();
        let mut image = posed();
        for vehicle in &mut image.vehicles {
            vehicle.model.clone_from(&name);
            vehicle.cuboid.extent = zoo.models[2].extent();
        }
        let ids = BTreeMap::from([(name, 3)]);
        let text = crate::formats::bop::bop_csv(&[([4, 7], &image)], &ids);
        let (_folder, path) = written("a.csv", text.as_bytes());
        let options = ImportOptions { zoo: Some(&zoo), ..options() };
        let found = import_bop(&path, &options).unwrap();
        assert_eq!(found[0].image, "000004/rgb/000007.png");
        for (found, vehicle) in found[0].vehicles.iter().zip(&image.vehicles) {
            assert!(found.cuboid.iou(&vehicle.cuboid) > 1.0 - 1e-6);
        }
        let (_folder, path) = written("a.csv", text.replace("4,7,3,", "4,7,99,").as_bytes());
        let said = import_bop(&path, &options).unwrap_err().to_string();
        assert!(said.contains("object 99"), "{said}");
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn damaged_files_are_read_or_refused(
            at in any::<prop::sample::Index>(), byte in any::<u8>(), cut in any::<prop::sample::Index>(),
        ) {
            for text in [
                serde_json::to_string(&nuscenes_results(&[posed()])).unwrap(),
                openlabel(&[posed()]).to_string(),
            ] {
                let mut bytes = text.into_bytes();
                let length = bytes.len();
                bytes[at.index(length)] = byte;
                bytes.truncate(length - cut.index(length) / 8);
                let (_folder, path) = written("a.json", &bytes);
                let _ = import_nuscenes(&path, &options());
                let _ = import_openlabel(&path, &options());
            }
        }
    }
}
