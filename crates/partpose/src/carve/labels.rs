//! The part of every face: a vote of the views that see it, then a little smoothing.
//!
//! A view's vote counts with the square of its resolution and with how squarely it faces the surface. Votes of the left
//! half come over the mirror with left and right exchanged. Faces that no view sees take the label of the nearest that
//! one does. Boundaries are smoothed by iterated conditional modes (Besag: *On the Statistical Analysis of Dirty
//! Pictures*, JRSS B 1986) on shares of votes plus shares of the border.

use rayon::prelude::*;

use crate::geometry::Extent;
use crate::parts::{PartClass, PartGroup};
use crate::vehicle::half::{HalfMesh, edges};

use super::distance::EdgeDistance;
use super::hull::part_of;
use super::view::{AMBIGUOUS, View};

/// Views whose votes are held at once.
const BATCH: usize = 16;
/// Metres by which a face may lie behind the drawn depth and still count as seen.
const DEPTH_TOLERANCE: f32 = 0.04;
/// Pixels from the outline within which a label may be that of what lies behind.
const OUTLINE_MARGIN: f32 = 0.75;
/// The same where a farther vehicle is known to stand behind.
const AMBIGUOUS_MARGIN: f32 = 2.5;

/// Sum of votes below which a face counts as unseen: half a view of a box about 60 pixels high.
const LEAST_VOTES: f32 = 0.5;
/// Faces over which small parts spread to what was not seen.
const NEAR: usize = 2;

/// Votes for the 29 parts, a face of the half each.
pub(super) type Votes = Vec<[f32; PartClass::COUNT + 1]>;

/// Counts the votes of all views.
pub(super) fn votes(half: &HalfMesh, views: &[&View], extent: &Extent) -> Votes {
    let mesh = half.mirrored(&[]);
    let mut sums: Votes = vec![[0.0; PartClass::COUNT + 1]; half.faces.len()];
    for batch in views.chunks(BATCH) {
        let ballots: Vec<Vec<(u32, u8, f32)>> =
            batch.par_iter().map(|view| ballot(half, &mesh, view, extent)).collect();
        for (face, label, weight) in ballots.into_iter().flatten() {
            sums[face as usize][usize::from(label)] += weight;
        }
    }
    sums
}

fn ballot(
    half: &HalfMesh,
    mesh: &crate::vehicle::Mesh,
    view: &View,
    extent: &Extent,
) -> Vec<(u32, u8, f32)> {
    let size = view.size();
    let image = view.render(mesh, extent);
    let seen: Vec<bool> = image.parts.iter().map(|part| *part != 0).collect();
    let outline = EdgeDistance::of(&seen, size);
    let rows = view.projection(extent);
    let scale = view.extent.ratio(extent);
    let eye = view.camera_from_vehicle.inverse_transform_point(&crate::geometry::Point3::origin());
    let weight = (view.resolution() / 40.0).powi(2) as f32;
    let count = half.faces.len();
    let mut ballots = Vec::new();
    for (n, face) in mesh.faces.iter().enumerate() {
        let [a, b, c] = face.map(|v| mesh.vertices[v as usize].coords.component_mul(&scale));
        let normal = (b - a).cross(&(c - a));
        let center = (a + b + c) / 3.0;
        let sight = eye.coords - center;
        let cosine = normal.dot(&sight) / (normal.norm() * sight.norm()).max(1e-12);
        if cosine < 0.15 {
            continue;
        }
        let p = center.component_div(&scale).cast::<f32>();
        let at = |r: [f32; 4]| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3];
        let z = at(rows[2]);
        let (u, v) = (at(rows[0]) / z, at(rows[1]) / z);
        let (x, y) = (u.round(), v.round());
        if !(x >= 0.0 && y >= 0.0 && (x as usize) < size[0] && (y as usize) < size[1]) {
            continue;
        }
        let pixel = y as usize * size[0] + x as usize;
        if z > image.depths[pixel] + DEPTH_TOLERANCE {
            continue;
        }
        let label = view.labels[pixel];
        let part = part_of(label);
        let margin = if label & AMBIGUOUS == 0 { OUTLINE_MARGIN } else { AMBIGUOUS_MARGIN };
        if part == 0 || outline.values[pixel] > -margin {
            continue;
        }
        let Some(class) = PartClass::from_id(part) else { continue };
        let class = if n < count { class } else { class.opposite() };
        if !is_left(class) {
            let weight = weight * (cosine * cosine) as f32;
            ballots.push(((n % count) as u32, class.id(), weight));
        }
    }
    ballots
}

/// Whether a part exists on the left only.
fn is_left(class: PartClass) -> bool {
    class.opposite() != class && class.name().ends_with('L')
}

