//! The things that a world is furnished with, made once and placed often.

use super::buildings::{barrier, wall};
use super::furniture::{
    bin, bollard, concrete_barrier, delineator, gantry, guard_rail, lamp_post, sign, signboard,
    traffic_light, wire, wire_post,
};
use super::heavy::heavy;
use super::people::{bicycle, cyclist, pedestrian};
use super::plants::{Species, bush, hedge, tree, tuft};
use super::random::hash;
use super::stuff::Prop;

/// One of each, or several where they should differ.
#[derive(Clone, Debug)]
pub(crate) struct Catalog {
    pub(crate) street_trees: Vec<Prop>,
    pub(crate) forest_trees: Vec<Prop>,
    pub(crate) bushes: Vec<Prop>,
    pub(crate) hedges: Vec<Prop>,
    pub(crate) tufts: Vec<Prop>,
    pub(crate) walls: Vec<Prop>,
    pub(crate) barriers: Vec<Prop>,
    pub(crate) signs: Vec<Prop>,
    pub(crate) signboards: Vec<Prop>,
    pub(crate) bins: Vec<Prop>,
    pub(crate) people: Vec<Prop>,
    pub(crate) cyclists: Vec<Prop>,
    pub(crate) bicycles: Vec<Prop>,
    pub(crate) heavies: Vec<Prop>,
    /// Red, then green; without arm, with arm.
    pub(crate) lights: [Prop; 4],
    pub(crate) lamp_post: Prop,
    pub(crate) tall_lamp_post: Prop,
    /// 1 m long along z: one that is taut, and one that sags.
    pub(crate) wires: [Prop; 2],
    pub(crate) wire_post: Prop,
    pub(crate) bollard: Prop,
    pub(crate) delineator: Prop,
    pub(crate) guard_rail: Prop,
    pub(crate) concrete_barrier: Prop,
    pub(crate) gantries: Vec<Prop>,
}

impl Catalog {
    /// The things of a world.
    pub(crate) fn new(seed: u64) -> Self {
        fn some<T>(count: i64, mut make: impl FnMut(i64) -> T) -> Vec<T> {
            (0..count).map(&mut make).collect()
        }
        let own = |kind: i64, i: i64| hash(seed, &[0xca7, kind, i]);
        let species =
            [Species::Forest, Species::Forest, Species::Forest, Species::Fir, Species::Fir];
        Self {
            street_trees: some(5, |i| tree(own(1, i), Species::Street)),
            forest_trees: some(8, |i| tree(own(2, i), species[i as usize % species.len()])),
            bushes: some(4, |i| bush(own(3, i))),
            hedges: some(3, |i| hedge(own(4, i))),
            tufts: some(5, |i| tuft(own(5, i))),
            walls: some(4, |i| wall(own(6, i))),
            barriers: some(2, |i| barrier(own(7, i))),
            signs: some(7, |i| sign(i as u32)),
            signboards: some(3, |i| signboard(own(8, i))),
            bins: some(6, |i| bin(own(9, i))),
            people: some(14, |i| pedestrian(own(10, i))),
            cyclists: some(6, |i| cyclist(own(11, i))),
            bicycles: some(3, |i| bicycle(own(14, i))),
            heavies: some(10, |i| heavy(own(12, i))),
            lights: [(0, false), (2, false), (0, true), (2, true)]
                .map(|(lit, arm)| traffic_light(lit, arm)),
            lamp_post: lamp_post(6.5),
            tall_lamp_post: lamp_post(10.0),
            wires: [wire(0.04, 0.009), wire(0.9, 0.011)],
            wire_post: wire_post(),
            bollard: bollard(),
            delineator: delineator(),
            guard_rail: guard_rail(),
            concrete_barrier: concrete_barrier(),
            gantries: some(2, |i| gantry(own(13, i), 14.0)),
        }
    }
}
