//! Differences between realizations and agreement: `friedman/*`, `rmanova/*`,
//! `rmanova2/*`, `posthoc/*`, `icc_*`, `krippendorff_*`. All over the tested
//! realizations.

use super::cells::{Cell, Cells, CompleteTable};
use super::identifiers::pair_id;
use super::record::{List, Stat, statistics};
use super::values::Values;
use study_stats::agreement::{Alpha, Coefficient, Icc, icc, krippendorff};
use study_stats::anova::{Effect, one_way, two_way};
use study_stats::friedman::friedman;
use study_stats::paired::{holm, paired};

/// Largest number of realizations (times repetitions) of an analysis of variance.
pub(super) const MAX_COLUMNS: usize = 300;

/// Largest number of realizations that are compared pair by pair.
pub const MAX_PAIRED: usize = 8;

/// Largest number of distinct repetitions for agreement.
const MAX_LABELS: usize = 10_000;

const FEW: &str = "fewer than two complete subjects or realizations";
const NO_END: &str = "the interval of ICC2 ends where Spearman–Brown's formula has its pole";
const NO_ERROR: &str = "the ratings leave no variance of error";

statistics! {
    /// Friedman's test: mid-ranks within each subject's row, χ² = (k−1) Σ(Rⱼ − n(k+1)/2)²/(Σr² − nk(k+1)²/4).
    pub struct Friedman {
        /// by realization
        mean_ranks: Option<List>,
        /// k − 1
        df: Option<Stat>,
        /// the statistic
        chi2: Stat,
        /// of `chi2`
        p: Stat,
        /// χ²/(n(k−1))
        kendall_w: Stat as "kendall_W",
        /// k − 1
        iman_davenport_df1: Option<Stat>,
        /// (k−1)(n−1)
        iman_davenport_df2: Option<Stat>,
        /// (n−1)χ²/(n(k−1) − χ²) (Iman & Davenport 1980)
        iman_davenport_f: Option<Stat> as "iman_davenport_F",
        /// of F
        iman_davenport_p: Option<Stat>,
        /// over all orders of the (tied) ranks within rows, computed by adding the rows one by one to the distribution of the sorted rank sums, as long as the number of sums is small enough ([limitations.md](limitations.md))
        exact_p: Option<Stat>,
    }

    /// The analysis of variance of cells with orthonormal (Helmert) contrasts: SS = S|ȳ|², error Σ|yₛ − ȳ|². The default p is `p_gg`.
    pub struct Anova {
        /// sum of squares of the realizations
        ss_model: Option<Stat>,
        /// of the subjects
        ss_subject: Option<Stat>,
        /// of the error
        ss_error: Option<Stat>,
        /// k − 1
        df1: Option<Stat>,
        /// (k−1)(S−1)
        df2: Option<Stat>,
        /// the statistic
        f: Stat as "F",
        /// without correction
        p: Stat,
        /// (tr Σ)²/(q tr Σ²), q = k − 1
        eps_gg: Option<Stat>,
        /// with Greenhouse and Geisser's correction
        p_gg: Stat,
        /// (Sqε − 2)/(q(S − 1 − qε)), clipped at 1 for `p_hf`
        eps_hf_unclipped: Option<Stat>,
        /// with Huynh and Feldt's correction
        p_hf: Option<Stat>,
        /// generalized η², SSm/(SSm+SSs+SSe)
        ges: Option<Stat>,
        /// partial η², SSm/(SSm+SSe)
        pes: Option<Stat>,
        /// det Σ/(tr Σ/q)^q
        mauchly_w: Option<Stat> as "mauchly_W",
        /// with the second-order term (Anderson 1958, §10.7.4) (q+2)(q−1)(q−2)(2q³+6q²+3q+2)/(288q²ρ²df²)
        mauchly_p: Option<Stat>,
        /// has 3(q+1) in place of 3q: inferred by solving for the term from one value that R prints (`sim_paper`), not read in R's source; it reproduced every other data set that was tried
        mauchly_p_as_r: Option<Stat> as "mauchly_p_as_R_prints",
    }

    /// An effect of the analysis of variance with repetitions.
    pub struct TwoWayEffect {
        /// of the effect
        df1: Option<Stat>,
        /// of its error
        df2: Option<Stat>,
        /// the statistic
        f: Stat as "F",
        /// without correction
        p: Stat,
        /// Greenhouse and Geisser's
        eps_gg: Option<Stat>,
        /// with their correction
        p_gg: Option<Stat>,
        /// generalized η²
        ges: Option<Stat>,
    }

    /// Realization × repetition, where every cell has the same repetitions.
    pub struct TwoWay {
        /// of realizations
        model: TwoWayEffect,
        /// of repetitions
        rep: TwoWayEffect,
        /// of realizations × repetitions
        inter: TwoWayEffect,
    }

    /// Whether realizations differ.
    pub struct Differences {
        /// by ranks
        friedman: Friedman,
        /// of cell means
        rmanova: Anova,
        /// with repetitions
        rmanova2: Option<TwoWay>,
    }
}

