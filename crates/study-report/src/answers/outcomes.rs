//! What was measured in the trials besides the rating.

use super::Answer;
use crate::wording::two_levels;
use crate::{apa, sentences};
use study_analysis::analyze::findings::Estimate;
use study_analysis::analyze::results::{
    MeasuredOutcome, Number as _, OutcomeMean, OutcomeModelTest, OutcomeName, OutcomePair,
};
use study_analysis::analyze::{Analysis, Finding, OutcomeAnswer, Question, Verdict};
use study_base::text::sentence;
use study_plan::protocol::{BetterEnd, OutcomeFamily, Transform};

/// An answer for each outcome that was measured.
pub(super) fn outcomes(a: &Analysis) -> Vec<Answer> {
    let one = |outcome: &OutcomeAnswer| {
        let record = (a.results.outcomes).get(outcome.rules.id.as_str())?;
        Some(answer(a, outcome, record))
    };
    a.outcomes.iter().filter_map(one).collect()
}

fn answer(a: &Analysis, outcome: &OutcomeAnswer, record: &MeasuredOutcome) -> Answer {
    let rules = &outcome.rules;
    let noun = rules.measure.noun();
    let by = match a.crossing {
        Some(_) => "depend on the factors",
        None => "differ between the realizations",
    };
    let question = format!("Measured: does {} ({noun}) {by}?", rules.id);
    let mut told = outcome.findings.iter().map(|f| found(a, outcome, f));
    let mut answer = Answer::new(&question, told.next().unwrap_or_default());
    answer.main.extend(told);
    answer.main.extend(ends(outcome, record));
    answer.main.extend(with_vaf(record));
    answer.main.extend(trade_offs(a, outcome, record));
    (answer.main).extend(outcome.caveats.iter().map(sentences::caveat));
    answer.more.push(
        "Measured outcomes decide no question of the study; p is corrected over the tests of all of them (Holm)."
            .to_owned(),
    );
    answer.more.extend(second_opinion(a, outcome, record));
    answer
}

/// What the generalized mixed model says of each effect, which decides nothing.
fn second_opinion(
    a: &Analysis,
    outcome: &OutcomeAnswer,
    record: &MeasuredOutcome,
) -> Option<String> {
    let model = record.model.as_ref()?;
    let (name, compared) = match outcome.rules.model? {
        OutcomeFamily::Poisson => ("A Poisson mixed model", "means"),
        OutcomeFamily::Binomial => ("A binomial mixed model", "odds"),
        OutcomeFamily::Gamma => ("A gamma mixed model", "means"),
    };
    if let Some(why) = model.loglik.reason() {
        return Some(sentence(&format!(
            "{name} was asked for as a second opinion and has no estimate: {why}"
        )));
    }
    let measured: Vec<&str> = (a.realizations.iter())
        .filter(|own| own.tested && outcome.order.contains(&own.id))
        .map(|own| own.id.as_str())
        .collect();
    let two = match measured[..] {
        [first, second] => Some([first, second]),
        _ => None,
    };
    let realizations =
        (model.differ.iter()).map(|test| likelihood_ratio("realizations", two, compared, test));
    let effects = model.effects.iter().map(|(effect, test)| {
        let effect = effect.as_str();
        likelihood_ratio(effect, levels_of(a, effect), compared, test)
    });
    let all: Vec<String> = realizations.chain(effects).collect();
    Some(sentence(&format!(
        "{name} of the single trials, by likelihood ratios and not corrected for their number, is a second opinion \
         and decides nothing: {}",
        all.join("; ")
    )))
}

/// The test of an effect and, of two levels, the ratio of their means or odds.
fn likelihood_ratio(
    effect: &str,
    levels: Option<[&str; 2]>,
    compared: &str,
    test: &OutcomeModelTest,
) -> String {
    let named = effect.replace(':', " × ");
    let (Some(chi2), Some(df), Some(p)) = (test.chi2.number(), test.df.number(), test.p.number())
    else {
        let why = test.chi2.reason().unwrap_or("it has no test");
        return format!("{named} has no test ({why})");
    };
    let ratio = test.ratio.number().map_or_else(String::new, |ratio| {
        let ci = sentences::ci(test.ratio_ci95.as_ref(), apa::two);
        let levels = levels.map(|levels| levels.map(apa::name));
        let [first, second] =
            levels.unwrap_or_else(|| ["the first", "the second"].map(str::to_owned));
        format!(
            ", ratio of the {compared} {second} over {first} = {}{ci}",
            apa::two(ratio)
        )
    });
    format!(
        "{named}, χ²({}) = {}, p {}{ratio}",
        apa::whole(df),
        apa::two(chi2),
        apa::p(p)
    )
}

/// The two levels of a factor that has two.
fn levels_of<'a>(a: &'a Analysis, factor: &str) -> Option<[&'a str; 2]> {
    let crossing = a.crossing.as_ref()?;
    let place = (0..=crossing.factors.len()).find(|place| crossing.name(*place) == factor)?;
    match crossing.levels(place) {
        [first, second] => Some([first.as_str(), second.as_str()]),
        _ => None,
    }
}

