//! The camera that a user names: TOML, KITTI calibration, or a data set.
//!
//! TOML is read here and not in the library, which knows no configuration format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use partpose::dataset::{Dataset, KittiCalibration};
use partpose::files::{self, FileError, MAX_IMAGE_SIDE, Photo};
use partpose::geometry::{Camera, Pose};

use crate::report;

const REMEDY: &str = "a camera file is TOML with `width`, `height`, `fx`, `fy`, `cx` and `cy` in pixels, \
                      a KITTI calibration, or a data set folder";
/// Shortest and longest focal length that is believed, pixels.
const FOCAL: [f64; 2] = [1.0, 1e6];
/// How far the principal point may be from the first pixel along either axis, pixels.
const MAX_CENTER: f64 = 1e6;

/// What a camera file may hold; all of it is needed.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    width: Option<i64>,
    height: Option<i64>,
    fx: Option<f64>,
    fy: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
}

/// The cameras of the images of a run.
pub(crate) enum Cameras {
    /// One for all.
    One { camera: Camera, path: PathBuf },
    /// A calibration, which fits images of any size.
    Calibration(KittiCalibration),
    /// Those of a data set's frames, by the paths of their images; the first for other images of its size.
    OfFrames { by_image: BTreeMap<PathBuf, (Camera, Option<Pose>)>, first: Camera, path: PathBuf },
    /// From the picture itself.
    Guessed { field_of_view: f64 },
}

/// Where a camera comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    /// From what the user gave.
    Given,
    /// A guess from the focal length in the picture's file.
    Exif,
    /// A guess from nothing.
    FieldOfView,
}

impl Cameras {
    /// The cameras of a file or folder: TOML, a KITTI calibration, or a data set.
    pub(crate) fn load(path: &Path) -> anyhow::Result<Self> {
        let cameras = if path.is_dir() { Self::of_dataset(path) } else { Self::of_file(path) };
        cameras.map_err(|error| report::hint(error, REMEDY))
    }

    /// Focal lengths from EXIF, else from a field of view along the longer side, radians.
    pub(crate) fn guess(field_of_view: f64) -> Self {
        Self::Guessed { field_of_view }
    }

    fn of_file(path: &Path) -> anyhow::Result<Self> {
        let text = files::read_text(path)?;
        if is_calibration(&text) {
            return Ok(Self::Calibration(KittiCalibration::parse(path, &text)?));
        }
        let camera = from_toml(path, &text)?;
        check_ranges(path, &camera)?;
        Ok(Self::One { camera, path: path.to_owned() })
    }

    fn of_dataset(path: &Path) -> anyhow::Result<Self> {
        let root = path.canonicalize().map_err(|source| FileError::read(path, source))?;
        let dataset = Dataset::open(&root)?;
        let mut by_image = BTreeMap::new();
        let mut first = None;
        for id in dataset.sequences() {
            for frame in dataset.frames(id)? {
                first.get_or_insert(frame.camera);
                let known = (frame.camera, frame.world_from_camera);
                by_image.extend(frame.image.map(|image| (image, known)));
            }
        }
        let first = first
            .with_context(|| format!("`{}` has no frame that could be read", path.display()))?;
        Ok(Self::OfFrames { by_image, first, path: path.to_owned() })
    }

    /// Where the camera of an image stands, if a data set knows.
    pub(crate) fn world_from_camera(&self, image: &Path) -> Option<Pose> {
        let Self::OfFrames { by_image, .. } = self else { return None };
        by_image.get(&image.canonicalize().ok()?)?.1
    }

