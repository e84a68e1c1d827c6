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
    let mut said: Vec<String> = Vec::new();
    let (mut cause, mut refused) = (Some(error), false);
    while let Some(one) = cause {
        let text = one.to_string();
        if !said.last().is_some_and(|last| last.ends_with(&text)) {
            said.push(text);
        }
        let file = one.downcast_ref::<FileError>();
        refused |= matches!(
            file,
            Some(FileError::Read { .. } | FileError::Write { .. } | FileError::NotAFolder { .. })
        );
        refused |= one.is::<std::io::Error>();
        cause = one.source();
    }
    let said = said.join(": ");
    if refused { PyOSError::new_err(said) } else { PyValueError::new_err(said) }
}

/// Panics, to test that Python gets an exception.
#[pyfunction]
#[pyo3(name = "_panic_for_tests")]
pub(crate) fn panic_for_tests(py: Python<'_>) -> PyResult<()> {
    run(py, || panic!("asked for"))
}
