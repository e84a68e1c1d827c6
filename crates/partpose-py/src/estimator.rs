//! Poses of anyone's detections.

use std::sync::Arc;

use nalgebra::Vector3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use partpose::detection::Detection;
use partpose::geometry::Rect;
use partpose::pose::dense::{GravityPrior, SizePrior};
use partpose::pose::ground::GroundOptions;
use partpose::pose::scene::{SceneDetection, SceneOptions, estimate_scene};
use partpose::pose::{ExtentSource, PoseOptions, reasons};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;

use crate::camera::Camera;
use crate::cuboid::{self, Cuboid, checked_extent};
use crate::zoo::ModelZoo;
use crate::{arrays, detections, guard};

/// How well a given height of the camera is known, as a share of it; as on the command line.
const HEIGHT_SIGMA: f64 = 0.01;
/// How well a given direction of gravity is known, radians; as on the command line.
const GRAVITY_SIGMA: f64 = 0.005;

/// Fits the models of a zoo to detections.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct PoseEstimator {
    inner: partpose::pose::PoseEstimator,
    zoo: Arc<partpose::vehicle::ModelZoo>,
}

/// The pose of one detection.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct PoseEstimate {
    pub(crate) inner: partpose::pose::PoseEstimate,
    pub(crate) category: String,
    pub(crate) bounds: Rect,
    #[pyo3(get)]
    pub(crate) score: f64,
    #[pyo3(get)]
    reasons: Vec<String>,
    /// By name, where the fit weighs models.
    model_probabilities: Option<Vec<(String, f64)>>,
}

/// Why a detection has no pose; false as a truth value.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct NoPose {
    bounds: Rect,
    #[pyo3(get)]
    score: f64,
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
    #[pyo3(signature = (zoo = None, method = "dense", options = None))]
    fn new(
        py: Python<'_>,
        zoo: Option<&ModelZoo>,
        method: &str,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let text = match options {
            Some(options) => {
                py.import("json")?.call_method1("dumps", (options,))?.extract::<String>()?
            }
            None => "{}".to_owned(),
        };
        let mut options: PoseOptions = serde_json::from_str(&text)
            .map_err(|error| PyValueError::new_err(format!("`options`: {error}")))?;
        let method = serde_json::Value::String(method.to_owned());
        options.method = serde_json::from_value(method)
            .map_err(|error| PyValueError::new_err(format!("`method`: {error}")))?;
        let zoo = zoo.map(|zoo| zoo.inner.clone());
        guard::run(py, || {
            let zoo = zoo.unwrap_or_else(|| Arc::new(partpose::vehicle::ModelZoo::embedded()));
            Self { inner: partpose::pose::PoseEstimator::new(&zoo, &options), zoo }
        })
    }

    #[getter]
    fn zoo(&self) -> ModelZoo {
        ModelZoo { inner: self.zoo.clone() }
    }

    #[pyo3(signature = (
        camera, boxes, scores, part_probabilities, extents = None, image = None, *, pixel_origin = "center",
        alone = false, ground = false, camera_height = None, gravity = None
    ))]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn fit(
        &self,
        py: Python<'_>,
        camera: &Camera,
        boxes: &Bound<'_, PyAny>,
        scores: &Bound<'_, PyAny>,
        part_probabilities: &Bound<'_, PyAny>,
        extents: Option<&Bound<'_, PyAny>>,
        image: Option<&Bound<'_, PyAny>>,
        pixel_origin: &str,
        alone: bool,
        ground: bool,
        camera_height: Option<f64>,
        gravity: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Outcome>> {
        let detections = detections::read(boxes, scores, part_probabilities, pixel_origin)?;
        let extents = extent_sources(extents, detections.len())?;
        let images = images(image, detections.len())?;
        let options = scene_options(alone, ground, camera_height, gravity)?;
        guard::run(py, || self.fit_images(camera, &detections, &extents, &images, &options))
    }

    /// `fit`, and the seconds of it that were Rust's alone, once the arrays had become its own types.
    fn _fit_and_seconds(
        &self,
        py: Python<'_>,
        camera: &Camera,
        boxes: &Bound<'_, PyAny>,
        scores: &Bound<'_, PyAny>,
        part_probabilities: &Bound<'_, PyAny>,
    ) -> PyResult<(Vec<Outcome>, f64)> {
        let detections = detections::read(boxes, scores, part_probabilities, "center")?;
        let extents = extent_sources(None, detections.len())?;
        let images = images(None, detections.len())?;
        let options = scene_options(false, false, None, None)?;
        guard::run(py, || {
            let start = std::time::Instant::now();
            let found = self.fit_images(camera, &detections, &extents, &images, &options);
            (found, start.elapsed().as_secs_f64())
        })
    }
}

