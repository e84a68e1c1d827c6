//! The betas of EPnP: weights of the null vectors such that control points keep their distances.

use crate::pnp::linalg::solve_positive;
use crate::pnp::linear::Nine;

/// Steps of Gauss-Newton; 5 to 8 are usual.
const MAX_STEPS: usize = 12;
/// Relative change of the betas at which Gauss-Newton has converged.
const CONVERGED: f64 = 1e-7;
/// Pairs of control points: axis a and axis b, or the centroid where b is 3.
const PAIRS: [(usize, usize); 6] = [(0, 3), (1, 3), (0, 1), (2, 3), (0, 2), (1, 2)];
/// Products of two of up to four betas, in the order of the columns of the linear systems.
const PRODUCTS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2), (0, 3), (1, 3), (2, 3), (3, 3)];

/// The distance constraints in terms of products of betas: `K` null vectors, `D` distances.
pub(super) struct Distances<const K: usize, const D: usize> {
    /// Coefficients of the products, off-diagonal ones doubled.
    coefficients: [[f64; 10]; D],
    /// Squared distances between control points in the object.
    squared: [f64; D],
    /// The betas of case N = 1 need plain lengths: sum of products of lengths, sum of squared lengths.
    lengths: [f64; 2],
}

impl<const K: usize, const D: usize> Distances<K, D> {
    /// From the null vectors (control points relative to the centroid) and the control points' distances from it.
    pub(super) fn new(vectors: &[Nine; K], scales: &[f64; 3]) -> Self {
        let mut coefficients = [[0.0; 10]; D];
        let mut squared = [0.0; D];
        let mut lengths = [0.0; 2];
        for (row, &(a, b)) in PAIRS.iter().take(D).enumerate() {
            let difference = vectors.map(|v| {
                let mut d = [v[3 * a], v[3 * a + 1], v[3 * a + 2]];
                if b < 3 {
                    for c in 0..3 {
                        d[c] -= v[3 * b + c];
                    }
                }
                d
            });
            for (column, &(k, l)) in PRODUCTS.iter().enumerate() {
                if l < K {
                    let (x, y) = (&difference[k], &difference[l]);
                    let dot = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
                    coefficients[row][column] = if k == l { dot } else { 2.0 * dot };
                }
            }
            squared[row] = scales[a] * scales[a];
            if b < 3 {
                squared[row] += scales[b] * scales[b];
            }
            let length2 = coefficients[row][0];
            lengths[0] += (length2 * squared[row]).sqrt();
            lengths[1] += length2;
        }
        Self { coefficients, squared, lengths }
    }

    /// Minimises the squared errors of the squared distances, damped after Levenberg.
    pub(super) fn gauss_newton(&self, start: [f64; K]) -> [f64; K] {
        let mut betas = start;
        let (mut errors, mut cost) = self.errors(&betas);
        let mut damping = 1e-6;
        let mut system = self.normal_equations(&betas, &errors);
        for _ in 0..MAX_STEPS {
            let mut matrix = system.0;
            for (k, row) in matrix.iter_mut().enumerate() {
                row[k] += damping * (row[k] + 1e-12);
            }
            let Some(step) = solve_positive(&matrix, &system.1) else {
                damping *= 100.0;
                continue;
            };
            let next: [f64; K] = std::array::from_fn(|k| betas[k] - step[k]);
            let (next_errors, next_cost) = self.errors(&next);
            if next_cost < cost {
                let size = |b: &[f64; K]| b.iter().map(|x| x * x).sum::<f64>();
                let done = size(&step) < CONVERGED * CONVERGED * size(&next);
                (betas, errors, cost) = (next, next_errors, next_cost);
                if done {
                    break;
                }
                damping *= 0.1;
                system = self.normal_equations(&betas, &errors);
            } else {
                if damping > 1e3 || next_cost <= cost * (1.0 + 1e-9) {
                    break;
                }
                damping = (damping * 30.0).max(1e-6);
            }
        }
        betas
    }

    fn errors(&self, betas: &[f64; K]) -> ([f64; D], f64) {
        let mut products = [0.0; 10];
        for (product, &(k, l)) in products.iter_mut().zip(&PRODUCTS) {
            if l < K {
                *product = betas[k] * betas[l];
            }
        }
        let mut errors = [0.0; D];
        let mut cost = 0.0;
        for (row, error) in errors.iter_mut().enumerate() {
            let mut sum = -self.squared[row];
            for (coefficient, product) in self.coefficients[row].iter().zip(&products) {
                sum += coefficient * product;
            }
            *error = sum;
            cost += sum * sum;
        }
        (errors, cost)
    }

