//! The study's questions and their answers, first in a sentence, then in numbers.

mod between;

use super::{safe, typeset};
use crate::report::{MAX_PAIRED, apa};
use maud::{Markup, html};
use study_core::analyze::{Analysis, Listed, PreregisteredRule};
use study_core::outcome::Role;

/// One question.
pub(super) struct Answer {
    pub(super) question: String,
    /// The sentence to take away.
    pub(super) short: String,
    /// What stands behind it.
    pub(super) more: Vec<String>,
}

pub(super) fn section(a: &Analysis) -> Markup {
    let all: Vec<Answer> = [
        real(a),
        between::predicts(a),
        between::covariates(a),
        separable(a),
        differ(a),
        variance(a),
        order(a),
    ]
    .into_iter()
    .flatten()
    .collect();
    html! {
        section {
            h2 { "Answers" }
            @if a.counts.rated == 0 {
                p { "Nothing is left to analyse: no rating counts. “What was counted and left out” tells why." }
            } @else if all.is_empty() {
                p { "The data allow no answer to any of the study's questions; the tables show what there is." }
            }
            @for answer in &all {
                h3 { (safe(&answer.question)) }
                p.short { (typeset(&answer.short)) }
                @for line in &answer.more { p { (typeset(line)) } }
            }
        }
    }
}

/// What the study asks about.
pub(super) fn tests(a: &Analysis) -> Vec<&Listed> {
    let own = |m: &&Listed| m.role == Role::Test && m.duplicate_of.is_none();
    a.realizations.iter().filter(own).collect()
}

/// Tests by mean, the highest first; equal ones by name.
fn ranked(a: &Analysis) -> Vec<(f64, &str)> {
    let mut ranked: Vec<(f64, &str)> = tests(a)
        .iter()
        .filter_map(|m| {
            let mean = a.values.number(&format!("desc/{}/mean", m.id))?;
            Some((mean, m.id.as_str()))
        })
        .collect();
    ranked.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(y.1)));
    ranked
}

/// `, 95 % CI [a, b]` of two values, or nothing.
pub(super) fn ci(a: &Analysis, id: &str, one: impl Fn(f64) -> String) -> String {
    let low = a.values.number(&format!("{id}_lo"));
    let high = a.values.number(&format!("{id}_hi"));
    low.zip(high).map_or_else(String::new, |(low, high)| {
        format!(", 95 % CI {}", apa::interval(low, high, one))
    })
}

fn two(x: f64) -> String {
    apa::number(x, 2)
}

fn real(a: &Analysis) -> Option<Answer> {
    let ranked = ranked(a);
    let (mean, best) = *ranked.first()?;
    let v = &a.values;
    let equals = ranked.iter().filter(|r| r.0 == mean).count();
    let who = match (ranked.len(), equals) {
        (1, _) => format!("The only realization is {best}"),
        (_, 1) => format!("The best-rated realization is {best}"),
        _ => format!(
            "{} realizations share the highest mean; one of them is {best}",
            apa::capital(&apa::count(equals))
        ),
    };
    let scale = a.scale.map_or_else(String::new, |(from, to)| {
        format!(" on a scale from {from} to {to}")
    });
    let share = |id: &str| v.number(&format!("realistic/{id}/share"));
    let short = match a.realistic_from.zip(share(best)) {
        Some((from, s)) => format!(
            "{who}, mean {}{scale}; {} of its ratings are {from} or higher.",
            two(mean),
            apa::percent(s)
        ),
        None if a.changed(PreregisteredRule::RealisticFrom) => format!(
            "{who}, mean {}{scale}; from which rating on one counts as realistic was changed after \
             the study began: see Deviations.",
            two(mean)
        ),
        None => format!(
            "{who}, mean {}{scale}; no rating was stated beforehand from which one counts as \
             realistic.",
            two(mean)
        ),
    };
    let mut more = Vec::new();
    let over = format!("desc/{best}/subject_mean");
    let interval = ci(a, &format!("{over}/ci95"), two);
    if let (Some(m), false) = (v.number(&format!("{over}/mean")), interval.is_empty()) {
        more.push(format!(
            "The mean of {best} over subjects is {}{interval}.",
            two(m)
        ));
    }
    if let Some(from) = a.realistic_from {
        let most: Vec<String> = ranked
            .iter()
            .filter_map(|(_, id)| Some(format!("{id} {}", apa::percent(share(id)?))))
            .take(12)
            .collect();
        if most.len() > 1 {
            let all = most.join(", ");
            more.push(format!("Share of ratings at {from} or higher: {all}."));
        }
    }
    let role = |role: Role, what: &str| -> Vec<String> {
        let own = a.realizations.iter().filter(|m| m.role == role);
        own.filter_map(|m| {
            let mean = v.number(&format!("desc/{}/mean", m.id))?;
            Some(format!("The {what} {} has the mean {}.", m.id, two(mean)))
        })
        .collect()
    };
    more.extend(role(Role::HiddenReference, "hidden reference"));
    more.extend(role(Role::Physical, "physical device"));
    more.extend(role(Role::LowAnchor, "low anchor"));
    more.extend(against_references(a, best));
    Some(Answer {
        question: "Do the realizations feel like the target?".to_owned(),
        short,
        more,
    })
}

