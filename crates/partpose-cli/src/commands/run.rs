//! `partpose run`: images to vehicles and poses.

mod inputs;
mod record;

use std::path::{Path, PathBuf};

use partpose::detection::Detection;
use partpose::files::{self, RgbImage, read_photo};
use partpose::formats::{DetectionFile, write_detections};
use partpose::geometry::Camera;
use partpose::labeling::Shard;

use self::inputs::Input;
use crate::camera::{Cameras, Origin};
use crate::commands::detection_files::ENDING;
use crate::commands::fitting::{Counts, FitFlags, Fitter, Fitting, parse_score};
use crate::commands::tracking::{self, TrackFlags};
use crate::network::{EngineFlags, Network};
use crate::progress;
use crate::report::{Outcome, note, warn};
use crate::side_by_side::{JobsFlag, side_by_side};

/// Folder of the detections below the output.
const DETECTIONS: &str = "detections";

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  partpose run photo.jpg --out out
      the focal length is taken from the photo's EXIF, or guessed
  partpose run training/image_2 --camera . --out out
      a KITTI or Virtual KITTI folder knows the camera of each of its images
  partpose run 'frames/*.png' --camera camera.toml --shard 1/2 --resume --out out
  partpose run frames --camera camera.toml --track --fps 25 --out out
      the images are a sequence: vehicles keep their numbers, poses are smoothed
  partpose run frames --camera camera.toml --onnx-model mine.onnx --mapping mine.toml --out out
      a detector of your own (docs/guide/5-detector.md)")]
pub(crate) struct Arguments {
    /// Images (PNG, JPEG), folders of them, or patterns such as 'frames/*.png'
    #[arg(required = true, value_name = "IMAGE|DIR|GLOB")]
    images: Vec<String>,
    /// Camera: TOML, KITTI calib, or the folder of a data set. Without it the focal length is guessed from EXIF, else from
    /// `--fov`; distances are as wrong as the guess
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Field of view along the longer side of images without camera and EXIF, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 70.0, value_parser = parse_angle, conflicts_with = "camera")]
    fov: f64,
    /// Weights of the network; those that come with the program if not given
    #[arg(long, value_name = "FILE")]
    weights: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineFlags,
    #[command(flatten)]
    jobs: JobsFlag,
    /// Leave out detections with a lower score
    #[arg(long, value_name = "SCORE", default_value_t = 0.5, value_parser = parse_score)]
    min_score: f64,
    #[command(flatten)]
    fit: FitFlags,
    #[command(flatten)]
    track: TrackFlags,
    /// Keep what an earlier run with the same settings has written, and do the rest
    #[arg(long)]
    resume: bool,
    /// Do part I of N of the images; all parts may write to the same folder
    #[arg(long, value_name = "I/N", conflicts_with = "track")]
    shard: Option<Shard>,
    /// Folder for results: JSON, KITTI text and a picture an image, and the detections in `detections/`
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

pub(crate) fn parse_angle(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (1.0..=170.0).contains(&value) => Ok(value),
        _ => Err("an angle from 1 to 170 degrees is meant".to_owned()),
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    // What was typed is checked before the network is made ready.
    let inputs = inputs::collect(&arguments.images, arguments.shard)?;
    // Either has a core to itself for most of its time.
    let (network, fitter) = rayon::join(
        || Network::load(arguments.weights.as_deref(), &arguments.engine),
        || Fitter::new(&arguments.fit, &arguments.out),
    );
    let (network, fitter) = (network?, fitter?);
    let detect = |image: &RgbImage| network.detect(image);
    run_with(arguments, &inputs, (&network.identity, &detect), fitter)
}

/// The detector: an image to what it shows.
type Detect<'a> = &'a (dyn Fn(&RgbImage) -> anyhow::Result<Vec<Detection>> + Sync);

/// An image that the network has seen.
struct Seen {
    camera: Camera,
    origin: Origin,
    image: RgbImage,
    found: Vec<Detection>,
}

