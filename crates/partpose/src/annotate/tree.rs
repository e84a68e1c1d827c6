//! Nearest neighbours among points with normals.
//!
//! A k-d tree over six coordinates: the position and the normal times a length. Bentley: *Multidimensional binary
//! search trees used for associative searching*, CACM 1975.

use crate::geometry::{Point3, Vector3};

/// Position and scaled normal.
pub(super) type Key = [f64; 6];

/// Points to a leaf.
const LEAF: usize = 8;

/// The key of a point whose normal counts as much as `reach` metres a unit.
pub(super) fn key(point: &Point3, normal: &Vector3, reach: f64) -> Key {
    [point.x, point.y, point.z, reach * normal.x, reach * normal.y, reach * normal.z]
}

/// The tree; its nodes are ranges of `order`, halved at the median.
pub(super) struct Tree {
    keys: Vec<Key>,
    /// Index of each key in the list that the tree was made of.
    order: Vec<u32>,
    /// Axis that each inner node divides, by the order of visits (a heap).
    axes: Vec<(u8, f64)>,
}

impl Tree {
    pub(super) fn new(keys: &[Key]) -> Self {
        let mut order: Vec<u32> = (0..keys.len() as u32).collect();
        let mut axes = Vec::new();
        build(keys, &mut order, 0, &mut axes);
        let keys = order.iter().map(|index| keys[*index as usize]).collect();
        Self { keys, order, axes }
    }

    /// The nearest keys as (squared distance, index), nearest first, at most `count`.
    pub(super) fn nearest(&self, query: &Key, count: usize, found: &mut Vec<(f64, u32)>) {
        found.clear();
        if count > 0 {
            self.search(query, count, 0, 0..self.keys.len(), found);
        }
    }

    fn search(
        &self,
        query: &Key,
        count: usize,
        node: usize,
        range: std::ops::Range<usize>,
        found: &mut Vec<(f64, u32)>,
    ) {
        if range.len() <= LEAF {
            for i in range {
                let square: f64 =
                    self.keys[i].iter().zip(query).map(|(a, b)| (a - b) * (a - b)).sum();
                let entry = (square, self.order[i]);
                if found.len() < count || square < found[found.len() - 1].0 {
                    let at = found.partition_point(|other| *other <= entry);
                    found.insert(at, entry);
                    found.truncate(count);
                }
            }
            return;
        }
        let middle = range.start + range.len() / 2;
        let (axis, split) = self.axes[node];
        let gap = query[usize::from(axis)] - split;
        let halves = [(2 * node + 1, range.start..middle), (2 * node + 2, middle..range.end)];
        let first = usize::from(gap > 0.0);
        let (child, part) = halves[first].clone();
        self.search(query, count, child, part, found);
        if found.len() < count || gap * gap < found[found.len() - 1].0 {
            let (child, part) = halves[1 - first].clone();
            self.search(query, count, child, part, found);
        }
    }
}

fn build(keys: &[Key], order: &mut [u32], node: usize, axes: &mut Vec<(u8, f64)>) {
    if order.len() <= LEAF {
        return;
    }
    let spread = |axis: usize| {
        let values = order.iter().map(|index| keys[*index as usize][axis]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        high - low
    };
    let spreads: [f64; 6] = std::array::from_fn(spread);
    let axis = (0..6).max_by(|a, b| spreads[*a].total_cmp(&spreads[*b])).unwrap_or(0);
    let middle = order.len() / 2;
    let value = |index: u32| keys[index as usize][axis];
    order.select_nth_unstable_by(middle, |a, b| value(*a).total_cmp(&value(*b)).then(a.cmp(b)));
    if axes.len() <= node {
        axes.resize(node + 1, (0, 0.0));
    }
    // By value: the halves are put into another order below.
    axes[node] = (axis as u8, value(order[middle]));
    let (left, right) = order.split_at_mut(middle);
    build(keys, left, 2 * node + 1, axes);
    build(keys, right, 2 * node + 2, axes);
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_tree_finds_what_a_search_through_all_finds() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut random = || -> Key { std::array::from_fn(|_| rng.random_range(-1.0..1.0)) };
        let keys: Vec<Key> = (0..700).map(|_| random()).collect();
        let tree = Tree::new(&keys);
        let mut found = Vec::new();
        for _ in 0..50 {
            let query = random();
            tree.nearest(&query, 5, &mut found);
            let square =
                |key: &Key| key.iter().zip(&query).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            let mut all: Vec<f64> = keys.iter().map(square).collect();
            all.sort_by(f64::total_cmp);
            let squares: Vec<f64> = found.iter().map(|(square, _)| *square).collect();
            assert_eq!(squares, all[..5]);
        }
        Tree::new(&[]).nearest(&[0.0; 6], 3, &mut found);
        assert!(found.is_empty());
    }
}
