//! The methods paragraph: how the sessions were run, what was left out, and the
//! tests that there are numbers of; no others.

use super::Details;
use crate::report::apa;
use study_core::analyze::{Analysis, Exclusion, Listed, PreregisteredRule, Value};
use study_stats::permutation::DRAWS;

/// The paragraph.
pub(super) fn paragraph(d: &Details, a: &Analysis) -> String {
    let mut said = conduct(d, a);
    said.extend(tests_done(a));
    said.extend(complete_only(a));
    let any = |what: &str| {
        let id = |m: &Listed| format!("desc/{}/{what}", m.id);
        let tests = super::answers::tests(a);
        tests.iter().any(|m| a.values.number(&id(m)).is_some())
    };
    if any("sd") {
        let sd = "Standard deviations are over all ratings of a realization (n − 1)";
        said.push(if any("subject_mean/ci95_lo") {
            format!("{sd}; intervals of means are t intervals over subjects.")
        } else {
            format!("{sd}.")
        });
    }
    said.push(format!(
        "The level of significance is .05, two-sided. The analysis was done with study {}.",
        env!("CARGO_PKG_VERSION")
    ));
    said.join(" ")
}

/// Whose ratings stand behind what needs complete tables, where not all are complete.
fn complete_only(a: &Analysis) -> Option<String> {
    let v = &a.values;
    let all = v.number("design/n_subjects")?;
    let complete = v.number("design/n_subjects_complete")?;
    let (pairs, _) = crate::report::pairs(a);
    let done: Vec<String> = [
        (v.number("rmanova/F").is_some(), "the analysis of variance"),
        (v.number("friedman/chi2").is_some(), "Friedman's test"),
        (!pairs.is_empty(), "the comparison of pairs"),
        (
            v.number("variance/share/model").is_some(),
            "the shares of variance",
        ),
    ]
    .into_iter()
    .filter(|(done, _)| *done)
    .map(|(_, what)| what.to_owned())
    .collect();
    (complete < all && !done.is_empty()).then(|| {
        format!(
            "Of the {all} participants, {complete} rated every realization: only they are in {}.",
            apa::listing(&done)
        )
    })
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
    let rated = |m: &&&Listed| {
        let n = a.values.number(&format!("desc/{}/n", m.id));
        n.is_some_and(|n| n > 0.0)
    };
    let rated = tests.iter().filter(rated).count();
    said.push(if c.rated == 0 {
        "No rating counts: there is nothing to analyse.".to_owned()
    } else if tests.is_empty() {
        let ratings = apa::counted(c.rated, "rating", "ratings");
        format!("{who}{others} gave {ratings}.")
    } else {
        let what = apa::counted(tests.len(), "realization", "realizations");
        if rated < tests.len() {
            format!("{who}{others} rated {rated} of {what}{times}; nobody rated the others.")
        } else {
            format!("{who}{others} rated {what}{times}.")
        }
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
        said.push(if a.changed(PreregisteredRule::RealisticFrom) {
            format!(
                "A rating of {from} or higher counts as realistic; this was changed after the study \
                 began (see Deviations)."
            )
        } else {
            format!("A rating of {from} or higher was said beforehand to count as realistic.")
        });
    }
    if d.states.iter().any(|(state, _)| state != "done") {
        let all: Vec<String> = (d.states.iter())
            .map(|(state, n)| format!("{n} {state}"))
            .collect();
        said.push(format!("States of all sessions: {}.", apa::listing(&all)));
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

/// What was to be left out, since when, and what was left out.
fn left_out(a: &Analysis) -> Vec<String> {
    let c = &a.counts;
    let mut said = Vec::new();
    if !a.exclusions.is_empty() {
        let rules: Vec<String> = a
            .exclusions
            .iter()
            .map(|e| {
                let rows = apa::counted(e.rows, "row", "rows");
                let who = apa::counted(e.participants, "participant", "participants");
                format!("{} ({rows} of {who})", in_words(e.rule))
            })
            .collect();
        let rules = apa::listing(&rules);
        said.push(if a.changed(PreregisteredRule::Exclusions) {
            format!(
                "The rules of exclusion were changed after the study began (see Deviations); now \
                 they leave out {rules}."
            )
        } else {
            format!("It was stated beforehand to leave out {rules}.")
        });
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
    if crate::report::mixed_f(a).is_some() {
        said.push(format!(
            "Differences between realizations were tested by a linear mixed model of all ratings with \
             an intercept for each subject, with Satterthwaite's degrees of freedom, because {} rated \
             every realization.",
            crate::report::complete(a)
        ));
    }
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
        let margin = if a.changed(PreregisteredRule::Margin) {
            "a margin that was changed after the study began (see Deviations)"
        } else {
            "the margin stated beforehand"
        };
        said.push(format!(
            "Equivalence with the reference was tested by two one-sided t tests at {margin}."
        ));
    }
    said
}
