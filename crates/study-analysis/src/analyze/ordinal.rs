//! Ordinal regression: `clm_*` treats all ratings as independent, `clmm_*` has a
//! random intercept for each subject. `*_model` estimates an effect of each tested
//! realization relative to the first, `*_vaf` a slope on the row's VAF. All results
//! hold for these realizations only.
//!
//! The categories are the whole numbers that occur. A rating that nobody gave has no
//! probability and no threshold.

use super::cells::Cells;
use super::record::{Field, Key, RealizationName, Stat, statistics};
use std::borrow::Cow;
use std::collections::BTreeMap;
use study_stats::clm::{
    CategoryCount, CategoryCounts, ClmError, ClmFit, Predictor, ProportionalOdds, clm,
    proportional_odds,
};
use study_stats::clmm::{ClmmFit, clmm, clmm_crossed};
use thiserror::Error;

/// Largest number of categories; more come from a slider, not from a rating scale.
const MAX_CATEGORIES: usize = 20;

/// Largest number of realizations with an effect of their own.
const MAX_MODELS: usize = 50;

/// Largest number of distinct VAF.
const MAX_LEVELS: usize = 10_000;

/// Largest number of subjects of a mixed model, whose cost is proportional to it.
const MAX_SUBJECTS: usize = 10_000;

/// Largest number of subjects of the model with two random effects, which takes some
/// milliseconds for each.
const MAX_CROSSED_SUBJECTS: usize = 100;

/// Not every larger whole number is a double.
const WHOLE: f64 = 9_007_199_254_740_992.0;

/// Why a model is not fitted.
#[derive(Debug, Clone, Copy, Error)]
enum NotFitted {
    #[error("more than {MAX_MODELS} realizations")]
    TooManyRealizations,
    #[error("no rating has a realization")]
    NoRealization,
    #[error("the ratings are not whole numbers")]
    NotWhole,
    #[error("more than {MAX_CATEGORIES} different ratings")]
    TooManyCategories,
    #[error("no rating has a realization and a VAF")]
    NoVaf,
    #[error("all VAF are equal")]
    EqualVaf,
    #[error("more than {MAX_LEVELS} different VAF")]
    TooManyVaf,
    #[error("more than {MAX_SUBJECTS} subjects")]
    TooManySubjects,
    #[error("more than {MAX_CROSSED_SUBJECTS} subjects")]
    TooManyCrossedSubjects,
    #[error(transparent)]
    Estimation(#[from] ClmError),
}

/// Two neighboring categories, as in `threshold/4|5`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ThresholdName(String);

impl Key for ThresholdName {
    const PLACEHOLDER: &'static str = "j|k";

    fn part(&self) -> Cow<'_, str> {
        Cow::Borrowed(&self.0)
    }
}

