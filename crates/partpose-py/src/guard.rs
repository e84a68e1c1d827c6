//! The border to Python: no GIL while we compute, no panic across, errors as Python's own classes.

use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};

use partpose::files::FileError;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Runs work without the GIL; its panic becomes a `RuntimeError`.
pub(crate) fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let done = py.detach(|| catch_unwind(AssertUnwindSafe(work)));
    done.map_err(|panic| {
        let said = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let said = said.or_else(|| panic.downcast_ref::<String>().cloned());
        let said = said.unwrap_or_else(|| "no message".to_owned());
        PyRuntimeError::new_err(format!("a bug in partpose: {said}"))
    })
}

/// An `OSError` where the system refused a file, else a `ValueError`, with all causes.
pub(crate) fn error(error: &(dyn Error + 'static)) -> PyErr {
    let refused = causes(error).any(|one| {
        one.is::<std::io::Error>()
            || matches!(
                one.downcast_ref::<FileError>(),
                Some(
                    FileError::Read { .. } | FileError::Write { .. } | FileError::NotAFolder { .. }
                )
            )
    });
    let said = words(error);
    if refused { PyOSError::new_err(said) } else { PyValueError::new_err(said) }
}

/// An error with its causes, none said twice.
pub(crate) fn words(error: &(dyn Error + 'static)) -> String {
    let mut said: Vec<String> = Vec::new();
    for text in causes(error).map(ToString::to_string) {
        if !said.last().is_some_and(|last| last.ends_with(&text)) {
            said.push(text);
        }
    }
    said.join(": ")
}

fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |one: &&'a (dyn Error + 'static)| (*one).source())
}

/// Panics, to test that Python gets an exception.
#[pyfunction]
#[pyo3(name = "_panic_for_tests")]
pub(crate) fn panic_for_tests(py: Python<'_>) -> PyResult<()> {
    run(py, || panic!("asked for"))
}
