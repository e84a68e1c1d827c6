//! Average precision and recall of boxes and masks as COCO has them.
//!
//! Lin et al.: *Microsoft COCO: Common Objects in Context*, ECCV 2014; matching and arithmetic are those of
//! `pycocotools` 2.0: results by falling score, each takes the truth that overlaps most among those not taken, truths
//! that count before those that do not; a crowd may be taken more than once and is measured by the result's area.
//!
//! One difference: an annotation with the id 0 can be matched; `pycocotools` takes the id for "no match".

mod polygon;
mod read;
mod segmentation;

use rayon::prelude::*;

use crate::parts::rle::Rle;

use super::ranking::{Ranked, RankedCurve, RankedImage, linspace, mean, ranked_curve};

pub use polygon::rasterize;
pub use read::{CocoSet, parse_coco, read_coco};
pub use segmentation::{SegmentationError, segmentation_rle};

/// Areas in square pixels: all, small, medium, large.
const AREAS: [[f64; 2]; 4] =
    [[0.0, 1e10], [0.0, 32.0 * 32.0], [32.0 * 32.0, 96.0 * 96.0], [96.0 * 96.0, 1e10]];
/// Most results of an image and category that are matched.
const MOST_RESULTS: usize = 100;

/// An annotation.
#[derive(Clone, Debug, PartialEq)]
pub struct CocoTruth {
    /// Index into the categories of the set.
    pub category: usize,
    /// `x, y, width, height`, pixels.
    pub bounds: Option<[f64; 4]>,
    /// As the file says, square pixels.
    pub area: f64,
    /// A crowd is ignored, and so is what lies in it.
    pub crowd: bool,
    /// Its pixels.
    pub mask: Option<Rle>,
}

/// A detection.
#[derive(Clone, Debug, PartialEq)]
pub struct CocoResult {
    /// Index into the categories of the set.
    pub category: usize,
    /// `x, y, width, height`, pixels.
    pub bounds: Option<[f64; 4]>,
    /// Of the box if the file has boxes, else of the mask, as `pycocotools` takes it.
    pub area: f64,
    /// The more certain the higher.
    pub score: f64,
    /// Its pixels.
    pub mask: Option<Rle>,
}

/// The annotations and results of one image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CocoImage {
    /// In the order of the file.
    pub truths: Vec<CocoTruth>,
    /// In the order of the file.
    pub results: Vec<CocoResult>,
}

/// What overlap is measured by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CocoOverlap {
    /// Boxes.
    Boxes,
    /// Masks.
    Masks,
}

/// The twelve figures that `pycocotools` prints.
#[derive(Clone, Debug, PartialEq)]
pub struct CocoScores {
    /// Names and values in its order, shares of 1; `None` where nothing counts.
    pub figures: Vec<(&'static str, Option<f64>)>,
    /// Mean precision over all thresholds by category of the set.
    pub categories: Vec<Option<f64>>,
    /// Precision at recall i / 100, mean over the categories, at overlaps 0.50, 0.55 to 0.95; empty without truths.
    pub precision: Vec<Vec<f64>>,
}

/// Scores a set.
pub fn score_coco(set: &CocoSet, overlap: CocoOverlap) -> CocoScores {
    let thresholds = linspace(0.5, 0.95, 10);
    let categories: Vec<Category> = (0..set.categories.len())
        .into_par_iter()
        .map(|category| Category::new(set, category, overlap, &thresholds))
        .collect();
    let curves = |area: usize, most: usize| -> Vec<Vec<&RankedCurve>> {
        categories.iter().map(|category| category.curves(area, most)).collect()
    };
    let precision = |area: usize, threshold: Option<usize>| {
        let curves = curves(area, 100);
        let picked = curves.iter().flat_map(|curves| {
            let chosen = curves.iter().enumerate();
            chosen.filter(|(i, _)| threshold.is_none_or(|threshold| threshold == *i))
        });
        mean(picked.flat_map(|(_, curve)| curve.precision.iter().copied()))
    };
    let recall = |area: usize, most: usize| {
        mean(curves(area, most).iter().flatten().map(|curve| curve.recall))
    };
    let figures = vec![
        ("AP", precision(0, None)),
        ("AP50", precision(0, Some(0))),
        ("AP75", precision(0, Some(5))),
        ("AP_small", precision(1, None)),
        ("AP_medium", precision(2, None)),
        ("AP_large", precision(3, None)),
        ("AR_1", recall(0, 1)),
        ("AR_10", recall(0, 10)),
        ("AR_100", recall(0, 100)),
        ("AR_small", recall(1, 100)),
        ("AR_medium", recall(2, 100)),
        ("AR_large", recall(3, 100)),
    ];
    let all = curves(0, 100);
    let of_category = |curves: &Vec<&RankedCurve>| {
        mean(curves.iter().flat_map(|curve| curve.precision.iter().copied()))
    };
    let at = |threshold: usize, point: usize| {
        mean(all.iter().filter_map(|curves| Some(curves.get(threshold)?.precision[point])))
    };
    let curve = |threshold: usize| {
        (0..super::ranking::RECALL_POINTS)
            .map(|point| at(threshold, point))
            .collect::<Option<Vec<f64>>>()
    };
    CocoScores {
        figures,
        categories: all.iter().map(of_category).collect(),
        precision: (0..thresholds.len()).filter_map(curve).collect(),
    }
}

/// Areas and most results that the figures need.
const SETTINGS: [(usize, usize); 6] = [(0, 1), (0, 10), (0, 100), (1, 100), (2, 100), (3, 100)];

/// The curves of one category.
struct Category {
    /// By [`SETTINGS`], then by threshold; empty where nothing counts.
    curves: Vec<Vec<RankedCurve>>,
}

impl Category {
    fn new(set: &CocoSet, category: usize, overlap: CocoOverlap, thresholds: &[f64]) -> Self {
        let pairs: Vec<Pairs> =
            set.images.iter().filter_map(|image| Pairs::new(image, category, overlap)).collect();
        let mut curves: Vec<Vec<RankedCurve>> = vec![Vec::new(); SETTINGS.len()];
        for (area, range) in AREAS.iter().enumerate() {
            for threshold in thresholds {
                let ranked: Vec<RankedImage> =
                    pairs.iter().map(|pairs| pairs.matched(*threshold, *range)).collect();
                for (i, (_, most)) in
                    SETTINGS.iter().enumerate().filter(|(_, (wanted, _))| *wanted == area)
                {
                    curves[i].extend(ranked_curve(&ranked, *most));
                }
            }
        }
        Self { curves }
    }

