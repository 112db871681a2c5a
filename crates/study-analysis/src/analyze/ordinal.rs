//! Ordinal regression: `clm_*` treats all ratings as independent, `clmm_*` has a
//! random intercept for each subject. `*_model` estimates an effect of each tested
//! realization relative to the first, `*_vaf` a slope on the row's VAF. All results
//! hold for these realizations only.
//!
//! The categories are the whole numbers that occur. A rating that nobody gave has no
//! probability and no threshold.

use super::cells::Cells;
use super::identifiers::group_id;
use super::values::{self, Values};
use rayon::prelude::*;
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

pub(super) fn ordinal(cells: &Cells<'_>, values: &mut Values) {
    let mut test = vec![false; cells.ratings.models.len()];
    for m in cells.tested() {
        test[m] = true;
    }
    let of_test = |i: &usize| cells.ratings.model[*i].is_some_and(|m| test[m as usize]);
    let rows: Vec<usize> = cells.order.iter().copied().filter(of_test).collect();
    let both: [Group; 3] = [crossed, by_model, by_vaf];
    let parts = both.par_iter().map(|group| {
        let mut values = Values::default();
        group(cells, &rows, &mut values);
        values
    });
    for part in parts.collect::<Vec<Values>>() {
        values.extend(part);
    }
}

/// Fits the models of one predictor.
type Group = fn(&Cells<'_>, &[usize], &mut Values);

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

fn by_model(cells: &Cells<'_>, rows: &[usize], values: &mut Values) {
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
    let scale = Scale {
        names: &names,
        unit: 1.0,
        origin: 0.0,
    };
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
    put_all("model", made, many(cells, rows), &scale, values);
}

fn by_vaf(cells: &Cells<'_>, rows: &[usize], values: &mut Values) {
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
    let scale = Scale {
        names: &["vaf"],
        unit,
        origin,
    };
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
    put_all("vaf", made, many(cells, &rows), &scale, values);
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

/// Names of the coefficients, and the scaling of x = (value − origin)/unit.
struct Scale<'a> {
    names: &'a [&'a str],
    unit: f64,
    origin: f64,
}

fn put_all(
    what: &str,
    made: Result<(CategoryCounts, Vec<f64>), NotFitted>,
    many: bool,
    scale: &Scale<'_>,
    values: &mut Values,
) {
    let ids = [
        format!("clm_{what}"),
        format!("clmm_{what}_laplace"),
        format!("clmm_{what}_quad"),
    ];
    let (table, ratings) = match made {
        Ok(made) => made,
        Err(why) => {
            for id in ids {
                none(&mut values.group(id, why.to_string()), what);
            }
            return;
        }
    };
    let labels: Vec<String> = ratings
        .windows(2)
        .map(|w| format!("{}|{}", w[0], w[1]))
        .collect();
    let fixed = clm(&table);
    match &fixed {
        Ok(fit) => {
            put(fit, &labels, scale, &mut values.group(&ids[0], ""));
            if what == "vaf" {
                proportional(proportional_odds(&table, fit).as_ref(), values);
            }
        }
        Err(cause) => none(&mut values.group(&ids[0], cause.to_string()), what),
    }
    let mixed: [Result<ClmmFit, NotFitted>; 2] = if many {
        [(); 2].map(|()| Err(NotFitted::TooManySubjects))
    } else {
        let both = clmm(&table);
        [both.laplace, both.quadrature].map(|m| m.map_err(NotFitted::from))
    };
    for (id, mixed) in ids[1..].iter().zip(mixed) {
        match mixed {
            Ok(mixed) => {
                let mut g = values.group(id, "");
                put(&mixed.fit, &labels, scale, &mut g);
                g.put("sd_subject", mixed.sd);
                g.put("boundary", f64::from(u8::from(mixed.boundary)));
            }
            Err(why) => {
                let mut g = values.group(id, why.to_string());
                none(&mut g, what);
                g.none(&["sd_subject"]);
            }
        }
    }
}

/// Whether one slope for all thresholds is enough.
fn proportional(found: Option<&ProportionalOdds>, values: &mut Values) {
    let why =
        "fewer than three categories, or the model with a slope for each threshold has no fit";
    let mut g = values.group("clm_vaf/proportional_odds", why);
    g.maybe("chi2", found.map(|f| f.chi2));
    g.maybe("df", found.map(|f| f.df));
    g.maybe("p", found.and_then(|f| f.p));
}

/// The slope on VAF beside random effects of subjects and of realizations, tested by the
/// likelihood ratio: `clmm_vaf_crossed/*`.
fn crossed(cells: &Cells<'_>, rows: &[usize], values: &mut Values) {
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
    let why = found
        .as_ref()
        .err()
        .map_or_else(String::new, ToString::to_string);
    let found = found.ok();
    let mut g = values.group("clmm_vaf_crossed", why);
    let scaled = |of: fn(&ClmFit) -> &Vec<f64>| {
        let first = found.as_ref().and_then(|f| of(&f.fit).first());
        first.map(|x| x / unit)
    };
    g.maybe("beta/vaf", scaled(|f| &f.beta));
    g.maybe("se/vaf", scaled(|f| &f.se));
    g.maybe("loglik", found.as_ref().map(|f| f.fit.loglik));
    g.maybe("null_loglik", found.as_ref().map(|f| f.null_loglik));
    g.maybe("sd_subject", found.as_ref().map(|f| f.sd_subject));
    g.maybe("sd_model", found.as_ref().map(|f| f.sd_realization));
    g.maybe("lrt_chi2", found.as_ref().map(|f| f.chi2));
    g.maybe("lrt_p", found.as_ref().and_then(|f| f.p_chi2));
    g.maybe("t", found.as_ref().map(|f| f.t));
    g.maybe("p", found.as_ref().and_then(|f| f.p));
}

fn none(g: &mut values::Group<'_>, what: &str) {
    g.none(&["loglik"]);
    if what == "vaf" {
        g.none(&["beta/vaf", "se/vaf"]);
    }
}

/// Adds the estimates on the scale of the data: θ + β·origin/unit, β/unit.
fn put(fit: &ClmFit, labels: &[String], scale: &Scale<'_>, g: &mut values::Group<'_>) {
    g.put("loglik", fit.loglik);
    for ((name, beta), se) in scale.names.iter().zip(&fit.beta).zip(&fit.se) {
        g.put(&group_id("beta", &[name]), beta / scale.unit);
        g.put(&group_id("se", &[name]), se / scale.unit);
    }
    let shift = match fit.beta.first() {
        Some(beta) => beta / scale.unit * scale.origin,
        None => 0.0,
    };
    for (label, threshold) in labels.iter().zip(&fit.thresholds) {
        g.put(&format!("threshold/{label}"), threshold + shift);
    }
}
