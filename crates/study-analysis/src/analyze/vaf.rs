//! VAF as a predictor of the rating: correlations over realizations, the main result;
//! `subject_corr/*`, `subject_slope/*`, `rmcorr_*`, `bootstrap/*`, `page/*` over
//! subjects, which hold for these realizations only.
//!
//! Only tested realizations with a VAF.

use super::Rules;
use super::adjusted::Adjusted;
use super::cells::{Cells, CompleteTable};
use super::correlation::{Correlation, FEW};
use super::draws::Draws;
use super::record::{Interval, ParticipantName, Stat, statistics};
use super::subjects::MAX_LISTED;
use std::collections::BTreeMap;
use study_stats::bayes::jzs_bf10;
use study_stats::bootstrap;
use study_stats::correlation::{pearson, spearman, within_subjects};
use study_stats::describe::{is_constant, mean};
use study_stats::friedman::page;
use study_stats::paired::one_sample;
use study_stats::regression::slope;
use study_stats::within::WithinError;

statistics! {
    /// The cells of a complete participant on VAF.
    pub struct OfSubject {
        /// Pearson's correlation; constant raters have none
        r: Stat,
        /// of ranks
        spearman: Stat,
        /// least squares; 0 of constant raters
        slope: Stat,
    }

    /// Correlations of the participants' cells with VAF; undefined if one of them is ±1.
    pub struct SubjectCorr {
        /// of each participant
        by_subject: BTreeMap<ParticipantName, OfSubject> as "",
        /// participants with a correlation
        n_defined: Stat,
        /// mean of z = atanh r over them
        fisher_z_mean: Stat,
        /// tanh of that mean
        r_back: Stat,
        /// one-sample t of z
        t: Stat,
        /// of `t`
        p: Stat,
        /// of `r_back`
        r_ci95: Interval,
    }

    /// One-sample t test of the participants' slopes on VAF.
    pub struct SubjectSlope {
        /// of the slopes
        mean: Stat,
        /// of the slopes
        sd: Stat,
        /// against 0
        t: Stat,
        /// of `t`
        p: Stat,
        /// of the mean
        ci95: Interval,
        /// Rouder et al. (2009), scale 0.707
        jzs_bf10: Stat,
    }

    /// Page's test of a trend in the order of VAF: scores are the ranks of VAF.
    pub struct Page {
        /// Σ score × rank
        l: Stat as "L",
        /// by the permutation variance, which accounts for ties
        z: Stat,
        /// one-sided
        p_greater: Stat,
        /// by Page's own variance (1963)
        p_greater_no_tie_correction: Option<Stat>,
    }

    /// Bootstrap of `corr/pearson/r` over complete participants. Up to ten of them, all C(2S−1, S) compositions with their multinomial weights, hence without Monte Carlo error; above, 10,000 resamples. It does not generalize to other realizations.
    pub struct Bootstrap {
        /// of r
        mean: Stat,
        /// its standard deviation
        se: Stat,
        /// 95 %; a quantile is the smallest value with cdf ≥ p
        percentile: Interval,
        /// 95 % (Efron 1987)
        bca: Interval,
        /// share of resamples with r ≤ 0
        p_le_zero: Option<Stat>,
        /// share of resamples in which all realizations have the same mean: they have no r and are left out
        undefined_probability: Option<Stat>,
        /// 1: by all compositions
        exact: Option<Stat>,
        /// 1: above 500 participants (or 50,000 cells) the means of the resamples are drawn from their limiting normal distribution; with 500 participants and a skewness of 1 this shifts a quantile by .02 standard errors, less than the .027 of 10,000 draws
        normal_limit: Option<Stat>,
        /// of BCa; it counts ties half
        z0: Option<Stat>,
        /// of BCa
        jackknife_acceleration: Option<Stat>,
    }

    /// Repeated-measures correlation (Bakdash & Marusich 2017).
    pub struct Within {
        /// the correlation
        r: Stat,
        /// N − S − 1
        df: Stat,
        /// of r
        p: Stat,
        /// by Fisher's z with df − 1
        ci95: Interval,
    }

    /// What is estimated over participants, for these realizations only.
    pub struct OverParticipants {
        /// correlations
        subject_corr: SubjectCorr,
        /// slopes
        subject_slope: SubjectSlope,
        /// a trend
        page: Page,
        /// other participants
        bootstrap: Bootstrap,
        /// over cells
        rmcorr_cells: Within,
        /// over trials
        rmcorr_trials: Within,
    }
}

