//! Making a data set.

use std::path::{Path, PathBuf};

use partpose::labeling::Shard;
use partpose::vehicle::{ModelZoo, VehicleModel};
use partpose_synth::dataset::{Effect, Progress, SynthOptions, write};
use partpose_synth::shading::RenderOptions;
use partpose_synth::world::{CameraOptions, SceneKind, Variation};

use super::advised;
use crate::camera::load_camera;
use crate::progress;
use crate::report::{Outcome, hint, note};

pub(super) const EXAMPLES: &str = "\
Examples:
  All four kinds of worlds in all ten variations, 20 frames each:
    partpose synth --out world --frames 20 --seed 1
  Go on where that was interrupted:
    partpose synth --out world --frames 20 --seed 1 --resume
  Many different views for training, one every two seconds, without rain and fog:
    partpose synth --out train --seed 7 --worlds 10 --frames 10 --fps 0.5 \\
      --variations clone,morning,overcast,sunset
  Quickly and without what a camera adds:
    partpose synth --out quick --frames 5 --scenes urban --fast --effects none
  Poses and occlusion of real labels, and how the result compares:
    partpose synth --out like --frames 100 --fps 2 --variations clone --layout-from vkitti
    partpose synth statistics like --against vkitti";

#[derive(clap::Args)]
pub(super) struct MakeArguments {
    /// Folder for the data set, new or empty
    #[arg(long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
    /// Frames of every sequence; a sequence is a world in a variation
    #[arg(long, value_name = "N", default_value_t = 10)]
    frames: u32,
    /// Seed of everything random
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Kinds of worlds, separated by commas: urban, intersection, forest, highway [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    scenes: Vec<SceneKind>,
    /// Worlds of every kind, each with its own roads, houses and traffic
    #[arg(long, value_name = "N", default_value_t = 1)]
    worlds: u32,
    /// Variations by Virtual KITTI's names, separated by commas [default: all ten]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    variations: Vec<Variation>,
    /// Frames a second; few make sequences of which every frame is different
    #[arg(long, default_value_t = 10.0)]
    fps: f64,
    /// Models of the vehicles, a folder of `.glb` files [default: those that come with the program]
    #[arg(long, value_name = "ZOO")]
    zoo: Option<PathBuf>,
    /// Use these models alone, by their names, separated by commas [default: all cars and vans]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    models: Vec<String>,
    /// Share of parked vehicles with a door or the boot open; above 0 the data set's zoo holds up to
    /// three opened models, named as `sedan-open-door-left`
    #[arg(long, value_name = "SHARE", default_value_t = 0.04)]
    open: f64,
    #[command(flatten)]
    camera: CameraArguments,
    /// Take camera path and vehicles from the clones of a data set; for comparison only, since what
    /// is made so falls under that data set's licence
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = [
            "scenes", "worlds", "open", "camera", "camera_height", "camera_pitch", "camera_roll",
            "camera_fixed",
        ]
    )]
    layout_from: Option<PathBuf>,
    /// The cheap preset: one sample a pixel and coarse shadows
    #[arg(long)]
    fast: bool,
    /// What lenses, sensors, weather and files add to pictures, separated by commas, or `none`: fog,
    /// rain, motion-blur, lens, flare, drops, exposure, white-balance, noise, tone, jpeg
    /// [default: all]
    #[arg(long, value_name = "LIST")]
    effects: Option<String>,
    /// Threads, 0 for as many as there are processors; the result does not depend on it
    #[arg(long, value_name = "K", default_value_t = 0)]
    threads: usize,
    /// Go on with a run that was cut off
    #[arg(long)]
    resume: bool,
    /// Draw part I of N of the sequences; all parts may write to the same folder, at the same time
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
}

#[derive(clap::Args)]
#[command(next_help_heading = "Camera")]
struct CameraArguments {
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
}

pub(super) fn run(arguments: &MakeArguments) -> anyhow::Result<Outcome> {
    // Whoever asks for no other command has to name it.
    let out = arguments.out.as_deref().unwrap_or(Path::new(""));
    let options = options(arguments)?;
    let zoo = zoo(arguments)?;
    let bar = progress::bar("drawing", 0);
    let summary = write(out, &zoo, &options, &|progress| match progress {
        Progress::Total(frames) => bar.set_length(frames as u64),
        Progress::Done(frames) => bar.inc(frames as u64),
    });
    bar.finish_and_clear();
    let summary = summary.map_err(advised)?;
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

fn zoo(arguments: &MakeArguments) -> anyhow::Result<ModelZoo> {
    let all = arguments.zoo.as_deref().map_or_else(|| Ok(ModelZoo::embedded()), ModelZoo::load)?;
    if arguments.models.is_empty() {
        return Ok(all);
    }
    if let Some(name) = arguments.models.iter().find(|name| all.get(name).is_none()) {
        return Err(hint(
            anyhow::anyhow!("there is no model `{name}`"),
            "`partpose zoo list` lists the models that come with the program",
        ));
    }
    let named = |model: &VehicleModel| arguments.models.iter().any(|name| name == model.name());
    Ok(ModelZoo { models: all.models.into_iter().filter(named).collect() })
}

fn options(arguments: &MakeArguments) -> anyhow::Result<SynthOptions> {
    fn or_all<T: Clone>(list: &[T], all: &[T]) -> Vec<T> {
        if list.is_empty() { all.to_vec() } else { list.to_vec() }
    }
    if !(0.1..=1000.0).contains(&arguments.fps) {
        anyhow::bail!("`--fps` is {}, but must be 0.1 to 1000 frames a second", arguments.fps);
    }
    Ok(SynthOptions {
        seed: arguments.seed,
        frames: arguments.frames,
        interval: 1.0 / arguments.fps,
        scenes: or_all(&arguments.scenes, &SceneKind::ALL),
        worlds: arguments.worlds,
        variations: or_all(&arguments.variations, &Variation::ALL),
        camera: camera(&arguments.camera)?,
        open: arguments.open,
        effects: effects(arguments.effects.as_deref())?,
        render: if arguments.fast { RenderOptions::cheap() } else { RenderOptions::default() },
        layout: arguments.layout_from.clone(),
        threads: arguments.threads,
        resume: arguments.resume,
        shard: arguments.shard,
    })
}

fn camera(arguments: &CameraArguments) -> anyhow::Result<CameraOptions> {
    let defaults = CameraOptions::default();
    Ok(CameraOptions {
        camera: arguments.camera.as_deref().map_or(Ok(defaults.camera), load_camera)?,
        height: arguments.camera_height,
        pitch: arguments.camera_pitch.to_radians(),
        roll: arguments.camera_roll.to_radians(),
        spread: if arguments.camera_fixed { [0.0, 0.0] } else { defaults.spread },
    })
}

fn effects(list: Option<&str>) -> anyhow::Result<Vec<Effect>> {
    match list {
        None => Ok(Effect::ALL.to_vec()),
        Some("none") => Ok(Vec::new()),
        Some(list) => list
            .split(',')
            .map(|name| {
                name.parse().map_err(|error| {
                    hint(
                        anyhow::Error::from(error),
                        "`--effects none` leaves all of them out, without `--effects` all are there",
                    )
                })
            })
            .collect(),
    }
}
