//! A vehicle's place, turn and size.

use nalgebra::{Matrix3, UnitQuaternion};
use numpy::{AllowTypeChange, IntoPyArray, PyArray1, PyArray2, PyArrayLike2, PyArrayMethods};
use partpose::geometry::{Extent, Pose, Rotation3, Vector3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// How far a matrix may be from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A vehicle's cuboid in the camera frame.
#[pyclass(frozen, from_py_object, module = "partpose")]
#[derive(Clone, Copy)]
pub(crate) struct Cuboid {
    pub(crate) inner: partpose::geometry::Cuboid,
}

#[pymethods]
impl Cuboid {
    #[new]
    fn new(
        translation: [f64; 3],
        rotation: PyArrayLike2<'_, f64, AllowTypeChange>,
        extent: [f64; 3],
    ) -> PyResult<Self> {
        let rotation = rotation.as_array();
        if rotation.shape() != [3, 3] {
            let shape = rotation.shape();
            return Err(PyValueError::new_err(format!(
                "the rotation has the shape {shape:?}, but [3, 3] is needed"
            )));
        }
        let matrix = Matrix3::from_fn(|i, j| rotation[[i, j]]);
        let miss = (matrix * matrix.transpose() - Matrix3::identity()).abs().max();
        if !(miss <= ROTATION_TOLERANCE) || matrix.determinant() < 0.0 {
            return Err(PyValueError::new_err("the matrix is not a rotation"));
        }
        if translation.iter().any(|value| !(value.abs() <= 1e6)) {
            return Err(PyValueError::new_err("the translation must be three sensible numbers"));
        }
        let extent = checked_extent(extent)?;
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
        let place = Vector3::from(translation);
        let camera_from_vehicle = Pose::from_parts(place.into(), rotation);
        Ok(Self { inner: partpose::geometry::Cuboid { camera_from_vehicle, extent } })
    }

    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        translation(py, &self.inner.camera_from_vehicle)
    }

    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        rotation(py, &self.inner.camera_from_vehicle)
    }

    #[getter]
    fn extent(&self) -> [f64; 3] {
        let Extent { width, height, length } = self.inner.extent;
        [width, height, length]
    }

    fn corners<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let corners: Vec<f64> = self.inner.corners().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        corners.into_pyarray(py).reshape([8, 3])
    }

    fn iou(&self, other: &Self) -> f64 {
        self.inner.iou(&other.inner)
    }

    fn __repr__(&self) -> String {
        let place = &self.inner.camera_from_vehicle.translation;
        let [width, height, length] = self.extent();
        format!(
            "<Cuboid at ({:.2}, {:.2}, {:.2}) m, {width:.2} x {height:.2} x {length:.2} m>",
            place.x, place.y, place.z
        )
    }
}

/// An extent from width, height, length.
pub(crate) fn checked_extent([width, height, length]: [f64; 3]) -> PyResult<Extent> {
    let extent = Extent::new(width, height, length);
    if extent.is_valid() && [width, height, length].iter().all(|side| *side <= 100.0) {
        return Ok(extent);
    }
    Err(PyValueError::new_err("width, height and length must lie above 0 and below 100 metres"))
}

pub(crate) fn translation<'py>(py: Python<'py>, pose: &Pose) -> Bound<'py, PyArray1<f64>> {
    let place = &pose.translation;
    vec![place.x, place.y, place.z].into_pyarray(py)
}

pub(crate) fn rotation<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let matrix = pose.rotation.to_rotation_matrix();
    let rows: Vec<f64> = (0..9).map(|i| matrix[(i / 3, i % 3)]).collect();
    rows.into_pyarray(py).reshape([3, 3])
}
