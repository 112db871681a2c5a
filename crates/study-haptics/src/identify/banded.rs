//! Symmetric banded systems, with bounds on the unknowns.
//!
//! [`Banded::solve`] is a Cholesky factorization within the band: n·h² operations
//! for n unknowns and half-bandwidth h. The last unknowns may be coupled with all others
//! ([`Banded::bordered`]), which the factorization preserves as well. [`Banded::solve_bounded`] minimizes
//! ½xᵀAx − rᵀx with some x ≥ 0 by block principal pivoting (Portugal, Júdice &
//! Vicente 1994, Math. Comp. 63:625): all unknowns that violate a condition are
//! exchanged at once, and one at a time where that does not help, which terminates
//! for every positive definite A.

/// A symmetric matrix with `half` diagonals on either side of the main one, and full
/// rows for the last unknowns.
#[derive(Debug, Clone)]
pub(super) struct Banded {
    n: usize,
    /// The first column of each row.
    first: Vec<usize>,
    /// Where each row begins in `lower`; one more than there are rows.
    start: Vec<usize>,
    /// Row by row, from its first column to the diagonal.
    lower: Vec<f64>,
}

/// The constraint on an unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Bound {
    /// Any value.
    Free,
    /// 0 or more.
    NotNegative,
    /// Fixed at 0.
    Zero,
}

impl Bound {
    /// Of a term that is not negative, or left out.
    pub(super) fn of_term(kept: bool) -> Self {
        if kept { Self::NotNegative } else { Self::Zero }
    }
}

/// Block exchanges in a row that may fail to reduce the number of violations.
const MAX_FAILED_EXCHANGES: usize = 3;
/// Pivots below this share of their diagonal element are rounding errors.
const SINGULAR: f64 = 1e-13;

impl Banded {
    pub(super) fn zero(n: usize, half: usize) -> Self {
        Self::bordered(n, half, 0)
    }

    /// With `full` more unknowns at the end, which may be coupled with all others.
    pub(super) fn bordered(n: usize, half: usize, full: usize) -> Self {
        let first: Vec<usize> = (0..n)
            .map(|i| i.saturating_sub(half))
            .chain(std::iter::repeat_n(0, full))
            .collect();
        let mut start = vec![0];
        for (i, first) in first.iter().enumerate() {
            start.push(start[i] + i + 1 - first);
        }
        Self {
            n: n + full,
            lower: vec![0.0; start[n + full]],
            first,
            start,
        }
    }

    fn at(&self, i: usize, j: usize) -> usize {
        self.start[i] + j - self.first[i]
    }

    /// Adds `value` to (i, j) and (j, i); j ≤ i, within the band or the border.
    pub(super) fn add(&mut self, i: usize, j: usize, value: f64) {
        let at = self.at(i, j);
        self.lower[at] += value;
    }

    /// Adds `scale` times a matrix of the same shape.
    pub(super) fn add_scaled(&mut self, other: &Self, scale: f64) {
        for (sum, one) in self.lower.iter_mut().zip(&other.lower) {
            *sum += scale * one;
        }
    }

