//! Annotated models, and pictures of their parts.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use partpose::render::{Instance, render_labels as render};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::camera::Camera;
use crate::cuboid::{Cuboid, sides};
use crate::guard;

/// Models to choose from.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct ModelZoo {
    pub(crate) inner: Arc<partpose::vehicle::ModelZoo>,
}

#[pymethods]
impl ModelZoo {
    #[staticmethod]
    fn embedded(py: Python<'_>) -> PyResult<Self> {
        let embedded = guard::run(py, partpose::vehicle::ModelZoo::embedded)?;
        Ok(Self { inner: Arc::new(embedded) })
    }

    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let loaded = guard::run(py, || partpose::vehicle::ModelZoo::load(&path))?;
        Ok(Self { inner: Arc::new(loaded.map_err(|error| guard::error(&error))?) })
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        guard::run(py, || self.inner.save(&path))?.map_err(|error| guard::error(&error))
    }

    #[getter]
    fn names(&self) -> Vec<String> {
        self.inner.models.iter().map(|model| model.name().to_owned()).collect()
    }

    fn __len__(&self) -> usize {
        self.inner.models.len()
    }

    fn __getitem__(&self, name: &str) -> PyResult<VehicleModel> {
        Ok(VehicleModel { inner: self.model(name)?.clone() })
    }

    fn __repr__(&self) -> String {
        format!("<ModelZoo of {} models>", self.inner.models.len())
    }
}

impl ModelZoo {
    fn model(&self, name: &str) -> PyResult<&partpose::vehicle::VehicleModel> {
        self.inner.get(name).ok_or_else(|| {
            let names = self.names().join(", ");
            PyKeyError::new_err(format!("there is no model `{name}`; there are {names}"))
        })
    }
}

/// An annotated model.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct VehicleModel {
    inner: partpose::vehicle::VehicleModel,
}

#[pymethods]
impl VehicleModel {
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    #[getter]
    fn category(&self) -> &str {
        self.inner.category()
    }

    #[getter]
    fn body_style(&self) -> &str {
        self.inner.body_style()
    }

    #[getter]
    fn extent(&self) -> (f64, f64, f64) {
        sides(&self.inner.extent())
    }

    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let vertices = &self.inner.mesh().vertices;
        let values: Vec<f64> = vertices.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        values.into_pyarray(py).reshape([vertices.len(), 3])
    }

    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let faces = &self.inner.mesh().faces;
        let values: Vec<u32> = faces.iter().flatten().copied().collect();
        values.into_pyarray(py).reshape([faces.len(), 3])
    }

    #[getter]
    fn parts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u8>> {
        let parts: Vec<u8> = self.inner.mesh().parts.iter().map(|part| part.id()).collect();
        parts.into_pyarray(py)
    }

    fn __repr__(&self) -> String {
        format!("<VehicleModel {}>", self.inner.name())
    }
}

/// Part, instance and depth images of models at their cuboids.
#[pyfunction]
pub(crate) fn render_labels<'py>(
    py: Python<'py>,
    camera: &Camera,
    zoo: &ModelZoo,
    vehicles: Vec<(String, Cuboid)>,
) -> PyResult<Bound<'py, PyDict>> {
    if vehicles.len() > usize::from(u16::MAX) - 1 {
        return Err(PyValueError::new_err(format!(
            "`vehicles` has {} vehicles, more than 16 bits can tell apart",
            vehicles.len()
        )));
    }
    let mut instances = Vec::with_capacity(vehicles.len());
    for (id, (name, cuboid)) in (1..).zip(&vehicles) {
        let model = zoo.model(name)?;
        instances.push(Instance {
            mesh: model.mesh(),
            scale: cuboid.inner.extent.ratio(&model.extent()),
            camera_from_vehicle: cuboid.inner.camera_from_vehicle,
            id,
        });
    }
    let image = guard::run(py, || render(&camera.inner, &instances))?;
    let shape = [image.size[1] as usize, image.size[0] as usize];
    let images = PyDict::new(py);
    images.set_item("parts", image.parts.into_pyarray(py).reshape(shape)?)?;
    images.set_item("instances", image.instances.into_pyarray(py).reshape(shape)?)?;
    images.set_item("depths", image.depths.into_pyarray(py).reshape(shape)?)?;
    Ok(images)
}
