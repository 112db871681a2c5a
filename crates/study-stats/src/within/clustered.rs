//! Realizations compared within subjects, with standard errors clustered by subject.
//!
//! The estimates are those of [`Within`]: cell mean ~ subject + realization. Their covariance makes no use of equal
//! variances, or of independent errors within a subject: it is the bias-reduced linearization CR2 of Bell & McCaffrey
//! (2002, Surv. Methodol. 28, 169–181) with the levels of the subjects absorbed, whose working model has independent errors of equal variance,
//! with Satterthwaite's degrees of freedom for one contrast and an approximate Hotelling T² (HTZ) for several (Pustejovsky &
//! Tipton 2018, J. Bus. Econ. Stat. 36, 672–683). In complete tables one contrast is a paired t test and several are Hotelling's T².
//!
//! With H the hat matrix, Ẍᵢ the rows of subject i less their mean and eᵢ the residuals, the adjustment is
//! Aᵢ = (I − Hᵢᵢ)^(−½), by the Moore–Penrose inverse, and a contrast cβ has the variance Σᵢ(pᵢᵀeᵢ)², pᵢ = AᵢẌᵢQcᵀ, Q = (ẌᵀẌ)⁻.
//! Subjects who rated the same realizations share Aᵢ and pᵢ.

mod differences;

pub use differences::Differences;

use super::{Within, WithinError, sums};
use crate::distribution::{f_upper, t_quantile, t_two_sided};
use crate::finite;
use crate::lmm::{CellSummary, ContrastF, ContrastT};
use crate::matrix::{Cholesky, Matrix, SymmetricEigen, SymmetricMatrix, dot};
use std::collections::BTreeMap;

/// Most realizations: the work grows with their cube times the number of different sets that subjects rated.
pub const MAX_CLUSTERED_REALIZATIONS: usize = 100;
/// Most subjects: the work grows with their square.
pub const MAX_CLUSTERED_SUBJECTS: usize = 1000;
/// Most multiplications of a test of several contrasts.
const MAX_PRODUCTS: f64 = 4e9;

/// Eigenvalues up to this are 0: what a subject alone determines.
const NONE_LEFT: f64 = 1e-10;
/// Up to this leverage the root is a power series, above it needs eigenvectors.
const LOW_LEVERAGE: f64 = 0.25;
/// Terms of the series: 0.25²⁸ is below the precision of numbers.
const TERMS: usize = 28;
/// Squared size of a term that changes nothing.
const NEGLIGIBLE: f64 = 1e-34;
/// What rounding may change in a sum of squares.
const ROUNDING: f64 = 1e-9;

/// Realizations compared within subjects, with standard errors clustered by subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Clustered {
    /// The numbers that identify the realizations, sorted.
    pub realizations: Vec<usize>,
    /// For each of them the set of realizations that subjects link, as in [`Within::sets`].
    pub sets: Vec<usize>,
    /// Effects, 0 for the reference of each set.
    effects: Vec<f64>,
    /// Q.
    unit: Matrix,
    patterns: Vec<Pattern>,
    /// Whether anything is left of the ratings.
    varies: bool,
}

/// The subjects who rated the same realizations.
#[derive(Debug, Clone, PartialEq)]
struct Pattern {
    /// Positions of the realizations.
    places: Vec<usize>,
    root: Root,
    /// Residuals of each subject.
    residuals: Vec<Vec<f64>>,
}

/// (I − H)^(−½) on vectors with the sum 0.
#[derive(Debug, Clone, PartialEq)]
enum Root {
    /// H, whose eigenvalues are small.
    Series(Matrix),
    /// The eigenvectors of I − H that are not of 0, by rows, and 1/√ of their eigenvalues.
    Eigen(Matrix, Vec<f64>),
}

/// What the variance of some contrasts needs of a pattern.
struct Part {
    /// pᵢ of each contrast.
    p: Matrix,
    /// Ẍᵢᵀpᵢ of each contrast, over all realizations.
    u: Matrix,
    /// Quᵀ.
    z: Matrix,
}

impl Part {
    /// pᵢᵀ(I − Hᵢᵢ)pᵢ of a contrast.
    fn own(&self, contrast: usize) -> f64 {
        let p = self.p.row(contrast);
        let hat: f64 = (self.u.row(contrast).iter().enumerate())
            .map(|(k, u)| u * self.z[(k, contrast)])
            .sum();
        dot(p, p) - hat
    }
}

