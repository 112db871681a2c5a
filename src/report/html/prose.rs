//! The results paragraph, as journals of the field print it, and what holds for
//! these realizations only.

use super::answers::ci;
use super::{Details, typeset};
use crate::report::apa;
use maud::{Markup, html};
use study_core::analyze::Analysis;

pub(super) fn section(details: &Details, a: &Analysis) -> Markup {
    let results = results(a);
    html! {
        section {
            h2 { "For the paper" }
            p.note { "Written from the numbers of this analysis. Check every sentence before you print it." }
            h3 { "Methods" }
            p { (typeset(&super::methods::paragraph(details, a))) }
            @if !results.is_empty() {
                h3 { "Results" }
                p { (typeset(&results)) }
            }
        }
    }
}

fn results(a: &Analysis) -> String {
    let v = &a.values;
    let mut said = Vec::new();
    let two = |x: f64| apa::number(x, 2);
    let tests = super::answers::tests(a);
    let means: Vec<String> = tests
        .iter()
        .filter_map(|m| {
            let mean = v.number(&format!("desc/{}/mean", m.id))?;
            let sd = v.number(&format!("desc/{}/sd", m.id));
            let sd = sd.map_or_else(String::new, |s| format!(", SD = {}", two(s)));
            Some(format!("{} (M = {}{sd})", m.id, two(mean)))
        })
        .collect();
    if (1..=12).contains(&means.len()) {
        said.push(format!("Mean ratings: {}.", means.join(", ")));
    }
    let both: Vec<String> = [anova(a), friedman(a)].into_iter().flatten().collect();
    if !both.is_empty() {
        said.push(format!(
            "Differences between realizations: {}.",
            both.join("; ")
        ));
    }
    if let Some(m) = crate::report::mixed_f(a) {
        said.push(format!(
            "Differences between realizations (linear mixed model of all ratings): F({}, {}) = {}, p {}.",
            apa::number(m.df1, 0),
            apa::number(m.df2, 1),
            two(m.f),
            apa::equals_p(m.p)
        ));
    }
    if let Some(r) = v.number("corr/pearson/r") {
        let n = v.number("corr/n_models").unwrap_or(0.0);
        let p = crate::report::permuted(a, "pearson");
        let p = p.map_or_else(String::new, |(kind, p)| {
            format!(", {}", apa::named_p(kind, p))
        });
        let rho = v.number("corr/spearman/rho");
        let rho = rho.map_or_else(String::new, |x| format!("; Spearman’s ρ = {}", apa::r(x)));
        said.push(format!(
            "Over the {n} realizations the mean rating correlated with VAF at r({}) = {}{}{p}{rho}.",
            n - 2.0,
            apa::r(r),
            ci(a, "corr/pearson/ci95", apa::r)
        ));
    }
    let get = |id: &str| v.number(&format!("lmm_vaf_crossed/{id}"));
    if let (Some(b), Some(se), Some(t), Some(df), Some(p)) = (
        get("slope"),
        get("slope_se"),
        get("slope_t"),
        get("slope_satterthwaite_df"),
        get("slope_satterthwaite_p"),
    ) {
        let singular = match super::answers::none_left(a) {
            Some(true) => {
                " (singular fit: no variance of the realizations is left beside VAF, and p is too small)"
            }
            Some(false) => " (singular fit in another variance than that of the realizations)",
            None => "",
        };
        said.push(format!(
            "Crossed mixed model: b = {} per unit of VAF, SE = {}, t({}) = {}, p {}{singular}.",
            apa::number(b, apa::decimals(se, 2)),
            apa::number(se, apa::decimals(se, 2)),
            apa::number(df, 1),
            two(t),
            apa::equals_p(p)
        ));
    }
    let icc = |group: &str, name: &str| -> Option<String> {
        let x = v.number(&format!("{group}/{name}"))?;
        let low = v.number(&format!("{group}/{name}/lo"));
        let high = v.number(&format!("{group}/{name}/hi"));
        let ends = low.zip(high).map_or_else(String::new, |(l, h)| {
            format!(", 95 % CI {}", apa::interval(l, h, |x| apa::share(x, 2)))
        });
        Some(format!("{}{ends}", apa::share(x, 2)))
    };
    if let Some(x) = icc("icc_subjects", "ICC2") {
        said.push(format!("Agreement of subjects: ICC(2,1) = {x}."));
    }
    if let Some(x) = icc("icc_repetitions", "ICC1") {
        said.push(format!("Consistency over repetitions: ICC(1,1) = {x}."));
    }
    let before = v.number("before_exclusion/corr/pearson/r");
    if let Some((before, r)) = before.zip(v.number("corr/pearson/r")) {
        said.push(format!(
            "Without the exclusions the correlation would be r = {} instead of {}.",
            apa::r(before),
            apa::r(r)
        ));
    }
    said.join(" ")
}

pub(super) fn anova(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("rmanova/{id}"));
    let (f, p, e) = (get("F")?, get("p_gg")?, get("eps_gg")?);
    let (df1, df2) = (get("df1")?, get("df2")?);
    let ges = get("ges").map_or_else(String::new, |g| {
        format!(", generalised η² = {}", apa::share(g, 2))
    });
    Some(format!(
        "F({}, {}) = {}, p {}{ges} (Greenhouse–Geisser, ε = {})",
        apa::number(df1 * e, 2),
        apa::number(df2 * e, 2),
        apa::number(f, 2),
        apa::equals_p(p),
        apa::share(e, 2)
    ))
}

