//! `partpose demo`: the main job on what the repository ships.
//!
//! Streets of the embedded models stand in for photographs: their part masks are rendered, made as wrong as a network's
//! (Table II: about 85 % of the pixels right), and fitted with the sizes given, which is the paper's protocol.
//! Everything that `fit` writes is written, its input too.

mod street;

use std::path::{Path, PathBuf};

use partpose::dataset::Frame;
use partpose::detection::Detection;
use partpose::eval::{PoseScores, Scored, pose_deviation, score_table, summarize};
use partpose::files;
use partpose::formats::{
    DetectionFile, PosedImage, PosedVehicle, ResultSettings, image_result, result_json,
    write_detections,
};
use partpose::oracle::{Degradation, Oracle, OracleOptions};
use partpose::pose::{ExtentSource, NoPose, PnpMethod, PoseEstimate, PoseEstimator, PoseOptions};
use partpose::vehicle::ModelZoo;

use super::result_files::{self, Pictured};
use crate::report::{self, Outcome, note};

/// Strength of the oracle's errors: about 85 % pixel accuracy, as the paper's network has (Table II).
const ERRORS: f64 = 0.9;

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Folder for pictures and results
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// How many streets
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    scenes: u32,
    /// Seed of the streets and of the detections' errors
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// One vehicle's detection, estimate and label.
struct Found {
    vehicle: usize,
    detection: Detection,
    estimate: Result<PoseEstimate, NoPose>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = ModelZoo::embedded();
    let options = PoseOptions { method: PnpMethod::Dense, ..Default::default() };
    let estimator = PoseEstimator::new(&zoo, &options);
    let (mut scored, mut accuracies): (Vec<Scored>, Vec<f64>) = Default::default();
    let mut file =
        DetectionFile { images: Vec::new(), detections: Vec::new(), extents: Some(Vec::new()) };
    let settings = ResultSettings {
        version: env!("CARGO_PKG_VERSION"),
        zoo: "embedded".to_owned(),
        extent: "given: the true sizes".to_owned(),
        pose: options,
    };
    files::create_folder(&arguments.out)?;
    // First what can be refused, so that nothing else is overwritten then.
    zoo.save(&arguments.out.join("zoo"))?;
    for index in 0..arguments.scenes {
        let frame = street::frame(&zoo, index, arguments.seed);
        let parts = street::part_mask(&frame, &zoo);
        let oracle = Oracle::new(&frame, parts, &zoo);
        let found = find(&frame, &oracle, &estimator, arguments.seed);
        let name = format!("scene-{}", index + 1);
        for one in &found {
            let label = &frame.vehicles[one.vehicle];
            let right = |e: &PoseEstimate| label.model.as_deref() == Some(e.model.as_str());
            let deviation = |e: &PoseEstimate| pose_deviation(&e.cuboid(), &label.cuboid, right(e));
            scored.push(one.estimate.as_ref().ok().map(deviation));
            let mask = one.detection.part_mask(frame.camera.size, options.scaling);
            accuracies
                .push(mask.agreement(&oracle.vehicle_mask(one.vehicle, &one.detection.bounds)));
            file.detections.push((index as usize, one.detection.clone()));
            file.extents.get_or_insert_default().push(label.cuboid.extent);
        }
        write(&arguments.out, &name, &frame, (&zoo, &settings), &found)?;
        file.images.push(format!("{name}.png"));
    }
    write_detections(&arguments.out.join("detections.safetensors"), &file)?;
    files::write(&arguments.out.join("camera.toml"), street::camera_toml().as_bytes())?;
    summary(&arguments.out, &summarize(scored), &accuracies)?;
    Ok(Outcome::Done)
}