/// The verdict of a test, with its result.
fn found(a: &Analysis, outcome: &OutcomeAnswer, f: &Finding) -> String {
    let noun = outcome.rules.measure.noun();
    let effect = f.names.join(" × ");
    let claim = match (&f.question, f.names.len()) {
        (Question::Effect(_), 1) => format!("{effect} has an effect on the {noun}"),
        (Question::Effect(_), _) => format!("{effect} is an interaction in the {noun}"),
        _ => format!("the {noun} differs between the realizations"),
    };
    let result = sentences::result(f).map_or_else(String::new, |r| format!(": {r}"));
    let test = f.test.as_ref().map_or_else(String::new, |t| {
        let name = sentences::test_name(t.kind);
        match t.comparisons {
            0 | 1 => format!(" ({name})"),
            n => format!(" ({name}, Holm's correction over {n} tests)"),
        }
    });
    let difference = (f.estimate.as_ref())
        .filter(|_| f.reason().is_none())
        .and_then(|e| second_level(outcome, two_levels(a, f)?, e))
        .unwrap_or_default();
    match &f.verdict {
        Verdict::Yes => sentence(&format!("shown: {claim}{result}{test}{difference}")),
        Verdict::NotShown => sentence(&format!(
            "not shown: that {claim}{result}{test}{difference}"
        )),
        Verdict::Undefined(why) => {
            sentence(&format!("whether {claim} cannot be determined: {why}"))
        }
    }
}

/// The second level of a factor less the first one or, of logarithms, over it.
fn second_level(outcome: &OutcomeAnswer, levels: [&str; 2], e: &Estimate) -> Option<String> {
    let rules = &outcome.rules;
    let back = |x: f64| rules.transform.back(x);
    let [first, second] = levels.map(apa::name);
    let (difference, unit) = match rules.transform {
        Transform::Log => (format!("{second} over {first}"), "times".to_owned()),
        Transform::Identity => (
            format!("{second} − {first}"),
            rules.measure.unit().to_owned(),
        ),
    };
    let own = Estimate {
        value: back(e.value),
        ci95: e.ci95.map(|(lo, hi)| (back(lo), back(hi))),
        ..*e
    };
    Some(format!(
        "; {difference}: {} {unit}",
        sentences::estimate(&own, apa::two)
    ))
}

/// The realizations at both ends, with what is compared.
fn ends(outcome: &OutcomeAnswer, record: &MeasuredOutcome) -> Option<String> {
    let rules = &outcome.rules;
    let [first, .., last] = outcome.order.as_slice() else {
        return None;
    };
    let of = |name: &str| {
        let mean: &OutcomeMean = record.means.get(name)?;
        let ci = sentences::ci(mean.center_ci95.as_ref(), apa::plain);
        let center = apa::plain(mean.center.number()?);
        Some(format!(
            "{} {center} {}{ci}",
            apa::name(name),
            rules.measure.unit()
        ))
    };
    let words = match rules.better {
        Some(BetterEnd::Higher) => ["best (highest)", "worst (lowest)"],
        Some(BetterEnd::Lower) => ["best (lowest)", "worst (highest)"],
        None => ["lowest", "highest"],
    };
    let means = match rules.transform {
        Transform::Log => "Geometric means",
        Transform::Identity => "Means",
    };
    Some(format!(
        "{means} over participants: {} {}; {} {}.",
        words[0],
        of(first)?,
        words[1],
        of(last)?
    ))
}

/// The relation with VAF over the realizations, described.
fn with_vaf(record: &MeasuredOutcome) -> Option<String> {
    let vaf = record.vaf.as_ref()?;
    Some(format!(
        "Over {} realizations its means correlate with VAF by r = {}, ρ = {} (described, not tested).",
        apa::whole(vaf.n.number()?),
        apa::r(vaf.r.number()?),
        apa::r(vaf.rho.number()?)
    ))
}

/// How a time goes with what else was measured; in which direction only where the interval tells it.
fn trade_offs(a: &Analysis, outcome: &OutcomeAnswer, record: &MeasuredOutcome) -> Vec<String> {
    let one = |(name, pair): (&OutcomeName, &OutcomePair)| {
        let other = a
            .outcomes
            .iter()
            .find(|o| o.rules.id.as_str() == name.as_str())?;
        let r = pair.r.number()?;
        let is_lower = |o: &OutcomeAnswer| o.rules.better == Some(BetterEnd::Lower);
        let same_end = is_lower(outcome) == is_lower(other);
        let known = pair.ci95.ends().is_some_and(|(lo, hi)| lo * hi > 0.0);
        let goes = match (known, (r > 0.0) == same_end) {
            (false, _) => "",
            (true, true) => ": what is better in one tends to be better in the other",
            (true, false) => ": what is better in one tends to be worse in the other",
        };
        Some(format!(
            "Within participants {} and {} correlate over the realizations by r({}) = {}{}{goes} \
             (described, not tested).",
            outcome.rules.id,
            other.rules.id,
            apa::whole(pair.df.number()?),
            apa::r(r),
            sentences::ci(&pair.ci95, apa::r)
        ))
    };
    record.pairs.iter().filter_map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_analysis::analyze::results::Stat;

    /// A ratio says of which two levels or realizations it is.
    #[test]
    fn a_ratio_names_what_it_compares() {
        let test = OutcomeModelTest {
            chi2: Stat::of(5.0),
            df: Stat::of(1.0),
            p: Stat::of(0.025),
            ratio: Some(Stat::of(1.5)),
            ratio_ci95: None,
        };
        let told = likelihood_ratio("realizations", Some(["soft", "crisp"]), "means", &test);
        assert!(
            told.ends_with("ratio of the means crisp over soft = 1.50"),
            "{told}"
        );
    }
}
