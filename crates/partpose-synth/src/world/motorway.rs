//! A motorway: three lanes either way, a reservation with barriers, fields, trees or noise barriers beside it.

use std::f64::consts::PI;

use rand::RngExt;

use super::plan::{MEDIAN, WIDE};
use super::site::{ASPHALT, GRASS, GRAVEL, PAINT, PATCH, PIECE, SOIL, Site, hills, level};
use super::street::{Strip, dashes, flat};
use crate::scene::SegmentClass;

/// From the path to the end of the hard shoulder, metres.
const SHOULDER: f64 = 1.5 * WIDE + 2.6;
/// The other carriageway's outer edge.
const FAR: f64 = 2.0 * MEDIAN - SHOULDER;

/// Furnishes a piece.
pub(crate) fn furnish(site: &mut Site) {
    let range = site.range;
    let raised = hills(20.0, 3.0);
    ground(site, range, &raised);
    markings(site, range);
    let mut rng = site.random(0x10);
    let catalog = site.catalog;
    let index = (range[0] / PIECE).round() as i64;
    // The character of the roadside lasts for a while.
    let stretch =
        |side: f64| super::random::unit(site.seed, &[0x77, index.div_euclid(5), side as i64]);
    let sides = [(1.0, SHOULDER, stretch(1.0)), (-1.0, -FAR, stretch(-1.0))];
    for i in 0..10 {
        let s = range[0] + 2.0 + 4.0 * f64::from(i);
        site.put(&catalog.concrete_barrier, [s, MEDIAN, 0.0], 0.0, 1.0);
        site.put(&catalog.guard_rail, [s, SHOULDER + 0.7, 0.0], 0.0, 1.0);
        site.put(&catalog.guard_rail, [s, FAR - 0.7, 0.0], PI, 1.0);
    }
    for (side, edge, character) in sides {
        let turn = if side > 0.0 { 0.0 } else { PI };
        if character < 0.25 {
            let barrier =
                &catalog.barriers[usize::from(index.rem_euclid(2) == 1) % catalog.barriers.len()];
            for i in 0..7 {
                let s = range[0] + 3.0 + 6.0 * f64::from(i);
                if s < range[1] {
                    site.put(barrier, [s, side * (edge + 3.0), 0.0], turn, 1.0);
                }
            }
        }
        let trees = if character < 0.75 { 16 } else { 4 };
        for _ in 0..trees {
            let right = edge + rng.random_range(6.0_f64..45.0);
            let s = rng.random_range(range[0]..range[1]);
            let pool =
                if rng.random_bool(0.5) { &catalog.forest_trees } else { &catalog.street_trees };
            let tree = &pool[rng.random_range(0..pool.len())];
            site.put(
                tree,
                [s, side * right, raised(s, side * right) - 0.2],
                rng.random_range(0.0..6.0),
                rng.random_range(0.7..1.3),
            );
        }
        for _ in 0..9 {
            let right = edge + rng.random_range(2.0_f64..9.0);
            let s = rng.random_range(range[0]..range[1]);
            let bush = &catalog.bushes[rng.random_range(0..catalog.bushes.len())];
            site.put(
                bush,
                [s, side * right, 0.0],
                rng.random_range(0.0..6.0),
                rng.random_range(0.6..1.8),
            );
        }
        site.put(&catalog.delineator, [range[0] + 20.0, side * (edge + 0.5), 0.0], turn, 1.0);
    }
    if index.rem_euclid(2) == 0 {
        site.put(&catalog.tall_lamp_post, [range[0] + 10.0, SHOULDER + 1.6, 0.0], 0.0, 1.0);
    }
    if index.rem_euclid(11) == 5 {
        let gantry = &catalog.gantries[index.rem_euclid(2) as usize % catalog.gantries.len()];
        site.put(gantry, [range[0] + 15.0, SHOULDER + 1.5, 0.0], 0.0, 1.0);
    }
}

fn ground(site: &mut Site, range: [f64; 2], raised: &dyn Fn(f64, f64) -> f64) {
    let median = 1.2;
    let road =
        [flat(MEDIAN + median, SHOULDER, 0.0, ASPHALT), flat(FAR, MEDIAN - median, 0.0, ASPHALT)];
    site.ground(range, 4.0, &road, &level, SegmentClass::Road);
    let mut strips = vec![flat(MEDIAN - median, MEDIAN + median, 0.02, GRAVEL)];
    for (side, edge) in [(1.0, SHOULDER), (-1.0, -FAR)] {
        let line: [(f64, f64, u16); 7] = [
            (edge, -0.01, GRAVEL),
            (edge + 0.6, -0.05, GRASS),
            (edge + 4.0, -0.4, GRASS),
            (edge + 9.0, 0.2, GRASS),
            (edge + 25.0, 0.6, SOIL),
            (edge + 70.0, 1.5, GRASS),
            (edge + 160.0, 3.0, GRASS),
        ];
        for pair in line.windows(2) {
            let [(a, up, material), (b, next, _)] = [pair[0], pair[1]];
            strips.push(Strip { from: [side * a, up], to: [side * b, next], material });
        }
    }
    site.ground(range, 8.0, &strips, raised, SegmentClass::Terrain);
}

fn markings(site: &mut Site, range: [f64; 2]) {
    for (left, right, inner, outer) in [
        (-1.5 * WIDE, 1.5 * WIDE, -0.5 * WIDE, 0.5 * WIDE),
        (
            2.0 * MEDIAN - 1.5 * WIDE,
            2.0 * MEDIAN + 1.5 * WIDE,
            2.0 * MEDIAN - 0.5 * WIDE,
            2.0 * MEDIAN + 0.5 * WIDE,
        ),
    ] {
        let edges = [left, right].map(|at| flat(at - 0.12, at + 0.12, 0.008, PAINT));
        site.ground(range, 4.0, &edges, &level, SegmentClass::Road);
        for dash in dashes(range, 6.0, 18.0) {
            let strips = [inner, outer].map(|at| flat(at - 0.075, at + 0.075, 0.008, PAINT));
            site.ground(dash, 3.0, &strips, &level, SegmentClass::Road);
        }
    }
    let mut rng = site.random(0x12);
    if rng.random_bool(0.3) {
        let s = rng.random_range(range[0]..range[1] - 20.0);
        site.ground(
            [s, s + 20.0],
            4.0,
            &[flat(0.6 * WIDE, 1.4 * WIDE, 0.004, PATCH)],
            &level,
            SegmentClass::Road,
        );
    }
}
