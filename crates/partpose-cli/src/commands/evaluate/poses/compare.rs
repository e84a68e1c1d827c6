//! `evaluate poses --compare`: the dense fit beside the paper's method and the best setting of points, over everything
//! that makes poses hard, with the time each takes.

use std::fmt::Write as _;

use partpose::dataset::Dataset;
use partpose::dataset::folds::Fold;
use partpose::eval::model_names::ModelNames;
use partpose::eval::uncertainty::{Sureness, uncertainty_scores, uncertainty_table};
use partpose::eval::{
    Configuration, PoseScores, Scored, Table, breakdown, paper_configurations, paper_tables,
    score_table, summarize,
};
use partpose::files;
use partpose::pose::dense::DenseOptions;
use partpose::pose::{Center2d, Center3d, PartFilters, PnpMethod, PoseOptions};
use partpose::vehicle::ModelZoo;
use partpose::viz::{Axis, Mark, Plot, Series, panels, plot};

use super::{Arguments, Evaluated, ExtentFlag, Row, evaluate, uncertainty};
use crate::report::{Outcome, data, note};

/// The methods that are compared everywhere.
const METHODS: [&str; 3] = ["paper", "points, best", "dense"];
/// Pixel accuracies of the masks, in percent.
const ACCURACIES: [f64; 3] = [90.0, 85.0, 80.0];
const KERNELS: [usize; 4] = [14, 28, 42, 56];
/// Cells a side in Table V.
const FILTERED_KERNEL: usize = 56;
/// Cells a side where nothing else is said.
const KERNEL: usize = 28;

/// Which rows a run of the evaluation has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    /// The three methods.
    Methods,
    /// The paper's tables and the dense fit at every kernel size besides.
    Everything,
}

/// The rows of one run; the three methods stand last.
pub(super) fn configurations(rows: Rows, seed: u64) -> Vec<Configuration> {
    let row = |name: &str, kernel: usize, pose: PoseOptions| Configuration {
        name: name.to_owned(),
        kernel,
        pose: PoseOptions { seed, ..pose },
        degradation: None,
    };
    let dense = PoseOptions {
        method: PnpMethod::Dense,
        dense: DenseOptions::default(),
        ..PoseOptions::default()
    };
    let points = PoseOptions {
        method: PnpMethod::Sqpnp,
        center_2d: Center2d::Mass,
        center_3d: Center3d::Visible,
        filters: PartFilters::default(),
        refine: true,
        ..PoseOptions::default()
    };
    let paper = PoseOptions { method: PnpMethod::Epnp, refine: false, ..PoseOptions::default() };
    let mut all = Vec::new();
    if rows == Rows::Everything {
        all.extend(paper_configurations(&paper));
        all.extend(KERNELS.map(|kernel| row(&format!("dense: {kernel}"), kernel, dense)));
    }
    all.push(row(METHODS[0], KERNEL, paper));
    all.push(row(METHODS[1], KERNEL, points));
    all.push(row(METHODS[2], KERNEL, dense));
    all
}

/// One run under its own conditions.
struct Run {
    name: String,
    extent: ExtentFlag,
    accuracy: f64,
    evaluated: Evaluated,
}

impl Run {
    /// The rows of a method.
    fn of(&self, method: usize) -> &[Row] {
        let count = self.evaluated.rows.len();
        &self.evaluated.rows[count - METHODS.len() + method]
    }

    fn scores(&self, method: usize) -> PoseScores {
        summarize(self.of(method).iter().map(|row| row.scored))
    }
}

