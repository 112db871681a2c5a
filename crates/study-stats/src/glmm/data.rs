//! Observations, aggregated: those with equal fixed effects and equal levels differ only by noise,
//! so that their number and sum are sufficient (and the sum of logarithms, of the gamma family).

use super::family::Sums;
use super::sparse::Pattern;
use super::{Family, GlmmError, INFINITE_SE};
use crate::clm::newton::{Evaluation, maximize};
use crate::matrix::{Cholesky, SymmetricMatrix, dot};
use statrs::function::factorial::ln_binomial;
use statrs::function::gamma::{digamma, ln_gamma};
use std::collections::BTreeMap;

/// One observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// A count, the number of successes, or a number above 0.
    pub y: f64,
    /// Trials of the binomial family, at least 1; of the others 1.
    pub trials: f64,
    /// The row of X, with its intercept.
    pub x: Vec<f64>,
    /// The level in each random factor, any number.
    pub levels: Vec<usize>,
}

/// Observations with the same x and levels.
#[derive(Debug, Clone)]
pub(super) struct Row {
    pub(super) sums: Sums,
    /// Scaled.
    pub(super) x: Vec<f64>,
    /// The place of its level in each factor, in the order of elimination: ascending.
    pub(super) levels: Vec<usize>,
    /// Elements of the factor of H at each pair of `levels`: (1, 0), (2, 0), (2, 1), …
    pub(super) pairs: Vec<usize>,
}

/// Observations of a model. At most 20,000 levels, and 2·10⁶ elements of the factor of H.
#[derive(Debug, Clone)]
pub struct GlmmData {
    pub(super) family: Family,
    pub(super) rows: Vec<Row>,
    /// What each column was divided by.
    scale: Vec<f64>,
    /// The random factors in the order of elimination, the one with most levels first.
    pub(super) order: Vec<usize>,
    /// The factor of each place of H.
    pub(super) owner: Vec<usize>,
    pub(super) pattern: Pattern,
    /// What does not depend on any parameter.
    constant: f64,
    /// Σ n and, of the gamma family, Σ ln y.
    n: f64,
    log_sum: f64,
}

const MAX_LEVELS: usize = 20_000;
const MAX_ELEMENTS: usize = 2_000_000;

/// A column is left over by the others by less than this share of its sum of squares.
const COLLINEAR: f64 = 1e-10;

/// A smaller mean deviance of gamma observations is rounding.
const NO_DEVIANCE: f64 = 1e-12;

impl GlmmData {
    /// Aggregates observations, in any order.
    ///
    /// # Errors
    /// If no model of this family is defined for them.
    pub fn new(family: Family, observations: &[Observation]) -> Result<Self, GlmmError> {
        let first = observations.first().ok_or(GlmmError::NoData)?;
        let (p, factors) = (first.x.len(), first.levels.len());
        let alike = |o: &Observation| o.x.len() == p && o.levels.len() == factors;
        if p == 0 || !observations.iter().all(alike) {
            return Err(GlmmError::NoData);
        }
        if !observations.iter().all(|o| is_of(family, o)) {
            return Err(GlmmError::NotOfFamily);
        }
        let largest = |j: usize| {
            observations
                .iter()
                .map(|o| o.x[j].abs())
                .fold(0.0, f64::max)
        };
        let scale: Vec<f64> = (0..p).map(largest).collect();
        if scale.iter().any(|s| !(*s > 0.0 && s.is_finite())) {
            return Err(GlmmError::Collinear);
        }
        let levels: Vec<Vec<usize>> = (0..factors).map(|f| levels(observations, f)).collect();
        if levels.iter().any(|own| own.len() < 2) {
            return Err(GlmmError::OneLevel);
        }
        let total: usize = levels.iter().map(Vec::len).sum();
        if total > MAX_LEVELS {
            return Err(GlmmError::TooLarge);
        }
        let mut order: Vec<usize> = (0..factors).collect();
        order.sort_by_key(|&f| std::cmp::Reverse(levels[f].len()));
        let mut owner = Vec::with_capacity(total);
        let mut start = vec![0; factors];
        for &f in &order {
            start[f] = owner.len();
            owner.extend(std::iter::repeat_n(f, levels[f].len()));
        }
        let place = |f: usize, level: usize| start[f] + levels[f].partition_point(|l| *l < level);
        let mut rows: BTreeMap<(Vec<u64>, Vec<usize>), Row> = BTreeMap::new();
        let (mut constant, mut n, mut log_sum) = (0.0, 0.0, 0.0);
        for o in observations {
            let x: Vec<f64> = o.x.iter().zip(&scale).map(|(x, s)| x / s).collect();
            let own: Vec<usize> = order.iter().map(|&f| place(f, o.levels[f])).collect();
            let bits = x.iter().map(|x| x.to_bits()).collect();
            let row = rows.entry((bits, own.clone())).or_insert_with(|| Row {
                sums: Sums { n: 0.0, y: 0.0 },
                x,
                levels: own,
                pairs: Vec::new(),
            });
            row.sums.n += o.trials;
            row.sums.y += o.y;
            n += o.trials;
            match family {
                Family::Poisson => constant -= ln_gamma(o.y + 1.0),
                Family::Binomial => constant += ln_binomial(o.trials as u64, o.y as u64),
                Family::Gamma => log_sum += o.y.ln(),
            }
        }
        let mut rows: Vec<Row> = rows.into_values().collect();
        let of_rows = rows.iter().map(|row| row.levels.as_slice());
        let pattern = Pattern::of(total, of_rows, MAX_ELEMENTS).ok_or(GlmmError::TooLarge)?;
        for row in &mut rows {
            for (i, &later) in row.levels.iter().enumerate() {
                let elements = row.levels[..i].iter().map(|&j| pattern.element(later, j));
                row.pairs.extend(elements);
            }
        }
        let data = Self {
            family,
            rows,
            scale,
            order,
            owner,
            pattern,
            constant,
            n,
            log_sum,
        };
        data.separable()?;
        Ok(data)
    }

