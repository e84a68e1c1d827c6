//! Poses of anyone's detections.

use numpy::{
    AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArrayLike1, PyArrayLike2, PyArrayLike4,
    PyArrayMethods,
};
use partpose::detection::Detection;
use partpose::geometry::Extent;
use partpose::parts::{CHANNELS, PartProbabilities};
use partpose::pose::dense::SizePrior;
use partpose::pose::{ExtentSource, PoseOptions};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::cuboid::{self, Cuboid, checked_extent};
use crate::detections::{MAX_KERNEL, rectangles};
use crate::guard;
use crate::zoo::ModelZoo;

/// Fits the models of a zoo to detections.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct PoseEstimator {
    inner: partpose::pose::PoseEstimator,
}

/// The pose of one detection.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct PoseEstimate {
    inner: partpose::pose::PoseEstimate,
}

/// Why a detection has no pose; false as a truth value.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct NoPose {
    #[pyo3(get)]
    reason: String,
}

/// What a detection gives: a pose or a reason.
#[derive(IntoPyObject)]
#[allow(clippy::large_enum_variant)]
pub(crate) enum Outcome {
    Pose(PoseEstimate),
    None(NoPose),
}

#[pymethods]
impl PoseEstimator {
    #[new]
    #[pyo3(signature = (zoo, method = "dense", options = None))]
    fn new(
        py: Python<'_>,
        zoo: &ModelZoo,
        method: &str,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let text = match options {
            Some(options) => {
                py.import("json")?.call_method1("dumps", (options,))?.extract::<String>()?
            }
            None => "{}".to_owned(),
        };
        let wrong = |error: serde_json::Error| PyValueError::new_err(format!("options: {error}"));
        let mut options: PoseOptions = serde_json::from_str(&text).map_err(wrong)?;
        let method = serde_json::Value::String(method.to_owned());
        options.method = serde_json::from_value(method)
            .map_err(|error| PyValueError::new_err(format!("method: {error}")))?;
        let inner = guard::run(py, || partpose::pose::PoseEstimator::new(&zoo.inner, &options))?;
        Ok(Self { inner })
    }

    #[pyo3(signature = (camera, boxes, scores, part_probabilities, extents = None, pixel_origin = "center"))]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn fit(
        &self,
        py: Python<'_>,
        camera: &Camera,
        boxes: PyArrayLike2<'_, f64, AllowTypeChange>,
        scores: PyArrayLike1<'_, f64, AllowTypeChange>,
        part_probabilities: PyArrayLike4<'_, f32, AllowTypeChange>,
        extents: Option<Bound<'_, PyAny>>,
        pixel_origin: &str,
    ) -> PyResult<Vec<Outcome>> {
        let detections = detections(&boxes, &scores, &part_probabilities, pixel_origin)?;
        let extents = extent_sources(extents.as_ref(), detections.len())?;
        let camera = camera.inner;
        let found: Vec<_> = guard::run(py, || {
            let pairs = detections.par_iter().zip(&extents);
            pairs.map(|(one, extent)| self.inner.estimate(&camera, one, extent)).collect()
        })?;
        let outcome = |one: Result<partpose::pose::PoseEstimate, partpose::pose::NoPose>| match one
        {
            Ok(inner) => Outcome::Pose(PoseEstimate { inner }),
            Err(reason) => Outcome::None(NoPose { reason: reason.to_string() }),
        };
        Ok(found.into_iter().map(outcome).collect())
    }
}

