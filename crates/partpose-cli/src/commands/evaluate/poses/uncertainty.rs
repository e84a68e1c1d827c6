//! What the dense fit says of itself against the truth: tables and plots.

use partpose::eval::Table;
use partpose::eval::uncertainty::{
    Sureness, UncertaintyScores, confidence_cases, coverage, model_cases, reliability,
    uncertainty_scores, uncertainty_table,
};
use partpose::files::{self, RgbImage};
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};

use super::{Arguments, Evaluated, Row};

/// The statements of one configuration; nothing for fits that make none.
pub(super) fn statements(rows: &[Row]) -> Vec<Sureness> {
    rows.iter().filter_map(|row| row.sureness).collect()
}

/// The scores of one configuration; `None` for fits that say nothing of themselves.
pub(super) fn scores(rows: &[Row]) -> Option<UncertaintyScores> {
    let all = statements(rows);
    (!all.is_empty()).then(|| uncertainty_scores(&all))
}

/// One row a configuration; no table without the dense fit.
pub(super) fn tables(evaluated: &Evaluated) -> Option<Table> {
    let rows: Vec<(String, UncertaintyScores)> = evaluated
        .configurations
        .iter()
        .zip(&evaluated.rows)
        .filter_map(|(configuration, rows)| Some((configuration.name.clone(), scores(rows)?)))
        .collect();
    (!rows.is_empty()).then(|| uncertainty_table("What the dense fit says of itself", &rows))
}

/// `uncertainty.png`, where something was said.
pub(super) fn write_plots(arguments: &Arguments, evaluated: &Evaluated) -> anyhow::Result<()> {
    let named: Vec<(String, Vec<Sureness>)> = evaluated
        .configurations
        .iter()
        .zip(&evaluated.rows)
        .map(|(configuration, rows)| (configuration.name.clone(), statements(rows)))
        .filter(|(_, all)| !all.is_empty())
        .collect();
    if named.is_empty() {
        return Ok(());
    }
    files::write_png(&arguments.out.join("uncertainty.png"), &picture(&named))?;
    Ok(())
}

/// Coverage, and the reliability of confidence and of the models' probabilities, side by side.
pub(super) fn picture(named: &[(String, Vec<Sureness>)]) -> RgbImage {
    let covered = |all: &[Sureness]| -> Vec<[f64; 2]> {
        (0..=40).map(|i| f64::from(i) / 40.0).map(|level| [level, coverage(all, level)]).collect()
    };
    let reliable = |cases: Vec<(f64, bool)>| -> Vec<[f64; 2]> {
        // Ranges with few cases say more of chance than of the fit.
        let bins = reliability(&cases, 10).into_iter().filter(|bin| bin.count >= 10);
        bins.map(|bin| [bin.stated, bin.happened]).collect()
    };
    let drawn =
        |title: &str, x: &str, y: &str, mark, points: &dyn Fn(&[Sureness]) -> Vec<[f64; 2]>| {
            let mut series = vec![Series {
                color: Some([150, 150, 150]),
                ..Series::new("honest", Mark::Reference, vec![[0.0, 0.0], [1.0, 1.0]])
            }];
            series.extend(named.iter().map(|(name, all)| Series::new(name, mark, points(all))));
            plot(&Plot {
                title: title.to_owned(),
                x: Axis::over(x, [0.0, 1.0]),
                y: Axis::over(y, [0.0, 1.0]),
                series,
                size: [480, 420],
            })
        };
    let pictures = [
        drawn(
            "Ellipsoids of pose",
            "said to hold",
            "share of truths inside",
            Mark::Curve,
            &covered,
        ),
        drawn("Confidence", "stated", "share with 3D IoU above 0.5", Mark::Line, &|all| {
            reliable(confidence_cases(all))
        }),
        drawn(
            "Probability of the chosen model",
            "stated",
            "share with the right model",
            Mark::Line,
            &|all| reliable(model_cases(all)),
        ),
    ];
    panels(&pictures, 3)
}
