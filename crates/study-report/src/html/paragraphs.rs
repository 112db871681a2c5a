//! Draft paragraphs for a paper: methods and results. The results say what the answers
//! say, finding by finding.

use super::{Details, methods, typeset};
use crate::{apa, sentences};
use maud::{Markup, html};
use study_analysis::analyze::findings::Direction;
use study_analysis::analyze::results::{Coefficient, Number as _};
use study_analysis::analyze::{Analysis, Finding, Question, Verdict};
use study_session::outcome::Role;

/// Realizations whose means are listed in a sentence, and pairs that differ.
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
            "Means adjusted for who rated which realization (linear mixed model): {}.",
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

/// The sentence of a finding.
fn sentence(a: &Analysis, f: &Finding) -> Option<String> {
    if let Some(why) = f.reason() {
        let what = subject(a, f)?;
        return Some(format!("{what} cannot be determined: {why}."));
    }
    let result = sentences::result(f).unwrap_or_default();
    let name = (f.test.as_ref()).map_or_else(String::new, sentences::corrected);
    let yes = f.is_yes();
    let size = f
        .estimate
        .map_or_else(String::new, |e| sentences::estimate(&e, apa::two));
    Some(match &f.question {
        Question::Differ => {
            let effect = (f.test.as_ref()).map(|t| sentences::anova_effect(a, t));
            let w = f.effect.filter(|e| e.name == "Kendall's W");
            let w = w.map(|w| format!(", Kendall's W = {}", apa::share(w.value, 2)));
            let effect = effect.unwrap_or_default() + &w.unwrap_or_default();
            let what = if yes {
                "The realizations differed"
            } else {
                "A difference between the realizations was not shown"
            };
            let n = sentences::participants(f.participants);
            let friedman = (f.effect.is_some_and(|e| e.name != "Kendall's W"))
                .then(|| sentences::friedman(a))
                .flatten();
            let friedman = friedman.map_or_else(String::new, |s| format!("; {s}"));
            format!("{what}, {result}{effect} ({name}, {n}){friedman}.")
        }
        Question::Pairs => pairs(a, f, &name),
        Question::Best => match &f.names[..] {
            [first, second] if f.test.is_some() => {
                let what = if yes {
                    "differed from"
                } else {
                    "was not shown to differ from"
                };
                format!(
                    "The best-rated realization, {first}, {what} the second best, {second}, by \
                     {size}, {result} ({name})."
                )
            }
            all => format!(
                "A best-rated realization was not shown: {} share the {} mean.",
                apa::listing(all),
                a.better.most()
            ),
        },
        Question::Vaf => vaf(a, f),
        Question::Delivered => {
            let what = match (&f.verdict, f.direction) {
                (Verdict::Yes, Some(Direction::Up)) => {
                    "Realizations of which more was delivered (a higher delivered VAF) were rated higher"
                }
                (Verdict::Yes, _) => {
                    "Realizations of which more was delivered (a higher delivered VAF) were rated lower"
                }
                _ => "A relation with the delivered VAF was not shown",
            };
            let r = f
                .estimate
                .map_or_else(String::new, |e| sentences::estimate(&e, apa::r));
            format!(
                "{what}, r({}) = {r}, {result} ({name}).",
                f.realizations.saturating_sub(2)
            )
        }
        Question::Memory => {
            let p = f.test.as_ref().map_or_else(String::new, sentences::p);
            let r = f.estimate.map_or_else(String::new, |e| apa::r(e.value));
            match (yes, f.direction) {
                (true, Some(Direction::Up)) => {
                    format!("Realizations with a longer memory were rated higher, r = {r}, {p}.")
                }
                (true, Some(Direction::Down)) => {
                    format!("Realizations with a shorter memory were rated higher, r = {r}, {p}.")
                }
                (true, _) => format!("The rating was a curved function of the memory, {p}."),
                (false, _) => {
                    format!("An effect of the memory was not shown, r = {r}, {p}.")
                }
            }
        }
        Question::Disagreement => {
            let what = if yes {
                "Participants disagreed about the realizations"
            } else {
                "A disagreement of participants about the realizations was not shown"
            };
            let caveats: Vec<String> = f.caveats.iter().map(sentences::caveat).collect();
            [format!("{what}, {result} ({name}).")]
                .into_iter()
                .chain(caveats)
                .collect::<Vec<_>>()
                .join(" ")
        }
        Question::Order => {
            let what = if yes {
                "Ratings changed over the session"
            } else {
                "A change of the ratings over the session was not shown"
            };
            let se = a.results.evidence.order.trial.se.number().unwrap_or(0.0);
            let decimals = apa::decimals(se, 3);
            let b = f
                .estimate
                .map_or_else(String::new, |e| apa::number(e.value, decimals));
            format!("{what}, b = {b} per trial, {result}.")
        }
        Question::CarryOver => {
            let what = if yes {
                "Ratings depended on the ones before them"
            } else {
                "A dependence of ratings on the ones before them was not shown"
            };
            format!("{what}, b = {size} points per point, {result}.")
        }
        Question::Reference(reference) => {
            let best = f.names.first()?;
            let role = a.realizations.iter().find(|m| m.id == *reference)?.role;
            let what = match role {
                Role::LowAnchor => "the low anchor",
                Role::MidAnchor => "the mid anchor",
                Role::Physical => "the physical device",
                _ => "the hidden reference",
            };
            let differed = if yes {
                "differed"
            } else {
                "was not shown to differ"
            };
            format!("{best} {differed} from {what} {reference}, by {size}, {result} ({name}).")
        }
        Question::Equivalence(reference) => {
            let best = f.names.first()?;
            let equivalence = a.against(reference, best)?.equivalence.as_ref();
            let margin = equivalence?.margin.number()?;
            let was = if yes {
                "was equivalent"
            } else {
                "was not shown to be equivalent"
            };
            format!("{best} {was} to {reference} within ± {margin} points, {result} ({name}).")
        }
        Question::Repeat(duplicate) => {
            let original = f.names.get(1)?;
            let differed = if yes {
                "differed"
            } else {
                "was not shown to differ"
            };
            format!(
                "The hidden duplicate {duplicate} {differed} from its original {original}, by {size}, \
                 {result} ({name})."
            )
        }
        Question::SiteRealizations => match yes {
            true => format!(
                "The differences between realizations depended on the site, {result} ({name})."
            ),
            false => format!(
                "A dependence of the differences between realizations on the site was not shown, \
                 {result} ({name})."
            ),
        },
        Question::SiteVaf => match yes {
            true => format!(
                "The effect of VAF depended on the site, {result} ({name} of the participants' slopes)."
            ),
            false => format!(
                "A dependence of the effect of VAF on the site was not shown, {result} ({name} of the \
                 participants' slopes)."
            ),
        },
        Question::SiteLevel => match yes {
            true => format!("The sites differed in their mean rating, {result} ({name})."),
            false => format!(
                "A difference of the sites in their mean rating was not shown, {result} ({name})."
            ),
        },
    })
}

