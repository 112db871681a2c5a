//! Answers to the study's questions, for the terminal page and the report.

mod conditional;
mod vaf;

pub(super) use conditional::conditional;

use super::{apa, sentences};
use study_base::text::counted;
use study_core::analyze::{
    Analysis, MAX_PAIRED, PreregisteredRule, TestKind, group_id, significant,
};
use study_core::outcome::Role;

/// The answer to a question. Names in it are untrusted.
pub(super) struct Answer {
    pub(super) question: String,
    /// The verdict, in one sentence.
    pub(super) short: String,
    /// Results on the terminal page and in the report.
    pub(super) main: Vec<String>,
    /// Results in the report only.
    pub(super) more: Vec<String>,
}

impl Answer {
    fn new(question: &str, short: String) -> Self {
        Self {
            question: question.to_owned(),
            short,
            main: Vec::new(),
            more: Vec::new(),
        }
    }
}

/// All questions that the data allow an answer to.
pub(super) fn answers(a: &Analysis) -> Vec<Answer> {
    let all = [
        target(a),
        vaf::predicts(a),
        vaf::covariates(a),
        best_two(a),
        differ(a),
        variance(a),
        order(a),
    ];
    all.into_iter().flatten().collect()
}

/// Whether the realizations feel like the target.
fn target(a: &Analysis) -> Option<Answer> {
    let ranked = a.ranked();
    let (mean, best) = *ranked.first()?;
    let equals = ranked.iter().filter(|r| r.0 == mean).count();
    let subject = match (ranked.len(), equals) {
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
    let share = |id: &str| a.about("realistic", &[id], "share");
    let changed = a.changed(PreregisteredRule::RealisticFrom);
    let realistic = match a.realistic_from.zip(share(best)) {
        Some((from, share)) => {
            let later = if changed {
                ", a threshold changed after the study began"
            } else {
                ""
            };
            let ci = sentences::ci(
                a,
                &format!("{}/ci95", group_id("realistic", &[best])),
                apa::percent,
            );
            let share = apa::percent(share);
            format!("{share} of its ratings are {from} or higher{later}{ci}")
        }
        None if changed => {
            "the threshold for “realistic” was changed after the study began: see Deviations"
                .to_owned()
        }
        None => "no threshold for “realistic” was preregistered".to_owned(),
    };
    let mut answer = Answer::new(
        "Do the realizations feel like the target?",
        format!("{subject}, mean {}{scale}; {realistic}.", apa::two(mean)),
    );
    answer.main = against_references(a, best);
    let ci = sentences::ci(
        a,
        &format!("{}/subject_mean/ci95", group_id("desc", &[best])),
        apa::two,
    );
    if let (Some(m), false) = (a.described(best, "subject_mean/mean"), ci.is_empty()) {
        let m = apa::two(m);
        (answer.more).push(format!("The mean of {best} over subjects is {m}{ci}."));
    }
    if let Some(from) = a.realistic_from {
        let shares = ranked.iter();
        let shares: Vec<String> = shares
            .filter_map(|(_, id)| Some(format!("{id} {}", apa::percent(share(id)?))))
            .take(12)
            .collect();
        if shares.len() > 1 {
            let all = shares.join(", ");
            (answer.more).push(format!("Share of ratings of {from} or higher: {all}."));
        }
    }
    for (role, name) in [
        (Role::HiddenReference, "hidden reference"),
        (Role::Physical, "physical device"),
        (Role::LowAnchor, "low anchor"),
    ] {
        for m in a.realizations.iter().filter(|m| m.role == role) {
            if let Some(mean) = a.described(&m.id, "mean") {
                let mean = apa::two(mean);
                (answer.more).push(format!("Mean rating of the {name} {}: {mean}.", m.id));
            }
        }
    }
    Some(answer)
}

/// The best realization minus each reference, and whether they are equivalent.
fn against_references(a: &Analysis, best: &str) -> Vec<String> {
    let references = a.realizations.iter();
    references
        .filter(|m| m.role == Role::HiddenReference || m.role == Role::Physical)
        .filter_map(|m| {
            let id = group_id("reference", &[&m.id, best]);
            let get = |what: &str| a.values.number(&format!("{id}/{what}"));
            let difference = apa::two(get("mean_diff")?);
            let ci = sentences::ci(a, &format!("{id}/ci95"), apa::two);
            let p = get("p_t_holm").map_or_else(String::new, |p| {
                format!(", paired t test p {} (Holm)", apa::p(p))
            });
            let later = match a.changed(PreregisteredRule::Margin) {
                true => " (changed after the study began)",
                false => "",
            };
            let equivalence = match (get("margin"), get("p_tost")) {
                (Some(margin), Some(p)) => {
                    let not = if significant(p) {
                        ""
                    } else {
                        "not shown to be "
                    };
                    let p = apa::p(p);
                    Some(format!(
                        "Within the margin of ± {margin}{later} they are {not}equivalent (two \
                         one-sided t tests, p {p})."
                    ))
                }
                _ => sentences::no_equivalence(a, &id),
            };
            let equivalence = equivalence.map_or_else(String::new, |e| format!(" {e}"));
            let reference = &m.id;
            Some(format!(
                "{best} minus {reference} over subjects: {difference}{ci}{p}.{equivalence}"
            ))
        })
        .collect()
}

/// Whether the best-rated realization differs from the second best.
fn best_two(a: &Analysis) -> Option<Answer> {
    let ranked = a.ranked();
    let [(mean, first), (next, second), ..] = ranked[..] else {
        return None;
    };
    let answer = |short| {
        Answer::new(
            "Does the best-rated realization differ from the second best?",
            short,
        )
    };
    if mean == next {
        let best = ranked.iter().take_while(|(m, _)| *m == mean);
        let best: Vec<String> = best.map(|(_, id)| (*id).to_owned()).collect();
        let (best, mean) = (apa::listing(&best), apa::two(mean));
        return Some(answer(format!(
            "Not shown: {best} share the highest mean, {mean}."
        )));
    }
    let compared = a.compared_pairs();
    let n = compared.pairs.len();
    let means = format!(
        "{first} (mean {}) and {second} (mean {})",
        apa::two(mean),
        apa::two(next)
    );
    let test = a.pair_test(first, second);
    let mut answer = answer(match test {
        Some(test) => {
            let verdict = sentences::verdict(test.p);
            let name = sentences::test_name(test.kind);
            let holm = match n {
                1 => String::new(),
                n => format!(", Holm's correction over {n} pairs"),
            };
            format!("{verdict}: {means}, p {} ({name}{holm}).", apa::p(test.p))
        }
        None if ranked.len() > MAX_PAIRED => format!(
            "Not tested: {means}; pairs are compared for at most {MAX_PAIRED} realizations, and \
             there are {}.",
            ranked.len()
        ),
        None => {
            let why = sentences::pair_not_tested(a, first, second);
            format!("Not tested: {means}; {why}.")
        }
    });
    let wilcoxon = test.filter(|t| t.kind == TestKind::WilcoxonExact);
    if let Some(p) = compared
        .smallest_p
        .filter(|p| wilcoxon.is_some() && !significant(*p))
    {
        answer.main.push(too_few_for_pairs(n, p));
    }
    let get = |statistic: &str| a.paired(first, second, statistic);
    if let (Some(d), Some(dz)) = (get("mean_diff"), get("dz")) {
        // The statistics are those of the difference by name.
        let sign = if first < second { 1.0 } else { -1.0 };
        let uncorrected = get("p_wilcoxon_exact").filter(|_| n > 1);
        let uncorrected = uncorrected.map_or_else(String::new, |p| {
            format!("; without the correction p {}", apa::p(p))
        });
        answer.more.push(format!(
            "{first} minus {second} over subjects: {} (Cohen's dz = {}){uncorrected}.",
            apa::two(sign * d),
            apa::two(sign * dz)
        ));
    }
    Some(answer)
}

/// Why no pair can be significant.
pub(super) fn too_few_for_pairs(pairs: usize, smallest_p: f64) -> String {
    format!(
        "With so few subjects Wilcoxon's test, corrected over {}, cannot give a p below {}: it could \
         not have shown a difference.",
        counted(pairs, "pair", "pairs"),
        apa::bare_p(smallest_p)
    )
}

/// Whether the realizations differ.
fn differ(a: &Analysis) -> Option<Answer> {
    let test = a.difference_test()?;
    let mut answer = Answer::new(
        "Do the realizations differ?",
        format!(
            "{}, p {} ({}).",
            sentences::verdict(test.p),
            apa::p(test.p),
            sentences::test_name(test.kind)
        ),
    );
    answer
        .main
        .extend(sentences::anova(a).map(|s| format!("{s}.")));
    answer
        .main
        .extend(sentences::friedman(a).map(|s| format!("{s}.")));
    answer.main.extend(sentences::mixed_model(a).map(|s| {
        let complete = apa::capital(&sentences::complete(a));
        format!(
            "Linear mixed model of all ratings, with an intercept for each subject: {s}. {complete} \
             rated every realization, too few for an analysis of variance or Friedman's test. The \
             model assumes that ratings are missing at random."
        )
    }));
    Some(answer)
}

/// The variance components.
fn variance(a: &Analysis) -> Option<Answer> {
    let shares = variance_shares(a);
    let all: Vec<String> = (shares.iter())
        .map(|(name, share)| format!("{name} {}", apa::percent(*share)))
        .collect();
    let mut answer = Answer::new(
        "Variance components",
        format!("{}.", apa::capital(&all.join(", "))),
    );
    answer.more.push(
        "The share of the realizations is the least precise: it rests on as many values as there \
         are realizations."
            .to_owned(),
    );
    (!shares.is_empty()).then_some(answer)
}

/// Name and share of each variance component: by expected mean squares, else of the
/// mixed model with crossed random effects.
pub(super) fn variance_shares(a: &Analysis) -> Vec<(&'static str, f64)> {
    let get = |id: &str| a.values.number(&format!("variance/share/{id}"));
    if let (Some(model), Some(subject)) = (get("model"), get("subject")) {
        let mut shares = vec![("realizations", model), ("subjects", subject)];
        match get("interaction").zip(get("noise")) {
            Some((interaction, noise)) => {
                shares.push(("subjects × realizations", interaction));
                shares.push(("within cells", noise));
            }
            None => shares.extend(
                get("interaction_and_noise").map(|x| ("subjects × realizations and noise", x)),
            ),
        }
        return shares;
    }
    let get = |id: &str| a.values.number(&format!("lmm_crossed/{id}"));
    let (Some(subject), Some(model), Some(error)) =
        (get("var_subject"), get("var_model"), get("sigma2"))
    else {
        return Vec::new();
    };
    let total = subject + model + error;
    if total <= 0.0 {
        return Vec::new();
    }
    vec![
        ("realizations", model / total),
        ("subjects", subject / total),
        ("within cells", error / total),
    ]
}

/// A slope on the order of the trials, with its t test.
struct Trend {
    slope: String,
    p: f64,
    /// Slope, standard error and test.
    text: String,
}

fn trend(a: &Analysis, id: &str) -> Option<Trend> {
    let get = |what: &str| a.values.number(&format!("{id}/{what}"));
    let (b, se, df, t, p) = (get("slope")?, get("se")?, get("df")?, get("t")?, get("p")?);
    let decimals = apa::decimals(se, 3);
    let slope = apa::number(b, decimals);
    let text = format!(
        "b = {slope}, SE = {}, t({}) = {}, p {}",
        apa::number(se, decimals),
        apa::number(df, 0),
        apa::two(t),
        apa::p(p)
    );
    Some(Trend { slope, p, text })
}

/// Whether ratings drift over the session.
fn order(a: &Analysis) -> Option<Answer> {
    let trial = trend(a, "order_trial")?;
    let mut answer = Answer::new(
        "Do order and learning matter?",
        format!(
            "{}: the change is {} points per trial, p {} (t test).",
            sentences::verdict(trial.p),
            trial.slope,
            apa::p(trial.p)
        ),
    );
    answer.more.push(format!(
        "Change per trial, adjusted for subjects and realizations: {}.",
        trial.text
    ));
    if let Some(previous) = trend(a, "order_previous_rating") {
        answer.main.push(format!(
            "Carry-over, the change per point of the preceding rating: {}.",
            previous.text
        ));
        answer.more.push(
            "The carry-over is biased slightly below 0, because the subjects' means are estimated: \
             a small negative value is not a finding."
                .to_owned(),
        );
    }
    Some(answer)
}
