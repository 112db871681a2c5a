//! Matrices: symmetric ones with their Cholesky factors and eigenvectors, and dense ones.
//!
//! The Cholesky factor admits positive semidefinite matrices: a variable that the ones
//! before it determine has a pivot of 0 and is left out.

mod dense;
mod eigen;

pub(crate) use dense::{Matrix, dot};
pub(crate) use eigen::{SymmetricEigen, triangular};

/// A symmetric matrix: the lower triangle by rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SymmetricMatrix {
    size: usize,
    lower: Vec<f64>,
}

impl SymmetricMatrix {
    /// All elements 0.
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            size,
            lower: vec![0.0; size * (size + 1) / 2],
        }
    }

    /// The matrix with the elements `element(i, j)`, which is asked for i ≥ j only.
    pub(crate) fn from_fn(size: usize, element: impl Fn(usize, usize) -> f64) -> Self {
        let places = (0..size).flat_map(|i| (0..=i).map(move |j| (i, j)));
        Self {
            size,
            lower: places.map(|(i, j)| element(i, j)).collect(),
        }
    }

    /// Number of rows.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Element (i, j), which is also (j, i).
    pub(crate) fn get(&self, i: usize, j: usize) -> f64 {
        self.lower[place(i, j)]
    }

    /// Adds to element (i, j), which is also (j, i).
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        self.lower[place(i, j)] += value;
    }

    /// Adds c·vvᵀ.
    pub(crate) fn add_outer(&mut self, c: f64, v: &[f64]) {
        let mut rest = self.lower.as_mut_slice();
        for (i, vi) in v.iter().enumerate() {
            let (row, next) = rest.split_at_mut(i + 1);
            let scaled = c * vi;
            for (r, vj) in row.iter_mut().zip(v) {
                *r += scaled * vj;
            }
            rest = next;
        }
    }

    /// Adds vyᵀ + yvᵀ.
    pub(crate) fn add_mixed(&mut self, v: &[f64], y: &[f64]) {
        let mut rest = self.lower.as_mut_slice();
        for i in 0..v.len() {
            let (row, next) = rest.split_at_mut(i + 1);
            for ((r, vj), yj) in row.iter_mut().zip(v).zip(y) {
                *r += v[i] * yj + y[i] * vj;
            }
            rest = next;
        }
    }

    /// The matrix times −1.
    pub(crate) fn negated(&self) -> Self {
        Self {
            size: self.size,
            lower: self.lower.iter().map(|v| -v).collect(),
        }
    }

    /// The elements (i, 0) to (i, i).
    fn row(&self, i: usize) -> &[f64] {
        &self.lower[place(i, 0)..=place(i, i)]
    }

    /// The elements (i, 0) to (i, i).
    pub(crate) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.lower[place(i, 0)..=place(i, i)]
    }
}

fn place(i: usize, j: usize) -> usize {
    let (i, j) = (i.max(j), i.min(j));
    i * (i + 1) / 2 + j
}

/// L of A = LLᵀ.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Cholesky {
    factor: SymmetricMatrix,
    /// What the variables before leave of each diagonal element; 0: the variable is
    /// left out.
    pub(crate) pivots: Vec<f64>,
}

impl Cholesky {
    /// The factor of a positive semidefinite matrix. A variable is left out if its
    /// pivot is not above `tolerance` of its diagonal element. `None` if an element is
    /// not finite.
    pub(crate) fn semidefinite(
        a: &SymmetricMatrix,
        tolerance: impl Fn(usize) -> f64,
    ) -> Option<Self> {
        let mut factor = SymmetricMatrix::zero(a.size);
        let mut pivots = vec![0.0; a.size];
        for i in 0..a.size {
            for j in 0..=i {
                let known = dot(&factor.row(i)[..j], &factor.row(j)[..j]);
                let rest = a.get(i, j) - known;
                if i == j && rest > tolerance(i) * a.get(i, i).abs() {
                    pivots[i] = rest;
                    factor.add(i, i, rest.sqrt());
                } else if i != j && pivots[j] > 0.0 {
                    factor.add(i, j, rest / factor.get(j, j));
                }
            }
        }
        let finite = a.lower.iter().chain(&factor.lower).all(|v| v.is_finite());
        finite.then_some(Self { factor, pivots })
    }

    /// The factor; `None` unless the matrix is clearly positive definite.
    pub(crate) fn definite(a: &SymmetricMatrix) -> Option<Self> {
        Self::semidefinite(a, |_| 1e-13).filter(|found| found.rank() == a.size)
    }

    /// The factor; `None` unless all pivots are positive, however small.
    pub(crate) fn positive(a: &SymmetricMatrix) -> Option<Self> {
        Self::semidefinite(a, |_| 0.0).filter(|found| found.rank() == a.size)
    }

    /// Number of variables that are not left out.
    pub(crate) fn rank(&self) -> usize {
        self.pivots.iter().filter(|p| **p > 0.0).count()
    }

    /// ln det A of a definite matrix.
    pub(crate) fn log_determinant(&self) -> f64 {
        self.pivots.iter().map(|p| p.ln()).sum()
    }

    /// Lz.
    pub(crate) fn times(&self, z: &[f64]) -> Vec<f64> {
        let rows = (0..self.pivots.len()).map(|i| self.factor.row(i));
        rows.map(|row| dot(row, &z[..row.len()])).collect()
    }