    /// The camera of an image.
    pub(crate) fn of(&self, image: &Path, photo: &Photo) -> anyhow::Result<(Camera, Origin)> {
        let (camera, path) = match self {
            Self::One { camera, path } => (*camera, path),
            Self::Calibration(calibration) => {
                let camera = calibration.camera(photo.image.size);
                check_ranges(image, &camera)?;
                return Ok((camera, Origin::Given));
            }
            Self::OfFrames { by_image, first, path } => {
                let known = image.canonicalize().ok().and_then(|image| by_image.get(&image));
                (known.map_or(*first, |(camera, _)| *camera), path)
            }
            Self::Guessed { field_of_view } => return Ok(guess(photo, *field_of_view)),
        };
        if camera.size != photo.image.size {
            let ([w, h], [cw, ch]) = (photo.image.size, camera.size);
            anyhow::bail!(
                "it has {w} x {h} pixels, but the camera of `{}` {cw} x {ch}",
                path.display()
            );
        }
        Ok((camera, Origin::Given))
    }
}

/// A pinhole in the middle of the picture.
fn guess(photo: &Photo, field_of_view: f64) -> (Camera, Origin) {
    let [width, height] = photo.image.size.map(f64::from);
    let longer = width.max(height);
    let (focal, origin) = match photo.focal_pixels() {
        Some(focal) => (focal, Origin::Exif),
        None => (0.5 * longer / (0.5 * field_of_view).tan(), Origin::FieldOfView),
    };
    let center = [0.5 * (width - 1.0), 0.5 * (height - 1.0)];
    (Camera::pinhole(focal, center, photo.image.size), origin)
}

/// The camera of a file or folder: TOML, a KITTI calibration with its image, or the first frame of a data set.
pub(crate) fn load_camera(path: &Path) -> anyhow::Result<Camera> {
    let camera = if path.is_dir() { from_dataset(path) } else { from_file(path) };
    camera.map_err(|error| report::hint(error, REMEDY))
}

fn from_file(path: &Path) -> anyhow::Result<Camera> {
    let text = files::read_text(path)?;
    let camera = if is_calibration(&text) {
        from_calibration(path, &text)?
    } else {
        from_toml(path, &text)?
    };
    check_ranges(path, &camera)?;
    Ok(camera)
}

/// Whether a text has matrices as KITTI writes them.
fn is_calibration(text: &str) -> bool {
    // `P0: ...` to `P3: ...`, or `P_rect_02: ...` in the raw recordings.
    let is_matrix = |line: &str| {
        line.starts_with('P') && line.split_once(':').is_some_and(|(name, _)| name.len() <= 9)
    };
    text.lines().any(is_matrix)
}

/// Refuses a camera that nobody has: its numbers would overflow, or its images exhaust memory, much later.
pub(crate) fn check_ranges(path: &Path, camera: &Camera) -> anyhow::Result<()> {
    let [fx, fy] = camera.focal;
    let [cx, cy] = camera.principal_point;
    let [width, height] = camera.size.map(f64::from);
    let (center, side) = ([-MAX_CENTER, MAX_CENTER], [1.0, f64::from(MAX_IMAGE_SIDE)]);
    for (name, value, [low, high]) in [
        ("fx", fx, FOCAL),
        ("fy", fy, FOCAL),
        ("cx", cx, center),
        ("cy", cy, center),
        ("width", width, side),
        ("height", height, side),
    ] {
        // NaN lies in no range.
        if !(low..=high).contains(&value) {
            anyhow::bail!(
                "`{name}` of the camera in `{}` is {value:?}, but must be {low} to {high} pixels",
                path.display()
            );
        }
    }
    Ok(())
}

fn from_dataset(path: &Path) -> anyhow::Result<Camera> {
    let dataset = Dataset::open(path)?;
    for id in dataset.sequences() {
        if let Some(frame) = dataset.frames(id)?.first() {
            return Ok(frame.camera);
        }
    }
    anyhow::bail!("`{}` has no frame that could be read", path.display())
}

/// A calibration has no image size; that of the image with the same name in `image_2` is taken.
fn from_calibration(path: &Path, text: &str) -> anyhow::Result<Camera> {
    let calibration = KittiCalibration::parse(path, text)?;
    let folder = path.parent().and_then(Path::parent).unwrap_or(Path::new(".."));
    let images = folder.join("image_2");
    let stem = path.file_stem().unwrap_or_default();
    let image = ["png", "jpg"]
        .map(|ending| images.join(stem).with_extension(ending))
        .into_iter()
        .find(|image| image.is_file());
    match image {
        Some(image) => Ok(calibration.camera(files::image_size(&image)?)),
        None => anyhow::bail!(
            "`{}` has no image size, and there is no image `{}`",
            path.display(),
            images.join(stem).with_extension("png").display()
        ),
    }
}

