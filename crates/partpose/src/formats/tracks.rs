//! What following vehicles over a sequence needs of the results of its images, and what it adds to them.

use std::path::Path;

use nalgebra::Matrix6;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::geometry::Camera;
use crate::track::{Observation, Spread, TrackedPose};

use super::kitti::{KittiRow, row_text};
use super::results::{placed, rows};
use super::{ResultFileError, parse_result};

#[derive(Deserialize)]
struct ImageRecord {
    vehicles: Vec<VehicleRecord>,
}

#[derive(Deserialize)]
struct VehicleRecord {
    pose: Option<PoseRecord>,
}

#[derive(Deserialize)]
struct PoseRecord {
    dense: Option<DenseRecord>,
}

#[derive(Deserialize)]
struct DenseRecord {
    #[serde(default)]
    depth_and_size: SpreadRecord,
    #[serde(default)]
    model_probabilities: Vec<ModelRecord>,
}

/// Numbers that are not finite are written as `null`.
#[derive(Default, Deserialize)]
struct SpreadRecord {
    depth_sd: Option<f64>,
    depth_sd_if_size_known: Option<f64>,
}

#[derive(Deserialize)]
struct ModelRecord {
    model: String,
    probability: Option<f64>,
}

/// The camera of a result, and what it says of each of its vehicles that have a pose; `path` is for messages only.
pub fn observations(
    path: &Path,
    bytes: &[u8],
) -> Result<(Camera, Vec<Observation>), ResultFileError> {
    let posed = parse_result(path, bytes, &|_| String::new())?;
    let record: ImageRecord = serde_json::from_slice(bytes)
        .map_err(|source| ResultFileError::Json { path: path.to_owned(), source })?;
    let poses = record.vehicles.into_iter().filter_map(|vehicle| vehicle.pose);
    let seen = posed.vehicles.into_iter().zip(poses).map(|(vehicle, pose)| {
        let known = pose
            .dense
            .map(|dense| (spread(vehicle.covariance, &dense), models(dense.model_probabilities)));
        let (spread, models) = known.unzip();
        Observation {
            bounds: vehicle.bounds,
            score: vehicle.score,
            cuboid: vehicle.cuboid,
            spread: spread.flatten(),
            confidence: vehicle.confidence.unwrap_or(0.5),
            models: models
                .filter(|models| !models.is_empty())
                .unwrap_or_else(|| vec![(vehicle.model, 1.0)]),
        }
    });
    Ok((posed.camera, seen.collect()))
}

fn spread(covariance: Option<Matrix6<f64>>, dense: &DenseRecord) -> Option<Spread> {
    Some(Spread {
        covariance: covariance?,
        depth_sd: dense.depth_and_size.depth_sd?,
        depth_sd_if_size_known: dense.depth_and_size.depth_sd_if_size_known?,
    })
}

fn models(records: Vec<ModelRecord>) -> Vec<(String, f64)> {
    records.into_iter().map(|record| (record.model, record.probability.unwrap_or(0.0))).collect()
}

/// The result with the tracks of its vehicles that have a pose, in their order, in place of those it had.
pub fn with_tracks(
    path: &Path,
    bytes: &[u8],
    tracked: &[Option<TrackedPose>],
) -> Result<String, ResultFileError> {
    let wrong = |source| ResultFileError::Json { path: path.to_owned(), source };
    let mut result: Value = serde_json::from_slice(bytes).map_err(wrong)?;
    let vehicles = result.get_mut("vehicles").and_then(Value::as_array_mut);
    let posed = vehicles.into_iter().flatten().filter(|vehicle| vehicle.get("pose").is_some());
    for (vehicle, tracked) in posed.filter_map(Value::as_object_mut).zip(tracked) {
        vehicle.remove("track");
        if let Some(tracked) = tracked {
            vehicle.insert("track".to_owned(), track(tracked));
        }
    }
    serde_json::to_string_pretty(&result).map_err(wrong)
}

