//! What was found of a part that is no rating, in sentences: for the terminal page, the
//! report and a paper. Names in them are untrusted.

mod again;
mod rankings;

use super::answers::Answer;
use super::{apa, sentences, wording};
use again::{changes, retest};
use rankings::{of_one_order, ranks};
use study_analysis::analyze::psychophysics::results::LabelPair;
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis, PartFinding, PartQuestion};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Pair, Verdict};
use study_base::text::counted;
use study_plan::protocol::Occasion;
use study_stats::psychometric::{Core, Spacing};

/// The most pairs that a sentence lists.
const MAX_LISTED: usize = 12;

/// The banner of a part whose answers are not those of real participants.
pub(super) fn banner(part: &PartAnalysis) -> Option<&'static str> {
    included(part.simulated, part.pilot)
}

/// Who is included besides real participants.
pub(super) fn included(simulated: bool, pilot: bool) -> Option<&'static str> {
    match (simulated, pilot) {
        (true, true) => Some("SIMULATED participants and PILOTS are included."),
        (true, false) => Some("SIMULATED participants are included."),
        (false, true) => Some("PILOTS are included."),
        (false, false) => None,
    }
}

/// The answers to all questions.
pub(super) fn answered(part: &PartAnalysis) -> Vec<Answer> {
    part.findings
        .iter()
        .filter_map(|f| answer(part, f))
        .collect()
}

fn answer(part: &PartAnalysis, f: &PartFinding) -> Option<Answer> {
    let words = wording::of_part(part, f);
    let mut answer = Answer::new(&words.ask(), words.answer()?);
    answer.main = f.caveats.iter().map(sentences::caveat).collect();
    if f.question == PartQuestion::Identified {
        answer.main.extend(information(part));
        answer.main.extend(most_confused(part));
    }
    if f.question == PartQuestion::Structure {
        answer.main.extend(agreement(part));
        answer.main.extend(identical(part));
    }
    if f.question == PartQuestion::Dimensions {
        answer.main.extend(dimensions(part));
        answer.main.extend(weights(part));
    }
    if f.question == PartQuestion::RankedAlike {
        answer.main.extend(ranks(part));
    }
    if f.question == PartQuestion::Starts {
        answer.main.extend(settings(part));
    }
    if f.question == PartQuestion::Sessions {
        answer.main.extend(retest(part));
    }
    // Of two groups and two sessions the answer has it.
    if f.question == PartQuestion::GroupsSessions && f.estimate.is_none() {
        answer.main.extend(changes(part));
    }
    if f.question == PartQuestion::RankedFirst {
        answer.main.extend(of_one_order(part));
    }
    if matches!(
        f.question,
        PartQuestion::Preferred
            | PartQuestion::Thresholds
            | PartQuestion::Magnitudes
            | PartQuestion::RankedFirst
    ) {
        answer.main.extend(different(part));
    }
    Some(answer)
}

