//! Do the factors of a factorial design matter, and does the effect of one depend on another?

use super::{Compared, Direction, Estimate, Finding, Question, Test, TestKind};
use crate::analyze::results::{ContrastName, FactorialEffect, LevelsName, Number as _};
use study_base::apa;
use study_base::text::counted;
use study_plan::protocol::factors::GROUP;
use study_stats::level::rejects;

/// A finding for each effect that is tested; nothing in a study without factors.
pub(super) fn factors(facts: &Compared<'_>) -> Vec<Finding> {
    let (Some(crossing), Some(tests)) = (&facts.rules.crossing, facts.factorial) else {
        return Vec::new();
    };
    let shown = |effect: &[usize]| {
        let own = tests.effects.get(crossing.effect_name(effect).as_str());
        own.and_then(|e| e.p_holm.number())
            .is_some_and(|p| rejects(p, facts.rules.alpha))
    };
    let mut found = Vec::new();
    for effect in &crossing.effects {
        let name = crossing.effect_name(effect);
        let Some(numbers) = tests.effects.get(name.as_str()) else {
            continue;
        };
        let names = effect.iter().map(|at| crossing.name(*at).to_owned());
        let mut finding = Finding {
            names: names.collect(),
            ..decided(facts, Question::Effect(name), numbers)
        };
        if finding.reason().is_none() {
            if let [factor] = effect[..] {
                estimate(facts, factor, &mut finding);
            }
            let larger = |other: &&Vec<usize>| {
                other.len() > effect.len() && effect.iter().all(|at| other.contains(at))
            };
            let depends: Vec<String> = (crossing.effects.iter().filter(larger))
                .filter(|other| shown(other))
                .map(|other| crossing.effect_name(other).replace(':', " × "))
                .collect();
            if !depends.is_empty() {
                finding.caveat(
                    "interaction",
                    format!(
                        "it is a mean over levels on which it depends: the interaction {} is shown, so read the simple effects",
                        depends.join(" and ")
                    ),
                );
            }
            if effect.contains(&crossing.factors.len()) {
                unequal_groups(facts, &mut finding);
            }
            if numbers.clustered.is_none() {
                ranks(facts, numbers, &mut finding);
            }
        }
        found.push(finding);
    }
    found
}

fn decided(facts: &Compared<'_>, question: Question, numbers: &FactorialEffect) -> Finding {
    let design = facts.design;
    let Some(p) = numbers.p_holm.number() else {
        let why = numbers.p_holm.reason().unwrap_or("there is no test");
        return Finding::undefined(question, why, design);
    };
    let comparisons = (facts.rules.crossing.as_ref()).map_or(1, |c| c.effects.len());
    // With one contrast there is no sphericity to depart from.
    let epsilon = numbers.eps_gg.number().unwrap_or(1.0);
    let (kind, (symbol, value), df) = match &numbers.clustered {
        Some(own) => (
            TestKind::FactorialWithin,
            ("t", own.t.number()),
            vec![own.df.number()],
        ),
        None => {
            let df = [&numbers.df1, &numbers.df2].map(|df| df.number().map(|df| df * epsilon));
            let df = df.to_vec();
            let kind = match epsilon < 1.0 {
                true => TestKind::FactorialAnovaGreenhouseGeisser,
                false => TestKind::FactorialAnova,
            };
            (kind, ("F", numbers.f.number()), df)
        }
    };
    let test = Test {
        comparisons,
        ..Test::single(kind, p, facts.rules.alpha)
    };
    let mut found = Finding::decided(question, test.with(symbol, value, &df), design);
    let people = counted(design.participants, "participant", "participants");
    let complete = match design.complete {
        0 => "none".to_owned(),
        n => n.to_string(),
    };
    if numbers.clustered.is_some() {
        found.participants = design.participants;
        found.caveat(
            "within-participants",
            format!(
                "{complete} of {people} rated every realization; levels are compared within participants, by the \
                 ratings of all, assuming that what is missing does not depend on what the rating would have been"
            ),
        );
        return found;
    }
    found.participants = design.complete;
    let ges = numbers.ges.number();
    found.effect = ges.and_then(|ges| Estimate::of("generalized eta squared", ges));
    if design.complete < design.participants {
        found.caveat(
            "complete-only",
            format!(
                "{complete} of {people} rated every realization; the others are left out of the analysis of the factors, \
                 assuming that those who did not rate everything would have rated alike"
            ),
        );
    }
    found
}

/// Of a factor with two levels the difference, second minus first, and its direction.
fn estimate(facts: &Compared<'_>, factor: usize, finding: &mut Finding) {
    let (Some(crossing), Some(tests)) = (&facts.rules.crossing, facts.factorial) else {
        return;
    };
    let [first, second] = crossing.levels(factor) else {
        return;
    };
    let name = ContrastName {
        factor: crossing.name(factor).to_owned(),
        levels: [first.clone(), second.clone()],
        at: LevelsName::default(),
    };
    let Some(contrast) = tests.contrasts.get(&name) else {
        return;
    };
    finding.estimate = contrast.difference.number().map(|difference| Estimate {
        name: "difference",
        value: -difference,
        ci95: (contrast.difference_ci95.ends()).map(|(lo, hi)| (-hi, -lo)),
    });
    if finding.is_yes() {
        finding.direction = finding.estimate.map(|e| Direction::of(e.value));
    }
}

/// Groups whose sizes differ by this factor are unequal.
const UNEQUAL: f64 = 1.5;

/// Says so if groups are of unlike size: then the test needs ratings that vary alike in all.
fn unequal_groups(facts: &Compared<'_>, finding: &mut Finding) {
    let (Some(crossing), Some(tests)) = (&facts.rules.crossing, facts.factorial) else {
        return;
    };
    // Of any mean of a group, whichever effects are tested.
    let size = |group: &String| {
        let of_group = |(factor, level): &(String, String)| factor == GROUP && level == group;
        let mut means = tests.means.iter();
        let (_, mean) = means.find(|(name, _)| name.0.iter().any(of_group))?;
        mean.n.number()
    };
    let sizes: Vec<f64> = crossing.groups.iter().filter_map(size).collect();
    let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    let most = sizes.iter().copied().fold(0.0, f64::max);
    if sizes.len() == crossing.groups.len() && most >= UNEQUAL * least {
        finding.caveat(
            "unequal-groups",
            format!(
                "the groups have {least} to {most} participants: if ratings vary more in a small group than in a large one, this test says yes too often"
            ),
        );
    }
}

/// Says so if the ranks do not show what the ratings do. That they show more says little: with single
/// ratings they reject too often (docs/calibration.md).
fn ranks(facts: &Compared<'_>, numbers: &FactorialEffect, finding: &mut Finding) {
    let alpha = facts.rules.alpha;
    let (Some(p), Some(of_ranks)) = (numbers.p_gg.number(), numbers.art_p.number()) else {
        return;
    };
    if rejects(p, alpha) && !rejects(of_ranks, alpha) {
        finding.caveat(
            "ranks",
            format!(
                "the aligned ranks of the ratings do not show it: p {} for {} of the ratings, both without correction for the number of effects",
                apa::p_beside(of_ranks, alpha),
                apa::p_beside(p, alpha)
            ),
        );
    }
}