    /// The product A x.
    pub(super) fn times(&self, x: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; self.n];
        for i in 0..self.n {
            for j in self.first[i]..=i {
                let value = self.lower[self.at(i, j)];
                product[i] += value * x[j];
                if j < i {
                    product[j] += value * x[i];
                }
            }
        }
        product
    }

    /// The minimum with the unknowns that are not `free` held at 0; `None` if A is
    /// singular in the others.
    pub(super) fn solve(&self, right: &[f64], free: &[bool]) -> Option<Vec<f64>> {
        let mut factor = self.lower.clone();
        for i in 0..self.n {
            let first = self.first[i];
            for j in first..=i {
                let at = self.at(i, j);
                if !(free[i] && free[j]) {
                    factor[at] = if i == j { 1.0 } else { 0.0 };
                    continue;
                }
                let start = first.max(self.first[j]);
                let (row_i, row_j) = (self.at(i, start), self.at(j, start));
                let done: f64 = factor[row_i..row_i + j - start]
                    .iter()
                    .zip(&factor[row_j..row_j + j - start])
                    .map(|(a, b)| a * b)
                    .sum();
                let left = factor[at] - done;
                factor[at] = if i == j {
                    // false for NaN
                    let regular = left > SINGULAR * self.lower[at];
                    if !regular {
                        return None;
                    }
                    left.sqrt()
                } else {
                    left / factor[self.at(j, j)]
                };
            }
        }
        let mut x: Vec<f64> = right
            .iter()
            .zip(free)
            .map(|(r, free)| if *free { *r } else { 0.0 })
            .collect();
        for i in 0..self.n {
            for j in self.first[i]..i {
                x[i] -= factor[self.at(i, j)] * x[j];
            }
            x[i] /= factor[self.at(i, i)];
        }
        for i in (0..self.n).rev() {
            x[i] /= factor[self.at(i, i)];
            for j in self.first[i]..i {
                x[j] -= factor[self.at(i, j)] * x[i];
            }
        }
        Some(x)
    }

    /// The minimum within the bounds; `None` if A is singular.
    pub(super) fn solve_bounded(&self, right: &[f64], bounds: &[Bound]) -> Option<Vec<f64>> {
        let mut free: Vec<bool> = bounds.iter().map(|b| *b != Bound::Zero).collect();
        let mut least = usize::MAX;
        let mut block_exchanges = MAX_FAILED_EXCHANGES;
        // block pivoting needs far fewer; single exchanges may need all of them
        for _ in 0..20 * self.n + 100 {
            let x = self.solve(right, &free)?;
            let violated = self.violated(right, bounds, &free, &x);
            let Some(last) = violated.last() else {
                return Some(x);
            };
            if violated.len() < least {
                least = violated.len();
                block_exchanges = MAX_FAILED_EXCHANGES;
            } else if block_exchanges > 0 {
                block_exchanges -= 1;
            } else {
                free[*last] = !free[*last];
                continue;
            }
            for i in violated {
                free[i] = !free[i];
            }
        }
        None
    }

    /// Bounded unknowns below 0, and those held at 0 whose gradient is negative.
    fn violated(&self, right: &[f64], bounds: &[Bound], free: &[bool], x: &[f64]) -> Vec<usize> {
        let product = self.times(x);
        (0..self.n)
            .filter(|i| {
                if bounds[*i] != Bound::NotNegative {
                    false
                } else if free[*i] {
                    x[*i] < 0.0
                } else {
                    // rounding errors must not exchange an unknown back and forth
                    let rounding = 1e-10 * (product[*i].abs() + right[*i].abs());
                    product[*i] - right[*i] < -rounding
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::rng::Stream;

    /// A positive definite matrix of half-bandwidth 3 and a right-hand side.
    fn system(noise: &mut Stream, n: usize) -> (Banded, Vec<f64>) {
        let half = 3;
        let mut a = Banded::zero(n, half);
        // Σ φφᵀ over windows, like a normal matrix
        for _ in 0..3 * n {
            let first = noise.below(n as u64 - 1) as usize;
            let end = (first + 1 + half).min(n);
            let phi: Vec<f64> = (first..end).map(|_| noise.normal()).collect();
            for (i, p) in phi.iter().enumerate() {
                for (j, q) in phi[..=i].iter().enumerate() {
                    a.add(first + i, first + j, p * q);
                }
            }
        }
        for i in 0..n {
            a.add(i, i, 1e-3);
        }
        (a, (0..n).map(|_| noise.normal()).collect())
    }

    #[test]
    fn a_solution_solves() {
        let mut noise = Stream::new(1, &["banded"]);
        for n in [2, 5, 40] {
            let (a, right) = system(&mut noise, n);
            let x = a.solve(&right, &vec![true; n]).unwrap();
            for (p, r) in a.times(&x).iter().zip(&right) {
                assert!((p - r).abs() < 1e-8, "{p} {r}");
            }
        }
    }

    #[test]
    fn an_unknown_that_is_coupled_with_all_others_is_solved_with_them() {
        let mut noise = Stream::new(3, &["banded"]);
        let n = 30;
        let (band, mut right) = system(&mut noise, n);
        let mut a = Banded::bordered(n, 3, 1);
        for i in 0..n {
            for j in band.first[i]..=i {
                a.add(i, j, band.lower[band.at(i, j)]);
            }
            a.add(n, i, 0.01 * noise.normal());
        }
        a.add(n, n, 2.0);
        right.push(1.0);
        let x = a.solve(&right, &vec![true; n + 1]).unwrap();
        for (p, r) in a.times(&x).iter().zip(&right) {
            assert!((p - r).abs() < 1e-8, "{p} {r}");
        }
    }

    #[test]
    fn a_bounded_solution_meets_the_kkt_conditions() {
        let mut noise = Stream::new(2, &["banded"]);
        let mut at_bounds = 0;
        for round in 0..300 {
            let n = 2 + round % 40;
            let (a, right) = system(&mut noise, n);
            let bounds: Vec<Bound> = (0..n)
                .map(|i| {
                    [
                        Bound::Free,
                        Bound::NotNegative,
                        Bound::NotNegative,
                        Bound::Zero,
                    ][i % 4]
                })
                .collect();
            let x = a.solve_bounded(&right, &bounds).unwrap();
            let slope: Vec<f64> = a.times(&x).iter().zip(&right).map(|(p, r)| p - r).collect();
            for i in 0..n {
                match bounds[i] {
                    Bound::Zero => assert_eq!(x[i], 0.0),
                    Bound::Free => assert!(slope[i].abs() < 1e-7, "{}", slope[i]),
                    Bound::NotNegative => {
                        assert!(x[i] >= 0.0, "{}", x[i]);
                        assert!(slope[i] > -1e-7, "{}", slope[i]);
                        assert!(x[i] == 0.0 || slope[i].abs() < 1e-7);
                        at_bounds += usize::from(x[i] == 0.0);
                    }
                }
            }
        }
        assert!(at_bounds > 500, "{at_bounds}");
    }

    #[test]
    fn a_singular_system_has_no_solution() {
        let mut a = Banded::zero(2, 1);
        for (i, j) in [(0, 0), (1, 0), (1, 1)] {
            a.add(i, j, 1.0);
        }
        assert_eq!(a.solve(&[1.0, 1.0], &[true, true]), None);
        let nothing = Banded::zero(2, 1);
        assert_eq!(nothing.solve_bounded(&[0.0; 2], &[Bound::Free; 2]), None);
    }
}
