//! Eigenvalues of symmetric matrices by Jacobi's rotations, and the triangular factor of
//! many rows by Householder's reflections (Golub & Van Loan 2013, §8.5 and §5.2).

use super::dense::Matrix;

/// A = QΛQᵀ.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SymmetricEigen {
    /// The eigenvalues, in no particular order.
    pub(crate) values: Vec<f64>,
    /// Qᵀ: row k is the eigenvector of value k, of length 1.
    pub(crate) vectors: Matrix,
}

/// A matrix of any size seen so far needs fewer than ten.
const MAX_SWEEPS: usize = 60;

impl SymmetricEigen {
    /// The decomposition of a symmetric matrix.
    pub(crate) fn new(mut a: Matrix) -> Self {
        let n = a.rows();
        let mut vectors = Matrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j)));
        for _ in 0..MAX_SWEEPS {
            let mut turned = false;
            for p in 0..n {
                for q in p + 1..n {
                    turned |= rotate(&mut a, &mut vectors, p, q);
                }
            }
            if !turned {
                break;
            }
        }
        Self {
            values: (0..n).map(|i| a[(i, i)]).collect(),
            vectors,
        }
    }

    /// The largest absolute eigenvalue; 0 of an empty matrix.
    pub(crate) fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |most, v| v.abs().max(most))
    }
}

/// Makes element (p, q) 0; false if it is negligible beside both diagonal elements.
fn rotate(a: &mut Matrix, vectors: &mut Matrix, p: usize, q: usize) -> bool {
    let (app, aqq, apq) = (a[(p, p)], a[(q, q)], a[(p, q)]);
    if app + apq == app && aqq + apq == aqq {
        return false;
    }
    let theta = (aqq - app) / (2.0 * apq);
    let tangent = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    let sine = tangent * cosine;
    for k in 0..a.rows() {
        let (x, y) = (a[(k, p)], a[(k, q)]);
        (a[(k, p)], a[(k, q)]) = (cosine * x - sine * y, sine * x + cosine * y);
        (a[(p, k)], a[(q, k)]) = (a[(k, p)], a[(k, q)]);
        let (x, y) = (vectors[(p, k)], vectors[(q, k)]);
        (vectors[(p, k)], vectors[(q, k)]) = (cosine * x - sine * y, sine * x + cosine * y);
    }
    (a[(p, p)], a[(q, q)]) = (app - tangent * apq, aqq + tangent * apq);
    (a[(p, q)], a[(q, p)]) = (0.0, 0.0);
    true
}

/// Replaces rows y by at most as many as they have elements, with the same Σ yyᵀ: the
/// triangular factor R of Y = QR.
pub(crate) fn triangular(rows: &mut Vec<Vec<f64>>) {
    let width = rows.first().map_or(0, Vec::len);
    if rows.len() <= width {
        return;
    }
    let mut sums = vec![0.0; width];
    for k in 0..width {
        let norm = rows[k..]
            .iter()
            .map(|row| row[k] * row[k])
            .sum::<f64>()
            .sqrt();
        if norm == 0.0 {
            continue;
        }
        let diagonal = -norm.copysign(rows[k][k]);
        let size = norm * (norm + rows[k][k].abs());
        rows[k][k] -= diagonal;
        sums.fill(0.0);
        for row in &rows[k..] {
            for (sum, y) in sums[k + 1..].iter_mut().zip(&row[k + 1..]) {
                *sum += row[k] * y;
            }
        }
        for row in &mut rows[k..] {
            let (done, rest) = row.split_at_mut(k + 1);
            let factor = done[k] / size;
            for (y, sum) in rest.iter_mut().zip(&sums[k + 1..]) {
                *y -= factor * sum;
            }
            done[k] = 0.0;
        }
        rows[k][k] = diagonal;
    }
    rows.truncate(width);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{RandomSource, SplitMix64};

    fn sorted(eigen: &SymmetricEigen) -> Vec<f64> {
        let mut values = eigen.values.clone();
        values.sort_by(f64::total_cmp);
        values
    }

    fn close(a: &[f64], b: &[f64]) {
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() < 1e-13, "{a} is not {b}");
        }
    }

    /// The second difference: 2 − 2 cos(kπ/(n + 1)).
    #[test]
    fn the_eigenvalues_of_the_second_difference_are_known() {
        let a = Matrix::from_fn(6, 6, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        let known = [1, 2, 3, 4, 5, 6].map(|k| {
            let angle = f64::from(k) * std::f64::consts::PI / 7.0;
            2.0 - 2.0 * angle.cos()
        });
        close(&sorted(&SymmetricEigen::new(a)), &known);
    }

    /// cI + J has the eigenvalues c, c and c + 3.
    #[test]
    fn equal_negative_and_zero_eigenvalues() {
        let ones = |diagonal: f64| {
            let element = move |i, j| if i == j { diagonal } else { 1.0 };
            SymmetricEigen::new(Matrix::from_fn(3, 3, element))
        };
        close(&sorted(&ones(3.0)), &[2.0, 2.0, 5.0]);
        close(&sorted(&ones(1.0)), &[0.0, 0.0, 3.0]);
        close(&sorted(&ones(0.0)), &[-1.0, -1.0, 2.0]);
        assert!((ones(-5.0).largest() - 6.0).abs() < 1e-13);
        let empty = SymmetricEigen::new(Matrix::zeros(0, 0));
        assert!(empty.values.is_empty() && empty.largest() == 0.0);
    }

    #[test]
    fn the_decomposition_gives_the_matrix_back() {
        let mut random = SplitMix64::new(5);
        for n in 1..20 {
            let mut a = Matrix::zeros(n, n);
            for i in 0..n {
                for j in 0..=i {
                    a[(i, j)] = random.normal() * 10f64.powi((i % 5) as i32);
                    a[(j, i)] = a[(i, j)];
                }
            }
            let eigen = SymmetricEigen::new(a.clone());
            let q = eigen.vectors.transposed();
            let diagonal = |i, j| if i == j { eigen.values[i] } else { 0.0 };
            let back = &q * &Matrix::from_fn(n, n, diagonal) * &eigen.vectors;
            let unit = &q * &eigen.vectors;
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert!((back[(i, j)] - a[(i, j)]).abs() < 1e-13 * eigen.largest());
                assert!((unit[(i, j)] - f64::from(u8::from(i == j))).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn a_triangular_factor_has_the_products_of_its_rows() {
        let mut random = SplitMix64::new(6);
        // The third column is the sum of the first two; the fourth is 0.
        let mut rows: Vec<Vec<f64>> = (0..40)
            .map(|_| (random.normal(), random.normal(), random.normal()))
            .map(|(a, b, c)| vec![a, b, a + b, 0.0, c])
            .collect();
        let product = |rows: &[Vec<f64>], i: usize, j: usize| -> f64 {
            rows.iter().map(|row| row[i] * row[j]).sum()
        };
        let all = rows.clone();
        triangular(&mut rows);
        assert_eq!(rows.len(), 5);
        for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (i, j))) {
            let (before, after) = (product(&all, i, j), product(&rows, i, j));
            assert!((before - after).abs() < 1e-12, "{i} {j}: {before} {after}");
            assert!(i <= j || rows[i][j] == 0.0);
        }
        let few = rows[..3].to_vec();
        let mut kept = few.clone();
        triangular(&mut kept);
        assert_eq!(kept, few);
    }
}