pub(super) fn ranks_and_anova(cells: &Cells<'_>) -> Differences {
    let table = cells.table(&cells.tested());
    Differences {
        friedman: ranks(&table),
        rmanova: anova(&table),
        rmanova2: anova_with_repetitions(cells, &table),
    }
}

pub(super) fn pairs(cells: &Cells<'_>, values: &mut Values) {
    posthoc(cells, &cells.table(&cells.tested()), values);
}

pub(super) fn agree(cells: &Cells<'_>, values: &mut Values) {
    let models = cells.tested();
    agreement(cells, &cells.table(&models), values);
    repetitions(cells, &models, values);
}

fn ranks(table: &CompleteTable) -> Friedman {
    let Some(f) = friedman(&table.rows) else {
        return Friedman::undefined(FEW);
    };
    let df2 = f.df * (table.rows.len() as f64 - 1.0);
    let alike = "every subject rated all realizations alike";
    let no_f = "all subjects rank alike, or rate all alike";
    let no_exact = match f.chi2 {
        None => alike,
        Some(_) => "too many orders of the ranks for the exact distribution",
    };
    Friedman {
        mean_ranks: Some(List::of(f.mean_ranks)),
        df: Some(Stat::of(f.df)),
        chi2: Stat::or(f.chi2, alike),
        p: Stat::or(f.p, alike),
        kendall_w: Stat::or(f.kendall_w, alike),
        iman_davenport_df1: Some(Stat::of(f.df)),
        iman_davenport_df2: Some(Stat::of(df2)),
        iman_davenport_f: Some(Stat::or(f.iman_davenport, no_f)),
        iman_davenport_p: Some(Stat::or(f.iman_davenport_p, no_f)),
        exact_p: Some(Stat::or(f.exact_p, no_exact)),
    }
}

fn anova(table: &CompleteTable) -> Anova {
    let wide = table.models.len() > MAX_COLUMNS;
    let Some(a) = one_way(&table.rows).filter(|_| !wide) else {
        return Anova::undefined(if wide {
            "more than 300 realizations"
        } else {
            FEW
        });
    };
    let e = &a.effect;
    let few = "too few subjects for it";
    let equal = "all ratings are equal";
    let singular = "two realizations, too few subjects, or a singular covariance";
    Anova {
        ss_model: Some(Stat::of(e.ss)),
        ss_subject: Some(Stat::of(a.ss_subject)),
        ss_error: Some(Stat::of(e.ss_error)),
        df1: Some(Stat::of(e.df1)),
        df2: Some(Stat::of(e.df2)),
        f: Stat::or(e.f, NO_ERROR),
        p: Stat::or(e.p, NO_ERROR),
        eps_gg: Some(Stat::or(e.eps_gg, NO_ERROR)),
        p_gg: Stat::or(e.p_gg, NO_ERROR),
        eps_hf_unclipped: Some(Stat::or(e.eps_hf, few)),
        p_hf: Some(Stat::or(e.p_hf, few)),
        ges: Some(Stat::or(a.ges, equal)),
        pes: Some(Stat::or(a.pes, equal)),
        mauchly_w: Some(Stat::or(e.mauchly.map(|m| m.w), singular)),
        mauchly_p: Some(Stat::or(e.mauchly.and_then(|m| m.p), singular)),
        mauchly_p_as_r: Some(Stat::or(e.mauchly.and_then(|m| m.p_as_r), singular)),
    }
}

/// For complete subjects whose cells all have the same repetitions, once each.
fn anova_with_repetitions(cells: &Cells<'_>, table: &CompleteTable) -> Option<TwoWay> {
    let Some((rows, repetitions)) = balanced(cells, table) else {
        return Some(TwoWay::undefined(
            "not every cell has the same two or more repetitions",
        ));
    };
    let [model, rep, inter] = two_way(&rows, repetitions)?.effects.map(of_effect);
    Some(TwoWay { model, rep, inter })
}