fn detections(
    boxes: &PyArrayLike2<'_, f64, AllowTypeChange>,
    scores: &PyArrayLike1<'_, f64, AllowTypeChange>,
    probabilities: &PyArrayLike4<'_, f32, AllowTypeChange>,
    pixel_origin: &str,
) -> PyResult<Vec<Detection>> {
    let bounds = rectangles(boxes, pixel_origin)?;
    let (scores, probabilities) = (scores.as_array(), probabilities.as_array());
    let count = bounds.len();
    let shape = probabilities.shape();
    let m = shape[3];
    if scores.len() != count {
        let said = format!("{count} boxes, but {} scores", scores.len());
        return Err(PyValueError::new_err(said));
    }
    if count > 0 && (shape != [count, CHANNELS, m, m] || !(1..=MAX_KERNEL).contains(&m)) {
        let said = format!(
            "part_probabilities have the shape {shape:?}, but [{count}, {CHANNELS}, m, m] is needed"
        );
        return Err(PyValueError::new_err(said));
    }
    let one = |(index, bounds)| {
        let score = scores[index];
        if !(0.0..=1.0).contains(&score) {
            let said = format!("detection {index} has the score {score}, which is not 0 to 1");
            return Err(PyValueError::new_err(said));
        }
        let kernel = probabilities.index_axis(numpy::ndarray::Axis(0), index);
        let values: Vec<f32> = kernel.iter().copied().collect();
        check_sums(index, &values, m)?;
        let probabilities = PartProbabilities::new(m, values)
            .map_err(|error| PyValueError::new_err(format!("detection {index}: {error}")))?;
        Ok(Detection { bounds, score, probabilities, unknown: None })
    };
    bounds.into_iter().enumerate().map(one).collect()
}

/// Sigmoids and logits look like probabilities one by one; their sums tell.
fn check_sums(index: usize, values: &[f32], m: usize) -> PyResult<()> {
    let sum: f32 = values.iter().sum();
    let mean = sum / (m * m) as f32;
    // Values that are no numbers are named one by one.
    if mean.is_nan() || (mean - 1.0).abs() <= 0.05 {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "detection {index}: the 30 channels of a cell sum to {mean:.3} on average, not to 1; take the soft-max over them"
    )))
}

/// None: the models' sizes; "free": stretched by the mask; `[3]` or `[N, 3]`: width, height, length.
fn extent_sources(given: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<ExtentSource>> {
    let Some(given) = given else { return Ok(vec![ExtentSource::Model; count]) };
    if let Ok(word) = given.extract::<String>() {
        if word == "free" {
            return Ok(vec![ExtentSource::Free(SizePrior::around(None)); count]);
        }
        let said = format!("extents is `{word}`; `free`, [3] or [N, 3] numbers are meant");
        return Err(PyValueError::new_err(said));
    }
    if let Ok(one) = given.extract::<[f64; 3]>() {
        return Ok(vec![ExtentSource::Given(checked_extent(one)?); count]);
    }
    let all: Vec<[f64; 3]> = given.extract()?;
    if all.len() != count {
        let said = format!("{count} boxes, but {} extents", all.len());
        return Err(PyValueError::new_err(said));
    }
    all.into_iter().map(|one| Ok(ExtentSource::Given(checked_extent(one)?))).collect()
}

#[pymethods]
impl PoseEstimate {
    #[getter]
    fn model(&self) -> &str {
        &self.inner.model
    }

    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        cuboid::translation(py, &self.inner.camera_from_vehicle)
    }

    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        cuboid::rotation(py, &self.inner.camera_from_vehicle)
    }

    #[getter]
    fn extent(&self) -> [f64; 3] {
        let Extent { width, height, length } = self.inner.extent;
        [width, height, length]
    }

    #[getter]
    fn cuboid(&self) -> Cuboid {
        Cuboid { inner: self.inner.cuboid() }
    }

    #[getter]
    fn reprojection_rmse(&self) -> Option<f64> {
        self.inner.reprojection_rmse
    }

    #[getter]
    fn confidence(&self) -> Option<f64> {
        self.inner.dense.as_ref().map(|report| report.confidence)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(report) = &self.inner.dense else { return Ok(None) };
        let values: Vec<f64> = (0..36).map(|i| report.covariance[(i / 6, i % 6)]).collect();
        values.into_pyarray(py).reshape([6, 6]).map(Some)
    }

    fn __repr__(&self) -> String {
        let place = &self.inner.camera_from_vehicle.translation;
        let model = &self.inner.model;
        format!("<PoseEstimate {model} at ({:.2}, {:.2}, {:.2}) m>", place.x, place.y, place.z)
    }
}

#[pymethods]
impl NoPose {
    #[allow(clippy::unused_self)]
    fn __bool__(&self) -> bool {
        false
    }

    fn __repr__(&self) -> String {
        format!("<NoPose: {}>", self.reason)
    }
}
