//! Wheels, mirrors, and the covers that keep one from looking through the wheel arches.

use std::f64::consts::{PI, TAU};

use crate::parts::PartClass;

use super::ParametricVehicle;
use super::curves::upper_curve;
use super::half::{Half, Vertex};
use super::loft::half_width;
use super::path::Point;

/// Faces round a tyre; a multiple of the spokes' number makes them alike.
const WHEEL_STEPS: usize = 30;
const SPOKES: f64 = 5.0;
/// Steps round a mirror and across it.
const MIRROR_STEPS: [usize; 2] = [12, 6];

/// A closed tyre with rim and spokes on each axle, standing on the ground.
pub(super) fn add_wheels(v: &ParametricVehicle, half: &mut Half) {
    let [radius, width] = [0.5 * v.wheel_diameter, v.tyre_width];
    // Lateral position from the wheel's middle, outside first, and radius, as shares of tyre width and radius.
    let profile = [
        [0.40, 0.0],
        [0.38, 0.13],
        [0.27, 0.24],
        [0.27, v.rim - 0.06],
        [0.42, v.rim],
        [0.46, v.rim + 0.06],
        [0.50, 0.5 * (v.rim + 0.06) + 0.49],
        [0.44, 0.96],
        [0.32, 1.0],
        [-0.32, 1.0],
        [-0.46, 0.94],
        [-0.42, 0.62],
        [-0.30, 0.0],
    ];
    let parts = [PartClass::WheelFrontLeft, PartClass::WheelRearLeft];
    for (axle, part) in v.axles().into_iter().zip(parts) {
        let ring = |[across, share]: [f64; 2]| {
            let point = |step: usize| {
                // Begins at the bottom, so that the wheel touches the ground.
                let (sin, cos) = (TAU * step as f64 / WHEEL_STEPS as f64).sin_cos();
                let is_dish = (0.2..v.rim - 0.05).contains(&share);
                let spoke = if is_dish {
                    let wave = (SPOKES * TAU * step as f64 / WHEEL_STEPS as f64).cos();
                    0.5 * (1.0 + wave) * 0.11
                } else {
                    0.0
                };
                Vertex {
                    lateral: 0.5 * v.track + width * (across + spoke),
                    h: radius - radius * share * cos,
                    z: axle - radius * share * sin,
                    t: 0.0,
                }
            };
            (0..WHEEL_STEPS).map(point).collect::<Vec<_>>()
        };
        // From the inside out, so that faces look outwards.
        let rows: Vec<_> = profile.into_iter().rev().map(ring).collect();
        half.push_grid(&rows, true, part);
    }
}

/// A box between the wheels of each axle, inside the tunnel that the arches make.
pub(super) fn add_axle_covers(v: &ParametricVehicle, half: &mut Half) {
    let reach = v.arch_radius() + 0.02;
    let [low, high] = [v.ground_clearance + 0.01, 0.5 * v.wheel_diameter + reach];
    let lateral = 0.5 * v.track - 0.5 * v.tyre_width - 0.08;
    for axle in v.axles() {
        let ring = |lateral: f64, size: f64| {
            let middle = 0.5 * (low + high);
            let corners = [[1.0, low], [1.0, high], [-1.0, high], [-1.0, low]];
            let point = |[side, h]: [f64; 2]| Vertex {
                lateral,
                h: middle + size * (h - middle),
                z: axle + size * side * reach,
                t: 0.0,
            };
            corners.map(point).to_vec()
        };
        half.push_grid(
            &[ring(lateral, 0.0), ring(lateral, 1.0), ring(0.0, 1.0)],
            true,
            PartClass::SideLeft,
        );
    }
}