impl Clustered {
    /// Compares the realizations of some cells, whatever their covariate. Those of one subject
    /// have to be adjacent.
    ///
    /// # Errors
    /// [`WithinError`].
    pub fn of(cells: &[CellSummary]) -> Result<Self, WithinError> {
        let within = Within::of(cells)?;
        let subjects: Vec<&[CellSummary]> = cells.chunk_by(|a, b| a.subject == b.subject).collect();
        if within.realizations.len() > MAX_CLUSTERED_REALIZATIONS
            || subjects.len() > MAX_CLUSTERED_SUBJECTS
        {
            return Err(WithinError::TooManyClustered);
        }
        let place = |c: &CellSummary| {
            let at = within.realizations.binary_search(&c.realization);
            at.unwrap_or(0)
        };
        let mut patterns: BTreeMap<Vec<usize>, Vec<Vec<f64>>> = BTreeMap::new();
        for own in subjects {
            let mut own: Vec<(usize, f64)> = own.iter().map(|c| (place(c), c.mean)).collect();
            own.sort_by_key(|(at, _)| *at);
            let places: Vec<usize> = own.iter().map(|(at, _)| *at).collect();
            let without = own.iter().map(|(at, y)| y - within.effects[*at]);
            let residuals = centered(&without.collect::<Vec<_>>());
            if places.len() > 1 {
                patterns.entry(places).or_default().push(residuals);
            }
        }
        let patterns = patterns.into_iter().map(|(places, residuals)| Pattern {
            root: Root::of(&places, &within.unit),
            places,
            residuals,
        });
        Ok(Self {
            patterns: patterns.collect(),
            varies: within.error.is_some(),
            realizations: within.realizations,
            sets: within.sets,
            effects: within.effects,
            unit: within.unit,
        })
    }

    /// The same with the means of some realizations moved, by their positions. Their precision stays.
    #[must_use]
    pub fn moved(&self, by: &[f64]) -> Self {
        Self {
            effects: sums(&self.effects, by),
            ..self.clone()
        }
    }

    /// The t test of one contrast of the realizations: weights in the order of `realizations` that sum to 0 in every set, with
    /// Satterthwaite's degrees of freedom. `None` if the weights are no contrast, without residuals, and
    /// if one subject alone determines some of the contrast, because nothing shows how much this subject varies.
    pub fn contrast(&self, weights: &[f64]) -> Option<ContrastT> {
        if !self.varies || !self.is_contrast(weights) {
            return None;
        }
        let contrasts = Matrix::from_fn(1, weights.len(), |_, j| weights[j]);
        let parts = self.parts(&contrasts);
        if !self.is_shown(&contrasts, &parts) {
            return None;
        }
        let estimate = dot(weights, &self.effects);
        let variance = self.covariance(&parts)?.get(0, 0);
        let [trace_squared, _] = sums_of_products(&self.patterns, &parts);
        let expected = self.expected(&parts, 0);
        let df = finite(expected * expected / trace_squared)?;
        let se = variance.sqrt();
        let size = (self.effects.iter().zip(weights)).fold(0.0f64, |most, (effect, weight)| {
            most.max((effect * weight).abs())
        });
        let t = finite(estimate / se).filter(|_| se > 1e-12 * size);
        let half = t_quantile(0.975, df).map(|t| t * se);
        Some(ContrastT {
            estimate,
            se,
            t,
            df: Some(df),
            p: t.and_then(|t| t_two_sided(t, df)),
            ci95: half.map(|half| (estimate - half, estimate + half)),
        })
    }

