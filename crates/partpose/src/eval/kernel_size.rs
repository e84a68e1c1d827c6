//! How many cells a kernel needs, from the sizes of the vehicles.
//!
//! With nearest scaling every pixel takes the class of its cell, so a boundary between parts lies wrong by up to half a
//! cell. A cell is `side / m` pixels large, where `side` is that of the vehicle's box and m the paper's kernel size; for
//! cells of at most c pixels along both sides m must be at least `max(width, height) / c`. The paper calls for such a
//! lower bound from the distribution of the objects' sizes (§ V) and gives none; this is ours. Bilinear scaling places
//! boundaries between cells and needs fewer.

use serde::Serialize;

use crate::geometry::Rect;

/// Shares of the vehicles for which bounds are given.
const SHARES: [f64; 5] = [0.5, 0.75, 0.9, 0.95, 0.99];

/// The kernel that a share of the vehicles needs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct KernelBound {
    /// Share of the vehicles, 0 to 1, whose longer side is at most `side`.
    pub share: f64,
    /// Longer side of their boxes, pixels.
    pub side: f64,
    /// Least m with cells of at most 1, 2 and 4 pixels.
    pub cells: [u32; 3],
}

/// The bounds of some boxes, by rising share; empty without boxes.
pub fn kernel_bounds(boxes: &[Rect]) -> Vec<KernelBound> {
    let sides = longer_sides(boxes);
    if sides.is_empty() {
        return Vec::new();
    }
    let bound = |share: f64| {
        // The least side that is enough for the share.
        let rank = ((share * sides.len() as f64).ceil() as usize).clamp(1, sides.len());
        let side = sides[rank - 1];
        KernelBound { share, side, cells: [1.0, 2.0, 4.0].map(|cell| (side / cell).ceil() as u32) }
    };
    SHARES.into_iter().map(bound).collect()
}

/// The share of the boxes whose cells are at most `pixels` large with a kernel of `m` cells a side; NaN without boxes.
pub fn share_within(boxes: &[Rect], m: usize, pixels: f64) -> f64 {
    let sides = longer_sides(boxes);
    let within = sides.iter().filter(|side| **side <= m as f64 * pixels).count();
    within as f64 / sides.len() as f64
}

fn longer_sides(boxes: &[Rect]) -> Vec<f64> {
    let mut sides: Vec<f64> = boxes.iter().map(|b| b.width().max(b.height())).collect();
    sides.sort_by(f64::total_cmp);
    sides
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bound_is_the_longer_side_over_the_cell() {
        // Longer sides 10, 20, ... 100.
        let boxes: Vec<Rect> =
            (1..=10).map(|i| Rect::new(0.0, 0.0, 10.0 * f64::from(i), 5.0)).collect();
        let bounds = kernel_bounds(&boxes);
        let sides: Vec<f64> = bounds.iter().map(|bound| bound.side).collect();
        assert_eq!(sides, [50.0, 80.0, 90.0, 100.0, 100.0]);
        assert_eq!(bounds[2].cells, [90, 45, 23]);
        assert!((share_within(&boxes, 28, 2.0) - 0.5).abs() < 1e-12);
        assert!(kernel_bounds(&[]).is_empty());
    }
}
