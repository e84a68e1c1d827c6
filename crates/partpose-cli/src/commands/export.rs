//! `partpose export`: results in other programs' formats, and other programs' results in ours; the network as an ONNX
//! model.

#[cfg(feature = "mcap")]
mod mcap;
mod network;
#[cfg(feature = "parquet")]
mod parquet;
mod read;
pub(crate) mod scene;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use partpose::files;
use partpose::formats::bop::{bop_csv, bop_image_ids, bop_model_info, bop_ply};
use partpose::formats::nuscenes::nuscenes_results;
use partpose::formats::{
    CocoIds, KittiRow, PosedImage, coco_results, kitti_text, openlabel, read_coco_ids, result_json,
};
use partpose::geometry::Vector3;
use partpose::vehicle::ModelZoo;
use partpose::viz::{SceneFrame, scene_glb};

pub(crate) use read::read_results;

use crate::camera::load_camera;
use crate::commands::result_files;
use crate::report::{Outcome, hint, note};

#[derive(clap::Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
#[command(after_help = "Examples:
  partpose export --results out/fit --to kitti --out out/kitti
  partpose export onnx --out network.onnx
  partpose export --results out/fit --to coco --coco-ids instances.json --out out/coco
  partpose export --from kitti --results label_2 --camera camera.toml --to results --out out/labels")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    network: Option<NetworkCommand>,
    /// Results to read: a file, or a folder of them
    #[arg(long, value_name = "FILE", required = true)]
    results: Option<PathBuf>,
    /// Format to read
    #[arg(long, value_enum, default_value = "results")]
    from: read::Source,
    /// Format to write
    #[arg(long, value_enum, required = true)]
    to: Option<Format>,
    /// The camera of all images, where the format to read has none
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Zoo of the results' models, which knows their categories and, for BOP, their shapes; without it every vehicle
    /// is a car
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// COCO annotations whose ids of images and categories are to be used
    #[arg(long, value_name = "FILE")]
    coco_ids: Option<PathBuf>,
    /// Export the poses of `--track` of `run` or `fit`, where vehicles have them
    #[arg(long)]
    tracked: bool,
    #[command(flatten)]
    scene: scene::SceneFlags,
    /// Images a second, for MCAP
    #[cfg(feature = "mcap")]
    #[arg(long, value_name = "N", default_value_t = 10.0, value_parser = crate::commands::tracking::parse_rate)]
    fps: f64,
    /// Folder to write to
    #[arg(long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
}

#[derive(clap::Subcommand)]
enum NetworkCommand {
    /// Write the network as an ONNX model, for other runtimes
    Onnx(network::Arguments),
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// The JSON of `fit`, one file an image
    Results,
    /// One label text an image
    Kitti,
    /// One list of boxes, ids of images as in `images.json`
    Coco,
    /// One CSV, ids of images and models as in `images.json` and `objects.json`; with a zoo its models too
    Bop,
    /// One JSON like that of the nuScenes detection task, boxes in the camera's frame
    Nuscenes,
    /// One ASAM `OpenLABEL` 1.0 file
    Openlabel,
    /// One GLB scene an image: models, camera, frustum with the picture, true boxes
    Glb,
    /// One MCAP file for Foxglove and ROS 2: pictures, calibration, `vision_msgs/Detection3DArray`
    #[cfg(feature = "mcap")]
    Mcap,
    /// One Parquet table, one row a vehicle
    #[cfg(feature = "parquet")]
    Parquet,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    match (&arguments.network, &arguments.results, arguments.to, &arguments.out) {
        (Some(NetworkCommand::Onnx(network)), ..) => network::run(network),
        (None, Some(results), Some(to), Some(out)) => export_results(arguments, (results, to), out),
        // The parser asks for all three where there is no subcommand.
        _ => Err(hint(
            anyhow::anyhow!("nothing to export was named"),
            "give `--results`, `--to` and `--out`, or say `export onnx`",
        )),
    }
}

fn export_results(
    arguments: &Arguments,
    (results, to): (&Path, Format),
    out: &Path,
) -> anyhow::Result<Outcome> {
    let zoo = arguments.zoo.as_ref().map(|folder| ModelZoo::load(folder)).transpose()?;
    let camera = arguments.camera.as_deref().map(load_camera).transpose()?;
    let (mut images, skipped) = read::read(results, arguments.from, camera, zoo.as_ref())?;
    if arguments.tracked {
        images = images.into_iter().map(scene::as_tracked).collect();
    }
    let ids = arguments.coco_ids.as_deref().map(read_coco_ids).transpose()?;
    files::create_folder(out)?;
    match to {
        Format::Results => write_results(out, &images)?,
        Format::Kitti => write_kitti(out, &images)?,
        Format::Coco => write_coco(out, &images, ids.as_ref())?,
        Format::Bop => write_bop(out, &images, zoo.as_ref())?,
        Format::Nuscenes => write_json(&out.join("results.json"), &nuscenes_results(&images))?,
        Format::Glb => {
            let zoo = zoo.unwrap_or_else(ModelZoo::embedded);
            write_glb(out, &scene::frames(images.clone(), &arguments.scene)?, &zoo)?;
        }
        #[cfg(feature = "mcap")]
        Format::Mcap => {
            let frames = scene::frames(images.clone(), &arguments.scene)?;
            mcap::write(out, &frames, arguments.fps)?;
        }
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::write(out, &images)?,
        Format::Openlabel => write_json(&out.join("openlabel.json"), &openlabel(&images))?,
    }
    let vehicles: usize = images.iter().map(|image| image.vehicles.len()).sum();
    note(format_args!(
        "exported {vehicles} vehicles of {} images to `{}`",
        images.len(),
        out.display()
    ));
    Ok(if skipped == 0 { Outcome::Done } else { Outcome::Skipped })
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    Ok(files::write(path, text.as_bytes())?)
}

