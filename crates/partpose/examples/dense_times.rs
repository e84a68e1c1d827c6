//! How long the dense fit takes a vehicle, and how good it is, over labelled frames with exact part masks.
//!
//! `dense_times DATASET ORACLE_ZOO MODELS [WORLDS [STRIDE [REPEATS]]]`: one thread, kernels of 28 x 28 cells, sizes from
//! the truth. `ORACLE_ZOO` tells the vehicles of a mask apart and, unless `MODELS` says otherwise, is what is fitted:
//! `known` fits each vehicle's own model, `all` the whole zoo, a number so many of the models that come with the
//! program. A vehicle's time is the shortest of `REPEATS` runs; medians are over vehicles. Vehicles are told apart by how
//! much of what the model at the true pose shows is background in the mask: behind something unlabelled. Where masks
//! have their outlines elsewhere than models, `evaluate poses --mask-bias` tells how good the fit is.

use std::path::Path;
use std::time::Instant;

use partpose::dataset::{Dataset, Frame};
use partpose::eval::pose_deviation;
use partpose::oracle::{Oracle, OracleOptions};
use partpose::parts::BACKGROUND;
use partpose::pose::{ExtentSource, PnpMethod, PoseEstimator, PoseOptions};
use partpose::render::render_labels;
use partpose::vehicle::ModelZoo;

type Failure = Box<dyn std::error::Error>;

/// What was found of one vehicle.
struct Row {
    seconds: f64,
    pictures: usize,
    energy: f64,
    iou: f64,
    is_right: bool,
    /// Share of what is drawn at the true pose that the mask has as background.
    hidden: f64,
}

/// From which share on a vehicle counts as hidden by something unlabelled.
const HIDDEN: f64 = 0.02;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, oracle_zoo, models, more @ ..] = arguments.as_slice() else {
        let usage = "dense_times DATASET ORACLE_ZOO known|all|COUNT [WORLDS [STRIDE [REPEATS]]]";
        return Err(usage.into());
    };
    let worlds = more.first().map_or("", String::as_str).split(',').filter(|w| !w.is_empty());
    let worlds: Vec<String> = worlds.map(str::to_owned).collect();
    let number = |at: usize, otherwise: usize| -> Result<usize, Failure> {
        Ok(more.get(at).map_or(Ok(otherwise), |text| text.parse())?)
    };
    let (stride, repeats) = (number(1, 20)?.max(1), number(2, 3)?.max(1));
    let dataset = Dataset::open(Path::new(dataset))?;
    let oracle_zoo = ModelZoo::load(Path::new(oracle_zoo))?;
    let estimators = estimators(&oracle_zoo, models)?;
    let mut rows = Vec::new();
    for sequence in dataset.select(&worlds, &[])? {
        for frame in dataset.frames(&sequence)?.iter().step_by(stride) {
            rows.extend(fit_frame(frame, &oracle_zoo, &estimators, repeats)?);
        }
    }
    tell("all", &rows.iter().collect::<Vec<_>>());
    tell(
        "nothing unlabelled in front",
        &rows.iter().filter(|r| r.hidden < HIDDEN).collect::<Vec<_>>(),
    );
    tell(
        "behind something unlabelled",
        &rows.iter().filter(|r| r.hidden >= HIDDEN).collect::<Vec<_>>(),
    );
    Ok(())
}