/// The best realization minus each reference, and whether they are equivalent.
fn against_references(a: &Analysis, best: &str) -> Vec<String> {
    let v = &a.values;
    let beside = |m: &&Listed| m.role == Role::HiddenReference || m.role == Role::Physical;
    let references = a.realizations.iter().filter(beside);
    references
        .filter_map(|m| {
            let id = format!("reference/{}/{best}", m.id);
            let get = |what: &str| v.number(&format!("{id}/{what}"));
            let difference = get("mean_diff")?;
            let interval = ci(a, &format!("{id}/ci95"), two);
            let p = get("p_t_holm").map_or_else(String::new, |p| {
                format!(", paired t test p {} (Holm)", apa::equals_p(p))
            });
            let later = match a.changed(PreregisteredRule::Margin) {
                true => ", a margin changed after the study began,",
                false => "",
            };
            let equivalent = match (get("margin"), get("p_tost")) {
                (Some(margin), Some(p)) => {
                    let verdict = if p < 0.05 {
                        "equivalent"
                    } else {
                        "not shown to be equivalent"
                    };
                    format!(
                        " Within ± {margin}{later} they are {verdict} (two one-sided tests, p {}).",
                        apa::equals_p(p)
                    )
                }
                _ => crate::report::no_equivalence(a, &id)
                    .map_or_else(String::new, |why| format!(" {}.", apa::capital(&why))),
            };
            Some(format!(
                "{best} minus {} over subjects: {}{interval}{p}.{equivalent}",
                m.id,
                two(difference)
            ))
        })
        .collect()
}

