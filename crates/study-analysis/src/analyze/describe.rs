//! `desc/*`, `desc_all/*`, `design/*`, `univariate/*`, `regression/*`.

use super::cells::{Cells, CompleteTable, within};
use super::record::{Interval, List, RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::describe::{counts, lag1_autocorrelation, mean, quantile, sd, sorted};
use study_stats::distribution::t_quantile;
use study_stats::regression::line;

/// Largest number of bins of a histogram.
const MAX_BINS: f64 = 101.0;

pub(super) const ONE: &str = "fewer than two ratings";
const ONE_SUBJECT: &str = "fewer than two subjects";
pub(super) const NO_REPETITION: &str = "no cell has two ratings";

statistics! {
    /// Counts over all realizations.
    pub struct Sizes {
        /// ratings
        n_ratings: Stat,
        /// trials without a rating
        n_missing_ratings: Stat,
        /// participants
        n_subjects: Stat,
        /// realizations
        n_models: Stat,
        /// participants and realizations with a rating
        n_cells: Stat,
        /// participants with every test realization
        n_subjects_complete: Stat,
        /// 1 if every cell holds the same number of ratings and none is missing
        balanced: Stat,
    }

    /// All ratings.
    pub struct DescribedAll {
        /// their mean
        mean: Stat,
        /// their standard deviation (n − 1)
        sd: Stat,
        /// degrees of freedom within cells
        within_cell_df: Stat,
        /// √(Σ within-cell squares/df)
        within_cell_sd: Stat,
        /// 1.96·√2·`within_cell_sd`
        repeatability_coefficient: Stat,
        /// the lowest rating; only if all are whole numbers
        hist_from: Option<Stat>,
        /// counts of the whole numbers from `hist_from` on
        hist: Option<List>,
    }

    /// The cells of a realization. If they hold unequal numbers of ratings, their mean differs from that of the ratings, and a warning says so.
    pub struct SubjectMean {
        /// participants who rated it
        n: Stat,
        /// mean over the cells
        mean: Stat,
        /// over the cells
        sd: Stat,
        /// `sd`/√`n`
        sem: Stat,
        /// t interval of the mean
        ci95: Interval,
    }

    /// Within-participant intervals of a tested realization: cells minus the mean of their row plus the grand mean (Cousineau 2005).
    pub struct CousineauMorey {
        /// SEM × √(M/(M−1)) (Morey 2008)
        sem: Stat,
        /// `sem` times t(.975, S−1)
        ci95_half: Stat,
    }

    /// The ratings of a realization.
    pub struct Described {
        /// their number
        n: Stat,
        /// over all ratings
        mean: Stat,
        /// n − 1, over all ratings, as in the paper
        sd: Stat,
        /// type 7 of Hyndman & Fan (1996), as the quartiles
        median: Stat,
        /// first quartile
        q1: Stat,
        /// third quartile
        q3: Stat,
        /// the lowest
        min: Stat,
        /// the highest
        max: Stat,
        /// counts of the whole numbers from `desc_all/hist_from` on
        hist: Option<List>,
        /// over participants
        subject_mean: SubjectMean,
        /// within participants
        cousineau_morey: Option<CousineauMorey>,
    }

    /// A table of one subject and one realization, such as NIST's StRD sets.
    pub struct Univariate {
        /// numbers
        n: Stat,
        /// their mean
        mean: Stat,
        /// n − 1
        sd: Stat,
        /// of each number with the next
        lag1_autocorrelation: Stat,
    }

    /// Least squares of the numbers of one subject on VAF, such as NIST's StRD sets.
    pub struct Regression {
        /// at a VAF of 0
        intercept: Stat,
        /// per VAF
        slope: Stat,
        /// standard error of `intercept`
        intercept_se: Stat,
        /// standard error of `slope`
        slope_se: Stat,
        /// √(residual squares/(n − 2))
        residual_sd: Stat,
        /// share of the variance that the line explains
        r2: Stat,
        /// of the line
        f: Stat as "F",
        /// the correlation
        pearson_r: Stat,
    }

    /// What the ratings are.
    pub struct Descriptives {
        /// how many there are
        design: Sizes,
        /// together
        desc_all: DescribedAll,
        /// by realization
        desc: BTreeMap<RealizationName, Described>,
        /// of one subject
        univariate: Option<Univariate>,
        /// of one subject
        regression: Option<Regression>,
    }
}

pub(super) fn describe(cells: &Cells<'_>) -> Descriptives {
    let table = cells.table(&cells.tested());
    let bins = whole_scale(cells);
    let mut desc = by_model(cells, bins);
    cousineau_morey(&table, &mut desc);
    let (univariate, regression) = alone(cells);
    Descriptives {
        design: design(cells, &table),
        desc_all: all(cells, bins),
        desc: desc
            .into_iter()
            .enumerate()
            .map(|(m, own)| (cells.model_name(m).into(), own))
            .collect(),
        univariate,
        regression,
    }
}

/// Smallest and largest rating, if all are whole and the range is not too wide.
fn whole_scale(cells: &Cells<'_>) -> Option<(f64, f64)> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for &v in cells.ratings.rating.iter().flatten() {
        if v.fract() != 0.0 {
            return None;
        }
        (low, high) = (low.min(v), high.max(v));
    }
    (low <= high && high - low < MAX_BINS).then_some((low, high))
}