    /// x of Ax = b; 0 for the variables that are left out.
    pub(crate) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; b.len()];
        let kept = || (0..b.len()).filter(|&i| self.pivots[i] > 0.0);
        for i in kept() {
            let known = dot(&self.factor.row(i)[..i], &x[..i]);
            x[i] = (b[i] - known) / self.factor.get(i, i);
        }
        for i in kept().rev() {
            let later = i + 1..b.len();
            let known: f64 = later.map(|k| self.factor.get(k, i) * x[k]).sum();
            x[i] = (x[i] - known) / self.factor.get(i, i);
        }
        x
    }

    /// Replaces b by x of Lx = b; of a definite matrix.
    pub(crate) fn solve_lower(&self, b: &mut [f64]) {
        self.solve_lower_from(0, b);
    }

    /// Replaces the rows of B by those of X of LX = B; of a definite matrix.
    pub(crate) fn solve_lower_rows(&self, b: &mut [Vec<f64>]) {
        for i in 0..b.len() {
            let (solved, rest) = b.split_at_mut(i);
            let (own, l) = (&mut rest[0], self.factor.row(i));
            for (row, l) in solved.iter().zip(l) {
                for (value, known) in own.iter_mut().zip(row) {
                    *value -= l * known;
                }
            }
            own.iter_mut().for_each(|value| *value /= l[i]);
        }
    }

    /// As [`Self::solve_lower`], where the elements of b before `first` are 0.
    fn solve_lower_from(&self, first: usize, b: &mut [f64]) {
        for i in first..b.len() {
            let row = self.factor.row(i);
            b[i] = (b[i] - dot(&row[first..i], &b[first..i])) / row[i];
        }
    }

    /// A⁻¹ of a definite matrix.
    pub(crate) fn inverse(&self) -> Matrix {
        let size = self.pivots.len();
        let column_of_inverse_factor = |j: usize| {
            let mut unit = vec![0.0; size];
            unit[j] = 1.0;
            self.solve_lower_from(j, &mut unit);
            unit
        };
        let columns: Vec<Vec<f64>> = (0..size).map(column_of_inverse_factor).collect();
        Matrix::from_fn(size, size, |i, j| {
            let first = i.max(j);
            dot(&columns[i][first..], &columns[j][first..])
        })
    }

    /// x of Lᵀx = b of a definite matrix: with standard normal b its covariance is A⁻¹.
    pub(crate) fn solve_transposed(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for i in (0..b.len()).rev() {
            let later = i + 1..b.len();
            let known: f64 = later.map(|k| self.factor.get(k, i) * x[k]).sum();
            x[i] = (x[i] - known) / self.factor.get(i, i);
        }
        x
    }

    /// The diagonal of A⁻¹.
    pub(crate) fn inverse_diagonal(&self) -> Vec<f64> {
        let element = |i: usize| {
            let mut unit = vec![0.0; self.pivots.len()];
            unit[i] = 1.0;
            self.solve(&unit)[i]
        };
        (0..self.pivots.len()).map(element).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The columns (1, 2, 2), (0, 1, 1), (0, 0, 3) of L.
    fn example() -> SymmetricMatrix {
        let mut a = SymmetricMatrix::zero(3);
        for column in [[1.0, 2.0, 2.0], [0.0, 1.0, 1.0], [0.0, 0.0, 3.0]] {
            a.add_outer(1.0, &column);
        }
        a
    }

    #[test]
    fn a_definite_matrix_is_factored_and_solved() {
        let factor = Cholesky::definite(&example()).unwrap();
        assert_eq!(factor.pivots, [1.0, 1.0, 9.0]);
        assert_eq!(factor.times(&[1.0, 1.0, 1.0]), [1.0, 3.0, 6.0]);
        assert!((factor.log_determinant() - 9f64.ln()).abs() < 1e-15);
        // A (1, 1, 1)ᵀ: the row sums of A.
        let sums = [0, 1, 2].map(|i| (0..3).map(|j| example().get(i, j)).sum());
        assert_eq!(factor.solve(&sums), [1.0, 1.0, 1.0]);
        assert!((factor.inverse_diagonal()[2] - 1.0 / 9.0).abs() < 1e-15);
        // L (1, 1, 1)ᵀ and L (0, 2, 1)ᵀ.
        let mut rows = vec![vec![1.0, 0.0], vec![3.0, 2.0], vec![6.0, 5.0]];
        factor.solve_lower_rows(&mut rows);
        assert_eq!(rows, [[1.0, 0.0], [1.0, 2.0], [1.0, 1.0]]);
        // L⁻¹ has the rows (1, 0, 0), (−2, 1, 0), (0, −1/3, 1/3).
        let inverse = [
            [5.0, -2.0, 0.0],
            [-2.0, 1.0 + 1.0 / 9.0, -1.0 / 9.0],
            [0.0, -1.0 / 9.0, 1.0 / 9.0],
        ];
        let found = factor.inverse();
        for (i, row) in inverse.iter().enumerate() {
            for (j, known) in row.iter().enumerate() {
                assert!((found[(i, j)] - known).abs() < 1e-15, "{i} {j}");
            }
        }
    }

    #[test]
    fn a_variable_that_others_determine_is_left_out() {
        let mut a = SymmetricMatrix::zero(2);
        a.add_outer(1.0, &[1.0, 2.0]);
        let factor = Cholesky::semidefinite(&a, |_| 1e-12).unwrap();
        assert_eq!((factor.rank(), factor.pivots[1]), (1, 0.0));
        assert_eq!(factor.solve(&[3.0, 6.0]), [3.0, 0.0]);
        assert!(Cholesky::definite(&a).is_none() && Cholesky::positive(&a).is_none());
        let close = SymmetricMatrix::from_fn(2, |i, j| [[1.0, 2.0], [2.0, 4.0 + 1e-14]][i][j]);
        assert!(Cholesky::definite(&close).is_none() && Cholesky::positive(&close).is_some());
        a.add(1, 1, f64::INFINITY);
        assert!(Cholesky::semidefinite(&a, |_| 1e-12).is_none());
    }
}