/// Runs everything and writes tables and plots.
pub(super) fn run(
    arguments: &Arguments,
    dataset: &Dataset,
    (folds, zoos): (&[Option<Fold>], &[ModelZoo]),
    names: &ModelNames,
) -> anyhow::Result<Outcome> {
    let conditions = [("masks exact, sizes given".to_owned(), ExtentFlag::Truth, None)]
        .into_iter()
        .chain(ACCURACIES.map(|accuracy| {
            (format!("masks {accuracy:.0} % right"), ExtentFlag::Truth, Some(accuracy / 100.0))
        }))
        .chain([
            ("sizes of the models".to_owned(), ExtentFlag::Model, None),
            ("sizes free".to_owned(), ExtentFlag::Free, None),
        ]);
    let mut runs = Vec::new();
    for (index, (name, extent, degrade)) in conditions.enumerate() {
        note(format_args!("{name}"));
        let rows = if index == 0 { Rows::Everything } else { Rows::Methods };
        let own = Arguments { extent, degrade, comparison: Some(rows), ..arguments.clone() };
        let evaluated = evaluate(&own, dataset, (folds, zoos), (None, names))?;
        let accuracy = degrade.unwrap_or(1.0);
        runs.push(Run { name, extent, accuracy, evaluated });
    }
    let tables = tables(&runs);
    let text = tables.iter().map(Table::to_markdown).collect::<Vec<_>>().join("\n");
    data(&text)?;
    let file = |name: &str| arguments.out.join(name);
    files::write(&file("comparison.md"), text.as_bytes())?;
    for (index, table) in tables.iter().enumerate() {
        let name = format!("comparison-{}.csv", index + 1);
        files::write(&file(&name), table.to_csv().as_bytes())?;
    }
    files::write_png(&file("comparison.png"), &plots(&runs))?;
    let said: Vec<(String, Vec<Sureness>)> = runs
        .iter()
        .map(|run| (run.name.clone(), uncertainty::statements(run.of(METHODS.len() - 1))))
        .filter(|(_, all)| !all.is_empty())
        .collect();
    files::write_png(&file("uncertainty.png"), &uncertainty::picture(&said))?;
    note(format_args!(
        "wrote `comparison.md`, `comparison.png`, `uncertainty.png` and the tables as CSV to `{}`",
        arguments.out.display()
    ));
    let skipped = runs.iter().map(|run| run.evaluated.skipped).max().unwrap_or(0);
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn tables(runs: &[Run]) -> Vec<Table> {
    let full = &runs[0].evaluated;
    let scores: Vec<(String, PoseScores)> = full
        .configurations
        .iter()
        .zip(&full.rows)
        .map(|(configuration, rows)| {
            (configuration.name.clone(), summarize(rows.iter().map(|row| row.scored)))
        })
        .collect();
    let mut tables = paper_tables(&scores);
    // Scaling, centres and filters have no say in the dense fit: its rows are the same under all tables.
    let dense = |size: Option<usize>| -> Vec<Vec<String>> {
        let of_size = |kernel: &str| size.is_none_or(|size| kernel == size.to_string());
        let rows = scores.iter().filter_map(|(name, scores)| {
            let kernel = name.strip_prefix("dense: ").filter(|kernel| of_size(kernel))?;
            Some((format!("{kernel} dense"), *scores))
        });
        score_table("", &rows.collect::<Vec<_>>()).rows
    };
    for (table, size) in tables.iter_mut().zip([None, None, Some(FILTERED_KERNEL)]) {
        table.rows.extend(dense(size));
    }
    for run in runs {
        let rows = METHODS.iter().enumerate();
        let rows: Vec<_> = rows.map(|(i, method)| ((*method).to_owned(), run.scores(i))).collect();
        tables.push(score_table(&format!("28 x 28, {}", run.name), &rows));
    }
    tables.push(by_stratum(&runs[0]));
    tables.push(times(full));
    let said: Vec<_> = runs
        .iter()
        .map(|run| {
            let all = uncertainty::statements(run.of(METHODS.len() - 1));
            (run.name.clone(), uncertainty_scores(&all))
        })
        .collect();
    tables.push(uncertainty_table("What the dense fit says of itself", &said));
    tables
}

/// Scores of a method by distance, occlusion and truncation.
fn strata(run: &Run, method: usize) -> Vec<(String, PoseScores)> {
    let scored: Vec<(_, Scored)> =
        run.of(method).iter().map(|row| (row.stratum, row.scored)).collect();
    breakdown(&scored)
}

fn by_stratum(run: &Run) -> Table {
    let columns: Vec<String> = METHODS
        .iter()
        .flat_map(|method| [format!("{method}: IoU of all %"), format!("{method}: model %")])
        .collect();
    let titles: Vec<&str> =
        ["", "count"].into_iter().chain(columns.iter().map(String::as_str)).collect();
    let mut table =
        Table::new("By distance, occlusion and truncation: 28 x 28, sizes given", &titles);
    let by: Vec<_> = (0..METHODS.len()).map(|method| strata(run, method)).collect();
    for (index, (name, first)) in by[0].iter().enumerate() {
        let mut cells = vec![name.clone(), first.count.to_string()];
        for of_method in &by {
            let s = &of_method[index].1;
            for share in [s.mean_iou3d_all, s.model_precision] {
                cells.push(if share.is_nan() {
                    String::new()
                } else {
                    format!("{:.1}", 100.0 * share)
                });
            }
        }
        table.rows.push(cells);
    }
    table
}

/// Median milliseconds a vehicle.
fn milliseconds(rows: &[Row]) -> f64 {
    let mut times: Vec<f64> = rows.iter().map(|row| 1e3 * row.seconds).collect();
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}

fn times(evaluated: &Evaluated) -> Table {
    let columns = ["", "median ms", "mean ms", "IoU of all %", "model %"];
    let mut table = Table::new("Time a vehicle, one thread, on the machine as it was", &columns);
    for (configuration, rows) in evaluated.configurations.iter().zip(&evaluated.rows) {
        let scores = summarize(rows.iter().map(|row| row.scored));
        let sum: f64 = rows.iter().map(|row| 1e3 * row.seconds).sum();
        let mut name = configuration.name.clone();
        let _ = write!(name, " ({0} x {0})", configuration.kernel);
        table.rows.push(vec![
            name,
            format!("{:.2}", milliseconds(rows)),
            format!("{:.2}", sum / rows.len().max(1) as f64),
            format!("{:.1}", 100.0 * scores.mean_iou3d_all),
            format!("{:.1}", 100.0 * scores.model_precision),
        ]);
    }
    table
}

fn plots(runs: &[Run]) -> partpose::files::RgbImage {
    let share = |label: &str| Axis::over(label, [0.0, 1.0]);
    let drawn = |title: &str, x: Axis, series: Vec<Series>| {
        let y = share("mean 3D IoU, no pose counted as 0");
        plot(&Plot { title: title.to_owned(), x, y, series, size: [520, 400] })
    };
    let by_method = |points: &dyn Fn(usize) -> Vec<[f64; 2]>| -> Vec<Series> {
        let methods = METHODS.iter().enumerate();
        methods.map(|(i, method)| Series::new(method, Mark::Line, points(i))).collect()
    };
    let as_dots = |series: Vec<Series>| -> Vec<Series> {
        series.into_iter().map(|series| Series { mark: Mark::Dots, ..series }).collect()
    };
    let depth = |name: &str| {
        let (low, high) = name.strip_suffix(" m")?.split_once(" to ")?;
        Some(0.5 * (low.parse::<f64>().ok()? + high.parse::<f64>().ok()?))
    };
    let distance = by_method(&|method| {
        let rows = strata(&runs[0], method).into_iter();
        rows.filter_map(|(name, s)| Some([depth(&name)?, s.mean_iou3d_all])).collect()
    });
    let accuracy = by_method(&|method| {
        let given = runs.iter().filter(|run| run.extent == ExtentFlag::Truth);
        given.map(|run| [run.accuracy, run.scores(method).mean_iou3d_all]).collect()
    });
    let names = [
        "not truncated",
        "truncated",
        "fills 60 to 100 % of its box",
        "fills 30 to 60 % of its box",
        "fills 0 to 30 % of its box",
    ];
    let conditions = by_method(&|method| {
        let rows = strata(&runs[0], method);
        let find = |name: &&str| rows.iter().find(|(other, _)| other == *name);
        (1u32..)
            .zip(&names)
            .filter_map(|(i, name)| Some([f64::from(i), find(name)?.1.mean_iou3d_all]))
            .collect()
    });
    let extents = by_method(&|method| {
        let sizes = [0, runs.len() - 2, runs.len() - 1];
        (1u32..)
            .zip(sizes)
            .map(|(i, run)| [f64::from(i), runs[run].scores(method).mean_iou3d_all])
            .collect()
    });
    let full = &runs[0].evaluated;
    let logarithmic = Axis { logarithmic: true, ..Axis::new("milliseconds a vehicle, median") };
    panels(
        &[
            drawn("By distance", Axis::new("metres"), distance),
            drawn("By mask accuracy", Axis::over("pixels right", [0.78, 1.0]), accuracy),
            drawn("By kernel size", Axis::over("cells a side", [10.0, 60.0]), kernel_series(full)),
            drawn(
                "Cut by the image; hidden, by the share of its box that a vehicle fills",
                Axis::of_names(&["not cut", "cut", "60-100 %", "30-60 %", "0-30 %"]),
                as_dots(conditions),
            ),
            drawn(
                "By where sizes come from",
                Axis::of_names(&["given", "of the models", "free"]),
                as_dots(extents),
            ),
            drawn("Time beside accuracy, every row of the tables", logarithmic, time_series(full)),
        ],
        3,
    )
}

/// Time beside accuracy, a dot a configuration.
fn time_series(full: &Evaluated) -> Vec<Series> {
    let group = |name: &str| match name {
        _ if name.starts_with("dense") => 2,
        "points, best" => 1,
        _ => 0,
    };
    let methods = METHODS.iter().enumerate().map(|(i, method)| {
        let points =
            full.configurations.iter().zip(&full.rows).filter(|(c, _)| group(&c.name) == i);
        let points = points.map(|(_, rows)| {
            [milliseconds(rows), summarize(rows.iter().map(|row| row.scored)).mean_iou3d_all]
        });
        Series::new(method, Mark::Dots, points.collect())
    });
    methods.collect()
}

/// Accuracy by kernel size.
fn kernel_series(full: &Evaluated) -> Vec<Series> {
    let kernel = |method: usize| -> Vec<[f64; 2]> {
        let prefix = ["III: ", "", "dense: "][method];
        full.configurations
            .iter()
            .zip(&full.rows)
            .filter(|(c, _)| !prefix.is_empty() && c.name.starts_with(prefix))
            .filter(|(c, _)| method != 0 || c.name.ends_with("RECT / CUB"))
            .map(|(c, rows)| {
                let scores = summarize(rows.iter().map(|row| row.scored));
                [c.kernel as f64, scores.mean_iou3d_all]
            })
            .collect()
    };
    vec![
        Series::new("paper, Table III", Mark::Line, kernel(0)),
        Series { color: Some([0, 158, 115]), ..Series::new("dense", Mark::Line, kernel(2)) },
    ]
}