/// The ratings in ascending order; a counting sort if they are whole.
fn ascending(x: &[f64], bins: Option<(f64, f64)>) -> Vec<f64> {
    let Some((low, high)) = bins else {
        return sorted(x);
    };
    let mut all = Vec::with_capacity(x.len());
    let mut value = low;
    for n in counts(x, low, high) {
        all.resize(all.len() + n as usize, value);
        value += 1.0;
    }
    all
}

fn rated(cells: &Cells<'_>) -> Vec<f64> {
    cells.ratings.rating.iter().copied().flatten().collect()
}

fn design(cells: &Cells<'_>, table: &CompleteTable) -> Sizes {
    let r = cells.ratings;
    let rated = rated(cells).len();
    let (s, m) = (r.subjects.len(), r.models.len());
    let per_cell = cells.cells.first().map_or(0, |c| c.rows.len());
    let balanced = m > 0
        && rated == r.len()
        && cells.cells.len() == s * m
        && cells.cells.iter().all(|c| c.rows.len() == per_cell);
    Sizes {
        n_ratings: Stat::count(rated),
        n_missing_ratings: Stat::count(r.len() - rated),
        n_subjects: Stat::count(s),
        n_models: Stat::count(m),
        n_cells: Stat::count(cells.cells.len()),
        n_subjects_complete: Stat::count(table.subjects.len()),
        balanced: Stat::flag(balanced),
    }
}

fn all(cells: &Cells<'_>, bins: Option<(f64, f64)>) -> DescribedAll {
    let rated = rated(cells);
    let (ss, df) = within(&cells.cells);
    let within_sd = (df > 0).then(|| (ss / df as f64).sqrt());
    let coefficient = within_sd.map(|s| 1.96 * std::f64::consts::SQRT_2 * s);
    DescribedAll {
        mean: Stat::or(mean(&rated), "no ratings"),
        sd: Stat::or(sd(&rated), ONE),
        within_cell_df: Stat::count(df),
        within_cell_sd: Stat::or(within_sd, NO_REPETITION),
        repeatability_coefficient: Stat::or(coefficient, NO_REPETITION),
        hist_from: bins.map(|(low, _)| Stat::of(low)),
        hist: bins.map(|(low, high)| List::of(counts(&rated, low, high))),
    }
}

/// The ratings of each realization.
fn by_model(cells: &Cells<'_>, bins: Option<(f64, f64)>) -> Vec<Described> {
    let r = cells.ratings;
    let mut by_model: Vec<Vec<f64>> = vec![Vec::new(); r.models.len()];
    for &i in &cells.order {
        if let (Some(m), Some(rating)) = (r.model[i], r.rating[i]) {
            by_model[m as usize].push(rating);
        }
    }
    let subject_means = cells.subject_means();
    (by_model.iter().zip(&subject_means))
        .map(|(x, means)| {
            let s = ascending(x, bins);
            let or = |x: Option<f64>| Stat::or(x, "no ratings");
            Described {
                n: Stat::count(x.len()),
                mean: or(mean(x)),
                sd: Stat::or(sd(x), ONE),
                median: or(quantile(&s, 0.5)),
                q1: or(quantile(&s, 0.25)),
                q3: or(quantile(&s, 0.75)),
                min: or(s.first().copied()),
                max: or(s.last().copied()),
                hist: bins.map(|(low, high)| List::of(counts(x, low, high))),
                subject_mean: subject_mean(means, cells.offset),
                cousineau_morey: None,
            }
        })
        .collect()
}

