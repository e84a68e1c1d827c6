//! What `export`, `view` and the evaluators read: our results, or those of other programs.

use std::path::Path;

use clap::ValueEnum;
use partpose::eval::files_with_ending;
use partpose::formats::{
    ImportOptions, PosedImage, import_bop, import_kitti, import_nuscenes, import_openlabel,
    read_result,
};
use partpose::geometry::Camera;
use partpose::vehicle::ModelZoo;

use crate::commands::result_files::OTHERS;
use crate::report::{hint, warn_error};

/// Where vehicles come from.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Source {
    /// The JSON of `fit`
    Results,
    /// A folder of KITTI labels or results, `*.txt`; needs `--camera`
    Kitti,
    /// A CSV of BOP results; needs `--camera` and `--zoo`
    Bop,
    /// A JSON like that of the nuScenes detection task, boxes in the camera's frame; needs `--camera`
    Nuscenes,
    /// An ASAM `OpenLABEL` 1.0 file with cuboids in the camera's frame
    Openlabel,
    /// A Parquet table as `export --to parquet` writes it
    #[cfg(feature = "parquet")]
    Parquet,
}

/// All images, by the names of their files, and how many could not be read.
///
/// Files of `fit` that cannot be read are reported and left out; in other formats the first fault is an error.
pub(super) fn read(
    path: &Path,
    from: Source,
    camera: Option<Camera>,
    zoo: Option<&ModelZoo>,
) -> anyhow::Result<(Vec<PosedImage>, usize)> {
    if camera.is_none() && matches!(from, Source::Kitti | Source::Bop | Source::Nuscenes) {
        let error = anyhow::anyhow!("this format does not tell the camera of its images");
        return Err(hint(error, "give it as `--camera`"));
    }
    if zoo.is_none() && from == Source::Bop {
        let error = anyhow::anyhow!("BOP results do not tell the sizes of their models");
        return Err(hint(error, "give the models as `--zoo`"));
    }
    let options = ImportOptions { camera, zoo };
    let images = match from {
        Source::Results => return read_results(path, zoo),
        Source::Kitti => import_kitti(path, &options)?,
        Source::Bop => import_bop(path, &options)?,
        Source::Nuscenes => import_nuscenes(path, &options)?,
        Source::Openlabel => import_openlabel(path, &options)?,
        #[cfg(feature = "parquet")]
        Source::Parquet => super::parquet::read(path)?,
    };
    if images.is_empty() {
        anyhow::bail!("there is no image in `{}`", path.display());
    }
    Ok((images, 0))
}

/// The results of `fit`: one file, or all of a folder.
pub(crate) fn read_results(
    path: &Path,
    zoo: Option<&ModelZoo>,
) -> anyhow::Result<(Vec<PosedImage>, usize)> {
    let category = |name: &str| {
        let model = zoo.and_then(|zoo| zoo.get(name));
        model.map_or("Car".to_owned(), |model| model.category().to_owned())
    };
    // Other JSON lies beside the results of some commands.
    let other = |path: &Path| {
        let stem = path.file_stem().unwrap_or_default();
        OTHERS.iter().any(|other| *other == stem)
    };
    let paths = if path.is_dir() {
        files_with_ending(path, "json")?.into_iter().filter(|path| !other(path)).collect()
    } else {
        vec![path.to_owned()]
    };
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
        return Err(hint(error, "give the folder that `partpose fit` wrote to"));
    }
    Ok((images, skipped))
}
