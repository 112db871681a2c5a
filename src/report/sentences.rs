//! Test results and remarks in the wording shared by the terminal page, the report and
//! its paragraphs. Names in them are untrusted.

use super::apa;
use study_base::text::counted;
use study_core::analyze::{
    ALPHA, Analysis, DecidingTest, PreregisteredRule, TestKind, significant,
};

/// `Yes` or `Not shown`: a test that is not significant shows nothing.
pub(super) fn verdict(p: f64) -> &'static str {
    if significant(p) { "Yes" } else { "Not shown" }
}

/// The name of a test.
pub(super) fn test_name(kind: TestKind) -> &'static str {
    match kind {
        TestKind::Anova => "repeated-measures analysis of variance",
        TestKind::FriedmanExact => "Friedman's test, exact",
        TestKind::Friedman => "Friedman's test",
        TestKind::MixedModel => "linear mixed model, Satterthwaite's degrees of freedom",
        TestKind::WilcoxonExact => "Wilcoxon's signed-rank test, exact",
        TestKind::PairedT => "paired t test",
        TestKind::PermutationExact | TestKind::PermutationMonteCarlo => "permutation test",
    }
}

/// `, 95 % CI [a, b]`, or nothing if the interval is undefined.
pub(super) fn ci(a: &Analysis, id: &str, format: impl Fn(f64) -> String) -> String {
    let bounds = a.values.interval(id);
    bounds.map_or_else(String::new, |b| {
        format!(", 95 % CI {}", apa::interval(b, format))
    })
}

/// `, exact p = .008` or `, permutation p = .008`; nothing if there is no test.
pub(super) fn permutation_p(test: Option<DecidingTest>) -> String {
    test.map_or_else(String::new, |test| {
        let kind = match test.kind {
            TestKind::PermutationExact => "exact p",
            _ => "permutation p",
        };
        format!(", {kind} {}", apa::p(test.p))
    })
}

/// The analysis of variance.
pub(super) fn anova(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("rmanova/{id}"));
    let (f, p, e) = (get("F")?, get("p_gg")?, get("eps_gg")?);
    let (df1, df2) = (get("df1")?, get("df2")?);
    let ges = get("ges").map_or_else(String::new, |g| {
        format!(", generalised η² = {}", apa::share(g, 2))
    });
    Some(format!(
        "F({}, {}) = {}, p {}{ges} (Greenhouse–Geisser, ε = {})",
        apa::two(df1 * e),
        apa::two(df2 * e),
        apa::two(f),
        apa::p(p),
        apa::share(e, 2)
    ))
}

/// Friedman's test, exact where possible.
pub(super) fn friedman(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("friedman/{id}"));
    let (chi2, df) = (get("chi2")?, get("df")?);
    let (kind, p) = match get("exact_p") {
        Some(p) => ("exact ", p),
        None => ("", get("p")?),
    };
    // A better approximation than χ², where the exact p is missing.
    let better = get("iman_davenport_p")
        .filter(|_| kind.is_empty())
        .map_or_else(String::new, |p| {
            format!(" (by Iman and Davenport's F, p {})", apa::p(p))
        });
    let w = get("kendall_W").map_or_else(String::new, |w| {
        format!(", Kendall's W = {}", apa::share(w, 2))
    });
    Some(format!(
        "Friedman's χ²({df}) = {}, {kind}p {}{better}{w}",
        apa::two(chi2),
        apa::p(p)
    ))
}

/// The F test of the mixed model, where it decides whether the realizations differ.
pub(super) fn mixed_model(a: &Analysis) -> Option<String> {
    let test = a.difference_test()?;
    let get = |id: &str| a.values.number(&format!("lmm_model/{id}"));
    let (f, df1, df2) = (
        get("satterthwaite_F")?,
        get("lrt_df")?,
        get("satterthwaite_df2")?,
    );
    (test.kind == TestKind::MixedModel).then(|| {
        format!(
            "F({}, {}) = {}, p {}",
            apa::number(df1, 0),
            apa::number(df2, 1),
            apa::two(f),
            apa::p(test.p)
        )
    })
}

/// The slope on VAF of a mixed model: `b = 38.2 per unit of VAF, SE = 5.1, t(3.0) = …`.
pub(super) fn slope_on_vaf(a: &Analysis, model: &str) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("{model}/slope{id}"));
    let (slope, se) = (get("")?, get("_se")?);
    let test = get("_t")
        .zip(get("_satterthwaite_df"))
        .zip(get("_satterthwaite_p"))
        .map_or_else(String::new, |((t, df), p)| {
            let df = apa::number(df, 1);
            format!(", t({df}) = {}, p {}", apa::two(t), apa::p(p))
        });
    let decimals = apa::decimals(se, 2);
    Some(format!(
        "b = {} per unit of VAF, SE = {}{test}",
        apa::number(slope, decimals),
        apa::number(se, decimals)
    ))
}

