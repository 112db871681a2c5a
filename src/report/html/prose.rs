//! A methods and a results paragraph, as journals of the field print them.

use super::answers::ci;
use super::{Details, safe};
use crate::analyze::{Analysis, Exclusion, Listed, Value};
use crate::report::apa;
use crate::stats::permutation::DRAWS;
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
    let mut said = conduct(d, a);
    said.extend(tests_done(a));
    if super::answers::tests(a).iter().any(|m| has_sd(a, m)) {
        said.push(
            "Standard deviations are over all ratings of a realization (n − 1); intervals of means are \
             t intervals over subjects."
                .to_owned(),
        );
    }
    said.push(format!(
        "The level of significance is .05, two-sided. The analysis was done with study {}.",
        env!("CARGO_PKG_VERSION")
    ));
    said.join(" ")
}

fn has_sd(a: &Analysis, m: &Listed) -> bool {
    let sd = format!("desc/{}/sd", m.id);
    a.values.number(&sd).is_some()
}

/// Who rated what, how often and how, and what was left out.
fn conduct(d: &Details, a: &Analysis) -> Vec<String> {
    let c = &a.counts;
    let tests = super::answers::tests(a);
    let mut said = Vec::new();
    let who = match (c.simulated == c.participants, c.pilots == c.participants) {
        _ if c.participants == 0 => apa::counted(0, "subject", "subjects"),
        (true, _) => apa::counted(
            c.participants,
            "simulated participant, no person,",
            "simulated participants, no people,",
        ),
        (_, true) => apa::counted(c.participants, "pilot participant", "pilot participants"),
        _ => apa::counted(c.participants, "participant", "participants"),
    };
    let others = match (c.pilots, c.simulated) {
        (0, 0) => String::new(),
        (p, s) if p == c.participants || s == c.participants => String::new(),
        (p, 0) => format!(" ({})", apa::counted(p, "pilot", "pilots")),
        (0, s) => format!(" ({s} simulated)"),
        (p, s) => format!(
            " ({} and {s} simulated)",
            apa::counted(p, "pilot", "pilots")
        ),
    };
    let times = d.repetitions.map_or_else(String::new, |n| match n {
        1 => " once each".to_owned(),
        2 => " twice each".to_owned(),
        n => format!(" {n} times each"),
    });
    said.push(if tests.is_empty() {
        let ratings = apa::counted(c.rated, "rating", "ratings");
        format!("{who}{others} gave {ratings}.")
    } else {
        let what = apa::counted(tests.len(), "realization", "realizations");
        format!("{who}{others} rated {what}{times}.")
    });
    let beside: Vec<String> = a
        .realizations
        .iter()
        .filter(|m| !tests.iter().any(|t| t.id == m.id))
        .map(|m| match &m.duplicate_of {
            Some(of) => format!("{} (a hidden repeat of {of})", m.id),
            None => format!("{} ({})", m.id, m.role.as_str().replace('-', " ")),
        })
        .collect();
    if !beside.is_empty() {
        said.push(format!(
            "Rated among them, without a part in the tests: {}.",
            apa::listing(&beside)
        ));
    }
    if let Some(order) = &d.order {
        said.push(format!(
            "The order of trials was {order}, fixed before each session."
        ));
    }
    said.extend(d.conduct.iter().cloned());
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
    if let Some(from) = a.realistic_from {
        said.push(format!(
            "A rating of {from} or higher was said beforehand to count as realistic."
        ));
    }
    said.extend(left_out(a));
    said
}

/// A rule of exclusion, as a sentence goes on with it.
pub(super) fn in_words(rule: Exclusion) -> String {
    match rule {
        Exclusion::ConstantRater => "participants whose ratings never change".to_owned(),
        Exclusion::HiddenReferenceBelow(rating) => {
            format!("participants whose mean rating of the hidden references is below {rating}")
        }
        Exclusion::StrokesBelow(strokes) => {
            format!("trials with fewer than {strokes} full strokes")
        }
        Exclusion::Inconsistent(difference) => format!(
            "participants whose means of a realization and of its hidden repeat are more than \
             {difference} apart, on average"
        ),
    }
}