fn separable(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let ranked = ranked(a);
    let [(mean, first), (next, second), ..] = ranked[..] else {
        return None;
    };
    let question = "Is the best-rated realization separable from the next?".to_owned();
    if mean == next {
        return Some(Answer {
            question,
            short: {
                let best = ranked.iter().take_while(|(m, _)| *m == mean);
                let best: Vec<String> = best.map(|(_, id)| (*id).to_owned()).collect();
                format!(
                    "No: {} share the highest mean, {}.",
                    apa::listing(&best),
                    two(mean)
                )
            },
            more: Vec::new(),
        });
    }
    let (low, high) = if first < second {
        (first, second)
    } else {
        (second, first)
    };
    let get = |id: &str| v.number(&format!("posthoc/{low}|{high}/{id}"));
    let exact = get("p_wilcoxon_exact_holm").map(|p| ("Wilcoxon's signed-rank test, exact", p));
    let found = exact.or_else(|| get("p_t_holm").map(|p| ("paired t test", p)));
    let (pairs, least) = crate::report::pairs(a);
    let holm = match pairs.len() {
        1 => String::new(),
        n => format!(", Holm's correction over {n} pairs"),
    };
    let difference = format!(
        "{first} (mean {}) and {second} (mean {})",
        two(mean),
        two(next)
    );
    let short = match found {
        Some((test, p)) => {
            let verdict = if p < 0.05 { "Yes" } else { "Not by these data" };
            let p = apa::equals_p(p);
            format!("{verdict}: {difference}, p {p} ({test}{holm}).")
        }
        None if ranked.len() > MAX_PAIRED => format!(
            "{difference}; pairs are tested of {MAX_PAIRED} realizations at most, and there are {}.",
            ranked.len()
        ),
        None => format!("{difference}; {}.", crate::report::no_pairs(a, low, high)),
    };
    let mut more = Vec::new();
    if let (Some(d), Some(dz)) = (get("mean_diff"), get("dz")) {
        let sign = if low == first { 1.0 } else { -1.0 };
        let alone = get("p_wilcoxon_exact").filter(|_| pairs.len() > 1);
        let alone = alone.map_or_else(String::new, |p| {
            format!("; without the correction p {}", apa::equals_p(p))
        });
        more.push(format!(
            "{first} minus {second} over subjects: {} (Cohen's dz = {}){alone}.",
            two(sign * d),
            two(sign * dz)
        ));
    }
    if let Some(least) = least.filter(|l| exact.is_some() && *l >= 0.05) {
        more.push(too_few_for_pairs(pairs.len(), least));
    }
    Some(Answer {
        question,
        short,
        more,
    })
}

/// Why no pair can be significant.
pub(super) fn too_few_for_pairs(pairs: usize, least: f64) -> String {
    format!(
        "With so few subjects Wilcoxon's test, corrected over {}, cannot give a p below {}: it could \
         not have shown a difference.",
        apa::counted(pairs, "pair", "pairs"),
        apa::p(least)
    )
}

/// Whether the crossed model with VAF has no variance of the realizations left;
/// `None` if its fit is not singular.
pub(super) fn none_left(a: &Analysis) -> Option<bool> {
    let get = |id: &str| a.values.number(&format!("lmm_vaf_crossed/{id}"));
    get("singular").filter(|s| *s == 1.0)?;
    Some(get("var_model").is_none_or(|v| v <= 0.0))
}

const MIXED: &str = "linear mixed model, Satterthwaite's degrees of freedom";

/// The test of all ratings, where too few subjects rated every realization.
fn incomplete_test(a: &Analysis) -> Option<String> {
    let m = crate::report::mixed_f(a)?;
    Some(format!(
        "Linear mixed model of all ratings, with an intercept for each subject: F({}, {}) = {}, \
         p {}. {} rated every realization, too few for an analysis of variance or Friedman's test. \
         The model takes what is missing as missing by chance.",
        apa::number(m.df1, 0),
        apa::number(m.df2, 1),
        two(m.f),
        apa::equals_p(m.p),
        apa::capital(&crate::report::complete(a))
    ))
}

fn differ(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let mut more = Vec::new();
    more.extend(super::prose::anova(a).map(|s| format!("{s}.")));
    more.extend(super::prose::friedman(a).map(|s| format!("{s}.")));
    let of = |id: &str, test: &'static str| v.number(id).map(|p| (p, test));
    let (p, test) = of("rmanova/p_gg", "repeated-measures analysis of variance")
        .or_else(|| of("friedman/exact_p", "Friedman's test, exact"))
        .or_else(|| of("friedman/p", "Friedman's test"))
        .or_else(|| of("lmm_model/satterthwaite_p", MIXED))?;
    if test == MIXED {
        more.extend(incomplete_test(a));
    }
    let verdict = if p < 0.05 {
        "Yes"
    } else {
        "These data do not show it"
    };
    let short = format!("{verdict}, p {} ({test}).", apa::equals_p(p));
    Some(Answer {
        question: "Do the realizations differ at all?".to_owned(),
        short,
        more,
    })
}

