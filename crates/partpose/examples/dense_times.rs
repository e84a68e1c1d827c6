//! How long the dense fit takes a vehicle, and how good it is, over labelled frames with exact part masks.
//!
//! `dense_times DATASET ORACLE_ZOO MODELS [WORLDS [STRIDE [REPEATS]]]`: one thread, kernels of 28 x 28 cells, sizes from
//! the truth. `ORACLE_ZOO` tells the vehicles of a mask apart and, unless `MODELS` says otherwise, is what is fitted:
//! `known` fits each vehicle's own model, `all` the whole zoo, a number so many of the models that come with the
//! program. A vehicle's time is the shortest of `REPEATS` runs; the median is over vehicles. Wherever a 3D IoU is
//! wanted of masks whose outlines lie elsewhere, `evaluate poses` has more to say.

use std::path::Path;
use std::time::Instant;

use partpose::dataset::Dataset;
use partpose::eval::pose_deviation;
use partpose::oracle::{Oracle, OracleOptions};
use partpose::pose::{ExtentSource, PnpMethod, PoseEstimator, PoseOptions};
use partpose::vehicle::ModelZoo;

type Failure = Box<dyn std::error::Error>;

/// What was found of one vehicle.
struct Row {
    seconds: f64,
    pictures: usize,
    energy: f64,
    iou: f64,
    model_is_right: bool,
    depth: f64,
    name: String,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [dataset, oracle_zoo, models, more @ ..] = arguments.as_slice() else {
        let usage = "dense_times DATASET ORACLE_ZOO known|all|COUNT [WORLDS [STRIDE [REPEATS]]]";
        return Err(usage.into());
    };
    let worlds = more.first().map_or(Vec::new(), |w| w.split(',').map(str::to_owned).collect());
    let number = |at: usize, otherwise: usize| -> Result<usize, Failure> {
        Ok(more.get(at).map_or(Ok(otherwise), |text| text.parse())?)
    };
    let (stride, repeats) = (number(1, 20)?.max(1), number(2, 3)?.max(1));
    let dataset = Dataset::open(Path::new(dataset))?;
    let oracle_zoo = ModelZoo::load(Path::new(oracle_zoo))?;
    let (estimators, zoo) = estimators(&oracle_zoo, models)?;
    let mut rows = Vec::new();
    for sequence in dataset.select(&worlds, &[])? {
        for frame in dataset.frames(&sequence)?.iter().step_by(stride) {
            let known = |index: &usize| {
                let label = &frame.vehicles[*index];
                let model = label.model.as_deref().and_then(|name| oracle_zoo.get(name));
                !label.dont_care && model.is_some()
            };
            let oracle = Oracle::new(frame, frame.read_parts()?, &oracle_zoo);
            for index in (0..frame.vehicles.len()).filter(known) {
                let label = &frame.vehicles[index];
                let name = label.model.clone().unwrap_or_default();
                let Some(detection) = oracle.detection(index, &OracleOptions::default()) else {
                    continue;
                };
                let own = |(models, _): &&(Vec<String>, _)| models.len() > 1 || models[0] == name;
                let Some((_, estimator)) = estimators.iter().find(own) else { continue };
                let extent = ExtentSource::Given(label.cuboid.extent);
                let mut seconds = f64::INFINITY;
                let mut found = None;
                for _ in 0..repeats {
                    let start = Instant::now();
                    found = estimator.estimate(&frame.camera, &detection, &extent).ok();
                    seconds = seconds.min(start.elapsed().as_secs_f64());
                }
                let Some(found) = found else { continue };
                let report = found.dense.as_ref().ok_or("not a dense fit")?;
                let is_right = found.model == name || !zoo.contains(&name);
                rows.push(Row {
                    seconds,
                    pictures: report.pictures,
                    energy: report.energy,
                    iou: pose_deviation(&found.cuboid(), &label.cuboid, is_right).iou3d,
                    model_is_right: found.model == name,
                    depth: label.cuboid.center().z,
                    name: format!("{} {index} {name} as {}", frame.name(), found.model),
                });
            }
        }
    }
    tell(&rows);
    Ok(())
}

/// Estimators with the models that each fits, and the names of all.
type Estimators = (Vec<(Vec<String>, PoseEstimator)>, Vec<String>);

fn estimators(oracle_zoo: &ModelZoo, models: &str) -> Result<Estimators, Failure> {
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
    let all = zoos.iter().flat_map(names).collect();
    let estimators = zoos.iter().map(|zoo| (names(zoo), PoseEstimator::new(zoo, &options)));
    Ok((estimators.collect(), all))
}

#[allow(clippy::print_stdout)]
fn tell(rows: &[Row]) {
    let quantile = |value: &dyn Fn(&Row) -> f64, share: f64| {
        let mut values: Vec<f64> = rows.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values.get((share * values.len() as f64) as usize).copied().unwrap_or(f64::NAN)
    };
    let mean =
        |value: &dyn Fn(&Row) -> f64| rows.iter().map(value).sum::<f64>() / rows.len() as f64;
    if std::env::var_os("ROWS").is_some() {
        for row in rows {
            println!(
                "{:7.2} ms {:4} pictures, energy {:.3}, IoU {:.3}, {:5.1} m, {}",
                1e3 * row.seconds,
                row.pictures,
                row.energy,
                row.iou,
                row.depth,
                row.name
            );
        }
    }
    let ms = |row: &Row| 1e3 * row.seconds;
    println!(
        "{} vehicles: median {:.2} ms, mean {:.2}, nine of ten below {:.2}; pictures {:.0} (median {:.0}); \
         energy {:.3} (median {:.3}); IoU {:.4} (median {:.4}), right model {:.4}",
        rows.len(),
        quantile(&ms, 0.5),
        mean(&ms),
        quantile(&ms, 0.9),
        mean(&|row| row.pictures as f64),
        quantile(&|row| row.pictures as f64, 0.5),
        mean(&|row| row.energy),
        quantile(&|row| row.energy, 0.5),
        mean(&|row| row.iou),
        quantile(&|row| row.iou, 0.5),
        mean(&|row| f64::from(u8::from(row.model_is_right))),
    );
}
