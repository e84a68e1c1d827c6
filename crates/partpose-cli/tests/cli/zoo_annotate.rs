use std::fs;

use expect_test::expect;
use partpose::vehicle::{ParametricVehicle, PartialModel, to_partial_glb};

use super::{check, run};

#[test]
fn a_stripped_model_becomes_one_of_the_zoo() {
    let folder = tempfile::tempdir().unwrap();
    let sedan = ParametricVehicle::sedan().build().unwrap();
    fs::write(folder.path().join("sedan.glb"), to_partial_glb(&PartialModel::from(&sedan)))
        .unwrap();
    let mut partial = PartialModel::from(&ParametricVehicle::hatchback().build().unwrap());
    partial.parts.iter_mut().for_each(|part| *part = None);
    fs::write(folder.path().join("x.glb"), to_partial_glb(&partial)).unwrap();
    let text = run(
        folder.path(),
        &["zoo", "annotate", "x.glb", "--from", "sedan.glb", "--out", "zoo", "--report", "report"],
    );
    assert!(text.contains("from `sedan` 100 %"), "{text}");
    assert!(folder.path().join("report/hatchback.confidence.png").is_file());
    let record = fs::read(folder.path().join("zoo/hatchback.annotation.json")).unwrap();
    let record: serde_json::Value = serde_json::from_slice(&record).unwrap();
    let list = run(folder.path(), &["zoo", "list", "zoo", "--json"]);
    assert!(list.contains(&format!("\"faces\": {}", record["faces"])), "{list}");
}

#[test]
fn bad_input_ends_with_2_and_a_hint() {
    let folder = tempfile::tempdir().unwrap();
    let sedan = ParametricVehicle::sedan().build().unwrap();
    fs::write(folder.path().join("sedan.glb"), to_partial_glb(&PartialModel::from(&sedan)))
        .unwrap();
    check(
        folder.path(),
        &["zoo", "annotate", "sedan.glb", "--out", "zoo"],
        &expect![[r#"
            --- stderr
            error: every face of `sedan.glb` has its part already
            hint: leave faces without one: `partpose zoo import` tells how
            --- exit 2
        "#]],
    );
    check(
        folder.path(),
        &["zoo", "annotate", "none.glb", "--out", "zoo"],
        &expect![[r#"
            --- stderr
            error: cannot read `none.glb`
              caused by: No such file or directory (os error 2)
            --- exit 2
        "#]],
    );
}
