//! Results that hold for these realizations only.

use crate::{apa, sentences};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{Number as _, Within};

/// The results, with those first that the terminal page shows too; their number.
pub(crate) fn conditional(a: &Analysis) -> (Vec<String>, usize) {
    let all = &a.results.over_participants;
    let mut rows = Vec::new();
    rows.extend(repeated_measures(&all.rmcorr_cells, "over cells"));
    let subjects = &all.subject_corr;
    if let Some(r) = subjects.r_back.number() {
        let n = subjects.n_defined.number().unwrap_or(0.0);
        let ci = sentences::ci(&subjects.r_ci95, apa::r);
        rows.push(format!(
            "Mean over {n} participants of the correlation of their cells with VAF (Fisher's z): r = \
             {}{ci}.",
            apa::r(r)
        ));
    }
    if let Some(bounds) = all.bootstrap.percentile.ends() {
        let exact = match &all.bootstrap.exact {
            Some(exact) if exact.is_set() => "exact ",
            _ => "",
        };
        rows.push(format!(
            "Correlation of the means with VAF when participants are resampled: 95 % of r lie in {} \
             ({exact}percentile bootstrap).",
            apa::interval(bounds, apa::r)
        ));
    }
    let on_terminal = rows.len();
    rows.extend(repeated_measures(&all.rmcorr_trials, "over trials"));
    let slopes = &all.subject_slope;
    if let Some(b) = slopes.mean.number() {
        let test = slopes.t.number().zip(slopes.p.number());
        let test = test.map_or_else(String::new, |(t, p)| {
            format!(", t = {}, p {}", apa::two(t), apa::p(p))
        });
        let ci = sentences::ci(&slopes.ci95, apa::two);
        let b = apa::two(b);
        rows.push(format!(
            "Mean slope of a participant's ratings on VAF: {b}{ci}{test}."
        ));
    }
    if let Some((l, p)) = all.page.l.number().zip(all.page.p_greater.number()) {
        let (l, p) = (apa::number(l, 1), apa::p(p));
        rows.push(format!(
            "Page's trend test in the order of VAF: L = {l}, one-sided p {p}."
        ));
    }
    let mixed = &a.results.mixed;
    for (model, what) in [
        (
            &mixed.vaf.coefficients,
            "Mixed model with an intercept for each participant",
        ),
        (
            &mixed.vaf_slope.coefficients,
            "Mixed model with an intercept and a slope for each participant",
        ),
    ] {
        rows.extend(sentences::slope_on_vaf(a, model).map(|slope| format!("{what}: {slope}.")));
    }
    let ordinal = &a.results.ordinal.clmm_vaf_quad.model;
    if let Some((b, se)) = ordinal.beta.number().zip(ordinal.se.number()) {
        let (b, se) = (apa::two(b), apa::two(se));
        rows.push(format!(
            "Cumulative logit model with an intercept for each participant: log odds ratio {b} per unit \
             of VAF, SE = {se}."
        ));
    }
    (rows, on_terminal)
}

fn repeated_measures(found: &Within, over: &str) -> Option<String> {
    let (r, df) = (apa::r(found.r.number()?), found.df.number()?);
    let ci = sentences::ci(&found.ci95, apa::r);
    let p = found
        .p
        .number()
        .map_or_else(String::new, |p| format!(", p {}", apa::p(p)));
    Some(format!(
        "Repeated-measures correlation of rating and VAF {over}: r({df}) = {r}{ci}{p}."
    ))
}
