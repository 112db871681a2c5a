//! The study's questions and their answers, first in a sentence, then in numbers.

mod between;

use super::safe;
use crate::analyze::{Analysis, Listed};
use crate::outcome::Role;
use crate::report::apa;
use maud::{Markup, html};

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
            @if all.is_empty() {
                p { "The data allow no answer to any of the study's questions; the tables show what there is." }
            }
            @for answer in &all {
                h3 { (safe(&answer.question)) }
                p.short { (safe(&answer.short)) }
                @for line in &answer.more { p { (safe(line)) } }
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
    let scale = a.scale.map_or_else(String::new, |(from, to)| {
        format!(" on a scale from {from} to {to}")
    });
    let share = |id: &str| v.number(&format!("realistic/{id}/share"));
    let short = match a.realistic_from.zip(share(best)) {
        Some((from, s)) => format!(
            "The best-rated realization is {best}, mean {}{scale}; {} of its ratings are {from} or higher.",
            two(mean),
            apa::percent(s)
        ),
        None => format!(
            "The best-rated realization is {best}, mean {}{scale}; no rating was stated beforehand \
             from which one counts as realistic.",
            two(mean)
        ),
    };
    let mut more = Vec::new();
    let over = format!("desc/{best}/subject_mean");
    let interval = ci(a, &format!("{over}/ci95"), two);
    if let (Some(m), false) = (v.number(&format!("{over}/mean")), interval.is_empty()) {
        more.push(format!("Its mean over subjects is {}{interval}.", two(m)));
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
            let p = get("p_t_holm")
                .map_or_else(String::new, |p| format!(", p {} (Holm)", apa::equals_p(p)));
            let equivalent = get("margin").zip(get("p_tost")).map_or_else(
                || " No margin of equivalence was stated beforehand.".to_owned(),
                |(margin, p)| {
                    let verdict = if p < 0.05 {
                        "equivalent"
                    } else {
                        "not shown to be equivalent"
                    };
                    format!(
                        " Within ± {margin} they are {verdict} (two one-sided tests, p {}).",
                        apa::equals_p(p)
                    )
                },
            );
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
                    "{} share the highest mean, {}.",
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
    let p = get("p_wilcoxon_exact_holm").or_else(|| get("p_t_holm"));
    let difference = format!("{first} {} and {second} {}", two(mean), two(next));
    let short = match p {
        Some(p) if p < 0.05 => format!("Yes: {difference}, p {} (Holm).", apa::equals_p(p)),
        Some(p) => format!(
            "Not by these data: {difference}, p {} (Holm).",
            apa::equals_p(p)
        ),
        None => format!("{difference}; the pair was not tested."),
    };
    let mut more = Vec::new();
    if let (Some(d), Some(dz)) = (get("mean_diff"), get("dz")) {
        let wilcoxon = get("p_wilcoxon_exact").map_or_else(String::new, |p| {
            format!(
                ", Wilcoxon exact p {} before Holm's correction over all pairs",
                apa::equals_p(p)
            )
        });
        more.push(format!(
            "{low} minus {high} over subjects: {} (dz = {}){wilcoxon}.",
            two(d),
            two(dz)
        ));
    }
    Some(Answer {
        question,
        short,
        more,
    })
}

fn differ(a: &Analysis) -> Option<Answer> {
    let v = &a.values;
    let mut more = Vec::new();
    more.extend(super::prose::anova(a).map(|s| format!("{s}.")));
    more.extend(super::prose::friedman(a).map(|s| format!("{s}.")));
    let p = v
        .number("rmanova/p_gg")
        .or_else(|| v.number("friedman/p"))?;
    let short = if p < 0.05 {
        format!("Yes, p {}.", apa::equals_p(p))
    } else {
        format!("These data do not show it, p {}.", apa::equals_p(p))
    };
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
        more: vec!["Few realizations estimate their own share poorly.".to_owned()],
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
        format!(
            "{} (SE {}), t({}) = {}, p {}",
            apa::number(b, 3),
            apa::number(se, 3),
            apa::number(df, 0),
            two(t),
            apa::equals_p(p)
        )
    };
    let trial = effect("order_trial")?;
    let short = if trial.4 < 0.05 {
        format!(
            "Ratings drift by {} per trial, p {}.",
            apa::number(trial.0, 3),
            apa::equals_p(trial.4)
        )
    } else {
        format!(
            "No drift over the session is shown, p {}.",
            apa::equals_p(trial.4)
        )
    };
    let mut more = vec![format!(
        "Change per trial, beside subjects and realizations: {}.",
        say(trial)
    )];
    if let Some(previous) = effect("order_previous_rating") {
        more.push(format!(
            "Change per point of the rating just before: {} (biased a little below 0, so that its p \
             is too small).",
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
                ul { @for row in &rows { li { (safe(row)) } } }
            }
        }
    }
}