fn track(tracked: &TrackedPose) -> Value {
    let (translation, rotation) = placed(&tracked.cuboid.camera_from_vehicle);
    let three = |vector: &crate::geometry::Vector3| <[f64; 3]>::from(*vector);
    json!({
        "id": tracked.track,
        "sightings": tracked.sightings,
        "model": tracked.model,
        "translation": translation,
        "rotation": rotation,
        "extent": tracked.cuboid.extent,
        "covariance": rows(&tracked.covariance),
        "velocity": three(&tracked.velocity),
        "turn_rate": three(&tracked.turn_rate),
    })
}

/// A sequence's file in the format of KITTI's tracking benchmark, with scores: frame, track and vehicle.
pub fn kitti_tracking_text(rows: &[(u64, u32, KittiRow)]) -> String {
    let line = |(frame, track, row): &(u64, u32, KittiRow)| {
        format!("{frame} {track} {}", row_text(row, &crate::geometry::Vector3::zeros()))
    };
    rows.iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::super::read_results::tests::posed;
    use super::super::result_json;
    use super::*;
    use crate::track::{SequenceFrame, TrackOptions, smooth_sequence};

    /// A result whose first vehicle says how sure it is.
    fn result() -> Value {
        let mut result: Value = serde_json::from_str(&result_json(&posed())).unwrap();
        let covariance: Vec<Vec<f64>> =
            (0..9).map(|i| (0..9).map(|j| if i == j { 0.01 } else { 0.0 }).collect()).collect();
        result["vehicles"][0]["pose"]["dense"] = json!({
            "covariance": covariance,
            "depth_and_size": {"depth_sd": 0.3, "depth_sd_if_size_known": 0.2, "correlation": 0.5},
            "model_probabilities": [{"model": "van", "probability": 0.75}],
            "confidence": 0.9,
        });
        result["vehicles"].as_array_mut().unwrap().insert(
            0,
            json!({
                "bounds": [1, 2, 30, 40], "score": 0.5, "no_pose": "too few points",
            }),
        );
        result
    }

    fn read(result: &Value) -> Vec<Observation> {
        observations(Path::new("a.json"), result.to_string().as_bytes()).unwrap().1
    }

    #[test]
    fn what_a_fit_says_of_itself_is_read() {
        let mut result = result();
        let seen = read(&result);
        assert_eq!(seen.len(), 2);
        assert!((seen[0].spread.unwrap().covariance[(3, 3)] - 0.01).abs() < 1e-12);
        assert_eq!(
            (seen[0].models.as_slice(), seen[0].confidence),
            (&[("van".to_owned(), 0.75)][..], 0.9)
        );
        assert_eq!((&seen[1].spread, seen[1].models[0].1), (&None, 1.0));
        result["vehicles"][1]["pose"]["dense"]["covariance"][2][2] = Value::Null;
        assert_eq!(read(&result)[0].spread, None);
    }

    #[test]
    fn tracks_are_added_to_the_vehicles_that_have_a_pose_and_read_back() {
        let bytes = result().to_string().into_bytes();
        let path = Path::new("a.json");
        let (camera, seen) = observations(path, &bytes).unwrap();
        let frame = |time| SequenceFrame {
            time,
            camera,
            camera_from_previous: crate::geometry::Pose::identity(),
            seen: seen.clone(),
        };
        let options = TrackOptions { start_score: 0.6, ..TrackOptions::default() };
        let tracked = smooth_sequence(&[frame(0.0), frame(0.1)], &options);
        let text = with_tracks(path, &bytes, &tracked[1]).unwrap();
        let back = parse_result(path, text.as_bytes(), &|_| String::new()).unwrap();
        let track = back.vehicles[0].track.as_ref().unwrap();
        assert_eq!((track.id, track.model.as_str()), (1, "van"));
        assert!(track.cuboid.iou(&back.vehicles[0].cuboid) > 0.99);
        assert!(back.vehicles[1].track.is_none(), "its score is too low to begin with");
        // Another run takes the place of the first.
        let again = with_tracks(path, text.as_bytes(), &tracked[1]).unwrap();
        assert_eq!(again, text);
        let none = with_tracks(path, text.as_bytes(), &[None, None]).unwrap();
        assert!(!none.contains("track"));
    }
}