statistics! {
    /// A cumulative logit model with an effect of each tested realization relative to the first.
    pub struct ByModel {
        /// log likelihood
        loglik: Stat,
        /// log odds ratio of a realization and the first
        beta: BTreeMap<RealizationName, Stat>,
        /// its standard error
        se: BTreeMap<RealizationName, Stat>,
        /// between two neighboring categories
        threshold: BTreeMap<ThresholdName, Stat>,
    }

    /// A cumulative logit model with a slope on VAF.
    pub struct ByVaf {
        /// log likelihood
        loglik: Stat,
        /// log odds ratio per unit of VAF
        beta: Stat as "beta/vaf",
        /// its standard error
        se: Stat as "se/vaf",
        /// between two neighboring categories
        threshold: BTreeMap<ThresholdName, Stat>,
    }

    /// Whether one slope for all thresholds is enough: its likelihood ratio against a slope for each.
    pub struct Proportional {
        /// of the likelihood ratio
        chi2: Stat,
        /// thresholds less one
        df: Stat,
        /// of `chi2`
        p: Stat,
    }

    /// All ratings taken as independent.
    pub struct FixedByVaf {
        /// the model
        model: ByVaf as "",
        /// are the odds proportional?
        proportional_odds: Option<Proportional>,
    }

    /// With a random intercept of each subject.
    pub struct MixedByModel {
        /// fixed effects
        model: ByModel as "",
        /// of the random intercepts, in logits
        sd_subject: Option<Stat>,
        /// 1 if `sd_subject` is 0
        boundary: Option<Stat>,
    }

    /// With a random intercept of each subject.
    pub struct MixedByVaf {
        /// fixed effects
        model: ByVaf as "",
        /// of the random intercepts, in logits
        sd_subject: Option<Stat>,
        /// 1 if `sd_subject` is 0
        boundary: Option<Stat>,
    }

    /// The slope on VAF beside random effects of subjects and of realizations, by Laplace's method, tested by the likelihood ratio. Up to 100 subjects.
    pub struct CrossedByVaf {
        /// log odds ratio per unit of VAF
        beta: Stat as "beta/vaf",
        /// its standard error
        se: Stat as "se/vaf",
        /// log likelihood
        loglik: Stat,
        /// without VAF
        null_loglik: Stat,
        /// of the random intercepts of subjects
        sd_subject: Stat,
        /// of the random intercepts of realizations
        sd_model: Stat,
        /// likelihood ratio against no slope
        lrt_chi2: Stat,
        /// of `lrt_chi2` with one degree of freedom
        lrt_p: Stat,
        /// √((q − 2)(e^(Λ/q) − 1)) with the sign of the slope, of q realizations and Λ = `lrt_chi2`
        t: Stat,
        /// of `t` with q − 2 degrees of freedom
        p: Stat,
    }

    /// Ordinal regression.
    pub struct Ordinal {
        /// all ratings taken as independent
        clm_model: ByModel,
        /// by Laplace's method
        clmm_model_laplace: MixedByModel,
        /// by adaptive Gauss–Hermite quadrature with 60 nodes
        clmm_model_quad: MixedByModel,
        /// all ratings taken as independent
        clm_vaf: FixedByVaf,
        /// by Laplace's method
        clmm_vaf_laplace: MixedByVaf,
        /// by adaptive Gauss–Hermite quadrature with 60 nodes
        clmm_vaf_quad: MixedByVaf,
        /// the one that generalizes to other realizations
        clmm_vaf_crossed: CrossedByVaf,
    }
}

pub(super) fn ordinal(cells: &Cells<'_>) -> Ordinal {
    let mut test = vec![false; cells.ratings.models.len()];
    for m in cells.tested() {
        test[m] = true;
    }
    let of_test = |i: &usize| cells.ratings.model[*i].is_some_and(|m| test[m as usize]);
    let rows: Vec<usize> = cells.order.iter().copied().filter(of_test).collect();
    let (clmm_vaf_crossed, (of_model, of_vaf)) = rayon::join(
        || crossed(cells, &rows),
        || rayon::join(|| by_model(cells, &rows), || by_vaf(cells, &rows)),
    );
    let mixed = |fit: Mixed<ByModel>| MixedByModel {
        model: fit.model,
        sd_subject: fit.sd_subject,
        boundary: fit.boundary,
    };
    let [clmm_model_laplace, clmm_model_quad] = of_model.mixed.map(mixed);
    let mixed = |fit: Mixed<ByVaf>| MixedByVaf {
        model: fit.model,
        sd_subject: fit.sd_subject,
        boundary: fit.boundary,
    };
    let [clmm_vaf_laplace, clmm_vaf_quad] = of_vaf.mixed.map(mixed);
    Ordinal {
        clm_model: of_model.fixed,
        clmm_model_laplace,
        clmm_model_quad,
        clm_vaf: FixedByVaf {
            model: of_vaf.fixed,
            proportional_odds: of_vaf.odds.map(|odds| proportional(odds.as_ref())),
        },
        clmm_vaf_laplace,
        clmm_vaf_quad,
        clmm_vaf_crossed,
    }
}

/// Whether rows, sorted by subject, have more than `most` subjects.
fn more_subjects(cells: &Cells<'_>, rows: &[usize], most: usize) -> bool {
    let subject = |i: usize| cells.ratings.subject[i];
    let next = rows.windows(2).filter(|w| subject(w[0]) != subject(w[1]));
    next.count() >= most
}

