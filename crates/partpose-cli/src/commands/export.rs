//! `partpose export`: the results of `fit` in other programs' formats.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use partpose::eval::files_with_ending;
use partpose::files;
use partpose::formats::bop::{bop_csv, bop_model_info, bop_ply};
use partpose::formats::nuscenes::nuscenes_results;
use partpose::formats::{KittiRow, PosedImage, coco_results, kitti_text, openlabel, read_result};
use partpose::geometry::Vector3;
use partpose::vehicle::ModelZoo;

use crate::commands::result_files;
use crate::report::{Outcome, hint, note, warn_error};

#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Results of `fit`: a JSON file, or a folder of them
    #[arg(long, value_name = "FILE")]
    results: PathBuf,
    /// Format to write
    #[arg(long, value_enum)]
    to: Format,
    /// Zoo of the results' models, which knows their categories and, for BOP, their shapes; without it every vehicle
    /// is a car
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
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
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let zoo = arguments.zoo.as_ref().map(|folder| ModelZoo::load(folder)).transpose()?;
    let (images, skipped) = read(&arguments.results, zoo.as_ref())?;
    let out = &arguments.out;
    files::create_folder(out)?;
    match arguments.to {
        Format::Kitti => write_kitti(out, &images)?,
        Format::Coco => {
            let images = with_ids(out, images.clone())?;
            let images: Vec<_> = images.into_iter().map(|(id, image)| (id.into(), image)).collect();
            write_json(&out.join("results.json"), &coco_results(&images))?;
        }
        Format::Bop => write_bop(out, &images, zoo.as_ref())?,
        Format::Nuscenes => write_json(&out.join("results.json"), &nuscenes_results(&images))?,
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

/// All results, by the names of their files, and how many could not be read.
fn read(path: &Path, zoo: Option<&ModelZoo>) -> anyhow::Result<(Vec<PosedImage>, usize)> {
    let category = |name: &str| {
        let model = zoo.and_then(|zoo| zoo.models.iter().find(|model| model.name() == name));
        model.map_or("Car".to_owned(), |model| model.category().to_owned())
    };
    let paths =
        if path.is_dir() { files_with_ending(path, "json")? } else { vec![path.to_owned()] };
    let (mut images, mut skipped) = (Vec::new(), 0);
    for path in &paths {
        match read_result(path, &category) {
            Ok(image) => images.push(image),
            Err(error) if paths.len() == 1 => return Err(error.into()),
            Err(error) => {
                skipped += 1;
                warn_error("skipped a result", &error);
            }
        }
    }
    if images.is_empty() {
        let error = anyhow::anyhow!("there is no result in `{}`", path.display());
        return Err(hint(error, "give the folder that `partpose fit` wrote to as `--results`"));
    }
    Ok((images, skipped))
}

fn write_json(path: &Path, value: &impl serde::Serialize) -> anyhow::Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    Ok(files::write(path, text.as_bytes())?)
}

fn write_kitti(out: &Path, images: &[PosedImage]) -> anyhow::Result<()> {
    let names: Vec<String> = images.iter().map(|image| image.image.clone()).collect();
    for (stem, image) in result_files::stems(&names)?.iter().zip(images) {
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

/// Numbers the images from 1 in their order and writes the numbers down.
fn with_ids(out: &Path, images: Vec<PosedImage>) -> anyhow::Result<Vec<(u32, PosedImage)>> {
    let images: Vec<(u32, PosedImage)> = (1..).zip(images).collect();
    let names: BTreeMap<u32, &String> =
        images.iter().map(|(id, image)| (*id, &image.image)).collect();
    write_json(&out.join("images.json"), &names)?;
    Ok(images)
}

fn write_bop(out: &Path, images: &[PosedImage], zoo: Option<&ModelZoo>) -> anyhow::Result<()> {
    let vehicles = images.iter().flat_map(|image| &image.vehicles);
    let mut names: Vec<String> = vehicles.map(|vehicle| vehicle.model.clone()).collect();
    names.extend(zoo.iter().flat_map(|zoo| &zoo.models).map(|model| model.name().to_owned()));
    names.sort();
    names.dedup();
    let ids: BTreeMap<String, u32> = names.into_iter().zip(1..).collect();
    write_json(&out.join("objects.json"), &ids)?;
    let images = with_ids(out, images.to_vec())?;
    files::write(&out.join("results.csv"), bop_csv(1, &images, &ids).as_bytes())?;
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
