//! Pose errors and recalls of the BOP benchmark: MSSD, MSPD, ADD.
//!
//! Hodan et al.: *BOP: Benchmark for 6D Object Pose Estimation*, ECCV 2018, and *BOP Challenge 2020 on 6D Object
//! Localization*, ECCVW 2020; Hinterstoisser et al., ACCV 2012, for ADD. Matching and thresholds are those of the
//! `bop_toolkit` for the task of 2019: of every object of an image as many estimates as it has instances, by falling
//! score, each takes the truth that it misses least.
//!
//! VSD, the third error of the benchmark, needs depth images and is not computed, so the benchmark's average over all
//! three is not given either. Lengths are millimetres here, as in all BOP files.

mod errors;
mod ply;
mod read;
mod symmetry;

use std::collections::BTreeMap;

use nalgebra::Matrix3;
use rayon::prelude::*;

use crate::geometry::{Point3, Vector3};

use super::ranking::mean;

pub use errors::{add, adi, mspd, mssd};
pub use ply::parse_ply_vertices;
pub use read::{BopFolders, parse_estimates, read_bop};
pub use symmetry::{ContinuousSymmetry, MAX_STEP, symmetries};

/// Where an object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BopPose {
    /// Takes the object's frame to the camera's.
    pub rotation: Matrix3<f64>,
    /// The object's origin in the camera frame, millimetres.
    pub translation: Vector3,
}

/// An object that is in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BopTruth {
    /// Its id.
    pub object: u32,
    /// Where it is.
    pub pose: BopPose,
    /// Visible share, 0 to 1, where it is known.
    pub visible: Option<f64>,
}

/// An estimate: a line of a results file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BopEstimate {
    /// Id of the scene.
    pub scene: u32,
    /// Id of the image in its scene.
    pub image: u32,
    /// Id of the object.
    pub object: u32,
    /// The more certain the higher.
    pub score: f64,
    /// Where it is.
    pub pose: BopPose,
    /// Seconds for the whole image; -1 if unknown.
    pub time: f64,
}

/// The shape of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct BopObject {
    /// Largest distance of two vertices, millimetres.
    pub diameter: f64,
    /// The vertices, millimetres.
    pub points: Vec<Point3>,
    /// Poses that look alike, the identity among them.
    pub symmetries: Vec<BopPose>,
}

/// An image of a test set.
#[derive(Clone, Debug, PartialEq)]
pub struct BopImage {
    /// Id of its scene.
    pub scene: u32,
    /// Its id.
    pub image: u32,
    /// The camera matrix, pixels.
    pub camera: Matrix3<f64>,
    /// What is there, in the order of the file.
    pub truths: Vec<BopTruth>,
    /// How many instances of each object are to be found.
    pub targets: BTreeMap<u32, usize>,
}

/// A test set.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BopSet {
    /// By id.
    pub objects: BTreeMap<u32, BopObject>,
    /// By scene and id.
    pub images: Vec<BopImage>,
    /// Of the images, pixels; MSPD is counted in images of 640.
    pub image_width: f64,
}

/// Recalls under one error.
#[derive(Clone, Debug, PartialEq)]
pub struct BopRecalls {
    /// The threshold of correctness and the recall under it.
    pub recalls: Vec<(f64, f64)>,
    /// Their mean.
    pub average: Option<f64>,
    /// Their mean by object.
    pub objects: BTreeMap<u32, f64>,
}

/// The recalls of a set of estimates.
#[derive(Clone, Debug, PartialEq)]
pub struct BopScores {
    /// Largest distance of surfaces, thresholds 0.05 to 0.5 of the diameter.
    pub mssd: BopRecalls,
    /// Largest distance in the image, thresholds 5 to 50 pixels in an image of 640.
    pub mspd: BopRecalls,
    /// Mean distance of vertices, to the nearest for objects with symmetries; threshold 0.1 of the diameter.
    pub add: BopRecalls,
    /// How many instances were to be found.
    pub targets: usize,
    /// Estimates of objects or images that are no target, or past the number that is to be found.
    pub unused: usize,
    /// Mean seconds an image, if all estimates have a time.
    pub time: Option<f64>,
}

/// One estimate against the truths of its object, as shares of the diameter and pixels in an image of 640.
struct Compared {
    image: usize,
    object: u32,
    /// Truth, MSSD, MSPD, ADD.
    errors: Vec<(usize, [f64; 3])>,
}

