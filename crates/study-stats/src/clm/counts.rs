//! The counts for an ordinal model: how often each subject used each category under each
//! predictor. They are sufficient for the likelihood, so the cost of a fit does not
//! depend on the number of trials.

use super::ClmError;
use super::newton::Evaluation;
use crate::matrix::SymmetricMatrix;
use std::ops::Range;

/// A row of the design matrix. It has at most one non-zero column: a dummy variable or a
/// covariate. A reference level has x = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Predictor {
    /// Index of the column, and of its coefficient in β.
    pub column: usize,
    /// Value in that column.
    pub x: f64,
}

/// The number of equal ratings of a subject under a predictor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct CategoryCount {
    /// Any number that identifies the subject.
    pub subject: u32,
    /// Index of the [`Predictor`].
    pub predictor: u32,
    /// Category, from 0; every category has to be used by somebody.
    pub category: u32,
    /// Number of ratings.
    pub n: u32,
}

/// The counts of one subject for a predictor and a threshold.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Term {
    /// predictor · (J − 1) + threshold.
    pub(crate) place: usize,
    /// Ratings in the category below the threshold.
    pub(crate) n: f64,
    /// Ratings in the two categories adjacent to it.
    pub(crate) m: f64,
}

/// Counts, prepared for fitting.
#[derive(Debug, Clone)]
pub struct CategoryCounts {
    thresholds: usize,
    columns: usize,
    predictors: Vec<Predictor>,
    terms: Vec<Term>,
    subjects: Vec<Range<usize>>,
    /// (n, m) over all subjects, by place.
    pooled: Vec<(f64, f64)>,
    /// Ratings by category.
    used: Vec<f64>,
    /// Lowest and highest category of each predictor.
    extent: Vec<Option<(usize, usize)>>,
}

impl CategoryCounts {
    /// Prepares counts, in any order, for the rows `predictors` of a design with
    /// `columns` columns, and `categories` categories. Counts whose predictor or category
    /// is out of range are left out.
    pub fn new(
        predictors: Vec<Predictor>,
        columns: usize,
        categories: usize,
        counts: &[CategoryCount],
    ) -> Self {
        let t = categories.saturating_sub(1);
        let mut counts: Vec<CategoryCount> = counts
            .iter()
            .copied()
            .filter(|c| {
                (c.predictor as usize) < predictors.len() && (c.category as usize) < categories
            })
            .filter(|c| c.n > 0)
            .collect();
        counts.sort_unstable();
        let mut table = Self {
            thresholds: t,
            columns,
            terms: Vec::new(),
            subjects: Vec::new(),
            pooled: vec![(0.0, 0.0); predictors.len() * t],
            used: vec![0.0; categories],
            extent: vec![None; predictors.len()],
            predictors,
        };
        let mut cell = vec![(0.0, 0.0); t];
        for subject in counts.chunk_by(|a, b| a.subject == b.subject) {
            let from = table.terms.len();
            for group in subject.chunk_by(|a, b| a.predictor == b.predictor) {
                cell.fill((0.0, 0.0));
                let g = group[0].predictor as usize;
                for c in group {
                    table.tally(g, c.category as usize, f64::from(c.n), &mut cell);
                }
                for (j, &(n, m)) in cell.iter().enumerate().filter(|(_, (_, m))| *m > 0.0) {
                    let place = g * t + j;
                    table.pooled[place].0 += n;
                    table.pooled[place].1 += m;
                    table.terms.push(Term { place, n, m });
                }
            }
            table.subjects.push(from..table.terms.len());
        }
        table
    }

    /// Adds a count to the totals and to the `cell` of its subject and predictor.
    fn tally(&mut self, g: usize, category: usize, n: f64, cell: &mut [(f64, f64)]) {
        self.used[category] += n;
        if let Some((below, beside)) = cell.get_mut(category) {
            *below += n;
            *beside += n;
        }
        if category > 0 {
            cell[category - 1].1 += n;
        }
        let (low, high) = self.extent[g].unwrap_or((category, category));
        self.extent[g] = Some((low.min(category), high.max(category)));
    }

    /// Number of thresholds, J − 1.
    pub fn thresholds(&self) -> usize {
        self.thresholds
    }

    /// Number of thresholds and coefficients.
    pub fn parameters(&self) -> usize {
        self.thresholds + self.columns
    }

    /// Number of subjects.
    pub fn subjects(&self) -> usize {
        self.subjects.len()
    }