    fn normal_equations(&self, betas: &[f64; K], errors: &[f64; D]) -> ([[f64; K]; K], [f64; K]) {
        let mut matrix = [[0.0; K]; K];
        let mut right = [0.0; K];
        for row in 0..D {
            let mut slope = [0.0; K];
            for (coefficient, &(k, l)) in self.coefficients[row].iter().zip(&PRODUCTS) {
                if l < K {
                    slope[k] += coefficient * betas[l];
                    slope[l] += coefficient * betas[k];
                }
            }
            for k in 0..K {
                right[k] += slope[k] * errors[row];
                for l in 0..=k {
                    matrix[k][l] += slope[k] * slope[l];
                }
            }
        }
        (matrix, right)
    }

    /// Case N = 1, in closed form.
    fn one(&self) -> Option<[f64; K]> {
        let mut betas = [0.0; K];
        betas[0] = self.lengths[0] / self.lengths[1];
        (betas[0].is_finite() && betas[0] > 0.0).then_some(betas)
    }

    /// Products in the given columns by least squares, all others taken as zero.
    fn products<const C: usize>(&self, columns: [usize; C]) -> Option<[f64; 10]> {
        let mut matrix = [[0.0; C]; C];
        let mut right = [0.0; C];
        for row in 0..D {
            let entries = columns.map(|column| self.coefficients[row][column]);
            for i in 0..C {
                right[i] += entries[i] * self.squared[row];
                for j in 0..=i {
                    matrix[i][j] += entries[i] * entries[j];
                }
            }
        }
        let solution = solve_positive(&matrix, &right)?;
        let mut products = [0.0; 10];
        for (column, value) in columns.into_iter().zip(solution) {
            products[column] = value;
        }
        Some(products)
    }
}

impl Distances<4, 6> {
    /// Starts for four control points: the paper's cases N = 1..4.
    pub(super) fn starts_of_four(&self) -> [Option<[f64; 4]>; 4] {
        [
            self.one(),
            self.products([0, 1, 2]).and_then(|p| betas(&p)),
            self.products([0, 1, 2, 3, 4, 5]).and_then(|p| betas(&p)),
            self.relinearise().and_then(|p| betas(&p)),
        ]
    }

