//! From detections to poses, and to the files that say so: what `fit` and `run` share.

use std::path::{Path, PathBuf};

use partpose::detection::{DetectedSize, Detection};
use partpose::files::{self, RgbImage};
use partpose::formats::{ResultSettings, image_result};
use partpose::geometry::{Camera, Cuboid, Extent};
use partpose::pose::dense::SizePrior;
use partpose::pose::scene::{SceneDetection, SceneOptions, estimate_scene};
use partpose::pose::{ExtentSource, NoPose, PoseEstimate, PoseEstimator};
use partpose::vehicle::ModelZoo;
use serde::Deserialize;
use serde_json::Value;

use super::mask_bias;
use super::result_files::{self, Pictured};
use crate::pose_flags::PoseFlags;
use crate::scene_flags::SceneFlags;

#[derive(clap::Args)]
pub(crate) struct FitFlags {
    /// Folder of the models; the embedded ones if not given
    #[arg(long, value_name = "DIR")]
    zoo: Option<PathBuf>,
    /// Size of the vehicles, on which their distance depends: `file` takes the detections' own `extents`, as sizes that
    /// are likely where they come with `extent_sigma`, else the models'; `model` the models'; `free` starts with the
    /// models', and what detections say of it, and lets the dense fit stretch them; width,height,length in metres is
    /// one size for all
    #[arg(long, value_name = "SIZE", default_value = "file", value_parser = parse_extent)]
    extent: FitExtent,
    /// Draw no pictures
    #[arg(long)]
    no_pictures: bool,
    /// How far masks lie off the models' outlines, for the dense fit: `mask-bias.json` of `evaluate poses --mask-bias`
    #[arg(long, value_name = "FILE")]
    mask_bias: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneFlags,
    #[command(flatten)]
    pose: PoseFlags,
}

impl FitFlags {
    /// What is asked for of the vehicles of an image together, for records.
    pub(crate) fn scene(&self) -> Value {
        self.scene.settings()
    }
}

impl Default for FitFlags {
    /// What the flags say when none is given.
    fn default() -> Self {
        #[derive(clap::Parser)]
        struct Alone {
            #[command(flatten)]
            flags: FitFlags,
        }
        <Alone as clap::Parser>::parse_from(["fit"]).flags
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) enum FitExtent {
    File,
    Model,
    Free,
    Given(Extent),
}

pub(super) fn parse_extent(text: &str) -> Result<FitExtent, String> {
    match text {
        "file" => return Ok(FitExtent::File),
        "model" => return Ok(FitExtent::Model),
        "free" => return Ok(FitExtent::Free),
        _ => {}
    }
    let sides: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    match sides.as_deref() {
        Ok([width, height, length]) => {
            let extent = Extent::new(*width, *height, *length);
            let believed = [0.1, 100.0];
            if [*width, *height, *length]
                .iter()
                .all(|side| (believed[0]..=believed[1]).contains(side))
            {
                return Ok(FitExtent::Given(extent));
            }
            Err("width, height and length must lie between 0.1 and 100 metres".to_owned())
        }
        _ => Err("`file`, `model`, `free` or width,height,length is meant, such as 1.8,1.5,4.4"
            .to_owned()),
    }
}

impl FitExtent {
    /// Where the size of a detection comes from that may have one of its own.
    pub(super) fn source(self, own: Option<&DetectedSize>) -> ExtentSource {
        match (self, own) {
            (Self::Given(extent), _) => ExtentSource::Given(extent),
            (Self::File, Some(size)) if size.is_exact() => ExtentSource::Given(size.extent),
            // The fit adds what the detection says.
            (Self::File, Some(_)) | (Self::Free, _) => ExtentSource::Free(SizePrior::around(None)),
            (Self::File, None) | (Self::Model, _) => ExtentSource::Model,
        }
    }

    fn in_words(self) -> String {
        match self {
            Self::File => "of the detections, else of the models".to_owned(),
            Self::Model => "of the models".to_owned(),
            Self::Free => "of the models, stretched by the masks".to_owned(),
            Self::Given(Extent { width, height, length }) => {
                format!("given: {width} x {height} x {length} m (width, height, length)")
            }
        }
    }
}

pub(crate) fn parse_score(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err("a score from 0 to 1 is meant".to_owned()),
    }
}

/// What every image is fitted with.
pub(crate) struct Fitter {
    zoo: ModelZoo,
    estimator: PoseEstimator,
    extent: FitExtent,
    scene: SceneOptions,
    settings: ResultSettings,
    pictures: bool,
    out: PathBuf,
}

/// One image with what was found in it.
pub(crate) struct Fitting<'a> {
    pub(crate) name: &'a str,
    /// Name of the files that are written, without their endings.
    pub(crate) stem: &'a str,
    pub(crate) camera: &'a Camera,
    /// To draw on; of the camera's size.
    pub(crate) image: Option<&'a RgbImage>,
    pub(crate) detections: Vec<Detection>,
}

/// A detection with its pose, or why it has none.
pub(crate) type Estimated = (Detection, Result<PoseEstimate, NoPose>);

/// An image whose results are written.
pub(crate) struct Shown<'a> {
    pub(crate) name: &'a str,
    /// Name of the files that are written, without their endings.
    pub(crate) stem: &'a str,
    pub(crate) camera: &'a Camera,
    /// To draw on; of the camera's size.
    pub(crate) image: Option<&'a RgbImage>,
    /// What is true of each vehicle, where that is known, to be drawn.
    pub(crate) truth: &'a dyn Fn(usize) -> Option<Cuboid>,
}