/// `three of 8 participants`: those who rated every realization.
pub(super) fn complete(a: &Analysis) -> String {
    let get = |id: &str| a.values.number(&format!("design/{id}")).unwrap_or(0.0);
    let complete = match get("n_subjects_complete") {
        0.0 => "none".to_owned(),
        n => n.to_string(),
    };
    let all = counted(get("n_subjects") as usize, "participant", "participants");
    format!("{complete} of {all}")
}

/// The realization that alone determines the correlation.
pub(super) fn sole_influence(a: &Analysis) -> Option<String> {
    let (name, what) = a.sole_influence()?;
    Some(format!(
        "Without {name} all {what} are equal: the correlation is driven by this realization alone."
    ))
}

/// What ties of VAF and of means do to the permutation p.
pub(super) fn ties(a: &Analysis) -> Vec<String> {
    let limit = "exchanging them does not change r, which limits how small p can be.";
    let mut found = Vec::new();
    let exact = a.permutation_test("pearson");
    let vaf = a.tied_vaf();
    if vaf > 1 && exact.is_some_and(|t| t.kind == TestKind::PermutationExact) {
        let n = apa::capital(&apa::count(vaf));
        found.push(format!(
            "{n} realizations share a VAF with another: {limit}"
        ));
    }
    let means = a.tied_means();
    if means > 1 {
        let n = a.values.number("corr/n_models").unwrap_or(0.0);
        let tied = apa::capital(&apa::count(means));
        found.push(format!("{tied} of the {n} means are tied: {limit}"));
    }
    found
}

/// Why a pair of realizations was not tested.
pub(super) fn pair_not_tested(a: &Analysis, first: &str, second: &str) -> String {
    let design = |id: &str| a.values.number(&format!("design/{id}"));
    match (design("n_subjects_complete"), a.pair_reason(first, second)) {
        (Some(n), Some(why)) if n >= 2.0 => why.to_owned(),
        _ if design("n_subjects") == Some(1.0) => "there is only one participant".to_owned(),
        _ => format!(
            "pairs are compared over the participants who rated every realization, here {}",
            complete(a)
        ),
    }
}

/// Why equivalence with a reference was not tested; `None` if it was.
pub(super) fn no_equivalence(a: &Analysis, contrast: &str) -> Option<String> {
    let why = a.values.reason(&format!("{contrast}/p_tost"))?;
    let margin = a.values.number(&format!("{contrast}/margin"));
    Some(match margin {
        None if a.changed(PreregisteredRule::Margin) => {
            "The equivalence margin was removed after the study began: see Deviations.".to_owned()
        }
        None => "No equivalence margin was preregistered.".to_owned(),
        Some(margin) => format!("Equivalence within ± {margin} was not tested: {why}."),
    })
}

/// The question as a noun. Untrusted.
pub(super) fn asked(a: &Analysis) -> String {
    match a.question.as_str() {
        "rating" => "the rating".to_owned(),
        other => other.to_owned(),
    }
}

/// Verdict on the memory from its correlation and the p of the linear and the quadratic
/// term. With two tests of one question each is held against half of [`ALPHA`].
pub(super) fn memory_verdict(r: f64, linear: Option<f64>, quadratic: Option<f64>) -> &'static str {
    let level = if quadratic.is_some() {
        0.5 * ALPHA
    } else {
        ALPHA
    };
    let shown = |p: Option<f64>| p.is_some_and(|p| p < level);
    match (shown(linear), shown(quadratic)) {
        (false, false) if linear.is_none() && r.abs() > 1.0 - 1e-9 => {
            "No t test is defined, because the mean ratings are an exact linear function of the \
             memory"
        }
        (false, false) if linear.is_none() => "No t test is defined",
        (true, _) if r > 0.0 => {
            "Yes: over these realizations, those with a longer memory are rated higher"
        }
        (true, _) => "Yes: over these realizations, those with a shorter memory are rated higher",
        (false, true) => {
            "Yes: over these realizations the rating is a curved function of the memory"
        }
        (false, false) => "Not shown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correlation_without_a_test_is_not_called_unshown() {
        assert_eq!(memory_verdict(0.5, Some(0.2), None), "Not shown");
        assert_eq!(memory_verdict(0.5, Some(0.03), Some(0.4)), "Not shown");
        assert!(memory_verdict(0.5, Some(0.03), None).starts_with("Yes"));
        assert!(memory_verdict(-1.0, None, None).contains("exact linear function"));
        assert_eq!(memory_verdict(0.5, None, None), "No t test is defined");
    }
}