/// Whether there are too many subjects for a mixed model. The counts are then pooled
/// over subjects.
fn many(cells: &Cells<'_>, rows: &[usize]) -> bool {
    more_subjects(cells, rows, MAX_SUBJECTS)
}

fn by_model(cells: &Cells<'_>, rows: &[usize]) -> Fits<ByModel> {
    let model = |i: usize| cells.ratings.model[i];
    let mut present: Vec<u32> = rows.iter().filter_map(|&i| model(i)).collect();
    present.sort_unstable();
    present.dedup();
    let names: Vec<&str> = present
        .iter()
        .skip(1)
        .map(|&m| cells.model_name(m as usize))
        .collect();
    // The first realization is the reference level: x = 0 in the first column.
    let predictors: Vec<Predictor> = (0..present.len())
        .map(|g| Predictor {
            column: g.saturating_sub(1),
            x: if g == 0 { 0.0 } else { 1.0 },
        })
        .collect();
    let mut level = vec![0; cells.ratings.models.len()];
    for (g, &m) in (0u32..).zip(&present) {
        level[m as usize] = g;
    }
    let made = if present.len() > MAX_MODELS {
        Err(NotFitted::TooManyRealizations)
    } else {
        categories(cells, rows).map(|ratings| {
            let n = predictors.len();
            let counts = counts(cells, rows, &ratings, n, |i| {
                model(i).map_or(0, |m| level[m as usize])
            });
            let table = CategoryCounts::new(predictors, names.len(), ratings.len(), &counts);
            (table, ratings)
        })
    };
    let named = |x: &[f64]| -> BTreeMap<RealizationName, Stat> {
        let named = names.iter().zip(x);
        named
            .map(|(name, x)| ((*name).into(), Stat::of(*x)))
            .collect()
    };
    fits(made, many(cells, rows), |fit, ratings| ByModel {
        loglik: Stat::of(fit.loglik),
        beta: named(&fit.beta),
        se: named(&fit.se),
        threshold: thresholds(fit, ratings, 0.0),
    })
}

fn by_vaf(cells: &Cells<'_>, rows: &[usize]) -> Fits<ByVaf> {
    let vaf = |i: usize| cells.ratings.vaf[i];
    let rows: Vec<usize> = (rows.iter().copied())
        .filter(|&i| vaf(i).is_some())
        .collect();
    let mut levels: Vec<f64> = rows.iter().filter_map(|&i| vaf(i)).collect();
    levels.sort_unstable_by(f64::total_cmp);
    levels.dedup_by(|a, b| a.total_cmp(b).is_eq());
    // Scaled to −1 … 1, so that the search does not depend on units.
    let (low, high) = match (levels.first(), levels.last()) {
        (Some(low), Some(high)) => (*low, *high),
        _ => (0.0, 0.0),
    };
    let (origin, unit) = (0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low);
    let made = if rows.is_empty() {
        Err(NotFitted::NoVaf)
    } else if unit <= 0.0 {
        Err(NotFitted::EqualVaf)
    } else if levels.len() > MAX_LEVELS {
        Err(NotFitted::TooManyVaf)
    } else {
        categories(cells, &rows).map(|ratings| {
            let predictors = levels
                .iter()
                .map(|v| Predictor {
                    column: 0,
                    x: (v - origin) / unit,
                })
                .collect();
            let index =
                |i: usize| vaf(i).map_or(0, |own| levels.partition_point(|v| *v < own)) as u32;
            let counts = counts(cells, &rows, &ratings, levels.len(), index);
            (
                CategoryCounts::new(predictors, 1, ratings.len(), &counts),
                ratings,
            )
        })
    };
    // On the scale of the data: β/unit, θ + β·origin/unit.
    fits(made, many(cells, &rows), |fit, ratings| {
        let of_data = |x: &[f64]| x.first().map(|x| x / unit);
        let (beta, se) = (of_data(&fit.beta), of_data(&fit.se));
        ByVaf {
            loglik: Stat::of(fit.loglik),
            beta: Stat::or(beta, ""),
            se: Stat::or(se, ""),
            threshold: thresholds(fit, ratings, beta.unwrap_or(0.0) * origin),
        }
    })
}