/// The tested realizations with a VAF.
fn with_vaf(cells: &Cells<'_>) -> Vec<usize> {
    let mut models = cells.tested();
    models.retain(|&m| cells.vaf[m].is_some());
    models
}

pub(super) fn over_participants(cells: &Cells<'_>, rules: &Rules) -> OverParticipants {
    let models = with_vaf(cells);
    let vaf: Vec<f64> = models.iter().filter_map(|&m| cells.vaf[m]).collect();
    let table = cells.table(&models);
    let (subject_corr, subject_slope) = by_subject(cells, &table, &vaf);
    let (rmcorr_cells, rmcorr_trials) = within(cells, &models);
    OverParticipants {
        subject_corr,
        subject_slope,
        page: trend(&table, &vaf),
        bootstrap: resampled(&table, &vaf, rules),
        rmcorr_cells,
        rmcorr_trials,
    }
}

/// The correlations with the means as they are and with the adjusted means.
pub(super) fn correlations(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    rules: &Rules,
) -> (Correlation, Correlation) {
    let raw = raw_points(cells).correlate(rules);
    let of_adjusted = if adjusted.design.is_complete() {
        raw.clone()
    } else {
        let points = adjusted_points(cells, adjusted);
        points.map_or_else(Correlation::without_means, |p| p.correlate(rules))
    };
    let of_adjusted = weighted(of_adjusted, adjusted, |m| cells.vaf[m]);
    (raw, of_adjusted)
}

/// Of `corr/*` what is compared with the finding.
pub(super) fn raw(cells: &Cells<'_>, rules: &Rules) -> Correlation {
    let p = raw_points(cells);
    Correlation::of_pearson(&p.vaf, &p.means, rules)
}

/// Of `corr_adjusted/*` what the finding rests on.
pub(super) fn deciding(cells: &Cells<'_>, adjusted: &Adjusted, rules: &Rules) -> Correlation {
    let points = adjusted_points(cells, adjusted);
    let found = points.map_or_else(Correlation::without_means, |p| {
        Correlation::of_pearson(&p.vaf, &p.means, rules)
    });
    weighted(found, adjusted, |m| cells.vaf[m])
}

/// With the trend on the VAF of each realization, unless all means are equally precise.
fn weighted(
    found: Correlation,
    adjusted: &Adjusted,
    vaf: impl Fn(usize) -> Option<f64>,
) -> Correlation {
    let vaf: Vec<Option<f64>> = adjusted.models.iter().map(|&m| vaf(m)).collect();
    if adjusted.is_balanced(&vaf) {
        return found;
    }
    let within = adjusted.within.as_ref().ok();
    found.with_trend(within.and_then(|within| within.trend(&vaf)))
}

/// The realizations with their means over participants.
fn raw_points<'a>(cells: &'a Cells<'_>) -> Points<'a> {
    let by_model = cells.subject_means();
    let raw = |m: usize| mean(&by_model[m]);
    Points::of(cells, &with_vaf(cells), |m| cells.vaf[m], raw)
}

/// The realizations with the means on which verdicts rest.
fn adjusted_points<'a>(
    cells: &'a Cells<'_>,
    adjusted: &Adjusted,
) -> Result<Points<'a>, WithinError> {
    let of = adjusted_mean(adjusted)?;
    Ok(Points::of(cells, &with_vaf(cells), |m| cells.vaf[m], of))
}

fn adjusted_mean(adjusted: &Adjusted) -> Result<impl Fn(usize) -> Option<f64>, WithinError> {
    let means = adjusted.means.as_ref().map_err(|why| *why)?;
    Ok(|m: usize| Some(means[adjusted.models.binary_search(&m).ok()?]))
}

