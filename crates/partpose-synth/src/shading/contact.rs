//! The dark under and around vehicles.
//!
//! A vehicle hides the sky from the road below it. Its underside and its body are taken for two level rectangles, of
//! which the road sees the share that the form factor between a surface element and a parallel rectangle gives (Siegel
//! and Howell: *Thermal Radiation Heat Transfer*, configuration C-11): exact for a box on stilts, and free of noise.

use nalgebra::{Matrix3, Vector3};

use crate::scene::SegmentClass;

use super::noise::floor;
use super::visible::Seen;

type V = Vector3<f32>;

/// Beyond this distance from a vehicle's outline its contact shade is not looked for, metres.
const REACH: f32 = 3.0;
/// Heights of underside and body as shares of the vehicle's.
const LEVELS: [f32; 2] = [0.15, 0.50];

/// A vehicle as rectangles over the road.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// Takes places relative to the camera, in axes of the world, to axes of the vehicle.
    axes: Matrix3<f32>,
    /// Middle of its footprint, relative to the camera.
    pub(super) origin: V,
    half: [f32; 2],
    height: f32,
    reach: f32,
}

/// Vehicles by where they stand.
#[derive(Clone, Debug, Default)]
pub(super) struct Blocks {
    blocks: Vec<Block>,
    /// Which of them reach into each cell of a grid around the camera; empty where there are none at all.
    cells: Vec<Vec<u16>>,
}

/// Side of a cell, metres, and cells from the camera to the border of the grid.
const CELL: f32 = 6.0;
const CELLS: i32 = 24;

impl Blocks {
    fn new(blocks: Vec<Block>) -> Self {
        let mut cells =
            vec![Vec::new(); if blocks.is_empty() { 0 } else { (4 * CELLS * CELLS) as usize }];
        for (i, block) in blocks.iter().enumerate() {
            let range = |at: f32| {
                let cell = |at: f32| (floor(at / CELL) + CELLS).clamp(0, 2 * CELLS - 1);
                cell(at - block.reach)..=cell(at + block.reach)
            };
            for z in range(block.origin.z) {
                for x in range(block.origin.x) {
                    cells[(z * 2 * CELLS + x) as usize].push(i as u16);
                }
            }
        }
        Self { blocks, cells }
    }

    /// The vehicles that may shade a place.
    fn near(&self, place: &V) -> impl Iterator<Item = &Block> {
        let cell = |at: f32| floor(at / CELL) + CELLS;
        let [x, z] = [cell(place.x), cell(place.z)];
        let is_in = (0..2 * CELLS).contains(&x) && (0..2 * CELLS).contains(&z);
        let list = if is_in { self.cells.get((z * 2 * CELLS + x) as usize) } else { None };
        list.into_iter().flatten().filter_map(|i| self.blocks.get(usize::from(*i)))
    }
}

/// The vehicles among what is seen.
pub(super) fn blocks(seen: &[Seen], world_from_camera: &Matrix3<f32>) -> Blocks {
    let is_vehicle =
        |class| matches!(class, SegmentClass::Car | SegmentClass::Van | SegmentClass::Truck);
    let block = |seen: &Seen| {
        if !is_vehicle(seen.object.class) {
            return None;
        }
        let vertices = seen.object.mesh.vertices.iter().map(|p| p.coords);
        let [low, high] = vertices.fold(None, |all: Option<[V; 2]>, p| {
            Some(all.map_or([p, p], |[low, high]| [low.inf(&p), high.sup(&p)]))
        })?;
        let scale = seen.object.scale.cast::<f32>();
        let size = (high - low).component_mul(&scale);
        let rotation = seen.object.world_from_object.rotation.to_rotation_matrix();
        let axes = rotation.matrix().cast::<f32>().transpose();
        // Mirrors stick out of the body by a tenth.
        let half = [0.45 * size.x, 0.48 * size.z];
        let center = world_from_camera * seen.center;
        let origin = V::new(center.x, seen.ground, center.z);
        let reach = half[0].hypot(half[1]) + REACH;
        Some(Block { axes, origin, half, height: size.y, reach })
    };
    Blocks::new(seen.iter().filter_map(block).collect())
}

/// Share of the sky that vehicles leave open above a place on the road.
pub(super) fn openness(blocks: &Blocks, place: &V) -> f32 {
    let mut open = 1.0;
    for block in blocks.near(place) {
        let offset = place - block.origin;
        if offset.x.abs() > block.reach || offset.z.abs() > block.reach {
            continue;
        }
        let p = block.axes * offset;
        let height = -p.y;
        if p.x.abs() > block.half[0] + REACH
            || p.z.abs() > block.half[1] + REACH
            || !(-0.5..0.6).contains(&height)
        {
            continue;
        }
        let mut hidden: f32 = 0.0;
        for (level, size, share) in [(LEVELS[0], 0.94, 1.0), (LEVELS[1], 1.0, 0.9)] {
            let above = (level * block.height - height).max(0.04);
            hidden = hidden.max(share * rectangle([p.x, p.z], block.half.map(|h| size * h), above));
        }
        let fade = ((0.6 - height) * 3.0).clamp(0.0, 1.0);
        open *= 1.0 - hidden.clamp(0.0, 0.985) * fade;
    }
    open
}

/// Share of the cosine-weighted hemisphere that a rectangle at a height covers.
fn rectangle([x, z]: [f32; 2], [half_x, half_z]: [f32; 2], height: f32) -> f32 {
    // Each with 1 over its distance from the edge's line.
    let sides = [-half_x - x, half_x - x, -half_z - z, half_z - z]
        .map(|side| (side, 1.0 / (side * side + height * height).sqrt()));
    let corner = |(a, over_a): (f32, f32), (b, over_b): (f32, f32)| {
        a * over_a * arc_tangent(b * over_a) + b * over_b * arc_tangent(a * over_b)
    };
    let [x0, x1, z0, z1] = sides;
    let sum = corner(x1, z1) - corner(x0, z1) - corner(x1, z0) + corner(x0, z0);
    sum * (0.5 / std::f32::consts::PI)
}

/// To 0.004 rad, several times faster than the exact one.
fn arc_tangent(x: f32) -> f32 {
    let is_near = x.abs() <= 1.0;
    let y = if is_near { x } else { 1.0 / x };
    let angle = y * (0.9724 - 0.1919 * y * y);
    if is_near { angle } else { std::f32::consts::FRAC_PI_2.copysign(x) - angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wide_rectangle_just_above_hides_all_and_a_far_one_nothing() {
        assert!(rectangle([0.0, 0.0], [50.0, 50.0], 0.1) > 0.98);
        assert!(rectangle([0.0, 0.0], [0.1, 0.1], 10.0) < 0.001);
        // Half of it from below its edge.
        assert!((rectangle([50.0, 0.0], [50.0, 50.0], 0.1) - 0.5).abs() < 0.02);
    }
}
