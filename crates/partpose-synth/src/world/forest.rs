//! A country road through a wood.

use rand::RngExt;

use super::plan::LANE;
use super::random::hash;
use super::site::{ASPHALT, GRASS, GRAVEL, PAINT, PATCH, SOIL, Site, hills, level};
use super::street::{Strip, dashes, flat};
use crate::scene::SegmentClass;

/// From the path to the edge of the asphalt, metres.
const EDGE: f64 = LANE + 0.25;
/// Where trees begin.
const TREES: f64 = EDGE + 2.4;

/// Furnishes a piece; nothing stands nearer to the path than `clear` metres.
pub(crate) fn furnish(site: &mut Site, clear: f64) {
    let range = site.range;
    let edge = EDGE.max(clear.min(12.0));
    let lift = hills(edge + 1.5, 2.0);
    ground(site, range, edge, &lift);
    markings(site, range, edge);
    wires(site, edge);
    let mut rng = site.random(0x10);
    let catalog = site.catalog;
    let rail = rng.random_range(0..5);
    for side in [-1.0, 1.0] {
        let begin = edge + (TREES - EDGE);
        for _ in 0..24 {
            // More of them near the road, where they are seen.
            let far = rng.random_range(0.0_f64..1.0);
            let right = begin + 38.0 * far * far;
            let s = rng.random_range(range[0]..range[1]);
            let pool =
                if rng.random_bool(0.3) { &catalog.street_trees } else { &catalog.forest_trees };
            let tree = &pool[rng.random_range(0..pool.len())];
            let up = lift(s, side * right) - 0.1;
            site.put(
                tree,
                [s, side * right, up],
                rng.random_range(0.0..6.0),
                rng.random_range(0.7..1.25),
            );
        }
        for _ in 0..24 {
            let right = begin - 0.6 + rng.random_range(0.0_f64..12.0);
            let s = rng.random_range(range[0]..range[1]);
            let bush = &catalog.bushes[rng.random_range(0..catalog.bushes.len())];
            let up = lift(s, side * right);
            site.put(
                bush,
                [s, side * right, up],
                rng.random_range(0.0..6.0),
                rng.random_range(0.6..2.0),
            );
        }
        for _ in 0..34 {
            let right = edge + 0.9 + rng.random_range(0.0_f64..5.0);
            let s = rng.random_range(range[0]..range[1]);
            let tuft = &catalog.tufts[rng.random_range(0..catalog.tufts.len())];
            site.put(
                tuft,
                [s, side * right, lift(s, side * right) - 0.05],
                rng.random_range(0.0..6.0),
                rng.random_range(0.6..1.3),
            );
        }
        let turn = if side > 0.0 { 0.0 } else { std::f64::consts::PI };
        if rail == 0 || (rail == 1 && side > 0.0) {
            for i in 0..10 {
                let s = range[0] + 2.0 + 4.0 * f64::from(i);
                site.put(&catalog.guard_rail, [s, side * (edge + 0.9), 0.0], turn, 1.0);
            }
        } else {
            site.put(&catalog.delineator, [range[0] + 8.0, side * (edge + 0.7), 0.0], turn, 1.0);
        }
        if rng.random_bool(0.15) {
            let sign = &catalog.signs[rng.random_range(0..catalog.signs.len())];
            site.put(sign, [range[0] + 21.0, side * (edge + 1.1), 0.0], turn, 1.0);
        }
    }
}

/// Posts with two wires along one side of the road, on some roads.
fn wires(site: &mut Site, edge: f64) {
    let own = hash(site.seed, &[0x74]);
    if own.is_multiple_of(3) {
        return;
    }
    let right = if own & 8 == 0 { edge + 3.2 } else { -edge - 3.2 };
    let catalog = site.catalog;
    let [from, to] = site.range;
    site.put(&catalog.wire_post, [from, right, 0.0], 0.0, 1.0);
    for beside in [-0.7, 0.7] {
        site.span(&catalog.wires[1], [from, to].map(|s| [s, right + beside, 7.7]));
    }
}

fn ground(site: &mut Site, range: [f64; 2], edge: f64, lift: &dyn Fn(f64, f64) -> f64) {
    let mut strips = vec![flat(-edge, edge, 0.0, ASPHALT)];
    site.ground(range, 2.0, &strips, &level, SegmentClass::Road);
    strips.clear();
    for side in [-1.0, 1.0] {
        let line: [(f64, f64, u16); 7] = [
            (edge, -0.01, GRAVEL),
            (edge + 0.7, -0.06, GRASS),
            (edge + 1.6, -0.30, GRASS),
            (edge + 2.6, -0.05, SOIL),
            (edge + 9.0, 0.4, SOIL),
            (edge + 24.0, 0.8, SOIL),
            (edge + 60.0, 1.0, SOIL),
        ];
        for pair in line.windows(2) {
            let [(a, up, material), (b, next, _)] = [pair[0], pair[1]];
            strips.push(Strip { from: [side * a, up], to: [side * b, next], material });
        }
    }
    site.ground(range, 4.0, &strips, lift, SegmentClass::Terrain);
}

fn markings(site: &mut Site, range: [f64; 2], edge: f64) {
    let mut rng = site.random(0x11);
    for dash in dashes(range, 4.0, 12.0) {
        site.ground(dash, 2.0, &[flat(-0.06, 0.06, 0.008, PAINT)], &level, SegmentClass::Road);
    }
    let at = edge - 0.25;
    let lines =
        [flat(-at - 0.06, -at + 0.06, 0.008, PAINT), flat(at - 0.06, at + 0.06, 0.008, PAINT)];
    site.ground(range, 2.0, &lines, &level, SegmentClass::Road);
    if rng.random_bool(0.5) {
        let s = rng.random_range(range[0]..range[1] - 9.0);
        let right = if rng.random_bool(0.5) { 0.3 } else { -2.9 };
        site.ground(
            [s, s + rng.random_range(3.0..9.0)],
            2.0,
            &[flat(right, right + 2.5, 0.004, PATCH)],
            &level,
            SegmentClass::Road,
        );
    }
}