    /// The same observations without these fixed effects.
    pub(super) fn without(&self, columns: &[usize]) -> Result<Self, GlmmError> {
        let kept: Vec<usize> = (0..self.columns())
            .filter(|j| !columns.contains(j))
            .collect();
        if kept.is_empty() {
            return Err(GlmmError::NoData);
        }
        let mut data = self.clone();
        data.scale = kept.iter().map(|&j| self.scale[j]).collect();
        for row in &mut data.rows {
            row.x = kept.iter().map(|&j| row.x[j]).collect();
        }
        Ok(data)
    }

    /// Whether no column is a combination of others.
    fn separable(&self) -> Result<(), GlmmError> {
        let mut products = SymmetricMatrix::zero(self.columns());
        for row in &self.rows {
            products.add_outer(row.sums.n, &row.x);
        }
        let rank = Cholesky::semidefinite(&products, |_| COLLINEAR).map(|found| found.rank());
        match rank == Some(self.columns()) {
            true => Ok(()),
            false => Err(GlmmError::Collinear),
        }
    }

    /// Number of fixed effects.
    pub(super) fn columns(&self) -> usize {
        self.scale.len()
    }

    /// Number of random factors.
    pub(super) fn factors(&self) -> usize {
        self.order.len()
    }

    /// What each column was divided by.
    pub(super) fn scale(&self) -> &[f64] {
        &self.scale
    }

    /// Fixed effects, standard deviations and shape, by their places in the parameters.
    pub(super) fn parts<'a>(&self, at: &'a [f64]) -> (&'a [f64], &'a [f64], f64) {
        let (beta, rest) = at.split_at(self.columns());
        let (sd, rest) = rest.split_at(self.factors());
        (beta, sd, rest.first().map_or(1.0, |shape| shape.exp()))
    }

    /// The log-likelihood's part that depends on neither fixed nor random effects, and its
    /// derivative in the logarithm of the shape.
    pub(super) fn common(&self, shape: f64) -> (f64, f64) {
        match self.family {
            Family::Poisson | Family::Binomial => (self.constant, 0.0),
            Family::Gamma => {
                let (n, s) = (self.n, self.log_sum);
                let value = n * (shape * shape.ln() - ln_gamma(shape)) + (shape - 1.0) * s;
                let slope = shape * (n * (shape.ln() + 1.0 - digamma(shape)) + s);
                (value, slope)
            }
        }
    }

    /// Where a search begins: the fixed effects of the model without random ones and, of the gamma
    /// family, the logarithm of a shape.
    pub(super) fn start(&self) -> Result<(Vec<f64>, Option<f64>), GlmmError> {
        let found = maximize(vec![0.0; self.columns()], |beta| self.fixed(beta));
        let found = found.ok_or(GlmmError::NotConverged)?;
        let factor = Cholesky::positive(&found.information).ok_or(GlmmError::Separated)?;
        let infinite = |v: &f64| v.is_nan() || v.sqrt() >= INFINITE_SE;
        if factor.inverse_diagonal().iter().any(infinite) {
            return Err(GlmmError::Separated);
        }
        if self.family != Family::Gamma {
            return Ok((found.at, None));
        }
        let of_row = |row: &Row| {
            let eta = dot(&row.x, &found.at);
            row.sums.y * (-eta).exp() + row.sums.n * (eta - 1.0)
        };
        let deviance = 2.0 * (self.rows.iter().map(of_row).sum::<f64>() - self.log_sum) / self.n;
        // Half of it is taken for that of the random effects.
        let shape = (deviance > NO_DEVIANCE).then(|| (2.0 / deviance).ln());
        Ok((found.at, Some(shape.ok_or(GlmmError::NoError)?)))
    }

    /// The log-likelihood without random effects.
    fn fixed(&self, beta: &[f64]) -> Option<Evaluation> {
        let mut point = Evaluation::zero(beta.len());
        for row in &self.rows {
            let term = self.family.term(row.sums, dot(&row.x, beta), 1.0);
            point.value += term.value;
            for (g, x) in point.gradient.iter_mut().zip(&row.x) {
                *g += term.score * x;
            }
            point.hessian.add_outer(-term.weight, &row.x);
        }
        let finite = point.value.is_finite() && point.gradient.iter().all(|g| g.is_finite());
        finite.then_some(point)
    }
}

fn is_of(family: Family, o: &Observation) -> bool {
    let whole = |x: f64| x >= 0.0 && x.fract() == 0.0 && x <= 1e15;
    let x = o.x.iter().all(|x| x.is_finite());
    x && match family {
        Family::Poisson => whole(o.y) && o.trials == 1.0,
        Family::Binomial => whole(o.y) && whole(o.trials) && o.trials >= 1.0 && o.y <= o.trials,
        Family::Gamma => o.y > 0.0 && o.y.is_finite() && o.trials == 1.0,
    }
}

/// The numbers that identify the levels of a factor, sorted.
fn levels(observations: &[Observation], factor: usize) -> Vec<usize> {
    let mut own: Vec<usize> = observations.iter().map(|o| o.levels[factor]).collect();
    own.sort_unstable();
    own.dedup();
    own
}
