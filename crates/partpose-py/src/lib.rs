//! `partpose` from Python: zoo, camera, detector, fits of anyone's masks, part labels, scores; numpy in and out.
//!
//! The names are those of the Rust library. Whatever takes long runs without the GIL; a panic, which would be a bug of
//! ours, becomes a `RuntimeError`. What the functions mean is documented for Python in `python/partpose/_partpose.pyi`.

#![allow(clippy::needless_pass_by_value, reason = "arguments come from Python as values")]

mod arrays;
mod camera;
mod cuboid;
mod dataset;
mod detections;
mod detector;
mod estimator;
mod guard;
mod images;
mod labelling;
mod results;
mod scores;
mod zoo;

use pyo3::prelude::*;

/// The compiled half of the package `partpose`.
#[pymodule]
#[pyo3(name = "_partpose")]
fn partpose_module(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add(
        "PARTS",
        partpose::parts::PartClass::ALL
            .map(|part| (part.id(), part.name(), <(u8, u8, u8)>::from(part.color()))),
    )?;
    module.add_class::<zoo::ModelZoo>()?;
    module.add_class::<zoo::VehicleModel>()?;
    module.add_class::<camera::Camera>()?;
    module.add_class::<cuboid::Cuboid>()?;
    module.add_class::<dataset::Dataset>()?;
    module.add_class::<dataset::Frame>()?;
    module.add_class::<detector::Detector>()?;
    module.add_class::<estimator::PoseEstimator>()?;
    module.add_class::<estimator::PoseEstimate>()?;
    module.add_class::<estimator::NoPose>()?;
    module.add_function(wrap_pyfunction!(detections::probabilities_from_labels, module)?)?;
    module.add_function(wrap_pyfunction!(detections::read_detections, module)?)?;
    module.add_function(wrap_pyfunction!(images::read_image, module)?)?;
    module.add_function(wrap_pyfunction!(labelling::label_dataset, module)?)?;
    module.add_function(wrap_pyfunction!(labelling::label_frame, module)?)?;
    module.add_function(wrap_pyfunction!(results::write_results, module)?)?;
    module.add_function(wrap_pyfunction!(zoo::render_labels, module)?)?;
    module.add_function(wrap_pyfunction!(scores::pose_deviation, module)?)?;
    module.add_function(wrap_pyfunction!(scores::score_coco, module)?)?;
    module.add_function(wrap_pyfunction!(scores::score_kitti, module)?)?;
    module.add_function(wrap_pyfunction!(guard::panic_for_tests, module)?)?;
    Ok(())
}
