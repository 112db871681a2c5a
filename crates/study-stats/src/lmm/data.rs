//! Sufficient statistics of cells: subjects with the same cells share a pattern.
//!
//! For a pattern with U cells (realization, covariate, n) the criterion needs only the
//! sums over its subjects Σy and Σyy' of the U cell means. Σyy' is stored as the rows of
//! a factor, at most U of them.

use super::LmmError;
use crate::matrix::triangular;
use std::collections::BTreeMap;

/// The ratings of one subject of one realization (at one value of the covariate).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSummary {
    /// Any number that identifies the subject.
    pub subject: usize,
    /// Any number that identifies the realization.
    pub realization: usize,
    /// The covariate; 0 for models without one.
    pub x: f64,
    /// Number of ratings, at least 1.
    pub n: usize,
    /// Mean of the ratings.
    pub mean: f64,
    /// Sum of squared deviations of the ratings from their mean.
    pub within: f64,
}

/// The fixed effects of a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixedEffects {
    /// A mean that all ratings share.
    Intercept,
    /// An intercept and a slope of the covariate.
    Covariate {
        /// The value of the covariate at which the intercepts, fixed and random, are
        /// defined.
        center: f64,
    },
    /// A mean for each realization.
    Realizations,
}

/// A cell within a pattern, standardized.
#[derive(Debug, Clone, Copy)]
pub(super) struct Unit {
    pub(super) realization: usize,
    /// The covariate as given, and standardized.
    pub(super) raw: f64,
    pub(super) x: f64,
    pub(super) n: f64,
}

/// Subjects that have the same cells.
#[derive(Debug, Clone)]
pub(super) struct Pattern {
    pub(super) subjects: f64,
    pub(super) units: Vec<Unit>,
    /// Sum over the subjects of their means, by unit.
    pub(super) sum: Vec<f64>,
    /// Rows r with Σ rr' = Σ yy'.
    pub(super) rows: Vec<Vec<f64>>,
}

/// Cells, standardized and aggregated, with the fixed effects of a model. At most 200
/// realizations, and Σ patterns × realizations² at most 5·10⁷.
#[derive(Debug, Clone)]
pub struct LmmData {
    pub(super) patterns: Vec<Pattern>,
    pub(super) fixed: FixedEffects,
    /// The numbers that identify the realizations, sorted.
    pub(super) realizations: Vec<usize>,
    pub(super) subjects: usize,
    /// Number of ratings.
    pub(super) n: f64,
    pub(super) cells: usize,
    /// Within-cell sum of squares, standardized.
    pub(super) within: f64,
    /// What was subtracted from the ratings, and what they were divided by.
    pub(super) y_center: f64,
    pub(super) y_scale: f64,
    /// What the centered covariate was divided by.
    pub(super) x_scale: f64,
    /// Variance of the covariate over the ratings, with n.
    pub(super) x_variance: f64,
    /// Whether a subject has two values of the covariate.
    pub(super) x_within: bool,
}

/// Most realizations: the order of the dense Cholesky factor.
const MAX_REALIZATIONS: usize = 200;
/// Most Σ patterns × realizations², which the work of one evaluation is proportional to.
const MAX_WORK: usize = 50_000_000;

impl LmmData {
    /// Aggregates cells, in any order, for a model with these fixed effects.
    ///
    /// # Errors
    /// If no model with these fixed effects is defined for the cells.
    pub fn new(cells: &[CellSummary], fixed: FixedEffects) -> Result<Self, LmmError> {
        if cells.is_empty() || cells.iter().any(|c| c.n == 0) {
            return Err(LmmError::NoData);
        }
        let mut realizations: Vec<usize> = cells.iter().map(|c| c.realization).collect();
        realizations.sort_unstable();
        realizations.dedup();
        if realizations.len() > MAX_REALIZATIONS {
            return Err(LmmError::TooLarge);
        }
        let n: f64 = cells.iter().map(|c| c.n as f64).sum();
        let about = |f: &dyn Fn(&CellSummary) -> f64| -> f64 {
            cells.iter().map(|c| c.n as f64 * f(c)).sum::<f64>() / n
        };
        let y_center = about(&|c| c.mean);
        let within: f64 = cells.iter().map(|c| c.within).sum();
        let total = about(&|c| (c.mean - y_center).powi(2)) + within / n;
        if !(y_center.is_finite() && total.is_finite()) {
            return Err(LmmError::NoData);
        }
        if total <= 1e-24 * y_center * y_center || total < 1e-200 {
            return Err(LmmError::ConstantRatings);
        }
        let mut table = Self {
            patterns: Vec::new(),
            fixed: FixedEffects::Intercept,
            subjects: 0,
            n,
            cells: cells.len(),
            within: within / total,
            y_center,
            y_scale: total.sqrt(),
            x_scale: 1.0,
            x_variance: 0.0,
            x_within: false,
            realizations,
        };
        table.aggregate(cells);
        if table.subjects < 2 {
            return Err(LmmError::OneSubject);
        }
        let width = table.realizations.len();
        if table.patterns.len().saturating_mul(width * width) > MAX_WORK {
            return Err(LmmError::TooLarge);
        }
        let patterns = table.patterns.iter_mut();
        patterns.for_each(|pattern| triangular(&mut pattern.rows));
        table.with_fixed_effects(fixed)
    }