    /// The approximate Hotelling T² (HTZ) that all contrasts are 0: F on their rank and Satterthwaite's degrees of freedom. `None` if one of
    /// them is no contrast (see [`Self::contrast`]), without residuals, if one subject alone determines some of them, if there are too few subjects for so many contrasts,
    /// and if there are so many of both that it would take minutes.
    pub fn test(&self, contrasts: &[Vec<f64>]) -> Option<ContrastF> {
        if !self.varies || !contrasts.iter().all(|weights| self.is_contrast(weights)) {
            return None;
        }
        let all = Matrix::from_fn(contrasts.len(), self.realizations.len(), |i, j| {
            contrasts[i][j]
        });
        let whitened = self.whitened(&all)?;
        let (q, k) = (whitened.rows() as f64, self.realizations.len() as f64);
        let pairs = (self.patterns.len() as f64).powi(2) / 2.0;
        if pairs * q * q * k > MAX_PRODUCTS {
            return None;
        }
        let parts = self.parts(&whitened);
        if !self.is_shown(&whitened, &parts) {
            return None;
        }
        let covariance = Cholesky::definite(&self.covariance(&parts)?)?;
        let estimates = whitened.times(&self.effects);
        let wald = dot(&estimates, &covariance.solve(&estimates));
        let [traces, products] = sums_of_products(&self.patterns, &parts);
        let eta = q * (q + 1.0) / (traces + products);
        // Exactly as many subjects as contrasts leave 0, but for rounding.
        let df2 = finite(eta - q + 1.0).filter(|df2| *df2 > ROUNDING * q)?;
        let f = finite(df2 / (eta * q) * wald)?;
        Some(ContrastF {
            f,
            df1: q,
            df2: Some(df2),
            p: f_upper(f, q, df2),
        })
    }

    /// Contrasts that span the same, uncorrelated by the working model and with its variance: L⁻¹C, CQCᵀ = LLᵀ. What others determine
    /// is left out. `None` if none is left.
    fn whitened(&self, contrasts: &Matrix) -> Option<Matrix> {
        let through = contrasts * &self.unit;
        let (n, k) = (contrasts.rows(), self.realizations.len());
        let working = SymmetricMatrix::from_fn(n, |i, j| dot(through.row(i), contrasts.row(j)));
        let found = Cholesky::semidefinite(&working, |_| ROUNDING)?;
        let kept: Vec<usize> = (0..n).filter(|i| found.pivots[*i] > 0.0).collect();
        let reduced = SymmetricMatrix::from_fn(kept.len(), |i, j| working.get(kept[i], kept[j]));
        let factor = Cholesky::definite(&reduced)?;
        let columns: Vec<Vec<f64>> = (0..k)
            .map(|j| {
                let mut column: Vec<f64> = kept.iter().map(|i| contrasts[(*i, j)]).collect();
                factor.solve_lower(&mut column);
                column
            })
            .collect();
        (!kept.is_empty()).then(|| Matrix::from_fn(kept.len(), k, |i, j| columns[j][i]))
    }

    /// Whether weights sum to 0 in every set and are not all 0.
    fn is_contrast(&self, weights: &[f64]) -> bool {
        let size = weights.iter().fold(0.0f64, |most, w| most.max(w.abs()));
        let mut sums = vec![0.0; self.sets.len()];
        if weights.len() != self.sets.len() || !(size.is_finite() && size > 0.0) {
            return false;
        }
        (self.sets.iter().zip(weights)).for_each(|(set, weight)| sums[*set] += weight);
        sums.iter().all(|sum| sum.abs() <= ROUNDING * size)
    }

    /// What each pattern contributes to some contrasts (by rows).
    fn parts(&self, contrasts: &Matrix) -> Vec<Part> {
        let through = contrasts * &self.unit;
        let (q, k) = (contrasts.rows(), self.realizations.len());
        let part = |pattern: &Pattern| {
            let places = &pattern.places;
            let mut u = Matrix::zeros(q, k);
            let mut p = Matrix::zeros(q, places.len());
            for i in 0..q {
                let own: Vec<f64> = places.iter().map(|at| through[(i, *at)]).collect();
                for (j, value) in pattern.root.times(&centered(&own)).into_iter().enumerate() {
                    p[(i, j)] = value;
                    u[(i, places[j])] += value;
                }
            }
            let z = (&u * &self.unit).transposed();
            Part { p, u, z }
        };
        self.patterns.iter().map(part).collect()
    }

    /// Whether the clustered variances are on average what the working model says itself: they are not where a
    /// subject leaves no residual.
    fn is_shown(&self, contrasts: &Matrix, parts: &[Part]) -> bool {
        let through = contrasts * &self.unit;
        (0..contrasts.rows()).all(|i| {
            let variance = dot(through.row(i), contrasts.row(i));
            (self.expected(parts, i) - variance).abs() <= ROUNDING * variance
        })
    }

    /// The expectation of the clustered variance of a contrast by the working model.
    fn expected(&self, parts: &[Part], contrast: usize) -> f64 {
        let all = self.patterns.iter().zip(parts);
        all.map(|(pattern, part)| pattern.residuals.len() as f64 * part.own(contrast))
            .sum()
    }

