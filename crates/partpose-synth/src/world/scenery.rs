//! Everything that stands still, in pieces that are made when the camera comes near.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::catalog::Catalog;
use super::plan::{CROSSING, Plan, SceneKind};
use super::replay::Layout;
use super::site::{PIECE, Site};
use super::stuff::Prop;
use super::{crossroads, forest, motorway, urban};
use crate::scene::Object;

/// How far ahead and behind pieces are shown, metres.
const AHEAD: f64 = 260.0;
const BEHIND: f64 = 50.0;
/// Most pieces that are kept.
const KEPT: usize = 64;

/// The furniture of a world.
#[derive(Debug)]
pub(crate) struct Scenery {
    kind: SceneKind,
    seed: u64,
    catalog: Catalog,
    /// Free width beside the path at every piece, where a layout needs it.
    clear: Option<Vec<f64>>,
    /// Pieces by path and number. Whether one is found here or made anew changes nothing but the time it takes.
    pieces: Mutex<BTreeMap<(usize, i64), Arc<Vec<Object>>>>,
}

impl Scenery {
    pub(crate) fn new(kind: SceneKind, seed: u64) -> Self {
        let catalog = Catalog::new(seed);
        Self { kind, seed, catalog, clear: None, pieces: Mutex::default() }
    }

    /// Scenery that leaves room for the vehicles of a layout.
    pub(crate) fn around(kind: SceneKind, seed: u64, layout: &Layout) -> Self {
        Self { clear: Some(layout.clearances(PIECE)), ..Self::new(kind, seed) }
    }

    pub(crate) fn kind(&self) -> SceneKind {
        self.kind
    }

    pub(crate) fn catalog(&self) -> &Catalog {
        &self.catalog
    }

    pub(crate) fn heavies(&self) -> &[Prop] {
        &self.catalog.heavies
    }

    /// From where to where the pavements reach, metres from the path.
    pub(crate) fn pavement(&self) -> Option<(f64, f64)> {
        let profile = match self.kind {
            SceneKind::Urban => urban::profile(0.0),
            SceneKind::Intersection => crossroads::main_profile(),
            SceneKind::Forest | SceneKind::Highway => return None,
        };
        Some((profile.kerb, profile.front))
    }

    /// Whether there is no pavement at a place, since a road crosses.
    pub(crate) fn is_open(&self, s: f64) -> bool {
        self.kind == SceneKind::Intersection && (s - CROSSING).abs() < 9.0
    }

    /// All pieces near a place of the camera's path.
    pub(crate) fn around_place(&self, plan: &Plan, own: f64) -> Vec<Object> {
        let first = ((own - BEHIND) / PIECE).floor() as i64;
        let last = ((own + AHEAD) / PIECE).floor() as i64;
        let mut wanted: Vec<(usize, i64)> = (first..=last).map(|number| (0, number)).collect();
        if self.kind == SceneKind::Intersection && self.clear.is_none() {
            wanted.extend((-3..3).map(|number| (1, number)));
        }
        let mut objects = Vec::new();
        for key in wanted {
            objects.extend(self.piece(plan, key).iter().cloned());
        }
        objects
    }

    fn piece(&self, plan: &Plan, key: (usize, i64)) -> Arc<Vec<Object>> {
        let locked = || self.pieces.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(piece) = locked().get(&key) {
            return piece.clone();
        }
        let piece = Arc::new(self.furnish(plan, key));
        let mut pieces = locked();
        while pieces.len() >= KEPT {
            // The smallest number is the one farthest behind.
            pieces.pop_first();
        }
        pieces.insert(key, piece.clone());
        piece
    }

    fn furnish(&self, plan: &Plan, (path, number): (usize, i64)) -> Vec<Object> {
        let start = number as f64 * PIECE;
        let mut site = Site {
            path: &plan.paths[path],
            catalog: &self.catalog,
            seed: super::random::hash(self.seed, &[0x517e, path as i64]),
            range: [start, start + PIECE],
            objects: Vec::new(),
        };
        let clear = self.clear(number);
        match (self.kind, path) {
            (SceneKind::Urban, _) => {
                urban::furnish(&mut site, urban::profile(clear), self.clear.is_none());
            }
            (SceneKind::Intersection, _) if self.clear.is_some() => {
                urban::furnish(&mut site, urban::profile(clear), false);
            }
            (SceneKind::Intersection, 0) => crossroads::furnish_main(&mut site),
            (SceneKind::Intersection, _) => crossroads::furnish_cross(&mut site, &plan.paths[path]),
            (SceneKind::Forest, _) => forest::furnish(&mut site, clear),
            (SceneKind::Highway, _) => motorway::furnish(&mut site),
        }
        site.objects
    }

    /// Metres beside the path that must stay free at a piece.
    fn clear(&self, number: i64) -> f64 {
        let Some(clear) = &self.clear else { return 0.0 };
        let at = number.clamp(0, clear.len() as i64 - 1) as usize;
        clear.get(at).copied().unwrap_or(0.0)
    }
}
