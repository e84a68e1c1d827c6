//! The assignment of rows to columns with the lowest sum of costs.
//!
//! Kuhn: *The Hungarian Method for the Assignment Problem*, Naval Research Logistics 1955, in the form with potentials
//! and shortest augmenting paths, O(rows² columns).

/// The column of each row, `None` where it stays without. `cost` is `None` for pairs that are not allowed; allowed costs
/// lie between 0 and 1e3. A row without a column costs `alone`.
pub(super) fn assign(
    rows: usize,
    columns: usize,
    alone: f64,
    cost: &dyn Fn(usize, usize) -> Option<f64>,
) -> Vec<Option<usize>> {
    /// Dearer than any sum of allowed costs.
    const FORBIDDEN: f64 = 1e9;
    // A column of its own for each row, to stay without.
    let all = columns + rows;
    let table: Vec<Vec<f64>> = (0..rows)
        .map(|row| {
            let real = (0..columns).map(|column| cost(row, column).unwrap_or(FORBIDDEN));
            real.chain((0..rows).map(|own| if own == row { alone } else { FORBIDDEN })).collect()
        })
        .collect();
    // Rows and columns are counted from 1; column 0 stands for the row that looks for one.
    let (mut row_potential, mut column_potential) = (vec![0.0; rows + 1], vec![0.0; all + 1]);
    let mut row_of = vec![0usize; all + 1];
    for row in 1..=rows {
        row_of[0] = row;
        let mut column = 0;
        let (mut least, mut before) = (vec![f64::INFINITY; all + 1], vec![0usize; all + 1]);
        let mut used = vec![false; all + 1];
        while row_of[column] != 0 {
            used[column] = true;
            let (here, mut delta, mut next) = (row_of[column], f64::INFINITY, 0);
            for j in 1..=all {
                if used[j] {
                    continue;
                }
                let reduced = table[here - 1][j - 1] - row_potential[here] - column_potential[j];
                if reduced < least[j] {
                    least[j] = reduced;
                    before[j] = column;
                }
                if least[j] < delta {
                    delta = least[j];
                    next = j;
                }
            }
            for j in 0..=all {
                if used[j] {
                    row_potential[row_of[j]] += delta;
                    column_potential[j] -= delta;
                } else {
                    least[j] -= delta;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
    }
    let mut assigned = vec![None; rows];
    for column in 1..=columns {
        if row_of[column] > 0 {
            let row = row_of[column] - 1;
            assigned[row] = cost(row, column - 1).map(|_| column - 1);
        }
    }
    assigned
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The least sum by trying all.
    fn best(costs: &[Vec<Option<f64>>], row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == costs.len() {
            return 0.0;
        }
        let mut found = 1.5 + best(costs, row + 1, taken);
        for column in 0..taken.len() {
            let Some(cost) = costs[row][column] else { continue };
            if !taken[column] {
                taken[column] = true;
                found = found.min(cost + best(costs, row + 1, taken));
                taken[column] = false;
            }
        }
        found
    }

    proptest! {
        #[test]
        fn no_assignment_is_better(
            (columns, costs) in (0usize..5).prop_flat_map(|columns| {
                let row = proptest::collection::vec(proptest::option::of(0.0..2.0f64), columns);
                (Just(columns), proptest::collection::vec(row, 0..5))
            })
        ) {
            let found = assign(costs.len(), columns, 1.5, &|row, column| costs[row][column]);
            let sum: f64 = (0..costs.len())
                .map(|row| found[row].and_then(|column| costs[row][column]).unwrap_or(1.5))
                .sum();
            let count = found.iter().flatten().count();
            let least = best(&costs, 0, &mut vec![false; columns]);
            prop_assert!((sum - least).abs() < 1e-6, "{} {}", sum, least);
            let mut columns: Vec<usize> = found.into_iter().flatten().collect();
            columns.sort_unstable();
            columns.dedup();
            prop_assert_eq!(columns.len(), count);
        }
    }
}
