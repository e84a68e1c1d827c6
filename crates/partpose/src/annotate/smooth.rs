//! Seams that are short, and run along edges of the surface where they can.
//!
//! Votes alone fray. Each face's shares are multiplied by those of its neighbours, more so across a long edge and
//! across a flat one, until they settle: mean field inference in a Potts model (Koller and Friedman: *Probabilistic
//! Graphical Models*, 2009, § 11.5). Given parts stay as they are and count as neighbours.

use super::shape::Spot;
use super::surface::Surface;
use super::vote::{Ballot, normalize};

/// How much a neighbour across a flat edge as long as a usual triangle's counts, as a logarithm of odds.
const COUPLING: f64 = 1.2;
/// Angle between normals, radians, at which an edge is a crease and neighbours hardly count.
const CREASE: f64 = 0.35;
const ROUNDS: usize = 12;
/// Share of an unlikely part, so that neighbours can win anywhere.
const FLOOR: f32 = 0.003;

/// The shares after the neighbours have been heard.
pub(super) fn smoothed(surface: &Surface, spots: &[Spot], ballots: &[Ballot]) -> Vec<Ballot> {
    let mut start: Vec<Ballot> = ballots.to_vec();
    for (ballot, spot) in start.iter_mut().zip(spots) {
        if let Some(part) = spot.part {
            *ballot = [0.0; _];
            ballot[part.index()] = 1.0;
        }
    }
    let links = links(surface, spots);
    let mut now = start.clone();
    for _ in 0..ROUNDS {
        let mut next = start.clone();
        for (i, spot) in spots.iter().enumerate() {
            if spot.part.is_some() {
                continue;
            }
            let mut pull: Ballot = [0.0; _];
            for (other, weight) in &links.of[links.starts[i]..links.starts[i + 1]] {
                for (sum, share) in pull.iter_mut().zip(&now[*other as usize]) {
                    *sum += weight * share;
                }
            }
            let ballot = &mut next[i];
            if ballot.iter().all(|share| *share <= 0.0) {
                // Nobody voted: the neighbours decide.
                ballot.copy_from_slice(&pull);
            } else {
                for (share, pull) in ballot.iter_mut().zip(&pull) {
                    *share = (*share + FLOOR) * pull.exp();
                }
            }
            normalize(ballot);
        }
        // Half a step keeps neighbours from changing places for ever.
        for (now, next) in now.iter_mut().flatten().zip(next.iter().flatten()) {
            *now = 0.5 * (*now + next);
        }
    }
    now
}

/// For each face its neighbours with their weights, one list after the other.
struct Links {
    starts: Vec<usize>,
    of: Vec<(u32, f32)>,
}

fn links(surface: &Surface, spots: &[Spot]) -> Links {
    let mut both: Vec<(u32, u32, f32)> = Vec::new();
    for ([a, b], length) in surface.neighbours() {
        let [p, q] = [&spots[a as usize], &spots[b as usize]];
        let angle = p.normal.dot(&q.normal).clamp(-1.0, 1.0).acos();
        let usual = (p.area.max(q.area)).sqrt().max(1e-9);
        let strength = (length / usual).min(2.0) * (-(angle / CREASE).powi(2)).exp();
        let weight = (COUPLING * strength) as f32;
        both.push((a, b, weight));
        both.push((b, a, weight));
    }
    both.sort_unstable_by_key(|(a, b, _)| (*a, *b));
    let mut starts = vec![0; spots.len() + 1];
    for (a, _, _) in &both {
        starts[*a as usize + 1] += 1;
    }
    for i in 0..spots.len() {
        starts[i + 1] += starts[i];
    }
    Links { starts, of: both.into_iter().map(|(_, b, weight)| (b, weight)).collect() }
}
