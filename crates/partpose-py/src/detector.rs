//! The network: images to detections.

use std::path::{Path, PathBuf};

use partpose::detection::Detection;
use partpose::files;
use partpose::geometry::Extent;
use partpose_net::weights;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::{arrays, detections, guard};

#[cfg(shipped_weights)]
const SHIPPED: Option<&[u8]> = Some(include_bytes!(env!("PARTPOSE_WEIGHTS")));
#[cfg(not(shipped_weights))]
const SHIPPED: Option<&[u8]> = None;

/// A network that is ready to look at images.
#[pyclass(frozen, module = "partpose")]
pub(crate) struct Detector {
    /// Boxed, since its tensors want an alignment that Python's allocator does not give to objects.
    inner: Box<partpose_net::Detector>,
    kernel: usize,
}

#[pymethods]
impl Detector {
    #[new]
    #[pyo3(signature = (weights = None))]
    fn new(py: Python<'_>, weights: Option<PathBuf>) -> PyResult<Self> {
        if weights.is_none() && SHIPPED.is_none() {
            return Err(PyValueError::new_err(
                "this package was built without weights: give `weights`, the path of a file of `partpose train`",
            ));
        }
        guard::run(py, || load(weights.as_deref()))?
    }

    /// Cells a side of the part probabilities.
    #[getter]
    fn kernel(&self) -> usize {
        self.kernel
    }

    #[pyo3(signature = (image, *, min_score = 0.5))]
    fn detect<'py>(
        &self,
        py: Python<'py>,
        image: &Bound<'py, PyAny>,
        min_score: f64,
    ) -> PyResult<Bound<'py, PyDict>> {
        if !(0.0..=1.0).contains(&min_score) {
            return Err(PyValueError::new_err(format!(
                "`min_score` is {min_score}, but 0 to 1 is needed"
            )));
        }
        let image = arrays::rgb("image", image)?;
        let found = guard::run(py, || self.inner.detect(&image))?;
        let mut found = found.map_err(|error| guard::error(&error))?;
        found.retain(|one| one.score >= min_score);
        // Sizes are told where all have them.
        let extents: Option<Vec<Extent>> = found.iter().map(|one| Some(one.size?.extent)).collect();
        let extents = extents.filter(|extents| !extents.is_empty());
        let detections: Vec<&Detection> = found.iter().collect();
        detections::as_arrays(py, &detections, extents.as_deref())
    }

    fn __repr__(&self) -> String {
        format!("<Detector with kernels of {0} x {0}>", self.kernel)
    }
}

fn load(path: Option<&Path>) -> PyResult<Detector> {
    let read;
    let bytes = match path {
        Some(path) => {
            read = files::read(path).map_err(|error| guard::error(&error))?;
            &read[..]
        }
        None => SHIPPED.unwrap_or_default(),
    };
    let name = path.unwrap_or(Path::new("the shipped weights"));
    let device = burn::tensor::Device::flex();
    let net = weights::from_bytes(name, bytes, &device).map_err(|error| guard::error(&error))?;
    let kernel = net.config().parts.kernel;
    Ok(Detector { inner: Box::new(partpose_net::Detector::new(&net)), kernel })
}