/// The distinct ratings, ascending.
fn categories(cells: &Cells<'_>, rows: &[usize]) -> Result<Vec<f64>, NotFitted> {
    let mut found: Vec<f64> = Vec::new();
    for rating in rows.iter().filter_map(|&i| cells.ratings.rating[i]) {
        // Adding 0 turns −0 into 0.
        let rating = rating + 0.0;
        if let Err(at) = found.binary_search_by(|v| v.total_cmp(&rating)) {
            if rating.fract() != 0.0 || rating.abs() > WHOLE {
                return Err(NotFitted::NotWhole);
            }
            if found.len() == MAX_CATEGORIES {
                return Err(NotFitted::TooManyCategories);
            }
            found.insert(at, rating);
        }
    }
    match found.len() {
        0 => Err(NotFitted::NoRealization),
        _ => Ok(found),
    }
}

/// Counts of the rows by subject, predictor and category; the rows are sorted by cell.
fn counts(
    cells: &Cells<'_>,
    rows: &[usize],
    ratings: &[f64],
    predictors: usize,
    predictor: impl Fn(usize) -> u32,
) -> Vec<CategoryCount> {
    let category = |i: usize| {
        cells.ratings.rating[i].map_or(0, |rating| ratings.partition_point(|v| *v < rating)) as u32
    };
    if many(cells, rows) {
        let mut tally = vec![0u32; predictors * ratings.len()];
        for &i in rows {
            tally[predictor(i) as usize * ratings.len() + category(i) as usize] += 1;
        }
        let of = |(at, n): (usize, u32)| CategoryCount {
            subject: 0,
            predictor: (at / ratings.len()) as u32,
            category: (at % ratings.len()) as u32,
            n,
        };
        return tally.into_iter().enumerate().map(of).collect();
    }
    let mut counts: Vec<CategoryCount> = Vec::new();
    let mut from = 0;
    for &i in rows {
        let new = CategoryCount {
            subject: cells.ratings.subject[i],
            predictor: predictor(i),
            category: category(i),
            n: 1,
        };
        if counts.get(from).is_some_and(|c| c.subject != new.subject) {
            from = counts.len();
        }
        let same =
            |c: &&mut CategoryCount| (c.predictor, c.category) == (new.predictor, new.category);
        // Counts of the same cell are the subject's last ones.
        match counts[from..].iter_mut().rev().find(same) {
            Some(c) => c.n += 1,
            None => counts.push(new),
        }
    }
    counts
}

/// A fit with a random intercept of each subject.
struct Mixed<T> {
    model: T,
    sd_subject: Option<Stat>,
    boundary: Option<Stat>,
}

/// The fits of one predictor.
struct Fits<T> {
    fixed: T,
    /// By Laplace's method and by quadrature.
    mixed: [Mixed<T>; 2],
    /// Whether the odds are proportional, if there is a fit.
    odds: Option<Option<ProportionalOdds>>,
}

/// Fits the models of a table; `of` makes the record of a fit with these ratings.
fn fits<T: Field>(
    made: Result<(CategoryCounts, Vec<f64>), NotFitted>,
    many: bool,
    of: impl Fn(&ClmFit, &[f64]) -> T,
) -> Fits<T> {
    let without = |why: NotFitted| T::undefined(&why.to_string().into());
    let (table, ratings) = match made {
        Ok(made) => made,
        Err(why) => {
            let mixed = || Mixed {
                model: without(why),
                sd_subject: None,
                boundary: None,
            };
            return Fits {
                fixed: without(why),
                mixed: [mixed(), mixed()],
                odds: None,
            };
        }
    };
    let fixed = clm(&table);
    let mixed: [Result<ClmmFit, NotFitted>; 2] = if many {
        [(); 2].map(|()| Err(NotFitted::TooManySubjects))
    } else {
        let both = clmm(&table);
        [both.laplace, both.quadrature].map(|m| m.map_err(NotFitted::from))
    };
    let with_intercepts = |fit: Result<ClmmFit, NotFitted>| match fit {
        Ok(fit) => Mixed {
            model: of(&fit.fit, &ratings),
            sd_subject: Some(Stat::of(fit.sd)),
            boundary: Some(Stat::flag(fit.boundary)),
        },
        Err(why) => Mixed {
            model: without(why),
            sd_subject: Some(Stat::missing(why.to_string())),
            boundary: None,
        },
    };
    Fits {
        odds: (fixed.as_ref().ok()).map(|fit| proportional_odds(&table, fit)),
        fixed: match &fixed {
            Ok(fit) => of(fit, &ratings),
            Err(why) => without((*why).into()),
        },
        mixed: mixed.map(with_intercepts),
    }
}