fn from_toml(path: &Path, text: &str) -> anyhow::Result<Camera> {
    let file: CameraFile = toml::from_str(text).map_err(|error| {
        let line = error
            .span()
            .map_or(1, |span| 1 + text.get(..span.start).unwrap_or(text).matches('\n').count());
        let what = error.message().lines().next().unwrap_or_default().to_owned();
        anyhow::anyhow!("`{}` line {line}: {what}", path.display())
    })?;
    let missing = |name: &str| anyhow::anyhow!("`{}` has no `{name}`", path.display());
    let number = |name: &str, value: Option<f64>| value.ok_or_else(|| missing(name));
    let side = |name: &str, value: Option<i64>| {
        let value = value.ok_or_else(|| missing(name))?;
        u32::try_from(value).map_err(|_| {
            let (path, max) = (path.display(), MAX_IMAGE_SIDE);
            anyhow::anyhow!(
                "`{name}` of the camera in `{path}` is {value}, but must be 1 to {max} pixels"
            )
        })
    };
    Ok(Camera {
        focal: [number("fx", file.fx)?, number("fy", file.fy)?],
        principal_point: [number("cx", file.cx)?, number("cy", file.cy)?],
        size: [side("width", file.width)?, side("height", file.height)?],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use expect_test::{Expect, expect};
    use partpose::files::{RgbImage, write, write_png};

    const GOOD: &str = "width = 1242\nheight = 375\nfx = 725\nfy = 725.5\ncx = 620.5\ncy = 187\n";
    const P2: &str = "P2: 700 0 600 35 0 710 180 0.7 0 0 1 0.001\n";

    fn check(text: &str, message: &Expect) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib/camera.toml");
        write(&path, text.as_bytes()).unwrap();
        let error = load_camera(&path).unwrap_err();
        let text = format!("{error:#}").replace(&path.display().to_string(), "camera.toml");
        message.assert_eq(&text.replace(&folder.path().display().to_string(), "."));
    }

    #[test]
    fn toml_with_all_six_numbers_is_a_camera() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        write(&path, GOOD.as_bytes()).unwrap();
        let camera = load_camera(&path).unwrap();
        let expected =
            Camera { focal: [725.0, 725.5], principal_point: [620.5, 187.0], size: [1242, 375] };
        assert_eq!(camera, expected);
    }

    #[test]
    fn a_camera_without_focal_length_is_refused_by_name() {
        check("", &expect!["`camera.toml` has no `fx`"]);
        check(
            &GOOD.replace("fx", "focal"),
            &expect![
                "`camera.toml` line 3: unknown field `focal`, expected one of `width`, `height`, `fx`, `fy`, `cx`, `cy`"
            ],
        );
        check(
            &GOOD.replace("fy = 725.5", "fy = \"a\""),
            &expect![[r#"`camera.toml` line 4: invalid type: string "a", expected f64"#]],
        );
        check(
            "width = ",
            &expect!["`camera.toml` line 1: string values must be quoted, expected literal string"],
        );
    }

    #[test]
    fn numbers_that_no_camera_has_are_refused() {
        let focal = "1 to 1000000 pixels";
        let center = "-1000000 to 1000000 pixels";
        let side = "1 to 16384 pixels";
        for (name, value, shown, needed) in [
            ("fx", "0", "0.0", focal),
            ("fx", "0.5", "0.5", focal),
            ("fy", "-725", "-725.0", focal),
            ("fy", "nan", "NaN", focal),
            ("fx", "1e300", "1e300", focal),
            ("cx", "inf", "inf", center),
            ("cy", "-2e6", "-2000000.0", center),
            ("cx", "nan", "NaN", center),
            ("width", "0", "0.0", side),
            ("width", "99999999999", "99999999999", side),
            ("height", "-1", "-1", side),
            ("height", "16385", "16385.0", side),
        ] {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("camera.toml");
            let line = |line: &str| {
                if line.starts_with(name) {
                    format!("{name} = {value}\n")
                } else {
                    format!("{line}\n")
                }
            };
            write(&path, GOOD.lines().map(line).collect::<String>().as_bytes()).unwrap();
            let said = load_camera(&path).unwrap_err().to_string();
            let path = path.display();
            let expected =
                format!("`{name}` of the camera in `{path}` is {shown}, but must be {needed}");
            assert_eq!(said, expected);
        }
    }

    #[test]
    fn a_calibration_is_held_to_the_same_ranges() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib/a.txt");
        write(&path, P2.replace("700", "0.1").as_bytes()).unwrap();
        let image = RgbImage { size: [8, 4], pixels: vec![0; 96] };
        write_png(&folder.path().join("image_2/a.png"), &image).unwrap();
        let said = load_camera(&path).unwrap_err().to_string();
        assert!(said.contains("is 0.1, but must be 1 to 1000000 pixels"), "{said}");
    }

    #[test]
    fn a_calibration_takes_its_size_from_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib/000003.txt");
        write(&path, P2.as_bytes()).unwrap();
        let image = RgbImage { size: [8, 4], pixels: vec![0; 96] };
        write_png(&folder.path().join("image_2/000003.png"), &image).unwrap();
        let camera = load_camera(&path).unwrap();
        assert_eq!((camera.focal, camera.size), ([700.0, 710.0], [8, 4]));
    }

    #[test]
    fn a_calibration_without_image_or_matrix_says_what_it_lacks() {
        check(
            P2,
            &expect![
                "`camera.toml` has no image size, and there is no image `./image_2/camera.png`"
            ],
        );
        check("P0: 1 2 3\n", &expect!["`camera.toml`: there is no row `P2:`"]);
    }

    #[test]
    fn a_calibration_fits_images_of_any_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("calib.txt");
        write(&path, P2.as_bytes()).unwrap();
        let image = RgbImage { size: [8, 4], pixels: vec![0; 96] };
        let photo = Photo { image, focal_35mm: None };
        let (camera, origin) =
            Cameras::load(&path).unwrap().of(Path::new("a.png"), &photo).unwrap();
        assert_eq!((camera.size, camera.focal, origin), ([8, 4], [700.0, 710.0], Origin::Given));
    }

    #[test]
    fn guess_takes_exif_before_the_field_of_view() {
        let image = RgbImage { size: [400, 300], pixels: Vec::new() };
        let mut photo = Photo { image, focal_35mm: None };
        let cameras = Cameras::guess(90f64.to_radians());
        let (camera, origin) = cameras.of(Path::new("a.png"), &photo).unwrap();
        assert!((camera.focal[0] - 200.0).abs() < 1e-9 && origin == Origin::FieldOfView);
        let expected = Camera::pinhole(camera.focal[0], [199.5, 149.5], [400, 300]);
        assert_eq!(camera, expected);
        photo.focal_35mm = Some(43.266_615);
        let (camera, origin) = cameras.of(Path::new("a.png"), &photo).unwrap();
        assert!((camera.focal[0] - 500.0).abs() < 1e-9 && origin == Origin::Exif);
    }

    #[test]
    fn a_data_set_lends_the_camera_of_its_first_frame() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let row = "0 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n";
        write(&root.join("vkitti_1.3.1_extrinsicsgt/0001_clone.txt"), row.as_bytes()).unwrap();
        write(&root.join("vkitti_1.3.1_motgt/0001_clone.txt"), b"frame\n").unwrap();
        let camera = load_camera(root).unwrap();
        assert_eq!(camera, Camera::pinhole(725.0, [620.5, 187.0], [1242, 375]));
    }
}
