//! Shapes pressed into the front: the grille between the lamps and the air intake below.
//!
//! Only the form changes, not the parts: both belong to the front apron.

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::half::{Vertex, Zone};
use super::seams::Painter;

/// How deep grille and intake lie, metres.
const DEPTH: f64 = 0.03;
/// Width of the sloped walls round them.
const WALL: f64 = 0.014;

/// Presses grille and intake into the front.
pub(super) fn press_grille(v: &ParametricVehicle, painter: &mut Painter) {
    if v.grille_width < 0.2 {
        return;
    }
    let half = 0.5 * v.grille_width;
    let sill = v.ground_clearance;
    let height = v.hood_front_height - v.front_bumper_height;
    let grille = [v.front_bumper_height + 0.15 * height, v.hood_front_height - 0.22 * height];
    let intake = [sill + 0.08, sill + 0.08 + 0.45 * (v.nose_height - sill - 0.08)];
    // The intake is wider than the grille, and wider still at its foot.
    for ([low, high], half, flare) in [(grille, half, -0.15), (intake, 1.2 * half, -0.5)] {
        if high - low < 4.0 * WALL {
            continue;
        }
        let bound = |inset: f64| {
            [
                Box::new(move |p: &Vertex| p.lateral - half - flare * (p.h - high) + inset)
                    as Box<dyn Fn(&Vertex) -> f64>,
                Box::new(move |p: &Vertex| low + inset - p.h),
                Box::new(move |p: &Vertex| p.h - high + inset),
            ]
        };
        let front = v.axles()[0] + 0.5 * v.wheel_diameter;
        let is_face = |zone: Zone, part: PartClass| {
            matches!(zone, Zone::Rim | Zone::Top) && part == PartClass::ApronFront
        };
        for inset in [0.0, WALL] {
            let [a, b, c] = bound(inset);
            painter.cut(is_face, &[&|p| front - p.z, &*a, &*b, &*c]);
        }
        let [a, b, c] = bound(WALL);
        painter.move_back(is_face, &[&*a, &*b, &*c], DEPTH);
    }
}