impl PoseEstimator {
    /// Each image by itself, as `partpose fit` does; detections that need not know of each other are images too.
    fn fit_images(
        &self,
        camera: &Camera,
        detections: &[Detection],
        extents: &[ExtentSource],
        images: &[Vec<usize>],
        options: &SceneOptions,
    ) -> Vec<Outcome> {
        let is_scene = options.occlusion || options.ground.is_some();
        let single: Vec<Vec<usize>>;
        let groups = if is_scene {
            images
        } else {
            single = (0..detections.len()).map(|index| vec![index]).collect();
            &single
        };
        let fitted = groups.par_iter().flat_map_iter(|group| {
            let given: Vec<SceneDetection> = group
                .iter()
                .map(|index| SceneDetection {
                    detection: &detections[*index],
                    extent: extents[*index],
                })
                .collect();
            let found = estimate_scene(&self.inner, &self.zoo, &camera.inner, &given, options);
            group.iter().copied().zip(found.vehicles).collect::<Vec<_>>()
        });
        let mut fitted: Vec<_> = fitted.collect();
        fitted.sort_by_key(|(index, _)| *index);
        fitted.into_iter().map(|(index, found)| self.outcome(&detections[index], found)).collect()
    }

    fn outcome(
        &self,
        detection: &Detection,
        found: Result<partpose::pose::PoseEstimate, partpose::pose::NoPose>,
    ) -> Outcome {
        let (bounds, score) = (detection.bounds, detection.score);
        let said = reasons(&found).into_iter().map(|reason| reason.words).collect();
        match found {
            Ok(inner) => {
                let models = &self.zoo.models;
                let category = models.get(inner.model_index).map_or("Car", |m| m.category());
                let model_probabilities = inner.dense.as_ref().map(|report| {
                    let names = models.iter().map(|model| model.name().to_owned());
                    names.zip(report.model_probabilities.iter().copied()).collect()
                });
                let category = category.to_owned();
                let reasons = said;
                Outcome::Pose(PoseEstimate {
                    inner,
                    category,
                    bounds,
                    score,
                    reasons,
                    model_probabilities,
                })
            }
            Err(reason) => Outcome::None(NoPose { bounds, score, reason: reason.to_string() }),
        }
    }
}