fn stems(images: &[PosedImage]) -> anyhow::Result<Vec<String>> {
    let names: Vec<String> = images.iter().map(|image| image.image.clone()).collect();
    result_files::stems(&names)
}

fn write_glb(out: &Path, frames: &[SceneFrame], zoo: &ModelZoo) -> anyhow::Result<()> {
    let names: Vec<String> = frames.iter().map(|frame| frame.found.image.clone()).collect();
    for (stem, frame) in result_files::stems(&names)?.iter().zip(frames) {
        files::write(&out.join(format!("{stem}.glb")), &scene_glb(frame, zoo))?;
    }
    Ok(())
}

fn write_results(out: &Path, images: &[PosedImage]) -> anyhow::Result<()> {
    for (stem, image) in stems(images)?.iter().zip(images) {
        files::write(&out.join(format!("{stem}.json")), result_json(image).as_bytes())?;
    }
    Ok(())
}

fn write_kitti(out: &Path, images: &[PosedImage]) -> anyhow::Result<()> {
    for (stem, image) in stems(images)?.iter().zip(images) {
        let row = |vehicle: &partpose::formats::PosedVehicle| KittiRow {
            category: vehicle.category.clone(),
            truncation: None,
            occluded: None,
            bounds: vehicle.bounds,
            cuboid: vehicle.cuboid,
            score: vehicle.score,
        };
        let rows: Vec<KittiRow> = image.vehicles.iter().map(row).collect();
        let text = kitti_text(&rows, &Vector3::zeros());
        files::write(&out.join(format!("{stem}.txt")), text.as_bytes())?;
    }
    Ok(())
}

fn write_coco(out: &Path, images: &[PosedImage], ids: Option<&CocoIds>) -> anyhow::Result<()> {
    let detections = if let Some(ids) = ids {
        coco_results(&with_coco_ids(images, ids)?, ids)
    } else {
        let numbered = (1..).zip(images.iter().cloned()).collect::<Vec<_>>();
        write_names(out, images)?;
        coco_results(&numbered, &CocoIds::default())
    };
    write_json(&out.join("results.json"), &detections)
}

/// Gives images the ids of a file of annotations; one that it does not have is an error.
pub(crate) fn with_coco_ids(
    images: &[PosedImage],
    ids: &CocoIds,
) -> anyhow::Result<Vec<(u64, PosedImage)>> {
    let id = |image: &PosedImage| {
        let unknown = || {
            let error =
                anyhow::anyhow!("the COCO annotations have no image of the name `{}`", image.image);
            hint(
                error,
                "images are found by `file_name`, or by its last part where only one has it",
            )
        };
        Ok((ids.image(&image.image).ok_or_else(unknown)?, image.clone()))
    };
    images.iter().map(id).collect()
}

/// Writes down the numbers of the images, from 1 in their order.
fn write_names(out: &Path, images: &[PosedImage]) -> anyhow::Result<()> {
    let names: BTreeMap<u32, &String> = (1..).zip(images.iter().map(|i| &i.image)).collect();
    write_json(&out.join("images.json"), &names)
}

fn write_bop(out: &Path, images: &[PosedImage], zoo: Option<&ModelZoo>) -> anyhow::Result<()> {
    let vehicles = images.iter().flat_map(|image| &image.vehicles);
    let mut names: Vec<String> = vehicles.map(|vehicle| vehicle.model.clone()).collect();
    names.extend(zoo.iter().flat_map(|zoo| &zoo.models).map(|model| model.name().to_owned()));
    names.sort();
    names.dedup();
    let ids: BTreeMap<String, u32> = names.into_iter().zip(1..).collect();
    write_json(&out.join("objects.json"), &ids)?;
    let own: Option<Vec<[u32; 2]>> = images.iter().map(|i| bop_image_ids(&i.image)).collect();
    let keys = if let Some(keys) = own {
        keys
    } else {
        write_names(out, images)?;
        (1..).take(images.len()).map(|image| [1, image]).collect()
    };
    let images: Vec<([u32; 2], &PosedImage)> = keys.into_iter().zip(images).collect();
    files::write(&out.join("results.csv"), bop_csv(&images, &ids).as_bytes())?;
    let Some(zoo) = zoo else { return Ok(()) };
    let mut infos = BTreeMap::new();
    for model in &zoo.models {
        let id = ids[model.name()];
        infos.insert(id, bop_model_info(model));
        let path = out.join(format!("models/obj_{id:06}.ply"));
        files::write(&path, bop_ply(model).as_bytes())?;
    }
    write_json(&out.join("models/models_info.json"), &infos)
}