/// Labels from votes: the most voted, spread to what was not seen, smoothed.
pub(super) fn labels(half: &HalfMesh, votes: &Votes, rounds: usize, smoothness: f32) -> Vec<u8> {
    let adjacency = adjacency(half);
    let totals: Vec<f32> = votes.iter().map(|v| v.iter().sum()).collect();
    let enough = |total: f32| total >= LEAST_VOTES;
    let sure = votes.iter().zip(&totals).map(|(v, total)| if enough(*total) { best(v) } else { 0 });
    let mut labels: Vec<u8> = sure.collect();
    spread(&mut labels, &adjacency);
    for _ in 0..rounds {
        let last = labels.clone();
        let mut changed = false;
        for n in 0..labels.len() {
            let mut score = [0.0f32; PartClass::COUNT + 1];
            if enough(totals[n]) {
                score.iter_mut().zip(&votes[n]).for_each(|(s, v)| *s = v / totals[n]);
            }
            let border: f32 = adjacency[n].iter().map(|a| a.1).sum();
            for (other, length) in &adjacency[n] {
                // In place, so that two faces cannot exchange labels for ever.
                score[usize::from(labels[*other as usize])] +=
                    smoothness * length / border.max(1e-9);
            }
            labels[n] = best(&score);
            changed |= labels[n] != last[n];
        }
        if !changed {
            break;
        }
    }
    labels
}

/// The label with the highest score, 0 where all are 0.
fn best(scores: &[f32; PartClass::COUNT + 1]) -> u8 {
    let mut best = 0;
    for n in 1..scores.len() {
        if scores[n] > scores[best] {
            best = n;
        }
    }
    best as u8
}

/// Neighbours of every face with the length of the shared edge.
pub(super) fn adjacency(half: &HalfMesh) -> Vec<Vec<(u32, f32)>> {
    let mut near = vec![Vec::new(); half.faces.len()];
    for (edge, faces) in edges(&half.faces) {
        let [a, b] = edge.map(|n| half.vertices[n as usize]);
        let length = (a - b).norm() as f32;
        if let [f, g] = faces[..] {
            near[f as usize].push((g, length));
            near[g as usize].push((f, length));
        }
    }
    near
}

/// Gives faces without a label that of the nearest face with one, counted in faces. Small parts (lights, wheels, glass)
/// spread over [`NEAR`] faces only: what no view sees, the underside above all, is apron or side.
fn spread(labels: &mut [u8], adjacency: &[Vec<(u32, f32)>]) {
    let wide = |label: u8| {
        PartClass::from_id(label).is_some_and(|class| class.group() == PartGroup::Blacklist)
    };
    for (rounds, may_spread) in
        [(NEAR, (|_| true) as fn(u8) -> bool), (usize::MAX, wide), (usize::MAX, |_| true)]
    {
        let mut front: Vec<usize> =
            (0..labels.len()).filter(|n| labels[*n] != 0 && may_spread(labels[*n])).collect();
        for _ in 0..rounds {
            let mut next = Vec::new();
            for n in front {
                for (other, _) in &adjacency[n] {
                    let other = *other as usize;
                    if labels[other] == 0 {
                        labels[other] = labels[n];
                        next.push(other);
                    }
                }
            }
            if next.is_empty() {
                break;
            }
            front = next;
        }
    }
}

/// Merges patches smaller than `least` square metres into the neighbour they share the longest border with.
pub(super) fn merge_patches(half: &HalfMesh, labels: &mut [u8], least: f64) {
    let adjacency = adjacency(half);
    let area = |n: usize| {
        let [a, b, c] = half.faces[n].map(|v| half.vertices[v as usize]);
        0.5 * (b - a).cross(&(c - a)).norm()
    };
    for _ in 0..4 {
        let mut seen = vec![false; labels.len()];
        let mut changed = false;
        for seed in 0..labels.len() {
            if seen[seed] {
                continue;
            }
            seen[seed] = true;
            let (mut patch, mut at, mut size) = (vec![seed], 0, 0.0);
            let mut borders = [0.0f32; PartClass::COUNT + 1];
            while at < patch.len() {
                let n = patch[at];
                at += 1;
                size += area(n);
                for (other, length) in &adjacency[n] {
                    let other = *other as usize;
                    if labels[other] != labels[seed] {
                        borders[usize::from(labels[other])] += length;
                    } else if !seen[other] {
                        seen[other] = true;
                        patch.push(other);
                    }
                }
            }
            let into = best(&borders);
            if size < least && into != 0 {
                for n in patch {
                    labels[n] = into;
                }
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
}
