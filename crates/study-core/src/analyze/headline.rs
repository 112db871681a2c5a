//! The main results: `realistic/*`, the share of the variance between realizations
//! that VAF explains (`corr/share/*`), variance components (`variance/*`), and the
//! main results without the exclusions (`before_exclusion/*`).

use super::Rules;
use super::cells::{Cells, within};
use super::design::Design;
use super::identifiers::group_id;
use super::values::Values;
use study_stats::anova::one_way;
use study_stats::correlation::equivalence;
use study_stats::distribution::t_quantile;
use study_stats::paired::equivalence_of;
use study_stats::power::{detectable_correlation, detectable_difference};
use study_stats::proportion::share;

pub(super) fn headline(cells: &Cells<'_>, rules: &Rules, values: &mut Values) {
    if let Some(from) = rules.realistic_from {
        realistic(cells, from, values);
    }
    for group in ["corr", "corr_adjusted"] {
        explained(group, rules.alpha, values);
    }
    components(cells, values);
    sensitivity(Design::of(cells), rules.alpha, values);
    if let Some(margin) = rules.equivalence_margin {
        little_effect_of_vaf(cells, margin, values);
    }
    if let Some(margin) = rules.equivalence_r {
        little_correlation(margin, values);
    }
}

/// Whether the rating changes by less than the margin from the lowest to the highest VAF,
/// by the slope of the crossed mixed model.
fn little_effect_of_vaf(cells: &Cells<'_>, margin: f64, values: &mut Values) {
    let vaf = |&m: &usize| cells.vaf[m];
    let vaf: Vec<f64> = cells.tested().iter().filter_map(vaf).collect();
    let range = vaf.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))
        - vaf.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    let get = |what: &str| values.number(&format!("lmm_vaf_crossed/{what}"));
    let slope = get("slope")
        .zip(get("slope_se"))
        .zip(get("slope_satterthwaite_df"));
    let found = slope.and_then(|((slope, se), df)| {
        let tests = equivalence_of(slope * range, se * range, df, margin)?;
        Some((slope * range, tests))
    });
    let mut g = values.group(
        "equivalence/vaf",
        "there is no slope of the crossed mixed model",
    );
    g.put("margin", margin);
    g.maybe("effect", found.map(|(effect, _)| effect));
    g.maybe("p", found.map(|(_, tests)| tests.p));
    g.interval("ci90", found.map(|(_, tests)| tests.ci90));
}

/// Whether the correlation with VAF is within ± the margin, by Fisher's z.
fn little_correlation(margin: f64, values: &mut Values) {
    let n = values.number("corr_adjusted/n_models").unwrap_or(0.0);
    let r = values.number("corr_adjusted/pearson/r");
    let found = r.and_then(|r| equivalence(r, n - 3.0, margin));
    let mut g = values.group(
        "equivalence/r",
        "there is no correlation, it is ±1, or it rests on fewer than four realizations",
    );
    g.put("margin", margin);
    g.maybe("p", found.map(|e| e.p));
    g.interval("ci90", found.map(|e| e.ci90));
}

/// The smallest effects that the design finds with a power of 80 %.
fn sensitivity(design: Design, alpha: f64, values: &mut Values) {
    let n = values.number("corr_adjusted/n_models").unwrap_or(0.0) as usize;
    let r = detectable_correlation(n, POWER, alpha);
    let mut g = values.group("sensitivity", "fewer than three realizations with a VAF");
    g.maybe("correlation", r);
    let difference = detectable_difference(design.analyzed(), POWER, alpha);
    g.put_or("difference", difference, "fewer than two participants");
}

/// The power for which the smallest effects are given.
const POWER: f64 = 0.8;

/// Shares of ratings at or above a threshold, with subjects as clusters.
fn realistic(cells: &Cells<'_>, from: f64, values: &mut Values) {
    let r = cells.ratings;
    let mut clusters: Vec<Vec<(f64, f64)>> = vec![Vec::new(); r.models.len()];
    for cell in &cells.cells {
        let rows = &cells.order[cell.rows.clone()];
        let hits = rows
            .iter()
            .filter(|&&i| r.rating[i].is_some_and(|v| v >= from))
            .count();
        clusters[cell.model].push((hits as f64, rows.len() as f64));
    }
    for (m, clusters) in clusters.iter().enumerate() {
        let found = share(clusters);
        let id = group_id("realistic", &[cells.model_name(m)]);
        let mut g = values.group(id.clone(), "no ratings");
        g.put("n", clusters.iter().map(|c| c.1).sum());
        g.maybe("share", found.map(|s| s.share));
        g.maybe("n_effective", found.map(|s| s.n_effective));
        let mut g = values.group(id, "fewer than two subjects");
        g.interval("ci95", found.and_then(|s| s.ci95));
    }
}

