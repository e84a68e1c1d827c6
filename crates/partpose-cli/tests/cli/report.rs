//! The report: what it holds of what folders, and that a browser shows it.

use std::fs;
use std::path::Path;

use super::{browser, run};

/// A folder as `evaluate poses --tables --pictures` leaves one, with a confidence.
fn evaluation(root: &Path) {
    let folder = root.join("evaluation");
    fs::create_dir_all(folder.join("pictures")).unwrap();
    let mut list =
        "sequence,frame,track,model,depth,predicted_model,iou3d,confidence,no_pose\n".to_owned();
    for i in 0..60 {
        let (depth, iou) = (5 + i, f64::from(60 - i) / 60.0);
        let model = if i % 3 == 0 { "suv" } else { "sedan" };
        let row = format!("0001/clone,{i},7,sedan,{depth},{model},{iou:.3},{iou:.3},\n");
        list.push_str(&row);
    }
    list += "0001/clone,60,8,suv,70,,,,\"4 parts are needed, 2 were seen\"\n";
    fs::write(folder.join("vehicles.csv"), list).unwrap();
    let metrics = r#"{"count": 61, "mean_iou3d": 0.508, "model_precision": 0.66, "settings": {"dataset": "<i>d</i>"},
        "rows": [{"name": "V: baseline", "scores": {"model_precision": 0.66, "mean_iou3d": 0.508, "delta_t": 1.5, "delta_r": 0.1}}]}"#;
    fs::write(folder.join("metrics.json"), metrics).unwrap();
    fs::write(folder.join("tables.md"), "**Table V: filters**\n").unwrap();
    fs::write(folder.join("table-1.csv"), ",count\nbaseline,61\n").unwrap();
    fs::write(folder.join("log.csv"), "step,loss\n1,3.5\n2,2.5\n3,2.0\n").unwrap();
    fs::write(folder.join("confusion.csv"), "truth,roof,hood\nroof,9,1\nhood,2,8\n").unwrap();
    let curve = "detections,score,precision,recall\nnet,0.9,1.0,0.2\nnet,0.5,0.9,0.8\n";
    fs::write(folder.join("curves.csv"), curve).unwrap();
    let times =
        ",median ms,mean ms,IoU of all %,model %\ndense (28 x 28),9,9,80.0,90\npaper,1,1,50.0,40\n";
    fs::write(folder.join("comparison-1.csv"), times).unwrap();
    let picture = partpose::files::RgbImage { size: [8, 8], pixels: vec![90; 192] };
    for frame in [0, 30, 59] {
        let path = folder.join(format!("pictures/0001_clone_{frame:05}.png"));
        partpose::files::write_png(&path, &picture).unwrap();
    }
}

#[test]
fn a_report_holds_tables_plots_and_the_best_and_the_worst() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    evaluation(root);
    run(root, &["demo", "--out", "demo", "--scenes", "1"]);
    let said = run(root, &["report", "evaluation", "demo", "--title", "a <b>", "--out", "r.html"]);
    assert!(said.contains("the report of 2 runs to `r.html`\n--- exit 0"), "{said}");
    let html = fs::read_to_string(root.join("r.html")).unwrap();
    assert!(browser::is_self_contained(&html) && !html.contains("a <b>") && !html.contains("<i>d"));
    for words in [
        "Tables III to V: the paper",
        "<td>55.03</td><td>66.00</td>",
        "Table V: filters",
        "3D IoU over distance",
        "Calibration",
        "log: loss",
        "Models: what each is taken for",
        "Parts: what each is taken for",
        "precision over recall",
        "Accuracy over time",
        "Best vehicles",
        "0001/clone/00000 at 5.0 m: sedan taken for suv, 3D IoU 1.000",
        "0001/clone/00059 at 64.0 m",
        "Vehicles found over distance",
    ] {
        assert!(html.contains(words), "{words}");
    }
    let Some(document) = browser::open(&root.join("r.html"), "", None) else { return };
    assert!(document.matches("<svg").count() >= 5 && document.matches("<img").count() >= 4);
}

#[test]
fn a_folder_without_a_run_and_a_damaged_one_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    fs::create_dir(root.join("empty")).unwrap();
    let said = run(root, &["report", "empty"]);
    assert!(said.contains("`empty` holds no run") && said.ends_with("--- exit 2\n"), "{said}");
    evaluation(root);
    fs::write(root.join("evaluation/metrics.json"), "{\"count\": ").unwrap();
    let said = run(root, &["report", "evaluation"]);
    assert!(said.contains("metrics.json` is not JSON") && said.ends_with("--- exit 2\n"), "{said}");
    fs::write(root.join("evaluation/metrics.json"), "{}").unwrap();
    fs::write(root.join("evaluation/vehicles.csv"), "a,b\n1\n").unwrap();
    let said = run(root, &["report", "evaluation"]);
    assert!(said.contains("vehicles.csv` row 2: 1 cells"), "{said}");
    assert!(!root.join("report.html").exists());
}
