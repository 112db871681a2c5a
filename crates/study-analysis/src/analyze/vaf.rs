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
use super::identifiers::group_id;
use super::subjects::MAX_LISTED;
use super::values::Values;
use study_stats::bayes::jzs_bf10;
use study_stats::bootstrap;
use study_stats::correlation::{pearson, spearman, within_subjects};
use study_stats::describe::{is_constant, mean};
use study_stats::friedman::page;
use study_stats::lmm::LmmError;
use study_stats::paired::one_sample;
use study_stats::regression::slope;

/// The tested realizations with a VAF.
fn with_vaf(cells: &Cells<'_>) -> Vec<usize> {
    let mut models = cells.tested();
    models.retain(|&m| cells.vaf[m].is_some());
    models
}

/// What is estimated over participants, for these realizations only.
pub(super) fn over_participants(cells: &Cells<'_>, rules: &Rules, values: &mut Values) {
    let models = with_vaf(cells);
    let vaf: Vec<f64> = models.iter().filter_map(|&m| cells.vaf[m]).collect();
    let table = cells.table(&models);
    by_subject(cells, &table, &vaf, values);
    trend(&table, &vaf, values);
    resampled(&table, &vaf, rules, values);
    within(cells, &models, values);
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
    points.map_or_else(Correlation::without_means, |p| {
        Correlation::of_pearson(&p.vaf, &p.means, rules)
    })
}

/// The realizations with their means over participants.
fn raw_points<'a>(cells: &'a Cells<'_>) -> Points<'a> {
    let by_model = cells.subject_means();
    let raw = |m: usize| mean(&by_model[m]);
    Points::of(cells, &with_vaf(cells), |m| cells.vaf[m], raw)
}

/// The realizations with the means on which verdicts rest.
fn adjusted_points<'a>(cells: &'a Cells<'_>, adjusted: &Adjusted) -> Result<Points<'a>, LmmError> {
    let of = adjusted_mean(adjusted)?;
    Ok(Points::of(cells, &with_vaf(cells), |m| cells.vaf[m], of))
}

fn adjusted_mean(adjusted: &Adjusted) -> Result<impl Fn(usize) -> Option<f64>, LmmError> {
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
    points.map_or_else(Correlation::without_means, |p| {
        Correlation::of_pearson(&p.vaf, &p.means, rules)
    })
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
fn by_subject(cells: &Cells<'_>, table: &CompleteTable, vaf: &[f64], values: &mut Values) {
    let (mut z, mut slopes, mut perfect) = (Vec::new(), Vec::new(), false);
    let enough = vaf.len() >= 3 && !is_constant(vaf);
    for (&s, row) in table.subjects.iter().zip(&table.rows).filter(|_| enough) {
        let r = pearson(vaf, row);
        let b = slope(vaf, row);
        if table.subjects.len() <= MAX_LISTED {
            let id = group_id("subject_corr", &[cells.subject_name(s)]);
            let mut g = values.group(id, "the subject rated all realizations alike");
            g.maybe("r", r);
            g.maybe("spearman", spearman(vaf, row));
            g.maybe("slope", b);
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
    let test = one_sample(&z).filter(|_| !perfect);
    let mut g = values.group("subject_corr", why);
    g.put("n_defined", z.len() as f64);
    g.maybe("fisher_z_mean", test.map(|t| t.mean));
    g.maybe("r_back", test.map(|t| t.mean.tanh()));
    g.maybe("t", test.and_then(|t| t.t));
    g.maybe("p", test.and_then(|t| t.p));
    let ends = test.map(|t| t.ci95);
    g.interval("r_ci95", ends.map(|(l, h)| (l.tanh(), h.tanh())));
    let test = one_sample(&slopes);
    let why = if enough {
        "fewer than two complete subjects, or equal slopes"
    } else {
        FEW
    };
    let mut g = values.group("subject_slope", why);
    g.maybe("mean", test.map(|t| t.mean));
    g.maybe("sd", test.map(|t| t.sd));
    g.maybe("t", test.and_then(|t| t.t));
    g.maybe("p", test.and_then(|t| t.p));
    g.interval("ci95", test.map(|t| t.ci95));
    let t = test.and_then(|t| t.t);
    g.maybe("jzs_bf10", t.and_then(|t| jzs_bf10(t, slopes.len(), 0.707)));
}

fn trend(table: &CompleteTable, vaf: &[f64], values: &mut Values) {
    let Some(p) = page(&table.rows, vaf).filter(|_| vaf.len() >= 3) else {
        let why = "fewer than two complete subjects, or three realizations, or one VAF";
        values.group("page", why).none(&["L", "z", "p_greater"]);
        return;
    };
    let mut g = values.group("page", "every subject rated all realizations alike");
    g.put("L", p.l);
    g.maybe("z", p.z);
    g.maybe("p_greater", p.p_greater);
    let why = "realizations share a VAF";
    g.put_or(
        "p_greater_no_tie_correction",
        p.p_greater_no_tie_correction,
        why,
    );
}

fn resampled(table: &CompleteTable, vaf: &[f64], rules: &Rules, values: &mut Values) {
    let found = bootstrap::correlation(&table.rows, vaf, &mut Draws::new(rules.seed, "bootstrap"));
    let why = "fewer than two complete subjects or three realizations, or no correlation";
    let mut g = values.group("bootstrap", why);
    let Some(b) = found else {
        g.none(&[
            "mean",
            "se",
            "percentile_lo",
            "percentile_hi",
            "bca_lo",
            "bca_hi",
        ]);
        return;
    };
    g.put("mean", b.mean);
    g.put("se", b.se);
    g.put("percentile_lo", b.percentile.0);
    g.put("percentile_hi", b.percentile.1);
    g.put("p_le_zero", b.p_le_zero);
    g.put("undefined_probability", b.undefined_probability);
    g.put("exact", f64::from(u8::from(b.exact)));
    g.put("normal_limit", f64::from(u8::from(b.normal_limit)));
    let why = "the correlation lies at the end of its own distribution";
    g.put_or("z0", b.z0, why);
    g.put_or("bca_lo", b.bca.map(|c| c.0), why);
    g.put_or("bca_hi", b.bca.map(|c| c.1), why);
    let why = "leaving out any one subject changes nothing, or leaves no correlation";
    g.put_or("jackknife_acceleration", b.acceleration, why);
}

/// Repeated-measures correlation, over cells and over trials. Trials need a VAF but no
/// realization.
fn within(cells: &Cells<'_>, models: &[usize], values: &mut Values) {
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
    for (id, groups) in [("rmcorr_cells", by_cell), ("rmcorr_trials", by_trial)] {
        let found = within_subjects(&groups.x, &groups.y, &groups.lengths);
        let why = "too few ratings with a VAF, or no variation within subjects";
        let mut g = values.group(id, why);
        g.maybe("r", found.map(|w| w.r));
        g.maybe("df", found.map(|w| w.df));
        g.maybe("p", found.and_then(|w| w.p));
        g.interval("ci95", found.and_then(|w| w.ci95));
    }
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
}
