//! Data sets: their frames, cameras and labelled vehicles.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use partpose::dataset::{DatasetOptions, SequenceId};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::camera::Camera;
use crate::cuboid::Cuboid;
use crate::guard;

/// A folder in a known layout.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct Dataset {
    pub(crate) inner: partpose::dataset::Dataset,
}

/// One image with its camera and its labels.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct Frame {
    pub(crate) inner: partpose::dataset::Frame,
}

#[pymethods]
impl Dataset {
    #[new]
    #[pyo3(signature = (path, *, camera = 0))]
    fn new(py: Python<'_>, path: PathBuf, camera: u32) -> PyResult<Self> {
        let options = DatasetOptions { camera };
        let opened = guard::run(py, || partpose::dataset::Dataset::open_with(&path, options))?;
        Ok(Self { inner: opened.map_err(|error| guard::error(&error))? })
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.inner.root().to_owned()
    }

    #[getter]
    fn layout(&self) -> String {
        self.inner.layout().to_string()
    }

    #[getter]
    fn sequences(&self) -> Vec<String> {
        self.inner.sequences().iter().map(ToString::to_string).collect()
    }

    /// The good frames of some sequences, in order; what is wrong with the others `partpose dataset check` tells.
    #[pyo3(signature = (sequences = None))]
    fn frames(&self, py: Python<'_>, sequences: Option<Vec<String>>) -> PyResult<Vec<Frame>> {
        let chosen = self.chosen(sequences.as_deref())?;
        let read = guard::run(py, || {
            let mut frames = Vec::new();
            for id in &chosen {
                frames.extend(self.inner.frames(id)?);
            }
            Ok(frames)
        })?;
        let frames = read.map_err(|error: partpose::dataset::DatasetError| guard::error(&error))?;
        Ok(frames.into_iter().map(|inner| Frame { inner }).collect())
    }

    fn __repr__(&self) -> String {
        let (path, count) = (self.inner.root().display(), self.inner.sequences().len());
        format!("<Dataset {} in `{path}`, {count} sequences>", self.inner.layout())
    }
}

impl Dataset {
    /// Sequences by their names; all without names.
    pub(crate) fn chosen(&self, names: Option<&[String]>) -> PyResult<Vec<SequenceId>> {
        let all = self.inner.sequences();
        let Some(names) = names else { return Ok(all.to_vec()) };
        let one = |name: &String| {
            all.iter().find(|id| id.to_string() == *name).cloned().ok_or_else(|| {
                let known = self.sequences().join(", ");
                PyValueError::new_err(format!(
                    "`sequences`: there is no `{name}`; there are {known}"
                ))
            })
        };
        names.iter().map(one).collect()
    }
}

#[pymethods]
impl Frame {
    /// World, variation and index.
    #[getter]
    fn name(&self) -> String {
        self.inner.name()
    }

    #[getter]
    fn sequence(&self) -> String {
        self.inner.sequence.to_string()
    }

    #[getter]
    fn index(&self) -> u32 {
        self.inner.index
    }

    #[getter]
    fn camera(&self) -> Camera {
        Camera { inner: self.inner.camera }
    }

    /// Path of the photograph, where there is one.
    #[getter]
    fn image(&self) -> Option<String> {
        self.inner.image.as_ref().map(|path| path.display().to_string())
    }

    /// What is labelled.
    #[getter]
    fn vehicles<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let vehicle = |vehicle: &partpose::dataset::VehicleLabel| {
            let said = PyDict::new(py);
            let b = &vehicle.bounds;
            said.set_item("track", vehicle.track)?;
            said.set_item("category", &vehicle.category)?;
            said.set_item("model", &vehicle.model)?;
            said.set_item("dont_care", vehicle.dont_care)?;
            said.set_item("bounds", (b.x_min, b.y_min, b.x_max, b.y_max))?;
            said.set_item("cuboid", Cuboid { inner: vehicle.cuboid })?;
            Ok(said)
        };
        self.inner.vehicles.iter().map(vehicle).collect()
    }

    /// The part mask `[H, W]`; None where the data set has none.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<u8>>>> {
        if self.inner.parts.is_none() {
            return Ok(None);
        }
        let read = guard::run(py, || self.inner.read_parts())?;
        let mask = read.map_err(|error| guard::error(&error))?;
        let [width, height] = mask.size.map(|side| side as usize);
        mask.labels.into_pyarray(py).reshape([height, width]).map(Some)
    }

    fn __repr__(&self) -> String {
        format!("<Frame {} of {} vehicles>", self.inner.name(), self.inner.vehicles.len())
    }
}
