//! The pinhole camera.

use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArrayLike2, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A pinhole camera without distortion.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct Camera {
    pub(crate) inner: partpose::geometry::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    fn new(focal: [f64; 2], principal_point: [f64; 2], size: [u32; 2]) -> PyResult<Self> {
        let limit = partpose::files::MAX_IMAGE_SIDE;
        if focal.iter().any(|focal| !(1.0..=1e6).contains(focal)) {
            return Err(PyValueError::new_err("focal lengths must be 1 to 1,000,000 pixels"));
        }
        if principal_point.iter().any(|value| !(value.abs() <= 1e6)) {
            return Err(PyValueError::new_err("the principal point must be two sensible numbers"));
        }
        if size.iter().any(|side| !(1..=limit).contains(side)) {
            return Err(PyValueError::new_err(format!("sides must be 1 to {limit} pixels")));
        }
        Ok(Self { inner: partpose::geometry::Camera { focal, principal_point, size } })
    }

    #[getter]
    fn focal(&self) -> [f64; 2] {
        self.inner.focal
    }

    #[getter]
    fn principal_point(&self) -> [f64; 2] {
        self.inner.principal_point
    }

    #[getter]
    fn size(&self) -> [u32; 2] {
        self.inner.size
    }

    fn project<'py>(
        &self,
        py: Python<'py>,
        points: PyArrayLike2<'py, f64, AllowTypeChange>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = points.as_array();
        if points.ncols() != 3 {
            return Err(PyValueError::new_err(format!(
                "points have the shape {:?}, but [N, 3] is needed",
                points.shape()
            )));
        }
        let pixels = points.rows().into_iter().flat_map(|p| {
            let point = partpose::geometry::Point3::new(p[0], p[1], p[2]);
            self.inner.project(&point).map_or([f64::NAN; 2], |pixel| [pixel.x, pixel.y])
        });
        let pixels: Vec<f64> = pixels.collect();
        let count = pixels.len() / 2;
        pixels.into_pyarray(py).reshape([count, 2])
    }

    fn __repr__(&self) -> String {
        let partpose::geometry::Camera { focal, principal_point, size } = self.inner;
        format!("Camera(focal={focal:?}, principal_point={principal_point:?}, size={size:?})")
    }
}
