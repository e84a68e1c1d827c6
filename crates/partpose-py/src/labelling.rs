//! Part labels for data sets with 3D boxes.

use std::path::PathBuf;

use numpy::{IntoPyArray, PyArrayMethods};
use partpose::labeling::{
    Categories, LabelJob, LabelOptions, LabelReport, LabelStore, ModelChoice, Shard, Zoos,
};
use partpose::render::LabelRenderer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::dataset::{Dataset, Frame};
use crate::guard;
use crate::zoo::ModelZoo;

/// Part and instance images of one frame, in memory.
#[pyfunction]
#[pyo3(signature = (frame, zoo, *, models = "size", categories = None))]
pub(crate) fn label_frame<'py>(
    py: Python<'py>,
    frame: &Frame,
    zoo: &ModelZoo,
    models: &str,
    categories: Option<Vec<String>>,
) -> PyResult<Bound<'py, PyDict>> {
    let options = options(models, categories)?;
    let labelled = guard::run(py, || {
        let (zoos, mut renderer) = (Zoos::single(&zoo.inner), LabelRenderer::default());
        partpose::labeling::label_frame(&frame.inner, &zoos, &options, None, &mut renderer)
    })?;
    let labels = labelled.map_err(|error| guard::error(&error))?;
    let shape = [labels.size[1] as usize, labels.size[0] as usize];
    let images = PyDict::new(py);
    images.set_item("parts", labels.parts.into_pyarray(py).reshape(shape)?)?;
    images.set_item("instances", labels.instances.into_pyarray(py).reshape(shape)?)?;
    Ok(images)
}

/// Labels of a data set as files, resumably and in shards, as `partpose label` writes them.
#[pyfunction]
#[pyo3(signature = (
    dataset, zoo, out, *, sequences = None, stride = 1, models = "size", categories = None, shard = None, resume = false
))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn label_dataset<'py>(
    py: Python<'py>,
    dataset: &Dataset,
    zoo: &ModelZoo,
    out: PathBuf,
    sequences: Option<Vec<String>>,
    stride: u32,
    models: &str,
    categories: Option<Vec<String>>,
    shard: Option<&str>,
    resume: bool,
) -> PyResult<Bound<'py, PyDict>> {
    if stride == 0 {
        return Err(PyValueError::new_err("`stride` is 0, but every how many-th frame is meant"));
    }
    let shard: Option<Shard> = match shard.map(str::parse) {
        Some(Ok(shard)) => Some(shard),
        Some(Err(error)) => return Err(PyValueError::new_err(format!("`shard`: {error}"))),
        None => None,
    };
    let options = options(models, categories)?;
    let sequences = dataset.chosen(sequences.as_deref())?;
    let labelled = guard::run(py, || {
        let job = LabelJob {
            sequences: &sequences,
            stride,
            zoos: Zoos::single(&zoo.inner),
            options,
            shard,
            resume,
            reference: None,
        };
        partpose::labeling::label_dataset(&dataset.inner, &job, &LabelStore::new(&out), &|_| ())
    })?;
    summary(py, &labelled.map_err(|error| guard::error(&error))?)
}

fn options(models: &str, categories: Option<Vec<String>>) -> PyResult<LabelOptions> {
    let models = match models {
        "size" => ModelChoice::Size,
        "name" => ModelChoice::Name,
        other => {
            let said = format!("`models` is `{other}`, but `size` or `name` is needed");
            return Err(PyValueError::new_err(said));
        }
    };
    let categories = categories.map_or(Categories::OfZoo, Categories::Named);
    Ok(LabelOptions { models, categories, ..LabelOptions::default() })
}

fn summary<'py>(py: Python<'py>, report: &LabelReport) -> PyResult<Bound<'py, PyDict>> {
    let sum = |count: fn(&partpose::labeling::SequenceReport) -> usize| -> usize {
        report.sequences.iter().map(count).sum()
    };
    let said = PyDict::new(py);
    said.set_item("written", sum(|sequence| sequence.written))?;
    said.set_item("kept", sum(|sequence| sequence.kept))?;
    said.set_item("skipped", sum(|sequence| sequence.skipped))?;
    said.set_item("vehicles", sum(|sequence| sequence.vehicles))?;
    said.set_item("missing_blocks", sum(|sequence| sequence.missing_blocks))?;
    let why: Vec<String> = report
        .skipped
        .iter()
        .map(|skipped| format!("{}: {}", skipped.name, guard::words(&skipped.error)))
        .collect();
    said.set_item("reasons", why)?;
    Ok(said)
}
