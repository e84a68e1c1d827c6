//! Fits a surface to silhouettes: moves vertices along their normals until rendered and observed outlines agree on
//! average.
//!
//! A hull is biased: it is cut by the noisiest view. Here every outline edge of every view measures how far, along the
//! outline's normal, the mask's edge lies from the projected one; pixels make that uncertain by half a pixel, which
//! hundreds of views average out. A vertex takes the robust mean of what was measured at it, weighted with the square
//! of the views' resolution; where nothing was measured the displacement is that of the neighbourhood (a screened
//! Laplace equation, solved by Jacobi iteration).

use rayon::prelude::*;

use crate::geometry::{Extent, Point3};
use crate::vehicle::Mesh;
use crate::vehicle::half::{HalfMesh, edges};

use super::distance::EdgeDistance;
use super::hull::is_part;
use super::view::{AMBIGUOUS, UNKNOWN, View};

/// Largest move of a vertex in one round, metres.
const MAX_MOVE: f64 = 0.04;

/// How the outlines are matched.
#[derive(Clone, Copy, Debug)]
pub(super) struct ContourOptions {
    /// Rounds of measuring and moving.
    pub(super) rounds: usize,
    /// Offsets beyond this share of the box height are not believed.
    pub(super) reach: f64,
    /// Weight of the neighbourhood against one measurement at [`Self::unit_resolution`].
    pub(super) stiffness: f64,
    /// Steps of the membrane a round.
    pub(super) membrane_rounds: usize,
    /// Weight of measurements at which the membrane has half its strength.
    pub(super) membrane_weight: f64,
    /// Pixels a metre of a view of weight one.
    pub(super) unit_resolution: f64,
}

impl Default for ContourOptions {
    fn default() -> Self {
        Self {
            rounds: 6,
            reach: 0.08,
            stiffness: 1.0,
            membrane_rounds: 32,
            membrane_weight: 2.0,
            unit_resolution: 40.0,
        }
    }
}

/// One offset seen by one view at one outline edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Offset {
    /// Ends of the edge, vertices of the mirrored mesh.
    pub(super) edge: [u32; 2],
    /// From the projected to the observed outline along the outward normal, pixels.
    pub(super) pixels: f32,
    /// The outward normal in the image.
    pub(super) normal: [f32; 2],
    /// Metres a pixel at the edge.
    pub(super) metres: f32,
    /// Length of the projected edge, pixels.
    pub(super) length: f32,
}

/// A view made ready for measuring.
pub(super) struct Outline<'a> {
    pub(super) view: &'a View,
    edge: EdgeDistance,
}

impl<'a> Outline<'a> {
    pub(super) fn new(view: &'a View) -> Self {
        let set: Vec<bool> = view.labels.iter().map(|label| is_part(*label)).collect();
        Self { view, edge: EdgeDistance::of(&set, view.size()) }
    }
}

/// The edges of a closed mesh with their two faces and the vertices opposite to them.
pub(super) struct MeshEdges(Vec<([u32; 2], [u32; 2])>);

impl MeshEdges {
    pub(super) fn of(mesh: &Mesh) -> Self {
        let pairs = edges(&mesh.faces).into_iter();
        Self(
            pairs
                .filter_map(|(edge, faces)| {
                    (faces.len() == 2).then(|| (edge, [faces[0], faces[1]]))
                })
                .collect(),
        )
    }
}

