//! The JSON results of `fit`, read back for other programs' formats.

use std::path::Path;

use nalgebra::{Matrix3, Matrix6, UnitQuaternion};
use serde::{Deserialize, Serialize};

use crate::files::{self, FileError};
use crate::geometry::{Camera, Cuboid, Extent, Pose, Rect, Rotation3, Vector3};

use super::results::placed;

/// How far a matrix may be from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Largest magnitude of a coordinate, metres or pixels.
const ABSURD: f64 = 1e6;

/// Why a file is no result of `fit`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultFileError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not JSON, or JSON of another shape.
    #[error("`{path}` is not a result of `partpose fit`")]
    Json {
        /// The file.
        path: std::path::PathBuf,
        /// What the parser says, with its place.
        source: serde_json::Error,
    },
    /// A camera that nobody has.
    #[error("`{path}` has a camera that makes no sense")]
    Camera {
        /// The file.
        path: std::path::PathBuf,
    },
    /// A vehicle that makes no sense.
    #[error("`{path}`: vehicle {index} has a {what} that makes no sense")]
    Vehicle {
        /// The file.
        path: std::path::PathBuf,
        /// Counted from 0.
        index: usize,
        /// What is wrong.
        what: &'static str,
    },
}

/// The vehicles with a pose of one image.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedImage {
    /// Name of the image.
    pub image: String,
    /// The camera that the poses refer to.
    pub camera: Camera,
    /// In the order of the file; those without pose are left out.
    pub vehicles: Vec<PosedVehicle>,
}

/// A vehicle with a pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedVehicle {
    /// Name of its model.
    pub model: String,
    /// What it is: `Car`, `Van`, `Truck`.
    pub category: String,
    /// The detection's box, pixel centres at integers.
    pub bounds: Rect,
    /// The more certain the higher.
    pub score: f64,
    /// Pose and extent.
    pub cuboid: Cuboid,
    /// How much the fit trusts itself, 0 to 1, where it says so.
    pub confidence: Option<f64>,
    /// Covariance of a rotation vector in camera axes about the cuboid's centre (radians) and of the centre (metres),
    /// where the fit says it.
    pub covariance: Option<Matrix6<f64>>,
    /// Root mean square distance of projected and seen part centres in pixels, where the fit rests on them.
    pub reprojection_rmse: Option<f64>,
    /// What the frames of a sequence say together, where they were followed.
    pub track: Option<PosedTrack>,
}

/// A vehicle's place in a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedTrack {
    /// Its number, the same in all frames.
    pub id: u32,
    /// The likeliest model over the frames.
    pub model: String,
    /// The smoothed pose and size.
    pub cuboid: Cuboid,
    /// As that of the vehicle.
    pub covariance: Option<Matrix6<f64>>,
}

impl PosedVehicle {
    /// The same with pose, size and model of its track, where it has one.
    #[must_use]
    pub fn tracked(mut self) -> Self {
        if let Some(track) = &self.track {
            self.cuboid = track.cuboid;
            self.covariance = track.covariance;
            self.model.clone_from(&track.model);
        }
        self
    }
}

#[derive(Serialize, Deserialize)]
struct ImageRecord {
    image: String,
    camera: Camera,
    vehicles: Vec<VehicleRecord>,
}

#[derive(Serialize, Deserialize)]
struct VehicleRecord {
    bounds: [f64; 4],
    score: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pose: Option<PoseRecord>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    track: Option<TrackRecord>,
}

#[derive(Serialize, Deserialize)]
struct PoseRecord {
    model: String,
    /// Only where it was known without a zoo.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    category: Option<String>,
    translation: [f64; 3],
    rotation: [[f64; 3]; 3],
    extent: Extent,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reprojection_rmse: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    dense: Option<DenseRecord>,
}

#[derive(Serialize, Deserialize)]
struct DenseRecord {
    confidence: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    covariance: CovarianceRecord,
}

/// Rows, of which the first six of the first six columns are meant; a number that is not finite is `null`.
type CovarianceRecord = Vec<Vec<Option<f64>>>;

#[derive(Serialize, Deserialize)]
struct TrackRecord {
    id: u32,
    model: String,
    translation: [f64; 3],
    rotation: [[f64; 3]; 3],
    extent: Extent,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    covariance: CovarianceRecord,
}

/// Reads the result of one image; `category` gives the category of a model by its name.
pub fn read_result(
    path: &Path,
    category: &dyn Fn(&str) -> String,
) -> Result<PosedImage, ResultFileError> {
    parse_result(path, &files::read(path)?, category)
}

