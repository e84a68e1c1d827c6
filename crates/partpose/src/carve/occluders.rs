//! Trees and poles that the masks cut out of a vehicle bear label 0, like the background.
//!
//! Background deep inside the rendered silhouette of what is carved so far cannot be background: it becomes unknown,
//! together with the background that hangs together with it inside the silhouette.

use crate::geometry::Extent;
use crate::vehicle::Mesh;

use super::distance::EdgeDistance;
use super::view::{UNKNOWN, View};

/// Marks occluders in the view's labels and returns their share of the silhouette.
///
/// `depth` in pixels: what lies deeper inside the silhouette than this is an occluder; what hangs together with it is
/// followed for twice as many pixels.
pub(super) fn mark_occluders(view: &mut View, mesh: &Mesh, extent: &Extent, depth: f32) -> f64 {
    let size = view.size();
    let seen: Vec<bool> = view.render(mesh, extent).parts.iter().map(|part| *part != 0).collect();
    let silhouette = seen.iter().filter(|seen| **seen).count();
    let edge = EdgeDistance::of(&seen, size);
    let hidden = |n: usize, view: &View| view.labels[n] == 0 && edge.values[n] < 0.0;
    let mut front: Vec<usize> =
        (0..seen.len()).filter(|n| hidden(*n, view) && edge.values[*n] < -depth).collect();
    let mut marked = 0;
    for n in &front {
        view.labels[*n] = UNKNOWN;
        marked += 1;
    }
    for _ in 0..(2.0 * depth) as usize {
        let mut next = Vec::new();
        for n in front {
            let (x, y) = (n % size[0], n / size[0]);
            let mut visit = |m: usize| {
                if hidden(m, view) {
                    view.labels[m] = UNKNOWN;
                    marked += 1;
                    next.push(m);
                }
            };
            if x > 0 {
                visit(n - 1);
            }
            if x + 1 < size[0] {
                visit(n + 1);
            }
            if y > 0 {
                visit(n - size[0]);
            }
            if y + 1 < size[1] {
                visit(n + size[0]);
            }
        }
        front = next;
    }
    f64::from(marked) / (silhouette as f64).max(1.0)
}