fn fit_frame(
    frame: &Frame,
    oracle_zoo: &ModelZoo,
    estimators: &[(Vec<String>, PoseEstimator)],
    repeats: usize,
) -> Result<Vec<Row>, Failure> {
    let parts = frame.read_parts()?;
    let drawn = render_labels(&frame.camera, &frame.instances(oracle_zoo));
    let hidden = |index: usize| {
        let own = drawn.instances.iter().zip(&parts.labels);
        let own = own.filter(|(id, _)| usize::from(**id) == index + 1);
        let (all, empty) = own.fold((0u32, 0u32), |(all, empty), (_, label)| {
            (all + 1, empty + u32::from(*label == BACKGROUND))
        });
        f64::from(empty) / f64::from(all.max(1))
    };
    let hidden: Vec<f64> = (0..frame.vehicles.len()).map(hidden).collect();
    let oracle = Oracle::new(frame, parts, oracle_zoo);
    let mut rows = Vec::new();
    for (index, label) in frame.vehicles.iter().enumerate() {
        let Some(name) = label.model.clone().filter(|name| oracle_zoo.get(name).is_some()) else {
            continue;
        };
        let own = |(models, _): &&(Vec<String>, _)| models.len() > 1 || models[0] == name;
        let Some((_, estimator)) = estimators.iter().find(own).filter(|_| !label.dont_care) else {
            continue;
        };
        let Some(detection) = oracle.detection(index, &OracleOptions::default()) else { continue };
        let extent = ExtentSource::Given(label.cuboid.extent);
        let (mut seconds, mut found) = (f64::INFINITY, None);
        for _ in 0..repeats {
            let start = Instant::now();
            found = estimator.estimate(&frame.camera, &detection, &extent).ok();
            seconds = seconds.min(start.elapsed().as_secs_f64());
        }
        let report = found.as_ref().and_then(|found| found.dense.as_ref());
        let is_right = found.as_ref().is_some_and(|found| found.model == name);
        let iou =
            found.as_ref().map(|found| pose_deviation(&found.cuboid(), &label.cuboid, is_right));
        rows.push(Row {
            seconds,
            pictures: report.map_or(0, |report| report.pictures),
            energy: report.map_or(1.0, |report| report.energy),
            iou: iou.map_or(0.0, |deviation| deviation.iou3d),
            is_right,
            hidden: hidden[index],
        });
    }
    Ok(rows)
}

/// Estimators with the names of the models that each fits.
fn estimators(
    oracle_zoo: &ModelZoo,
    models: &str,
) -> Result<Vec<(Vec<String>, PoseEstimator)>, Failure> {
    let options = PoseOptions { method: PnpMethod::Dense, ..Default::default() };
    let names = |zoo: &ModelZoo| -> Vec<String> {
        zoo.models.iter().map(|model| model.name().to_owned()).collect()
    };
    let zoos: Vec<ModelZoo> = match models {
        "all" => vec![oracle_zoo.clone()],
        "known" => {
            let alone = |index: usize| {
                let mut zoo = oracle_zoo.clone();
                zoo.models.swap(0, index);
                zoo.models.truncate(1);
                zoo
            };
            (0..oracle_zoo.models.len()).map(alone).collect()
        }
        count => {
            let mut zoo = ModelZoo::embedded();
            zoo.models.truncate(count.parse()?);
            vec![zoo]
        }
    };
    Ok(zoos.iter().map(|zoo| (names(zoo), PoseEstimator::new(zoo, &options))).collect())
}

#[allow(clippy::print_stdout)]
fn tell(name: &str, rows: &[&Row]) {
    let quantile = |value: &dyn Fn(&Row) -> f64, share: f64| {
        let mut values: Vec<f64> = rows.iter().map(|row| value(row)).collect();
        values.sort_by(f64::total_cmp);
        values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN)
    };
    let mean = |value: &dyn Fn(&Row) -> f64| {
        rows.iter().map(|row| value(row)).sum::<f64>() / rows.len() as f64
    };
    let ms = |row: &Row| 1e3 * row.seconds;
    println!(
        "{name}: {} vehicles, median {:.2} ms, mean {:.2}, nine of ten below {:.2}, median of {:.0} pictures, \
         energy {:.4} (median {:.4}), 3D IoU {:.4} (median {:.4}), right model {:.4}",
        rows.len(),
        quantile(&ms, 0.5),
        mean(&ms),
        quantile(&ms, 0.9),
        quantile(&|row| row.pictures as f64, 0.5),
        mean(&|row| row.energy),
        quantile(&|row| row.energy, 0.5),
        mean(&|row| row.iou),
        quantile(&|row| row.iou, 0.5),
        mean(&|row| f64::from(u8::from(row.is_right))),
    );
}