    /// Whether finite estimates exist, from the directions in which the likelihood never
    /// decreases (after Albert & Anderson 1984).
    ///
    /// If θ moves by t, increasing in j, and xβ by d, then ln P(Y = j) never decreases if
    /// and only if tⱼ₋₁ ≤ d ≤ tⱼ. For a predictor whose ratings span low … high this means
    /// t_high−1 ≤ d ≤ t_low. With a dummy for each predictor but the first every d is free:
    /// the estimates are finite if the spans link all thresholds together and no predictor
    /// has all its ratings in the lowest or all in the highest category. With one column
    /// d = ±x: such a t exists if for every j the largest d with low ≤ j is at most the
    /// smallest d with high > j.
    ///
    /// # Errors
    /// The reason why an estimate does not exist.
    pub fn estimable(&self) -> Result<(), ClmError> {
        if self.thresholds == 0 {
            return Err(ClmError::OneCategory);
        }
        let seen: Vec<(Predictor, (usize, usize))> = self
            .predictors
            .iter()
            .zip(&self.extent)
            .filter_map(|(p, e)| e.map(|e| (*p, e)))
            .collect();
        let differ = seen.windows(2).any(|w| w[0].0 != w[1].0);
        if self.columns == 0 || !differ {
            return Err(ClmError::OnePredictor);
        }
        let infinite = if self.columns > 1 {
            self.dummies_separate(&seen)
        } else {
            [1.0, -1.0].iter().any(|sign| {
                (0..self.thresholds).all(|j| {
                    let reach = |(p, _): &(Predictor, _)| sign * p.x;
                    let under = seen.iter().filter(|(_, e)| e.0 <= j).map(reach);
                    let over = seen.iter().filter(|(_, e)| e.1 > j).map(reach);
                    under.fold(f64::NEG_INFINITY, f64::max) <= over.fold(f64::INFINITY, f64::min)
                })
            })
        };
        if infinite {
            Err(ClmError::Separated)
        } else {
            Ok(())
        }
    }

    fn dummies_separate(&self, seen: &[(Predictor, (usize, usize))]) -> bool {
        let top = self.thresholds;
        // Whether threshold j has to move with threshold j − 1.
        let mut linked = vec![false; top];
        for (_, (low, high)) in seen.iter().filter(|(_, e)| e.0 < e.1) {
            linked[low + 1..*high].fill(true);
        }
        let outer = |e: &(usize, usize)| *e == (0, 0) || *e == (top, top);
        linked[1..].iter().any(|c| !c) || seen.iter().any(|(_, e)| outer(e))
    }

    /// Logits of the cumulative shares.
    pub(super) fn marginal_logits(&self) -> Vec<f64> {
        let all: f64 = self.used.iter().sum();
        let mut below = 0.0;
        self.used[..self.thresholds]
            .iter()
            .map(|n| {
                below += n;
                (below / (all - below)).ln()
            })
            .collect()
    }

    /// The rows of the design.
    pub(crate) fn predictors(&self) -> &[Predictor] {
        &self.predictors
    }

    /// Number of predictors with a rating.
    pub(crate) fn realizations_used(&self) -> usize {
        self.extent.iter().flatten().count()
    }

    /// aₖ of every place, without the random intercept.
    pub(crate) fn linear(&self, at: &[f64]) -> Vec<f64> {
        let t = self.thresholds;
        let mut a = Vec::with_capacity(self.pooled.len());
        for p in &self.predictors {
            let shift = p.x * at[t + p.column];
            a.extend(at[..t].iter().map(|theta| theta - shift));
        }
        a
    }

    /// (n, m) of every place, over all subjects.
    pub(crate) fn pooled(&self) -> &[(f64, f64)] {
        &self.pooled
    }

    /// The terms of each subject.
    pub(crate) fn by_subject(&self) -> impl Iterator<Item = &[Term]> {
        self.subjects.iter().map(|r| &self.terms[r.clone()])
    }

    /// Σ Nⱼκ(θⱼ − θⱼ₋₁) with κ′ = 1/(e^δ − 1), κ″ = −κ′(1 + κ′), among `size`
    /// parameters; `None` if the thresholds do not increase.
    pub(crate) fn spacing(&self, at: &[f64], size: usize) -> Option<Evaluation> {
        let mut point = Evaluation::zero(size);
        for j in 1..self.thresholds {
            let gap = at[j] - at[j - 1];
            if !(gap > 0.0 && gap.is_finite()) {
                return None;
            }
            let n = self.used[j];
            let first = 1.0 / gap.exp_m1();
            let second = -first * (1.0 + first);
            point.value += n * (-(-gap).exp_m1()).ln();
            point.gradient[j] += n * first;
            point.gradient[j - 1] -= n * first;
            point.hessian.add(j, j, n * second);
            point.hessian.add(j - 1, j - 1, n * second);
            point.hessian.add(j, j - 1, -n * second);
        }
        Some(point)
    }

    /// Adds Σ wₖ ∂aₖ, with a weight for every place.
    pub(crate) fn add_gradient(&self, weights: &[f64], to: &mut [f64]) {
        let t = self.thresholds;
        for (p, weights) in self.predictors.iter().zip(weights.chunks_exact(t)) {
            for (j, w) in weights.iter().enumerate() {
                to[j] += w;
                to[t + p.column] -= p.x * w;
            }
        }
    }

    /// Adds Σ wₖ ∂aₖ, with a weight for each term of one subject.
    pub(crate) fn add_terms(&self, terms: &[Term], weights: &[f64], to: &mut [f64]) {
        let t = self.thresholds;
        for (term, w) in terms.iter().zip(weights) {
            let p = self.predictors[term.place / t];
            to[term.place % t] += w;
            to[t + p.column] -= p.x * w;
        }
    }

    /// Adds Σ wₖ ∂aₖ∂aₖᵀ, with a weight for every place.
    pub(crate) fn add_hessian(&self, weights: &[f64], to: &mut SymmetricMatrix) {
        let t = self.thresholds;
        for (p, weights) in self.predictors.iter().zip(weights.chunks_exact(t)) {
            let column = t + p.column;
            for (j, w) in weights.iter().enumerate() {
                to.add(j, j, *w);
                to.add(column, j, -p.x * w);
                to.add(column, column, p.x * p.x * w);
            }
        }
    }
}
