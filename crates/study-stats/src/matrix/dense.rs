//! Rectangular matrices with all their elements.

use std::ops::{Add, Index, IndexMut, Mul, Sub};

/// A rectangular matrix, stored by rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Matrix {
    rows: usize,
    columns: usize,
    elements: Vec<f64>,
}

impl Matrix {
    /// All elements 0.
    pub(crate) fn zeros(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            elements: vec![0.0; rows * columns],
        }
    }

    /// The matrix with the elements `element(i, j)`.
    pub(crate) fn from_fn(
        rows: usize,
        columns: usize,
        element: impl Fn(usize, usize) -> f64,
    ) -> Self {
        let places = (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j)));
        Self {
            rows,
            columns,
            elements: places.map(|(i, j)| element(i, j)).collect(),
        }
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    /// Row i.
    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.elements[i * self.columns..(i + 1) * self.columns]
    }

    fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.elements[i * self.columns..(i + 1) * self.columns]
    }

    /// All elements, row after row.
    pub(crate) fn elements(&self) -> &[f64] {
        &self.elements
    }

    /// Aᵀ.
    pub(crate) fn transposed(&self) -> Self {
        Self::from_fn(self.columns, self.rows, |i, j| self[(j, i)])
    }

    /// Ax.
    pub(crate) fn times(&self, x: &[f64]) -> Vec<f64> {
        (0..self.rows).map(|i| dot(self.row(i), x)).collect()
    }

    /// tr A.
    pub(crate) fn trace(&self) -> f64 {
        (0..self.rows).map(|i| self[(i, i)]).sum()
    }

    /// tr AB, without the product.
    pub(crate) fn trace_of_product(&self, b: &Self) -> f64 {
        let column = |i: usize| (0..self.columns).map(move |k| b[(k, i)]);
        let diagonal = |i: usize| self.row(i).iter().zip(column(i)).map(|(x, y)| x * y);
        (0..self.rows).flat_map(diagonal).sum()
    }
}

impl Index<(usize, usize)> for Matrix {
    type Output = f64;

    fn index(&self, (i, j): (usize, usize)) -> &f64 {
        &self.elements[i * self.columns + j]
    }
}

impl IndexMut<(usize, usize)> for Matrix {
    fn index_mut(&mut self, (i, j): (usize, usize)) -> &mut f64 {
        &mut self.elements[i * self.columns + j]
    }
}

impl Mul<&Matrix> for &Matrix {
    type Output = Matrix;

    fn mul(self, b: &Matrix) -> Matrix {
        let mut product = Matrix::zeros(self.rows, b.columns);
        for i in 0..self.rows {
            for (k, a) in self.row(i).iter().enumerate() {
                for (sum, b) in product.row_mut(i).iter_mut().zip(b.row(k)) {
                    *sum += a * b;
                }
            }
        }
        product
    }
}

impl Mul<&Matrix> for Matrix {
    type Output = Matrix;

    fn mul(self, b: &Matrix) -> Matrix {
        &self * b
    }
}

impl Mul<f64> for Matrix {
    type Output = Matrix;

    fn mul(mut self, factor: f64) -> Matrix {
        self.elements.iter_mut().for_each(|v| *v *= factor);
        self
    }
}

impl Add<&Matrix> for Matrix {
    type Output = Matrix;

    fn add(mut self, b: &Matrix) -> Matrix {
        let pairs = self.elements.iter_mut().zip(&b.elements);
        pairs.for_each(|(a, b)| *a += b);
        self
    }
}

impl Sub<&Matrix> for Matrix {
    type Output = Matrix;

    fn sub(mut self, b: &Matrix) -> Matrix {
        let pairs = self.elements.iter_mut().zip(&b.elements);
        pairs.for_each(|(a, b)| *a -= b);
        self
    }
}

/// Σ aᵢbᵢ.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_sums_and_traces() {
        let a = Matrix::from_fn(2, 3, |i, j| (3 * i + j) as f64); // 0 1 2; 3 4 5
        let b = Matrix::from_fn(3, 2, |i, j| (i + 10 * j) as f64); // 0 10; 1 11; 2 12
        let product = Matrix::from_fn(2, 2, |i, j| [[5.0, 35.0], [14.0, 134.0]][i][j]);
        assert_eq!(&a * &b, product);
        assert_eq!(product.trace(), 139.0);
        assert_eq!(a.trace_of_product(&b), 139.0);
        assert_eq!(a.times(&[1.0, 1.0, 2.0]), [5.0, 17.0]);
        assert_eq!(a.transposed()[(2, 1)], 5.0);
        assert_eq!(a.clone() * 2.0 - &a, a);
        assert_eq!(a.clone() + &a, a * 2.0);
    }
}
