//! What was found of a part that is no rating, in sentences: for the terminal page, the
//! report and a paper. Names in them are untrusted.

use super::{apa, sentences};
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis, PartFinding, PartQuestion};
use study_analysis::analyze::results::{Interval, Number as _, Stat};
use study_analysis::analyze::{Pair, Verdict};
use study_base::text::counted;
use study_stats::psychometric::{Core, Spacing};

/// The most pairs that a sentence lists.
const MAX_LISTED: usize = 12;

/// The answer to a question.
pub(super) struct Answered {
    pub(super) question: String,
    /// The verdict, in one sentence.
    pub(super) short: String,
    pub(super) more: Vec<String>,
}

/// The banner of a part whose answers are not those of real participants.
pub(super) fn banner(part: &PartAnalysis) -> Option<&'static str> {
    match (part.simulated, part.pilot) {
        (true, true) => Some("SIMULATED participants and PILOTS are included."),
        (true, false) => Some("SIMULATED participants are included."),
        (false, true) => Some("PILOTS are included."),
        (false, false) => None,
    }
}

/// The answers to all questions.
pub(super) fn answered(part: &PartAnalysis) -> Vec<Answered> {
    part.findings.iter().map(|f| answer(part, f)).collect()
}

fn answer(part: &PartAnalysis, f: &PartFinding) -> Answered {
    let verdict = sentences::verdict(&f.verdict);
    let question = asked(&f.question);
    let decided = || format!("{verdict}: {}.", result(part, f));
    let mut more: Vec<String> = f.caveats.iter().map(sentences::caveat).collect();
    if f.question == PartQuestion::Sessions {
        more.extend(retest(part));
    }
    if matches!(
        f.question,
        PartQuestion::Preferred | PartQuestion::Thresholds | PartQuestion::Magnitudes
    ) {
        more.extend(different(part));
    }
    Answered {
        question,
        short: sentences::undefined(f).unwrap_or_else(decided),
        more,
    }
}

/// The question of a finding.
fn asked(question: &PartQuestion) -> String {
    match question {
        PartQuestion::Preferred => "Is a realization preferred to another?".to_owned(),
        PartQuestion::PreferenceVaf => "Does VAF predict which is preferred?".to_owned(),
        PartQuestion::IntervalOrder => "Does the order of the intervals matter?".to_owned(),
        PartQuestion::ToldApart(condition) => {
            format!("{condition}: are standard and comparison told apart?")
        }
        PartQuestion::Thresholds => "Do thresholds differ between the conditions?".to_owned(),
        PartQuestion::Magnitudes => "Do the estimates differ between realizations?".to_owned(),
        PartQuestion::MagnitudeVaf => "Does VAF predict the estimates?".to_owned(),
        PartQuestion::Groups => "Do the groups differ?".to_owned(),
        PartQuestion::GroupsConditions => {
            "Does what distinguishes the conditions depend on the group?".to_owned()
        }
        PartQuestion::Sessions => "Do the sessions differ?".to_owned(),
    }
}

/// A question and the test that decides it, for a preregistration.
pub(super) fn declared(part: &PartAnalysis, f: &PartFinding) -> String {
    let question = format!("Part `{}`: {}", part.part, asked(&f.question));
    match &f.test {
        Some(test) => format!(
            "{question} Decided by: {}; level {}.",
            sentences::corrected(test),
            sentences::level(test.level)
        ),
        None => format!("{question} No test: {}.", f.reason().unwrap_or_default()),
    }
}

/// What the deciding test says: `r = .93, 95 % CI [.71, .98], p = .008 (permutation test,
/// exact, 5 realizations)`.
fn result(part: &PartAnalysis, f: &PartFinding) -> String {
    let tested = sentences::result(f).unwrap_or_default();
    let test = f
        .test
        .as_ref()
        .map_or_else(String::new, sentences::corrected);
    let people = sentences::participants(f.participants);
    let estimate = |format: fn(f64) -> String| {
        let e = f.estimate.as_ref();
        e.map_or_else(String::new, |e| sentences::estimate(e, format))
    };
    match &f.question {
        PartQuestion::Preferred => {
            let clearest = clearest(part).map_or(tested.clone(), |p| {
                let (first, second) = (&p.first, &p.second);
                // the statistic of the pair has the sign of the difference that is printed
                let of_pair = p.test.as_ref();
                let tested = of_pair.map_or(tested, |t| sentences::tested(t, f.participants));
                format!(
                    "{first} over {second} by {}, {tested}",
                    sentences::estimate(&p.difference, apa::two)
                )
            });
            format!("{clearest} ({test}, {people})")
        }
        PartQuestion::PreferenceVaf | PartQuestion::MagnitudeVaf => {
            let n = counted(f.realizations, "realization", "realizations");
            format!("r = {}, {tested} ({test}, {n})", estimate(apa::r))
        }
        PartQuestion::IntervalOrder => {
            let first = "for what is presented first";
            format!("{} {first}, {tested} ({test})", estimate(apa::two))
        }
        PartQuestion::ToldApart(_) => {
            format!(
                "mean d′ {}, {tested} ({test}, {people})",
                estimate(apa::two)
            )
        }
        PartQuestion::Thresholds | PartQuestion::Magnitudes => {
            format!("{tested} ({test}, {people})")
        }
        PartQuestion::Groups | PartQuestion::GroupsConditions | PartQuestion::Sessions => {
            let size = f.estimate.as_ref().map_or_else(String::new, |e| {
                format!("{} {}, ", e.name, sentences::estimate(e, apa::two))
            });
            format!("{size}{tested} ({test}, {people})")
        }
    }
}