fn subject_mean(x: &[f64], offset: f64) -> SubjectMean {
    let center = mean(x).map(|c| c + offset);
    let spread = sd(x);
    let sem = spread.map(|s| s / (x.len() as f64).sqrt());
    let half = sem.and_then(|s| Some(s * t_quantile(0.975, x.len() as f64 - 1.0)?));
    let ends = center.zip(half).map(|(c, h)| (c - h, c + h));
    SubjectMean {
        n: Stat::count(x.len()),
        mean: Stat::or(center, "no ratings"),
        sd: Stat::or(spread, ONE_SUBJECT),
        sem: Stat::or(sem, ONE_SUBJECT),
        ci95: Interval::or(ends, ONE_SUBJECT),
    }
}

/// Within-subject intervals: ratings less the subject's mean (Cousineau 2005), SEM
/// times √(M/(M − 1)) (Morey 2008).
fn cousineau_morey(table: &CompleteTable, desc: &mut [Described]) {
    let (s, m) = (table.rows.len(), table.models.len());
    let why = if m < 2 {
        "fewer than two realizations"
    } else {
        "fewer than two complete subjects"
    };
    let normal: Vec<Vec<f64>> = table
        .rows
        .iter()
        .map(|row| {
            // Of no realizations there is no row.
            let center = mean(row).unwrap_or(0.0);
            row.iter().map(|v| v - center).collect()
        })
        .collect();
    let t = t_quantile(0.975, s as f64 - 1.0).filter(|_| m >= 2);
    for (j, &model) in table.models.iter().enumerate() {
        let column: Vec<f64> = normal.iter().map(|r| r[j]).collect();
        let correction = (m as f64 / (m as f64 - 1.0)).sqrt();
        let sem = sd(&column)
            .filter(|_| m >= 2)
            .map(|v| v / (s as f64).sqrt() * correction);
        desc[model].cousineau_morey = Some(CousineauMorey {
            sem: Stat::or(sem, why),
            ci95_half: Stat::or(sem.zip(t).map(|(a, b)| a * b), why),
        });
    }
}

/// A table of one subject: univariate data, or a regression on VAF.
fn alone(cells: &Cells<'_>) -> (Option<Univariate>, Option<Regression>) {
    let r = cells.ratings;
    if r.subjects.len() != 1 {
        return (None, None);
    }
    let x = rated(cells);
    let equal = "all numbers are equal";
    let univariate = (r.models.len() <= 1).then(|| Univariate {
        n: Stat::count(x.len()),
        mean: Stat::or(mean(&x), equal),
        sd: Stat::or(sd(&x), ONE),
        lag1_autocorrelation: Stat::or(lag1_autocorrelation(&x), equal),
    });
    let once = cells.cells.iter().all(|c| c.rows.len() == 1) || r.model.iter().all(Option::is_none);
    let rows = (0..r.len()).filter(|&i| r.rating[i].is_some());
    let vaf: Option<Vec<f64>> = rows.map(|i| r.vaf[i]).collect();
    let found = vaf
        .filter(|v| once && v.len() >= 3)
        .and_then(|vaf| line(&vaf, &x));
    let regression = found.map(|l| Regression {
        intercept: Stat::of(l.intercept),
        slope: Stat::of(l.slope),
        intercept_se: Stat::of(l.intercept_se),
        slope_se: Stat::of(l.slope_se),
        residual_sd: Stat::of(l.residual_sd),
        r2: Stat::of(l.r2),
        f: Stat::or(l.f, "the line fits without a residual"),
        pearson_r: Stat::of(l.r),
    });
    (univariate, regression)
}
