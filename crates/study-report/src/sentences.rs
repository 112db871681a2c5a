//! Findings, test results and remarks in the wording shared by the terminal page, the
//! report and its paragraphs. Names in them are untrusted.

use super::apa;
use study_analysis::analyze::findings::{Estimate, Statistic};
use study_analysis::analyze::results::{Coefficients, Interval, Number as _, ReferenceTest};
use study_analysis::analyze::{
    Analysis, Finding, Pair, PreregisteredRule, Test, TestKind, Verdict, Warning,
};
use study_base::text::{capital, counted, sentence};

/// `Yes`, `Not shown` or `Cannot be determined`.
pub(super) fn verdict(verdict: &Verdict) -> &'static str {
    match verdict {
        Verdict::Yes => "Yes",
        Verdict::NotShown => "Not shown",
        Verdict::Undefined(_) => "Cannot be determined",
    }
}

/// The name of a test.
pub(super) fn test_name(kind: TestKind) -> &'static str {
    match kind {
        TestKind::Anova => "repeated-measures analysis of variance",
        TestKind::AnovaGreenhouseGeisser => {
            "repeated-measures analysis of variance, Greenhouse–Geisser correction"
        }
        TestKind::AnovaHuynhFeldt => {
            "repeated-measures analysis of variance, Huynh–Feldt correction"
        }
        TestKind::FriedmanExact => "Friedman's test, exact",
        TestKind::Friedman => "Friedman's test, Iman and Davenport's approximation",
        TestKind::MixedModel => "linear mixed model",
        TestKind::MixedContrast => "contrast of the linear mixed model",
        TestKind::WithinParticipants => "analysis of variance within participants",
        TestKind::WithinContrast => "t test within participants",
        TestKind::WeightedTrend => "t test of the means weighted by their precision",
        TestKind::PairedT => "paired t test",
        TestKind::PermutationExact => "permutation test, exact",
        TestKind::PermutationMonteCarlo => "permutation test",
        TestKind::StressPermutation => "permutation test within participants",
        TestKind::RanksExact => "permutation test of the ranks within participants, exact",
        TestKind::RanksMonteCarlo => "permutation test of the ranks within participants",
        TestKind::Sign => "sign test, exact",
        TestKind::Interaction => "interaction of participants and realizations",
        TestKind::SlopesDiffer => "slopes of the participants on VAF",
        TestKind::SlopeT => "t test",
        TestKind::Equivalence => "two one-sided t tests",
        TestKind::OneSampleT => "t test over participants",
        TestKind::Wald => "z test",
        TestKind::Welch => "Welch's analysis of variance between groups",
        TestKind::ClusteredT => "t test, participants as clusters",
        TestKind::BetweenWithin => {
            "analysis of variance between and within participants, Greenhouse–Geisser correction"
        }
        TestKind::BetweenSites => "analysis of variance between sites",
        TestKind::FactorialAnova => "factorial repeated-measures analysis of variance",
        TestKind::FactorialWithin => {
            "t tests within participants, clustered by participant, of the contrasts of the effect"
        }
        TestKind::FactorialAnovaGreenhouseGeisser => {
            "factorial repeated-measures analysis of variance, Greenhouse–Geisser correction"
        }
    }
}

/// p of a test, with its sign: `p = .023`.
pub(super) fn p(test: &Test) -> String {
    format!("p {}", apa::p_beside(test.p, test.level))
}

/// `F(2.78, 25.00) = 19.16`, `t(9) = 3.20`; χ² with the number of participants.
fn statistic(s: &Statistic, participants: usize) -> String {
    let df = |df: &f64| apa::number(*df, if df.fract().abs() < 1e-9 { 0 } else { 2 });
    let mut df: Vec<String> = s.df.iter().map(df).collect();
    if s.symbol == "χ²" {
        df.push(format!("N = {participants}"));
    }
    let df = match df.len() {
        0 => String::new(),
        _ => format!("({})", df.join(", ")),
    };
    format!("{}{df} = {}", s.symbol, apa::two(s.value))
}

/// The result of the deciding test: `F(2.78, 25.00) = 19.16, p < .001`.
pub(super) fn result<Q>(f: &Finding<Q>) -> Option<String> {
    let test = f.test.as_ref()?;
    Some(tested(test, f.participants))
}