/// The pair with the smallest p, the higher one first.
fn clearest(part: &PartAnalysis) -> Option<Pair> {
    let p = |pair: &&Pair| pair.test.as_ref().map_or(f64::INFINITY, |t| t.p);
    let pair = part.pairs.iter().min_by(|a, b| p(a).total_cmp(&p(b)))?;
    Some(upwards(pair))
}

/// A pair seen from the one with the higher value. Ratios stay as they are.
fn upwards(pair: &Pair) -> Pair {
    match pair.difference.value < 0.0 {
        true => pair.seen_from(&pair.second),
        false => pair.clone(),
    }
}

/// The pairs that differ.
fn different(part: &PartAnalysis) -> Option<String> {
    let differ = part.pairs.iter().filter(|p| p.verdict == Verdict::Yes);
    let differ: Vec<String> = differ.map(|pair| of_pair(&upwards(pair))).collect();
    let shown = differ.len().min(MAX_LISTED);
    let more = match differ.len() - shown {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    (!differ.is_empty()).then(|| {
        let n = counted(differ.len(), "pair differs", "pairs differ");
        format!(
            "Of {}, {n}: {}{more}.",
            part.pairs.len(),
            differ[..shown].join("; ")
        )
    })
}

fn of_pair(pair: &Pair) -> String {
    let p = pair
        .test
        .as_ref()
        .map_or_else(String::new, |t| format!(", {}", sentences::p(t)));
    let size = sentences::estimate(&pair.difference, apa::two);
    let joined = match pair.difference.name {
        "ratio" => format!("{} / {} = {size}", pair.first, pair.second),
        _ => format!("{} − {} = {size}", pair.first, pair.second),
    };
    format!("{joined}{p}")
}

/// What limits the part: warnings, and rules that could not be applied.
pub(super) fn caveats(part: &PartAnalysis) -> Vec<String> {
    let mut all: Vec<String> = part.warnings.iter().map(sentences::caveat).collect();
    for rule in &part.exclusions {
        if rule.rows > 0 {
            all.push(format!(
                "The rule {} excludes {} of {}.",
                rule.rule,
                counted(rule.rows, "trial", "trials"),
                counted(rule.participants, "participant", "participants")
            ));
        }
        if let Some(problem) = rule.problem {
            all.push(format!("The rule {}: {problem}.", rule.rule));
        }
    }
    all
}

/// The results, for a paper.
pub(super) fn results(part: &PartAnalysis) -> String {
    let mut text: Vec<String> = thresholds(part);
    text.extend(scores(part));
    text.extend(exponent(part));
    for f in &part.findings {
        let Some(test) = &f.test else { continue };
        let what = result(part, f);
        let significant = test.is_significant();
        text.push(match (&f.question, significant) {
            (PartQuestion::Preferred, true) => {
                format!("Preferences differed between realizations: {what}.")
            }
            (PartQuestion::Preferred, false) => {
                format!("No difference of preference between realizations was shown: {what}.")
            }
            (PartQuestion::PreferenceVaf, true) => {
                format!("Preference was correlated with VAF, {what}.")
            }
            (PartQuestion::PreferenceVaf, false) => {
                format!("No correlation of preference with VAF was shown, {what}.")
            }
            (PartQuestion::IntervalOrder, true) => {
                format!("The order of the intervals mattered, {what}.")
            }
            (PartQuestion::IntervalOrder, false) => {
                format!("No effect of the order of the intervals was shown, {what}.")
            }
            (PartQuestion::ToldApart(c), _) if f.is_yes() => {
                format!("{c}: standard and comparison were told apart, {what}.")
            }
            (PartQuestion::ToldApart(c), _) => {
                format!(
                    "{c}: it was not shown that standard and comparison are told apart, {what}."
                )
            }
            (PartQuestion::Magnitudes, true) => {
                format!("Estimates differed between realizations, {what}.")
            }
            (PartQuestion::Magnitudes, false) => {
                format!("No difference of estimates between realizations was shown, {what}.")
            }
            (PartQuestion::MagnitudeVaf, true) => {
                format!("Estimates (logarithms) were correlated with VAF, {what}.")
            }
            (PartQuestion::MagnitudeVaf, false) => {
                format!("No correlation of estimates (logarithms) with VAF was shown, {what}.")
            }
            (PartQuestion::Groups, true) => format!("The groups differed, {what}."),
            (PartQuestion::Groups, false) => {
                format!("No difference between the groups was shown, {what}.")
            }
            (PartQuestion::GroupsConditions, true) => {
                format!("The differences between the conditions depended on the group, {what}.")
            }
            (PartQuestion::GroupsConditions, false) => {
                format!("No interaction of group and condition was shown, {what}.")
            }
            (PartQuestion::Sessions, true) => format!("The sessions differed, {what}."),
            (PartQuestion::Sessions, false) => {
                format!("No difference between the sessions was shown, {what}.")
            }
            (PartQuestion::Thresholds, true) => {
                format!("Thresholds differed between conditions, {what}.")
            }
            (PartQuestion::Thresholds, false) => {
                format!("No difference of thresholds between conditions was shown, {what}.")
            }
        });
    }
    text.extend(retest(part));
    let pairs = part.findings.iter().any(|f| {
        let of_conditions = [PartQuestion::Thresholds, PartQuestion::Magnitudes];
        f.is_yes() && of_conditions.contains(&f.question)
    });
    text.extend(different(part).filter(|_| pairs));
    text.join(" ")
}

/// ", 95 % CI [.2, .4]" of an interval.
fn ci(ends: Option<(f64, f64)>, format: fn(f64) -> String) -> String {
    ends.map_or_else(String::new, |ends| {
        format!(", 95 % CI {}", apa::interval(ends, format))
    })
}

/// How alike the sessions are.
fn retest(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.again.retest.as_ref()?;
    let icc = |value: &Stat, ci95: &Interval| {
        let ci = ci(ci95.ends(), apa::two);
        Some(format!("{}{ci}", apa::two(value.number()?)))
    };
    Some(format!(
        "Test–retest reliability over {} participants: ICC(A,1) = {} (agreement), ICC(C,1) = {} \
         (consistency).",
        found.n.number()?,
        icc(&found.icc_agreement, &found.icc_agreement_ci95)?,
        icc(&found.icc_consistency, &found.icc_consistency_ci95)?
    ))
}

/// The thresholds of each condition.
fn thresholds(part: &PartAnalysis) -> Vec<String> {
    let all = part.results.over.psy_group.iter();
    all.filter_map(|(condition, found)| {
        let found = &found.posterior_threshold;
        Some(format!(
            "{}: the geometric mean of the thresholds was {}{} (n = {}).",
            condition.as_str(),
            apa::plain(found.geometric_mean.number()?),
            ci(found.ci95.ends(), apa::plain),
            found.n.number()?
        ))
    })
    .collect()
}

/// The exponent of estimated magnitudes of levels.
fn exponent(part: &PartAnalysis) -> Option<String> {
    let law = part.results.over.magnitude.as_ref()?.law.as_ref()?;
    let ci = ci(law.exponent_over_participants.ci95.ends(), apa::two);
    let over = if ci.is_empty() {
        ""
    } else {
        " over participants"
    };
    Some(format!(
        "Estimates were proportional to the level to the power of {}{ci}{over} (n = {}).",
        apa::two(law.exponent.number()?),
        part.participants
    ))
}

/// The mean score of a questionnaire.
fn scores(part: &PartAnalysis) -> Option<String> {
    let found = part.results.questionnaire.as_ref()?;
    Some(format!(
        "The mean score of the {} was {} (SD = {}, 95 % CI {}, median {}, n = {}).",
        questionnaire(part)?.0,
        apa::two(found.mean.number()?),
        apa::two(found.sd.number()?),
        apa::interval(found.ci95.ends()?, apa::two),
        apa::two(found.median.number()?),
        found.n.number()?
    ))
}

/// The name of a questionnaire, and how it is scored.
fn questionnaire(part: &PartAnalysis) -> Option<(&'static str, &'static str)> {
    match part.task {
        "sus" => Some((
            "System Usability Scale",
            "Participants filled in the System Usability Scale (Brooke, 1996) at the end; its score goes from 0 to \
             100, and more is better.",
        )),
        "nasa-tlx" => Some((
            "raw NASA Task Load Index",
            "Participants filled in the NASA Task Load Index (Hart & Staveland, 1988) at the end; its raw score, \
             without weights (Hart, 2006), is the mean of six ratings from 0 to 100, and more is more load.",
        )),
        _ => None,
    }
}

/// What was counted of a part: its trials, or its questionnaires.
pub(super) fn answers(part: &PartAnalysis) -> String {
    match questionnaire(part) {
        None => counted(part.trials, "trial", "trials"),
        Some(_) => counted(part.trials, "score", "scores"),
    }
}

/// The psychometric functions, by condition where they differ.
fn shapes(part: &PartAnalysis) -> String {
    let shape = |cell: &LevelData| match (cell.spacing, cell.core) {
        (Spacing::Lin, Core::Norm) => "a cumulative normal",
        (Spacing::Lin, Core::Logistic) => "a logistic function",
        (Spacing::Lin, Core::Gumbel) => "a Gumbel function",
        (Spacing::Lin, Core::ReversedGumbel) => "a reversed Gumbel function",
        (Spacing::Log, Core::Norm) => "a cumulative normal of the logarithm of the level",
        (Spacing::Log, Core::Logistic) => "a logistic function of the logarithm of the level",
        (Spacing::Log, Core::Gumbel) => "a Weibull function of the level",
        (Spacing::Log, Core::ReversedGumbel) => {
            "a reversed Gumbel function of the logarithm of the level"
        }
    };
    let mut conditions: Vec<(&str, &str)> = (part.data.levels.iter())
        .map(|cell| (cell.condition.as_str(), shape(cell)))
        .collect();
    conditions.sort_unstable();
    conditions.dedup();
    match &conditions[..] {
        [] => "a cumulative normal".to_owned(),
        [first, others @ ..] if others.iter().all(|o| o.1 == first.1) => first.1.to_owned(),
        all => {
            let each: Vec<String> = (all.iter())
                .map(|(condition, shape)| format!("{shape} ({condition})"))
                .collect();
            apa::listing(&each)
        }
    }
}

/// How the numbers were computed, for a paper.
pub(super) fn methods(part: &PartAnalysis) -> String {
    let (results, over) = (&part.results, &part.results.over);
    let mut text = Vec::new();
    if !results.psy.is_empty() {
        text.push(format!(
            "The psychometric function of each participant and condition was {} with \
             beta-binomial errors; thresholds are posterior means with equal-tailed 95 % intervals \
             (Schütt et al., 2016), at half the height between guesses and lapses.",
            shapes(part)
        ));
    }
    if let Some((_, how)) = questionnaire(part) {
        text.push(how.to_owned());
    }
    if over.magnitude.is_some() {
        text.push(
            "Estimates of magnitude were averaged as logarithms, after the participants' own means were made equal \
             (Lane et al., 1961)."
                .to_owned(),
        );
    }
    if results.magnitude_mixed.is_some() {
        text.push(
            "Realizations were compared by a linear mixed model of the logarithms with an intercept for each \
             participant (REML; F with Satterthwaite's degrees of freedom, contrasts by Kenward and Roger's method with Holm's correction)."
                .to_owned(),
        );
    }
    if over.psy_mixed.is_some() {
        text.push(
            "Conditions were compared by a linear mixed model with an intercept for each participant \
             (REML; F with Satterthwaite's degrees of freedom, contrasts by Kenward and Roger's method with Holm's correction)."
                .to_owned(),
        );
    }
    if !results.sdt.is_empty() {
        text.push(
            "Sensitivities d′ are from rates after the log-linear correction (Hautus, 1995)."
                .to_owned(),
        );
    }
    if over.again.groups.is_some() {
        text.push(
            "Groups were compared by Welch's analysis of variance of one mean for each participant, over what \
             all groups have."
                .to_owned(),
        );
    }
    if over.again.groups_conditions.is_some() {
        text.push(
            "Whether conditions depend on the group is the interaction of both in an analysis of variance between \
             and within participants, with the Greenhouse–Geisser correction."
                .to_owned(),
        );
    }
    if over.again.sessions.is_some() {
        text.push(
            "Sessions were compared by a linear mixed model with an intercept for each participant; intraclass \
             correlations are those of single sessions (Shrout & Fleiss, 1979)."
                .to_owned(),
        );
    }
    if let Some(pairs) = results.pairs.as_ref().filter(|p| !p.items.0.is_empty()) {
        let ties = match &pairs.ties {
            Some(_) => ", with ties (Davidson, 1970)",
            None => "",
        };
        text.push(format!(
            "Preferences were fitted by the model of Bradley and Terry (1952){ties}, by maximum \
             likelihood; abilities are logarithms of odds."
        ));
    }
    text.push(format!(
        "The level of significance is {}, two-sided. The analysis was done with study {}.",
        sentences::level(part.alpha),
        env!("CARGO_PKG_VERSION")
    ));
    text.join(" ")
}