    /// The clustered covariance of some contrasts; `None` if it overflows.
    fn covariance(&self, parts: &[Part]) -> Option<SymmetricMatrix> {
        let mut sum = SymmetricMatrix::zero(parts.first()?.p.rows());
        for (pattern, part) in self.patterns.iter().zip(parts) {
            for residuals in &pattern.residuals {
                sum.add_outer(1.0, &part.p.times(residuals));
            }
        }
        let finite = (0..sum.size()).all(|i| (0..=i).all(|j| sum.get(i, j).is_finite()));
        finite.then_some(sum)
    }
}

impl Root {
    /// Of I − H for the subjects who rated the realizations at these places, with their levels absorbed.
    fn of(places: &[usize], unit: &Matrix) -> Self {
        let n = places.len();
        let all = Matrix::from_fn(n, n, |i, j| unit[(places[i], places[j])]);
        let means: Vec<f64> = (0..n)
            .map(|i| all.row(i).iter().sum::<f64>() / n as f64)
            .collect();
        let mean = means.iter().sum::<f64>() / n as f64;
        let hat = Matrix::from_fn(n, n, |i, j| all[(i, j)] - means[i] - means[j] + mean);
        // The largest sum of a row is at least the largest eigenvalue.
        let sum = |i: usize| hat.row(i).iter().map(|h| h.abs()).sum::<f64>();
        if (0..n).map(sum).fold(0.0, f64::max) <= LOW_LEVERAGE {
            return Self::Series(hat);
        }
        let left = Matrix::from_fn(n, n, |i, j| {
            f64::from(u8::from(i == j)) - 1.0 / n as f64 - hat[(i, j)]
        });
        let eigen = SymmetricEigen::new(left);
        let kept: Vec<usize> = (0..n).filter(|i| eigen.values[*i] > NONE_LEFT).collect();
        Self::Eigen(
            Matrix::from_fn(kept.len(), n, |i, j| eigen.vectors[(kept[i], j)]),
            kept.iter().map(|i| 1.0 / eigen.values[*i].sqrt()).collect(),
        )
    }

    /// The root times a vector with the sum 0.
    fn times(&self, v: &[f64]) -> Vec<f64> {
        match self {
            // Σ (2n choose n)/4ⁿ Hⁿ.
            Self::Series(hat) => {
                let (mut sum, mut power, mut factor) = (v.to_vec(), v.to_vec(), 1.0);
                for term in 1..=TERMS {
                    power = hat.times(&power);
                    if dot(&power, &power) <= NEGLIGIBLE * dot(v, v) {
                        break;
                    }
                    factor *= (2.0 * term as f64 - 1.0) / (2.0 * term as f64);
                    (sum.iter_mut().zip(&power)).for_each(|(s, p)| *s += factor * p);
                }
                sum
            }
            Self::Eigen(vectors, roots) => {
                let mut sum = vec![0.0; v.len()];
                for (i, root) in roots.iter().enumerate() {
                    let along = root * dot(vectors.row(i), v);
                    (sum.iter_mut().zip(vectors.row(i))).for_each(|(s, e)| *s += along * e);
                }
                sum
            }
        }
    }
}

/// With Kᵢⱼ the covariance of the contrasts' pᵢᵀ(I − H) and pⱼᵀ(I − H) rows by the working model: Σ (tr Kᵢⱼ)² and
/// Σ tr KᵢⱼKᵢⱼ over all subjects i and j. Their sum is that of the variances of the elements of the covariance matrix.
fn sums_of_products(patterns: &[Pattern], parts: &[Part]) -> [f64; 2] {
    let mut sums = [0.0; 2];
    let mut add = |k: &Matrix, times: f64| {
        sums[0] += times * k.trace().powi(2);
        sums[1] += times * k.trace_of_product(k);
    };
    for (g, (pattern, part)) in patterns.iter().zip(parts).enumerate() {
        let n = pattern.residuals.len() as f64;
        let hat = &part.u * &part.z;
        add(&hat, n * (n - 1.0));
        add(&(&part.p * &part.p.transposed() - &hat), n);
        for (other, with) in patterns[g + 1..].iter().zip(&parts[g + 1..]) {
            let times = 2.0 * n * other.residuals.len() as f64;
            add(&(&part.u * &with.z), times);
        }
    }
    sums
}

/// Numbers less their mean.
fn centered(x: &[f64]) -> Vec<f64> {
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    x.iter().map(|x| x - mean).collect()
}

#[cfg(test)]
mod tests;
