//! The two curves of the side view that rings join.

use super::ParametricVehicle;
use super::path::{Edge, Knot, Path, Point};

/// The upper curve of the side view, from the nose over hood, windscreen, roof and trunk to the tail.
pub(super) fn upper_curve(v: &ParametricVehicle) -> Path {
    let nose = v.nose();
    let cowl = v.axles()[0] - v.cowl_setback;
    let header_height = v.height - v.header_drop;
    let header = cowl - (header_height - v.cowl_height) * v.windscreen_rake.to_radians().tan();
    let foot = v.rear_window_foot();
    let roof_end_height = v.height - v.roof_end_drop;
    let roof_end = foot + (roof_end_height - v.deck_height) * v.rear_window_rake.to_radians().tan();
    let peak = header + v.roof_peak * (roof_end - header);
    let hood_start = nose - v.hood_setback;
    let hood_middle = hood_start + 0.45 * (cowl - hood_start);
    let hood_middle_height =
        v.hood_front_height + 0.45 * (v.cowl_height - v.hood_front_height) + v.hood_curve;
    let [crown_f, along_f, across_f] = v.front_corner;
    let [crown_r, along_r, across_r] = v.rear_corner;
    let front = |inwards| Edge::new(inwards, crown_f, [along_f, across_f]);
    let rear = |inwards| Edge::new(inwards, crown_r, [along_r, across_r]);
    // Shallower than the bumper's, so that rings stay in order where the corner runs out along the hood.
    let hood_edge = Edge::new([-1.0, -0.3], 0.8 * crown_f, [0.75 * along_f, across_f]);
    let down = [0.0, -1.0];
    // Without a notch the rear window wraps round the corners like the panel below it.
    let notch = (v.deck_length / 0.3).min(1.0);
    let foot_edge = if v.has_bed() {
        // The rails of the load bed.
        Edge::new([0.0, -1.0], 0.004, [0.035, 0.035])
    } else {
        Edge::new([0.2, -1.0], 0.06, [0.06, 0.10]).lerp(&rear([1.0, -0.3]), 1.0 - notch)
    };
    let radius = v.roof_radius;
    let roof = |inwards, crown: f64, radii: [f64; 2]| {
        Edge::new(inwards, crown * v.roof_crown, radii.map(|share| share * radius))
    };
    let roof_end_edge =
        roof([0.1, -1.0], 1.0, [0.6, 1.0]).lerp(&roof([0.6, -1.0], 1.2, [0.8, 1.3]), 1.0 - notch);
    let knot = |z, h, round, edge| Knot { at: Point { z, h }, round, edge, arch: None };
    let mut path = Path(vec![
        knot(nose, v.nose_height, 0.0, front([-1.0, 0.0])),
        knot(nose - 0.02, v.front_bumper_height, 0.05, front([-1.0, 0.0])),
        knot(hood_start, v.hood_front_height, 0.07, hood_edge),
        knot(hood_middle, hood_middle_height, 0.5, Edge::new(down, 0.05, [0.07, 0.12])),
        knot(cowl, v.cowl_height, 0.06, Edge::new(down, 0.05, [0.04, 0.07])),
        knot(header, header_height, 0.22, roof(down, 1.0, [0.6, 0.9])),
        knot(peak, v.height, 0.6, roof(down, 1.0, [0.6, 1.1])),
        knot(roof_end, roof_end_height, 0.2, roof_end_edge),
        knot(foot, v.deck_height, 0.05, foot_edge),
        knot(v.lip_setback - nose, v.lip_height, 0.035, rear([1.0, -0.3])),
        knot(0.025 - nose, v.rear_bumper_height, 0.04, rear([1.0, 0.0])),
        knot(-nose, v.tail_height, 0.0, rear([1.0, 0.0])),
    ]);
    // Rounding lowers the roof; each step at least halves what is missing.
    for _ in 0..60 {
        path.0[6].at.h += v.height - path.at(6.0).h;
    }
    path
}

/// The lower curve, from the nose under the bumper, over the wheel arches and along the sills to the tail.
pub(super) fn lower_curve(v: &ParametricVehicle) -> Path {
    let nose = v.nose();
    let hub = 0.5 * v.wheel_diameter;
    let low = v.ground_clearance;
    let [crown_f, along_f, across_f] = v.front_corner;
    let [crown_r, along_r, across_r] = v.rear_corner;
    let front = |inwards| Edge::new(inwards, crown_f, [along_f, across_f]);
    let rear = |inwards| Edge::new(inwards, crown_r, [along_r, across_r]);
    // Shallower corners below, so that rings do not cross those at the wheel arches.
    let tucked = |inwards, [crown, along, across]: [f64; 3]| {
        Edge::new(inwards, 0.8 * crown, [0.8 * along, across])
    };
    let sill = Edge::new([0.0, 1.0], 0.0, [0.025, 0.025]);
    let knot = |z, h, round, edge| Knot { at: Point { z, h }, round, edge, arch: None };
    let reach = v.arch_radius();
    let arch = |z: f64| {
        let start = knot(z + reach, low, 0.0, sill);
        [Knot { arch: Some(hub + reach - low), ..start }, knot(z - reach, low, 0.0, sill)]
    };
    let mut path = vec![
        knot(nose, v.nose_height, 0.0, front([-1.0, 0.0])),
        knot(nose - 0.015, v.nose_height - 0.13, 0.05, front([-1.0, 0.0])),
        knot(nose - v.front_undercut, low + 0.03, 0.08, tucked([-1.0, 0.3], v.front_corner)),
    ];
    path.extend(v.axles().into_iter().flat_map(arch));
    path.push(knot(v.rear_undercut - nose, low + 0.08, 0.08, tucked([1.0, 0.3], v.rear_corner)));
    path.push(knot(0.02 - nose, v.tail_height - 0.13, 0.05, rear([1.0, 0.0])));
    path.push(knot(-nose, v.tail_height, 0.0, rear([1.0, 0.0])));
    Path(path)
}
