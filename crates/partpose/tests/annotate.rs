//! Labels are transferred to stripped models, given ones stay, bad input is told.

#![expect(clippy::unwrap_used, reason = "helpers of tests fail loudly too")]

use std::sync::LazyLock;

use partpose::annotate::{AnnotateError, AnnotateOptions, Sources, agreement, annotate};
use partpose::parts::PartClass;
use partpose::vehicle::{ModelZoo, ParametricVehicle, PartialModel};

static SEDAN: LazyLock<Sources> = LazyLock::new(|| {
    let models = vec![ParametricVehicle::sedan().build().unwrap()];
    Sources::new(&ModelZoo { models }, &mut |_| {})
});

fn stripped() -> PartialModel {
    let mut partial = PartialModel::from(&ParametricVehicle::hatchback().build().unwrap());
    partial.parts.iter_mut().for_each(|part| *part = None);
    partial
}

#[test]
fn a_hatchback_gets_its_parts_from_a_sedan() {
    let model = ParametricVehicle::hatchback().build().unwrap();
    let found = agreement(&model, &SEDAN, &AnnotateOptions::default()).unwrap();
    // One source of another body style; with more of them it is better.
    assert!(found.outside > 0.87, "{}", found.outside);
    assert_eq!(found.sources, ["sedan"]);
}

#[test]
fn given_parts_stay_and_others_are_marked() {
    let mut partial = PartialModel::from(&ParametricVehicle::hatchback().build().unwrap());
    for part in &mut partial.parts {
        part.take_if(|part| *part == PartClass::Hood);
    }
    let found = annotate(&partial, &SEDAN, &AnnotateOptions::default()).unwrap();
    let mesh = found.model.mesh();
    assert_eq!(mesh.faces.len(), found.transferred.len());
    assert_eq!(mesh.faces.len(), found.confidence.len());
    let hood = (0..mesh.faces.len()).filter(|i| found.transferred[*i]);
    let right = hood.clone().filter(|i| mesh.parts[*i] == PartClass::Hood).count();
    assert!(right as f64 > 0.9 * hood.count() as f64);
    for i in 0..mesh.faces.len() {
        assert!(found.transferred[i] || mesh.parts[i] != PartClass::Hood);
        assert!(found.transferred[i] || (found.confidence[i] - 1.0).abs() < 1e-6);
    }
}

#[test]
fn bad_input_is_told() {
    let options = AnnotateOptions::default();
    let mut empty = stripped();
    empty.faces.clear();
    empty.parts.clear();
    let error = annotate(&empty, &SEDAN, &options).unwrap_err();
    assert!(matches!(error, AnnotateError::NoSurface), "{error}");
    let none = SEDAN.retained(|_| false);
    let error = annotate(&stripped(), &none, &options).unwrap_err();
    assert!(matches!(error, AnnotateError::NoSource), "{error}");
    let style = AnnotateOptions { style: Some("tank".to_owned()), ..options };
    let error = annotate(&stripped(), &SEDAN, &style).unwrap_err();
    assert!(error.to_string().contains("`tank`: there are `sedan`"), "{error}");
}