fn of_effect((e, ges): (Effect, Option<f64>)) -> TwoWayEffect {
    // Without an error η² is defined unless the effect, too, is 0 but for rounding.
    let ges = ges.filter(|ges| e.f.is_some() || *ges > 1e-9);
    TwoWayEffect {
        df1: Some(Stat::of(e.df1)),
        df2: Some(Stat::of(e.df2)),
        f: Stat::or(e.f, NO_ERROR),
        p: Stat::or(e.p, NO_ERROR),
        eps_gg: Some(Stat::or(e.eps_gg, NO_ERROR)),
        p_gg: Some(Stat::or(e.p_gg.filter(|_| e.f.is_some()), NO_ERROR)),
        ges: Some(Stat::or(ges, "neither effect nor error has a variance")),
    }
}

fn balanced(cells: &Cells<'_>, table: &CompleteTable) -> Option<(Vec<Vec<f64>>, usize)> {
    let r = cells.ratings;
    let labels = |c: &Cell| cells.order[c.rows.clone()].iter().map(|&i| r.repetition[i]);
    let columns = cells.columns(&table.models);
    let first = cells.cells.iter().find(|c| columns[c.model].is_some())?;
    let wanted: Vec<u32> = labels(first).collect();
    let n = wanted.len();
    let distinct = wanted.windows(2).all(|w| w[0] < w[1]);
    if n < 2 || !distinct || n * table.models.len() > MAX_COLUMNS {
        return None;
    }
    let mut rows = vec![vec![f64::NAN; n * table.models.len()]; table.subjects.len()];
    for cell in &cells.cells {
        let subject = table.subjects.binary_search(&cell.subject);
        let (Some(j), Ok(s)) = (columns[cell.model], subject) else {
            continue;
        };
        if !labels(cell).eq(wanted.iter().copied()) {
            return None;
        }
        rows[s][j * n..(j + 1) * n].copy_from_slice(cells.of_cell(cell));
    }
    (rows.len() >= 2 && table.models.len() >= 2).then_some((rows, n))
}

fn posthoc(cells: &Cells<'_>, table: &CompleteTable, values: &mut Values) {
    let m = table.models.len();
    if !(2..=MAX_PAIRED).contains(&m) || table.rows.len() < 2 {
        return;
    }
    let columns: Vec<Vec<f64>> = (0..m).map(|j| table.column(j)).collect();
    let mut pairs = Vec::new();
    for a in 0..m {
        for b in a + 1..m {
            if let Some(p) = paired(&columns[a], &columns[b]) {
                let name = |j: usize| cells.model_name(table.models[j]);
                pairs.push((pair_id("posthoc", name(a), name(b)), p));
            }
        }
    }
    let t_holm = holm(&pairs.iter().map(|(_, p)| p.p_t).collect::<Vec<_>>());
    let w_holm = holm(&pairs.iter().map(|(_, p)| p.p_exact).collect::<Vec<_>>());
    for (i, (id, p)) in pairs.iter().enumerate() {
        let mut g = values.group(id.clone(), "all differences are equal");
        g.put("mean_diff", p.mean_diff);
        g.maybe("t", p.t);
        g.maybe("p_t", p.p_t);
        g.maybe("p_t_holm", t_holm[i]);
        g.maybe("dz", p.dz);
        g.put_or("d_av", p.d_av, "neither realization's ratings vary");
        g.put("wilcoxon_n", p.wilcoxon_n as f64);
        let why = "no difference other than zero";
        g.put_or("wilcoxon_Wplus", p.w_plus, why);
        g.put_or("rank_biserial", p.rank_biserial, why);
        g.put_or("p_wilcoxon_normal", p.p_normal, why);
        let why = "no difference other than zero, or more than 500";
        g.put_or("p_wilcoxon_exact", p.p_exact, why);
        g.put_or("p_wilcoxon_exact_holm", w_holm[i], why);
    }
}