fn run_with(
    arguments: &Arguments,
    inputs: &[Input],
    (weights, detect): (&str, Detect),
    fitter: Fitter,
) -> anyhow::Result<Outcome> {
    let cameras = match &arguments.camera {
        Some(path) => Cameras::load(path)?,
        None => Cameras::guess(arguments.fov.to_radians()),
    };
    files::create_folder(&arguments.out)?;
    let run = record::settle(arguments, weights, &fitter)?;
    let fitter = &fitter.of_run(run);
    let (done, open): (Vec<&Input>, Vec<&Input>) =
        inputs.iter().partition(|input| arguments.resume && is_done(arguments, fitter, input));
    let bar = progress::bar("images", open.len() as u64);
    let jobs = arguments.jobs.count(arguments.engine.shares_device());
    let looked = side_by_side(&open, jobs, |input| {
        let seen = look(input, &cameras, arguments.min_score, detect);
        let done = match seen {
            Ok(seen) => Some((seen.origin, finish(arguments, fitter, input, seen)?)),
            Err(error) => {
                warn(format_args!("skipped `{}`: {error:#}", input.path.display()));
                None
            }
        };
        bar.inc(1);
        anyhow::Ok(done)
    });
    bar.finish_and_clear();
    let looked: Vec<Option<(Origin, Counts)>> = looked?;
    let unreadable = looked.iter().filter(|done| done.is_none()).count();
    let mut counts = Counts::default();
    let mut guesses = [0usize; 2];
    for (origin, of_image) in looked.into_iter().flatten() {
        counts.add(&of_image);
        match origin {
            Origin::Given => {}
            Origin::Exif => guesses[0] += 1,
            Origin::FieldOfView => guesses[1] += 1,
        }
    }
    tell_guesses(arguments, guesses);
    follow(arguments, inputs, &cameras, fitter)?;
    if open.len() == unreadable && done.is_empty() {
        anyhow::bail!("none of the {unreadable} images could be done");
    }
    tell(arguments, &counts, [open.len() - unreadable, done.len(), unreadable]);
    Ok(if unreadable + counts.skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

/// Follows vehicles from image to image, if that is asked for.
fn follow(
    arguments: &Arguments,
    inputs: &[Input],
    cameras: &Cameras,
    fitter: &Fitter,
) -> anyhow::Result<()> {
    let frame = |input: &'_ Input| tracking::Frame {
        name: input.name.clone(),
        stem: input.stem.clone(),
        world_from_camera: cameras.world_from_camera(&input.path),
    };
    let frames: Vec<tracking::Frame> = inputs.iter().map(frame).collect();
    tracking::track(&arguments.out, &frames, &arguments.track, fitter.zoo())
}

fn tell_guesses(arguments: &Arguments, [exif, fov]: [usize; 2]) {
    if exif + fov > 0 {
        let fov_text = format!("a field of view of {}°", arguments.fov);
        warn(format_args!(
            "there is no `--camera`: focal lengths are guessed, of {exif} images from EXIF, of {fov} from {fov_text}; \
             distances are as wrong as the guess"
        ));
    }
}

fn tell(arguments: &Arguments, counts: &Counts, [done, kept, unreadable]: [usize; 3]) {
    let kept = if kept > 0 { format!(", kept {kept} that were done") } else { String::new() };
    let skipped = if unreadable > 0 { format!(", skipped {unreadable}") } else { String::new() };
    let reasons = if counts.without == 0 { "" } else { " (the results say why)" };
    note(format_args!(
        "found {} vehicles in {done} images{kept}{skipped}, {} of them without a pose{reasons}; wrote `{}`",
        counts.posed + counts.without,
        counts.without,
        arguments.out.display()
    ));
}

/// Reads an image and lets the network look at it.
fn look(input: &Input, cameras: &Cameras, min_score: f64, detect: Detect) -> anyhow::Result<Seen> {
    let photo = read_photo(&input.path)?;
    let (camera, origin) = cameras.of(&input.path, &photo)?;
    let mut found = detect(&photo.image)?;
    found.retain(|found| found.score >= min_score);
    Ok(Seen { camera, origin, image: photo.image, found })
}

/// Writes the detections, finds the poses and writes them.
fn finish(
    arguments: &Arguments,
    fitter: &Fitter,
    input: &Input,
    seen: Seen,
) -> anyhow::Result<Counts> {
    let Seen { camera, image, found, .. } = seen;
    let file = DetectionFile {
        images: vec![input.name.clone()],
        detections: found.iter().map(|found| (0, found.clone())).collect(),
    };
    write_detections(&detections_file(&arguments.out, &input.stem), &file)?;
    fitter.fit(Fitting {
        name: &input.name,
        stem: &input.stem,
        camera: &camera,
        image: Some(&image),
        detections: found,
    })
}

fn detections_file(out: &Path, stem: &str) -> PathBuf {
    out.join(DETECTIONS).join(format!("{stem}.{ENDING}"))
}

/// Whether all files of an image are there, of the same settings.
fn is_done(arguments: &Arguments, fitter: &Fitter, input: &Input) -> bool {
    detections_file(&arguments.out, &input.stem).is_file() && fitter.has_written(&input.stem)
}

#[cfg(test)]
mod tests;
