//! Detections: from Python's arrays, to Python's arrays, from label images, from files.

use std::path::PathBuf;

use numpy::ndarray::{Axis, Ix4};
use numpy::{IntoPyArray, PyArray4, PyArrayMethods, PyUntypedArrayMethods};
use partpose::detection::Detection;
use partpose::geometry::{Extent, Rect};
use partpose::oracle::detection_from_labels;
use partpose::parts::{CHANNELS, PartMask, PartProbabilities};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{self, Side, Wanted};
use crate::guard;

/// Largest kernel, as in files of detections.
const MAX_KERNEL: usize = 512;

/// How far the channels of a cell may be from summing to 1 on average.
const SUM_TOLERANCE: f32 = 0.05;

/// The rectangles of `[N, 4]` boxes whose first pixel is centred at 0, or begins there.
fn rectangles(boxes: &Bound<'_, PyAny>, pixel_origin: &str) -> PyResult<Vec<Rect>> {
    let shift = match pixel_origin {
        "center" => 0.0,
        "corner" => -0.5,
        other => {
            return Err(PyValueError::new_err(format!(
                "`pixel_origin` is `{other}`, but `center` or `corner` is needed"
            )));
        }
    };
    let said = "[N, 4], x_min, y_min, x_max, y_max of each,";
    let rectangle = |(index, row): (usize, &[f64; 4])| {
        let b = row.map(|value| value + shift);
        let rect = Rect::new(b[0], b[1], b[2], b[3]);
        let sensible = b.iter().all(|value| value.abs() < 1e6);
        if sensible && rect.width() > 0.0 && rect.height() > 0.0 {
            return Ok(rect);
        }
        Err(PyValueError::new_err(format!(
            "`boxes`: box {index} is {row:?}, but x_min, y_min, x_max, y_max with an area is needed"
        )))
    };
    arrays::rows::<4>("boxes", said, boxes)?.iter().enumerate().map(rectangle).collect()
}

/// Boxes `[N, 4]`, scores `[N]` and part probabilities `[N, 30, m, m]` as detections.
pub(crate) fn read(
    boxes: &Bound<'_, PyAny>,
    scores: &Bound<'_, PyAny>,
    probabilities: &Bound<'_, PyAny>,
    pixel_origin: &str,
) -> PyResult<Vec<Detection>> {
    let bounds = rectangles(boxes, pixel_origin)?;
    let scores = arrays::numbers("scores", scores)?;
    let said = format!("[{}, {CHANNELS}, m, m]", bounds.len());
    let sides = [Side::Any, Side::Is(CHANNELS), Side::Any, Side::Any];
    let wanted = Wanted { name: "part_probabilities", sides: &sides, said: &said };
    let probabilities = wanted.read::<f32>(probabilities)?;
    let shape = probabilities.shape();
    let m = shape.last().copied().unwrap_or(0);
    if scores.len() != bounds.len() {
        let said = format!("`boxes` has {} boxes, but `scores` {}", bounds.len(), scores.len());
        return Err(PyValueError::new_err(said));
    }
    if shape.first() != Some(&bounds.len())
        || !bounds.is_empty() && (shape.get(2) != Some(&m) || !(1..=MAX_KERNEL).contains(&m))
    {
        return Err(PyValueError::new_err(format!(
            "`part_probabilities` has the shape {shape:?}, but {said} with m from 1 to {MAX_KERNEL} is needed"
        )));
    }
    let view = arrays::view(&probabilities, Ix4(0, CHANNELS, 1, 1));
    let one = |(index, bounds)| {
        let score = scores[index];
        if !(0.0..=1.0).contains(&score) {
            return Err(PyValueError::new_err(format!(
                "`scores`: that of detection {index} is {score}, but 0 to 1 is needed"
            )));
        }
        let kernel = view.index_axis(Axis(0), index);
        let slices = || kernel.iter().copied().collect();
        let values: Vec<f32> = kernel.as_slice().map_or_else(slices, <[f32]>::to_vec);
        check_sums(index, &values, m)?;
        let probabilities = PartProbabilities::new(m, values).map_err(|error| {
            let said = format!("`part_probabilities`: detection {index}: {error}");
            PyValueError::new_err(said)
        })?;
        Ok(Detection::new(bounds, score, probabilities))
    };
    bounds.into_iter().enumerate().map(one).collect()
}

