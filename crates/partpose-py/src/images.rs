//! Images from files.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArray3, PyArrayMethods};
use partpose::files::{RgbImage, read_photo};
use pyo3::prelude::*;

use crate::guard;

/// A PNG or JPEG file as `[H, W, 3]`, turned as its camera says.
#[pyfunction]
pub(crate) fn read_image(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let read = guard::run(py, || read_photo(&path))?;
    to_python(py, read.map_err(|error| guard::error(&error))?.image)
}

fn to_python(py: Python<'_>, image: RgbImage) -> PyResult<Bound<'_, PyArray3<u8>>> {
    let [width, height] = image.size.map(|side| side as usize);
    image.pixels.into_pyarray(py).reshape([height, width, 3])
}