/// `corr_delivered/*`: the correlation of the ratings with the delivered VAF of each
/// realization.
pub(super) fn against_delivered(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    delivered: &[Option<f64>],
    rules: &Rules,
) -> Correlation {
    let mut models = cells.tested();
    models.retain(|&m| delivered[m].is_some());
    let by_model = cells.subject_means();
    let points = if adjusted.design.is_complete() {
        Ok(Points::of(
            cells,
            &models,
            |m| delivered[m],
            |m| mean(&by_model[m]),
        ))
    } else {
        adjusted_mean(adjusted).map(|of| Points::of(cells, &models, |m| delivered[m], of))
    };
    let found = points.map_or_else(Correlation::without_means, |p| {
        Correlation::of_pearson(&p.vaf, &p.means, rules)
    });
    weighted(found, adjusted, |m| delivered[m])
}

/// The realizations as points.
#[derive(Default)]
struct Points<'a> {
    vaf: Vec<f64>,
    means: Vec<f64>,
    names: Vec<&'a str>,
}

impl<'a> Points<'a> {
    /// The realizations with a VAF and a mean.
    fn of(
        cells: &'a Cells<'_>,
        models: &[usize],
        vaf: impl Fn(usize) -> Option<f64>,
        mean: impl Fn(usize) -> Option<f64>,
    ) -> Self {
        let mut points = Self::default();
        for &m in models {
            if let (Some(vaf), Some(mean)) = (vaf(m), mean(m)) {
                points.vaf.push(vaf);
                points.means.push(mean);
                points.names.push(cells.model_name(m));
            }
        }
        points
    }

    fn correlate(&self, rules: &Rules) -> Correlation {
        Correlation::of(&self.vaf, &self.means, &self.names, rules)
    }
}

/// Correlation and slope of each complete subject, and their means.
fn by_subject(
    cells: &Cells<'_>,
    table: &CompleteTable,
    vaf: &[f64],
) -> (SubjectCorr, SubjectSlope) {
    let (mut z, mut slopes, mut perfect) = (Vec::new(), Vec::new(), false);
    let mut by_subject = BTreeMap::new();
    let enough = vaf.len() >= 3 && !is_constant(vaf);
    for (&s, row) in table.subjects.iter().zip(&table.rows).filter(|_| enough) {
        let r = pearson(vaf, row);
        let b = slope(vaf, row);
        if table.subjects.len() <= MAX_LISTED {
            let or = |x| Stat::or(x, "the subject rated all realizations alike");
            let of_subject = OfSubject {
                r: or(r),
                spearman: or(spearman(vaf, row)),
                slope: or(b),
            };
            by_subject.insert(cells.subject_name(s).into(), of_subject);
        }
        slopes.extend(b);
        if let Some(r) = r {
            perfect |= 1.0 - r.abs() < 1e-12;
            z.push(r.atanh());
        }
    }
    let why = if !enough {
        FEW
    } else if perfect {
        "a subject's ratings lie on a line with VAF: its z is infinite"
    } else {
        "fewer than two subjects with a correlation"
    };
    let or = |x: Option<f64>| Stat::or(x, why);
    let test = one_sample(&z).filter(|_| !perfect);
    let ends = test.map(|t| t.ci95);
    let correlations = SubjectCorr {
        by_subject,
        n_defined: Stat::count(z.len()),
        fisher_z_mean: or(test.map(|t| t.mean)),
        r_back: or(test.map(|t| t.mean.tanh())),
        t: or(test.and_then(|t| t.t)),
        p: or(test.and_then(|t| t.p)),
        r_ci95: Interval::or(ends.map(|(l, h)| (l.tanh(), h.tanh())), why),
    };
    let test = one_sample(&slopes);
    let why = if enough {
        "fewer than two complete subjects, or equal slopes"
    } else {
        FEW
    };
    let or = |x: Option<f64>| Stat::or(x, why);
    let t = test.and_then(|t| t.t);
    let of_slopes = SubjectSlope {
        mean: or(test.map(|t| t.mean)),
        sd: or(test.map(|t| t.sd)),
        t: or(t),
        p: or(test.and_then(|t| t.p)),
        ci95: Interval::or(test.map(|t| t.ci95), why),
        jzs_bf10: or(t.and_then(|t| jzs_bf10(t, slopes.len(), 0.707))),
    };
    (correlations, of_slopes)
}