/// None: the models' sizes; "free": stretched by the mask; `[3]` or `[N, 3]`: width, height, length.
fn extent_sources(given: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<ExtentSource>> {
    let Some(given) = given else { return Ok(vec![ExtentSource::Model; count]) };
    if let Ok(word) = given.extract::<String>() {
        if word == "free" {
            return Ok(vec![ExtentSource::Free(SizePrior::around(None)); count]);
        }
        return Err(PyValueError::new_err(format!(
            "`extents` is `{word}`, but `free`, or [3] or [N, 3] numbers are needed"
        )));
    }
    if let Ok(one) = given.extract::<[f64; 3]>() {
        return Ok(vec![ExtentSource::Given(checked_extent("extents", one)?); count]);
    }
    let said = "[3] or [N, 3], width, height, length in metres,";
    let all = arrays::rows::<3>("extents", said, given)?;
    if all.len() != count {
        let said = format!("`boxes` has {count} boxes, but `extents` {}", all.len());
        return Err(PyValueError::new_err(said));
    }
    all.into_iter().map(|one| Ok(ExtentSource::Given(checked_extent("extents", one)?))).collect()
}

/// The detections of each image; all are of one where `given` is None.
fn images(given: Option<&Bound<'_, PyAny>>, count: usize) -> PyResult<Vec<Vec<usize>>> {
    let Some(given) = given else { return Ok(vec![(0..count).collect()]) };
    let wanted =
        arrays::Wanted { name: "image", sides: &[arrays::Side::Any], said: "[N] of whole numbers" };
    let array = wanted.read::<i64>(given)?;
    let numbers: Vec<i64> = array.as_array().iter().copied().collect();
    if numbers.len() != count {
        let said = format!("`boxes` has {count} boxes, but `image` {} numbers", numbers.len());
        return Err(PyValueError::new_err(said));
    }
    let mut groups: std::collections::BTreeMap<i64, Vec<usize>> = std::collections::BTreeMap::new();
    for (index, number) in numbers.into_iter().enumerate() {
        groups.entry(number).or_default().push(index);
    }
    Ok(groups.into_values().collect())
}

fn scene_options(
    alone: bool,
    ground: bool,
    camera_height: Option<f64>,
    gravity: Option<&Bound<'_, PyAny>>,
) -> PyResult<SceneOptions> {
    if let Some(height) = camera_height.filter(|height| !(0.1..=20.0).contains(height) || !ground) {
        return Err(PyValueError::new_err(format!(
            "`camera_height` is {height}, but it needs `ground=True` and 0.1 to 20 metres"
        )));
    }
    let said = "[3], the direction down in the camera frame,";
    let gravity = match gravity {
        Some(given) => {
            let [x, y, z] = arrays::triple("gravity", said, given)?;
            let down = Vector3::new(x, y, z).try_normalize(1e-6);
            let down_in_camera = down.filter(|down| down.iter().all(|value| value.is_finite()));
            let down_in_camera = down_in_camera.ok_or_else(|| {
                PyValueError::new_err(format!("`gravity` is {:?}, but {said} is needed", [x, y, z]))
            })?;
            Some(GravityPrior { down_in_camera, sigma: GRAVITY_SIGMA })
        }
        None => None,
    };
    let camera_height = camera_height.map(|height| [height, HEIGHT_SIGMA]);
    Ok(SceneOptions {
        occlusion: !alone,
        gravity,
        ground: ground.then(|| GroundOptions { camera_height, ..GroundOptions::default() }),
    })
}

#[pymethods]
impl PoseEstimate {
    #[getter]
    fn model(&self) -> &str {
        &self.inner.model
    }

    #[getter]
    fn category(&self) -> &str {
        &self.category
    }

    #[getter]
    fn bounds(&self) -> (f64, f64, f64, f64) {
        corners(&self.bounds)
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
    fn extent(&self) -> (f64, f64, f64) {
        cuboid::sides(&self.inner.extent)
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
    fn model_probabilities<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let Some(probabilities) = &self.model_probabilities else { return Ok(None) };
        let by_name = PyDict::new(py);
        for (name, probability) in probabilities {
            by_name.set_item(name, probability)?;
        }
        Ok(Some(by_name))
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
    #[getter]
    fn bounds(&self) -> (f64, f64, f64, f64) {
        corners(&self.bounds)
    }

    #[allow(clippy::unused_self)]
    fn __bool__(&self) -> bool {
        false
    }

    fn __repr__(&self) -> String {
        format!("<NoPose: {}>", self.reason)
    }
}

fn corners(bounds: &Rect) -> (f64, f64, f64, f64) {
    (bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max)
}
