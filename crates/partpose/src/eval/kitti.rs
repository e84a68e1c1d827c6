//! Average precision as KITTI's object benchmark has it: 2D boxes, orientation, bird's-eye view, 3D.
//!
//! Geiger, Lenz, Urtasun: *Are We Ready for Autonomous Driving? The KITTI Vision Benchmark Suite*, CVPR 2012; the
//! matching, its two passes and its quirks are those of the evaluator of the development kit. Simonelli et al.:
//! *Disentangling Monocular 3D Object Detection*, ICCV 2019, replaced the 11 recall points by 40.
//!
//! For every class, metric and difficulty the labels are matched twice. The first pass takes the highest score and
//! gives the scores at which recall passes each fortieth; the second takes the greatest overlap and gives precision
//! at these scores. A detection that is too low is ignored before its class is looked at, so it can take a label of
//! another class.

mod curve;
mod matching;
mod overlap;
mod read;

use rayon::prelude::*;
use serde::Serialize;

use crate::geometry::Rect;

pub use curve::Curve;
pub use read::{KittiFiles, parse_kitti, read_kitti};

/// One label or detection, in the numbers of its line.
#[derive(Clone, Debug, PartialEq)]
pub struct KittiObject {
    /// `Car`, `DontCare` and so on.
    pub category: String,
    /// Truncated share; -1 if unknown.
    pub truncation: f64,
    /// Level of occlusion, 0 to 3; -1 if unknown.
    pub occlusion: f64,
    /// Observation angle, radians.
    pub alpha: f64,
    /// The 2D box, taken as continuous coordinates, pixels.
    pub bounds: Rect,
    /// Height, width and length, metres.
    pub size: [f64; 3],
    /// Centre of the bottom face in the camera frame, metres.
    pub location: [f64; 3],
    /// Yaw about the axis that points down, radians; 0 faces right.
    pub rotation_y: f64,
    /// The more certain the higher; 0 for labels.
    pub score: f64,
}

/// The labels of an image and what was detected in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KittiFrame {
    /// In the order of their file.
    pub labels: Vec<KittiObject>,
    /// In the order of their file, which decides between equals.
    pub detections: Vec<KittiObject>,
}

/// What is scored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum KittiClass {
    /// Vans count neither for nor against it.
    Car,
    /// People who sit count neither for nor against it.
    Pedestrian,
    /// Has no neighbour.
    Cyclist,
}

impl KittiClass {
    /// In the order of the benchmark.
    pub const ALL: [Self; 3] = [Self::Car, Self::Pedestrian, Self::Cyclist];

    /// As in results and metrics.
    pub fn name(self) -> &'static str {
        match self {
            Self::Car => "car",
            Self::Pedestrian => "pedestrian",
            Self::Cyclist => "cyclist",
        }
    }

    /// The class that is neither counted nor penalised.
    fn neighbour(self) -> &'static str {
        match self {
            Self::Car => "van",
            Self::Pedestrian => "person_sitting",
            Self::Cyclist => "",
        }
    }
}

/// What overlap is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KittiMetric {
    /// Boxes in the image; orientation is scored by the same matching.
    Image,
    /// Rotated rectangles on the ground.
    BirdsEye,
    /// Boxes that stand upright, rotated about the vertical.
    Volume,
}

impl KittiMetric {
    /// In the order of the benchmark.
    pub const ALL: [Self; 3] = [Self::Image, Self::BirdsEye, Self::Volume];
}

/// What counts as a label at one level of difficulty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KittiDifficulty {
    /// `easy`, `moderate`, `hard`.
    pub name: &'static str,
    /// Least height of a 2D box, pixels.
    pub min_height: f64,
    /// Highest level of occlusion.
    pub max_occlusion: f64,
    /// Largest truncated share.
    pub max_truncation: f64,
}

impl KittiDifficulty {
    /// Those of the benchmark.
    pub const ALL: [Self; 3] = [
        Self { name: "easy", min_height: 40.0, max_occlusion: 0.0, max_truncation: 0.15 },
        Self { name: "moderate", min_height: 25.0, max_occlusion: 1.0, max_truncation: 0.30 },
        Self { name: "hard", min_height: 25.0, max_occlusion: 2.0, max_truncation: 0.50 },
    ];
}

/// Least overlaps; a match needs more.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KittiOptions {
    /// Car, pedestrian, cyclist; the same for all three metrics.
    pub min_overlap: [f64; 3],
}

impl Default for KittiOptions {
    fn default() -> Self {
        Self { min_overlap: [0.7, 0.5, 0.5] }
    }
}

/// The curves of one class.
#[derive(Clone, Debug, PartialEq)]
pub struct KittiScores {
    /// The class.
    pub class: KittiClass,
    /// By [`KittiMetric::ALL`], then by [`KittiDifficulty::ALL`].
    pub curves: [[Curve; 3]; 3],
}

/// Scores all classes over all frames.
pub fn score_kitti(frames: &[KittiFrame], options: &KittiOptions) -> Vec<KittiScores> {
    let overlaps: [Vec<overlap::Overlaps>; 3] = KittiMetric::ALL
        .map(|metric| frames.par_iter().map(|frame| overlap::overlaps(frame, metric)).collect());
    let score = |(class, least): (KittiClass, f64)| {
        let curve = |metric: usize, difficulty: &KittiDifficulty| {
            let task = matching::Task::new(frames, &overlaps[metric], class, difficulty, least);
            curve::curve(&task)
        };
        let curves: [[Curve; 3]; 3] = std::array::from_fn(|metric| {
            let levels = KittiDifficulty::ALL.each_ref();
            levels.map(|difficulty| curve(metric, difficulty))
        });
        KittiScores { class, curves }
    };
    let pairs: Vec<_> = KittiClass::ALL.into_iter().zip(options.min_overlap).collect();
    pairs.into_par_iter().map(score).collect()
}