/// Sigmoids and logits look like probabilities one by one; their sums tell.
fn check_sums(index: usize, values: &[f32], m: usize) -> PyResult<()> {
    // Sums that do not wait for each other.
    let mut sums = [0.0f32; 16];
    for chunk in values.chunks(sums.len()) {
        for (sum, value) in sums.iter_mut().zip(chunk) {
            *sum += value;
        }
    }
    let mean = sums.iter().sum::<f32>() / (m * m) as f32;
    // Values that are no numbers are named one by one.
    if mean.is_nan() || (mean - 1.0).abs() <= SUM_TOLERANCE {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "`part_probabilities`: detection {index}: the {CHANNELS} channels of a cell sum to {mean:.3} on average, not \
         to 1; take the soft-max over them"
    )))
}

/// Detections as arrays under the names of the arguments of `fit`.
pub(crate) fn as_arrays<'py>(
    py: Python<'py>,
    detections: &[&Detection],
    extents: Option<&[Extent]>,
) -> PyResult<Bound<'py, PyDict>> {
    let count = detections.len();
    // All kernels of a network, and of a file, are of one size.
    let m = detections.first().map_or(1, |one| one.probabilities.size());
    let boxes: Vec<f64> = detections
        .iter()
        .flat_map(|one| {
            let b = &one.bounds;
            [b.x_min, b.y_min, b.x_max, b.y_max]
        })
        .collect();
    let scores: Vec<f64> = detections.iter().map(|one| one.score).collect();
    let probabilities: Vec<f32> =
        detections.iter().flat_map(|one| one.probabilities.values().iter().copied()).collect();
    let found = PyDict::new(py);
    found.set_item("boxes", boxes.into_pyarray(py).reshape([count, 4])?)?;
    found.set_item("scores", scores.into_pyarray(py))?;
    let probabilities = probabilities.into_pyarray(py).reshape([count, CHANNELS, m, m])?;
    found.set_item("part_probabilities", probabilities)?;
    if let Some(extents) = extents {
        let sides: Vec<f64> = extents.iter().flat_map(|e| [e.width, e.height, e.length]).collect();
        found.set_item("extents", sides.into_pyarray(py).reshape([count, 3])?)?;
    }
    Ok(found)
}

/// `[N, 30, size, size]` shares of the cells of each box.
#[pyfunction]
#[pyo3(signature = (labels, boxes, size = 28, *, pixel_origin = "center"))]
pub(crate) fn probabilities_from_labels<'py>(
    py: Python<'py>,
    labels: &Bound<'py, PyAny>,
    boxes: &Bound<'py, PyAny>,
    size: i64,
    pixel_origin: &str,
) -> PyResult<Bound<'py, PyArray4<f32>>> {
    let m =
        usize::try_from(size).ok().filter(|m| (1..=MAX_KERNEL).contains(m)).ok_or_else(|| {
            let said = format!("`size` is {size}, but 1 to {MAX_KERNEL} cells a side are needed");
            PyValueError::new_err(said)
        })?;
    let boxes = rectangles(boxes, pixel_origin)?;
    let (size, labels) = arrays::labels("labels", labels)?;
    let mask = PartMask { origin: [0, 0], size, labels };
    let count = boxes.len();
    let values: Vec<f32> = guard::run(py, || {
        let one = |bounds: &Rect| detection_from_labels(&mask, bounds, m).probabilities;
        boxes.iter().flat_map(|bounds| one(bounds).values().to_vec()).collect()
    })?;
    values.into_pyarray(py).reshape([count, CHANNELS, m, m])
}

/// A file of detections as arrays: `images`, then the arguments of `fit`.
#[pyfunction]
pub(crate) fn read_detections(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let read = guard::run(py, || partpose::formats::read_detections(&path))?;
    let file = read.map_err(|error| guard::error(&error))?;
    let detections: Vec<&Detection> = file.detections.iter().map(|(_, one)| one).collect();
    // Sizes are told where all have them.
    let extents: Option<Vec<Extent>> =
        detections.iter().map(|one| Some(one.size?.extent)).collect();
    let extents = extents.filter(|extents| !extents.is_empty());
    let found = as_arrays(py, &detections, extents.as_deref())?;
    found.set_item("images", &file.images)?;
    let image: Vec<i64> = file.detections.iter().map(|(image, _)| *image as i64).collect();
    found.set_item("image", image.into_pyarray(py))?;
    Ok(found)
}