/// The same from the file's bytes; `path` is for messages only.
pub fn parse_result(
    path: &Path,
    bytes: &[u8],
    category: &dyn Fn(&str) -> String,
) -> Result<PosedImage, ResultFileError> {
    let record: ImageRecord = serde_json::from_slice(bytes)
        .map_err(|source| ResultFileError::Json { path: path.to_owned(), source })?;
    let Camera { focal, principal_point, size } = &record.camera;
    if focal.iter().any(|focal| !(1.0..=ABSURD).contains(focal))
        || principal_point.iter().any(|value| !(value.abs() <= ABSURD))
        || size.iter().any(|side| !(1..=files::MAX_IMAGE_SIDE).contains(side))
    {
        return Err(ResultFileError::Camera { path: path.to_owned() });
    }
    let mut vehicles = Vec::new();
    for (index, vehicle) in record.vehicles.into_iter().enumerate() {
        let wrong = |what| ResultFileError::Vehicle { path: path.to_owned(), index, what };
        let Some(pose) = vehicle.pose else { continue };
        if !vehicle.score.is_finite() {
            return Err(wrong("score"));
        }
        if !is_sensible(&vehicle.bounds) {
            return Err(wrong("box"));
        }
        let cuboid = cuboid(&pose.translation, pose.rotation, pose.extent).map_err(wrong)?;
        let track = match vehicle.track {
            Some(track) => Some(PosedTrack {
                id: track.id,
                covariance: covariance(&track.covariance),
                model: track.model,
                cuboid: self::cuboid(&track.translation, track.rotation, track.extent)
                    .map_err(wrong)?,
            }),
            None => None,
        };
        let [left, top, right, bottom] = vehicle.bounds;
        let dense = pose.dense.as_ref();
        vehicles.push(PosedVehicle {
            category: pose.category.unwrap_or_else(|| category(&pose.model)),
            model: pose.model,
            bounds: Rect::new(left, top, right, bottom),
            score: vehicle.score,
            confidence: dense.and_then(|dense| dense.confidence),
            covariance: dense.and_then(|dense| covariance(&dense.covariance)),
            reprojection_rmse: pose.reprojection_rmse,
            cuboid,
            track,
        });
    }
    Ok(PosedImage { image: record.image, camera: record.camera, vehicles })
}

fn is_sensible(values: &[f64]) -> bool {
    values.iter().all(|value| value.abs() <= ABSURD)
}

/// `None` where numbers are missing or say of no place how sure it is.
fn covariance(rows: &CovarianceRecord) -> Option<Matrix6<f64>> {
    let mut covariance = Matrix6::zeros();
    for i in 0..6 {
        for j in 0..6 {
            covariance[(i, j)] = rows.get(i)?.get(j).copied().flatten()?;
        }
    }
    (covariance.diagonal().min() >= 0.0).then_some(covariance)
}

/// The cuboid of a record, or what of it makes no sense.
fn cuboid(
    translation: &[f64; 3],
    [a, b, c]: [[f64; 3]; 3],
    extent: Extent,
) -> Result<Cuboid, &'static str> {
    if !is_sensible(translation) {
        return Err("translation");
    }
    if !extent.is_valid() {
        return Err("extent");
    }
    let matrix = Matrix3::from_row_slice(&[a, b, c].concat());
    let miss = (matrix * matrix.transpose() - Matrix3::identity()).abs().max();
    if !(miss <= ROTATION_TOLERANCE) || matrix.determinant() < 0.0 {
        return Err("rotation");
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    let place = Vector3::from(*translation);
    Ok(Cuboid { camera_from_vehicle: Pose::from_parts(place.into(), rotation), extent })
}

