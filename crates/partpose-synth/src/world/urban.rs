//! A street in a town: two lanes, parked rows, kerbs, pavements, houses, trees, people.

use std::f64::consts::{FRAC_PI_2, PI};

use rand::RngExt;

use super::buildings::{House, house};
use super::plan::LANE;
use super::random::hash;
use super::site::{ASPHALT, GRASS, IRON, KERB, PAINT, PATCH, PAVEMENT, Site, level};
use super::street::{dashes, flat, riser};
use crate::scene::SegmentClass;

/// Height of kerbs, metres.
pub(crate) const KERB_HEIGHT: f64 = 0.12;

/// The cross-section of a street in a town.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Profile {
    /// From the path to the kerb, metres.
    pub(crate) kerb: f64,
    /// From the path to the fronts of the houses.
    pub(crate) front: f64,
}

/// A street with two lanes and a parked row on either side; `clear` metres at least are kept free of houses.
pub(crate) fn profile(clear: f64) -> Profile {
    let kerb = (LANE + 2.35).max(clear.min(14.0));
    Profile { kerb, front: kerb + 3.2 }
}

/// Furnishes a piece.
pub(crate) fn furnish(site: &mut Site, profile: Profile, marked: bool) {
    let range = site.range;
    carriageway(site, range, profile.kerb);
    if marked {
        center_line(site, range);
    }
    pavements(site, range, profile);
    rows_of_houses(site, range, profile, &[-1.0, 1.0]);
    pavement_things(site, range, profile);
    wires(site, range, profile);
    clutter(site, range, profile);
}

/// Wires across the street and, where trams run, along it.
fn wires(site: &mut Site, range: [f64; 2], profile: Profile) {
    let with_trams = hash(site.seed, &[0x71]).is_multiple_of(2);
    let catalog = site.catalog;
    for i in 0..4 {
        let s = site.range[0] + 10.0 * f64::from(i);
        if s < range[0] || s + 10.0 > range[1] {
            continue;
        }
        if i % 2 == 0 && (with_trams || hash(site.seed, &[0x72, s as i64]).is_multiple_of(3)) {
            let ends = [-1.0, 1.0].map(|side| [s, side * profile.front, 7.6]);
            site.span(&catalog.wires[1], ends);
        }
        if with_trams {
            for right in [-0.5 * LANE, 0.5 * LANE] {
                site.span(&catalog.wires[0], [s, s + 10.0].map(|s| [s, right, 6.5]));
            }
        }
    }
}

/// Bins in groups and bicycles that lean against houses.
fn clutter(site: &mut Site, range: [f64; 2], profile: Profile) {
    let mut rng = site.random(0x73);
    let catalog = site.catalog;
    for side in [-1.0, 1.0] {
        for _ in 0..3 {
            let s = rng.random_range(site.range[0]..site.range[1]);
            let [kind, count] = [rng.random_range(0..5), rng.random_range(1..4)];
            let choice: usize = rng.random_range(0..60);
            for i in 0..count {
                let at = s + f64::from(i) * if kind < 3 { 0.75 } else { 0.45 };
                if at < range[0] || at > range[1] {
                    continue;
                }
                let turn = FRAC_PI_2 * rng.random_range(0.9..1.1);
                if kind < 3 {
                    let bin = &catalog.bins[(choice + i as usize) % catalog.bins.len()];
                    site.put(bin, [at, side * (profile.front - 0.5), KERB_HEIGHT], turn, 1.0);
                } else {
                    let bicycle = &catalog.bicycles[choice % catalog.bicycles.len()];
                    let at = [at, side * (profile.front - 0.95), KERB_HEIGHT];
                    site.put(bicycle, at, turn, 1.0);
                }
            }
        }
    }
}

