//! Where along the curves the rings stand.

use super::ParametricVehicle;
use super::loft::{bed_rings, knots};
use super::path::Path;

/// Longest distance between rings along either curve, metres.
const RING_DISTANCE: f64 = 0.1;

/// The rings, as parameters of the upper and the lower curve.
///
/// Rings are upright between the outer ends of the wheel arches and fan out from there to nose and tail.
pub(super) fn stations(v: &ParametricVehicle, top: &Path, bottom: &Path) -> Vec<[f64; 2]> {
    let (arches_begin, arches_end) = (bottom.at(3.0).z, bottom.at(6.0).z);
    let upright = |z: f64| [top.parameter_at(z), bottom.parameter_at(z)];
    let mut anchors = vec![[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]];
    anchors.extend((3..=6).map(|b| [top.parameter_at(bottom.at(f64::from(b)).z), f64::from(b)]));
    let lip = top.at(knots::LIP).z;
    for t in 3..9 {
        let (t, z) = (f64::from(t), top.at(f64::from(t)).z);
        if z > arches_begin {
            let share = (t - 2.0) / (top.parameter_at(arches_begin) - 2.0);
            anchors.push([t, 2.0 + share]);
        } else if z > arches_end {
            anchors.push([t, upright(z)[1]]);
        } else {
            anchors.push([t, 6.0 + (arches_end - z) / (arches_end - lip)]);
        }
    }
    anchors.extend([[9.0, 7.0], [10.0, 8.0], [11.0, 9.0]]);
    anchors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // Anchors that nearly coincide would make slivers; those at knots of the upper curve stay.
    let is_knot = |t: f64| (t - t.round()).abs() < 1e-9;
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for anchor in anchors {
        let near = kept.last().filter(|last| {
            top.at(last[0]).distance(top.at(anchor[0])) < 0.02 && anchor[0] - last[0] < 0.5
        });
        match near.map(|last| is_knot(last[0])) {
            Some(true) if !is_knot(anchor[0]) => {}
            Some(false) => *kept.last_mut().expect("it has a last one") = anchor,
            _ => kept.push(anchor),
        }
    }
    for t in bed_rings(v).into_iter().flatten() {
        let after = kept.partition_point(|anchor| anchor[0] < t).clamp(1, kept.len() - 1);
        let [from, to] = [kept[after - 1], kept[after]];
        let share = (t - from[0]) / (to[0] - from[0]);
        kept.insert(after, [t, from[1] + share * (to[1] - from[1])]);
    }
    let mut rings = vec![kept[0]];
    for pair in kept.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        let length = |path: &Path, k: usize| {
            let at = |share: f64| path.at(from[k] + share * (to[k] - from[k]));
            (0..8).map(|i| at(f64::from(i) / 8.0).distance(at(f64::from(i + 1) / 8.0))).sum::<f64>()
        };
        let distance = if from[0] < 2.0 || to[0] > 9.0 { 0.6 } else { 1.0 } * RING_DISTANCE;
        let steps = (length(top, 0).max(length(bottom, 1)) / distance).ceil().max(1.0);
        for step in 1..=steps as usize {
            let share = step as f64 / steps;
            rings.push([0, 1].map(|k| from[k] + share * (to[k] - from[k])));
        }
    }
    rings
}
