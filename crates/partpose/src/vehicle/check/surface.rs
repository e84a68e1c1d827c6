//! Whether the mesh is a sound surface.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::geometry::Point3;
use crate::vehicle::PartialModel;
use crate::vehicle::place::pieces;

use super::{Finding, area, corners, middle};

/// Area below which a face has none, square metres: (1 um)^2.
const NO_AREA: f64 = 1e-12;
/// Share of the whole area below which a piece is small.
const SMALL: f64 = 1e-3;
/// How far from all larger pieces a small one must lie to be told, metres.
const FAR: f64 = 0.3;
/// Most pieces that small ones are compared with: the largest.
const MAX_COMPARED: usize = 200;

/// What is known of a connected piece.
#[derive(Clone)]
struct Piece {
    area: f64,
    /// Six times the volume inside, if it is closed.
    volume: f64,
    is_open: bool,
    low: Point3,
    high: Point3,
}

pub(super) fn check(model: &PartialModel, findings: &mut Vec<Finding>) {
    let faces = welded(model);
    let mut degenerate = Vec::new();
    let mut sound = Vec::new();
    for face in &faces {
        let [a, b, c] = *face;
        if a == b || b == c || c == a || area(corners(model, *face)) < NO_AREA {
            degenerate.push(*face);
        } else {
            sound.push(*face);
        }
    }
    let at = |face: &[u32; 3]| middle(corners(model, *face));
    if let Some(first) = degenerate.first() {
        let (count, of) = (degenerate.len(), faces.len());
        findings.push(Finding::Degenerate { count, of, at: at(first) });
    }
    let mut seen = BTreeSet::new();
    let turned_to_front = |face: &[u32; 3]| {
        let mut face = *face;
        let first = (0..3).min_by_key(|at| face[*at]).unwrap_or(0);
        face.rotate_left(first);
        face
    };
    let doubles: Vec<&[u32; 3]> =
        sound.iter().filter(|face| !seen.insert(turned_to_front(face))).collect();
    if let Some(first) = doubles.first() {
        findings.push(Finding::Duplicate { count: doubles.len(), at: at(first) });
    }
    // Slivers stay in: without them there would be holes.
    let topology: Vec<[u32; 3]> =
        faces.iter().copied().filter(|[a, b, c]| a != b && b != c && c != a).collect();
    let pieces = check_edges(model, &topology, findings);
    check_flecks(&pieces, findings);
}

/// Faces by the first vertex at each position.
fn welded(model: &PartialModel) -> Vec<[u32; 3]> {
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let weld = |at: u32| {
        let p = model.vertices[at as usize];
        let key = [p.x, p.y, p.z].map(|value| (value + 0.0).to_bits());
        *first.entry(key).or_insert(at)
    };
    let mut weld = weld;
    model.faces.iter().map(|face| face.map(&mut weld)).collect()
}

fn check_edges(
    model: &PartialModel,
    faces: &[[u32; 3]],
    findings: &mut Vec<Finding>,
) -> Vec<Piece> {
    let piece_of = pieces(&model.vertices, faces);
    let count = piece_of.iter().max().map_or(0, |last| last + 1);
    let far = Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY);
    let mut pieces =
        vec![Piece { area: 0.0, volume: 0.0, is_open: false, low: far, high: -far }; count];
    // Per edge: how often it is run along upwards and downwards, and a piece it is of.
    let mut edges: BTreeMap<[u32; 2], ([u32; 2], usize)> = BTreeMap::new();
    let center = model.extent.height * -0.5;
    for (face, piece) in faces.iter().zip(&piece_of) {
        let [a, b, c] = *face;
        for [from, to] in [[a, b], [b, c], [c, a]] {
            let edge = edges.entry([from.min(to), from.max(to)]).or_insert(([0, 0], *piece));
            edge.0[usize::from(from > to)] += 1;
        }
        let triangle = corners(model, *face);
        let piece = &mut pieces[*piece];
        piece.area += area(triangle);
        for p in &triangle {
            (piece.low, piece.high) = (piece.low.inf(p), piece.high.sup(p));
        }
        // Seen from the middle of the vehicle, so that the sum tells something of open pieces too.
        let [a, b, c] = triangle.map(|p| p - Point3::new(0.0, center, 0.0));
        piece.volume += a.dot(&b.cross(&c));
    }
    let (mut open_edges, mut non_manifold, mut unoriented) = (0, 0, 0);
    for ([up, down], piece) in edges.values() {
        match up + down {
            1 => {
                open_edges += 1;
                pieces[*piece].is_open = true;
            }
            2 if up != down => unoriented += 1,
            2 => {}
            _ => non_manifold += 1,
        }
    }
    if open_edges > 0 {
        let open = pieces.iter().filter(|piece| piece.is_open).count();
        findings.push(Finding::Open { open, pieces: pieces.len(), edges: open_edges });
    }
    if non_manifold > 0 {
        findings.push(Finding::NonManifold { edges: non_manifold });
    }
    if unoriented > 0 {
        findings.push(Finding::Unoriented { edges: unoriented });
    }
    let inside_out = pieces.iter().filter(|piece| !piece.is_open && piece.volume < 0.0).count();
    if pieces.iter().map(|piece| piece.volume).sum::<f64>() < 0.0 {
        findings.push(Finding::MostlyInsideOut);
    } else if inside_out > 0 {
        findings.push(Finding::InsideOut { pieces: inside_out });
    }
    pieces
}

fn check_flecks(pieces: &[Piece], findings: &mut Vec<Finding>) {
    let total: f64 = pieces.iter().map(|piece| piece.area).sum();
    let mut by_area: Vec<&Piece> = pieces.iter().collect();
    by_area.sort_by(|a, b| b.area.total_cmp(&a.area));
    let large = &by_area[..by_area.len().min(MAX_COMPARED)];
    let mut found: Option<(usize, f64, Point3)> = None;
    for (at, piece) in by_area.iter().enumerate().skip(1) {
        if piece.area > SMALL * total {
            continue;
        }
        let gaps = large.iter().take(at).map(|other| gap(piece, other));
        let distance = gaps.fold(f64::INFINITY, f64::min);
        if distance > FAR {
            let (count, least, place) =
                found.unwrap_or((0, f64::INFINITY, nalgebra::center(&piece.low, &piece.high)));
            found = Some((count + 1, least.min(distance), place));
        }
    }
    if let Some((count, distance, at)) = found {
        findings.push(Finding::Flecks { count, distance, at });
    }
}

/// Distance between the boxes of two pieces.
fn gap(a: &Piece, b: &Piece) -> f64 {
    let apart = |axis: usize| (a.low[axis] - b.high[axis]).max(b.low[axis] - a.high[axis]).max(0.0);
    apart(0).hypot(apart(1)).hypot(apart(2))
}
