//! The figures that the paper prints, to stand beside ours.
//!
//! Barowski, Szczot, Houben: *6DoF Vehicle Pose Estimation Using Segmentation-Based Part Correspondences*, ITSC 2019,
//! Tables III to V: model precision and 3D IoU in percent, ΔT in metres, ΔR in radians.

use partpose::eval::Table;
use serde_json::Value;

/// Name of the row as in `metrics.json`, then the paper's four figures.
const ROWS: [(&str, [f64; 4]); 19] = [
    ("III: 14 CM / CM", [44.51, 40.84, 3.44, 0.35]),
    ("III: 14 RECT / CUB", [43.78, 40.33, 3.43, 0.38]),
    ("III: 28 CM / CM", [50.36, 43.52, 3.56, 0.41]),
    ("III: 28 RECT / CUB", [55.01, 42.31, 3.98, 0.45]),
    ("III: 42 CM / CM", [47.67, 42.14, 4.18, 0.41]),
    ("III: 42 RECT / CUB", [56.87, 42.27, 4.31, 0.44]),
    ("III: 56 CM / CM", [49.47, 42.98, 3.51, 0.42]),
    ("III: 56 RECT / CUB", [55.03, 42.03, 3.64, 0.45]),
    ("IV: 14 CM / CM", [42.26, 26.63, 4.41, 0.36]),
    ("IV: 14 RECT / CUB", [42.05, 36.78, 3.72, 0.38]),
    ("IV: 28 CM / CM", [49.17, 38.24, 3.85, 0.40]),
    ("IV: 28 RECT / CUB", [53.94, 42.21, 4.02, 0.43]),
    ("IV: 42 CM / CM", [47.55, 40.62, 4.41, 0.40]),
    ("IV: 42 RECT / CUB", [55.93, 42.25, 4.49, 0.43]),
    ("IV: 56 CM / CM", [49.60, 42.30, 3.50, 0.41]),
    ("IV: 56 RECT / CUB", [55.03, 42.03, 3.64, 0.45]),
    ("V: baseline", [55.03, 42.03, 3.64, 0.45]),
    ("V: -SP +BL +WL", [63.83, 48.87, 2.48, 0.29]),
    ("V: -SP +BL +WL +CFIX", [64.17, 49.34, 2.42, 0.28]),
];

/// The rows of an evaluation that the paper has too; `None` if there is none.
pub(super) fn beside(metrics: &Value) -> Option<Table> {
    let columns = [
        "",
        "model %: paper",
        "ours",
        "3D IoU %: paper",
        "ours",
        "ΔT m: paper",
        "ours",
        "ΔR rad: paper",
        "ours",
    ];
    let mut table = Table::new("Tables III to V: the paper's figures beside ours", &columns);
    for row in metrics["rows"].as_array()? {
        let name = row["name"].as_str().unwrap_or_default();
        let Some((_, paper)) = ROWS.iter().find(|(other, _)| *other == name) else { continue };
        let ours = |key: &str, factor: f64| {
            let value = row["scores"][key].as_f64();
            value.map_or("-".to_owned(), |value| format!("{:.2}", factor * value))
        };
        let ours = [
            ours("model_precision", 100.0),
            ours("mean_iou3d", 100.0),
            ours("delta_t", 1.0),
            ours("delta_r", 1.0),
        ];
        let mut cells = vec![name.to_owned()];
        for (paper, ours) in paper.iter().zip(ours) {
            cells.extend([format!("{paper:.2}"), ours]);
        }
        table.rows.push(cells);
    }
    (!table.rows.is_empty()).then_some(table)
}
