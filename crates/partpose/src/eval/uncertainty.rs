//! Whether the dense fit knows how good it is: its ellipsoids, its probabilities of models and modes, its confidence.
//!
//! The error of an estimate, a rotation vector and the cuboid's centre in camera axes (and the logarithms of the sides
//! where they were fitted), is whitened by the stated covariance. If that is true, the squared length follows a
//! chi-square distribution: a share L of the errors lies within the ellipsoid that is said to hold L, and the mean is
//! the number of dimensions (the normalised estimation error squared; Bar-Shalom, Li and Kirubarajan, "Estimation with
//! Applications to Tracking and Navigation", 2001, § 5.4). A probability is honest if events of probability p happen in
//! a share p of the cases.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Deserializer, Serialize};

use crate::geometry::{Cuboid, Vector3};
use crate::pose::PoseEstimate;

use super::Table;

/// 3D IoU above which a pose counts as good.
pub const GOOD_IOU: f64 = 0.5;

/// One estimate's statements about itself, and what was true.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sureness {
    /// Dimensions of the error: 6, or 9 with the size.
    pub dimensions: usize,
    /// The normalised squared error.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub squared_error: f64,
    /// The smallest level whose ellipsoid holds the truth, 0 to 1.
    pub level: f64,
    /// The error of the centre's depth over its stated standard deviation.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub depth: f64,
    /// The stated standard deviation of the centre's depth, metres.
    #[serde(deserialize_with = "finite_or_infinite")]
    pub depth_sd: f64,
    /// The stated probability of a good pose, and whether it is.
    pub confidence: f64,
    /// Whether the 3D IoU is above [`GOOD_IOU`].
    pub is_good: bool,
    /// The stated probability of the chosen model, and whether it is the true one.
    pub model_probability: f64,
    /// Whether the chosen model is the true one.
    pub model_is_right: bool,
    /// The stated probability of the second mode, and whether it is nearer the truth than the first.
    pub second: Option<(f64, bool)>,
}

/// JSON has no infinity: it is written as `null`.
fn finite_or_infinite<'de, D: Deserializer<'de>>(number: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(number)?.unwrap_or(f64::INFINITY))
}

/// What an estimate of the dense fit said of itself; `None` for other fits.
pub fn sureness(estimate: &PoseEstimate, truth: &Cuboid, model_is_right: bool) -> Option<Sureness> {
    let report = estimate.dense.as_ref()?;
    let own = estimate.cuboid();
    let turn = truth.camera_from_vehicle.rotation * own.camera_from_vehicle.rotation.inverse();
    let shift = truth.center() - own.center();
    let mut error: Vec<f64> = turn.scaled_axis().iter().chain(shift.iter()).copied().collect();
    let covariance = match &report.covariance_with_size {
        Some(with_size) => {
            let ratio: Vector3 = truth.extent.ratio(&own.extent);
            error.extend(ratio.iter().map(|value| value.ln()));
            DMatrix::from_column_slice(9, 9, with_size.as_slice())
        }
        None => DMatrix::from_column_slice(6, 6, report.covariance.as_slice()),
    };
    let depth_sd = covariance[(5, 5)].sqrt();
    let error = DVector::from_vec(error);
    let squared_error =
        covariance.cholesky().map_or(f64::INFINITY, |c| error.dot(&c.solve(&error)));
    let nearer = |other: &Cuboid| truth.iou(other) > truth.iou(&own);
    Some(Sureness {
        dimensions: error.len(),
        squared_error,
        level: chi_square_below(squared_error, error.len()),
        depth: error[5] / depth_sd,
        depth_sd,
        confidence: report.confidence,
        is_good: truth.iou(&own) > GOOD_IOU,
        model_probability: report
            .model_probabilities
            .get(estimate.model_index)
            .copied()
            .unwrap_or(0.0),
        model_is_right,
        second: report.second_mode.as_ref().map(|second| {
            let extent = second.extent;
            let other = Cuboid { camera_from_vehicle: second.camera_from_vehicle, extent };
            (second.probability, nearer(&other))
        }),
    })
}