/// What a finding is about and the test that decides it, for a preregistration.
pub(crate) fn declared_test(a: &Analysis, f: &Finding) -> Option<(String, String)> {
    let test = f.test.as_ref()?;
    let what = match &f.question {
        // Which realizations these are is not known before.
        Question::Reference(name) => {
            format!("Whether the best-rated realization differs from {name}")
        }
        Question::Equivalence(name) => {
            format!("Whether the best-rated realization is equivalent to {name}")
        }
        _ => subject(a, f)?,
    };
    let name = match &f.question {
        Question::Memory => "t tests of a linear and a quadratic term, each".to_owned(),
        _ => format!("{},", sentences::corrected(test)),
    };
    let level = sentences::level(test.level);
    Some((what, format!("{name} level {level}")))
}

/// What an undefined finding is about.
fn subject(a: &Analysis, f: &Finding) -> Option<String> {
    Some(match &f.question {
        Question::Vaf => format!("Whether VAF predicts {}", sentences::asked(a)),
        Question::Delivered if f.realizations == 0 => return None,
        Question::Delivered => {
            format!("Whether the delivered VAF predicts {}", sentences::asked(a))
        }
        Question::Memory => "Whether the memory matters".to_owned(),
        Question::Best => {
            "Whether the best-rated realization differs from the second best".to_owned()
        }
        Question::Differ => "Whether the realizations differ".to_owned(),
        Question::Pairs => "Which pairs of realizations differ".to_owned(),
        Question::Disagreement => "Whether participants disagree about the realizations".to_owned(),
        Question::Order => "Whether ratings change over the session".to_owned(),
        Question::CarryOver => "Whether ratings depend on the ones before them".to_owned(),
        Question::Reference(name) => format!("Whether {} differs from {name}", f.names.first()?),
        Question::Equivalence(name) => {
            format!("Whether {} is equivalent to {name}", f.names.first()?)
        }
        Question::Repeat(name) => format!("Whether {name} differs from its original"),
        Question::SiteRealizations => {
            "Whether the differences between realizations depend on the site".to_owned()
        }
        Question::SiteVaf => "Whether the effect of VAF depends on the site".to_owned(),
        Question::SiteLevel => "Whether the sites differ in their mean rating".to_owned(),
    })
}