/// Asphalt with patches and manholes.
pub(crate) fn carriageway(site: &mut Site, range: [f64; 2], kerb: f64) {
    let mut rng = site.random(0x10);
    site.ground(range, 2.0, &[flat(-kerb, kerb, 0.0, ASPHALT)], &level, SegmentClass::Road);
    let inside = |s: f64| s > range[0] && s < range[1];
    for _ in 0..rng.random_range(0..3) {
        let s = rng.random_range(site.range[0]..site.range[1] - 6.0);
        let long = rng.random_range(1.0..6.0);
        let right = rng.random_range(-kerb + 1.0..kerb - 1.5);
        let wide = rng.random_range(0.5..1.6);
        if inside(s) && inside(s + long) {
            site.ground(
                [s, s + long],
                2.0,
                &[flat(right, right + wide, 0.004, PATCH)],
                &level,
                SegmentClass::Road,
            );
        }
    }
    for _ in 0..rng.random_range(1..3) {
        let s = rng.random_range(site.range[0]..site.range[1] - 1.0);
        let right = rng.random_range(-kerb + 0.5..kerb - 0.5);
        if inside(s) && inside(s + 0.6) {
            site.ground(
                [s, s + 0.6],
                1.0,
                &[flat(right - 0.3, right + 0.3, 0.006, IRON)],
                &level,
                SegmentClass::Road,
            );
        }
    }
}

fn center_line(site: &mut Site, range: [f64; 2]) {
    for dash in dashes(range, 3.0, 9.0) {
        site.ground(dash, 3.0, &[flat(-0.06, 0.06, 0.008, PAINT)], &level, SegmentClass::Road);
    }
    // Edges of the parking strips, short strokes.
    for side in [-1.0, 1.0] {
        for dash in dashes(range, 0.8, 6.3) {
            let at = side * (LANE + 0.1);
            site.ground(
                dash,
                3.0,
                &[flat(at - 0.05, at + 0.05, 0.008, PAINT)],
                &level,
                SegmentClass::Road,
            );
        }
    }
}

/// Kerbs and pavements on both sides.
pub(crate) fn pavements(site: &mut Site, range: [f64; 2], profile: Profile) {
    let mut strips = Vec::new();
    for side in [-1.0, 1.0] {
        let at = |metres: f64| side * metres;
        strips.push(riser(at(profile.kerb), 0.0, KERB_HEIGHT, KERB));
        strips.push(flat(at(profile.kerb), at(profile.kerb + 0.15), KERB_HEIGHT, KERB));
        strips.push(flat(
            at(profile.kerb + 0.15),
            at(profile.front + 0.5),
            KERB_HEIGHT + 0.005,
            PAVEMENT,
        ));
        strips.push(flat(
            at(profile.front + 0.5),
            at(profile.front + 40.0),
            KERB_HEIGHT - 0.02,
            GRASS,
        ));
    }
    site.ground(range, 4.0, &strips, &level, SegmentClass::Terrain);
}

/// Houses of different widths on some sides (-1 left, 1 right), with gaps and gardens between them.
pub(crate) fn rows_of_houses(site: &mut Site, range: [f64; 2], profile: Profile, sides: &[f64]) {
    for side in sides {
        let mut rng = site.random(0x20 + *side as i64);
        let turn = if *side > 0.0 { 0.0 } else { PI };
        let mut s = site.range[0];
        while s < site.range[1] - 5.0 {
            let width = rng.random_range(8.0_f64..17.0).min(site.range[1] - s);
            let storeys = rng.random_range(2..6);
            let setback = if rng.random_bool(0.25) { rng.random_range(1.0..5.0) } else { 0.0 };
            let seed = hash(site.seed, &[0x40, *side as i64, (s * 10.0) as i64]);
            let gap = rng.random_bool(0.16);
            let middle = s + 0.5 * width;
            let (from, to) = (s, s + width);
            s += width + if rng.random_bool(0.2) { rng.random_range(2.0..6.0) } else { 0.0 };
            if from < range[0] - 0.01 || to > range[1] + 0.01 {
                continue;
            }
            let right = side * (profile.front + setback);
            if gap {
                garden(site, [middle, width], *side, profile);
                continue;
            }
            let kind =
                House { width: width as f32, depth: rng.random_range(9.0_f32..13.0), storeys };
            let prop = house(seed, &kind);
            site.put(&prop, [middle, right, KERB_HEIGHT], turn, 1.0);
            if setback > 2.0 {
                let hedge =
                    site.catalog.hedges[storeys as usize % site.catalog.hedges.len()].clone();
                for i in 0..(width / 4.0) as i32 {
                    let at = from + 2.0 + 4.0 * f64::from(i);
                    site.put(&hedge, [at, side * (profile.front + 0.5), KERB_HEIGHT], 0.0, 1.0);
                }
            }
        }
    }
}