fn trend(table: &CompleteTable, vaf: &[f64]) -> Page {
    let Some(p) = page(&table.rows, vaf).filter(|_| vaf.len() >= 3) else {
        let why = "fewer than two complete subjects, or three realizations, or one VAF";
        return Page::undefined(why);
    };
    let alike = "every subject rated all realizations alike";
    Page {
        l: Stat::of(p.l),
        z: Stat::or(p.z, alike),
        p_greater: Stat::or(p.p_greater, alike),
        p_greater_no_tie_correction: Some(Stat::or(
            p.p_greater_no_tie_correction,
            "realizations share a VAF",
        )),
    }
}

fn resampled(table: &CompleteTable, vaf: &[f64], rules: &Rules) -> Bootstrap {
    let found = bootstrap::correlation(&table.rows, vaf, &mut Draws::new(rules.seed, "bootstrap"));
    let Some(b) = found else {
        let why = "fewer than two complete subjects or three realizations, or no correlation";
        return Bootstrap::undefined(why);
    };
    let end = "the correlation lies at the end of its own distribution";
    let alone = "leaving out any one subject changes nothing, or leaves no correlation";
    Bootstrap {
        mean: Stat::of(b.mean),
        se: Stat::of(b.se),
        percentile: Interval::or(Some(b.percentile), ""),
        bca: Interval::or(b.bca, end),
        p_le_zero: Some(Stat::of(b.p_le_zero)),
        undefined_probability: Some(Stat::of(b.undefined_probability)),
        exact: Some(Stat::flag(b.exact)),
        normal_limit: Some(Stat::flag(b.normal_limit)),
        z0: Some(Stat::or(b.z0, end)),
        jackknife_acceleration: Some(Stat::or(b.acceleration, alone)),
    }
}

/// Repeated-measures correlation, over cells and over trials. Trials need a VAF but no
/// realization.
fn within(cells: &Cells<'_>, models: &[usize]) -> (Within, Within) {
    let r = cells.ratings;
    let mut by_cell = Flat::default();
    for own in cells.cells.chunk_by(|a, b| a.subject == b.subject) {
        by_cell.next();
        for c in own {
            if let (Ok(_), Some(v)) = (models.binary_search(&c.model), cells.vaf[c.model]) {
                by_cell.push(v, c.mean);
            }
        }
    }
    // Whether to include the trials of a realization; those without one are included.
    let mut included = vec![false; r.models.len()];
    for m in cells.tested() {
        included[m] = true;
    }
    let mut by_trial = Flat::default();
    for own in cells.all.chunk_by(|&a, &b| r.subject[a] == r.subject[b]) {
        by_trial.next();
        for &i in own {
            if let (Some(vaf), Some(rating)) = (r.vaf[i], cells.centered[i])
                && r.model[i].is_none_or(|m| included[m as usize])
            {
                by_trial.push(vaf, rating);
            }
        }
    }
    (by_cell.correlate(), by_trial.correlate())
}

/// Pairs (x, y) of all subjects, and the number of pairs of each.
#[derive(Default)]
struct Flat {
    x: Vec<f64>,
    y: Vec<f64>,
    lengths: Vec<usize>,
}

impl Flat {
    /// Starts the next subject.
    fn next(&mut self) {
        self.lengths.push(0);
    }

    fn push(&mut self, x: f64, y: f64) {
        self.x.push(x);
        self.y.push(y);
        if let Some(n) = self.lengths.last_mut() {
            *n += 1;
        }
    }

    fn correlate(&self) -> Within {
        let found = within_subjects(&self.x, &self.y, &self.lengths);
        let why = "too few ratings with a VAF, or no variation within subjects";
        Within {
            r: Stat::or(found.map(|w| w.r), why),
            df: Stat::or(found.map(|w| w.df), why),
            p: Stat::or(found.and_then(|w| w.p), why),
            ci95: Interval::or(found.and_then(|w| w.ci95), why),
        }
    }
}
