//! Draft paragraphs for a paper: methods and results. The results say what the answers
//! say, finding by finding.

use super::{Details, methods, typeset};
use crate::{apa, sentences, wording};
use maud::{Markup, html};
use study_analysis::analyze::results::{Coefficient, Number as _};
use study_analysis::analyze::{Analysis, Finding, Question};

/// Realizations whose means are listed in a sentence.
const MAX_LISTED: usize = 12;

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
    let mut text = Vec::new();
    text.extend(means(a));
    text.extend(adjusted_means(a));
    text.extend(realistic(a));
    for f in &a.findings {
        text.extend(sentence(a, f));
    }
    text.extend(agreement(a));
    let before = a.results.before_exclusion.as_ref();
    let before = before.map(|b| &b.corr.pearson.r).number();
    if let Some((before, r)) = before.zip(a.results.evidence.corr.pearson.r.number()) {
        text.push(format!(
            "Without the exclusions the correlation would be r = {} instead of {}.",
            apa::r(before),
            apa::r(r)
        ));
    }
    text.join(" ")
}

fn means(a: &Analysis) -> Option<String> {
    let means: Vec<String> = (a.tested())
        .filter_map(|m| {
            let described = a.described(&m.id)?;
            let mean = apa::two(described.mean.number()?);
            let sd = described
                .sd
                .number()
                .map_or_else(String::new, |s| format!(", SD = {}", apa::two(s)));
            Some(format!("{} (M = {mean}{sd})", m.id))
        })
        .collect();
    (1..=MAX_LISTED)
        .contains(&means.len())
        .then(|| format!("Mean ratings: {}.", means.join(", ")))
}

fn adjusted_means(a: &Analysis) -> Option<String> {
    if a.design.is_complete() {
        return None;
    }
    let means: Vec<String> = (a.ranked().iter())
        .map(|(mean, name)| {
            let ci = sentences::ci(a.adjusted(name).map(|m| &m.ci95), apa::two);
            format!("{name} {}{ci}", apa::two(*mean))
        })
        .collect();
    (1..=MAX_LISTED).contains(&means.len()).then(|| {
        format!(
            "Means adjusted for who rated which realization (comparisons within participants): {}.",
            means.join("; ")
        )
    })
}

fn realistic(a: &Analysis) -> Option<String> {
    let from = a.realistic_from?;
    let (_, best) = *a.ranked().first()?;
    let found = a.realistic(best)?;
    let share = found.share.number()?;
    Some(format!(
        "Of the ratings of {best}, {} were {from} or higher{}.",
        apa::percent(share),
        sentences::ci(&found.ci95, apa::percent)
    ))
}

/// The sentence of a finding. Without a validation recording nobody asks about the delivered VAF.
fn sentence(a: &Analysis, f: &Finding) -> Option<String> {
    let asked = f.question != Question::Delivered || f.realizations > 0;
    wording::of_ratings(a, f).paper().filter(|_| asked)
}

fn agreement(a: &Analysis) -> Vec<String> {
    let all = &a.results.agreement;
    let icc = |icc: &Coefficient| {
        let x = icc.value.number()?;
        let ci = crate::tables::icc_interval(icc).map_or_else(String::new, |b| {
            format!(", 95 % CI {}", apa::interval(b, |x| apa::share(x, 2)))
        });
        Some(format!("{}{ci}", apa::share(x, 2)))
    };
    let between = icc(&all.icc_subjects.icc2)
        .map(|x| format!("Agreement between participants: ICC(2,1) = {x}."));
    let within = icc(&all.icc_repetitions.icc.icc1)
        .map(|x| format!("Consistency over repetitions: ICC(1,1) = {x}."));
    [between, within].into_iter().flatten().collect()
}