fn agreement(cells: &Cells<'_>, table: &CompleteTable, values: &mut Values) {
    let transposed: Vec<Vec<f64>> = (0..table.models.len()).map(|j| table.column(j)).collect();
    put_icc(icc(&transposed).as_ref(), "icc_subjects", FEW, values);
    let r = cells.ratings;
    let labels = labels(cells, &table.models);
    // A unit is one repetition of one realization.
    let columns = cells.columns(&table.models);
    let mut units = vec![Vec::new(); table.models.len() * labels.len()];
    for (&i, &v) in cells.order.iter().zip(&cells.sorted) {
        let column = r.model[i].and_then(|m| columns[m as usize]);
        if let (Ok(k), Some(j)) = (labels.binary_search(&r.repetition[i]), column) {
            units[j * labels.len() + k].push(v);
        }
    }
    put_alpha(krippendorff(&units), "krippendorff_subjects", values);
}

/// The distinct repetition numbers of some realizations, sorted.
fn labels(cells: &Cells<'_>, models: &[usize]) -> Vec<u32> {
    let r = cells.ratings;
    let mut labels: Vec<u32> = Vec::new();
    for cell in &cells.cells {
        if models.binary_search(&cell.model).is_err() {
            continue;
        }
        for &i in &cells.order[cell.rows.clone()] {
            if let Err(at) = labels.binary_search(&r.repetition[i]) {
                labels.insert(at, r.repetition[i]);
            }
        }
        // In a table that numbers all rows these are no repetitions.
        if labels.len() > MAX_LABELS {
            return Vec::new();
        }
    }
    labels
}

/// Intraclass correlation of the repetitions, over the cells that have all of them.
fn repetitions(cells: &Cells<'_>, models: &[usize], values: &mut Values) {
    let labels = labels(cells, models);
    let units: Vec<&[f64]> = (cells.cells.iter())
        .filter(|c| models.binary_search(&c.model).is_ok())
        .map(|c| cells.of_cell(c))
        .collect();
    let complete: Vec<&[f64]> = (units.iter().copied())
        .filter(|u| u.len() == labels.len())
        .collect();
    let found = icc(&complete);
    let why = "fewer than two cells with two repetitions or more";
    put_icc(found.as_ref(), "icc_repetitions", why, values);
    let mut g = values.group("icc_repetitions", why);
    g.put(
        "n_cells",
        if labels.len() > 1 {
            complete.len() as f64
        } else {
            0.0
        },
    );
    let sem = found.map(|i| i.ms_error.max(0.0).sqrt());
    g.maybe("sem", sem);
    let change = sem.map(|s| 1.96 * std::f64::consts::SQRT_2 * s);
    g.maybe("smallest_detectable_change", change);
    put_alpha(krippendorff(&units), "krippendorff_repetitions", values);
}

fn put_icc(found: Option<&Icc>, prefix: &str, few: &str, values: &mut Values) {
    let Some(i) = found else {
        let names = ["ICC1", "ICC2", "ICC3", "ICC1k", "ICC2k", "ICC3k"];
        values.group(prefix, few).none(&names);
        return;
    };
    let mut g = values.group(prefix, NO_ERROR);
    g.put("ms_targets", i.ms_targets);
    g.put("ms_raters", i.ms_raters);
    g.put("ms_error", i.ms_error);
    g.maybe("F_1", i.f_1);
    g.maybe("p_1", i.p_1);
    g.maybe("F_3", i.f_3);
    g.maybe("p_3", i.p_3);
    g.maybe("ICC1k", i.icc1k);
    let coefficients: [(&str, Option<Coefficient>); 5] = [
        ("ICC1", i.icc1),
        ("ICC2", i.icc2),
        ("ICC3", i.icc3),
        ("ICC2k", i.icc2k),
        ("ICC3k", i.icc3k),
    ];
    for (name, c) in coefficients {
        g.maybe(name, c.map(|c| c.value));
        let ends = c.and_then(|c| c.ci95);
        for (end, value) in [("lo", ends.map(|e| e.0)), ("hi", ends.map(|e| e.1))] {
            match value {
                Some(None) => g.put_or(&format!("{name}/{end}"), None, NO_END),
                value => g.maybe(&format!("{name}/{end}"), value.flatten()),
            }
        }
    }
}

fn put_alpha(alpha: Alpha, prefix: &str, values: &mut Values) {
    let why = "no unit has two ratings, or all are equal, or more than 1000 differ";
    let mut g = values.group(prefix, why);
    g.maybe("nominal", alpha.nominal);
    g.maybe("ordinal", alpha.ordinal);
    g.maybe("interval", alpha.interval);
}
