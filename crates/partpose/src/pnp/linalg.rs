//! Small dense linear algebra on fixed arrays: what the solvers need, at the size they need it.
//!
//! The generic decompositions of nalgebra are several times slower at these sizes, and the solvers are called for every
//! vehicle and model. The eigensolver is Householder tridiagonalisation followed by implicit QL (Martin, Reinsch and
//! Wilkinson, Handbook for Automatic Computation II/2, 1971), as in EISPACK's `tred2` and `tql2`, with the vectors kept
//! as rows so that a rotation touches contiguous memory.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

/// Steps of QL per eigenvalue; 2 are usual, and more than 30 do not happen with finite input.
const MAX_QL_STEPS: usize = 40;

/// Eigenvalues, ascending, and unit eigenvectors as rows, of the symmetric matrix `a`.
pub(super) fn symmetric_eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let (mut d, mut e) = tridiagonalise(&mut a);
    implicit_ql(&mut d, &mut e, &mut a);
    // Insertion sort, ascending.
    for i in 1..N {
        let mut k = i;
        while k > 0 && d[k] < d[k - 1] {
            d.swap(k, k - 1);
            a.swap(k, k - 1);
            k -= 1;
        }
    }
    (d, a)
}

/// Reduces `a` to tridiagonal form; leaves the transposed product of the reflections in `a`.
///
/// Returns the diagonal, and the subdiagonal in `e[0..N - 1]`.
fn tridiagonalise<const N: usize>(a: &mut [[f64; N]; N]) -> ([f64; N], [f64; N]) {
    let mut d = [0.0; N];
    let mut e = [0.0; N];
    let mut reflections = [[0.0; N]; N];
    let mut factors = [0.0; N];
    for k in 0..N.saturating_sub(2) {
        // The reflection that maps column k below the diagonal onto its first entry.
        let mut norm2 = 0.0;
        let mut v = [0.0; N];
        for i in k + 1..N {
            v[i] = a[k][i];
            norm2 += v[i] * v[i];
        }
        let tail2 = norm2 - v[k + 1] * v[k + 1];
        d[k] = a[k][k];
        if tail2 <= 0.0 {
            e[k] = v[k + 1];
            continue;
        }
        let norm = norm2.sqrt();
        let alpha = if v[k + 1] > 0.0 { -norm } else { norm };
        e[k] = alpha;
        v[k + 1] -= alpha;
        let factor = 1.0 / (norm2 - alpha * a[k][k + 1]);
        // a <- (1 - factor v v') a (1 - factor v v'), on the trailing block.
        let mut p = [0.0; N];
        let mut vp = 0.0;
        for i in k + 1..N {
            let mut sum = 0.0;
            for j in k + 1..N {
                sum += a[i][j] * v[j];
            }
            p[i] = factor * sum;
            vp += p[i] * v[i];
        }
        let half = 0.5 * factor * vp;
        for i in k + 1..N {
            p[i] -= half * v[i];
        }
        for i in k + 1..N {
            for j in k + 1..N {
                a[i][j] -= v[i] * p[j] + p[i] * v[j];
            }
        }
        reflections[k] = v;
        factors[k] = factor;
    }
    if N >= 2 {
        d[N - 2] = a[N - 2][N - 2];
        e[N - 2] = a[N - 2][N - 1];
    }
    d[N - 1] = a[N - 1][N - 1];
    // The product of the reflections, from the last to the first, so that zeros stay zeros.
    *a = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for k in (0..N.saturating_sub(2)).rev() {
        if factors[k] == 0.0 {
            continue;
        }
        let v = &reflections[k];
        for row in a.iter_mut().skip(k + 1) {
            let mut dot = 0.0;
            for j in k + 1..N {
                dot += row[j] * v[j];
            }
            dot *= factors[k];
            for j in k + 1..N {
                row[j] -= dot * v[j];
            }
        }
    }
    (d, e)
}

/// Diagonalises the tridiagonal matrix, turning the rows of `z` along.
fn implicit_ql<const N: usize>(d: &mut [f64; N], e: &mut [f64; N], z: &mut [[f64; N]; N]) {
    for l in 0..N {
        for _ in 0..MAX_QL_STEPS {
            let mut m = l;
            while m + 1 < N && e[m].abs() > f64::EPSILON * (d[m].abs() + d[m + 1].abs()) {
                m += 1;
            }
            if m == l {
                break;
            }
            let g = (d[l + 1] - d[l]) / (2.0 * e[l]);
            let r = g.hypot_fast();
            let mut g = d[m] - d[l] + e[l] / (g + r.copysign(g));
            let (mut s, mut c, mut p) = (1.0, 1.0, 0.0);
            let mut deflated = false;
            for i in (l..m).rev() {
                let f = s * e[i];
                let b = c * e[i];
                let r = (f * f + g * g).sqrt();
                e[i + 1] = r;
                if r == 0.0 {
                    d[i + 1] -= p;
                    e[m] = 0.0;
                    deflated = true;
                    break;
                }
                let inverse = 1.0 / r;
                s = f * inverse;
                c = g * inverse;
                g = d[i + 1] - p;
                let r = (d[i] - g) * s + 2.0 * c * b;
                p = s * r;
                d[i + 1] = g + p;
                g = c * r - b;
                let (upper, lower) = z.split_at_mut(i + 1);
                let (upper, lower) = (&mut upper[i], &mut lower[0]);
                for k in 0..N {
                    let f = lower[k];
                    lower[k] = s * upper[k] + c * f;
                    upper[k] = c * upper[k] - s * f;
                }
            }
            if !deflated {
                d[l] -= p;
                e[l] = g;
                e[m] = 0.0;
            }
        }
    }
}

