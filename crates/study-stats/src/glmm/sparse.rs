//! Factors LDLᵀ of sparse symmetric matrices, and the elements of the inverse on their pattern.
//!
//! Crossed and nested random intercepts fill few elements, if the factor with most levels is
//! eliminated first: of participants and realizations only the block of the realizations is dense.
//! The pattern of L is found once for a model (George & Liu 1981); the elements of the inverse are
//! those of Takahashi, Fagan & Chen (1973).

use std::collections::BTreeSet;

/// The elements of L below the diagonal that are not 0, by columns.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    /// Where each column begins, and where the last one ends.
    start: Vec<usize>,
    /// Row of each element, ascending in a column.
    rows: Vec<usize>,
}

/// D and L of A = LDLᵀ.
#[derive(Debug)]
pub(super) struct Factor<'a> {
    pattern: &'a Pattern,
    diagonal: Vec<f64>,
    below: Vec<f64>,
}

/// Elements of a symmetric matrix: its diagonal, and those of the pattern.
#[derive(Debug, Clone)]
pub(super) struct Elements {
    pub(super) diagonal: Vec<f64>,
    pub(super) below: Vec<f64>,
}

impl Pattern {
    /// That of a matrix of this size, with elements at each pair of places of each row. `None` if L
    /// has more than `most` elements.
    pub(super) fn of<'r>(
        size: usize,
        rows: impl Iterator<Item = &'r [usize]>,
        most: usize,
    ) -> Option<Self> {
        let mut columns: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); size];
        for places in rows {
            for (i, &place) in places.iter().enumerate() {
                columns[place].extend(&places[i + 1..]);
            }
        }
        let mut found = Self {
            start: vec![0],
            rows: Vec::new(),
        };
        for j in 0..size {
            let own = std::mem::take(&mut columns[j]);
            // What is left of a column fills that of its first element.
            if let Some(&next) = own.first() {
                columns[next].extend(own.iter().skip(1));
            }
            found.rows.extend(own);
            found.start.push(found.rows.len());
            if found.rows.len() > most {
                return None;
            }
        }
        Some(found)
    }

    fn size(&self) -> usize {
        self.start.len() - 1
    }

    fn column(&self, j: usize) -> std::ops::Range<usize> {
        self.start[j]..self.start[j + 1]
    }

    /// The place of element (i, j), i > j, which has to be of the pattern.
    pub(super) fn element(&self, i: usize, j: usize) -> usize {
        let column = self.column(j);
        column.start + self.rows[column].partition_point(|&row| row < i)
    }

    /// The unit matrix.
    pub(super) fn unit(&self) -> Elements {
        Elements {
            diagonal: vec![1.0; self.size()],
            below: vec![0.0; self.rows.len()],
        }
    }

    /// The factor of a positive definite matrix; `None` if it is not, or not finite.
    pub(super) fn factor(&self, matrix: Elements) -> Option<Factor<'_>> {
        let Elements {
            mut diagonal,
            mut below,
        } = matrix;
        for j in 0..self.size() {
            let d = diagonal[j];
            if !(d > 0.0 && d.is_finite()) {
                return None;
            }
            let column = self.column(j);
            for a in column.clone() {
                let target = self.rows[a];
                let share = below[a] / d;
                diagonal[target] -= share * below[a];
                // The rest of the column is of the pattern of `target`.
                let mut at = self.start[target];
                for b in a + 1..column.end {
                    while self.rows[at] < self.rows[b] {
                        at += 1;
                    }
                    below[at] -= share * below[b];
                }
            }
            below[column].iter_mut().for_each(|x| *x /= d);
        }
        Some(Factor {
            pattern: self,
            diagonal,
            below,
        })
    }
}

impl Factor<'_> {
    /// ln det A.
    pub(super) fn log_determinant(&self) -> f64 {
        self.diagonal.iter().map(|d| d.ln()).sum()
    }

    /// x of Ax = b.
    pub(super) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let rows = &self.pattern.rows;
        let mut x = b.to_vec();
        for j in 0..x.len() {
            for a in self.pattern.column(j) {
                x[rows[a]] -= self.below[a] * x[j];
            }
        }
        for j in (0..x.len()).rev() {
            let known = self.pattern.column(j).map(|a| self.below[a] * x[rows[a]]);
            x[j] = x[j] / self.diagonal[j] - known.sum::<f64>();
        }
        x
    }

    /// The elements of A⁻¹ on the pattern.
    pub(super) fn inverse(&self) -> Elements {
        let (pattern, rows) = (self.pattern, &self.pattern.rows);
        let mut diagonal = vec![0.0; pattern.size()];
        let mut below = vec![0.0; rows.len()];
        for j in (0..pattern.size()).rev() {
            let column = pattern.column(j);
            for a in column.clone() {
                let i = rows[a];
                // Σ over the column's elements k of L(k, j) A⁻¹(k, i).
                let sum: f64 = column
                    .clone()
                    .map(|b| {
                        let k = rows[b];
                        let known = match k.cmp(&i) {
                            std::cmp::Ordering::Equal => diagonal[i],
                            std::cmp::Ordering::Less => below[pattern.element(i, k)],
                            std::cmp::Ordering::Greater => below[pattern.element(k, i)],
                        };
                        self.below[b] * known
                    })
                    .sum();
                below[a] = -sum;
            }
            let known: f64 = column.map(|a| self.below[a] * below[a]).sum();
            diagonal[j] = 1.0 / self.diagonal[j] - known;
        }
        Elements { diagonal, below }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::{Cholesky, SymmetricMatrix};

    /// Four places, of which the pairs (0, 2), (0, 3), (1, 2) are given and (2, 3) is filled.
    #[test]
    fn the_factor_solves_and_inverts_like_a_dense_one() {
        let rows: [&[usize]; 3] = [&[0, 2, 3], &[1, 2], &[0, 2]];
        let pattern = Pattern::of(4, rows.into_iter(), 100).unwrap();
        assert_eq!(pattern.rows, [2, 3, 2, 3]);
        let mut sparse = pattern.unit();
        let mut dense = SymmetricMatrix::zero(4);
        (0..4).for_each(|i| dense.add(i, i, 1.0));
        let weights = [0.7, 2.0, 1.5];
        for (places, w) in rows.iter().zip(weights) {
            for (i, &a) in places.iter().enumerate() {
                sparse.diagonal[a] += w;
                dense.add(a, a, w);
                for &b in &places[..i] {
                    sparse.below[pattern.element(a, b)] += w;
                    dense.add(a, b, w);
                }
            }
        }
        let (sparse, dense) = (
            pattern.factor(sparse).unwrap(),
            Cholesky::definite(&dense).unwrap(),
        );
        assert!((sparse.log_determinant() - dense.log_determinant()).abs() < 1e-12);
        let b = [1.0, -2.0, 0.5, 3.0];
        for (x, y) in sparse.solve(&b).iter().zip(dense.solve(&b)) {
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
        let (own, whole) = (sparse.inverse(), dense.inverse());
        for i in 0..4 {
            assert!((own.diagonal[i] - whole[(i, i)]).abs() < 1e-12);
        }
        for (i, j) in [(2, 0), (3, 0), (2, 1), (3, 2)] {
            assert!((own.below[pattern.element(i, j)] - whole[(i, j)]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_pattern_that_fills_too_much_gives_none() {
        let star: [&[usize]; 2] = [&[0, 1], &[0, 2]];
        assert!(Pattern::of(3, star.into_iter(), 2).is_none());
        assert!(Pattern::of(3, star.into_iter(), 3).is_some());
    }
}