/// The probability that a chi-square variable of so many degrees of freedom lies below `x`.
///
/// The regularised lower incomplete gamma function by its power series (Abramowitz and Stegun, 6.5.29).
pub fn chi_square_below(x: f64, degrees: usize) -> f64 {
    if !(x > 0.0) {
        return 0.0;
    }
    if x > 400.0 {
        return 1.0;
    }
    let (a, half) = (0.5 * degrees as f64, 0.5 * x);
    // ln gamma(a + 1) for half-integers: gamma(1/2) = sqrt(pi), gamma(t + 1) = t gamma(t).
    let mut log_gamma =
        if degrees.is_multiple_of(2) { 0.0 } else { 0.5 * std::f64::consts::PI.ln() };
    let mut t = if degrees.is_multiple_of(2) { 1.0 } else { 0.5 };
    while t < a + 0.75 {
        log_gamma += t.ln();
        t += 1.0;
    }
    let mut term = (a * half.ln() - half - log_gamma).exp();
    let mut sum = term;
    for k in 1..2000 {
        term *= half / (a + f64::from(k));
        sum += term;
        if term < 1e-16 * sum {
            break;
        }
    }
    sum.min(1.0)
}

/// A range of stated probabilities and what happened.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReliabilityBin {
    /// Mean stated probability.
    pub stated: f64,
    /// Share of the cases in which it came true.
    pub happened: f64,
    /// Cases.
    pub count: usize,
}

/// Stated probabilities against what happened, in `bins` equal ranges; empty ones are left out.
pub fn reliability(cases: &[(f64, bool)], bins: usize) -> Vec<ReliabilityBin> {
    let of_bin = |bin: usize| {
        let inside =
            cases.iter().filter(|(p, _)| ((p * bins as f64) as usize).min(bins - 1) == bin);
        let (mut stated, mut happened, mut count) = (0.0, 0usize, 0usize);
        for (probability, came_true) in inside {
            stated += probability;
            happened += usize::from(*came_true);
            count += 1;
        }
        (count > 0).then(|| ReliabilityBin {
            stated: stated / count as f64,
            happened: happened as f64 / count as f64,
            count,
        })
    };
    (0..bins).filter_map(of_bin).collect()
}

/// How a set of stated probabilities fared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProbabilityScores {
    /// Mean stated probability.
    pub stated: f64,
    /// Share that came true.
    pub happened: f64,
    /// Mean squared difference of the two, 0 the best (Brier 1950).
    pub brier: f64,
    /// Mean distance of stated and happened over ten ranges, weighted by their cases.
    pub calibration_error: f64,
}

fn probability_scores(cases: &[(f64, bool)]) -> ProbabilityScores {
    let n = cases.len() as f64;
    let hit = |came_true: bool| f64::from(u8::from(came_true));
    let bins = reliability(cases, 10);
    let off = bins.iter().map(|b| (b.stated - b.happened).abs() * b.count as f64);
    ProbabilityScores {
        stated: cases.iter().map(|(p, _)| p).sum::<f64>() / n,
        happened: cases.iter().map(|(_, t)| hit(*t)).sum::<f64>() / n,
        brier: cases.iter().map(|(p, t)| (p - hit(*t)).powi(2)).sum::<f64>() / n,
        calibration_error: off.sum::<f64>() / n,
    }
}

/// How honest a set of estimates is; NaN (`null` in JSON) where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UncertaintyScores {
    /// Estimates.
    pub count: usize,
    /// Normalised squared error over its dimensions: 1 if the covariance is true.
    pub mean_squared_error: f64,
    /// The same with the median, over the median of chi-square.
    pub median_squared_error: f64,
    /// Shares of the truths in the ellipsoids that are said to hold 50, 90, 95 and 99 %.
    pub coverage: [f64; 4],
    /// Share of the true depths within two stated standard deviations.
    pub depth_within_two: f64,
    /// Median stated standard deviation of the depth, metres.
    pub median_depth_sd: f64,
    /// Of good poses.
    pub confidence: ProbabilityScores,
    /// Of right models.
    pub model: ProbabilityScores,
    /// Of second modes that are nearer the truth.
    pub second: ProbabilityScores,
}

/// Levels of [`UncertaintyScores::coverage`].
pub const COVERAGE_LEVELS: [f64; 4] = [0.5, 0.9, 0.95, 0.99];

/// The pairs of stated probability and truth that [`reliability`] takes.
pub fn confidence_cases(all: &[Sureness]) -> Vec<(f64, bool)> {
    all.iter().map(|s| (s.confidence, s.is_good)).collect()
}

/// The same of models.
pub fn model_cases(all: &[Sureness]) -> Vec<(f64, bool)> {
    all.iter().map(|s| (s.model_probability, s.model_is_right)).collect()
}

