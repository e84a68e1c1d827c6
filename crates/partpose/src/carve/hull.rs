//! The visual hull as a vote (Laurentini: *The Visual Hull Concept for Silhouette-Based Image Understanding*, PAMI 1994).
//!
//! Right of the mirror plane only: every view also counts as its own mirror image. A voxel just outside a side surface
//! is seen as background only by the few views that look along that surface, so no share of all views decides: views
//! are gathered by the direction they look from, and a voxel is outside where from *one* direction most tracks see
//! background behind it. An occluder that the masks cut out hides a voxel from some tracks of a direction, or in some
//! frames of a track, not in most. A view's vote grows with its resolution, and with how far outside the silhouette
//! the voxel falls.

use rayon::prelude::*;

use crate::geometry::{Extent, Point3};
use crate::parts::PartClass;

use super::distance::EdgeDistance;
use super::view::{AMBIGUOUS, UNKNOWN, View};

/// Voxels over the right half of the cuboid and a margin, in the coordinates of a model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Voxels along x (half of the width), y, z.
    pub(super) size: [usize; 3],
    /// Corner of the first voxel, metres; x is 0.
    pub(super) origin: [f64; 3],
    /// Edges of a voxel, metres.
    pub(super) step: [f64; 3],
}

impl Grid {
    /// `voxels` over the full width, height and length, with a margin on all sides.
    pub(super) fn over(extent: &Extent, voxels: [usize; 3], margin: [f64; 3]) -> Self {
        let size = [voxels[0].div_ceil(2), voxels[1], voxels[2]];
        let whole = extent.to_vector();
        let reach = [
            whole.x * (0.5 + margin[0]),
            whole.y * (1.0 + 2.0 * margin[1]),
            whole.z * (1.0 + 2.0 * margin[2]),
        ];
        let origin = [0.0, -whole.y * (1.0 + margin[1]), -whole.z * (0.5 + margin[2])];
        Self { size, origin, step: std::array::from_fn(|i| reach[i] / size[i] as f64) }
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Index of a voxel: x runs fastest.
    pub(super) fn index(&self, i: usize, j: usize, k: usize) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }

    /// Centre of a voxel, model coordinates in metres.
    pub(super) fn center(&self, i: usize, j: usize, k: usize) -> Point3 {
        let at = |axis: usize, n: usize| self.origin[axis] + (n as f64 + 0.5) * self.step[axis];
        Point3::new(at(0, i), at(1, j), at(2, k))
    }
}

/// A view made ready for voting.
struct Voter<'a> {
    view: &'a View,
    edge: EdgeDistance,
    quality: f32,
}

/// What the views of one track from one direction say of one voxel.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    /// Sum of votes for background.
    against: f32,
    /// Sum of the votes that there could be.
    all: f32,
    /// The largest of them.
    most: f32,
}

/// What the tracks of one direction say of one voxel.
#[derive(Clone, Copy, Debug, Default)]
struct Direction {
    against: f32,
    all: f32,
}

impl Direction {
    /// 1 where the voxel is just outside.
    fn score(self, least: f32) -> f32 {
        if self.all > 0.0 {
            (self.against / self.all / SHARE).min(self.against / least)
        } else {
            0.0
        }
    }
}

/// The share of a direction's tracks that must see background.
const SHARE: f32 = 0.5;
/// Directions around the vehicle.
const DIRECTIONS: f64 = 24.0;

/// How strongly each voxel is seen as background; see the head of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoteOptions {
    /// Pixels outside the silhouette from which a voxel counts at all.
    pub(super) tolerance: f32,
    /// What a direction's votes for background must amount to, in tracks of full resolution.
    pub(super) least: f32,
    /// Box height, pixels, from which a view counts in full.
    pub(super) full_height: f64,
}

/// Score at which a voxel needs no further voting.
const ENOUGH: f32 = 2.0;

/// A score for every voxel: 1 at the surface, more outside, at most about [`ENOUGH`].
pub(super) fn votes(
    grid: &Grid,
    extent: &Extent,
    views: &[&View],
    options: &VoteOptions,
) -> Vec<f32> {
    let voters: Vec<Voter> = views
        .par_iter()
        .map(|view| {
            let set: Vec<bool> = view.labels.iter().map(|label| *label != 0).collect();
            let quality = (view.box_height / options.full_height).min(1.0) as f32;
            Voter { view, edge: EdgeDistance::of(&set, view.size()), quality }
        })
        .collect();
    let mut ballots: Vec<(i32, usize, f32, &Voter)> = Vec::new();
    for voter in &voters {
        for side in [1.0f32, -1.0] {
            let turn = f64::from(side) * voter.view.azimuth() / std::f64::consts::TAU;
            ballots.push(((turn * DIRECTIONS).floor() as i32, voter.view.track, side, voter));
        }
    }
    ballots.sort_by_key(|ballot| (ballot.0, ballot.1));
    let layer = grid.size[0] * grid.size[1];
    let mut scores = vec![0.0f32; grid.len()];
    scores.par_chunks_mut(layer).enumerate().for_each(|(k, scores)| {
        let mut tallies = vec![Tally::default(); layer];
        let mut sums = vec![Direction::default(); layer];
        for direction in ballots.chunk_by(|a, b| a.0 == b.0) {
            sums.fill(Direction::default());
            for track in direction.chunk_by(|a, b| a.1 == b.1) {
                tallies.fill(Tally::default());
                for (_, _, side, voter) in track {
                    vote(grid, extent, voter, options, *side, k, scores, &mut tallies);
                }
                for (sum, tally) in
                    sums.iter_mut().zip(&tallies).filter(|(_, tally)| tally.all > 0.0)
                {
                    sum.against += tally.against / tally.all * tally.most;
                    sum.all += tally.most;
                }
            }
            scores
                .iter_mut()
                .zip(&sums)
                .for_each(|(score, sum)| *score = score.max(sum.score(options.least)));
        }
    });
    scores
}