/// The number plates: front, and on the tailgate or the rear bumper.
pub(super) fn add_plates(v: &ParametricVehicle, half: &mut Half) {
    let top = upper_curve(v);
    let [plate_width, plate_height, thickness] = [0.26, 0.055, 0.025];
    // The curve's point at a height: from the nose backwards, or from the tail forwards.
    let at = |from: f64, to: f64, h: f64| {
        let steps = 60;
        let points =
            (0..=steps).map(|i| top.at(from + (to - from) * f64::from(i) / f64::from(steps)));
        points.min_by(|a, b| (a.h - h).abs().total_cmp(&(b.h - h).abs())).map_or(0.0, |p| p.z)
    };
    let front = 0.5 * (v.nose_height + v.front_bumper_height) - 0.02;
    let on_lid = v.plate_height > v.rear_bumper_height;
    let rear = if on_lid { PartClass::Trunk } else { PartClass::ApronRear };
    for (h, [from, to], sign, part) in [
        (front, [0.0, 2.0], 1.0, PartClass::ApronFront),
        (v.plate_height, [top.last(), 8.2], -1.0, rear),
    ] {
        let h = h.max(v.ground_clearance + 0.2);
        let [low, high] = [h - plate_height, h + plate_height].map(|h| [at(from, to, h), h]);
        let ring = |lateral: f64, size: f64| {
            let corner = |[z, h]: [f64; 2], out: f64| Vertex {
                lateral,
                h: h + (1.0 - size) * (0.5 * (low[1] + high[1]) - h),
                z: z + size * sign * out * thickness
                    + (1.0 - size) * (0.5 * (low[0] + high[0]) - z),
                t: 0.0,
            };
            let [a, b, c, d] =
                [corner(low, 0.5), corner(high, 0.5), corner(high, -1.6), corner(low, -1.6)];
            if sign > 0.0 { vec![a, b, c, d] } else { vec![d, c, b, a] }
        };
        half.push_grid(
            &[ring(plate_width, 0.0), ring(plate_width, 1.0), ring(0.0, 1.0)],
            true,
            part,
        );
    }
}

/// A rounded housing beside the front of the side window, on a foot.
pub(super) fn add_mirror(v: &ParametricVehicle, half: &mut Half) {
    let z = v.axles()[0] - v.door_start - 0.17;
    let belt = v.belt(z);
    let outer = 0.5 * v.width + v.mirror_reach;
    let body = half_width(v, Point { z, h: belt });
    let height = 0.5 * v.mirror_height;
    let h = belt + 0.01 + height;
    // Housing, then foot: half its size across, up and along; its middle; how far the outer end lies back.
    let across = (0.5 * (outer - body - 0.035)).clamp(0.06, 0.12);
    push_pillow(half, [across, height, 0.055], [outer - across, h, z], 0.03);
    let reach = 0.5 * (outer - across - body) + 0.03;
    push_pillow(half, [reach, 0.022, 0.035], [body - 0.03 + reach, belt + 0.02, z + 0.01], 0.0);
}

/// A superellipsoid: the powers square it off.
fn push_pillow(half: &mut Half, radii: [f64; 3], center: [f64; 3], sweep: f64) {
    let [round, across] = MIRROR_STEPS;
    let power = |value: f64, exponent: f64| value.signum() * value.abs().powf(exponent);
    let row = |i: usize| {
        let (sin, cos) = (PI * i as f64 / across as f64).sin_cos();
        // Exactly a point at the ends, so that its vertices can be merged.
        let sin = if i == 0 || i == across { 0.0 } else { sin };
        let point = |j: usize| {
            let (s, c) = (TAU * j as f64 / round as f64).sin_cos();
            let size = power(sin, 0.6);
            Vertex {
                lateral: center[0] + radii[0] * power(cos, 0.8),
                h: center[1] + radii[1] * size * power(c, 0.7),
                z: center[2] - radii[2] * size * power(s, 0.7) - sweep * cos,
                t: 0.0,
            }
        };
        (0..round).map(point).collect::<Vec<_>>()
    };
    let rows: Vec<_> = (0..=across).map(row).collect();
    half.push_grid(&rows, true, PartClass::MirrorLeft);
}
