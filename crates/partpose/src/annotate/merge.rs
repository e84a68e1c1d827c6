//! As few triangles as the seams allow.
//!
//! Labels are found on triangles of a few centimetres, most of which agree with all of their face. The mesh is cut
//! again, this time only where a triangle holds more than one part, so that a roof of two triangles stays one.

use crate::parts::{PartClass, PartMap};
use crate::vehicle::PartialModel;

use super::Transfer;
use super::outside::Seen;
use super::shape::GRAIN;
use super::surface::Surface;

/// Rounds of halving; enough for faces of any size.
const ROUNDS: usize = 17;

/// The mesh, cut where seams are.
pub(super) struct Merged {
    pub(super) surface: Surface,
    pub(super) parts: Vec<PartClass>,
    pub(super) confidence: Vec<f32>,
    /// Whether a face can be seen from nowhere.
    pub(super) hidden: Vec<bool>,
}

/// What the small triangles in a larger one say.
#[derive(Clone)]
struct Content {
    areas: PartMap<f64>,
    hidden: f64,
    sure: f64,
    total: f64,
}

pub(super) fn merged(partial: &PartialModel, transfer: &Transfer) -> Merged {
    let mut surface = Surface::welded(&partial.vertices, &partial.faces, &partial.parts);
    let mut small: Vec<Vec<u32>> = vec![Vec::new(); partial.faces.len()];
    for (i, origin) in transfer.surface.origins.iter().enumerate() {
        small[*origin as usize].push(i as u32);
    }
    let mut contents = contents(&surface, transfer, &small);
    for _ in 0..ROUNDS {
        let is_mixed = |i: usize| {
            let Content { areas, hidden, total, .. } = &contents[i];
            let share = hidden / total.max(1e-12);
            areas.len() > 1 || (0.02..0.98).contains(&share)
        };
        let wanted: Vec<bool> = (0..contents.len()).map(is_mixed).collect();
        if !surface.halve(GRAIN, &|i| wanted[i]) {
            break;
        }
        contents = self::contents(&surface, transfer, &small);
    }
    let most = |content: &Content| {
        let best = content.areas.iter().max_by(|a, b| a.1.total_cmp(b.1).then(b.0.cmp(&a.0)));
        best.map_or(PartClass::SideLeft, |(part, _)| part)
    };
    Merged {
        parts: contents.iter().map(most).collect(),
        confidence: contents.iter().map(|c| (c.sure / c.total.max(1e-12)) as f32).collect(),
        hidden: contents.iter().map(|c| c.hidden > 0.5 * c.total).collect(),
        surface,
    }
}

/// For each triangle what the small ones say whose middles lie in it, or else the nearest one of the same face.
fn contents(surface: &Surface, transfer: &Transfer, small: &[Vec<u32>]) -> Vec<Content> {
    let content = |i: usize| {
        let candidates = &small[surface.origins[i] as usize];
        let [a, b, c] = surface.corners(i);
        let normal = surface.cross(i);
        let is_inside = |index: &&u32| {
            let p = transfer.surface.center(**index as usize);
            [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(from, to)| (to - from).cross(&(p - from)).dot(&normal) >= 0.0)
        };
        let mut sum = Content { areas: PartMap::default(), hidden: 0.0, sure: 0.0, total: 0.0 };
        let mut add = |index: u32| {
            let k = index as usize;
            let area = transfer.surface.area(k).max(1e-15);
            let part = transfer.parts[k];
            let before = sum.areas.get(part).copied().unwrap_or(0.0);
            sum.areas.insert(part, before + area);
            sum.total += area;
            sum.sure += area * f64::from(transfer.confidence[k]);
            sum.hidden += if transfer.seen[k] == Seen::Hidden { area } else { 0.0 };
        };
        let inside: Vec<u32> = candidates.iter().filter(is_inside).copied().collect();
        if inside.is_empty() {
            let middle = surface.center(i);
            let away = |index: &u32| (transfer.surface.center(*index as usize) - middle).norm();
            let nearest = candidates.iter().min_by(|p, q| away(p).total_cmp(&away(q)));
            nearest.copied().into_iter().for_each(&mut add);
        } else {
            inside.into_iter().for_each(&mut add);
        }
        sum
    };
    (0..surface.faces.len()).map(content).collect()
}
