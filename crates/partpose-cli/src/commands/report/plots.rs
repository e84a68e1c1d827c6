//! The plots of a report.

use std::collections::BTreeMap;

use partpose::eval::Table;
use partpose::viz::{Axis, Mark, Plot, Series, svg_matrix, svg_plot};

use super::folder::{Run, Vehicle};

/// Width of a bin of distance, metres.
const BIN: f64 = 10.0;
/// Fewest vehicles that make a bin.
const FEWEST: usize = 5;
/// Most models of a confusion that are shown.
const MOST_MODELS: usize = 40;
/// From this 3D IoU on a pose counts as right where a share of right ones is shown.
const RIGHT: f64 = 0.5;

/// Means of the 3D IoU over the distance, a line a run; vehicles without a pose count 0.
pub(super) fn over_distance(runs: &[Run]) -> Option<String> {
    let line = |run: &Run| {
        let mut bins: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for vehicle in &run.vehicles {
            let bin = (vehicle.depth.max(0.0) / BIN) as usize;
            bins.entry(bin).or_default().push(vehicle.iou.unwrap_or(0.0));
        }
        let full = bins.into_iter().filter(|(_, values)| values.len() >= FEWEST);
        let point = |(bin, values): (usize, Vec<f64>)| [(bin as f64 + 0.5) * BIN, mean(&values)];
        Series::new(&run.name, Mark::Line, full.map(point).collect())
    };
    plot("3D IoU over distance", ["metres", "mean 3D IoU"], runs.iter().map(line).collect())
}

/// The share of vehicles whose 3D IoU is at least so large, a line a run.
pub(super) fn distribution(runs: &[Run]) -> Option<String> {
    let line = |run: &Run| {
        let count = run.vehicles.len().max(1) as f64;
        let at_least = |least: f64| {
            run.vehicles.iter().filter(|v| v.iou.is_some_and(|iou| iou >= least)).count() as f64
        };
        let points = (0..=50).map(|i| f64::from(i) / 50.0).map(|t| [t, at_least(t) / count]);
        let points = if run.vehicles.is_empty() { Vec::new() } else { points.collect() };
        Series::new(&run.name, Mark::Curve, points)
    };
    let series = runs.iter().map(line).collect();
    plot("Vehicles at least so good", ["3D IoU", "share of all vehicles"], series)
}

/// How often a pose is right over how much the fit trusts itself; where the fit says so.
pub(super) fn calibration(runs: &[Run]) -> Option<String> {
    let line = |run: &Run| {
        let mut bins: BTreeMap<usize, Vec<[f64; 2]>> = BTreeMap::new();
        for vehicle in &run.vehicles {
            let (Some(confidence), Some(iou)) = (vehicle.confidence, vehicle.iou) else { continue };
            let bin = (confidence.clamp(0.0, 0.999) * 10.0) as usize;
            bins.entry(bin).or_default().push([confidence, f64::from(u8::from(iou >= RIGHT))]);
        }
        let of = |values: &[[f64; 2]], i: usize| {
            mean(&values.iter().map(|pair| pair[i]).collect::<Vec<_>>())
        };
        let full = bins.into_values().filter(|values| values.len() >= FEWEST);
        Series::new(&run.name, Mark::Line, full.map(|v| [of(&v, 0), of(&v, 1)]).collect())
    };
    let mut series: Vec<Series> = runs.iter().map(line).collect();
    if series.iter().all(|series| series.points.is_empty()) {
        return None;
    }
    series.push(Series::new("expected", Mark::Reference, vec![[0.0, 0.0], [1.0, 1.0]]));
    plot("Calibration", ["confidence", "share with 3D IoU of 0.5 or more"], series)
}

/// What each model was called.
pub(super) fn confusion(run: &Run) -> Option<String> {
    let called =
        |vehicle: &Vehicle| vehicle.predicted.clone().unwrap_or_else(|| "no pose".to_owned());
    let names = |name: &dyn Fn(&Vehicle) -> String| {
        let mut names: Vec<String> = run.vehicles.iter().map(name).collect();
        names.sort();
        names.dedup();
        names
    };
    let (rows, columns) = (names(&|vehicle| vehicle.model.clone()), names(&called));
    if rows.is_empty() || rows.len() > MOST_MODELS || columns.len() > MOST_MODELS {
        return None;
    }
    let mut counts = vec![0_u64; rows.len() * columns.len()];
    for vehicle in &run.vehicles {
        let row = rows.iter().position(|name| *name == vehicle.model);
        let column = columns.iter().position(|name| *name == called(vehicle));
        if let (Some(row), Some(column)) = (row, column) {
            counts[row * columns.len() + column] += 1;
        }
    }
    Some(svg_matrix("Models: what each is taken for, % of its row", &rows, &columns, &counts))
}

