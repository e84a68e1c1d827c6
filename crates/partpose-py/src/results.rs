//! Poses as the files that `partpose fit` writes, for `view`, `report`, `export` and `evaluate`.

use std::path::PathBuf;

use partpose::files;
use partpose::formats::{KittiRow, PosedImage, PosedVehicle, kitti_text, result_json};
use partpose::geometry::Vector3;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::camera::Camera;
use crate::estimator::{NoPose, PoseEstimate};
use crate::guard;

/// `STEM.json` and `STEM.txt` (KITTI's label text) of one image.
#[pyfunction]
pub(crate) fn write_results(
    py: Python<'_>,
    folder: PathBuf,
    image: String,
    camera: &Camera,
    poses: Vec<Bound<'_, PyAny>>,
) -> PyResult<()> {
    let stem = image.rsplit_once('.').map_or(image.as_str(), |(stem, _)| stem);
    let stem: Vec<&str> =
        stem.split(['/', '\\']).filter(|part| !matches!(*part, "" | "." | "..")).collect();
    if stem.is_empty() {
        let said = format!("`image` is `{image}`, but the name of an image is needed");
        return Err(PyValueError::new_err(said));
    }
    let stem = stem.join("_");
    let mut posed: Vec<PosedVehicle> = Vec::with_capacity(poses.len());
    for pose in &poses {
        match pose.cast::<PoseEstimate>() {
            Ok(pose) => posed.push(vehicle(pose.get())),
            Err(_) if pose.is_instance_of::<NoPose>() => {}
            Err(_) => {
                let said = format!(
                    "`poses` holds a {}, but what `fit` returns is needed",
                    pose.get_type()
                );
                return Err(PyTypeError::new_err(said));
            }
        }
    }
    let rows: Vec<KittiRow> = posed
        .iter()
        .map(|vehicle| KittiRow {
            category: vehicle.category.clone(),
            bounds: vehicle.bounds,
            cuboid: vehicle.cuboid,
            truncation: None,
            occluded: None,
            score: vehicle.score,
        })
        .collect();
    let result = PosedImage { image, camera: camera.inner, vehicles: posed };
    let written = guard::run(py, || {
        files::write(&folder.join(format!("{stem}.json")), result_json(&result).as_bytes())?;
        let text = kitti_text(&rows, &Vector3::zeros());
        files::write(&folder.join(format!("{stem}.txt")), text.as_bytes())
    })?;
    written.map_err(|error| guard::error(&error))
}

fn vehicle(pose: &PoseEstimate) -> PosedVehicle {
    PosedVehicle {
        model: pose.inner.model.clone(),
        category: pose.category.clone(),
        bounds: pose.bounds,
        score: pose.score,
        cuboid: pose.inner.cuboid(),
        confidence: pose.inner.dense.as_ref().map(|report| report.confidence),
        covariance: pose.inner.dense.as_ref().map(|report| report.covariance),
        reprojection_rmse: pose.inner.reprojection_rmse,
        track: None,
    }
}
