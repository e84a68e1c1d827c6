//! Results with their pictures and with what is known to be true, for `view` and `export --to glb`.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use partpose::files;
use partpose::formats::{PosedImage, PosedVehicle};
use partpose::viz::{SceneFrame, picture_uri};

use super::read::{Source, read};
use crate::commands::result_files::stem;
use crate::report::warn;

/// Where pictures and true poses are.
#[derive(clap::Args)]
pub(crate) struct SceneFlags {
    /// Folder of the pictures, by the names in the results
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,
    /// True poses: a file or folder in the form of results, whose images are found by name; labels of KITTI with
    /// `--truth-from kitti`
    #[arg(long, value_name = "PATH")]
    truth: Option<PathBuf>,
    /// Format of the true poses
    #[arg(long, value_enum, default_value = "results", requires = "truth")]
    truth_from: Source,
}

/// The image with its vehicles where their tracks have them.
pub(crate) fn as_tracked(image: PosedImage) -> PosedImage {
    let vehicles = image.vehicles.into_iter().map(PosedVehicle::tracked).collect();
    PosedImage { vehicles, ..image }
}

/// Adds pictures and true poses; a picture that is not there is told and left out.
pub(crate) fn frames(
    images: Vec<PosedImage>,
    flags: &SceneFlags,
) -> anyhow::Result<Vec<SceneFrame>> {
    let mut truths = truths(&images, flags)?;
    let mut missing = 0;
    let frame = |found: PosedImage| {
        let photo = flags.images.as_deref().and_then(|folder| photo(folder, &found.image));
        missing += usize::from(flags.images.is_some() && photo.is_none());
        let truths = truths.remove(&stem(&found.image)).unwrap_or_default();
        SceneFrame { found, truths, photo }
    };
    let frames = images.into_iter().map(frame).collect();
    if missing > 0 {
        warn(format_args!("{missing} images have no picture of their name that is PNG or JPEG"));
    }
    Ok(frames)
}

fn truths(
    images: &[PosedImage],
    flags: &SceneFlags,
) -> anyhow::Result<BTreeMap<String, Vec<PosedVehicle>>> {
    let Some(path) = &flags.truth else { return Ok(BTreeMap::new()) };
    let camera = images.first().map(|image| image.camera);
    let (truths, _) = read(path, flags.truth_from, camera, None)?;
    Ok(truths.into_iter().map(|image| (stem(&image.image), image.vehicles)).collect())
}

/// The bytes of a picture below the folder; its name must not lead out of it.
fn photo(folder: &Path, name: &str) -> Option<Vec<u8>> {
    let inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    let path = folder.join(name);
    // What has no size of an image is none, whatever it begins with.
    let readable = inside && files::image_size(&path).is_ok();
    let bytes = readable.then(|| files::read(&path).ok()).flatten()?;
    picture_uri(&bytes).is_some().then_some(bytes)
}
