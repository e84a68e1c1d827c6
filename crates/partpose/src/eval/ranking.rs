//! Average precision over ranked results as COCO has it, at 101 points of recall.
//!
//! Lin et al.: *Microsoft COCO: Common Objects in Context*, ECCV 2014; the arithmetic is that of `pycocotools`, down to
//! the order of equals, so that figures agree in every digit. `ApolloCar3D` took it over.

/// Points of recall, 0 to 1 in hundredths.
pub const RECALL_POINTS: usize = 101;

/// A result of one image after matching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ranked {
    /// The more certain the higher.
    pub score: f64,
    /// Whether it found a truth.
    pub matched: bool,
    /// Whether it counts neither for nor against.
    pub ignored: bool,
}

/// The results of one image, by falling score, and how many truths count.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RankedImage {
    /// By falling score.
    pub results: Vec<Ranked>,
    /// Truths that are not ignored.
    pub positives: usize,
}

/// Precision over recall.
#[derive(Clone, Debug, PartialEq)]
pub struct RankedCurve {
    /// Precision at recall i / 100, never rising; 0 beyond the recall that is reached.
    pub precision: Vec<f64>,
    /// The recall that is reached.
    pub recall: f64,
}

/// The curve over all images with up to `most` results each; `None` if no truth counts.
pub fn ranked_curve(images: &[RankedImage], most: usize) -> Option<RankedCurve> {
    let positives: usize = images.iter().map(|image| image.positives).sum();
    if positives == 0 {
        return None;
    }
    let results = images.iter().flat_map(|image| image.results.iter().take(most));
    let mut results: Vec<Ranked> = results.copied().collect();
    // Stable: equals stay in the order of images.
    results.sort_by(|a, b| b.score.total_cmp(&a.score));
    let (mut right, mut wrong) = (0.0, 0.0);
    let mut points: Vec<[f64; 2]> = Vec::with_capacity(results.len());
    for result in &results {
        if !result.ignored {
            *(if result.matched { &mut right } else { &mut wrong }) += 1.0;
        }
        points.push([right / positives as f64, right / (wrong + right + f64::EPSILON)]);
    }
    for i in (1..points.len()).rev() {
        points[i - 1][1] = points[i - 1][1].max(points[i][1]);
    }
    let precision = (0..RECALL_POINTS).map(|i| {
        let wanted = if i + 1 == RECALL_POINTS { 1.0 } else { i as f64 * 0.01 };
        let at = points.partition_point(|[recall, _]| *recall < wanted);
        points.get(at).map_or(0.0, |[_, precision]| *precision)
    });
    let precision = precision.collect();
    Some(RankedCurve { precision, recall: points.last().map_or(0.0, |[recall, _]| *recall) })
}

/// The mean of what is there; `None` of nothing.
pub(super) fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.into_iter().collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// `count` values from `start` to `end`, rounded as `numpy.linspace` rounds them.
pub(super) fn linspace(start: f64, end: f64, count: usize) -> Vec<f64> {
    let step = (end - start) / (count - 1) as f64;
    let at = |i: usize| if i + 1 == count { end } else { i as f64 * step + start };
    (0..count).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(results: &[(f64, bool)], positives: usize) -> RankedImage {
        let ranked = |(score, matched): &(f64, bool)| Ranked {
            score: *score,
            matched: *matched,
            ignored: false,
        };
        RankedImage { results: results.iter().map(ranked).collect(), positives }
    }

    #[test]
    fn precision_falls_where_recall_ends() {
        let curve = ranked_curve(&[image(&[(0.9, true), (0.8, false)], 2)], 100).unwrap();
        assert!((curve.recall - 0.5).abs() < 1e-12);
        assert!((curve.precision[50] - 1.0).abs() < 1e-9 && curve.precision[51] == 0.0);
    }

    #[test]
    fn results_past_the_most_do_not_count_and_without_truths_there_is_no_curve() {
        let images = [image(&[(0.9, false), (0.8, true)], 1)];
        assert!(ranked_curve(&images, 1).unwrap().recall.abs() < 1e-12);
        assert_eq!(ranked_curve(&[image(&[(0.9, false)], 0)], 1), None);
    }
}
