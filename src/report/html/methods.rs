//! The methods paragraph: conduct of the sessions, exclusions, and the tests that were
//! done.

use super::Details;
use crate::report::{apa, sentences};
use study_base::text::counted;
use study_core::analyze::{Analysis, Exclusion, PreregisteredRule, TestKind, Value};
use study_stats::permutation::DRAWS;

/// The paragraph.
pub(super) fn paragraph(d: &Details, a: &Analysis) -> String {
    let mut text = design(d, a);
    text.extend(exclusions(a));
    text.extend(tests(a));
    text.extend(complete_only(a));
    let any = |what: &str| a.tested().any(|m| a.described(&m.id, what).is_some());
    if any("sd") {
        let sd = "Standard deviations are over all ratings of a realization (n − 1)";
        let intervals = if any("subject_mean/ci95_lo") {
            "; confidence intervals of means are t intervals over subjects"
        } else {
            ""
        };
        text.push(format!("{sd}{intervals}."));
    }
    text.push(format!(
        "The level of significance is .05, two-sided. The analysis was done with study {}.",
        env!("CARGO_PKG_VERSION")
    ));
    text.join(" ")
}

/// The analyses restricted to participants who rated everything, unless all did.
fn complete_only(a: &Analysis) -> Option<String> {
    let v = &a.values;
    let all = v.number("design/n_subjects")?;
    let complete = v.number("design/n_subjects_complete")?;
    let defined = |id: &str| v.number(id).is_some();
    let done: Vec<String> = [
        (defined("rmanova/F"), "the analysis of variance"),
        (defined("friedman/chi2"), "Friedman's test"),
        (
            !a.compared_pairs().pairs.is_empty(),
            "the comparison of pairs",
        ),
        (defined("variance/share/model"), "the variance components"),
    ]
    .into_iter()
    .filter(|(done, _)| *done)
    .map(|(_, what)| what.to_owned())
    .collect();
    (complete < all && !done.is_empty()).then(|| {
        format!(
            "Of the {all} participants, {complete} rated every realization; only they are included in \
             {}.",
            apa::listing(&done)
        )
    })
}

/// Participants, realizations, order, device and question.
fn design(d: &Details, a: &Analysis) -> Vec<String> {
    let mut text = vec![ratings(d, a)];
    let others: Vec<String> = (a.realizations.iter())
        .filter(|m| !m.tested)
        .map(|m| match &m.duplicate_of {
            Some(of) => format!("{} (a hidden duplicate of {of})", m.id),
            None => format!("{} ({})", m.id, m.role.as_str().replace('-', " ")),
        })
        .collect();
    if !others.is_empty() {
        text.push(format!(
            "Also rated, but not included in the tests: {}.",
            apa::listing(&others)
        ));
    }
    if let Some(order) = &d.order {
        text.push(format!(
            "The order of trials was {order}, fixed before each session."
        ));
    }
    text.extend(d.conduct.iter().cloned());
    if let Some(reference) = &d.reference {
        text.push(format!(
            "Before each trial the screen showed: “{reference}”"
        ));
    }
    if let Some(prompt) = &d.prompt {
        let scale = a.scale.map_or_else(String::new, |(from, to)| {
            let label = |at: f64| {
                let label = d.labels.iter().find(|l| l.0 == at);
                label.map_or_else(String::new, |l| format!(" (“{}”)", l.1))
            };
            format!(
                " on a scale from {from}{} to {to}{}",
                label(from),
                label(to)
            )
        });
        text.push(format!(
            "After each trial participants answered the question “{prompt}”{scale}."
        ));
    }
    if let Some(from) = a.realistic_from {
        text.push(if a.changed(PreregisteredRule::RealisticFrom) {
            format!(
                "A rating of {from} or higher counts as realistic; this threshold was changed after \
                 the study began (see Deviations)."
            )
        } else {
            format!("A rating of {from} or higher was preregistered to count as realistic.")
        });
    }
    if d.states.iter().any(|(state, _)| state != "done") {
        let all: Vec<String> = (d.states.iter())
            .map(|(state, n)| format!("{n} {state}"))
            .collect();
        text.push(format!("States of all sessions: {}.", apa::listing(&all)));
    }
    text
}

