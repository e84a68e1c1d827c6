//! Average precision of car poses as `ApolloCar3D` has it (A3DP).
//!
//! Song et al.: *`ApolloCar3D`: A Large 3D Car Instance Understanding Benchmark for Autonomous Driving*, CVPR 2019; the
//! arithmetic is that of the evaluator in the `dataset-api`. A result is right under a criterion if its shape, its
//! translation and its rotation are near enough at once; ten criteria go from loose to strict. `Abs` measures
//! translation in metres, `Rel` as a share of the truth's distance from the camera.
//!
//! The released evaluator does not go back to the criterion when it comes to the next result of an image: what the
//! last match reached is demanded of all that follow. [`A3dpMatching::Released`] repeats this, for figures that are to
//! be comparable with its own; [`A3dpMatching::Fresh`] asks the same of every result, as the paper's text does and as
//! later evaluators do.

mod read;

use crate::geometry::Vector3;

use super::ranking::{Ranked, RankedImage, linspace, mean, ranked_curve};

pub use read::{A3dpFiles, parse_a3dp, parse_similarity, read_a3dp};

/// Criteria from loose to strict.
const CRITERIA: usize = 10;
/// Most results of an image that count.
const MOST_RESULTS: usize = 100;
/// Areas in square pixels: all, small, medium, large.
const AREAS: [[f64; 2]; 4] =
    [[0.0, 1e10], [0.0, 64.0 * 64.0], [64.0 * 64.0, 192.0 * 192.0], [192.0 * 192.0, 1e10]];

/// One car, true or found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct A3dpCar {
    /// Row and column in the similarities.
    pub model: usize,
    /// Roll, pitch and yaw, radians, about x, y and z.
    pub rotation: [f64; 3],
    /// In the camera frame, metres.
    pub translation: [f64; 3],
    /// Pixels that show it.
    pub area: f64,
    /// The more certain the higher; 0 for truths.
    pub score: f64,
}

/// The cars of one image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct A3dpImage {
    /// What is there.
    pub truths: Vec<A3dpCar>,
    /// What was found, in the order of the file.
    pub results: Vec<A3dpCar>,
}

/// How alike models are, 0 to 1, by the result's model and then the truth's.
///
/// Invariant, which is why the fields are private: there is a value for every pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Similarity {
    models: usize,
    values: Vec<f64>,
}

impl Similarity {
    /// A square table, row by row; `None` if it is none.
    pub fn new(models: usize, values: Vec<f64>) -> Option<Self> {
        (models > 0 && models.checked_mul(models) == Some(values.len()))
            .then_some(Self { models, values })
    }

    /// How many models there are.
    pub fn models(&self) -> usize {
        self.models
    }

    fn of(&self, result: usize, truth: usize) -> f64 {
        self.values.get(result * self.models + truth).copied().unwrap_or(0.0)
    }
}

/// What translation is measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum A3dpDistance {
    /// Metres, 2.8 down to 0.1.
    Absolute,
    /// Shares of the truth's distance, 0.10 down to 0.01.
    Relative,
}

/// What is demanded of a result after the first match of its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum A3dpMatching {
    /// What the last match reached, as in the released evaluator.
    Released,
    /// The criterion.
    Fresh,
}