    /// The same ratings with other fixed effects, without aggregating again.
    ///
    /// # Errors
    /// If no model with these fixed effects is defined for the cells.
    pub fn with_fixed_effects(&self, fixed: FixedEffects) -> Result<Self, LmmError> {
        let mut table = self.clone();
        table.fixed = fixed;
        let (mut center, mut scale, mut variance) = (0.0, 1.0, 0.0);
        if let FixedEffects::Covariate { center: at } = fixed {
            center = at;
            let about = |f: &dyn Fn(f64) -> f64| -> f64 {
                let patterns = self.patterns.iter();
                patterns
                    .flat_map(|p| p.units.iter().map(|u| p.subjects * u.n * f(u.raw - center)))
                    .sum::<f64>()
                    / self.n
            };
            let mean = about(&|x| x);
            variance = about(&|x| (x - mean).powi(2));
            scale = about(&|x| x * x).sqrt();
            let varies = variance > 1e-24 * (center * center + scale * scale) && variance > 1e-200;
            if !(varies && scale.is_finite() && center.is_finite()) {
                return Err(LmmError::ConstantCovariate);
            }
        }
        for unit in table.patterns.iter_mut().flat_map(|p| &mut p.units) {
            unit.x = (unit.raw - center) / scale;
        }
        (table.x_scale, table.x_variance) = (scale, variance);
        Ok(table)
    }

    fn aggregate(&mut self, cells: &[CellSummary]) {
        let mut sorted: Vec<&CellSummary> = cells.iter().collect();
        sorted.sort_by(|a, b| {
            (a.subject, a.realization)
                .cmp(&(b.subject, b.realization))
                .then(a.x.total_cmp(&b.x))
        });
        type Key = Vec<(usize, u64, usize)>;
        let mut places: BTreeMap<Key, usize> = BTreeMap::new();
        for own in sorted.chunk_by(|a, b| a.subject == b.subject) {
            self.subjects += 1;
            self.x_within |= own.iter().any(|c| c.x != own[0].x);
            let key: Key = own
                .iter()
                .map(|c| (c.realization, c.x.to_bits(), c.n))
                .collect();
            let next = self.patterns.len();
            let place = *places.entry(key).or_insert(next);
            if place == next {
                self.patterns.push(Pattern {
                    subjects: 0.0,
                    units: own
                        .iter()
                        .map(|c| Unit {
                            realization: self.realizations.partition_point(|&m| m < c.realization),
                            raw: c.x,
                            x: 0.0,
                            n: c.n as f64,
                        })
                        .collect(),
                    sum: vec![0.0; own.len()],
                    rows: Vec::new(),
                });
            }
            let pattern = &mut self.patterns[place];
            pattern.subjects += 1.0;
            let row: Vec<f64> = own
                .iter()
                .map(|c| (c.mean - self.y_center) / self.y_scale)
                .collect();
            for (sum, y) in pattern.sum.iter_mut().zip(&row) {
                *sum += y;
            }
            pattern.rows.push(row);
            // Bounds the memory of a growing pattern.
            if pattern.rows.len() >= 1024 + 4 * pattern.units.len() {
                triangular(&mut pattern.rows);
            }
        }
    }

    /// Whether a cell has two ratings.
    pub(super) fn repeats(&self) -> bool {
        self.n > self.cells as f64
    }

    /// Number of fixed effects p.
    pub(super) fn columns(&self) -> usize {
        match self.fixed {
            FixedEffects::Intercept => 1,
            FixedEffects::Covariate { .. } => 2,
            FixedEffects::Realizations => self.realizations.len(),
        }
    }

    /// The numbers that identify the realizations, sorted: the order of their means in
    /// contrasts.
    pub fn realizations(&self) -> &[usize] {
        &self.realizations
    }

    /// Number of ratings of each realization, in the order of [`Self::realizations`].
    pub(super) fn ratings_by_realization(&self) -> Vec<f64> {
        let mut ratings = vec![0.0; self.realizations.len()];
        for pattern in &self.patterns {
            for unit in &pattern.units {
                ratings[unit.realization] += pattern.subjects * unit.n;
            }
        }
        ratings
    }

    /// The cell means, each as one rating.
    pub(super) fn of_cell_means(&self) -> Self {
        let mut table = self.clone();
        for unit in table.patterns.iter_mut().flat_map(|p| &mut p.units) {
            unit.n = 1.0;
        }
        (table.n, table.within) = (self.cells as f64, 0.0);
        table
    }

    /// Whether the subjects link all realizations, directly or by way of others.
    pub(super) fn connected(&self) -> bool {
        let mut linked = vec![false; self.realizations.len()];
        linked[0] = true;
        loop {
            let before = linked.clone();
            for pattern in &self.patterns {
                if pattern.units.iter().any(|u| linked[u.realization]) {
                    pattern
                        .units
                        .iter()
                        .for_each(|u| linked[u.realization] = true);
                }
            }
            if linked == before {
                return linked.iter().all(|l| *l);
            }
        }
    }

    /// Number of ratings.
    pub fn ratings(&self) -> f64 {
        self.n
    }

    /// Variance of the covariate over the ratings, with n − 1.
    pub fn covariate_variance(&self) -> f64 {
        self.x_variance * self.n / (self.n - 1.0)
    }
}