/// The JSON of an image whose poses come from elsewhere; [`parse_result`] reads it as it reads that of `fit`.
pub fn result_json(image: &PosedImage) -> String {
    let matrix = |covariance: &Option<Matrix6<f64>>| {
        let row = |row: nalgebra::RowVector6<f64>| row.iter().copied().map(Some).collect();
        covariance.map_or(Vec::new(), |matrix| matrix.row_iter().map(|r| row(r.into())).collect())
    };
    let vehicle = |vehicle: &PosedVehicle| {
        let bounds = &vehicle.bounds;
        let (translation, rotation) = placed(&vehicle.cuboid.camera_from_vehicle);
        let says = vehicle.confidence.is_some() || vehicle.covariance.is_some();
        VehicleRecord {
            bounds: [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max],
            score: vehicle.score,
            pose: Some(PoseRecord {
                model: vehicle.model.clone(),
                category: Some(vehicle.category.clone()),
                translation,
                rotation,
                extent: vehicle.cuboid.extent,
                reprojection_rmse: vehicle.reprojection_rmse,
                dense: says.then(|| DenseRecord {
                    confidence: vehicle.confidence,
                    covariance: matrix(&vehicle.covariance),
                }),
            }),
            track: vehicle.track.as_ref().map(|track| {
                let (translation, rotation) = placed(&track.cuboid.camera_from_vehicle);
                TrackRecord {
                    id: track.id,
                    model: track.model.clone(),
                    translation,
                    rotation,
                    extent: track.cuboid.extent,
                    covariance: matrix(&track.covariance),
                }
            }),
        }
    };
    let record = ImageRecord {
        image: image.image.clone(),
        camera: image.camera,
        vehicles: image.vehicles.iter().map(vehicle).collect(),
    };
    serde_json::to_string_pretty(&record).expect("names and numbers can be written as JSON")
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::EulerAngles;

    /// An image with two vehicles that no two axes are alike in.
    pub(crate) fn posed() -> PosedImage {
        let vehicle = |x: f64, yaw: f64, score: f64| {
            let rotation = EulerAngles { x: 0.05, y: yaw, z: -0.02 }.to_rotation();
            let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
            PosedVehicle {
                model: "sedan".to_owned(),
                category: "Car".to_owned(),
                bounds: Rect::new(10.0, 20.0, 110.5, 80.25),
                score,
                cuboid: Cuboid {
                    camera_from_vehicle: Pose::from_parts(
                        Vector3::new(x, 1.5, 14.0).into(),
                        rotation,
                    ),
                    extent: Extent::new(1.8, 1.5, 4.4),
                },
                confidence: None,
                covariance: None,
                reprojection_rmse: None,
                track: None,
            }
        };
        PosedImage {
            image: "frames/0007.png".to_owned(),
            camera: Camera::pinhole(700.0, [600.0, 180.0], [1242, 375]),
            vehicles: vec![vehicle(-2.0, 0.3, 0.9), vehicle(3.0, -2.0, 0.5)],
        }
    }

    const JSON: &str = r#"{"image": "a.png", "settings": {},
        "camera": {"focal": [700, 700], "principal_point": [600, 180], "size": [1242, 375]},
        "vehicles": [{"bounds": [1, 2, 30, 40], "score": 0.5, "no_pose": "too few points"},
          {"bounds": [1, 2, 30, 40], "score": 0.7, "pose": {"model": "van", "translation": [1, 2, 9],
           "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "extent": {"width": 1.8, "height": 1.5, "length": 4.4}}}]}"#;

    fn parse(text: &str) -> Result<PosedImage, String> {
        let category = |model: &str| if model == "van" { "Van" } else { "Car" }.to_owned();
        parse_result(Path::new("a.json"), text.as_bytes(), &category).map_err(|e| e.to_string())
    }

    #[test]
    fn vehicles_without_pose_are_left_out() {
        let image = parse(JSON).unwrap();
        assert_eq!((image.vehicles.len(), image.vehicles[0].category.as_str()), (1, "Van"));
    }

    #[test]
    fn a_camera_that_nobody_has_is_refused() {
        let said = parse(&JSON.replace("[1242, 375]", "[0, 375]")).unwrap_err();
        assert_eq!(said, "`a.json` has a camera that makes no sense");
    }

    #[test]
    fn a_vehicle_that_makes_no_sense_is_named() {
        for (from, to, what) in [
            ("[0, 1, 0]", "[0, 2, 0]", "rotation"),
            ("\"width\": 1.8", "\"width\": -1", "extent"),
            ("[1, 2, 9]", "[1, 2, 9e99]", "translation"),
        ] {
            let said = parse(&JSON.replace(from, to)).unwrap_err();
            assert_eq!(said, format!("`a.json`: vehicle 1 has a {what} that makes no sense"));
        }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let mut image = posed();
        image.vehicles[0].confidence = Some(0.75);
        image.vehicles[0].covariance = Some(Matrix6::from_fn(|i, j| 1.0 / (i + j + 1) as f64));
        let cuboid = image.vehicles[1].cuboid;
        let track = PosedTrack { id: 3, model: "van".to_owned(), cuboid, covariance: None };
        image.vehicles[1].track = Some(track);
        let text = result_json(&image);
        let back = parse_result(Path::new("a.json"), text.as_bytes(), &|_| String::new()).unwrap();
        assert_eq!((back.camera, &back.image), (image.camera, &image.image));
        for (found, vehicle) in back.vehicles.iter().zip(&image.vehicles) {
            assert_eq!((&found.model, &found.category), (&vehicle.model, &vehicle.category));
            assert!(found.cuboid.iou(&vehicle.cuboid) > 1.0 - 1e-9);
            assert_eq!(
                (found.confidence, found.covariance),
                (vehicle.confidence, vehicle.covariance)
            );
            let track = |vehicle: &PosedVehicle| vehicle.track.as_ref().map(|track| track.id);
            assert_eq!(track(found), track(vehicle));
        }
    }

    proptest! {
        #[test]
        fn damaged_json_is_read_or_refused(at in 0usize..500, byte in any::<u8>(), cut in 0usize..600) {
            let mut bytes = JSON.as_bytes().to_vec();
            let at = at % bytes.len();
            bytes[at] = byte;
            bytes.truncate(cut);
            let _ = parse_result(Path::new("a.json"), &bytes, &|_| String::new());
        }
    }
}