/// How many participants rated how many realizations how often.
fn ratings(d: &Details, a: &Analysis) -> String {
    let c = &a.counts;
    let all = |one, many| counted(c.participants, one, many);
    let pilots = counted(c.pilots, "pilot", "pilots");
    let (participants, others) = match (c.pilots, c.simulated) {
        (_, s) if s > 0 && s == c.participants => (
            all(
                "simulated participant (no person)",
                "simulated participants (no people)",
            ),
            String::new(),
        ),
        (p, _) if p > 0 && p == c.participants => (
            all("pilot participant", "pilot participants"),
            String::new(),
        ),
        (0, 0) => (all("participant", "participants"), String::new()),
        (_, 0) => (all("participant", "participants"), format!(" ({pilots})")),
        (0, s) => (
            all("participant", "participants"),
            format!(" ({s} simulated)"),
        ),
        (_, s) => (
            all("participant", "participants"),
            format!(" ({pilots} and {s} simulated)"),
        ),
    };
    let times = d.repetitions.map_or_else(String::new, |n| match n {
        1 => " once each".to_owned(),
        2 => " twice each".to_owned(),
        n => format!(" {n} times each"),
    });
    let tested = a.tested().count();
    let has_ratings = |id: &str| a.described(id, "n").is_some_and(|n| n > 0.0);
    let rated = a.tested().filter(|m| has_ratings(&m.id)).count();
    let realizations = counted(tested, "realization", "realizations");
    if c.rated == 0 {
        "No rating is included: there is nothing to analyse.".to_owned()
    } else if tested == 0 {
        let ratings = counted(c.rated, "rating", "ratings");
        format!("{participants}{others} gave {ratings}.")
    } else if rated < tested {
        format!(
            "{participants}{others} rated {rated} of {realizations}{times}; nobody rated the others."
        )
    } else {
        format!("{participants}{others} rated {realizations}{times}.")
    }
}

/// An exclusion rule as a noun phrase.
pub(super) fn rule_in_words(rule: Exclusion) -> String {
    match rule {
        Exclusion::ConstantRater => "participants whose ratings never change".to_owned(),
        Exclusion::HiddenReferenceBelow(rating) => {
            format!("participants whose mean rating of the hidden references is below {rating}")
        }
        Exclusion::StrokesBelow(strokes) => {
            format!("trials with fewer than {strokes} full strokes")
        }
        Exclusion::Inconsistent(difference) => format!(
            "participants whose mean ratings of a realization and its hidden duplicate differ by more \
             than {difference} on average"
        ),
    }
}

/// The exclusion rules and their effects.
fn exclusions(a: &Analysis) -> Vec<String> {
    let c = &a.counts;
    let mut text = Vec::new();
    if !a.exclusions.is_empty() {
        let rules: Vec<String> = (a.exclusions.iter())
            .map(|e| {
                let rows = counted(e.rows, "row", "rows");
                let participants = counted(e.participants, "participant", "participants");
                format!("{} ({rows} of {participants})", rule_in_words(e.rule))
            })
            .collect();
        let rules = apa::listing(&rules);
        text.push(if a.changed(PreregisteredRule::Exclusions) {
            format!(
                "The exclusion rules were changed after the study began (see Deviations); they now \
                 exclude {rules}."
            )
        } else {
            format!("The preregistered rules exclude {rules}.")
        });
    }
    let by_rules: usize = a.exclusions.iter().map(|e| e.rows).sum();
    let rows: usize = c.excluded.values().sum();
    if rows > by_rules {
        text.push(format!(
            "In total, {} of {} excluded; “Included and excluded data” lists the reasons.",
            counted(rows, "row", "rows"),
            counted(
                c.excluded_participants,
                "participant is",
                "participants are"
            )
        ));
    }
    if c.without_rating > 0 {
        text.push(format!(
            "{} no rating.",
            counted(
                c.without_rating,
                "included trial has",
                "included trials have"
            )
        ));
    }
    text
}