/// The twelve figures that the evaluator prints; `None` where no truth counts.
#[derive(Clone, Debug, PartialEq)]
pub struct A3dpScores {
    /// Names and values in the order of the evaluator.
    pub figures: Vec<(&'static str, Option<f64>)>,
    /// Precision at recall i / 100 under each criterion, over all areas; empty without truths.
    pub precision: Vec<Vec<f64>>,
}

/// Shape, translation and rotation of a result against a truth.
#[derive(Clone, Copy, Debug)]
struct Likeness {
    shape: f64,
    translation: f64,
    /// Degrees.
    rotation: f64,
}

impl Likeness {
    fn satisfies(&self, criterion: &Self) -> bool {
        self.shape >= criterion.shape
            && self.translation <= criterion.translation
            && self.rotation <= criterion.rotation
    }
}

/// Scores all images.
pub fn score_a3dp(
    images: &[A3dpImage],
    similarity: &Similarity,
    distance: A3dpDistance,
    matching: A3dpMatching,
) -> A3dpScores {
    let ranked: Vec<Prepared> =
        images.iter().map(|image| Prepared::new(image, similarity, distance)).collect();
    let criteria = criteria(distance);
    let curves = |area: usize, most: usize| {
        let curve = |criterion: &Likeness| {
            let images: Vec<RankedImage> = ranked
                .iter()
                .map(|image| image.matched(criterion, AREAS[area], matching))
                .collect();
            ranked_curve(&images, most)
        };
        criteria.iter().filter_map(curve).collect::<Vec<_>>()
    };
    let precision = |area: usize| {
        mean(curves(area, MOST_RESULTS).into_iter().flat_map(|curve| curve.precision))
    };
    let recall =
        |area: usize, most: usize| mean(curves(area, most).into_iter().map(|curve| curve.recall));
    let all = curves(0, MOST_RESULTS);
    let single = |criterion: usize| {
        all.get(criterion).and_then(|curve| mean(curve.precision.iter().copied()))
    };
    let figures = vec![
        ("AP", precision(0)),
        ("AP_c0", single(0)),
        ("AP_c3", single(3)),
        ("AP_s", precision(1)),
        ("AP_m", precision(2)),
        ("AP_l", precision(3)),
        ("AR_1", recall(0, 1)),
        ("AR_10", recall(0, 10)),
        ("AR_100", recall(0, 100)),
        ("AR_s", recall(1, 100)),
        ("AR_m", recall(2, 100)),
        ("AR_l", recall(3, 100)),
    ];
    A3dpScores { figures, precision: all.into_iter().map(|curve| curve.precision).collect() }
}

fn criteria(distance: A3dpDistance) -> Vec<Likeness> {
    let [loose, strict] = match distance {
        A3dpDistance::Absolute => [2.8, 0.1],
        A3dpDistance::Relative => [0.1, 0.01],
    };
    let shapes = linspace(0.5, 0.95, CRITERIA);
    let rotations = linspace(50.0, 5.0, CRITERIA);
    let translations = linspace(loose, strict, CRITERIA);
    (0..CRITERIA)
        .map(|i| Likeness {
            shape: shapes[i],
            translation: translations[i],
            rotation: rotations[i],
        })
        .collect()
}

/// An image whose results are in order and compared with all truths.
struct Prepared {
    truth_areas: Vec<f64>,
    /// Area and score by falling score.
    results: Vec<[f64; 2]>,
    /// By result, then truth.
    likeness: Vec<Vec<Likeness>>,
}

impl Prepared {
    fn new(image: &A3dpImage, similarity: &Similarity, distance: A3dpDistance) -> Self {
        let mut results: Vec<&A3dpCar> = image.results.iter().collect();
        results.sort_by(|a, b| b.score.total_cmp(&a.score));
        results.truncate(MOST_RESULTS);
        let compare = |result: &&A3dpCar| {
            let one = |truth: &A3dpCar| likeness(result, truth, similarity, distance);
            image.truths.iter().map(one).collect()
        };
        Self {
            truth_areas: image.truths.iter().map(|truth| truth.area).collect(),
            likeness: results.iter().map(compare).collect(),
            results: results.iter().map(|result| [result.area, result.score]).collect(),
        }
    }