#[expect(clippy::too_many_arguments, reason = "the inner loop of one caller")]
fn vote(
    grid: &Grid,
    extent: &Extent,
    voter: &Voter,
    options: &VoteOptions,
    side: f32,
    k: usize,
    scores: &[f32],
    tallies: &mut [Tally],
) {
    let rows = voter.view.projection(extent);
    for j in 0..grid.size[1] {
        let start = grid.center(0, j, k);
        let at = |r: [f32; 4]| {
            r[0] * side * start.x as f32 + r[1] * start.y as f32 + r[2] * start.z as f32 + r[3]
        };
        let (mut u, mut v, mut z) = (at(rows[0]), at(rows[1]), at(rows[2]));
        let dx = side * grid.step[0] as f32;
        let (du, dv, dz) = (rows[0][0] * dx, rows[1][0] * dx, rows[2][0] * dx);
        for i in 0..grid.size[0] {
            let n = j * grid.size[0] + i;
            if scores[n] < ENOUGH
                && z > 0.1
                && let Some(outside) = voter.edge.at(u / z, v / z)
            {
                let (x, y) = ((u / z).round() as usize, (v / z).round() as usize);
                if voter.view.labels[y * voter.edge.size[0] + x] != UNKNOWN {
                    let vote = (outside - options.tolerance).clamp(0.0, 1.0) * voter.quality;
                    let tally = &mut tallies[n];
                    tally.against += vote;
                    tally.all += voter.quality;
                    tally.most = tally.most.max(voter.quality);
                }
            }
            u += du;
            v += dv;
            z += dz;
        }
    }
}

/// Marks voxels beyond the cuboid's side as outside (score [`ENOUGH`]) unless the views from that side see a mirror there.
///
/// Cuboids leave mirrors out. Behind a mirror, seen from ahead, the hull would keep all that the mirror hides, along the
/// whole vehicle, because hardly any view looks along its side.
pub(super) fn cut_sides(grid: &Grid, extent: &Extent, views: &[&View], scores: &mut [f32]) {
    let first = (0..grid.size[0]).find(|i| grid.center(*i, 0, 0).x > SIDE * extent.width);
    let Some(first) = first else { return };
    let looks: Vec<(f32, &View, [[f32; 4]; 3])> = views
        .iter()
        .map(|view| (if view.azimuth() > 0.0 { 1.0 } else { -1.0 }, *view, view.projection(extent)))
        .collect();
    let layer = grid.size[0] * grid.size[1];
    scores.par_chunks_mut(layer).enumerate().for_each(|(k, scores)| {
        for j in 0..grid.size[1] {
            for i in first..grid.size[0] {
                let score = &mut scores[j * grid.size[0] + i];
                if *score >= 1.0 {
                    continue;
                }
                let p = grid.center(i, j, k).cast::<f32>();
                let (mut mirror, mut other) = (0.0f32, 0.0f32);
                for (side, view, rows) in &looks {
                    let at = |r: &[f32; 4]| r[0] * side * p.x + r[1] * p.y + r[2] * p.z + r[3];
                    let z = at(&rows[2]);
                    let (u, v) = ((at(&rows[0]) / z).round(), (at(&rows[1]) / z).round());
                    let size = view.size();
                    if u < 0.0 || v < 0.0 || u as usize >= size[0] || v as usize >= size[1] {
                        continue;
                    }
                    match PartClass::from_id(part_of(
                        view.labels[v as usize * size[0] + u as usize],
                    )) {
                        None => {}
                        Some(PartClass::MirrorLeft | PartClass::MirrorRight) => mirror += 1.0,
                        Some(_) => other += 1.0,
                    }
                }
                if mirror < MIRROR_SHARE * (mirror + other) || mirror == 0.0 {
                    *score = ENOUGH;
                }
            }
        }
    });
}

/// Half of the cuboid's width and a little: what lies beyond can be a mirror only.
const SIDE: f64 = 0.505;
/// Share of the views that must see a mirror where one is.
const MIRROR_SHARE: f32 = 0.3;

/// Whether a pixel's label shows a part, be it of another vehicle behind.
pub(super) fn is_part(label: u8) -> bool {
    label != 0 && label != UNKNOWN
}

/// The part id of a label, without the mark of ambiguity; 0 where nothing is known.
pub(super) fn part_of(label: u8) -> u8 {
    if label == UNKNOWN { 0 } else { label & !AMBIGUOUS }
}