    /// Case N = 4: ten products, six equations, and the quadratic relations between the products.
    ///
    /// Elimination leaves four products free. That `b_ij b_kl = b_ik b_jl` holds is linear in the monomials of these
    /// four, taken as unknowns of their own: 20 equations, 14 unknowns.
    fn relinearise(&self) -> Option<[f64; 10]> {
        let (constant, slopes, free) = self.eliminate()?;
        let affine = |column: usize| (constant[column], slopes[column]);
        let mut matrix = [[0.0; 14]; 14];
        let mut right = [0.0; 14];
        for &[a, b, c, d] in &RELATIONS {
            // product[a] * product[b] - product[c] * product[d] = 0
            let mut row = [0.0; 14];
            let mut constant = 0.0;
            for (sign, first, second) in [(1.0, affine(a), affine(b)), (-1.0, affine(c), affine(d))]
            {
                constant += sign * first.0 * second.0;
                for i in 0..4 {
                    row[i] += sign * (first.0 * second.1[i] + second.0 * first.1[i]);
                }
                for (entry, &(i, j)) in row[4..].iter_mut().zip(&PRODUCTS) {
                    let cross = first.1[i] * second.1[j];
                    let twin = if i == j { 0.0 } else { first.1[j] * second.1[i] };
                    *entry += sign * (cross + twin);
                }
            }
            for i in 0..14 {
                right[i] -= row[i] * constant;
                for j in 0..=i {
                    matrix[i][j] += row[i] * row[j];
                }
            }
        }
        // The monomials depend on each other, so the system may be singular without being hopeless.
        let trace: f64 = (0..14).map(|i| matrix[i][i]).sum();
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] += 1e-13 * trace;
        }
        let unknowns = solve_positive(&matrix, &right)?;
        let mut products = constant;
        for (column, slope) in slopes.iter().enumerate() {
            for i in 0..4 {
                products[column] += slope[i] * unknowns[i];
            }
        }
        debug_assert!(free.iter().all(|column| *column < 10));
        Some(products)
    }

    /// Solves the six equations for six of the ten products: `products = constant + slopes * (the four free ones)`.
    fn eliminate(&self) -> Option<([f64; 10], [[f64; 4]; 10], [usize; 4])> {
        let mut rows = [[0.0; 11]; 6];
        for (row, (coefficients, squared)) in
            rows.iter_mut().zip(self.coefficients.iter().zip(&self.squared))
        {
            row[..10].copy_from_slice(coefficients);
            row[10] = *squared;
        }
        let mut columns: [usize; 10] = std::array::from_fn(|i| i);
        for step in 0..6 {
            let (mut pivot, mut at) = (0.0, (step, step));
            for (r, row) in rows.iter().enumerate().skip(step) {
                for (c, column) in columns.iter().enumerate().skip(step) {
                    if row[*column].abs() > pivot {
                        (pivot, at) = (row[*column].abs(), (r, c));
                    }
                }
            }
            if !(pivot > 1e-14) {
                return None;
            }
            rows.swap(step, at.0);
            columns.swap(step, at.1);
            let inverse = 1.0 / rows[step][columns[step]];
            rows[step].iter_mut().for_each(|value| *value *= inverse);
            let lead = rows[step];
            for (r, row) in rows.iter_mut().enumerate() {
                let factor = row[columns[step]];
                if r != step && factor != 0.0 {
                    for (value, above) in row.iter_mut().zip(&lead) {
                        *value -= factor * above;
                    }
                }
            }
        }
        let free = [columns[6], columns[7], columns[8], columns[9]];
        let (mut constant, mut slopes) = ([0.0; 10], [[0.0; 4]; 10]);
        for step in 0..6 {
            constant[columns[step]] = rows[step][10];
            slopes[columns[step]] = free.map(|column| -rows[step][column]);
        }
        for (i, column) in free.into_iter().enumerate() {
            slopes[column][i] = 1.0;
        }
        Some((constant, slopes, free))
    }
}

impl Distances<3, 3> {
    /// Starts for three control points: N = 1, and N = 2 from three products and three distances.
    pub(super) fn starts_of_three(&self) -> [Option<[f64; 3]>; 3] {
        [
            self.one(),
            self.products([0, 1, 2]).and_then(|p| betas(&p)),
            self.products([0, 1, 3]).and_then(|p| betas(&p)),
        ]
    }
}

/// The 20 relations `product[a] * product[b] = product[c] * product[d]` of a symmetric 4 x 4 matrix of rank one.
const RELATIONS: [[usize; 4]; 20] = [
    [0, 2, 1, 1],
    [0, 5, 3, 3],
    [0, 9, 6, 6],
    [2, 5, 4, 4],
    [2, 9, 7, 7],
    [5, 9, 8, 8],
    [0, 4, 1, 3],
    [0, 7, 1, 6],
    [0, 8, 3, 6],
    [2, 3, 1, 4],
    [2, 6, 1, 7],
    [2, 8, 4, 7],
    [5, 1, 3, 4],
    [5, 6, 3, 8],
    [5, 7, 4, 8],
    [9, 1, 6, 7],
    [9, 3, 6, 8],
    [9, 4, 7, 8],
    [1, 8, 3, 7],
    [1, 8, 4, 6],
];

/// The betas whose products come closest: from the largest square, with the signs of its row.
///
/// A negative square is no product of real betas; if the largest is not positive, there is no start.
fn betas<const K: usize>(products: &[f64; 10]) -> Option<[f64; K]> {
    const SQUARES: [usize; 4] = [0, 2, 5, 9];
    let mut largest = 0;
    for k in 1..K {
        if products[SQUARES[k]] > products[SQUARES[largest]] {
            largest = k;
        }
    }
    let square = products[SQUARES[largest]];
    if !(square > 0.0 && square.is_finite()) {
        return None;
    }
    let lead = square.sqrt();
    let mut betas = [0.0; K];
    for (product, &(k, l)) in products.iter().zip(&PRODUCTS) {
        if l < K && k == largest {
            betas[l] = product / lead;
        } else if l < K && l == largest {
            betas[k] = product / lead;
        }
    }
    betas[largest] = lead;
    betas.iter().all(|beta| beta.is_finite()).then_some(betas)
}