/// The tests whose results are defined.
fn tests(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let defined = |id: &str| v.number(id).is_some();
    let any = |start: &str, end: &str| {
        v.iter().any(|(id, value)| {
            id.starts_with(start) && id.ends_with(end) && matches!(value, Value::Number(_))
        })
    };
    let mut text = Vec::new();
    if defined("corr/pearson/r") {
        let p = match a.permutation_test("pearson").map(|t| t.kind) {
            None => String::new(),
            Some(TestKind::PermutationExact) => {
                "; p is from all permutations of the realizations".to_owned()
            }
            Some(_) => format!("; p is from {DRAWS} random permutations of the realizations"),
        };
        text.push(format!(
            "Whether the variance accounted for (VAF) predicts the rating was tested by Pearson's \
             correlation over the means of the realizations (averages of the subjects' cell \
             means){p}."
        ));
    }
    let anova = "a repeated-measures analysis of variance on the cell means with the \
                 Greenhouse–Geisser correction";
    let friedman = "Friedman's test with mid-ranks";
    let complete = sentences::complete(a);
    let differences = match (defined("rmanova/F"), defined("friedman/chi2")) {
        (true, true) => Some(format!("{anova} and by {friedman}")),
        (true, false) => Some(anova.to_owned()),
        (false, true) => Some(friedman.to_owned()),
        (false, false) => sentences::mixed_model(a).map(|_| {
            format!(
                "a linear mixed model of all ratings with an intercept for each subject and \
                 Satterthwaite's degrees of freedom, because {complete} rated every realization"
            )
        }),
    };
    text.extend(
        differences.map(|d| format!("Differences between realizations were tested by {d}.")),
    );
    let pair_test = if any("posthoc/", "/p_wilcoxon_exact") {
        "by Wilcoxon's signed-rank test (exact, conditional on ties) and by paired t tests"
    } else {
        "by paired t tests"
    };
    match a.compared_pairs().pairs.len() {
        0 => {}
        1 => text.push(format!("The pair was compared {pair_test}.")),
        n => text.push(format!(
            "The {n} pairs were compared {pair_test}, each with Holm's correction over all pairs."
        )),
    }
    if defined("lmm_vaf_crossed/slope") {
        let effects = if defined("lmm_vaf_crossed/var_subject_model") {
            ", realizations and their combinations"
        } else {
            " and realizations"
        };
        text.push(format!(
            "A linear mixed model of the ratings on VAF with random intercepts of subjects{effects} \
             was fitted by restricted maximum likelihood, with Satterthwaite's degrees of freedom."
        ));
    }
    let between = defined("icc_subjects/ICC2")
        .then(|| "Agreement between subjects is ICC(2,1) over cell means".to_owned());
    let within = defined("icc_repetitions/ICC1")
        .then(|| "consistency over repetitions is ICC(1,1)".to_owned());
    let iccs: Vec<String> = [between, within].into_iter().flatten().collect();
    if !iccs.is_empty() {
        text.push(format!(
            "{} (Shrout and Fleiss), with F intervals.",
            apa::capital(&iccs.join(", "))
        ));
    }
    if any("reference/", "/p_tost") {
        let margin = if a.changed(PreregisteredRule::Margin) {
            "a margin that was changed after the study began (see Deviations)"
        } else {
            "the preregistered margin"
        };
        text.push(format!(
            "Equivalence with the reference was tested by two one-sided t tests with {margin}."
        ));
    }
    text
}