    fn curves(&self, area: usize, most: usize) -> Vec<&RankedCurve> {
        let setting = SETTINGS.iter().position(|setting| *setting == (area, most));
        setting.map_or(Vec::new(), |setting| self.curves[setting].iter().collect())
    }
}

/// The truths and results of one image and category, with all overlaps.
struct Pairs<'a> {
    truths: Vec<&'a CocoTruth>,
    /// By falling score.
    results: Vec<&'a CocoResult>,
    /// By result, then truth.
    overlaps: Vec<Vec<f64>>,
}

impl<'a> Pairs<'a> {
    fn new(image: &'a CocoImage, category: usize, overlap: CocoOverlap) -> Option<Self> {
        let truths: Vec<&CocoTruth> =
            image.truths.iter().filter(|truth| truth.category == category).collect();
        let mut results: Vec<&CocoResult> =
            image.results.iter().filter(|result| result.category == category).collect();
        if truths.is_empty() && results.is_empty() {
            return None;
        }
        results.sort_by(|a, b| b.score.total_cmp(&a.score));
        results.truncate(MOST_RESULTS);
        let of = |result: &&CocoResult| {
            let with = |truth: &&CocoTruth| match overlap {
                CocoOverlap::Boxes => box_overlap(result, truth),
                CocoOverlap::Masks => mask_overlap(result, truth),
            };
            truths.iter().map(with).collect()
        };
        let overlaps = results.iter().map(of).collect();
        Some(Self { truths, results, overlaps })
    }

    fn matched(&self, threshold: f64, area: [f64; 2]) -> RankedImage {
        let outside = |value: f64| value < area[0] || value > area[1];
        let ignored: Vec<bool> =
            self.truths.iter().map(|truth| truth.crowd || outside(truth.area)).collect();
        let mut order: Vec<usize> = (0..ignored.len()).collect();
        order.sort_by_key(|truth| ignored[*truth]);
        let mut taken = vec![false; ignored.len()];
        let mut results = Vec::with_capacity(self.results.len());
        for (result, overlaps) in self.results.iter().zip(&self.overlaps) {
            let mut best = threshold.min(1.0 - 1e-10);
            let mut found: Option<usize> = None;
            for truth in order.iter().copied() {
                if taken[truth] && !self.truths[truth].crowd {
                    continue;
                }
                // A truth that counts is not given up for one that does not.
                if found.is_some_and(|found| !ignored[found]) && ignored[truth] {
                    break;
                }
                if overlaps[truth] >= best {
                    best = overlaps[truth];
                    found = Some(truth);
                }
            }
            if let Some(truth) = found {
                taken[truth] = true;
            }
            results.push(Ranked {
                score: result.score,
                matched: found.is_some(),
                ignored: found.map_or(outside(result.area), |truth| ignored[truth]),
            });
        }
        RankedImage { results, positives: ignored.iter().filter(|ignored| !**ignored).count() }
    }
}

fn box_overlap(result: &CocoResult, truth: &CocoTruth) -> f64 {
    let (Some(d), Some(g)) = (result.bounds, truth.bounds) else { return 0.0 };
    let shared =
        |axis: usize| (d[axis + 2] + d[axis]).min(g[axis + 2] + g[axis]) - d[axis].max(g[axis]);
    let [width, height] = [shared(0), shared(1)];
    if width <= 0.0 || height <= 0.0 {
        return 0.0;
    }
    let [own, other] = [d[2] * d[3], g[2] * g[3]];
    let shared = width * height;
    shared / if truth.crowd { own } else { own + other - shared }
}

fn mask_overlap(result: &CocoResult, truth: &CocoTruth) -> f64 {
    let (Some(d), Some(g)) = (&result.mask, &truth.mask) else { return 0.0 };
    let [a, b] = [d.bounds(), g.bounds()];
    let apart = |i: usize| a[i] + a[i + 2] <= b[i] || b[i] + b[i + 2] <= a[i];
    if apart(0) || apart(1) {
        return 0.0;
    }
    // Masks of different sizes are refused when they are read.
    let Some(shared) = d.intersection(g).map(|shared| shared.area()) else { return 0.0 };
    let whole = if truth.crowd { d.area() } else { d.area() + g.area() - shared };
    if shared == 0 { 0.0 } else { shared as f64 / whole as f64 }
}