/// The share of the variance between realizations that VAF explains: r² of the means
/// and its adjusted version 1 − (1 − r²)(n − 1)/(n − 2) (Ezekiel 1930); and the
/// critical |r| at the level of significance. The crossed model's share is computed
/// with that model.
fn explained(group: &str, alpha: f64, values: &mut Values) {
    let Some(n) = values.number(&format!("{group}/n_models")) else {
        return;
    };
    let r2 = values.number(&format!("{group}/pearson/r")).map(|r| r * r);
    let needed = t_quantile(1.0 - alpha / 2.0, n - 2.0)
        .filter(|_| n >= 3.0)
        .map(|t| t / (n - 2.0 + t * t).sqrt());
    let why = "no correlation over realizations";
    let mut g = values.group(format!("{group}/share"), why);
    g.maybe("r2", r2);
    g.maybe(
        "r2_adjusted",
        r2.map(|r2| 1.0 - (1.0 - r2) * (n - 1.0) / (n - 2.0)),
    );
    values
        .group(
            format!("{group}/pearson"),
            "fewer than three realizations with a VAF",
        )
        .maybe("critical_r", needed);
}

/// Variance components of the complete table, by the expected mean squares of its
/// cells: with h the mean of 1/(ratings of a cell), σ² within cells,
/// E(MS subjects) = M σ²ₛ + σ²ₛₘ + hσ², E(MS realizations) = S σ²ₘ + σ²ₛₘ + hσ²,
/// E(MS error) = σ²ₛₘ + hσ² (Searle, Casella & McCulloch 1992, §5.3; for balanced
/// tables the usual analysis of variance). Negative estimates are set to 0.
fn components(cells: &Cells<'_>, values: &mut Values) {
    let table = cells.table(&cells.tested());
    let (s, m) = (table.rows.len() as f64, table.models.len() as f64);
    let found = one_way(&table.rows);
    let own: Vec<_> = (cells.cells.iter())
        .filter(|c| table.subjects.binary_search(&c.subject).is_ok())
        .filter(|c| table.models.binary_search(&c.model).is_ok())
        .collect();
    let (squares, df) = within(own.iter().copied());
    let h = own.iter().map(|c| 1.0 / c.rows.len() as f64).sum::<f64>() / own.len() as f64;
    let noise = (df > 0).then(|| squares / df as f64);
    let why = "fewer than two complete subjects or realizations";
    let mut g = values.group("variance", why);
    let Some(a) = found else {
        g.none(&["subject", "model", "interaction", "noise"]);
        return;
    };
    let error = a.effect.ss_error / a.effect.df2;
    let subject = ((a.ss_subject / (s - 1.0) - error) / m).max(0.0);
    let model = ((a.effect.ss / a.effect.df1 - error) / s).max(0.0);
    let interaction = noise.map(|noise| (error - h * noise).max(0.0));
    // Without repetitions interaction and noise are confounded.
    let rest = interaction.zip(noise).map_or(error, |(i, n)| i + n);
    let total = subject + model + rest;
    let why = "no cell has two ratings: it is part of `interaction_and_noise`";
    g.put("subject", subject);
    g.put("model", model);
    g.put_or("interaction", interaction, why);
    g.put_or("noise", noise, why);
    g.put("interaction_and_noise", rest);
    let of = |x: f64| (total > 0.0).then(|| x / total);
    let mut g = values.group("variance/share", "all ratings are equal");
    g.maybe("subject", of(subject));
    g.maybe("model", of(model));
    g.maybe("interaction_and_noise", of(rest));
    if let Some((interaction, noise)) = interaction.zip(noise) {
        g.maybe("interaction", of(interaction));
        g.maybe("noise", of(noise));
    } else {
        g.put_or("interaction", None, why);
        g.put_or("noise", None, why);
    }
}

/// The statistics that are compared with and without the exclusions.
const BOTH: [&str; 17] = [
    "adjusted/",
    "corr/n_models",
    "corr/pearson/",
    "corr/spearman/",
    "corr/kendall/",
    "corr/share/",
    "corr_adjusted/pearson/",
    "desc/",
    "design/",
    "friedman/",
    "lmm_cells/",
    "lmm_vaf_crossed/",
    "posthoc/",
    "realistic/",
    "reference/",
    "rmanova/",
    "variance/",
];

/// Adds the main results of `all`, computed without the exclusion rules.
pub(super) fn without_exclusions(all: &Values, values: &mut Values) {
    let ids: Vec<&str> = (all.iter())
        .map(|(id, _)| id)
        .filter(|id| BOTH.iter().any(|b| id.starts_with(b)))
        .collect();
    for id in ids {
        values.copy(all, id, format!("before_exclusion/{id}"));
    }
}
