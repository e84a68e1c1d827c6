//! `partpose demo`: the main job on what the repository ships.
//!
//! Images of the synthetic world, which are part of the program, are looked at by the network that comes with it, and the
//! embedded models are fitted to what it finds, as `run` does. Nothing of the truth goes in but into the scores and the
//! green boxes of the pictures. Everything that `run` writes is written, and what `fit` and `evaluate` need to do it again.

mod sample;
mod scores;

use std::path::{Path, PathBuf};

use partpose::dataset::{Dataset, Frame};
use partpose::detection::{DetectedSize, Detection};
use partpose::files::{self, RgbImage};
use partpose::formats::{DetectionFile, PosedImage, PosedVehicle, result_json, write_detections};
use partpose::geometry::Camera;
use partpose::oracle::Oracle;
use partpose::vehicle::ModelZoo;

use self::scores::Scores;
use super::fitting::{Counts, FitFlags, Fitter, Shown};
use crate::network::{EngineFlags, Network};
use crate::report::{self, Outcome, hint, note};

/// Least score of the detections that are shown; that of `run`.
const MIN_SCORE: f64 = 0.5;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose demo
  partpose demo --scenes 1 --weights run/best.safetensors --out out/mine")]
pub(crate) struct Arguments {
    /// Folder for pictures and results
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,
    /// How many of the images [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    scenes: Option<u32>,
    /// Weights of the network; those that come with the program if not given
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
}

/// One image with its truth, and what the network finds in it.
struct Scene {
    name: String,
    frame: Frame,
    image: RgbImage,
    oracle: Oracle,
    found: Vec<Detection>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let out = &arguments.out;
    let zoo = ModelZoo::embedded();
    files::create_folder(out)?;
    // First what can be refused, so that nothing else is overwritten then.
    zoo.save(&out.join("zoo"))?;
    let network = Network::load(arguments.weights.as_deref(), &EngineFlags::default())?;
    let fitter = Fitter::new(&FitFlags::default(), out)?;
    let data = out.join("data");
    sample::write(&data)?;
    let count = arguments.scenes.map_or(usize::MAX, |count| count as usize);
    let frames = frames(&data, count)?;
    let mut scores = Scores::default();
    let mut counts = Counts::default();
    let mut found = Vec::new();
    for (index, frame) in frames.into_iter().enumerate() {
        let scene = look(format!("scene-{}", index + 1), frame, &network, &zoo)?;
        counts.add(&fit(&scene, &fitter, &mut scores)?);
        let image = out.join(format!("images/{}.png", scene.name));
        files::write_png(&image, &scene.image)?;
        let truth = result_json(&truth(&scene));
        files::write(&out.join(format!("truth/{}.json", scene.name)), truth.as_bytes())?;
        let text = camera_toml(&scene.frame.camera);
        files::write(&out.join("camera.toml"), text.as_bytes())?;
        found.push((format!("{}.png", scene.name), scene.found));
    }
    write_detections(&out.join("detections.safetensors"), &detection_file(found))?;
    let (tables, metrics) = scores.summary();
    report::data(&tables)?;
    files::write(&out.join("metrics.json"), serde_json::to_string_pretty(&metrics)?.as_bytes())?;
    tell(out, &counts);
    Ok(Outcome::Done)
}

/// The first frames of the sample.
fn frames(data: &Path, count: usize) -> anyhow::Result<Vec<Frame>> {
    let dataset = Dataset::open(data)?;
    let mut frames = Vec::new();
    for id in dataset.sequences() {
        frames.extend(dataset.frames(id)?);
    }
    frames.truncate(count);
    Ok(frames)
}

fn look(name: String, frame: Frame, network: &Network, zoo: &ModelZoo) -> anyhow::Result<Scene> {
    let path = frame.image.as_ref().ok_or_else(|| anyhow::anyhow!("a frame has no image"))?;
    let image = files::read_rgb(path)?;
    let oracle = Oracle::new(&frame, frame.read_parts()?, zoo);
    let mut found = network.detect(&image)?;
    found.retain(|found| found.score >= MIN_SCORE);
    Ok(Scene { name, frame, image, oracle, found })
}

/// Fits the models as `run` does, and once more with the true sizes for the scores alone.
fn fit(scene: &Scene, fitter: &Fitter, scores: &mut Scores) -> anyhow::Result<Counts> {
    let Scene { name, frame, image, oracle, found } = scene;
    let matched = scores.add_boxes(frame, oracle, found);
    let with_true_size = |(detection, vehicle): (&Detection, &Option<usize>)| {
        let label = vehicle.map(|vehicle| &frame.vehicles[vehicle]);
        let size = label.map(|label| DetectedSize::exact(label.cuboid.extent)).or(detection.size);
        Detection { size, ..detection.clone() }
    };
    let given = found.iter().zip(&matched).map(with_true_size).collect();
    let given = fitter.estimate(&frame.camera, given);
    let estimated = fitter.estimate(&frame.camera, found.clone());
    scores.add_poses(frame, &matched, [&estimated, &given]);
    let truth = |i: usize| matched[i].map(|vehicle| frame.vehicles[vehicle].cuboid);
    let file = format!("{name}.png");
    let (camera, image) = (&frame.camera, Some(image));
    fitter.write(&Shown { name: &file, stem: name, camera, image, truth: &truth }, &estimated)
}

/// The labelled vehicles that are not to be ignored, in the form of results.
fn truth(scene: &Scene) -> PosedImage {
    let labelled = scene.frame.vehicles.iter().filter(|label| !label.dont_care);
    let vehicles = labelled.map(|label| PosedVehicle {
        model: label.model.clone().unwrap_or_default(),
        category: label.category.clone(),
        bounds: label.bounds,
        score: 1.0,
        cuboid: label.cuboid,
        confidence: None,
        covariance: None,
        reprojection_rmse: None,
        track: None,
    });
    let image = format!("{}.png", scene.name);
    PosedImage { image, camera: scene.frame.camera, vehicles: vehicles.collect() }
}

/// A camera as `fit` reads it.
fn camera_toml(camera: &Camera) -> String {
    let ([fx, fy], [cx, cy], [width, height]) = (camera.focal, camera.principal_point, camera.size);
    format!(
        "width = {width}\nheight = {height}\nfx = {fx:?}\nfy = {fy:?}\ncx = {cx:?}\ncy = {cy:?}\n"
    )
}

/// All detections as one file.
fn detection_file(found: Vec<(String, Vec<Detection>)>) -> DetectionFile {
    let mut file = DetectionFile { images: Vec::new(), detections: Vec::new() };
    for (index, (name, found)) in found.into_iter().enumerate() {
        file.images.push(name);
        file.detections.extend(found.into_iter().map(|detection| (index, detection)));
    }
    file
}

fn tell(out: &Path, counts: &Counts) {
    let out = out.display();
    note(format_args!(
        "found {} vehicles, {} of them without a pose; wrote pictures, poses and scores to `{out}`",
        counts.posed + counts.without,
        counts.without
    ));
    let program =
        std::env::current_exe().map_or("partpose".to_owned(), |path| path.display().to_string());
    note(format_args!(
        "next: {program} run {out}/images --camera {out}/camera.toml --out {out}/run"
    ));
}

/// An error of a program that was built without the sample.
fn no_sample() -> anyhow::Error {
    hint(
        anyhow::anyhow!("this program was built without the sample images"),
        "build it from a clone that has `examples/world`, or give images to `partpose run`",
    )
}
