//! The betas of EPnP: weights of the null vectors such that control points keep their distances.

use crate::pnp::linalg::solve_positive;
use crate::pnp::linear::Nine;

/// Steps of Gauss-Newton; 5 to 8 are usual.
const MAX_STEPS: usize = 12;
/// Relative change of the betas at which Gauss-Newton has converged.
const CONVERGED: f64 = 1e-5;
/// Relative distance of betas within which a known minimum is being approached again.
const SAME: f64 = 1e-2;
/// Damping of the first step, relative to the diagonal.
const FIRST_DAMPING: f64 = 1e-6;
/// How far the extra starts are from case N = 1, in units of its beta; anything from 0.2 to 0.5 does as well.
const PUSH: f64 = 0.3;
/// Pairs of control points: axis a and axis b, or the centroid where b is 3.
const PAIRS: [(usize, usize); 6] = [(0, 3), (1, 3), (0, 1), (2, 3), (0, 2), (1, 2)];
/// Products of two of up to four betas, in the order of the columns of the linear systems.
const PRODUCTS: [(usize, usize); 10] =
    [(0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2), (0, 3), (1, 3), (2, 3), (3, 3)];

/// The distance constraints: `K` null vectors, `D` distances, one form in the betas each.
pub(super) struct Distances<const K: usize, const D: usize> {
    /// The squared distance of each pair is `betas' form betas`.
    forms: [[[f64; K]; K]; D],
    /// Squared distances between control points in the object.
    squared: [f64; D],
}

impl<const K: usize, const D: usize> Distances<K, D> {
    /// From the null vectors (control points relative to the centroid) and the control points' distances from it.
    pub(super) fn new(vectors: &[Nine; K], lengths: &[f64; 3]) -> Self {
        let mut forms = [[[0.0; K]; K]; D];
        let mut squared = [0.0; D];
        for (pair, &(a, b)) in PAIRS.iter().take(D).enumerate() {
            let difference = vectors.map(|v| {
                let mut d = [v[3 * a], v[3 * a + 1], v[3 * a + 2]];
                if b < 3 {
                    for c in 0..3 {
                        d[c] -= v[3 * b + c];
                    }
                }
                d
            });
            for k in 0..K {
                for l in 0..=k {
                    let (x, y) = (&difference[k], &difference[l]);
                    let dot = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
                    forms[pair][k][l] = dot;
                    forms[pair][l][k] = dot;
                }
            }
            squared[pair] = lengths[a] * lengths[a];
            if b < 3 {
                squared[pair] += lengths[b] * lengths[b];
            }
        }
        Self { forms, squared }
    }

    /// Coefficient of a product of two betas in a distance.
    fn coefficient(&self, pair: usize, product: usize) -> f64 {
        let (k, l) = PRODUCTS[product];
        if l >= K {
            return 0.0;
        }
        if k == l { self.forms[pair][k][l] } else { 2.0 * self.forms[pair][k][l] }
    }

    /// The distinct minima that the starts lead to.
    pub(super) fn minima<const S: usize>(
        &self,
        starts: [Option<[f64; K]>; S],
    ) -> impl Iterator<Item = [f64; K]> {
        let mut found = [[0.0; K]; S];
        let mut len = 0;
        for start in starts.into_iter().flatten() {
            if let Some(betas) = self.gauss_newton(start, &found[..len]) {
                found[len] = betas;
                len += 1;
            }
        }
        found.into_iter().take(len)
    }

    /// Minimises the squared errors of the squared distances, damped after Levenberg and Marquardt.
    ///
    /// `None` as soon as it comes close to a minimum that is already known.
    fn gauss_newton(&self, start: [f64; K], known: &[[f64; K]]) -> Option<[f64; K]> {
        let size = |b: &[f64; K]| b.iter().map(|x| x * x).sum::<f64>();
        let is_known = |betas: &[f64; K]| {
            let near = SAME * SAME * size(betas);
            // The sign of all betas is arbitrary.
            known.iter().any(|other| {
                size(&std::array::from_fn(|k| betas[k] - other[k])) < near
                    || size(&std::array::from_fn(|k| betas[k] + other[k])) < near
            })
        };
        let mut betas = start;
        let mut here = self.linearise(&betas);
        let mut damping = FIRST_DAMPING;
        for _ in 0..MAX_STEPS {
            let mut matrix = here.matrix;
            for (k, row) in matrix.iter_mut().enumerate() {
                row[k] *= 1.0 + damping;
            }
            let Some(step) = solve_positive(&matrix, &here.right) else {
                damping = (damping * 100.0).max(FIRST_DAMPING);
                continue;
            };
            let next: [f64; K] = std::array::from_fn(|k| betas[k] - step[k]);
            let there = self.linearise(&next);
            if there.cost < here.cost {
                let arrived = size(&step) < CONVERGED * CONVERGED * size(&next);
                (betas, here) = (next, there);
                if is_known(&betas) {
                    return None;
                }
                if arrived {
                    break;
                }
                damping *= 0.1;
            } else {
                // A refused step of no consequence: rounding is all that is left.
                if there.cost <= here.cost * (1.0 + 1e-9) || damping > 1e3 {
                    break;
                }
                damping = (damping * 30.0).max(FIRST_DAMPING);
            }
        }
        Some(betas)
    }