/// A test: `t(9) = 3.20, p = .011`.
pub(super) fn tested(test: &Test, participants: usize) -> String {
    // A correlation is printed as the estimate.
    let shown = test.statistic.as_ref().filter(|s| s.symbol != "r");
    match shown {
        Some(s) => format!("{}, {}", statistic(s, participants), p(test)),
        None => p(test),
    }
}

/// `paired t test, Holm's correction over 10 pairs`.
pub(super) fn corrected(test: &Test) -> String {
    let name = test_name(test.kind);
    match test.comparisons {
        0 | 1 => name.to_owned(),
        n => format!("{name}, Holm's correction over {n} pairs"),
    }
}

/// An estimate with its interval: `0.57, 95 % CI [0.12, 1.02]`.
pub(super) fn estimate(e: &Estimate, format: impl Fn(f64) -> String) -> String {
    let ci = e.ci95.map_or_else(String::new, |bounds| {
        format!(", 95 % CI {}", apa::interval(bounds, &format))
    });
    format!("{}{ci}", format(e.value))
}

/// A caveat or warning as a sentence.
pub(super) fn caveat(w: &Warning) -> String {
    sentence(&w.text)
}

/// `, 95 % CI [a, b]`, or nothing if the interval is undefined.
pub(super) fn ci<'a>(
    interval: impl Into<Option<&'a Interval>>,
    format: impl Fn(f64) -> String,
) -> String {
    let bounds = interval.into().and_then(Interval::ends);
    bounds.map_or_else(String::new, |b| {
        format!(", 95 % CI {}", apa::interval(b, format))
    })
}

/// `, exact p = .008` or `, permutation p = .008`; nothing if there is no test.
pub(super) fn permutation_p(a: &Analysis, found: Option<(f64, bool)>) -> String {
    found.map_or_else(String::new, |(p, exact)| {
        let kind = if exact { "exact p" } else { "permutation p" };
        format!(", {kind} {}", apa::p_beside(p, a.alpha))
    })
}

/// The p that decides whether VAF predicts the rating, as [`permutation_p`] or with the weighted means.
pub(super) fn p_of_vaf(a: &Analysis) -> String {
    let Some(trend) = &a.correlation().trend else {
        return permutation_p(a, a.correlation().pearson.permutation_p());
    };
    let all = (trend.t.number())
        .zip(trend.df.number())
        .zip(trend.p.number());
    all.map_or_else(String::new, |((t, df), p)| {
        format!(
            "; with the means weighted by their precision t({df}) = {}, p {}",
            apa::two(t),
            apa::p_beside(p, a.alpha)
        )
    })
}

/// The effect of the realizations in an analysis of variance, where it was decided by one:
/// generalized η² and the correction.
pub(super) fn anova_effect(a: &Analysis, test: &Test) -> String {
    let anova = &a.results.evidence.differences.rmanova;
    let ges = anova.ges.number().map_or_else(String::new, |g| {
        format!(", generalized η² = {}", apa::share(g, 2))
    });
    let epsilon = match test.kind {
        TestKind::AnovaGreenhouseGeisser => anova.eps_gg.number(),
        TestKind::AnovaHuynhFeldt => anova.eps_hf_unclipped.number().map(|e| e.min(1.0)),
        _ => None,
    };
    let epsilon = epsilon.map_or_else(String::new, |e| format!(", ε = {}", apa::share(e, 2)));
    match test.kind {
        TestKind::Anova | TestKind::AnovaGreenhouseGeisser | TestKind::AnovaHuynhFeldt => {
            format!("{ges}{epsilon}")
        }
        _ => String::new(),
    }
}

/// Friedman's test, exact where possible.
pub(super) fn friedman(a: &Analysis) -> Option<String> {
    let found = &a.results.evidence.differences.friedman;
    let (chi2, df) = (found.chi2.number()?, found.df.number()?);
    let (kind, p) = match found.exact_p.number() {
        Some(p) => ("exact ", p),
        None => ("", found.p.number()?),
    };
    // A better approximation than χ², where the exact p is missing.
    let better = (found.iman_davenport_p.number())
        .filter(|_| kind.is_empty())
        .map_or_else(String::new, |p| {
            format!(
                " (by Iman and Davenport's F, p {})",
                apa::p_beside(p, a.alpha)
            )
        });
    let w = found.kendall_w.number().map_or_else(String::new, |w| {
        format!(", Kendall's W = {}", apa::share(w, 2))
    });
    Some(format!(
        "Friedman's χ²({df}, N = {}) = {}, {kind}p {}{better}{w}",
        a.design.complete,
        apa::two(chi2),
        apa::p_beside(p, a.alpha)
    ))
}

