//! The pinhole camera.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray2, PyArrayMethods};
use partpose::dataset::KittiCalibration;
use partpose::files::MAX_IMAGE_SIDE;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::{arrays, guard};

/// A pinhole camera without distortion.
#[pyclass(frozen, eq, from_py_object, module = "partpose")]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Camera {
    pub(crate) inner: partpose::geometry::Camera,
}

#[pymethods]
impl Camera {
    #[new]
    fn new(focal: [f64; 2], principal_point: [f64; 2], size: [i64; 2]) -> PyResult<Self> {
        let size = checked_size(size)?;
        if focal.iter().any(|focal| !(1.0..=1e6).contains(focal)) {
            return Err(PyValueError::new_err(format!(
                "`focal` is {focal:?}, but focal lengths are 1 to 1,000,000 pixels"
            )));
        }
        if principal_point.iter().any(|value| !(value.abs() <= 1e6)) {
            return Err(PyValueError::new_err(format!(
                "`principal_point` is {principal_point:?}, but pixels near the image are needed"
            )));
        }
        Ok(Self { inner: partpose::geometry::Camera { focal, principal_point, size } })
    }

    /// A guess where nothing is known but the angle.
    #[staticmethod]
    fn from_field_of_view(size: [i64; 2], degrees: f64) -> PyResult<Self> {
        let size = checked_size(size)?;
        if !(1.0..=170.0).contains(&degrees) {
            return Err(PyValueError::new_err(format!(
                "`degrees` is {degrees}, but an angle from 1 to 170 is needed"
            )));
        }
        let [width, height] = size.map(f64::from);
        let focal = 0.5 * width.max(height) / (0.5 * degrees.to_radians()).tan();
        let center = [0.5 * (width - 1.0), 0.5 * (height - 1.0)];
        Ok(Self { inner: partpose::geometry::Camera::pinhole(focal, center, size) })
    }

    /// The left colour camera of a KITTI calibration.
    #[staticmethod]
    fn from_kitti(py: Python<'_>, path: PathBuf, size: [i64; 2]) -> PyResult<Self> {
        let size = checked_size(size)?;
        let read = guard::run(py, || KittiCalibration::read(&path))?;
        let camera = read.map_err(|error| guard::error(&error))?.camera(size);
        Self::new(camera.focal, camera.principal_point, camera.size.map(i64::from))
    }

    #[getter]
    fn focal(&self) -> (f64, f64) {
        self.inner.focal.into()
    }

    #[getter]
    fn principal_point(&self) -> (f64, f64) {
        self.inner.principal_point.into()
    }

    #[getter]
    fn size(&self) -> (u32, u32) {
        self.inner.size.into()
    }

    fn project<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let points = arrays::rows::<3>("points", "[N, 3]", points)?;
        let pixels = points.iter().flat_map(|[x, y, z]| {
            let point = partpose::geometry::Point3::new(*x, *y, *z);
            self.inner.project(&point).map_or([f64::NAN; 2], |pixel| [pixel.x, pixel.y])
        });
        let pixels: Vec<f64> = pixels.collect();
        pixels.into_pyarray(py).reshape([points.len(), 2])
    }

    /// What pickle calls the class with.
    fn __getnewargs__(&self) -> ((f64, f64), (f64, f64), (u32, u32)) {
        (self.focal(), self.principal_point(), self.size())
    }

    fn __repr__(&self) -> String {
        let (focal, center, size) = (self.focal(), self.principal_point(), self.size());
        format!("Camera(focal={focal:?}, principal_point={center:?}, size={size:?})")
    }
}

fn checked_size(size: [i64; 2]) -> PyResult<[u32; 2]> {
    let side = |side: i64| u32::try_from(side).ok().filter(|s| (1..=MAX_IMAGE_SIDE).contains(s));
    match size.map(side) {
        [Some(width), Some(height)] => Ok([width, height]),
        _ => Err(PyValueError::new_err(format!(
            "`size` is {size:?}, but width and height are 1 to {MAX_IMAGE_SIDE} pixels"
        ))),
    }
}
