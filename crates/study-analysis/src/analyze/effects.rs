//! Differences between realizations: `friedman/*`, `rmanova/*`, `rmanova2/*`, `posthoc/*`. All
//! over the tested realizations.

use super::cells::{Cell, Cells, CompleteTable};
use super::record::{List, PairName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::anova::{Effect, one_way, two_way};
use study_stats::friedman::friedman;
use study_stats::paired::{holm, paired};

/// Largest number of realizations (times repetitions) of an analysis of variance.
pub(super) const MAX_COLUMNS: usize = 300;

/// Largest number of realizations that are compared pair by pair.
pub const MAX_PAIRED: usize = 8;

pub(super) const FEW: &str = "fewer than two complete subjects or realizations";
pub(super) const NO_ERROR: &str = "the ratings leave no variance of error";

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

    /// The cell means of two realizations, a minus b, over the complete participants; up to eight realizations. Ranks, zeros and ties are those of the differences rounded to 10⁻¹⁰ (of the size of the ratings, if that is below 1); `mean_diff` and t are not rounded.
    pub struct Posthoc {
        /// mean difference
        mean_diff: Stat,
        /// paired
        t: Stat,
        /// of `t`
        p_t: Stat,
        /// by Holm (1979) over all pairs that have a p
        p_t_holm: Stat,
        /// mean difference over the standard deviation of the differences
        dz: Stat,
        /// mean difference over the mean of the two standard deviations
        d_av: Stat,
        /// differences in Wilcoxon's signed-rank test, without zeros
        wilcoxon_n: Stat,
        /// W₊, the sum of the ranks of positive differences
        wilcoxon_w_plus: Stat as "wilcoxon_Wplus",
        /// (W₊ − W₋)/(W₊ + W₋)
        rank_biserial: Stat,
        /// with continuity and tie corrections
        p_wilcoxon_normal: Stat,
        /// conditional on the ties, min(1, 2·tail), up to 500 differences
        p_wilcoxon_exact: Stat,
        /// by Holm (1979) over all pairs that have a p
        p_wilcoxon_exact_holm: Stat,
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

/// Paired tests of up to eight realizations.
pub(super) fn posthoc(cells: &Cells<'_>) -> BTreeMap<PairName, Posthoc> {
    let table = cells.table(&cells.tested());
    let m = table.models.len();
    if !(2..=MAX_PAIRED).contains(&m) || table.rows.len() < 2 {
        return BTreeMap::new();
    }
    let columns: Vec<Vec<f64>> = (0..m).map(|j| table.column(j)).collect();
    let mut pairs = Vec::new();
    for a in 0..m {
        for b in a + 1..m {
            if let Some(p) = paired(&columns[a], &columns[b]) {
                let name = |j: usize| cells.model_name(table.models[j]);
                pairs.push((PairName::of(name(a), name(b)), p));
            }
        }
    }
    let t_holm = holm(&pairs.iter().map(|(_, p)| p.p_t).collect::<Vec<_>>());
    let w_holm = holm(&pairs.iter().map(|(_, p)| p.p_exact).collect::<Vec<_>>());
    let tests = pairs.into_iter().zip(t_holm.into_iter().zip(w_holm));
    let tests = tests.map(|((name, p), (t_holm, w_holm))| {
        let or = |x: Option<f64>| Stat::or(x, "all differences are equal");
        let ranked = |x: Option<f64>| Stat::or(x, "no difference other than zero");
        let exact = |x| Stat::or(x, "no difference other than zero, or more than 500");
        let posthoc = Posthoc {
            mean_diff: Stat::of(p.mean_diff),
            t: or(p.t),
            p_t: or(p.p_t),
            p_t_holm: or(t_holm),
            dz: or(p.dz),
            d_av: Stat::or(p.d_av, "neither realization's ratings vary"),
            wilcoxon_n: Stat::count(p.wilcoxon_n),
            wilcoxon_w_plus: ranked(p.w_plus),
            rank_biserial: ranked(p.rank_biserial),
            p_wilcoxon_normal: ranked(p.p_normal),
            p_wilcoxon_exact: exact(p.p_exact),
            p_wilcoxon_exact_holm: exact(w_holm),
        };
        (name, posthoc)
    });
    tests.collect()
}
