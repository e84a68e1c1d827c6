//! Arrays from Python: whatever numpy can read, with the argument's name, the shape and a remedy where it is wrong.

use numpy::ndarray::{ArrayView, Dimension, Ix2};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use partpose::files::{MAX_IMAGE_SIDE, RgbImage};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A side of an expected shape.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Side {
    /// Any length.
    Any,
    /// This length.
    Is(usize),
}

/// An argument that is an array: its name, the sides of its shape, and how these are written in messages.
#[derive(Clone, Copy)]
pub(crate) struct Wanted<'a> {
    pub(crate) name: &'a str,
    pub(crate) sides: &'a [Side],
    pub(crate) said: &'a str,
}

impl Wanted<'_> {
    /// The argument as numbers of a type; numpy converts what is of another.
    pub(crate) fn read<'py, T: Element>(
        &self,
        given: &Bound<'py, PyAny>,
    ) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
        let py = given.py();
        let numpy = py.import("numpy")?;
        let array = numpy.call_method1("asarray", (given, T::get_dtype(py))).map_err(|error| {
            let Self { name, said, .. } = self;
            let why = error.value(py);
            PyValueError::new_err(format!("`{name}` is no array of numbers {said}: {why}"))
        })?;
        let array = array.cast_into::<PyArrayDyn<T>>()?.try_readonly()?;
        self.check(array.shape())?;
        Ok(array)
    }

    fn check(&self, shape: &[usize]) -> PyResult<()> {
        // Of nothing, no side but the first has a length.
        if shape.first() == Some(&0) && self.sides.first() == Some(&Side::Any) {
            return Ok(());
        }
        let fits =
            |(length, side): (&usize, &Side)| *side == Side::Any || *side == Side::Is(*length);
        if shape.len() == self.sides.len() && shape.iter().zip(self.sides).all(fits) {
            return Ok(());
        }
        let Self { name, said, .. } = self;
        Err(PyValueError::new_err(format!(
            "`{name}` has the shape {shape:?}, but {said} is needed"
        )))
    }
}

/// The view with as many dimensions as were checked; nothing of an array of nothing.
pub(crate) fn view<'a, T: Element, D: Dimension>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
    empty: D,
) -> ArrayView<'a, T, D> {
    let view = array.as_array();
    let nothing = || ArrayView::from_shape(empty, &[]).expect("nothing fits an empty shape");
    view.into_dimensionality().unwrap_or_else(|_| nothing())
}

/// `[N, width]` numbers.
pub(crate) fn rows<const WIDTH: usize>(
    name: &str,
    said: &str,
    given: &Bound<'_, PyAny>,
) -> PyResult<Vec<[f64; WIDTH]>> {
    let wanted = Wanted { name, sides: &[Side::Any, Side::Is(WIDTH)], said };
    let array = wanted.read::<f64>(given)?;
    let view = view(&array, Ix2(0, WIDTH));
    Ok(view.rows().into_iter().map(|row| std::array::from_fn(|i| row[i])).collect())
}

/// `[N]` numbers.
pub(crate) fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let wanted = Wanted { name, sides: &[Side::Any], said: "[N]" };
    Ok(wanted.read::<f64>(given)?.as_array().iter().copied().collect())
}

/// Three numbers.
pub(crate) fn triple(name: &str, said: &str, given: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    let wanted = Wanted { name, sides: &[Side::Is(3)], said };
    let array = wanted.read::<f64>(given)?;
    let mut values = array.as_array().into_iter().copied();
    Ok(std::array::from_fn(|_| values.next().unwrap_or(f64::NAN)))
}

/// numpy's array of an object, in the type that it has.
fn as_it_is<'py>(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyUntypedArray>> {
    let array = given.py().import("numpy")?.call_method1("asarray", (given,));
    let array = array.map_err(|error| {
        let why = error.value(given.py());
        PyValueError::new_err(format!("`{name}` is no array: {why}"))
    })?;
    Ok(array.cast_into()?)
}

/// An RGB image `[H, W, 3]` of bytes.
pub(crate) fn rgb(name: &str, given: &Bound<'_, PyAny>) -> PyResult<RgbImage> {
    let array = as_it_is(name, given)?;
    let kind = array.dtype();
    let said = "[H, W, 3] of bytes, red, green, blue,";
    let Ok(bytes) = array.extract::<PyReadonlyArrayDyn<u8>>() else {
        return Err(PyValueError::new_err(format!(
            "`{name}` is of {kind}, but {said} is needed: scale it to 0 to 255 and call .astype(\"uint8\")"
        )));
    };
    let wanted = Wanted { name, sides: &[Side::Any, Side::Any, Side::Is(3)], said };
    let shape = bytes.shape();
    wanted.check(shape)?;
    let size = size_of(name, shape)?;
    Ok(RgbImage { size, pixels: bytes.as_array().iter().copied().collect() })
}

/// Labels `[H, W]`: width, height and the ids of parts, 0 for background.
pub(crate) fn labels(name: &str, given: &Bound<'_, PyAny>) -> PyResult<([u32; 2], Vec<u8>)> {
    let array = as_it_is(name, given)?;
    let kind = array.dtype();
    if !matches!(kind.kind(), b'u' | b'i' | b'b') {
        return Err(PyValueError::new_err(format!(
            "`{name}` is of {kind}, but [H, W] of whole numbers 0 to 29 is needed: call .astype(\"uint8\")"
        )));
    }
    let said = "[H, W] of ids of parts, 0 to 29,";
    let wanted = Wanted { name, sides: &[Side::Any, Side::Any], said };
    wanted.check(array.shape())?;
    let size = size_of(name, array.shape())?;
    let numbers = wanted.read::<i64>(array.as_any())?;
    let ids: Result<Vec<u8>, i64> = numbers
        .as_array()
        .iter()
        .map(|label| u8::try_from(*label).ok().filter(|id| *id <= 29).ok_or(*label))
        .collect();
    let ids = ids.map_err(|label| {
        PyValueError::new_err(format!(
            "`{name}` holds {label}, but 0 for background and 1 to 29 for parts are needed"
        ))
    })?;
    Ok((size, ids))
}

/// Width and height of an image of a shape.
fn size_of(name: &str, shape: &[usize]) -> PyResult<[u32; 2]> {
    let side = |at: usize| {
        let length = shape.get(at).and_then(|length| u32::try_from(*length).ok());
        length.filter(|length| (1..=MAX_IMAGE_SIDE).contains(length))
    };
    match (side(1), side(0)) {
        (Some(width), Some(height)) => Ok([width, height]),
        _ => Err(PyValueError::new_err(format!(
            "`{name}` has the shape {shape:?}, but height and width must be 1 to {MAX_IMAGE_SIDE}"
        ))),
    }
}