trait HypotFast {
    /// `sqrt(1 + self^2)`.
    fn hypot_fast(self) -> f64;
}

impl HypotFast for f64 {
    fn hypot_fast(self) -> f64 {
        if self.abs() > 1e150 { self.abs() } else { (1.0 + self * self).sqrt() }
    }
}

/// Solves `a x = b` for a symmetric positive definite `a`, of which the lower triangle is read; `None` if it is not.
pub(super) fn solve_positive<const N: usize>(a: &[[f64; N]; N], b: &[f64; N]) -> Option<[f64; N]> {
    let (l, inverse) = cholesky(a)?;
    let mut x = *b;
    for i in 0..N {
        let mut sum = x[i];
        for k in 0..i {
            sum -= l[i][k] * x[k];
        }
        x[i] = sum * inverse[i];
    }
    for i in (0..N).rev() {
        let mut sum = x[i];
        for k in i + 1..N {
            sum -= l[k][i] * x[k];
        }
        x[i] = sum * inverse[i];
    }
    x.iter().all(|value| value.is_finite()).then_some(x)
}

/// The lower Cholesky factor and the inverses of its diagonal.
pub(super) fn cholesky<const N: usize>(a: &[[f64; N]; N]) -> Option<([[f64; N]; N], [f64; N])> {
    let mut l = [[0.0; N]; N];
    let mut inverse = [0.0; N];
    for j in 0..N {
        let mut pivot = a[j][j];
        for k in 0..j {
            pivot -= l[j][k] * l[j][k];
        }
        // The pivot must stand out from the rounding of what was subtracted; NaN fails too.
        if !(pivot > 1e-15 * a[j][j].abs() && pivot.is_finite()) {
            return None;
        }
        let root = pivot.sqrt();
        l[j][j] = root;
        inverse[j] = 1.0 / root;
        for i in j + 1..N {
            let mut sum = a[i][j];
            for k in 0..j {
                sum -= l[i][k] * l[j][k];
            }
            l[i][j] = sum * inverse[j];
        }
    }
    Some((l, inverse))
}

/// The proper rotation nearest to `m`: the `R` that maximises the trace of `R' m`.
///
/// This is `U diag(1, 1, det(U V')) V'` of the singular value decomposition, found as the largest eigenvector of
/// Horn's 4 x 4 matrix (*Closed-form solution of absolute orientation using unit quaternions*, JOSA A 1987), which can
/// only be a proper rotation and needs no repair of the determinant. `None` if `m` is not finite.
pub(super) fn nearest_rotation(m: &Matrix3<f64>) -> Option<UnitQuaternion<f64>> {
    let scale = m.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    // Horn writes the correlation source-target; ours is target-source, hence the transpose.
    let s = m.transpose() / scale;
    let (xx, xy, xz) = (s[(0, 0)], s[(0, 1)], s[(0, 2)]);
    let (yx, yy, yz) = (s[(1, 0)], s[(1, 1)], s[(1, 2)]);
    let (zx, zy, zz) = (s[(2, 0)], s[(2, 1)], s[(2, 2)]);
    let n = [
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ];
    let (_, vectors) = symmetric_eigen(n);
    let [w, x, y, z] = vectors[3];
    let quaternion = Quaternion::new(w, x, y, z);
    quaternion.norm().is_finite().then(|| UnitQuaternion::new_normalize(quaternion))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn eigenvectors_rebuild_the_matrix(entries in proptest::collection::vec(-3.0..3.0f64, 81)) {
            let a: [[f64; 9]; 9] =
                std::array::from_fn(|i| std::array::from_fn(|j| entries[9 * i.max(j) + i.min(j)]));
            let (values, vectors) = symmetric_eigen(a);
            prop_assert!(values.windows(2).all(|pair| pair[0] <= pair[1]));
            for i in 0..9 {
                for j in 0..9 {
                    let dot: f64 = (0..9).map(|k| vectors[i][k] * vectors[j][k]).sum();
                    prop_assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-12);
                    let back: f64 = (0..9).map(|k| values[k] * vectors[k][i] * vectors[k][j]).sum();
                    prop_assert!((back - a[i][j]).abs() < 1e-12 * 30.0);
                }
            }
        }

        #[test]
        fn nearest_rotation_beats_the_singular_value_recipe_nowhere(
            entries in proptest::collection::vec(-1.0..1.0f64, 9),
        ) {
            let m = Matrix3::from_row_slice(&entries);
            let svd = m.svd(true, true);
            let (u, v_t) = (svd.u.unwrap(), svd.v_t.unwrap());
            let mut fix = Matrix3::identity();
            fix[(2, 2)] = (u * v_t).determinant().signum();
            let expected = (u * fix * v_t).transpose() * m;
            let found = nearest_rotation(&m).unwrap().to_rotation_matrix();
            let found = found.matrix().transpose() * m;
            prop_assert!((expected.trace() - found.trace()).abs() < 1e-10);
        }
    }

    #[test]
    fn diagonal_and_zero_matrices_have_eigenvectors() {
        let (values, vectors) = symmetric_eigen([[0.0; 4]; 4]);
        assert!(values.iter().all(|value| value.abs() < 1e-300));
        assert!(vectors.iter().all(|v| (v.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-15));
    }
}
