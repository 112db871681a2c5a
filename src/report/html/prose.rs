//! A methods and a results paragraph, as journals of the field print them.

use super::answers::ci;
use super::{Details, safe};
use crate::analyze::Analysis;
use crate::report::apa;
use maud::{Markup, html};

pub(super) fn section(details: &Details, a: &Analysis) -> Markup {
    let results = results(a);
    html! {
        section {
            h2 { "For the paper" }
            p.note { "Written from the numbers of this analysis. Check every sentence before you print it." }
            h3 { "Methods" }
            p { (safe(&methods(details, a))) }
            @if !results.is_empty() {
                h3 { "Results" }
                p { (safe(&results)) }
            }
        }
    }
}

fn methods(d: &Details, a: &Analysis) -> String {
    let c = &a.counts;
    let tests = super::answers::tests(a).len();
    let mut said = Vec::new();
    let who = match (c.simulated == c.participants, c.pilots == c.participants) {
        _ if c.participants == 0 => ("subject", "subjects"),
        (true, _) => (
            "simulated participant, no person,",
            "simulated participants, no people,",
        ),
        (_, true) => ("pilot participant", "pilot participants"),
        _ => ("participant", "participants"),
    };
    let times = d.repetitions.map_or_else(String::new, |n| match n {
        1 => " once".to_owned(),
        2 => " twice".to_owned(),
        n => format!(" {n} times"),
    });
    said.push(format!(
        "{} rated {}{times}.",
        apa::counted(c.participants, who.0, who.1),
        apa::counted(tests, "realization", "realizations")
    ));
    if let Some(order) = &d.order {
        said.push(format!(
            "The order of trials was {order}, fixed before each session."
        ));
    }
    if let Some(reference) = &d.reference {
        said.push(format!("Before each trial the screen said: “{reference}”"));
    }
    if let Some(prompt) = &d.prompt {
        let scale = a.scale.map_or_else(String::new, |(from, to)| {
            let words = |at: f64| {
                let label = d.labels.iter().find(|l| l.0 == at);
                label.map_or_else(String::new, |l| format!(" (“{}”)", l.1))
            };
            format!(
                " on a scale from {from}{} to {to}{}",
                words(from),
                words(to)
            )
        });
        said.push(format!(
            "After each trial the question was “{prompt}”, answered{scale}."
        ));
    }
    let beside = a.realizations.len() - tests;
    if beside > 0 {
        said.push(format!(
            "{} beside them (references, anchors, hidden repeats) had no part in the tests.",
            apa::counted(beside, "realization", "realizations")
        ));
    }
    if a.values.number("corr/pearson/r").is_some() {
        said.push(
            "Whether VAF predicts the rating was tested over the means of the realizations \
             (subjects' cell means averaged), with Pearson's r and the p of all permutations of the \
             realizations where there were nine or fewer, of random ones above."
                .to_owned(),
        );
    }
    if a.values.number("rmanova/F").is_some() {
        said.push(
            "Differences between realizations were tested by a repeated-measures analysis of \
             variance on the cell means with the Greenhouse–Geisser correction and by Friedman's \
             test with mid-ranks; pairs by Wilcoxon's signed-rank test, exact and conditional on \
             ties, with Holm's correction."
                .to_owned(),
        );
    }
    if a.values.number("lmm_vaf_crossed/slope").is_some() {
        said.push(
            "A linear mixed model with crossed random intercepts of subjects and realizations was \
             fitted by REML, with Satterthwaite's degrees of freedom."
                .to_owned(),
        );
    }
    said.push(format!(
        "Standard deviations are over all ratings of a realization (n − 1). The analysis was done \
         with study {}.",
        env!("CARGO_PKG_VERSION")
    ));
    said.join(" ")
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
        said.push(format!("{}.", both.join("; ")));
    }
    if let Some(r) = v.number("corr/pearson/r") {
        let n = v.number("corr/n_models").unwrap_or(0.0);
        let exact = v
            .number("corr/pearson/p_exact_two_sided")
            .map(|p| ("exact ", p));
        let drawn = v.number("corr/pearson/p_monte_carlo_two_sided");
        let p = exact.or_else(|| drawn.map(|p| ("Monte Carlo permutation ", p)));
        let p = p.map_or_else(String::new, |(kind, p)| {
            format!(", {kind}p {}", apa::equals_p(p))
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
        let singular = if get("singular") == Some(1.0) {
            " (singular fit: no variance of the realizations is left beside VAF, and p is too small)"
        } else {
            ""
        };
        said.push(format!(
            "Crossed mixed model: b = {} per unit of VAF, SE = {}, t({}) = {}, p {}{singular}.",
            two(b),
            two(se),
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
    let w = get("kendall_W").map_or_else(String::new, |w| {
        format!(", Kendall’s W = {}", apa::share(w, 2))
    });
    Some(format!(
        "Friedman’s χ²({df}) = {}, {kind}p {}{w}",
        apa::number(chi2, 2),
        apa::equals_p(p)
    ))
}

/// What holds for these realizations only.
pub(super) fn only_these(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let two = |x: f64| apa::number(x, 2);
    let mut rows = Vec::new();
    for (id, what) in [
        ("rmcorr_cells", "Repeated-measures correlation of the cells"),
        (
            "rmcorr_trials",
            "Repeated-measures correlation of the trials",
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
            format!(", t = {}, p {}", two(t), apa::equals_p(p))
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
            "With other subjects and the same realizations, r would be {} in 95 of 100 studies ({kind} over subjects, percentiles).",
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
            let p = get("slope_satterthwaite_p");
            let p = p.map_or_else(String::new, |p| format!(", p {}", apa::equals_p(p)));
            rows.push(format!("{what}: slope {} (SE {}){p}.", two(b), two(se)));
        }
    }
    let ordinal = v
        .number("clmm_vaf_quad/beta/vaf")
        .zip(v.number("clmm_vaf_quad/se/vaf"));
    if let Some((b, se)) = ordinal {
        rows.push(format!(
            "Ordinal model with an intercept for each subject: log odds {} per unit of VAF (SE {}).",
            two(b),
            two(se)
        ));
    }
    rows
}
