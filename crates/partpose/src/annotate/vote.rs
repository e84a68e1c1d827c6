//! What the sources say each face of the target is.
//!
//! At the place where a face would be on a source its nearest points vote with their parts, the nearer and the more
//! alike in normal the more; sources that fit the target better count more.

use crate::geometry::Point3;
use crate::parts::{PartClass, PartMap};

use super::align::Alignment;
use super::shape::{Shape, Spot, left_name};
use super::tree::{Key, Tree, key};

/// Metres that a unit of difference between normals counts.
const REACH: f64 = 0.25;
/// Points of a source that vote for a face.
const VOTERS: usize = 6;
/// Distance beyond the nearest voter's at which a voter counts little, metres.
const NEAR: f64 = 0.03;
/// Distance at which a source as a whole counts less, metres; normals counted.
const FAR: f64 = 0.15;
/// How far a part that the target names may reach beyond the faces that bear its name, metres.
const BEYOND: f64 = 0.04;

/// Shares of the parts, under their left names, by [`PartClass::index`].
pub(super) type Ballot = [f32; PartClass::COUNT];

/// The votes for a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Votes {
    /// Sums to 1, or is all zero where nobody voted.
    pub(super) ballot: Ballot,
    /// How well the sources that voted fit there, 0 to 1.
    pub(super) fit: f32,
}

/// A source laid on the target, with its weight among the sources.
pub(super) struct Voter<'a> {
    pub(super) shape: &'a Shape,
    pub(super) alignment: Alignment,
    pub(super) weight: f64,
}

/// The votes of all sources for every spot of the target.
///
/// `without` names parts that the target lacks: their votes go to what stands in their place. A part that the target
/// names gets no votes away from the faces that bear its name: the nearest points of other parts vote there.
pub(super) fn votes(spots: &[Spot], voters: &[Voter], without: &[PartClass]) -> Vec<Votes> {
    let mut votes = vec![Votes { ballot: [0.0; PartClass::COUNT], fit: 0.0 }; spots.len()];
    let total: f64 = voters.iter().map(|voter| voter.weight).sum::<f64>().max(1e-300);
    let given = Given::new(spots);
    let mut found = Vec::new();
    for voter in voters {
        let (all, free) = (Electorate::new(voter.shape, &|_| true), {
            Electorate::new(voter.shape, &|part| given.trees.get(part).is_none())
        });
        for (spot, votes) in spots.iter().zip(&mut votes) {
            if spot.part.is_some() {
                continue;
            }
            let place = voter.alignment.source_from_target(&spot.point);
            let query = key(&place, &spot.normal, REACH);
            all.tree.nearest(&query, VOTERS, &mut found);
            let is_free =
                found.iter().all(|(_, i)| given.allows(all.parts[*i as usize], &spot.point));
            if !is_free {
                free.tree.nearest(&query, VOTERS, &mut found);
            }
            let parts = if is_free { &all.parts } else { &free.parts };
            let Some((nearest, _)) = found.first().copied() else { continue };
            let fit = (-0.5 * nearest / (FAR * FAR)).exp();
            let share = voter.weight / total;
            let count = |square: f64| (-0.5 * (square - nearest) / (NEAR * NEAR)).exp();
            let sum: f64 = found.iter().map(|(square, _)| count(*square)).sum();
            for (square, index) in &found {
                let part = stand_in(parts[*index as usize], without);
                let weight = share * fit.max(1e-6) * count(*square) / sum;
                votes.ballot[part.index()] += weight as f32;
            }
            votes.fit += (share * fit) as f32;
        }
    }
    for votes in &mut votes {
        normalize(&mut votes.ballot);
    }
    votes
}

/// Those points of a source that may vote, with their parts.
struct Electorate {
    tree: Tree,
    parts: Vec<PartClass>,
}

impl Electorate {
    fn new(shape: &Shape, admits: &dyn Fn(PartClass) -> bool) -> Self {
        let labelled = shape.spots.iter().filter_map(|spot| Some((spot, spot.part?)));
        let (keys, parts): (Vec<Key>, Vec<PartClass>) = labelled
            .filter(|(_, part)| admits(*part))
            .map(|(spot, part)| (key(&spot.point, &spot.normal, REACH), part))
            .unzip();
        Self { tree: Tree::new(&keys), parts }
    }
}

/// Where the target's own parts are.
struct Given {
    trees: PartMap<Tree>,
}

impl Given {
    fn new(spots: &[Spot]) -> Self {
        let mut keys: PartMap<Vec<Key>> = PartMap::default();
        for spot in spots {
            let Some(part) = spot.part else { continue };
            match keys.get_mut(part) {
                Some(list) => list.push(place_key(&spot.point)),
                None => drop(keys.insert(part, vec![place_key(&spot.point)])),
            }
        }
        Self { trees: keys.map(|_, keys| Tree::new(keys)) }
    }

    /// Whether a face without a part may get this one: the target does not name it, or names it close by.
    fn allows(&self, part: PartClass, point: &Point3) -> bool {
        let Some(tree) = self.trees.get(part) else { return true };
        let mut found = Vec::with_capacity(2);
        tree.nearest(&place_key(point), 1, &mut found);
        found.first().is_some_and(|(square, _)| *square <= BEYOND * BEYOND)
    }
}

/// The part that is where a missing one would be.
fn stand_in(part: PartClass, without: &[PartClass]) -> PartClass {
    use PartClass as P;
    let mut part = part;
    // Each step leads to a part that more vehicles have; sides and aprons end the chain.
    for _ in 0..4 {
        if !without.iter().any(|other| left_name(*other) == part) {
            break;
        }
        part = match part {
            P::DoorRearLeft
            | P::GlassCornerLeft
            | P::MirrorLeft
            | P::WheelFrontLeft
            | P::WheelRearLeft
            | P::GlassFrontLeft
            | P::DoorFrontLeft => P::SideLeft,
            P::GlassRearLeft => P::GlassCornerLeft,
            P::LightFrontLeft | P::Hood => P::ApronFront,
            P::LightRearLeft | P::Trunk => P::ApronRear,
            P::WindshieldFront | P::WindshieldRear => P::Roof,
            other => other,
        };
    }
    part
}

fn place_key(point: &Point3) -> Key {
    [point.x, point.y, point.z, 0.0, 0.0, 0.0]
}

pub(super) fn normalize(ballot: &mut Ballot) {
    let sum: f32 = ballot.iter().sum();
    if sum > 0.0 {
        for value in &mut *ballot {
            *value /= sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coupe_has_its_side_where_a_sedan_has_its_rear_door() {
        let without = [PartClass::DoorRearRight, PartClass::GlassRearLeft];
        assert_eq!(stand_in(PartClass::DoorRearLeft, &without), PartClass::SideLeft);
        assert_eq!(stand_in(PartClass::GlassRearLeft, &without), PartClass::GlassCornerLeft);
        assert_eq!(stand_in(PartClass::Roof, &without), PartClass::Roof);
    }
}
