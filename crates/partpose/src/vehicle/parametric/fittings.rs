//! Wheels, mirrors, and the covers that keep one from looking through the wheel arches.

use std::f64::consts::{PI, TAU};

use crate::parts::PartClass;

use super::ParametricVehicle;
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
        [0.27, 0.58],
        [0.42, 0.64],
        [0.46, 0.70],
        [0.50, 0.84],
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
                let is_dish = (0.2..0.6).contains(&share);
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

/// A rounded box at the foot of the A-pillar.
pub(super) fn add_mirror(v: &ParametricVehicle, half: &mut Half) {
    let z = v.axles()[0] - v.door_start - 0.20;
    let h = v.belt(z) + 0.055;
    let body = half_width(v, Point { z, h });
    let radii = [0.125, 0.075, 0.065];
    let center = [body + 0.085, h, z];
    let [round, across] = MIRROR_STEPS;
    // A superellipsoid: the power squares it off.
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
                // The outer end lies further back.
                z: center[2] - radii[2] * size * power(s, 0.7) - 0.03 * cos,
                t: 0.0,
            }
        };
        (0..round).map(point).collect::<Vec<_>>()
    };
    let rows: Vec<_> = (0..=across).map(row).collect();
    half.push_grid(&rows, true, PartClass::MirrorLeft);
}
