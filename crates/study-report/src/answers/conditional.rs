//! Results that hold for these realizations only.

use crate::{apa, sentences};
use study_analysis::analyze::Analysis;

/// The results, with those first that the terminal page shows too; their number.
pub(crate) fn conditional(a: &Analysis) -> (Vec<String>, usize) {
    let v = &a.values;
    let mut rows = Vec::new();
    rows.extend(repeated_measures(a, "rmcorr_cells", "over cells"));
    if let Some(r) = v.number("subject_corr/r_back") {
        let n = v.number("subject_corr/n_defined").unwrap_or(0.0);
        let ci = sentences::ci(a, "subject_corr/r_ci95", apa::r);
        rows.push(format!(
            "Mean over {n} participants of the correlation of their cells with VAF (Fisher's z): r = \
             {}{ci}.",
            apa::r(r)
        ));
    }
    if let Some(bounds) = v.interval("bootstrap/percentile") {
        let exact = match v.number("bootstrap/exact") {
            Some(1.0) => "exact ",
            _ => "",
        };
        rows.push(format!(
            "Correlation of the means with VAF when participants are resampled: 95 % of r lie in {} \
             ({exact}percentile bootstrap).",
            apa::interval(bounds, apa::r)
        ));
    }
    let on_terminal = rows.len();
    rows.extend(repeated_measures(a, "rmcorr_trials", "over trials"));
    if let Some(b) = v.number("subject_slope/mean") {
        let get = |name: &str| v.number(&format!("subject_slope/{name}"));
        let test = get("t").zip(get("p")).map_or_else(String::new, |(t, p)| {
            format!(", t = {}, p {}", apa::two(t), apa::p(p))
        });
        let ci = sentences::ci(a, "subject_slope/ci95", apa::two);
        let b = apa::two(b);
        rows.push(format!(
            "Mean slope of a participant's ratings on VAF: {b}{ci}{test}."
        ));
    }
    if let Some((l, p)) = v.number("page/L").zip(v.number("page/p_greater")) {
        let (l, p) = (apa::number(l, 1), apa::p(p));
        rows.push(format!(
            "Page's trend test in the order of VAF: L = {l}, one-sided p {p}."
        ));
    }
    for (id, what) in [
        (
            "lmm_vaf",
            "Mixed model with an intercept for each participant",
        ),
        (
            "lmm_vaf_slope",
            "Mixed model with an intercept and a slope for each participant",
        ),
    ] {
        rows.extend(sentences::slope_on_vaf(a, id).map(|slope| format!("{what}: {slope}.")));
    }
    let ordinal = (v.number("clmm_vaf_quad/beta/vaf")).zip(v.number("clmm_vaf_quad/se/vaf"));
    if let Some((b, se)) = ordinal {
        let (b, se) = (apa::two(b), apa::two(se));
        rows.push(format!(
            "Cumulative logit model with an intercept for each participant: log odds ratio {b} per unit \
             of VAF, SE = {se}."
        ));
    }
    (rows, on_terminal)
}

fn repeated_measures(a: &Analysis, id: &str, over: &str) -> Option<String> {
    let get = |name: &str| a.values.number(&format!("{id}/{name}"));
    let (r, df) = (apa::r(get("r")?), get("df")?);
    let ci = sentences::ci(a, &format!("{id}/ci95"), apa::r);
    let p = get("p").map_or_else(String::new, |p| format!(", p {}", apa::p(p)));
    Some(format!(
        "Repeated-measures correlation of rating and VAF {over}: r({df}) = {r}{ci}{p}."
    ))
}
