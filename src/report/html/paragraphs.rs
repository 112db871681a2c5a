//! Draft paragraphs for a paper: methods and results.

use super::{Details, methods, typeset};
use crate::report::{apa, sentences};
use maud::{Markup, html};
use study_core::analyze::Analysis;

/// Realizations whose means are listed in a sentence.
const MAX_MEANS: usize = 12;

pub(super) fn section(details: &Details, a: &Analysis) -> Markup {
    let results = results(a);
    html! {
        section {
            h2 { "For the paper" }
            p.note { "Drafts made from the numbers of this analysis. Check every sentence before you use it." }
            h3 { "Methods" }
            p { (typeset(&methods::paragraph(details, a))) }
            @if !results.is_empty() {
                h3 { "Results" }
                p { (typeset(&results)) }
            }
        }
    }
}

fn results(a: &Analysis) -> String {
    let v = &a.values;
    let mut text = Vec::new();
    let means: Vec<String> = (a.tested())
        .filter_map(|m| {
            let mean = apa::two(a.described(&m.id, "mean")?);
            let sd = a.described(&m.id, "sd");
            let sd = sd.map_or_else(String::new, |s| format!(", SD = {}", apa::two(s)));
            Some(format!("{} (M = {mean}{sd})", m.id))
        })
        .collect();
    if (1..=MAX_MEANS).contains(&means.len()) {
        text.push(format!("Mean ratings: {}.", means.join(", ")));
    }
    let tests = [sentences::anova(a), sentences::friedman(a)];
    let tests: Vec<String> = tests.into_iter().flatten().collect();
    if !tests.is_empty() {
        let tests = tests.join("; ");
        text.push(format!("Differences between realizations: {tests}."));
    }
    text.extend(sentences::mixed_model(a).map(|f| {
        format!("Differences between realizations (linear mixed model of all ratings): {f}.")
    }));
    if let Some(r) = v.number("corr/pearson/r") {
        let n = v.number("corr/n_models").unwrap_or(0.0);
        let rho = v.number("corr/spearman/rho");
        let rho = rho.map_or_else(String::new, |x| format!("; Spearman's ρ = {}", apa::r(x)));
        text.push(format!(
            "Over the {n} realizations the mean rating correlated with VAF at r({}) = {}{}{}{rho}.",
            n - 2.0,
            apa::r(r),
            sentences::ci(a, "corr/pearson/ci95", apa::r),
            sentences::permutation_p(a.permutation_test("pearson")),
        ));
    }
    let tested = v.number("lmm_vaf_crossed/slope_satterthwaite_p").is_some();
    if let Some(slope) = sentences::slope_on_vaf(a, "lmm_vaf_crossed").filter(|_| tested) {
        let singular = match a.no_variance_beside_vaf() {
            Some(true) => {
                " (singular fit: besides VAF no variance between realizations is left, and p is too \
                 small)"
            }
            Some(false) => " (singular fit in a variance other than that between realizations)",
            None => "",
        };
        text.push(format!("Crossed mixed model: {slope}{singular}."));
    }
    let icc = |group: &str, name: &str| {
        let x = v.number(&format!("{group}/{name}"))?;
        let ci = super::tables::icc_interval(a, &format!("{group}/{name}"));
        let ci = ci.map_or_else(String::new, |b| {
            format!(", 95 % CI {}", apa::interval(b, |x| apa::share(x, 2)))
        });
        Some(format!("{}{ci}", apa::share(x, 2)))
    };
    if let Some(x) = icc("icc_subjects", "ICC2") {
        text.push(format!("Agreement between subjects: ICC(2,1) = {x}."));
    }
    if let Some(x) = icc("icc_repetitions", "ICC1") {
        text.push(format!("Consistency over repetitions: ICC(1,1) = {x}."));
    }
    let before = v.number("before_exclusion/corr/pearson/r");
    if let Some((before, r)) = before.zip(v.number("corr/pearson/r")) {
        text.push(format!(
            "Without the exclusions the correlation would be r = {} instead of {}.",
            apa::r(before),
            apa::r(r)
        ));
    }
    text.join(" ")
}
