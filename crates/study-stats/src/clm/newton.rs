//! Newton's method for a likelihood of few parameters, with step halving.

/// A symmetric matrix: the lower triangle by rows.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SymmetricMatrix {
    size: usize,
    lower: Vec<f64>,
}

impl SymmetricMatrix {
    /// All zero.
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            size,
            lower: vec![0.0; size * (size + 1) / 2],
        }
    }

    /// Element (i, j), which is also (j, i).
    pub(crate) fn get(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.max(j), i.min(j));
        self.lower[i * (i + 1) / 2 + j]
    }

    /// Adds to element (i, j), which is also (j, i).
    pub(crate) fn add(&mut self, i: usize, j: usize, value: f64) {
        let (i, j) = (i.max(j), i.min(j));
        self.lower[i * (i + 1) / 2 + j] += value;
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

    /// The sum of two.
    pub(crate) fn plus(&mut self, other: &Self) {
        for (a, b) in self.lower.iter_mut().zip(&other.lower) {
            *a += b;
        }
    }

    fn negated(&self) -> Self {
        Self {
            size: self.size,
            lower: self.lower.iter().map(|v| -v).collect(),
        }
    }

    /// L of A = LLᵀ; `None` unless A is clearly positive definite.
    fn cholesky(&self) -> Option<Self> {
        let mut l = Self::zero(self.size);
        for i in 0..self.size {
            for j in 0..=i {
                let dot: f64 = (0..j).map(|k| l.get(i, k) * l.get(j, k)).sum();
                let left = self.get(i, j) - dot;
                if i == j {
                    if !(left > 1e-13 * self.get(i, i).abs() && left.is_finite()) {
                        return None;
                    }
                    l.add(i, i, left.sqrt());
                } else {
                    l.add(i, j, left / l.get(j, j));
                }
            }
        }
        Some(l)
    }

    /// x of LLᵀx = b.
    fn solve(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for i in 0..self.size {
            let dot: f64 = (0..i).map(|k| self.get(i, k) * x[k]).sum();
            x[i] = (x[i] - dot) / self.get(i, i);
        }
        for i in (0..self.size).rev() {
            let dot: f64 = (i + 1..self.size).map(|k| self.get(k, i) * x[k]).sum();
            x[i] = (x[i] - dot) / self.get(i, i);
        }
        x
    }

    /// The diagonal of A⁻¹; `None` unless A is positive definite.
    pub(crate) fn inverse_diagonal(&self) -> Option<Vec<f64>> {
        let l = self.cholesky()?;
        let column = |i: usize| {
            let mut unit = vec![0.0; self.size];
            unit[i] = 1.0;
            l.solve(&unit)[i]
        };
        Some((0..self.size).map(column).collect())
    }
}

/// A log-likelihood with its derivatives at some parameters.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Evaluation {
    /// The log-likelihood.
    pub(crate) value: f64,
    /// First derivatives.
    pub(crate) gradient: Vec<f64>,
    /// Second derivatives.
    pub(crate) hessian: SymmetricMatrix,
}

impl Evaluation {
    /// Nothing yet.
    pub(crate) fn zero(size: usize) -> Self {
        Self {
            value: 0.0,
            gradient: vec![0.0; size],
            hessian: SymmetricMatrix::zero(size),
        }
    }
}

/// Where the search ended.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Maximum {
    /// The parameters.
    pub(crate) at: Vec<f64>,
    /// The log-likelihood.
    pub(crate) value: f64,
    /// Less the second derivatives.
    pub(crate) information: SymmetricMatrix,
}

/// No parameter moves further in one step: the scale is that of logits.
const LONGEST_STEP: f64 = 2.0;

const MOST_STEPS: usize = 100;

/// A step that promises less than this of log-likelihood is the last one.
const PROMISE: f64 = 1e-9;

/// The maximum of a smooth log-likelihood; `None` if the search finds none.
///
/// A step solves (−H + ρ·diag|H|)·δ = g with the smallest ρ of 0, 10⁻³, 10⁻² …
/// that makes the matrix positive definite, and is halved until the value does
/// not fall. `at` is `None` where the parameters are not admissible. The last
/// step, once the promise ½gᵀδ is small, squares what is left of the error.
pub(crate) fn maximise(
    start: Vec<f64>,
    mut at: impl FnMut(&[f64]) -> Option<Evaluation>,
) -> Option<Maximum> {
    let mut here = start;
    let mut point = at(&here)?;
    for _ in 0..MOST_STEPS {
        let (step, newton) = direction(&point)?;
        let promise: f64 = 0.5
            * step
                .iter()
                .zip(&point.gradient)
                .map(|(a, b)| a * b)
                .sum::<f64>();
        let last = newton && promise < PROMISE;
        let longest = step.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut share = (LONGEST_STEP / longest).min(1.0);
        let slack = 1e-13 * point.value.abs();
        let mut found = None;
        while share > 1e-10 {
            let there: Vec<f64> = here.iter().zip(&step).map(|(x, d)| x + share * d).collect();
            match at(&there) {
                Some(next) if next.value >= point.value - slack => {
                    found = Some((there, next));
                    break;
                }
                // The promise is below the rounding of the value.
                _ if last => break,
                _ => share *= 0.5,
            }
        }
        match found {
            Some((there, next)) => (here, point) = (there, next),
            None if last => {}
            None => return None,
        }
        if last {
            return Some(Maximum {
                at: here,
                value: point.value,
                information: point.hessian.negated(),
            });
        }
    }
    None
}

/// The step, and whether it is Newton's own.
fn direction(point: &Evaluation) -> Option<(Vec<f64>, bool)> {
    let information = point.hessian.negated();
    let mut ridge = 0.0;
    while ridge < 1e9 {
        let mut matrix = information.clone();
        for i in 0..matrix.size {
            let diagonal = information.get(i, i).abs().max(1e-12);
            matrix.add(i, i, ridge * diagonal);
        }
        if let Some(l) = matrix.cholesky() {
            return Some((l.solve(&point.gradient), ridge == 0.0));
        }
        ridge = if ridge == 0.0 { 1e-3 } else { ridge * 10.0 };
    }
    None
}