/// Measures the outline of a mesh, given in coordinates of a model with extent `model`, in one view.
pub(super) fn offsets(
    outline: &Outline,
    mesh: &Mesh,
    mesh_edges: &MeshEdges,
    model: &Extent,
    reach: f64,
) -> Vec<Offset> {
    let view = outline.view;
    let size = view.size();
    let seen: Vec<bool> = view.render(mesh, model).parts.iter().map(|part| *part != 0).collect();
    let rows = view.projection(model).map(|row| row.map(f64::from));
    let project = |p: &Point3| {
        let at = |r: &[f64; 4]| r[0] * p.x + r[1] * p.y + r[2] * p.z + r[3];
        let z = at(&rows[2]);
        [at(&rows[0]) / z, at(&rows[1]) / z, z]
    };
    let pixels: Vec<[f64; 3]> = mesh.vertices.iter().map(project).collect();
    // Positive where a face is seen from its front: image y points down.
    let facing = |face: u32| {
        let [a, b, c] = mesh.faces[face as usize].map(|n| pixels[n as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0
    };
    let front: Vec<bool> = (0..mesh.faces.len() as u32).map(facing).collect();
    let reach = (reach * view.box_height).max(2.0);
    let focal = 0.5 * (view.camera.focal[0] + view.camera.focal[1]);
    let sample = |u: f64, v: f64| -> Option<usize> {
        let (x, y) = (u.round(), v.round());
        (x >= 0.0 && y >= 0.0 && x < size[0] as f64 && y < size[1] as f64)
            .then(|| y as usize * size[0] + x as usize)
    };
    let mut found = Vec::new();
    for (edge, faces) in &mesh_edges.0 {
        if front[faces[0] as usize] == front[faces[1] as usize] {
            continue;
        }
        let [a, b] = edge.map(|n| pixels[n as usize]);
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        if length < 1e-3 {
            continue;
        }
        let opposite = mesh.faces[faces[0] as usize]
            .iter()
            .find(|n| !edge.contains(n))
            .map_or(a, |n| pixels[*n as usize]);
        let mut normal = [dy / length, -dx / length];
        if normal[0] * (opposite[0] - a[0]) + normal[1] * (opposite[1] - a[1]) > 0.0 {
            normal = normal.map(|c| -c);
        }
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let at = |t: f64| [middle[0] + t * normal[0], middle[1] + t * normal[1]];
        let outer = [1.5, 3.0].map(at).map(|p| sample(p[0], p[1]));
        let on_outline = outer.iter().all(|n| n.is_some_and(|n| !seen[n]));
        if !on_outline {
            continue;
        }
        let Some(distance) = outline.edge.at(middle[0] as f32, middle[1] as f32) else { continue };
        if f64::from(distance.abs()) > reach {
            continue;
        }
        // The mask's edge lies at -distance along the normal: what is beyond it must be seen background.
        let edge_at = -f64::from(distance);
        let sound = [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0].iter().all(|step| {
            let p = at(edge_at + step);
            sample(p[0], p[1]).is_some_and(|n| {
                let label = view.labels[n];
                label != UNKNOWN && (*step <= 0.0 || label < AMBIGUOUS)
            })
        });
        if sound {
            found.push(Offset {
                edge: *edge,
                pixels: edge_at as f32,
                normal: normal.map(|c| c as f32),
                metres: (0.5 * (a[2] + b[2]) / focal) as f32,
                length: length as f32,
            });
        }
    }
    found
}

/// Moves the half's vertices until outlines agree; returns the mean absolute offset in pixels before each round.
pub(super) fn fit(
    half: &mut HalfMesh,
    views: &[&View],
    extent: &Extent,
    options: &ContourOptions,
) -> Vec<f64> {
    let outlines: Vec<Outline> = views.par_iter().map(|view| Outline::new(view)).collect();
    let sources = half.sources();
    let near = half.neighbours();
    let mesh_edges = MeshEdges::of(&half.mirrored(&[]));
    let mut history = Vec::new();
    for _ in 0..options.rounds {
        let mesh = half.mirrored(&[]);
        let measured: Vec<Vec<Offset>> = outlines
            .par_iter()
            .map(|outline| offsets(outline, &mesh, &mesh_edges, extent, options.reach))
            .collect();
        let mut samples: Vec<Vec<(f64, f64)>> = vec![Vec::new(); half.vertices.len()];
        let (mut sum, mut weights) = (0.0, 0.0);
        for offset in measured.iter().flatten() {
            let resolution = 1.0 / f64::from(offset.metres);
            let weight = (resolution / options.unit_resolution).powi(2)
                * f64::from(offset.length / 3.0).min(1.0);
            let metres = f64::from(offset.pixels * offset.metres);
            sum += f64::from(offset.pixels.abs() * offset.length);
            weights += f64::from(offset.length);
            for vertex in offset.edge {
                samples[sources[vertex as usize] as usize].push((metres, weight));
            }
        }
        history.push(sum / f64::max(weights, 1.0));
        let targets: Vec<(f64, f64)> =
            samples.par_iter_mut().map(|list| robust_mean(list)).collect();
        let moves = diffuse(&targets, &near, options.stiffness);
        let normals = half.normals();
        for (n, vertex) in half.vertices.iter_mut().enumerate() {
            *vertex += normals[n] * (0.8 * moves[n]).clamp(-MAX_MOVE, MAX_MOVE);
            if half.on_plane[n] {
                vertex.x = 0.0;
            } else {
                vertex.x = vertex.x.max(1e-4);
            }
        }
        tighten(half, &near, &targets, options);
        smooth(half, &near, 0.15);
    }
    history
}

/// Draws vertices of which no outline says anything to the mean of their neighbours, like a membrane over the frame of
/// the known ones: a hull bulges where no view looks along it.
fn tighten(
    half: &mut HalfMesh,
    near: &[Vec<u32>],
    targets: &[(f64, f64)],
    options: &ContourOptions,
) {
    for _ in 0..options.membrane_rounds {
        let last = half.vertices.clone();
        for (n, list) in near.iter().enumerate().filter(|(_, list)| !list.is_empty()) {
            let slack = 0.5 / (1.0 + targets[n].1 / options.membrane_weight);
            let sum = list
                .iter()
                .fold(nalgebra::Vector3::zeros(), |sum, m| sum + last[*m as usize].coords);
            let mut pull = sum / list.len() as f64 - last[n].coords;
            if half.on_plane[n] {
                pull.x = 0.0;
            }
            half.vertices[n] += pull * slack;
        }
    }
}

/// Weighted median, then the weighted mean of what lies near it; with the sum of weights.
fn robust_mean(samples: &mut [(f64, f64)]) -> (f64, f64) {
    if samples.is_empty() {
        return (0.0, 0.0);
    }
    samples.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let total: f64 = samples.iter().map(|s| s.1).sum();
    let mut passed = 0.0;
    let median = samples
        .iter()
        .find(|s| {
            passed += s.1;
            passed >= 0.5 * total
        })
        .map_or(0.0, |s| s.0);
    let (mut spread, mut sum, mut weight) = (0.0, 0.0, 0.0);
    for s in samples.iter() {
        spread += s.1 * (s.0 - median).abs();
    }
    let limit = 1.5 * spread / total + 1e-4;
    for s in samples.iter().filter(|s| (s.0 - median).abs() <= limit) {
        sum += s.0 * s.1;
        weight += s.1;
    }
    if weight > 0.0 { (sum / weight, total) } else { (median, total) }
}

/// Displacements near the targets where there are some, smooth elsewhere.
fn diffuse(targets: &[(f64, f64)], near: &[Vec<u32>], stiffness: f64) -> Vec<f64> {
    const ROUNDS: usize = 60;
    let mut moves: Vec<f64> = targets.iter().map(|t| if t.1 > 0.0 { t.0 } else { 0.0 }).collect();
    for _ in 0..ROUNDS {
        let last = moves.clone();
        for (n, target) in targets.iter().enumerate() {
            let count = near[n].len() as f64;
            let sum: f64 = near[n].iter().map(|m| last[*m as usize]).sum();
            // The screen pulls unseen regions gently to rest.
            let screen = 0.02 * stiffness;
            moves[n] =
                (target.1 * target.0 + stiffness * sum) / (target.1 + stiffness * count + screen);
        }
    }
    moves
}

/// Moves every vertex a little to the mean of its neighbours, then back out (Taubin: *A Signal Processing Approach to
/// Fair Surface Design*, SIGGRAPH 1995), so that the volume stays.
pub(super) fn smooth(half: &mut HalfMesh, near: &[Vec<u32>], strength: f64) {
    for factor in [strength, -1.03 * strength] {
        let last = half.vertices.clone();
        for (n, list) in near.iter().enumerate() {
            let mut sum = nalgebra::Vector3::zeros();
            let mut count = 0.0;
            for m in list {
                let p = last[*m as usize];
                if half.on_plane[n] {
                    // The neighbour and its mirror image.
                    sum += nalgebra::Vector3::new(0.0, p.y, p.z);
                } else {
                    sum += p.coords;
                }
                count += 1.0;
            }
            if count > 0.0 {
                half.vertices[n] += (sum / count - last[n].coords) * factor;
            }
            if half.on_plane[n] {
                half.vertices[n].x = 0.0;
            } else {
                half.vertices[n].x = half.vertices[n].x.max(1e-4);
            }
        }
    }
}