/// What became of detections.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Counts {
    pub(crate) posed: usize,
    pub(crate) without: usize,
    /// Images that could not be done, or not be drawn on.
    pub(crate) skipped: usize,
}

impl Counts {
    pub(crate) fn add(&mut self, other: &Self) {
        self.posed += other.posed;
        self.without += other.without;
        self.skipped += other.skipped;
    }
}

impl Fitter {
    /// Reads the zoo and prepares it.
    pub(crate) fn new(flags: &FitFlags, out: &Path) -> anyhow::Result<Self> {
        let mut options = flags.pose.options();
        options.dense.mask_bias = flags.mask_bias.as_deref().map(mask_bias::read).transpose()?;
        let zoo = match &flags.zoo {
            Some(folder) => ModelZoo::load(folder)?,
            None => ModelZoo::embedded(),
        };
        let name = flags.zoo.as_ref().map(|zoo| zoo.display().to_string());
        Ok(Self {
            estimator: PoseEstimator::new(&zoo, &options),
            zoo,
            extent: flags.extent,
            scene: flags.scene.options(),
            settings: ResultSettings {
                version: env!("CARGO_PKG_VERSION"),
                zoo: name.unwrap_or_else(|| "embedded".to_owned()),
                extent: flags.extent.in_words(),
                pose: options,
                run: None,
            },
            pictures: !flags.no_pictures,
            out: out.to_owned(),
        })
    }

    /// The same, with results that say of which run they are.
    pub(crate) fn of_run(self, run: String) -> Self {
        Self { settings: ResultSettings { run: Some(run), ..self.settings }, ..self }
    }

    /// The models.
    pub(crate) fn zoo(&self) -> &ModelZoo {
        &self.zoo
    }

    /// What the results depend on.
    pub(crate) fn settings(&self) -> &ResultSettings {
        &self.settings
    }

    /// Whether pictures are asked for.
    pub(crate) fn draws(&self) -> bool {
        self.pictures
    }

    /// Names of the files of an image.
    fn files(&self, stem: &str) -> Vec<PathBuf> {
        let endings = ["json", "txt"].into_iter().chain(self.pictures.then_some("png"));
        endings.map(|ending| self.out.join(format!("{stem}.{ending}"))).collect()
    }

    /// Whether all files of an image are there, of the same run. Each is written whole or not at all, and the JSON, which
    /// says of which run it is, last: the others are not older.
    pub(crate) fn has_written(&self, stem: &str) -> bool {
        #[derive(Deserialize)]
        struct Written {
            settings: Settings,
        }
        #[derive(Deserialize)]
        struct Settings {
            run: Option<String>,
        }
        let bytes = files::read(&self.out.join(format!("{stem}.json")));
        let written: Option<Written> =
            bytes.ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
        written.is_some_and(|written| written.settings.run == self.settings.run)
            && self.files(stem).iter().all(|path| path.is_file())
    }

    /// Finds the poses of an image and writes JSON, KITTI text and picture.
    pub(crate) fn fit(&self, fitting: Fitting) -> anyhow::Result<Counts> {
        let Fitting { name, stem, camera, image, detections } = fitting;
        let estimated = self.estimate(camera, detections);
        self.write(&Shown { name, stem, camera, image, truth: &|_| None }, &estimated)
    }

    /// Finds the poses of an image.
    pub(crate) fn estimate(&self, camera: &Camera, detections: Vec<Detection>) -> Vec<Estimated> {
        let given: Vec<SceneDetection> = detections
            .iter()
            .map(|detection| {
                let extent = self.extent.source(detection.size.as_ref());
                SceneDetection { detection, extent }
            })
            .collect();
        let found = estimate_scene(&self.estimator, &self.zoo, camera, &given, &self.scene);
        let mut estimated: Vec<Estimated> = detections.into_iter().zip(found.vehicles).collect();
        for (detection, estimate) in &mut estimated {
            if let Ok(estimate) = estimate {
                self.estimator.observe(camera, detection, estimate);
            }
        }
        estimated
    }

    /// Writes JSON, KITTI text and picture of an image.
    pub(crate) fn write(&self, shown: &Shown, estimated: &[Estimated]) -> anyhow::Result<Counts> {
        let Shown { name, stem, camera, image, truth } = shown;
        let posed = estimated.iter().filter(|(_, estimate)| estimate.is_ok()).count();
        if self.pictures {
            let pictured: Vec<Pictured> = estimated
                .iter()
                .enumerate()
                .map(|(i, (detection, estimate))| Pictured {
                    detection,
                    estimate: estimate.as_ref().ok(),
                    zoo: &self.zoo,
                    truth: truth(i),
                })
                .collect();
            let drawn = (pictured.as_slice(), self.estimator.options().scaling);
            let picture = result_files::picture(stem, camera, *image, drawn);
            files::write_png(&self.out.join(format!("{stem}.png")), &picture)?;
        }
        let result = image_result(name, camera, &self.settings, estimated);
        let written: Vec<_> = estimated.iter().map(|(d, e)| (d, e.as_ref().ok())).collect();
        result_files::write_results(&self.out, stem, &result, &written, &self.zoo)?;
        Ok(Counts { posed, without: estimated.len() - posed, skipped: 0 })
    }
}