/// Scores estimates.
pub fn score_bop(set: &BopSet, estimates: &[BopEstimate]) -> BopScores {
    let index: BTreeMap<(u32, u32), usize> =
        set.images.iter().enumerate().map(|(i, image)| ((image.scene, image.image), i)).collect();
    let mut by_target: BTreeMap<(usize, u32), Vec<&BopEstimate>> = BTreeMap::new();
    let mut unused = 0;
    for estimate in estimates {
        let image = index.get(&(estimate.scene, estimate.image));
        match image.filter(|image| set.images[**image].targets.contains_key(&estimate.object)) {
            Some(image) => by_target.entry((*image, estimate.object)).or_default().push(estimate),
            None => unused += 1,
        }
    }
    let mut work: Vec<(usize, &BopEstimate)> = Vec::new();
    for ((image, object), mut estimates) in by_target {
        let wanted = set.images[image].targets.get(&object).copied().unwrap_or(0);
        estimates.sort_by(|a, b| b.score.total_cmp(&a.score));
        unused += estimates.len().saturating_sub(wanted);
        work.extend(estimates.into_iter().take(wanted).map(|estimate| (image, estimate)));
    }
    // Parallel, but in order: work of one target stays together and by falling score.
    let compared: Vec<Compared> =
        work.par_iter().map(|(image, estimate)| compare(set, *image, estimate)).collect();
    let valid: Vec<Vec<bool>> = set.images.iter().map(valid_truths).collect();
    let recalls =
        |error: usize, thresholds: &[f64]| recalls(set, &compared, &valid, error, thresholds);
    let twentieths: Vec<f64> = (1..=10).map(|i| f64::from(i) * 0.05).collect();
    let pixels: Vec<f64> = (1..=10).map(|i| f64::from(i) * 5.0).collect();
    BopScores {
        mssd: recalls(0, &twentieths),
        mspd: recalls(1, &pixels),
        add: recalls(2, &[0.1]),
        targets: valid.iter().flatten().filter(|valid| **valid).count(),
        unused,
        time: time_per_image(estimates),
    }
}

fn compare(set: &BopSet, image: usize, estimate: &BopEstimate) -> Compared {
    let scene = &set.images[image];
    let mut errors = Vec::new();
    if let Some(object) = set.objects.get(&estimate.object) {
        let truths = scene.truths.iter().enumerate();
        for (i, truth) in truths.filter(|(_, truth)| truth.object == estimate.object) {
            let (found, there, points) = (&estimate.pose, &truth.pose, &object.points);
            let mean_distance = if object.symmetries.len() > 1 {
                adi(found, there, points)
            } else {
                add(found, there, points)
            };
            let pixels = mspd(found, there, &scene.camera, object) * 640.0 / set.image_width;
            let surface = mssd(found, there, object) / object.diameter;
            errors.push((i, [surface, pixels, mean_distance / object.diameter]));
        }
    }
    Compared { image, object: estimate.object, errors }
}

/// The truths that count: of every target as many as are to be found, the most visible ones.
fn valid_truths(image: &BopImage) -> Vec<bool> {
    let mut valid = vec![false; image.truths.len()];
    for (object, count) in &image.targets {
        let mut mine: Vec<usize> =
            (0..valid.len()).filter(|i| image.truths[*i].object == *object).collect();
        let visible = |i: usize| image.truths[i].visible.unwrap_or(1.0);
        mine.sort_by(|a, b| visible(*b).total_cmp(&visible(*a)));
        mine.into_iter().take(*count).for_each(|i| valid[i] = true);
    }
    valid
}

fn recalls(
    set: &BopSet,
    compared: &[Compared],
    valid: &[Vec<bool>],
    error: usize,
    thresholds: &[f64],
) -> BopRecalls {
    let mut targets: BTreeMap<u32, usize> = BTreeMap::new();
    for (image, valid) in set.images.iter().zip(valid) {
        for (truth, _) in image.truths.iter().zip(valid).filter(|(_, valid)| **valid) {
            *targets.entry(truth.object).or_default() += 1;
        }
    }
    let total: usize = targets.values().sum();
    let mut recalls = Vec::new();
    let mut of_objects: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
    for threshold in thresholds {
        let mut found: BTreeMap<u32, usize> = BTreeMap::new();
        let mut taken: Vec<Vec<bool>> = valid.iter().map(|v| vec![false; v.len()]).collect();
        for one in compared {
            let mut best = (None, *threshold);
            for (truth, errors) in &one.errors {
                let free = valid[one.image][*truth] && !taken[one.image][*truth];
                if free && errors[error] < best.1 {
                    best = (Some(*truth), errors[error]);
                }
            }
            if let Some(truth) = best.0 {
                taken[one.image][truth] = true;
                *found.entry(one.object).or_default() += 1;
            }
        }
        for (object, count) in &targets {
            let found = found.get(object).copied().unwrap_or(0);
            of_objects.entry(*object).or_default().push(found as f64 / *count as f64);
        }
        let found: usize = found.values().sum();
        recalls.push((*threshold, found as f64 / total.max(1) as f64));
    }
    let average = mean(recalls.iter().map(|(_, recall)| *recall)).filter(|_| total > 0);
    let objects = of_objects.into_iter().filter_map(|(id, values)| Some((id, mean(values)?)));
    BopRecalls { recalls, average, objects: objects.collect() }
}

fn time_per_image(estimates: &[BopEstimate]) -> Option<f64> {
    let times: BTreeMap<(u32, u32), f64> =
        estimates.iter().map(|e| ((e.scene, e.image), e.time)).collect();
    mean(times.into_values()).filter(|_| estimates.iter().all(|estimate| estimate.time >= 0.0))
}