/// The pairs that differ.
fn different(part: &PartAnalysis) -> Option<String> {
    let differ = part.pairs.iter().filter(|p| p.verdict == Verdict::Yes);
    let differ: Vec<String> = differ
        .map(|pair| of_pair(&wording::upwards(pair)))
        .collect();
    let shown = differ.len().min(MAX_LISTED);
    let more = match differ.len() - shown {
        0 => String::new(),
        n => format!("; and {n} more"),
    };
    (!differ.is_empty()).then(|| {
        let n = counted(differ.len(), "pair differs", "pairs differ");
        let others = of_one_order(part).map_or("", |_| "the other ");
        format!(
            "Of {others}{}, {n}: {}{more}.",
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
    text.extend(webers_law(part));
    text.extend(scores(part));
    text.extend(exponent(part));
    text.extend(information(part));
    text.extend(agreement(part));
    text.extend(identical(part));
    text.extend(ranks(part));
    text.extend(settings(part));
    let tested = part.findings.iter().filter(|f| f.test.is_some());
    text.extend(tested.filter_map(|f| wording::of_part(part, f).paper()));
    text.extend(dimensions(part));
    text.extend(weights(part));
    text.extend(retest(part));
    text.extend(of_one_order(part));
    let pairs = part.findings.iter().any(|f| {
        let of_conditions = [
            PartQuestion::Thresholds,
            PartQuestion::Magnitudes,
            PartQuestion::RankedFirst,
        ];
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

/// The thresholds of each condition; those that are learned together stand beside the means.
fn thresholds(part: &PartAnalysis) -> Vec<String> {
    let over = &part.results.over;
    let pooled = |condition: &str| {
        let found = over.psy_population.as_ref()?.threshold.get(condition)?;
        Some(format!(
            "; learned from all participants together, that of the population was {}{}",
            apa::plain(found.median.number()?),
            ci(found.ci95.ends(), apa::plain)
        ))
    };
    let all = over.psy_group.iter();
    all.filter_map(|(condition, found)| {
        let found = &found.posterior_threshold;
        Some(format!(
            "{}: the geometric mean of the thresholds was {}{} (n = {}{}).",
            condition.as_str(),
            apa::plain(found.geometric_mean.number()?),
            ci(found.ci95.ends(), apa::plain),
            found.n.number()?,
            pooled(condition.as_str()).unwrap_or_default(),
        ))
    })
    .collect()
}

/// How increments grow with the standard.
fn webers_law(part: &PartAnalysis) -> Option<String> {
    let law = part.results.over.webers_law.as_ref()?;
    let test = match (law.t.number(), law.df.number(), law.p.number()) {
        (Some(t), Some(df), Some(p)) => format!(", t({df}) = {}, p {}", apa::two(t), apa::p(p)),
        _ => String::new(),
    };
    Some(format!(
        "Increments grew with the standard to the power of {}{}, where Weber's law says 1{test} (n = {}).",
        apa::two(law.exponent.number()?),
        ci(law.exponent_ci95.ends(), apa::two),
        law.n.number()?
    ))
}

/// Information transfer over all participants.
fn information(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.identification.as_ref()?;
    let bits = &found.information;
    let ci = match bits.corrected_ci95.lo.reason() {
        Some(why) => format!(" (no interval: {why})"),
        None => ci(bits.corrected_ci95.ends(), apa::two),
    };
    Some(format!(
        "Information transfer: {} bits of {}{ci}, as much as {} labels that are identified without an error.",
        apa::two(bits.corrected.number()?),
        apa::two(bits.stimulus.number()?),
        apa::one(bits.items.number()?),
    ))
}

/// Whether participants agree on what is different, and whether the order of two matters.
fn agreement(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.similarity.as_ref()?;
    let correlation = found.agreement.mean_correlation.number()?;
    let w = found.agreement.kendall_w.number();
    let w = w.map_or_else(String::new, |w| format!("; Kendall's W = {}", apa::two(w)));
    let order = match (found.order.rms.number(), found.order.p.number()) {
        (Some(rms), Some(p)) => format!(
            " The two orders of a pair differed by {} points (root mean square; p {} by random signs).",
            apa::one(rms),
            apa::p(p)
        ),
        _ => String::new(),
    };
    Some(format!(
        "Agreement: the mean correlation of the ratings of two participants is {}{w}.{order}",
        apa::two(correlation)
    ))
}

/// Where levels feel equal, and how much settings scatter.
fn settings(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.adjustment.as_ref()?;
    let pse = apa::plain(found.pse.number()?);
    let ci95 = found.pse_ci95.ends();
    let ci95 = ci95.map_or_else(String::new, |(low, high)| {
        format!(", 95 % CI [{}, {}]", apa::plain(low), apa::plain(high))
    });
    let spread = found.spread.sd.number().map_or_else(String::new, |sd| {
        let share = found.spread.relative.number();
        let share = share.map_or_else(String::new, |share| format!(" ({} of it)", apa::percent(share)));
        format!(
            " Settings of a participant scattered by {}{share} from one side, one standard deviation.",
            apa::plain(sd)
        )
    });
    Some(format!(
        "The point of subjective equality was {pse} on average{ci95}.{spread}"
    ))
}

/// How different something is from itself.
fn identical(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.similarity.as_ref()?;
    let own = found.identical.as_ref()?;
    Some(format!(
        "Identical pairs were rated {} on average, different ones {}.",
        apa::one(own.mean.number()?),
        apa::one(found.mean.number()?)
    ))
}

/// What weights of the dimensions add for participants.
fn weights(part: &PartAnalysis) -> Option<String> {
    let found = &part.results.over.similarity.as_ref()?.weights;
    let (fit, common) = (found.fit.number()?, found.common_fit.number()?);
    Some(format!(
        "A map whose dimensions each participant weighs (INDSCAL, n = {}) accounts for {} of the squares of their scalar products, one \
         with the same weights for all, but for a factor of each, for {} (p {}, by dealing the ratings of each pair to the participants \
         at random).",
        found.n.number()?,
        apa::percent(fit),
        apa::percent(common),
        apa::p(found.p.number()?)
    ))
}

/// The map that is shown, and why it has so many dimensions.
fn dimensions(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.similarity.as_ref()?;
    let chosen = found.map_dimensions.number()?;
    let each: Vec<String> = (found.dimensions.iter())
        .filter_map(|(k, own)| {
            let predicted = apa::two(own.predicted.number()?);
            Some(format!("{predicted} with {}", k.as_str()))
        })
        .collect();
    let shown = counted(chosen as usize, "dimension", "dimensions");
    let stress = apa::two(found.map_stress.number()?);
    let how = match found.map_in_proportion.is_set() {
        true => "; in proportion to the differences, because their order alone fits without stress",
        false => "",
    };
    Some(match each.is_empty() {
        true => format!(
            "The map has {shown} (stress {stress}{how}): without other participants no number of dimensions predicts better."
        ),
        false => format!(
            "The map has {shown} (stress {stress}{how}): the fewest that predict the ratings of a participant who was left out as well as \
             any, within one standard error. Correlation by the number of dimensions: {}.",
            each.join(", ")
        ),
    })
}

/// The two labels that are most alike.
fn most_confused(part: &PartAnalysis) -> Option<String> {
    let found = part.results.over.identification.as_ref()?;
    let alike = |pair: &LabelPair| pair.similarity.number();
    let pairs = found.pairs.iter().filter(|(_, pair)| alike(pair).is_some());
    let (names, pair) = pairs.max_by(|a, b| {
        alike(a.1)
            .unwrap_or(0.0)
            .total_cmp(&alike(b.1).unwrap_or(0.0))
    })?;
    let [first, second] = names.names();
    Some(format!(
        "Most alike: “{first}” and “{second}” (similarity {}{}, d′ = {}).",
        apa::two(alike(pair)?),
        ci(pair.similarity_ci95.ends(), apa::two),
        apa::two(pair.d.number()?),
    ))
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
fn questionnaire(part: &PartAnalysis) -> Option<(String, String)> {
    let when = part.data.between.unwrap_or(Occasion::Session).when();
    match part.task {
        "sus" => Some((
            "System Usability Scale".to_owned(),
            format!(
                "Participants filled in the System Usability Scale (Brooke, 1996) {when}; its score goes from 0 to \
                 100, and more is better."
            ),
        )),
        "nasa-tlx" => Some((
            "raw NASA Task Load Index".to_owned(),
            format!(
                "Participants filled in the NASA Task Load Index (Hart & Staveland, 1988) {when}; its raw score, \
                 without weights (Hart, 2006), is the mean of six ratings from 0 to 100, and more is more load."
            ),
        )),
        "nasa-tlx-weighted" => Some((
            "weighted NASA Task Load Index".to_owned(),
            format!(
                "Participants filled in the NASA Task Load Index with its comparisons (Hart & Staveland, 1988) {when}; its \
                 score is the mean of six ratings from 0 to 100, each as often as its subscale was chosen from 15 pairs, \
                 and more is more load."
            ),
        )),
        "own" => Some((
            format!("questionnaire {}", part.part),
            format!(
                "Participants filled in the questionnaire {} {when}; its items and its scoring are in the protocol.",
                part.part
            ),
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
             beta-binomial errors; thresholds are posterior medians with equal-tailed 95 % intervals \
             (Schütt et al., 2016), at half the height between guesses and lapses.",
            shapes(part)
        ));
    }
    if let Some(model) = &over.psy_population {
        text.push(match model.has_converged() {
            true => "Beside them stand posterior medians of a hierarchical model: participants' thresholds and widths as \
                     draws, lapses shared, their functions integrated out by quadrature and the population's parameters \
                     drawn by importance sampling. No test rests on it."
                .to_owned(),
            false => "A hierarchical model of all participants did not converge, and was not used.".to_owned(),
        });
    }
    if let Some((_, how)) = questionnaire(part) {
        text.push(how);
    }
    if over.identification.is_some() {
        text.push(
            "Participants' shares of correct answers were compared with those of guesses that have their own \
             preferences for labels. Information transfer is that of the summed confusion matrices less its bias \
             for fixed numbers of presentations (after Miller, 1955); similarities and biases of labels are those of Luce's \
             (1963) choice model by maximum likelihood. Intervals are by leaving out each participant in turn (Tukey, 1958), \
             that of information transfer on the logarithm of what it lacks of the stimulus information."
                .to_owned(),
        );
    }
    if over.similarity.is_some() {
        text.push(
            "Each participant's ratings of a pair were averaged over both orders and brought to the same mean by a factor of the \
             participant's; their mean over participants was scaled by majorization of Kruskal's (1964) stress 1 on the order of the \
             dissimilarities, or in proportion to them where their order fits without stress, from the classical map and from random starts. Stress was compared with that after each participant's \
             ratings were dealt to the pairs at random. The number of dimensions is the smallest whose maps of all others predict the ratings of \
             a participant as well as any, within one standard error. Standard errors of positions are by resampling participants; \
             properties of the realizations were laid on the map by Procrustes' rotation and tested over the orders of the realizations. \
             Weights of dimensions are those of INDSCAL (Carroll & Chang, 1970) with none below 0; what they add to equal weights was \
             compared with that after the ratings of each pair were dealt to the participants at random."
                .to_owned(),
        );
    }
    if over.ranking.is_some() {
        text.push(
            "Whether participants rank alike was tested by Kendall's (1939) W of their mean ranks, corrected for ties, over the orders of each \
             participant's ranks. Worths are those of the model of Plackett (1975) and Luce (1959) with ties of any order (Turner et al., \
             2020), by maximum likelihood; their differences were tested by t with participants as clusters and Holm's correction, \
             and a realization is above each other one if all of its differences are significant. Where some realizations were above \
             all others in every ranking, worths are the limit of the likelihood within such a level, and differences of two levels, which have no \
             upper limit, were tested by the sign test over participants and have the exact lower limit of Clopper and Pearson (1934)."
                .to_owned(),
        );
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
    if over.again.groups_sessions.is_some() {
        text.push(
            "Whether changes from session to session depend on the group is the interaction of both in an analysis of \
             variance between and within participants, with the Greenhouse–Geisser correction."
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
