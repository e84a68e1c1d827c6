//! Two streets of a town that cross, with traffic lights, seen from the one that waits.

use std::f64::consts::PI;

use rand::RngExt;

use super::path::Path;
use super::plan::{CROSSING, LANE};
use super::site::{ASPHALT, PAINT, Site, level};
use super::street::flat;
use super::urban::{
    self, KERB_HEIGHT, Profile, carriageway, pavement_things, pavements, rows_of_houses,
};
use crate::scene::SegmentClass;

/// The camera's street.
const MAIN: Profile = Profile { kerb: 2.0 * LANE + 2.3, front: 2.0 * LANE + 6.0 };
/// The one that crosses it.
const CROSS: Profile = Profile { kerb: 2.0 * LANE + 0.4, front: 2.0 * LANE + 4.2 };

/// Furnishes a piece of the camera's street.
pub(crate) fn furnish_main(site: &mut Site) {
    let mouth = [CROSSING - CROSS.kerb, CROSSING + CROSS.kerb];
    let corner = [CROSSING - CROSS.front - 1.0, CROSSING + CROSS.front + 1.0];
    let range = site.range;
    carriageway(site, range, MAIN.kerb);
    for stretch in site.outside(mouth) {
        pavements(site, stretch, MAIN);
        lane_lines(site, stretch, [CROSSING - CROSS.kerb - 4.5, CROSSING + CROSS.kerb + 4.5]);
    }
    for stretch in site.outside(corner) {
        rows_of_houses(site, stretch, MAIN, &[-1.0, 1.0]);
        pavement_things(site, stretch, MAIN);
    }
    for (at, from, to) in [
        (CROSSING - CROSS.kerb - 4.2, 0.0, MAIN.kerb),
        (CROSSING + CROSS.kerb + 4.0, -MAIN.kerb, 0.0),
    ] {
        if (range[0]..range[1]).contains(&at) {
            // The line to stop at, and the zebra before it.
            site.ground(
                [at - 0.4, at],
                1.0,
                &[flat(from, to, 0.008, PAINT)],
                &level,
                SegmentClass::Road,
            );
        }
    }
    for at in [CROSSING - CROSS.kerb - 3.4, CROSSING + CROSS.kerb + 0.6] {
        if (range[0]..range[1]).contains(&at) {
            let bars = (0..(2.0 * MAIN.kerb) as i32).map(|i| {
                let from = -MAIN.kerb + 0.4 + f64::from(i);
                flat(from, from + 0.5, 0.008, PAINT)
            });
            let bars: Vec<_> = bars.collect();
            site.ground([at, at + 2.8], 3.0, &bars, &level, SegmentClass::Road);
        }
    }
    lights(site);
}

/// Furnishes a piece of the crossing street, whose own path is the site's.
pub(crate) fn furnish_cross(site: &mut Site, path: &Path) {
    let middle = 0.0;
    debug_assert!(path.range()[0] < middle);
    let mouth = [-MAIN.kerb, MAIN.kerb];
    let corner = [-MAIN.front - 14.0, MAIN.front + 14.0];
    for stretch in site.outside(mouth) {
        site.ground(
            stretch,
            8.0,
            &[flat(-CROSS.kerb, CROSS.kerb, -0.002, ASPHALT)],
            &level,
            SegmentClass::Road,
        );
        pavements(site, stretch, CROSS);
        lane_lines(site, stretch, mouth);
    }
    for stretch in site.outside(corner) {
        rows_of_houses(site, stretch, CROSS, &[-1.0, 1.0]);
        pavement_things(site, stretch, CROSS);
    }
}

fn lane_lines(site: &mut Site, stretch: [f64; 2], gap: [f64; 2]) {
    let lines: Vec<[f64; 2]> =
        [[stretch[0], stretch[1].min(gap[0])], [stretch[0].max(gap[1]), stretch[1]]]
            .into_iter()
            .filter(|[a, b]| b - a > 0.1)
            .collect();
    for line in lines {
        site.ground(
            line,
            8.0,
            &[flat(-0.14, -0.04, 0.008, PAINT), flat(0.04, 0.14, 0.008, PAINT)],
            &level,
            SegmentClass::Road,
        );
        for at in [-LANE, LANE] {
            for dash in super::street::dashes(line, 2.0, 5.0) {
                site.ground(
                    dash,
                    3.0,
                    &[flat(at - 0.06, at + 0.06, 0.008, PAINT)],
                    &level,
                    SegmentClass::Road,
                );
            }
        }
    }
}

fn lights(site: &mut Site) {
    let mut rng = site.random(0x50);
    let catalog = site.catalog;
    let [red, green, red_arm, _] = &catalog.lights;
    let side = MAIN.kerb + 0.6;
    let near = CROSSING - CROSS.kerb - 1.2;
    let far = CROSSING + CROSS.kerb + 1.2;
    let mut put = |prop, s: f64, right: f64, turn: f64| {
        if (site.range[0]..site.range[1]).contains(&s) {
            site.put(prop, [s, right, KERB_HEIGHT], turn, 1.0);
        }
    };
    // For the camera's street red, for the other green.
    put(red_arm, far, side, 0.0);
    put(red, near, side, 0.0);
    put(red, far + 0.5, -side, PI);
    put(green, near - 0.5, -side, 0.5 * PI);
    put(green, far - 0.5, side, -0.5 * PI);
    put(&catalog.signs[rng.random_range(0..7)], near - 3.0, side, 0.0);
    put(&catalog.signs[4], far + 2.0, side, 0.0);
}

/// Where people cross: metres along the camera's street and the width of it.
pub(crate) const ZEBRA: [f64; 2] = [CROSSING - CROSS.kerb - 2.0, MAIN.kerb];

/// The profile that walkers keep to.
pub(crate) fn main_profile() -> Profile {
    MAIN
}

/// Height of the pavement.
pub(crate) fn pavement_height() -> f64 {
    urban::KERB_HEIGHT
}