fn variance(a: &Analysis) -> Option<Answer> {
    let parts = shares(a);
    if parts.is_empty() {
        return None;
    }
    let all: Vec<String> = parts
        .iter()
        .map(|(name, s)| format!("{name} {}", apa::percent(*s)))
        .collect();
    let said = all.join(", ");
    let mut letters = said.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    Some(Answer {
        question: "Where does the variance of the ratings come from?".to_owned(),
        short: format!("{}{}.", first.unwrap_or_default(), letters.as_str()),
        more: vec![
            "The share of the realizations is the least certain: it rests on as many values as there \
             are realizations."
                .to_owned(),
        ],
    })
}

/// Name and share of each component of variance: by expected mean squares, else
/// of the mixed model with subjects and realizations crossed.
pub(super) fn shares(a: &Analysis) -> Vec<(&'static str, f64)> {
    let get = |id: &str| a.values.number(&format!("variance/share/{id}"));
    if let (Some(model), Some(subject)) = (get("model"), get("subject")) {
        let mut parts = vec![("realizations", model), ("subjects", subject)];
        match get("interaction").zip(get("noise")) {
            Some((interaction, noise)) => {
                parts.push(("subjects × realizations", interaction));
                parts.push(("within cells", noise));
            }
            None => parts.extend(
                get("interaction_and_noise").map(|x| ("subjects × realizations and noise", x)),
            ),
        }
        return parts;
    }
    let get = |id: &str| a.values.number(&format!("lmm_crossed/{id}"));
    let (Some(subject), Some(model), Some(rest)) =
        (get("var_subject"), get("var_model"), get("sigma2"))
    else {
        return Vec::new();
    };
    let both = get("var_subject_model");
    let whole = subject + model + rest + both.unwrap_or(0.0);
    if whole.is_nan() || whole <= 0.0 {
        return Vec::new();
    }
    let mut parts = vec![
        ("realizations", model / whole),
        ("subjects", subject / whole),
    ];
    parts.extend(both.map(|b| ("subjects × realizations", b / whole)));
    parts.push(("within cells", rest / whole));
    parts
}

fn order(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let effect = |id: &str| {
        let get = |what: &str| v.number(&format!("{id}/{what}"));
        Some((get("slope")?, get("se")?, get("df")?, get("t")?, get("p")?))
    };
    let say = |(b, se, df, t, p): (f64, f64, f64, f64, f64)| {
        let digits = apa::decimals(se, 3);
        format!(
            "{} (SE {}), t({}) = {}, p {}",
            apa::number(b, digits),
            apa::number(se, digits),
            apa::number(df, 0),
            two(t),
            apa::equals_p(p)
        )
    };
    let trial = effect("order_trial")?;
    let short = if trial.4 < 0.05 {
        format!(
            "Ratings drift by {} points per trial, p {} (t test).",
            apa::number(trial.0, apa::decimals(trial.1, 3)),
            apa::equals_p(trial.4)
        )
    } else {
        format!(
            "No drift over the session is shown, p {} (t test).",
            apa::equals_p(trial.4)
        )
    };
    let mut more = vec![format!(
        "Change per trial, with a mean for each subject and each realization taken out: {}.",
        say(trial)
    )];
    if let Some(previous) = effect("order_previous_rating") {
        more.push(format!(
            "Change per point of the rating just before: {}. Taking out the subjects' means biases \
             this a little below 0, so that a small negative change is no finding.",
            say(previous)
        ));
    }
    Some(Answer {
        question: "Do order and learning matter?".to_owned(),
        short,
        more,
    })
}

/// Results that hold for these realizations only, set apart.
pub(super) fn only_these(a: &Analysis) -> Markup {
    let rows = super::prose::only_these(a);
    html! {
        @if !rows.is_empty() {
            section.apart {
                h2 { "For these realizations only" }
                p.warning {
                    "These results treat the realizations as all there are. They say nothing about \
                     other realizations: where realizations differ for reasons other than VAF, tests \
                     of this kind found a VAF effect that was not there in up to half of simulated studies. \
                     None of them answers whether VAF predicts realism."
                }
                ul { @for row in &rows { li { (typeset(row)) } } }
            }
        }
    }
}
