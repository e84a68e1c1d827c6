//! Which points of two side views correspond: hood to hood, windscreen to windscreen.
//!
//! The outlines over both vehicles at their middle are walked from front to rear, in step where position and slope
//! agree; a stretch that has no counterpart, such as the deck of a sedan beside a hatchback, is skipped at a cost a step.
//! Needleman and Wunsch: *A general method applicable to the search for similarities in the amino acid sequence of two
//! proteins*, JMB 1970. Order is what nearest points cannot keep: a sedan's rear window would find the roof of a
//! hatchback, whose own window stands further back.

use crate::geometry::{Point3, Vector3};

use super::lattice::Pull;
use super::shape::Spot;

/// Width of the bins in which the highest point is taken, metres.
const BIN: f64 = 0.05;
/// Distance of the points that are matched, along the outline, metres.
const STEP: f64 = 0.03;
/// Half the stretch over which the slope is taken, in steps.
const SLOPE: usize = 3;
/// Difference of position that costs as much as [`ANGLE`], metres.
const PLACE: f64 = 0.8;
/// Difference of slope, radians.
const ANGLE: f64 = 0.35;
/// Cost of a step that has no counterpart.
const SKIP: f64 = 0.5;
/// Distances from the plane of symmetry, in half widths, at which the match pulls.
const COLUMNS: [f64; 3] = [0.1, 0.4, 0.7];
/// The outline is taken this near the plane of symmetry, in half widths.
const MIDDLE: f64 = 0.35;

/// A point of an outline: z and height above, metres, and the direction in which it runs to the rear.
#[derive(Clone, Copy, Debug)]
struct Step {
    z: f64,
    y: f64,
    angle: f64,
}

/// Pulls from the outline of the target to that of the source, both in the source's coordinates.
pub(super) fn pulls(target: &[Spot], source: &[Spot], half_width: f64) -> Vec<Pull> {
    let [a, b] = [outline(target, half_width), outline(source, half_width)];
    if a.len() < 10 || b.len() < 10 {
        return Vec::new();
    }
    let mut pulls = Vec::new();
    for (from, to) in matches(&a, &b) {
        for column in COLUMNS {
            pulls.push(Pull {
                point: Point3::new(column * half_width, from.y, from.z),
                wanted: Vector3::new(0.0, to[1] - from.y, to[0] - from.z),
                normal: Vector3::zeros(),
                across: 1.0,
                weight: 1.0,
            });
        }
    }
    pulls
}

/// The upper outline from front to rear, at even steps.
fn outline(spots: &[Spot], half_width: f64) -> Vec<Step> {
    let middle: Vec<&Spot> = spots.iter().filter(|s| s.point.x < MIDDLE * half_width).collect();
    let front = middle.iter().map(|spot| spot.point.z).fold(f64::MIN, f64::max);
    let rear = middle.iter().map(|spot| spot.point.z).fold(f64::MAX, f64::min);
    let count = ((front - rear) / BIN).ceil().clamp(0.0, 1e4) as usize;
    // y points down: the highest point has the smallest.
    let mut highest = vec![None::<[f64; 2]>; count];
    for spot in &middle {
        let bin = (((front - spot.point.z) / BIN) as usize).min(count.saturating_sub(1));
        let best = &mut highest[bin];
        if best.is_none_or(|[_, y]| spot.point.y < y) {
            *best = Some([spot.point.z, spot.point.y]);
        }
    }
    let corners: Vec<[f64; 2]> = highest.into_iter().flatten().collect();
    let corners: Vec<[f64; 2]> = (0..corners.len())
        .map(|i| {
            let [a, c] = [i.saturating_sub(1), (i + 1).min(corners.len() - 1)];
            // The middles of triangles lie high or low by chance.
            [corners[i][0], 0.25 * corners[a][1] + 0.5 * corners[i][1] + 0.25 * corners[c][1]]
        })
        .collect();
    let points = resampled(&corners);
    let at = |i: usize| points[i.min(points.len() - 1)];
    (0..points.len())
        .map(|i| {
            let ([z0, y0], [z1, y1]) = (at(i.saturating_sub(SLOPE)), at(i + SLOPE));
            Step { z: points[i][0], y: points[i][1], angle: (y1 - y0).atan2(z0 - z1) }
        })
        .collect()
}

fn resampled(corners: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    let mut left = 0.0;
    for pair in corners.windows(2) {
        let ([z0, y0], [z1, y1]) = (pair[0], pair[1]);
        let length = (z1 - z0).hypot(y1 - y0);
        while left < length {
            let share = left / length;
            points.push([z0 + share * (z1 - z0), y0 + share * (y1 - y0)]);
            left += STEP;
        }
        left -= length;
    }
    points
}

/// The steps of `a` with the places on `b` that they correspond to; some of both may be left over.
#[expect(clippy::float_cmp, reason = "the same sums in the same order are equal")]
fn matches(a: &[Step], b: &[Step]) -> Vec<(Step, [f64; 2])> {
    let cost = |i: usize, j: usize| {
        let (p, q) = (&a[i], &b[j]);
        let place = ((p.z - q.z).powi(2) + (p.y - q.y).powi(2)) / (PLACE * PLACE);
        place + ((p.angle - q.angle) / ANGLE).powi(2)
    };
    let (n, m) = (a.len(), b.len());
    let mut total = vec![f64::INFINITY; (n + 1) * (m + 1)];
    let at = |i: usize, j: usize| i * (m + 1) + j;
    total[0] = 0.0;
    for i in 0..=n {
        for j in 0..=m {
            if i > 0 && j > 0 {
                total[at(i, j)] = total[at(i - 1, j - 1)] + cost(i - 1, j - 1);
            }
            let before = [(i > 0).then(|| at(i - 1, j)), (j > 0).then(|| at(i, j - 1))];
            for before in before.into_iter().flatten() {
                total[at(i, j)] = total[at(i, j)].min(total[before] + SKIP);
            }
        }
    }
    let mut found = Vec::new();
    let (mut i, mut j) = (n, m);
    while i > 0 && j > 0 {
        // The same sums in the same order: equality is exact.
        if total[at(i, j)] == total[at(i - 1, j - 1)] + cost(i - 1, j - 1) {
            (i, j) = (i - 1, j - 1);
            found.push((a[i], [b[j].z, b[j].y]));
        } else if total[at(i, j)] == total[at(i - 1, j)] + SKIP {
            i -= 1;
        } else {
            j -= 1;
        }
    }
    found.reverse();
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Hood, windscreen, roof and rear window, with the windscreen's foot at a place of choice.
    fn profile(foot: f64) -> Vec<Step> {
        let corners = [[2.0, -0.7], [foot, -1.0], [foot - 0.8, -1.5], [-1.5, -1.5], [-2.0, -0.8]];
        let points = resampled(&corners);
        let angle = |i: usize| {
            let [a, b] = [points[i.max(1) - 1], points[i.max(1)]];
            (b[1] - a[1]).atan2(a[0] - b[0])
        };
        (0..points.len())
            .map(|i| Step { z: points[i][0], y: points[i][1], angle: angle(i) })
            .collect()
    }

    #[test]
    fn a_windscreen_finds_the_windscreen() {
        let (a, b) = (profile(0.9), profile(0.6));
        for (step, [z, y]) in matches(&a, &b) {
            let is_screen = step.y < -1.05 && step.y > -1.45 && step.z > 0.0;
            if is_screen {
                assert!((z - (step.z - 0.3)).abs() < 0.06 && (y - step.y).abs() < 0.04, "{step:?}");
            }
        }
    }
}