pub(super) fn friedman(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("friedman/{id}"));
    let (chi2, df) = (get("chi2")?, get("df")?);
    let (kind, p) = match get("exact_p") {
        Some(p) => ("exact ", p),
        None => ("", get("p")?),
    };
    // Closer than that of χ² where there is no exact one.
    let better = get("iman_davenport_p")
        .filter(|_| kind.is_empty())
        .map_or_else(String::new, |p| {
            format!(" (by Iman and Davenport’s F, p {})", apa::equals_p(p))
        });
    let w = get("kendall_W").map_or_else(String::new, |w| {
        format!(", Kendall’s W = {}", apa::share(w, 2))
    });
    Some(format!(
        "Friedman’s χ²({df}) = {}, {kind}p {}{better}{w}",
        apa::number(chi2, 2),
        apa::equals_p(p)
    ))
}

/// What holds for these realizations only.
pub(super) fn only_these(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let two = |x: f64| apa::number(x, 2);
    let mut rows = Vec::new();
    if a.realizations.is_empty() {
        return rows;
    }
    for (id, what) in [
        (
            "rmcorr_cells",
            "Repeated-measures correlation of rating and VAF, by cells",
        ),
        (
            "rmcorr_trials",
            "Repeated-measures correlation of rating and VAF, by trials",
        ),
    ] {
        let get = |name: &str| v.number(&format!("{id}/{name}"));
        if let (Some(r), Some(df)) = (get("r"), get("df")) {
            let p = get("p").map_or_else(String::new, |p| format!(", p {}", apa::equals_p(p)));
            let interval = ci(a, &format!("{id}/ci95"), apa::r);
            rows.push(format!("{what}: r({df}) = {}{interval}{p}.", apa::r(r)));
        }
    }
    if let Some(r) = v.number("subject_corr/r_back") {
        let n = v.number("subject_corr/n_defined").unwrap_or(0.0);
        let interval = ci(a, "subject_corr/r_ci95", apa::r);
        rows.push(format!(
            "Mean correlation of a subject’s cells with VAF (Fisher’s z, {n} subjects): r = {}{interval}.",
            apa::r(r)
        ));
    }
    if let Some(b) = v.number("subject_slope/mean") {
        let get = |name: &str| v.number(&format!("subject_slope/{name}"));
        let test = get("t").zip(get("p")).map_or_else(String::new, |(t, p)| {
            let df = v.number("subject_slope/df");
            let df = df.map_or_else(String::new, |df| format!("({df})"));
            format!(", t{df} = {}, p {}", two(t), apa::equals_p(p))
        });
        rows.push(format!(
            "Mean slope of a subject’s ratings on VAF: {}{}{test}.",
            two(b),
            ci(a, "subject_slope/ci95", two)
        ));
    }
    if let Some((low, high)) = v
        .number("bootstrap/percentile_lo")
        .zip(v.number("bootstrap/percentile_hi"))
    {
        let kind = match v.number("bootstrap/exact") {
            Some(1.0) => "exact bootstrap",
            _ => "bootstrap",
        };
        rows.push(format!(
            "Correlation of the means with VAF, subjects drawn anew from these subjects: 95 % of r lie in {} ({kind}, percentiles).",
            apa::interval(low, high, apa::r)
        ));
    }
    if let Some((l, p)) = v.number("page/L").zip(v.number("page/p_greater")) {
        rows.push(format!(
            "Page’s trend along the ranks of VAF: L = {}, one-sided p {}.",
            apa::number(l, 1),
            apa::equals_p(p)
        ));
    }
    for (id, what) in [
        ("lmm_vaf", "Mixed model with an intercept for each subject"),
        (
            "lmm_vaf_slope",
            "Mixed model with an intercept and a slope for each subject",
        ),
    ] {
        let get = |name: &str| v.number(&format!("{id}/{name}"));
        if let (Some(b), Some(se)) = (get("slope"), get("slope_se")) {
            let p = get("slope_satterthwaite_p").zip(get("slope_satterthwaite_df"));
            let p = p
                .zip(get("slope_t"))
                .map_or_else(String::new, |((p, df), t)| {
                    let df = apa::number(df, 1);
                    format!(", t({df}) = {}, p {}", two(t), apa::equals_p(p))
                });
            rows.push(format!(
                "{what}: slope {} points per unit of VAF (SE {}){p}.",
                apa::number(b, apa::decimals(se, 2)),
                apa::number(se, apa::decimals(se, 2))
            ));
        }
    }
    let ordinal = v
        .number("clmm_vaf_quad/beta/vaf")
        .zip(v.number("clmm_vaf_quad/se/vaf"));
    if let Some((b, se)) = ordinal {
        rows.push(format!(
            "Ordinal model (cumulative logits) with an intercept for each subject: log odds {} per unit of VAF (SE {}).",
            two(b),
            two(se)
        ));
    }
    rows
}
