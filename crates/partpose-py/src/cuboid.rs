//! A vehicle's place, turn and size.

use nalgebra::{Matrix3, UnitQuaternion};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods};
use partpose::geometry::{Extent, Pose, Rotation3, Vector3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;

/// How far a matrix may be from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A vehicle's cuboid in the camera frame.
#[pyclass(frozen, eq, from_py_object, module = "partpose")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Cuboid {
    pub(crate) inner: partpose::geometry::Cuboid,
}

#[pymethods]
impl Cuboid {
    #[new]
    fn new(
        translation: &Bound<'_, PyAny>,
        rotation: &Bound<'_, PyAny>,
        extent: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let translation = arrays::triple("translation", "[3], in metres,", translation)?;
        let wanted = arrays::Wanted {
            name: "rotation",
            sides: &[arrays::Side::Is(3), arrays::Side::Is(3)],
            said: "[3, 3]",
        };
        let array = wanted.read::<f64>(rotation)?;
        let view = array.as_array();
        let matrix = Matrix3::from_fn(|i, j| view[[i, j]]);
        let miss = (matrix * matrix.transpose() - Matrix3::identity()).abs().max();
        if !(miss <= ROTATION_TOLERANCE) || matrix.determinant() < 0.0 {
            return Err(PyValueError::new_err(
                "`rotation` is not a rotation: its rows must be orthonormal and its determinant 1",
            ));
        }
        if translation.iter().any(|value| !(value.abs() <= 1e6)) {
            return Err(PyValueError::new_err(format!(
                "`translation` is {translation:?}, but three lengths below 1,000 km are needed"
            )));
        }
        let extent = arrays::triple("extent", "[3], width, height, length,", extent)?;
        let extent = checked_extent("extent", extent)?;
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
    fn extent(&self) -> (f64, f64, f64) {
        sides(&self.inner.extent)
    }

    fn corners<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let corners: Vec<f64> = self.inner.corners().iter().flat_map(|p| [p.x, p.y, p.z]).collect();
        corners.into_pyarray(py).reshape([8, 3])
    }

    /// The smallest box around its picture; None behind the camera.
    fn project(&self, camera: &crate::camera::Camera) -> Option<[f64; 4]> {
        let rect = self.inner.project(&camera.inner)?;
        Some([rect.x_min, rect.y_min, rect.x_max, rect.y_max])
    }

    fn iou(&self, other: &Self) -> f64 {
        self.inner.iou(&other.inner)
    }

    /// What pickle calls the class with.
    fn __getnewargs__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>, (f64, f64, f64))> {
        Ok((self.translation(py), self.rotation(py)?, self.extent()))
    }

    fn __repr__(&self) -> String {
        let place = &self.inner.camera_from_vehicle.translation;
        let (width, height, length) = self.extent();
        format!(
            "<Cuboid at ({:.2}, {:.2}, {:.2}) m, {width:.2} x {height:.2} x {length:.2} m>",
            place.x, place.y, place.z
        )
    }
}

/// An extent from width, height, length.
pub(crate) fn checked_extent(name: &str, sides: [f64; 3]) -> PyResult<Extent> {
    let [width, height, length] = sides;
    let extent = Extent::new(width, height, length);
    if extent.is_valid() && sides.iter().all(|side| *side <= 100.0) {
        return Ok(extent);
    }
    Err(PyValueError::new_err(format!(
        "`{name}` has {sides:?}, but width, height and length lie above 0 and below 100 metres"
    )))
}

pub(crate) fn sides(extent: &Extent) -> (f64, f64, f64) {
    (extent.width, extent.height, extent.length)
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