/// What each part was called.
pub(super) fn part_confusion(run: &Run) -> Option<String> {
    let table = run.confusion.as_ref()?;
    let rows: Vec<String> = table.rows.iter().map(|row| row[0].clone()).collect();
    let counts: Vec<u64> = table
        .rows
        .iter()
        .flat_map(|row| &row[1..])
        .map(|cell| cell.parse().ok())
        .collect::<Option<_>>()?;
    let title = "Parts: what each is taken for, % of its row";
    Some(svg_matrix(title, &rows, &table.columns[1..], &counts))
}

/// Precision over recall, a line a source of detections.
pub(super) fn precision(run: &Run) -> Option<String> {
    let table = run.precision.as_ref()?;
    let [name, recall, precision] =
        ["detections", "recall", "precision"].map(|name| super::csv::column(table, name));
    let (recall, precision) = (recall?, precision?);
    let mut lines: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
    for row in &table.rows {
        let (Ok(x), Ok(y)) = (row[recall].parse(), row[precision].parse()) else { continue };
        lines.entry(name.map_or("", |name| row[name].as_str())).or_default().push([x, y]);
    }
    let series =
        lines.into_iter().map(|(name, points)| Series::new(name, Mark::Curve, points)).collect();
    plot("Boxes: precision over recall", ["recall", "precision"], series)
}

/// How accurate each configuration is over the time it takes, where a run has measured both; a colour a kind.
pub(super) fn time(runs: &[Run]) -> Option<String> {
    let mut kinds: BTreeMap<String, Vec<[f64; 2]>> = BTreeMap::new();
    for table in runs.iter().flat_map(|run| &run.tables) {
        let column = |name: &str| super::csv::column(table, name);
        let (Some(time), Some(iou)) = (column("median ms"), column("IoU of all %")) else {
            continue;
        };
        for row in &table.rows {
            let (Ok(x), Ok(y)) = (row[time].parse::<f64>(), row[iou].parse::<f64>()) else {
                continue;
            };
            let kind = row[0].split([':', ',', ' ']).next().unwrap_or_default();
            kinds.entry(kind.to_owned()).or_default().push([x, y]);
        }
    }
    if kinds.is_empty() {
        return None;
    }
    let series = kinds.iter().map(|(kind, points)| Series::new(kind, Mark::Dots, points.clone()));
    let x = Axis { logarithmic: true, ..Axis::new("milliseconds a vehicle, median") };
    Some(svg_plot(&Plot {
        title: "Accuracy over time".to_owned(),
        x,
        y: Axis::new("mean 3D IoU, %, no pose counted as 0"),
        series: series.collect(),
        size: [560, 340],
    }))
}

/// Each column of numbers over the steps of a training.
pub(super) fn curves(table: &Table) -> Vec<String> {
    let numbers = |column: usize| -> Vec<Option<f64>> {
        table
            .rows
            .iter()
            .map(|row| row[column].parse().ok().filter(|v: &f64| v.is_finite()))
            .collect()
    };
    let steps = numbers(0);
    let one = |column: usize| {
        let values = numbers(column);
        let points: Vec<[f64; 2]> =
            steps.iter().zip(values).filter_map(|(x, y)| Some([(*x)?, y?])).collect();
        let name = &table.columns[column];
        let series = vec![Series::new("", Mark::Curve, points)];
        plot(&format!("{}: {name}", table.title), [&table.columns[0], ""], series)
    };
    (1..table.columns.len()).filter_map(one).collect()
}

/// How many vehicles stand how far away, of results without labels.
pub(super) fn distances(run: &Run) -> Option<String> {
    let mut bins: BTreeMap<usize, u32> = BTreeMap::new();
    for vehicle in run.results.iter().flat_map(|image| &image.vehicles) {
        let distance = vehicle.cuboid.camera_from_vehicle.translation.vector.norm();
        *bins.entry((distance / BIN).min(50.0) as usize).or_default() += 1;
    }
    let points =
        bins.into_iter().map(|(bin, n)| [(bin as f64 + 0.5) * BIN, f64::from(n)]).collect();
    let series = vec![Series::new("", Mark::Bars, points)];
    plot("Vehicles found over distance", ["metres", "vehicles"], series)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// `None` where there is nothing to show.
fn plot(title: &str, [x, y]: [&str; 2], mut series: Vec<Series>) -> Option<String> {
    series.retain(|series| series.points.len() > 1 || series.mark == Mark::Bars);
    let is_shown = |series: &Series| !series.points.is_empty() && series.mark != Mark::Reference;
    if !series.iter().any(is_shown) {
        return None;
    }
    // Shares are shown from 0 to 1, so that plots can be compared.
    let all = || series.iter().flat_map(|series| &series.points);
    let names_share = ["IoU", "precision", "share"].iter().any(|name| y.contains(name));
    let is_share = names_share && all().all(|point| (0.0..=1.0).contains(&point[1]));
    let y = if is_share { Axis::over(y, [0.0, 1.0]) } else { Axis::new(y) };
    let title = title.to_owned();
    Some(svg_plot(&Plot { title, x: Axis::new(x), y, series, size: [560, 340] }))
}
