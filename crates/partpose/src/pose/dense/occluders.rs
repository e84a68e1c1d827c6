//! What hides a vehicle without being labelled: poles, trees, people.
//!
//! Their pixels say background deep inside a vehicle whose outline and parts fit all around. Read as background they
//! pull the outline inwards; as unknown they do no harm. Only cells well inside the drawn model start a hidden region,
//! so that a model that is merely too large does not get rid of what contradicts it.

use super::raster::Raster;
use super::target::Target;

/// How far inside the drawn model a hidden region must begin: 1.5 cells of a 28-cell kernel on every side.
const DEPTH: f64 = 1.5 / 28.0;
/// How far a region reaches from where it began: to the outline and beyond.
const REACH: f64 = 3.0 / 28.0;
/// Largest share of the drawn model that may be taken for hidden.
pub(super) const MOST: f64 = 0.35;

/// What was taken for hidden.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Hidden {
    /// As a share of the drawn model.
    pub(super) share: f64,
    /// Weighted cells.
    pub(super) cells: f64,
}

/// Takes the weight of cells that something unlabelled hides, if they are at most the share `most` of the drawn model.
pub(super) fn hide(target: &mut Target, raster: &Raster, most: f64) -> Hidden {
    let m = target.cells;
    let s = raster.size / m;
    let is_drawn: Vec<bool> = (0..m * m)
        .map(|cell| {
            let start = (cell / m) * s * raster.size + (cell % m) * s;
            (0..s).all(|y| raster.labels[start + y * raster.size..][..s].iter().all(|l| *l != 0))
        })
        .collect();
    let drawn = is_drawn.iter().filter(|drawn| **drawn).count();
    let depth = (DEPTH * m as f64).round().max(1.0) as isize;
    let reach = (REACH * m as f64).round().max(1.0) as isize;
    let empty = |cell: usize| target.weights[cell] > 0.0 && target.probabilities[cell][0] > 0.5;
    let around = |cell: usize, far: isize| {
        let (x, y) = ((cell % m) as isize, (cell / m) as isize);
        let line = move |at: isize| at - far..=at + far;
        line(y).flat_map(move |y| line(x).map(move |x| (x, y)))
    };
    let inside = |(x, y): (isize, isize)| {
        // What lies beyond the box cannot contradict.
        let in_box = (0..m as isize).contains(&x) && (0..m as isize).contains(&y);
        !in_box || is_drawn[y as usize * m + x as usize]
    };
    let mut hidden = vec![false; m * m];
    for cell in 0..m * m {
        if is_drawn[cell] && empty(cell) && around(cell, depth).all(inside) {
            hidden[cell] = true;
        }
    }
    for _ in 0..reach {
        let before = hidden.clone();
        for cell in 0..m * m {
            let touches = |(x, y): (isize, isize)| {
                let in_box = (0..m as isize).contains(&x) && (0..m as isize).contains(&y);
                in_box && before[y as usize * m + x as usize]
            };
            // Cells that are hidden in part say less than they seem to, too.
            let is_part = target.probabilities[cell][0] > 0.1;
            if !before[cell] && is_part && around(cell, 1).any(touches) {
                hidden[cell] = true;
            }
        }
    }
    let count = (0..m * m).filter(|cell| hidden[*cell] && is_drawn[*cell]).count();
    let share = count as f64 / drawn.max(1) as f64;
    if share == 0.0 || share > most {
        return Hidden::default();
    }
    let mut cells = 0.0;
    for (weight, hidden) in target.weights.iter_mut().zip(hidden) {
        if hidden {
            cells += f64::from(*weight);
            *weight = 0.0;
        }
    }
    Hidden { share, cells }
}