/// A detection and an estimate of every vehicle that is seen well enough to be labelled.
fn find(frame: &Frame, oracle: &Oracle, estimator: &PoseEstimator, seed: u64) -> Vec<Found> {
    let degradation = Some(Degradation { strength: ERRORS, seed });
    let options = OracleOptions { degradation, ..Default::default() };
    let labelled = (0..frame.vehicles.len()).filter(|i| !frame.vehicles[*i].dont_care);
    labelled
        .filter_map(|vehicle| {
            let detection = oracle.detection(vehicle, &options)?;
            // The paper's protocol: the size is given, since one image cannot tell it from the distance.
            let extent = ExtentSource::Given(frame.vehicles[vehicle].cuboid.extent);
            let mut estimate = estimator.estimate(&frame.camera, &detection, &extent);
            if let Ok(estimate) = &mut estimate {
                estimator.observe(&frame.camera, &detection, estimate);
            }
            Some(Found { vehicle, detection, estimate })
        })
        .collect()
}

fn write(
    folder: &Path,
    name: &str,
    frame: &Frame,
    (zoo, settings): (&ModelZoo, &ResultSettings),
    found: &[Found],
) -> anyhow::Result<()> {
    let estimated: Vec<(Detection, Result<PoseEstimate, NoPose>)> =
        found.iter().map(|one| (one.detection.clone(), one.estimate.clone())).collect();
    let result = image_result(&format!("{name}.png"), &frame.camera, settings, &estimated);
    let written: Vec<_> = estimated.iter().map(|(d, e)| (d, e.as_ref().ok())).collect();
    result_files::write_results(folder, name, &result, &written, zoo)?;
    let pictured: Vec<Pictured> = found
        .iter()
        .map(|one| Pictured {
            detection: &one.detection,
            estimate: one.estimate.as_ref().ok(),
            zoo,
            truth: Some(frame.vehicles[one.vehicle].cuboid),
        })
        .collect();
    let image = street::photograph(frame, zoo);
    let drawn = (pictured.as_slice(), settings.pose.scaling);
    let picture = result_files::picture(name, &frame.camera, Some(&image), drawn);
    files::write_png(&folder.join(format!("{name}.png")), &picture)?;
    files::write_png(&folder.join(format!("images/{name}.png")), &image)?;
    let truth = result_json(&truth(name, frame));
    files::write(&folder.join(format!("truth/{name}.json")), truth.as_bytes())?;
    Ok(())
}

/// The labelled vehicles that are not to be ignored, in the form of results.
fn truth(name: &str, frame: &Frame) -> PosedImage {
    let labelled = frame.vehicles.iter().filter(|label| !label.dont_care);
    let vehicles = labelled.map(|label| PosedVehicle {
        model: label.model.clone().unwrap_or_default(),
        category: label.category.clone(),
        bounds: label.bounds,
        score: 1.0,
        cuboid: label.cuboid,
        confidence: None,
        reprojection_rmse: None,
        track: None,
    });
    PosedImage { image: format!("{name}.png"), camera: frame.camera, vehicles: vehicles.collect() }
}

fn summary(folder: &Path, scores: &PoseScores, accuracies: &[f64]) -> anyhow::Result<()> {
    let accuracy = accuracies.iter().sum::<f64>() / accuracies.len().max(1) as f64;
    let table = score_table("Poses of the demo", &[("demo".to_owned(), *scores)]);
    report::data(&table.to_markdown())?;
    let mut metrics = serde_json::to_value(scores)?;
    if let Some(object) = metrics.as_object_mut() {
        object.insert("mean_pixel_accuracy".to_owned(), accuracy.into());
        object.insert("extent".to_owned(), "given: the true sizes".into());
    }
    let text = serde_json::to_string_pretty(&metrics)?;
    files::write(&folder.join("metrics.json"), text.as_bytes())?;
    let percent = 100.0 * accuracy;
    note(format_args!(
        "masks with {percent:.1} % of the pixels right, as a network would make them; sizes are given"
    ));
    note(format_args!("wrote pictures, poses and scores to `{}`", folder.display()));
    let out = folder.display();
    let program =
        std::env::current_exe().map_or("partpose".to_owned(), |path| path.display().to_string());
    note(format_args!(
        "next: {program} fit --detections {out}/detections.safetensors --camera {out}/camera.toml --zoo {out}/zoo \
         --fit dense --out {out}/fit"
    ));
    Ok(())
}