/// The slope on VAF of a mixed model, per .01: `b = 0.38 per .01 of VAF, SE = 0.05, …`.
pub(super) fn slope_on_vaf(a: &Analysis, model: &Coefficients) -> Option<String> {
    let (slope, se) = (
        model.slope.number()? / 100.0,
        model.slope_se.number()? / 100.0,
    );
    let test = (model.slope_t.number())
        .zip(model.slope_satterthwaite_df.number())
        .zip(model.slope_satterthwaite_p.number())
        .map_or_else(String::new, |((t, df), p)| {
            let df = apa::number(df, 1);
            format!(
                ", t({df}) = {}, p {}",
                apa::two(t),
                apa::p_beside(p, a.alpha)
            )
        });
    let decimals = apa::decimals(se, 2);
    Some(format!(
        "b = {} per .01 of VAF, SE = {}{test}",
        apa::number(slope, decimals),
        apa::number(se, decimals)
    ))
}

/// A pair that differs: `a above b by 0.57, 95 % CI [0.12, 1.02], p = .011`.
pub(super) fn different_pair(p: &Pair) -> String {
    let test = p
        .test
        .as_ref()
        .map_or_else(String::new, |t| format!(", {}", self::p(t)));
    format!(
        "{} above {} by {}{test}",
        p.first,
        p.second,
        estimate(&p.difference, apa::two)
    )
}

/// The realization that alone determines the correlation.
pub(super) fn sole_influence(a: &Analysis) -> Option<String> {
    let (name, what) = a.sole_influence()?;
    Some(format!(
        "Without {name} all {what} are equal: the correlation is driven by this realization alone."
    ))
}

/// What ties of VAF and of means do to an exact permutation p.
pub(super) fn ties(a: &Analysis) -> Vec<String> {
    let limit = "exchanging them does not change r, which limits how small p can be.";
    let mut found = Vec::new();
    let permutation = a.correlation().pearson.permutation_p();
    if a.correlation().trend.is_some() || !permutation.is_some_and(|(_, exact)| exact) {
        return found;
    }
    let vaf = a.tied_vaf();
    if vaf > 1 {
        let n = capital(&apa::count(vaf));
        found.push(format!(
            "{n} realizations share a VAF with another: {limit}"
        ));
    }
    let means = a.tied_means();
    if means > 1 {
        let n = a.correlation().n();
        let tied = capital(&apa::count(means));
        found.push(format!("{tied} of the {n} means are tied: {limit}"));
    }
    found
}

/// Why equivalence with a reference was not tested; `None` if it was.
pub(super) fn no_equivalence(a: &Analysis, contrast: &ReferenceTest) -> Option<String> {
    let why = contrast.p_tost.reason()?;
    let margin = contrast.equivalence.as_ref().map(|e| &e.margin).number();
    Some(match margin {
        None if a.changed(PreregisteredRule::Margin) => {
            "The equivalence margin was removed after the study began: see Deviations.".to_owned()
        }
        None => "No equivalence margin was set in advance.".to_owned(),
        Some(margin) => format!("Equivalence within ± {margin} was not tested: {why}."),
    })
}

/// What was rated, as a noun. Untrusted.
pub(super) fn asked(a: &Analysis) -> String {
    match (&a.construct, a.question.as_str()) {
        (Some(construct), _) => construct.clone(),
        (None, "rating") => "the rating".to_owned(),
        (None, other) => other.to_owned(),
    }
}

/// Whether the study is about realism: its question or construct is so called, or it
/// states from which rating on a realization counts as realistic.
pub(super) fn is_about_realism(a: &Analysis) -> bool {
    match &a.construct {
        Some(construct) => construct == "realism",
        None => {
            a.question == "realism"
                || a.realistic_from.is_some()
                || a.changed(PreregisteredRule::RealisticFrom)
        }
    }
}

/// The mean on which verdicts rest: `adjusted mean` where cells are missing.
pub(super) fn mean(a: &Analysis) -> &'static str {
    if a.design.is_complete() {
        "mean"
    } else {
        "adjusted mean"
    }
}

/// Level of significance, without a zero before the decimal point.
pub(super) fn level(alpha: f64) -> String {
    let digits = format!("{alpha:.6}");
    digits.trim_matches('0').to_owned()
}

/// `12 participants`.
pub(super) fn participants(n: usize) -> String {
    counted(n, "participant", "participants")
}