/// The thresholds between these ratings, plus a number.
fn thresholds(fit: &ClmFit, ratings: &[f64], plus: f64) -> BTreeMap<ThresholdName, Stat> {
    let names = ratings
        .windows(2)
        .map(|w| ThresholdName(format!("{}|{}", w[0], w[1])));
    let thresholds = fit.thresholds.iter().map(|x| Stat::of(x + plus));
    names.zip(thresholds).collect()
}

/// Whether one slope for all thresholds is enough.
fn proportional(found: Option<&ProportionalOdds>) -> Proportional {
    let why =
        "fewer than three categories, or the model with a slope for each threshold has no fit";
    Proportional {
        chi2: Stat::or(found.map(|f| f.chi2), why),
        df: Stat::or(found.map(|f| f.df), why),
        p: Stat::or(found.and_then(|f| f.p), why),
    }
}

/// The slope on VAF beside random effects of subjects and of realizations.
fn crossed(cells: &Cells<'_>, rows: &[usize]) -> CrossedByVaf {
    let model = |i: usize| cells.ratings.model[i].map(|m| m as usize);
    let vaf = |i: usize| model(i).and_then(|m| cells.vaf[m]);
    let rows: Vec<usize> = (rows.iter().copied())
        .filter(|&i| vaf(i).is_some())
        .collect();
    let mut present: Vec<usize> = rows.iter().filter_map(|&i| model(i)).collect();
    present.sort_unstable();
    present.dedup();
    let all: Vec<f64> = present.iter().filter_map(|&m| cells.vaf[m]).collect();
    let low = all.iter().copied().fold(f64::INFINITY, f64::min);
    let high = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (origin, unit) = (0.5 * low + 0.5 * high, 0.5 * high - 0.5 * low);
    let found = (|| {
        if rows.is_empty() {
            return Err(NotFitted::NoVaf);
        } else if unit.is_nan() || unit <= 0.0 {
            return Err(NotFitted::EqualVaf);
        } else if present.len() > MAX_MODELS {
            return Err(NotFitted::TooManyRealizations);
        } else if more_subjects(cells, &rows, MAX_CROSSED_SUBJECTS) {
            return Err(NotFitted::TooManyCrossedSubjects);
        }
        let ratings = categories(cells, &rows)?;
        let predictors = all.iter().map(|v| Predictor {
            column: 0,
            x: (v - origin) / unit,
        });
        let index = |i: usize| {
            let at = model(i).and_then(|m| present.binary_search(&m).ok());
            at.unwrap_or(0) as u32
        };
        let counts = counts(cells, &rows, &ratings, present.len(), index);
        let table = CategoryCounts::new(predictors.collect(), 1, ratings.len(), &counts);
        Ok(clmm_crossed(&table)?)
    })();
    let found = match found {
        Ok(found) => found,
        Err(why) => return CrossedByVaf::undefined(why.to_string()),
    };
    let scaled = |x: &[f64]| Stat::or(x.first().map(|x| x / unit), "");
    CrossedByVaf {
        beta: scaled(&found.fit.beta),
        se: scaled(&found.fit.se),
        loglik: Stat::of(found.fit.loglik),
        null_loglik: Stat::of(found.null_loglik),
        sd_subject: Stat::of(found.sd_subject),
        sd_model: Stat::of(found.sd_realization),
        lrt_chi2: Stat::of(found.chi2),
        lrt_p: Stat::or(found.p_chi2, ""),
        t: Stat::of(found.t),
        p: Stat::or(found.p, ""),
    }
}
