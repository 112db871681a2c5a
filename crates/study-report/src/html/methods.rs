//! The methods paragraph: conduct of the sessions, exclusions, and the tests that were
//! done.

use super::Details;
use crate::{apa, sentences};
use study_analysis::analyze::results::{Differences, Number};
use study_analysis::analyze::{Analysis, Better, PreregisteredRule, Question, TestKind};
use study_base::text::{capital, counted};
use study_stats::permutation::DRAWS;

/// The paragraph.
pub(super) fn paragraph(d: &Details, a: &Analysis) -> String {
    let mut text = design(d, a);
    if a.better == Better::Lower {
        text.push("Lower ratings are better.".to_owned());
    }
    text.extend(exclusions(a));
    text.extend(tests(a));
    text.extend(complete_only(a));
    let described = || a.tested().filter_map(|m| a.described(&m.id));
    if described().any(|d| d.sd.number().is_some()) {
        let sd = "Standard deviations are over all ratings of a realization (n − 1)";
        let intervals = if described().any(|d| d.subject_mean.ci95.ends().is_some()) {
            "; confidence intervals of means are t intervals over participants"
        } else {
            ""
        };
        text.push(format!("{sd}{intervals}."));
    }
    text.push(format!(
        "The level of significance is {}, two-sided. The analysis was done with study {}.",
        sentences::level(a.alpha),
        env!("CARGO_PKG_VERSION")
    ));
    text.join(" ")
}