/// The share of truths in the ellipsoid that is said to hold `level`.
pub fn coverage(all: &[Sureness], level: f64) -> f64 {
    all.iter().filter(|s| s.level <= level).count() as f64 / all.len() as f64
}

/// Scores of many estimates.
pub fn uncertainty_scores(all: &[Sureness]) -> UncertaintyScores {
    let n = all.len() as f64;
    let median = |value: &dyn Fn(&Sureness) -> f64| {
        let mut values: Vec<f64> = all.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        if values.is_empty() { f64::NAN } else { values[values.len() / 2] }
    };
    // The median of chi-square by Wilson and Hilferty: k (1 - 2 / (9 k))^3.
    let usual = |s: &Sureness| {
        let k = s.dimensions as f64;
        s.squared_error / (k * (1.0 - 2.0 / (9.0 * k)).powi(3))
    };
    let second: Vec<(f64, bool)> = all.iter().filter_map(|s| s.second).collect();
    UncertaintyScores {
        count: all.len(),
        mean_squared_error: all.iter().map(|s| s.squared_error / s.dimensions as f64).sum::<f64>()
            / n,
        median_squared_error: median(&usual),
        coverage: COVERAGE_LEVELS.map(|level| coverage(all, level)),
        depth_within_two: all.iter().filter(|s| s.depth.abs() <= 2.0).count() as f64 / n,
        median_depth_sd: median(&|s| s.depth_sd),
        confidence: probability_scores(&confidence_cases(all)),
        model: probability_scores(&model_cases(all)),
        second: probability_scores(&second),
    }
}

/// A row a name: what is stated against what is true.
pub fn uncertainty_table(title: &str, rows: &[(String, UncertaintyScores)]) -> Table {
    let columns = [
        "",
        "count",
        "error² / d",
        "median",
        "in 50 %",
        "in 90 %",
        "in 95 %",
        "in 99 %",
        "depth in 2 sd %",
        "depth sd m",
        "confidence %",
        "good %",
        "off %",
        "model said %",
        "model right %",
        "off %",
        "second said %",
        "second nearer %",
    ];
    let mut table = Table::new(title, &columns);
    for (name, s) in rows {
        let text = |value: f64, digits: usize| {
            if value.is_finite() { format!("{value:.digits$}") } else { String::new() }
        };
        let percent = |share: f64| text(100.0 * share, 1);
        let mut cells = vec![name.clone(), s.count.to_string()];
        cells.extend([s.mean_squared_error, s.median_squared_error].map(|value| text(value, 2)));
        cells.extend(s.coverage.map(percent));
        cells.push(percent(s.depth_within_two));
        cells.push(text(s.median_depth_sd, 2));
        let of = |p: &ProbabilityScores| [p.stated, p.happened, p.calibration_error].map(percent);
        cells.extend(of(&s.confidence));
        cells.extend(of(&s.model));
        cells.extend([s.second.stated, s.second.happened].map(percent));
        table.rows.push(cells);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_has_the_quantiles_of_the_tables() {
        let known = [(12.592, 6, 0.95), (16.919, 9, 0.95), (5.348, 6, 0.5), (3.841, 1, 0.95)];
        for (x, degrees, level) in known {
            assert!((chi_square_below(x, degrees) - level).abs() < 1e-4, "{x} {degrees}");
        }
        assert!(chi_square_below(-1.0, 6) <= 0.0 && chi_square_below(1e9, 6) >= 1.0);
        assert!(chi_square_below(f64::NAN, 6) <= 0.0);
    }

    #[test]
    fn honest_probabilities_lie_on_the_diagonal() {
        let cases: Vec<(f64, bool)> =
            (0..1000).map(|i| (0.25, i % 4 == 0)).chain((0..100).map(|i| (1.0, i > 0))).collect();
        let bins = reliability(&cases, 10);
        assert_eq!(bins.len(), 2);
        assert!((bins[0].happened - 0.25).abs() < 1e-9 && (bins[1].happened - 0.99).abs() < 1e-9);
        let scores = probability_scores(&cases);
        assert!((scores.calibration_error - 0.01 * 100.0 / 1100.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_has_no_scores() {
        let scores = uncertainty_scores(&[]);
        assert!(scores.count == 0 && scores.mean_squared_error.is_nan());
    }
}