    fn linearise(&self, betas: &[f64; K]) -> Linearised<K> {
        let mut result = Linearised { matrix: [[0.0; K]; K], right: [0.0; K], cost: 0.0 };
        for (form, squared) in self.forms.iter().zip(&self.squared) {
            // Half the derivative of the distance.
            let mut slope = [0.0; K];
            for (row, beta) in form.iter().zip(betas) {
                for k in 0..K {
                    slope[k] += row[k] * beta;
                }
            }
            let mut error = -squared;
            for k in 0..K {
                error += slope[k] * betas[k];
            }
            result.cost += error * error;
            for k in 0..K {
                // Twice the slope on both sides, once in the step: factor 2 = 4 / 2.
                result.right[k] += slope[k] * error;
                for l in 0..=k {
                    result.matrix[k][l] += 2.0 * slope[k] * slope[l];
                }
            }
        }
        result
    }

    /// Case N = 1: the ratio of the distances, each weighted by its length in the null vector.
    fn one(&self) -> Option<f64> {
        let (mut above, mut below) = (0.0, 0.0);
        for (form, squared) in self.forms.iter().zip(&self.squared) {
            above += (form[0][0] * squared).sqrt();
            below += form[0][0];
        }
        let beta = above / below;
        (beta > 0.0 && beta.is_finite()).then_some(beta)
    }

    /// The betas whose products solve the distances by least squares, products other than these taken as zero.
    fn least_squares<const C: usize>(&self, columns: [usize; C]) -> Option<[f64; K]> {
        let mut matrix = [[0.0; C]; C];
        let mut right = [0.0; C];
        for pair in 0..D {
            let entries = columns.map(|column| self.coefficient(pair, column));
            for i in 0..C {
                right[i] += entries[i] * self.squared[pair];
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
        betas(&products)
    }
}

/// Normal equations (lower triangle) and cost of the distance errors at some betas.
struct Linearised<const K: usize> {
    matrix: [[f64; K]; K],
    right: [f64; K],
    cost: f64,
}

impl Distances<4, 6> {
    /// Starts for four control points: the paper's cases N = 1..4, then case 1 pushed along its neighbours.
    ///
    /// With noise the distance errors have several minima around the weakest vector, told apart by the signs of the
    /// second and third beta; the linearised cases often fall into the wrong one.
    pub(super) fn starts_of_four(&self) -> [Option<[f64; 4]>; 8] {
        let one = self.one();
        let pushed = |second: f64, third: f64| one.map(|b| [b, second * b, third * b, 0.0]);
        [
            pushed(0.0, 0.0),
            self.least_squares([0, 1, 2]),
            self.least_squares([0, 1, 2, 3, 4, 5]),
            self.relinearise().and_then(|products| betas(&products)),
            pushed(PUSH, 0.0),
            pushed(-PUSH, 0.0),
            pushed(0.0, PUSH),
            pushed(0.0, -PUSH),
        ]
    }

    /// Case N = 4: ten products, six equations, and the quadratic relations between the products.
    ///
    /// Elimination leaves four products free. That `b_ij b_kl = b_ik b_jl` holds is linear in the monomials of these
    /// four, taken as unknowns of their own: 20 equations, 14 unknowns.
    fn relinearise(&self) -> Option<[f64; 10]> {
        let (constant, slopes) = self.eliminate()?;
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
        Some(products)
    }

    /// Solves the six equations for six of the ten products: `products = constant + slopes * (the four free ones)`.
    fn eliminate(&self) -> Option<([f64; 10], [[f64; 4]; 10])> {
        let mut rows = [[0.0; 11]; 6];
        for (pair, row) in rows.iter_mut().enumerate() {
            for (product, entry) in row.iter_mut().take(10).enumerate() {
                *entry = self.coefficient(pair, product);
            }
            row[10] = self.squared[pair];
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
        Some((constant, slopes))
    }
}

impl Distances<3, 3> {
    /// Starts for three control points: N = 1, N = 2 from three products and three distances, and neighbours.
    pub(super) fn starts_of_three(&self) -> [Option<[f64; 3]>; 4] {
        let one = self.one();
        [
            one.map(|b| [b, 0.0, 0.0]),
            self.least_squares([0, 1, 2]),
            one.map(|b| [b, PUSH * b, 0.0]),
            one.map(|b| [b, -PUSH * b, 0.0]),
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
