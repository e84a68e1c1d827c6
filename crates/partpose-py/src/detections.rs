//! Part probabilities from label images, and files of detections.

use std::path::PathBuf;

use numpy::{AllowTypeChange, IntoPyArray, PyArray4, PyArrayLike2, PyArrayMethods};
use partpose::geometry::Rect;
use partpose::oracle::detection_from_labels;
use partpose::parts::{CHANNELS, PartClass, PartMask};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::guard;

/// Largest kernel, as in files of detections.
pub(crate) const MAX_KERNEL: usize = 512;

/// The rectangles of `[N, 4]` boxes whose first pixel is centred at 0, or begins there.
pub(crate) fn rectangles(
    boxes: &PyArrayLike2<'_, f64, AllowTypeChange>,
    pixel_origin: &str,
) -> PyResult<Vec<Rect>> {
    let shift = match pixel_origin {
        "center" => 0.0,
        "corner" => -0.5,
        other => {
            let said = format!("`pixel_origin` is `{other}`; `center` or `corner` is meant");
            return Err(PyValueError::new_err(said));
        }
    };
    let boxes = boxes.as_array();
    // A list without boxes has no second side.
    if boxes.nrows() > 0 && boxes.ncols() != 4 {
        let said = format!("boxes have the shape {:?}, but [N, 4] is needed", boxes.shape());
        return Err(PyValueError::new_err(said));
    }
    let rectangle = |(index, row): (usize, numpy::ndarray::ArrayView1<'_, f64>)| {
        let b: [f64; 4] = std::array::from_fn(|i| row[i] + shift);
        let rect = Rect::new(b[0], b[1], b[2], b[3]);
        let sensible = b.iter().all(|value| value.abs() < 1e6);
        if sensible && rect.width() > 0.0 && rect.height() > 0.0 {
            return Ok(rect);
        }
        let said = format!("box {index} is {row}: x_min, y_min, x_max, y_max is meant");
        Err(PyValueError::new_err(said))
    };
    boxes.rows().into_iter().enumerate().map(rectangle).collect()
}

/// `[N, 30, size, size]` shares of the cells of each box.
#[pyfunction]
#[pyo3(signature = (labels, boxes, size = 28, pixel_origin = "center"))]
pub(crate) fn probabilities_from_labels<'py>(
    py: Python<'py>,
    labels: PyArrayLike2<'py, u8, AllowTypeChange>,
    boxes: PyArrayLike2<'py, f64, AllowTypeChange>,
    size: usize,
    pixel_origin: &str,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    if !(1..=MAX_KERNEL).contains(&size) {
        return Err(PyValueError::new_err(format!("`size` must be 1 to {MAX_KERNEL}")));
    }
    let boxes = rectangles(&boxes, pixel_origin)?;
    let labels = labels.as_array();
    if let Some(label) = labels.iter().find(|label| usize::from(**label) > PartClass::COUNT) {
        return Err(PyValueError::new_err(format!("the label {label} is no part; 0 to 29 are")));
    }
    let (height, width) = (labels.nrows(), labels.ncols());
    let limit = partpose::files::MAX_IMAGE_SIDE as usize;
    if height == 0 || width == 0 || height > limit || width > limit {
        return Err(PyValueError::new_err(format!("labels have {width} x {height} pixels")));
    }
    let mask = PartMask {
        origin: [0, 0],
        size: [width as u32, height as u32],
        labels: labels.iter().copied().collect(),
    };
    let count = boxes.len();
    let values: Vec<f32> = guard::run(py, || {
        let one = |bounds: &Rect| detection_from_labels(&mask, bounds, size).probabilities;
        boxes.iter().flat_map(|bounds| one(bounds).values().to_vec()).collect()
    })?;
    values.into_pyarray(py).reshape([count, CHANNELS, size, size])
}

/// A file of detections as arrays.
#[pyfunction]
pub(crate) fn read_detections(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = guard::run(py, || partpose::formats::read_detections(&path))?;
    let file = read.map_err(|error| guard::error(&error))?;
    let count = file.detections.len();
    let size = file.detections.first().map_or(1, |(_, one)| one.probabilities.size());
    let all = || file.detections.iter().map(|(_, one)| one);
    let boxes: Vec<f64> = all()
        .flat_map(|one| {
            let b = &one.bounds;
            [b.x_min, b.y_min, b.x_max, b.y_max]
        })
        .collect();
    let probabilities: Vec<f32> =
        all().flat_map(|one| one.probabilities.values().iter().copied()).collect();
    let found = PyDict::new(py);
    found.set_item("images", &file.images)?;
    let image: Vec<i64> = file.detections.iter().map(|(image, _)| *image as i64).collect();
    found.set_item("image", image.into_pyarray(py))?;
    found.set_item("boxes", boxes.into_pyarray(py).reshape([count, 4])?)?;
    found.set_item("scores", all().map(|one| one.score).collect::<Vec<f64>>().into_pyarray(py))?;
    let shape = [count, CHANNELS, size, size];
    found.set_item("part_probabilities", probabilities.into_pyarray(py).reshape(shape)?)?;
    if let Some(extents) = &file.extents {
        let sides: Vec<f64> = extents.iter().flat_map(|e| [e.width, e.height, e.length]).collect();
        found.set_item("extents", sides.into_pyarray(py).reshape([count, 3])?)?;
    }
    Ok(found)
}
