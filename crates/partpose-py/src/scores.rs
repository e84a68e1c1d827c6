//! Scores: one pose against its truth, KITTI's and COCO's average precision.

use std::path::PathBuf;

use partpose::eval::coco::{CocoOverlap, read_coco, score_coco as coco};
use partpose::eval::kitti::{self, Curve, KittiDifficulty, KittiOptions, read_kitti};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::cuboid::Cuboid;
use crate::guard;

/// The deviation of a cuboid from the true one.
#[pyfunction]
pub(crate) fn pose_deviation<'py>(
    py: Python<'py>,
    predicted: &Cuboid,
    truth: &Cuboid,
) -> PyResult<Bound<'py, PyDict>> {
    let deviation = partpose::eval::pose_deviation(&predicted.inner, &truth.inner, false);
    let said = PyDict::new(py);
    said.set_item("iou3d", deviation.iou3d)?;
    said.set_item("translation", deviation.translation)?;
    said.set_item("rotation", deviation.rotation)?;
    said.set_item("distance", deviation.distance)?;
    said.set_item("angle", deviation.angle)?;
    Ok(said)
}

/// Class, metric, recall points, difficulty: percent, or None where no label counts.
#[pyfunction]
#[pyo3(signature = (labels, results, *, subset = false))]
pub(crate) fn score_kitti(
    py: Python<'_>,
    labels: PathBuf,
    results: PathBuf,
    subset: bool,
) -> PyResult<Bound<'_, PyDict>> {
    let scored = guard::run(py, || {
        let files = read_kitti(&labels, &results, subset)?;
        Ok(kitti::score_kitti(&files.frames, &KittiOptions::default()))
    })?;
    let scored = scored.map_err(|error: partpose::eval::InputError| guard::error(&error))?;
    let classes = PyDict::new(py);
    for scores in scored {
        let metrics = PyDict::new(py);
        let [image, birds_eye, volume] = &scores.curves;
        for (name, curves, orientation) in [
            ("2d", image, false),
            ("aos", image, true),
            ("bev", birds_eye, false),
            ("3d", volume, false),
        ] {
            let points = PyDict::new(py);
            points.set_item("R11", levels(py, curves, orientation, false)?)?;
            points.set_item("R40", levels(py, curves, orientation, true)?)?;
            metrics.set_item(name, points)?;
        }
        classes.set_item(scores.class.name(), metrics)?;
    }
    Ok(classes)
}

fn levels<'py>(
    py: Python<'py>,
    curves: &[Curve; 3],
    orientation: bool,
    forty: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let levels = PyDict::new(py);
    for (level, curve) in KittiDifficulty::ALL.iter().zip(curves) {
        let value = match (orientation, forty) {
            (false, false) => curve.r11(),
            (false, true) => curve.r40(),
            (true, false) => curve.orientation_r11(),
            (true, true) => curve.orientation_r40(),
        };
        levels.set_item(level.name, value)?;
    }
    Ok(levels)
}

/// COCO's twelve figures, 0 to 1; None where no label counts.
#[pyfunction]
#[pyo3(signature = (labels, results, *, overlap = "bbox"))]
pub(crate) fn score_coco<'py>(
    py: Python<'py>,
    labels: PathBuf,
    results: PathBuf,
    overlap: &str,
) -> PyResult<Bound<'py, PyDict>> {
    let measured = match overlap {
        "bbox" => CocoOverlap::Boxes,
        "segm" => CocoOverlap::Masks,
        other => {
            let said = format!("`overlap` is `{other}`, but `bbox` or `segm` is needed");
            return Err(PyValueError::new_err(said));
        }
    };
    let scored = guard::run(py, || {
        let set = read_coco(&labels, &results).map_err(|error| guard::error(&error))?;
        Ok(set.has(measured).then(|| coco(&set, measured)))
    })?;
    let scores = scored.and_then(|scores| {
        scores.ok_or_else(|| {
            let key = if overlap == "bbox" { "bbox" } else { "segmentation" };
            PyValueError::new_err(format!(
                "`overlap` is `{overlap}`, but some label or result has no `{key}`"
            ))
        })
    })?;
    let figures = PyDict::new(py);
    for (name, value) in scores.figures {
        figures.set_item(name, value)?;
    }
    Ok(figures)
}