/// The analyses restricted to participants who rated everything, unless all did.
fn complete_only(a: &Analysis) -> Option<String> {
    let (all, complete) = (a.design.participants, a.design.complete);
    let evidence = &a.results.evidence;
    let Differences {
        rmanova, friedman, ..
    } = &evidence.differences;
    let shares = evidence.variance.share.as_ref().map(|s| &s.model);
    let defined = |stat: &dyn Number| stat.number().is_some();
    let compared = a.design.uses_complete();
    let done: Vec<String> = [
        (defined(&rmanova.f) && compared, "the analysis of variance"),
        (defined(&friedman.chi2), "Friedman's test"),
        (!a.pairs.is_empty() && compared, "the comparison of pairs"),
        (defined(&shares) && compared, "the variance components"),
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
    text.extend(sample(d));
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
            format!("A rating of {from} or higher counts as realistic, a threshold that was set in advance.")
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
/// The sample and the ethics approval, with placeholders for what the study does not say.
fn sample(d: &Details) -> Vec<String> {
    let mut text = d.sample.clone();
    text.push(
        match d.sample.is_empty() {
            true => "[Participants: age, gender, handedness, recruitment, compensation.]",
            false => "[Participants: recruitment, compensation.]",
        }
        .to_owned(),
    );
    text.push(match &d.ethics {
        Some(approval) => format!("Ethics: {approval}."),
        None => "[Ethics approval and consent.]".to_owned(),
    });
    text
}

fn ratings(d: &Details, a: &Analysis) -> String {
    let c = &a.counts;
    let all = |one, many| counted(c.with_ratings, one, many);
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
    let described = a.tested().filter_map(|m| a.described(&m.id));
    let rated = described.filter(|d| d.n.number() > Some(0.0)).count();
    let without = match c.participants - c.with_ratings {
        0 => String::new(),
        n => format!(" {n} more took part but gave no rating."),
    };
    let realizations = counted(tested, "realization", "realizations");
    if c.rated == 0 {
        "No rating is included: there is nothing to analyze.".to_owned()
    } else if tested == 0 {
        let ratings = counted(c.rated, "rating", "ratings");
        format!("{participants}{others} gave {ratings}.{without}")
    } else if rated < tested {
        format!(
            "{participants}{others} rated {rated} of {realizations}{times}; nobody rated the others.{without}"
        )
    } else {
        format!("{participants}{others} rated {realizations}{times}.{without}")
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
                format!("{} ({rows} of {participants})", e.rule.words())
            })
            .collect();
        let rules = apa::listing(&rules);
        text.push(if a.changed(PreregisteredRule::Exclusions) {
            format!(
                "The exclusion rules were changed after the study began (see Deviations); they now \
                 exclude {rules}."
            )
        } else {
            format!("The rules that were set in advance exclude {rules}.")
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

/// The factorial design, and how its effects were tested.
fn factors(a: &Analysis) -> Option<String> {
    let crossing = a.crossing.as_ref()?;
    let mut factors: Vec<String> = (crossing.factors.iter())
        .map(|factor| format!("{} ({})", factor.id, factor.levels.join(", ")))
        .collect();
    if !crossing.groups.is_empty() {
        factors.push(format!(
            "group between participants ({})",
            crossing.groups.join(", ")
        ));
    }
    let n = crossing.effects.len();
    let effects = match n {
        1 => "Its effect was".to_owned(),
        n => format!("{} effects were", capital(&apa::count(n))),
    };
    let correction = match n {
        1 => "",
        _ => ", and Holm's correction over the effects",
    };
    let mut decided =
        (a.results.evidence.factorial.iter()).flat_map(|tests| tests.effects.values());
    if decided.any(|effect| effect.clustered.is_some()) {
        return Some(format!(
            "The factors were {}. Because only {} of {} rated every realization, {} tested within participants, from all \
             cell means with participants and realizations as fixed factors, by t tests of the contrasts of the effect with standard \
             errors clustered by participant (Pustejovsky & Tipton, 2018), Bonferroni's correction over these{correction}.{}",
            apa::listing(&factors),
            a.design.complete,
            counted(a.design.participants, "participant", "participants"),
            effects.to_lowercase(),
            equivalent_levels(a)
        ));
    }
    Some(format!(
        "The factors were {}. {effects} tested by a repeated-measures analysis of variance of the participants' \
         means in each combination of levels, each effect within participants against its own interaction with \
         participants, with the Greenhouse–Geisser correction{correction}; simple effects by t tests over \
         participants with Holm's correction. An aligned rank transform (Wobbrock et al., 2011) is given besides.{}",
        apa::listing(&factors),
        equivalent_levels(a)
    ))
}

/// How the levels of factors were tested for equivalence; nothing without a margin.
fn equivalent_levels(a: &Analysis) -> String {
    let tests = a.results.evidence.factorial.as_ref();
    let contrasts = tests.map(|tests| tests.contrasts.values());
    let is_tested = contrasts.is_some_and(|mut all| all.any(|c| c.equivalence.is_some()));
    let Some(margin) = a.equivalence_margin.filter(|_| is_tested) else {
        return String::new();
    };
    let stated = match a.changed(PreregisteredRule::Margin) {
        true => "was changed after the study began (see Deviations)",
        false => "was set in advance",
    };
    format!(
        " Levels were tested for equivalence by two one-sided t tests (Schuirmann, 1987) with a margin of {margin} points, which \
         {stated}, with Holm's correction over the pairs of levels of a factor."
    )
}

/// What was measured besides the ratings, and how it was tested.
fn outcomes(a: &Analysis) -> Option<String> {
    let named: Vec<String> = a.outcomes.iter().map(|o| o.rules.in_words()).collect();
    let by = match a.crossing {
        Some(_) => "by the factors in the same way",
        None => "between the realizations in the same way",
    };
    let besides = match a.outcomes.iter().any(|o| o.rules.model.is_some()) {
        true => {
            " Generalized mixed models of single trials with random intercepts of participants, of their cells where \
             they repeat or are counts, and of participants at the levels of the factors where there are several, are given \
             besides and decide nothing."
        }
        false => "",
    };
    (!named.is_empty()).then(|| {
        format!(
            "Measured besides: {}. They were compared {by}, in the trials whose rating was analyzed, with Holm's \
             correction over the tests of all of them.{besides}",
            apa::listing(&named)
        )
    })
}

/// The errors of comparisons within participants.
fn clustered(a: &Analysis) -> &'static str {
    match a.results.evidence.cells.clustered {
        Some(_) if a.design.participants > a.design.realizations => {
            " with errors clustered by participant (CR2; Pustejovsky & Tipton, 2018) and the Greenhouse–Geisser correction"
        }
        Some(_) => {
            " with errors clustered by participant (CR2; Pustejovsky & Tipton, 2018) and the Huynh–Feldt correction"
        }
        None => "",
    }
}

/// How differences between realizations were tested.
fn differences(a: &Analysis) -> Option<String> {
    let test = a.finding(&Question::Differ)?.test.as_ref()?;
    let correction = |name: &str| format!(" with the {name} correction");
    let anova = "a repeated-measures analysis of variance on the cell means";
    let friedman = "Friedman's test with mid-ranks";
    let by = match test.kind {
        TestKind::Anova => anova.to_owned(),
        TestKind::AnovaGreenhouseGeisser => anova.to_owned() + &correction("Greenhouse–Geisser"),
        TestKind::AnovaHuynhFeldt => {
            anova.to_owned()
                + &correction("Huynh–Feldt")
                + ", because there are not more participants than realizations"
        }
        TestKind::WithinParticipants => format!(
            "an analysis of variance of all cell means with participants and realizations as fixed factors \
             (comparisons within participants){}, because only {} of {} rated every realization",
            clustered(a),
            a.design.complete,
            counted(a.design.participants, "participant", "participants")
        ),
        _ => friedman.to_owned(),
    };
    let besides = match test.kind {
        TestKind::Friedman | TestKind::FriedmanExact => String::new(),
        _ => match a.results.evidence.differences.friedman.chi2.number() {
            Some(_) => format!("; {friedman} is given besides"),
            None => String::new(),
        },
    };
    Some(format!(
        "Differences between realizations were tested by {by}{besides}."
    ))
}

/// How disagreement was tested.
fn disagreement(a: &Analysis) -> Option<String> {
    let test = a.finding(&Question::Disagreement)?.test.as_ref()?;
    let by = match test.kind {
        TestKind::Interaction => {
            "the interaction of participants and realizations against the variance within cells"
        }
        _ => "the differences between their slopes on VAF against the rest of the interaction",
    };
    Some(format!(
        "Whether participants disagree about the realizations was tested by F of {by}."
    ))
}

/// The tests whose results are defined.
fn tests(a: &Analysis) -> Vec<String> {
    let evidence = &a.results.evidence;
    let defined = |stat: &dyn Number| stat.number().is_some();
    let finding = |question: &Question| a.finding(question);
    let mut text = Vec::new();
    if let Some(test) = finding(&Question::Vaf).and_then(|f| f.test.as_ref()) {
        let p = match test.kind {
            TestKind::PermutationExact => "p is from all permutations of the realizations".to_owned(),
            TestKind::WeightedTrend => "because not all means are equally precise, p is from the slope on VAF \
                 by generalized least squares with the covariance of the means and a variance of the \
                 realizations about the line (Knapp & Hartung 2003)"
                .to_owned(),
            _ => format!("p is from {DRAWS} random permutations of the realizations"),
        };
        let means = if a.design.is_complete() {
            "means of the realizations (averages of the participants' cell means)"
        } else {
            "adjusted means of the realizations (what a mean participant would rate, by comparisons \
             within participants)"
        };
        text.push(format!(
            "Whether the variance accounted for (VAF) predicts the rating was tested by Pearson's \
             correlation over the {means}; {p}."
        ));
    }
    text.extend(factors(a));
    text.extend(outcomes(a));
    text.extend(differences(a));
    let wilcoxon = (a.results.posthoc.values()).any(|p| defined(&p.p_wilcoxon_exact));
    let test = finding(&Question::Pairs).and_then(|f| f.test.as_ref());
    let test = test.or_else(|| finding(&Question::Best)?.test.as_ref());
    if let Some(test) = test {
        let how = match test.kind {
            TestKind::WithinContrast => "t tests within participants, by the same model",
            _ => "paired t tests",
        };
        let wilcoxon = if wilcoxon {
            "; p of Wilcoxon's signed-rank test (exact, conditional on ties) is given besides"
        } else {
            ""
        };
        text.push(match test.comparisons {
            0 | 1 => format!("The pair was compared by {how}{wilcoxon}."),
            n => format!(
                "Pairs were compared by {how} with Holm's correction over all {n} pairs{wilcoxon}. \
                 The two {} means were also compared by themselves, two-sided and without a \
                 correction, which keeps the level for the claim that one is the best (Gutmann & \
                 Maymin, 1987; Hung & Fithian, 2019).",
                a.better.most()
            ),
        });
    }
    text.extend(disagreement(a));
    let crossed = &evidence.crossed;
    if defined(&crossed.coefficients.slope) {
        let effects = if defined(&crossed.var_subject_model) {
            ", realizations and their combinations"
        } else {
            " and realizations"
        };
        text.push(format!(
            "A linear mixed model of the ratings on VAF with random intercepts of participants{effects} \
             was fitted by restricted maximum likelihood, with Satterthwaite's degrees of freedom."
        ));
    }
    let agreement = &a.results.agreement;
    let between = defined(&agreement.icc_subjects.icc2.value)
        .then(|| "Agreement between participants is ICC(2,1) over cell means".to_owned());
    let within = defined(&agreement.icc_repetitions.icc.icc1.value)
        .then(|| "consistency over repetitions is ICC(1,1)".to_owned());
    let iccs: Vec<String> = [between, within].into_iter().flatten().collect();
    if !iccs.is_empty() {
        text.push(format!(
            "{} (Shrout and Fleiss), with F intervals.",
            capital(&iccs.join(", "))
        ));
    }
    if !a.sites.is_empty() {
        text.push(format!(
            "Participants of {} (site as a factor between participants) were analyzed together. Whether \
             the differences between realizations depend on the site was tested by the interaction in \
             an analysis of variance between and within participants with the Greenhouse–Geisser \
             correction; means and slopes on VAF of the participants were compared by analyses of \
             variance between sites.",
            apa::listing(&a.sites)
        ));
    }
    let mut references = evidence.references.reference.values().flatten();
    if references.any(|(_, test)| defined(&test.p_tost)) {
        let margin = if a.changed(PreregisteredRule::Margin) {
            "a margin that was changed after the study began (see Deviations)"
        } else {
            "a margin that was set in advance"
        };
        text.push(format!(
            "Equivalence with the reference was tested by two one-sided t tests with {margin}."
        ));
    }
    if let Some(equivalence) = &evidence.equivalence.r
        && let (Some(margin), Some(_)) = (equivalence.margin.number(), equivalence.p.number())
    {
        text.push(format!(
            "Whether the correlation with VAF lies within ± {} was tested by two one-sided tests of Fisher's \
             z (Goertzen & Cribbie, 2010).",
            apa::share(margin, 2)
        ));
    }
    text
}