    fn matched(&self, criterion: &Likeness, area: [f64; 2], how: A3dpMatching) -> RankedImage {
        let outside = |value: f64| value < area[0] || value > area[1];
        let truths: Vec<bool> = self.truth_areas.iter().map(|area| outside(*area)).collect();
        // Truths that count come first.
        let mut order: Vec<usize> = (0..truths.len()).collect();
        order.sort_by_key(|truth| truths[*truth]);
        let mut taken = vec![false; truths.len()];
        let mut demanded = *criterion;
        let mut results = Vec::with_capacity(self.results.len());
        for ([area, score], likeness) in self.results.iter().zip(&self.likeness) {
            if how == A3dpMatching::Fresh {
                demanded = *criterion;
            }
            let mut found: Option<usize> = None;
            for truth in order.iter().copied().filter(|truth| !taken[*truth]) {
                // A truth that counts is not given up for one that does not.
                if found.is_some_and(|found| !truths[found]) && truths[truth] {
                    break;
                }
                if likeness[truth].satisfies(&demanded) {
                    demanded = likeness[truth];
                    found = Some(truth);
                }
            }
            if let Some(truth) = found {
                taken[truth] = true;
            }
            let ignored = found.map_or(outside(*area), |truth| truths[truth]);
            results.push(Ranked { score: *score, matched: found.is_some(), ignored });
        }
        RankedImage { results, positives: truths.iter().filter(|ignored| !**ignored).count() }
    }
}

fn likeness(
    result: &A3dpCar,
    truth: &A3dpCar,
    similarity: &Similarity,
    distance: A3dpDistance,
) -> Likeness {
    let [from, to] = [result, truth].map(|car| Vector3::from(car.translation));
    let unit = match distance {
        A3dpDistance::Absolute => 1.0,
        A3dpDistance::Relative => to.norm(),
    };
    let [a, b] = [result, truth].map(|car| quaternion(car.rotation));
    let squared: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    Likeness {
        shape: similarity.of(result.model, truth.model),
        translation: (from - to).norm() / unit,
        rotation: (2.0 * (1.0 - squared / 2.0).abs().min(1.0).acos()).to_degrees(),
    }
}

/// Unit quaternion, real part first, of roll about x, then pitch about y, then yaw about z.
fn quaternion([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = [roll, pitch, yaw].map(|angle| (0.5 * angle).sin_cos());
    [
        cy * cr * cp + sy * sr * sp,
        cy * sr * cp - sy * cr * sp,
        cy * cr * sp + sy * sr * cp,
        sy * cr * cp - cy * sr * sp,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn car(x: f64, score: f64) -> A3dpCar {
        let translation = [x, 1.0, 10.0];
        A3dpCar { model: 0, rotation: [0.1, 0.2, 3.0], translation, area: 5000.0, score }
    }

    fn scores(image: A3dpImage, distance: A3dpDistance, how: A3dpMatching) -> A3dpScores {
        let similarity = Similarity::new(1, vec![1.0]).unwrap();
        score_a3dp(&[image], &similarity, distance, how)
    }

    #[test]
    fn a_perfect_result_has_full_precision_and_small_cars_that_are_not_there_have_none() {
        let image = A3dpImage { truths: vec![car(0.0, 0.0)], results: vec![car(0.0, 0.5)] };
        let scores = scores(image, A3dpDistance::Absolute, A3dpMatching::Released);
        assert!((scores.figures[0].1.unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(scores.figures[3], ("AP_s", None));
    }

    #[test]
    fn the_released_matching_demands_of_a_second_result_what_the_first_reached() {
        let image = A3dpImage {
            truths: vec![car(0.0, 0.0), car(20.0, 0.0)],
            results: vec![car(0.0, 0.9), car(20.05, 0.5)],
        };
        let recall = |how| scores(image.clone(), A3dpDistance::Absolute, how).figures[8].1.unwrap();
        assert!((recall(A3dpMatching::Released) - 0.5).abs() < 1e-12);
        assert!((recall(A3dpMatching::Fresh) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn relative_distance_forgives_more_far_away() {
        let far = |offset: f64, score: f64| A3dpCar {
            translation: [0.0, 0.0, 100.0 + offset],
            ..car(0.0, score)
        };
        let image = A3dpImage { truths: vec![far(0.0, 0.0)], results: vec![far(5.0, 0.5)] };
        let ap =
            |distance| scores(image.clone(), distance, A3dpMatching::Fresh).figures[1].1.unwrap();
        assert!(ap(A3dpDistance::Absolute) < 1e-12);
        assert!((ap(A3dpDistance::Relative) - 1.0).abs() < 1e-9);
    }
}