fn pairs(a: &Analysis, f: &Finding, name: &str) -> String {
    let different = a.different_pairs();
    let p = f.test.as_ref().map_or_else(String::new, sentences::p);
    if different.is_empty() {
        return format!("No pair of realizations was shown to differ, smallest {p} ({name}).");
    }
    let listed: Vec<String> = (different.iter().take(MAX_LISTED))
        .map(sentences::different_pair)
        .collect();
    let more = match different.len().saturating_sub(MAX_LISTED) {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    format!(
        "These pairs of realizations differed ({name}): {}{more}.",
        listed.join("; ")
    )
}

fn vaf(a: &Analysis, f: &Finding) -> String {
    let n = f.realizations;
    let asked = sentences::asked(a);
    let what = match (&f.verdict, f.direction) {
        (Verdict::Yes, Some(Direction::Up)) => "Realizations with a higher VAF were rated higher",
        (Verdict::Yes, _) => "Realizations with a higher VAF were rated lower",
        _ => "A relation with VAF was not shown",
    };
    let r = f
        .estimate
        .map_or_else(String::new, |e| sentences::estimate(&e, apa::r));
    let correlation = a.correlation();
    let rho = correlation.spearman.as_ref().map(|s| &s.rho).number();
    let rho = rho.map_or_else(String::new, |x| format!("; Spearman's ρ = {}", apa::r(x)));
    let mut text = format!(
        "{what}: over the {n} realizations the {} of {asked} correlated with VAF at r({}) = {r}{}{rho}.",
        sentences::mean(a),
        n.saturating_sub(2),
        sentences::permutation_p(a, correlation.pearson.permutation_p()),
    );
    for c in f.caveats.iter().filter(|c| c.code == "raw-and-adjusted") {
        text.push(' ');
        text.push_str(&sentences::caveat(c));
    }
    let crossed = &a.results.evidence.crossed.coefficients;
    let tested = crossed.slope_satterthwaite_p.number().is_some();
    if let Some(slope) = sentences::slope_on_vaf(a, crossed).filter(|_| tested) {
        let singular = match a.no_variance_beside_vaf() {
            Some(true) => {
                " (singular fit: besides VAF no variance between realizations is left, and p is too \
                 small)"
            }
            Some(false) => " (singular fit in a variance other than that between realizations)",
            None => "",
        };
        text.push_str(&format!(" Crossed mixed model: {slope}{singular}."));
    }
    text
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