/// A gap in the row: a wall, trees and bushes behind it.
fn garden(site: &mut Site, [middle, width]: [f64; 2], side: f64, profile: Profile) {
    let mut rng = site.random(0x60 + middle as i64);
    let catalog = site.catalog;
    let wall = &catalog.walls[rng.random_range(0..catalog.walls.len())];
    for i in 0..(width / 6.0).ceil() as i32 {
        let at = middle - 0.5 * width + 3.0 + 6.0 * f64::from(i);
        site.put(wall, [at, side * (profile.front + 0.3), KERB_HEIGHT], 0.0, 1.0);
    }
    for _ in 0..3 {
        let at = middle + rng.random_range(-0.5..0.5) * width;
        let right = side * (profile.front + rng.random_range(2.5..12.0));
        let tree = &catalog.street_trees[rng.random_range(0..catalog.street_trees.len())];
        site.put(tree, [at, right, 0.0], rng.random_range(0.0..6.0), rng.random_range(0.8..1.3));
        let bush = &catalog.bushes[rng.random_range(0..catalog.bushes.len())];
        site.put(
            bush,
            [at, side * (profile.front + 1.5), KERB_HEIGHT],
            rng.random_range(0.0..6.0),
            1.2,
        );
    }
}

/// Lamp posts, trees, signs, bins and people.
pub(crate) fn pavement_things(site: &mut Site, range: [f64; 2], profile: Profile) {
    let mut rng = site.random(0x30);
    let catalog = site.catalog;
    let edge = profile.kerb + 0.45;
    let with_trees = !hash(site.seed, &[0x31]).is_multiple_of(3);
    for side in [-1.0, 1.0] {
        let turn = if side > 0.0 { 0.0 } else { PI };
        let phase = rng.random_range(2.0..6.0);
        for i in 0..4 {
            let s = site.range[0] + phase + 10.0 * f64::from(i);
            if s < range[0] || s > range[1] {
                continue;
            }
            let at = [s, side * edge, KERB_HEIGHT];
            match i {
                0 => site.put(&catalog.lamp_post, at, turn, 1.0),
                2 if rng.random_bool(0.7) => {
                    let sign = &catalog.signs[rng.random_range(0..catalog.signs.len())];
                    // Signs face those who come: against the direction on the right, along it on the left.
                    site.put(sign, at, turn, 1.0);
                }
                _ if with_trees && rng.random_bool(0.6) => {
                    let tree =
                        &catalog.street_trees[rng.random_range(0..catalog.street_trees.len())];
                    site.put(tree, at, rng.random_range(0.0..6.0), rng.random_range(0.65..1.0));
                }
                _ => {
                    let bin = &catalog.bins[rng.random_range(0..catalog.bins.len())];
                    if rng.random_bool(0.35) {
                        site.put(
                            bin,
                            [s, side * (profile.front - 0.7), KERB_HEIGHT],
                            FRAC_PI_2 * rng.random_range(0.9..1.1),
                            1.0,
                        );
                    }
                }
            }
        }
        if rng.random_bool(0.25) {
            for i in 0..8 {
                let s = site.range[0] + 1.5 * f64::from(i) + 12.0;
                if s > range[0] && s < range[1] {
                    site.put(&catalog.bollard, [s, side * (edge - 0.2), KERB_HEIGHT], 0.0, 1.0);
                }
            }
        }
        if rng.random_bool(0.10) {
            let board = &catalog.signboards[rng.random_range(0..catalog.signboards.len())];
            let s = rng.random_range(site.range[0]..site.range[1]);
            if s > range[0] && s < range[1] {
                site.put(
                    board,
                    [s, side * (profile.front - 0.4), KERB_HEIGHT],
                    turn + rng.random_range(0.2..1.2),
                    0.8,
                );
            }
        }
    }
}
