//! Who is about: candidates for a frame, and people on pavements and crossings.

use nalgebra::Translation3;

use super::crossroads;
use super::fleet::Vehicle;
use super::plan::{Plan, SceneKind};
use super::random::{hash, unit};
use super::scenery::Scenery;
use super::site::upright;
use super::traffic::Place;
use crate::scene::Object;

/// Somebody who may be seen in a frame.
#[derive(Clone, Debug)]
pub(crate) enum Candidate {
    /// A vehicle with part labels.
    Vehicle { vehicle: Vehicle, place: Place, track: u32 },
    /// Anything else that moves.
    Other(Object),
}

/// Distance of walkers on a pavement in the mean, metres.
const APART: f64 = 14.0;
/// How far ahead people are shown, metres.
const AHEAD: f64 = 90.0;

/// People on the pavements beside the camera's road, cyclists at its edge, people who cross before the camera.
pub(crate) fn walkers(
    plan: &Plan,
    scenery: &Scenery,
    seed: u64,
    own: f64,
    time: f64,
) -> Vec<Object> {
    let mut people = Vec::new();
    let path = &plan.paths[0];
    let Some((edge, front)) = scenery.pavement() else { return people };
    let catalog = scenery.catalog();
    for (line, side, way) in [(0_i64, -1.0, -1.0), (1, -1.0, 1.0), (2, 1.0, 1.0), (3, 1.0, -1.0)] {
        // Everybody walks at the pace of the line, at a place that is a little theirs.
        let pace = way * (1.15 + 0.3 * unit(seed, &[0x3a1, line]));
        let first = ((own - 15.0 - pace * time) / APART).floor() as i64;
        let last = ((own + AHEAD - pace * time) / APART).ceil() as i64;
        for index in first..=last {
            let own = |what: i64| unit(seed, &[what, line, index]);
            if own(0x3a2) < 0.45 {
                continue;
            }
            let s = (index as f64 + 0.8 * own(0x3a3)) * APART + pace * time;
            let right = side * (edge + 0.8 + (front - edge - 1.4) * own(0x3a4));
            if scenery.is_open(s) {
                continue;
            }
            let prop =
                &catalog.people[hash(seed, &[0x3a5, line, index]) as usize % catalog.people.len()];
            let turn =
                if way > 0.0 { 0.0 } else { std::f64::consts::PI } + 0.4 * (own(0x3a6) - 0.5);
            let scale = 0.92 + 0.13 * own(0x3a7);
            let pose = upright(&path.beside(s, right), crossroads::pavement_height(), turn);
            people.push(prop.object(pose, nalgebra::Vector3::new(scale, scale, scale)));
        }
    }
    if scenery.kind() == SceneKind::Intersection {
        people.extend(crossing(plan, scenery, seed, time));
    } else {
        people.extend(cyclists(plan, scenery, seed, own, time));
    }
    people
}

/// Cyclists between the lane and what is parked.
fn cyclists(plan: &Plan, scenery: &Scenery, seed: u64, own: f64, time: f64) -> Vec<Object> {
    let catalog = scenery.catalog();
    let (apart, pace) = (55.0, 4.6);
    let first = ((own + 3.0 - pace * time) / apart).floor() as i64;
    let last = ((own + AHEAD - pace * time) / apart).ceil() as i64;
    let mut found = Vec::new();
    for index in first..=last {
        if unit(seed, &[0xb1c, index]) < 0.4 {
            continue;
        }
        let s = (index as f64 + 0.7 * unit(seed, &[0xb1d, index])) * apart + pace * time;
        if s < own + 4.0 {
            continue;
        }
        let prop = &catalog.cyclists[hash(seed, &[0xb1e, index]) as usize % catalog.cyclists.len()];
        let pose = plan.paths[0].beside(s, 2.75 + 0.1 * (time + index as f64).sin());
        found.push(prop.at(upright(&pose, 0.0, 0.0)));
    }
    found
}

/// People on the zebra, and cyclists who cross farther away.
fn crossing(plan: &Plan, scenery: &Scenery, seed: u64, time: f64) -> Vec<Object> {
    let catalog = scenery.catalog();
    let [s, half] = crossroads::ZEBRA;
    let span = 2.0 * half + 30.0;
    let mut found = Vec::new();
    for index in 0..7_i64 {
        let own = |what: i64| unit(seed, &[what, index]);
        let way = if index % 2 == 0 { 1.0 } else { -1.0 };
        let rides = index == 6;
        let pace = if rides { 3.5 } else { 1.1 + 0.4 * own(0x2e1) };
        let at = (pace * time + span * own(0x2e2)).rem_euclid(span) - 0.5 * span;
        let (props, ahead) = if rides {
            (&catalog.cyclists, s + 5.0)
        } else {
            (&catalog.people, s + 1.8 * (own(0x2e3) - 0.5))
        };
        let prop = &props[hash(seed, &[0x2e4, index]) as usize % props.len()];
        let place = plan.paths[0].pose(0.0) * Translation3::new(way * at, 0.0, ahead);
        let up = if at.abs() > half { crossroads::pavement_height() } else { 0.0 };
        found.push(prop.at(upright(&place, up, way * std::f64::consts::FRAC_PI_2)));
    }
    found
}