/// What was stated beforehand of leaving out, and what was left out.
fn left_out(a: &Analysis) -> Vec<String> {
    let c = &a.counts;
    let mut said = Vec::new();
    if !a.exclusions.is_empty() {
        let rules: Vec<String> = a
            .exclusions
            .iter()
            .map(|e| {
                let rows = apa::counted(e.rows, "row", "rows");
                format!("{} ({rows})", in_words(e.rule))
            })
            .collect();
        said.push(format!(
            "It was stated beforehand to leave out {}.",
            apa::listing(&rules)
        ));
    }
    let rules: usize = a.exclusions.iter().map(|e| e.rows).sum();
    let rows: usize = c.excluded.values().sum();
    if rows > rules {
        said.push(format!(
            "In all, {} of {} left out; the reasons are listed under “What was counted and left out”.",
            apa::counted(rows, "row", "rows"),
            apa::counted(c.excluded_participants, "participant is", "participants are")
        ));
    }
    if c.without_rating > 0 {
        said.push(format!(
            "{} without a rating.",
            apa::counted(
                c.without_rating,
                "trial that counts is",
                "trials that count are"
            )
        ));
    }
    said
}

/// The tests that there are numbers of.
fn tests_done(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut said = Vec::new();
    if v.number("corr/pearson/r").is_some() {
        let p = match crate::report::permuted(a, "pearson") {
            Some(("exact p", _)) => ", the p from all permutations of the realizations".to_owned(),
            Some(_) => format!(", the p from {DRAWS} random permutations of the realizations"),
            None => String::new(),
        };
        said.push(format!(
            "Whether the variance accounted for (VAF) predicts the rating was tested over the means \
             of the realizations (subjects' cell means averaged), with Pearson's r{p}."
        ));
    }
    let (f, chi2) = (
        v.number("rmanova/F").is_some(),
        v.number("friedman/chi2").is_some(),
    );
    let anova = "a repeated-measures analysis of variance on the cell means with the \
                 Greenhouse–Geisser correction";
    let friedman = "Friedman's test with mid-ranks";
    let differences = match (f, chi2) {
        (true, true) => Some(format!("{anova} and by {friedman}")),
        (true, false) => Some(anova.to_owned()),
        (false, true) => Some(friedman.to_owned()),
        (false, false) => None,
    };
    said.extend(
        differences.map(|d| format!("Differences between realizations were tested by {d}.")),
    );
    let (pairs, _) = crate::report::pairs(a);
    let wilcoxon = v
        .iter()
        .any(|(id, value)| id.ends_with("/p_wilcoxon_exact") && matches!(value, Value::Number(_)));
    let pair_test = if wilcoxon {
        "by Wilcoxon's signed-rank test, exact and conditional on ties, and by paired t tests"
    } else {
        "by paired t tests"
    };
    match pairs.len() {
        0 => {}
        1 => said.push(format!("The pair was compared {pair_test}.")),
        n => said.push(format!(
            "The {n} pairs were compared {pair_test}, each with Holm's correction over all pairs."
        )),
    }
    if v.number("lmm_vaf_crossed/slope").is_some() {
        let cells = match v.number("lmm_vaf_crossed/var_subject_model") {
            Some(_) => ", realizations and their combinations",
            None => " and realizations",
        };
        said.push(format!(
            "A linear mixed model of the ratings on VAF with random intercepts of subjects{cells} was \
             fitted by restricted maximum likelihood, with Satterthwaite's degrees of freedom."
        ));
    }
    let one = v.number("icc_subjects/ICC2").is_some();
    let other = v.number("icc_repetitions/ICC1").is_some();
    let iccs = match (one, other) {
        (true, true) => Some(
            "Agreement of subjects is ICC(2,1) over cell means, consistency over repetitions ICC(1,1)",
        ),
        (true, false) => Some("Agreement of subjects is ICC(2,1) over cell means"),
        (false, true) => Some("Consistency over repetitions is ICC(1,1)"),
        (false, false) => None,
    };
    said.extend(iccs.map(|i| format!("{i} (Shrout and Fleiss), with F intervals.")));
    if v.iter().any(|(id, value)| {
        id.starts_with("reference/") && id.ends_with("/p_tost") && matches!(value, Value::Number(_))
    }) {
        said.push(
            "Equivalence with the reference was tested by two one-sided t tests at the margin stated \
             beforehand."
                .to_owned(),
        );
    }
    said
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
