//! `partpose synth`: makes a synthetic labelled data set, or says how one is distributed.

use std::path::PathBuf;

use partpose::dataset::Dataset;
use partpose::geometry::Camera;
use partpose::vehicle::ModelZoo;
use partpose_synth::dataset::{
    Progress, SynthError, SynthOptions, contact_sheets, statistics, statistics_table, write,
};
use partpose_synth::shading::RenderOptions;
use partpose_synth::world::{CameraOptions, SceneKind, Variation};

use crate::camera::load_camera;
use crate::progress;
use crate::report::{self, Outcome, hint, note};

#[expect(clippy::struct_excessive_bools, reason = "flags")]
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true).args(["out", "statistics"]))]
pub(crate) struct Arguments {
    /// Folder for the data set, new or empty
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Frames of every sequence; a sequence is a world in a variation
    #[arg(long, value_name = "N", default_value_t = 10)]
    frames: u32,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kinds of worlds: urban, intersection, forest, highway [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    scenes: Vec<SceneKind>,
    /// Worlds of every kind, each with its own roads, houses and traffic
    #[arg(long, value_name = "N", default_value_t = 1)]
    worlds: u32,
    /// Variations by Virtual KITTI's names [default: all ten]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    variations: Vec<Variation>,
    /// Frames a second; few make sequences of which every frame is different
    #[arg(long, default_value_t = 10.0)]
    fps: f64,
    /// Models of the vehicles, a folder of `.glb` files [default: those that come with the program]
    #[arg(long, value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// Camera: TOML, KITTI calibration, or a data set [default: Virtual KITTI's]
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Height of the camera, metres
    #[arg(long, value_name = "METRES", default_value_t = 1.6)]
    camera_height: f64,
    /// How far the camera looks down, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true)]
    camera_pitch: f64,
    /// How far the camera is turned clockwise, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true)]
    camera_roll: f64,
    /// Mount the camera the same in all worlds; else height, pitch and roll differ a little
    #[arg(long)]
    camera_fixed: bool,
    /// Take camera path and vehicles from the clones of a data set; for comparison only
    #[arg(long, value_name = "DIR")]
    layout_from: Option<PathBuf>,
    /// One sample a pixel and coarse shadows: several times faster
    #[arg(long)]
    fast: bool,
    /// Leave out what lenses, sensors and files add to pictures
    #[arg(long)]
    plain: bool,
    /// Threads, 0 for as many as there are processors; the result does not depend on it
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Go on with a run that was cut off
    #[arg(long)]
    resume: bool,
    /// When done, draw all variations of every world on sheets, `FILE-rgb.png` and `FILE-parts.png`
    #[arg(long, value_name = "FILE", requires = "out")]
    contact_sheets: Option<PathBuf>,
    /// Write no data set, but how one is distributed: shares of parts, distances, occlusion, truncation
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    statistics: Option<PathBuf>,
    /// Another data set beside it
    #[arg(long, value_name = "DIR", requires = "statistics")]
    against: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    match (&arguments.out, &arguments.statistics) {
        (Some(out), _) => make(arguments, out),
        (None, Some(dataset)) => compare(arguments, dataset),
        // The group of arguments asks for one of them.
        (None, None) => Ok(Outcome::Done),
    }
}

fn make(arguments: &Arguments, out: &std::path::Path) -> anyhow::Result<Outcome> {
    let options = options(arguments)?;
    let zoo = arguments.zoo.as_deref().map_or_else(|| Ok(ModelZoo::embedded()), ModelZoo::load)?;
    let bar = progress::bar("drawing", 0);
    let summary = write(out, &zoo, &options, &|progress| match progress {
        Progress::Total(frames) => bar.set_length(frames as u64),
        Progress::Done(frames) => bar.inc(frames as u64),
    });
    bar.finish_and_clear();
    let summary = summary.map_err(advised)?;
    if let Some(path) = &arguments.contact_sheets {
        for file in contact_sheets(out, path)? {
            note(format_args!("drew `{}`", file.display()));
        }
    }
    let kept =
        if summary.kept > 0 { format!(", {} were there", summary.kept) } else { String::new() };
    note(format_args!(
        "drew {} frames of {} sequences into `{}`{kept}",
        summary.drawn,
        summary.sequences,
        out.display()
    ));
    Ok(Outcome::Done)
}

fn options(arguments: &Arguments) -> anyhow::Result<SynthOptions> {
    fn or_all<T: Clone>(list: &[T], all: &[T]) -> Vec<T> {
        if list.is_empty() { all.to_vec() } else { list.to_vec() }
    }
    let defaults = CameraOptions::default();
    let camera: Camera = match &arguments.camera {
        Some(path) => load_camera(path)?,
        None => defaults.camera,
    };
    if !(arguments.fps >= 0.1 && arguments.fps <= 1000.0) {
        anyhow::bail!("`--fps` is {}, but must be 0.1 to 1000 frames a second", arguments.fps);
    }
    Ok(SynthOptions {
        seed: arguments.seed,
        frames: arguments.frames,
        interval: 1.0 / arguments.fps,
        scenes: or_all(&arguments.scenes, &SceneKind::ALL),
        worlds: arguments.worlds,
        variations: or_all(&arguments.variations, &Variation::ALL),
        camera: CameraOptions {
            camera,
            height: arguments.camera_height,
            pitch: arguments.camera_pitch.to_radians(),
            roll: arguments.camera_roll.to_radians(),
            spread: if arguments.camera_fixed { [0.0, 0.0] } else { defaults.spread },
        },
        effects: !arguments.plain,
        render: if arguments.fast { RenderOptions::cheap() } else { RenderOptions::default() },
        layout: arguments.layout_from.clone(),
        threads: arguments.threads,
        resume: arguments.resume,
    })
}

/// Says what can be done about an error.
fn advised(error: SynthError) -> anyhow::Error {
    match &error {
        SynthError::Exists { .. } => {
            hint(error, "add `--resume` to go on with it, or choose an empty folder")
        }
        SynthError::Foreign { .. } => hint(error, "choose a new or empty folder"),
        SynthError::OtherOptions { .. } => {
            hint(error, "repeat the options it was begun with, or choose an empty folder")
        }
        SynthError::ModelName { .. } => hint(error, "rename the model"),
        _ => error.into(),
    }
}

fn compare(arguments: &Arguments, dataset: &std::path::Path) -> anyhow::Result<Outcome> {
    let counted = statistics(&Dataset::open(dataset)?)?;
    let text = match &arguments.against {
        Some(path) => {
            let other = statistics(&Dataset::open(path)?)?;
            statistics_table(&[("this", &counted), ("against", &other)])
        }
        None => statistics_table(&[("this", &counted)]),
    };
    report::data(&text)?;
    Ok(Outcome::Done)
}
