//! The findings of a part of ranking.

use super::{
    AbilityDifference, PartFacts, PartFinding, PartQuestion, estimate, of_abilities,
    test_of_abilities,
};
use crate::analyze::findings::{Estimate, Finding, Pair, Test, TestKind};
use crate::analyze::psychophysics::ranking::{Rankings, by_worth};
use crate::analyze::record::Number as _;
use study_base::apa;
use study_stats::level::rejects;

/// The findings of rankings, and the differences of the realizations.
pub(in crate::analyze::psychophysics) fn of_rankings(
    facts: &PartFacts,
    found: &Rankings,
) -> (Vec<PartFinding>, Vec<Pair>) {
    let differences = found.pairs.iter();
    let pairs = of_abilities(facts, differences.map(|(name, pair)| (name, &pair.worths)));
    (
        vec![ranked_alike(facts, found), ranked_first(facts, found)],
        pairs,
    )
}

fn ranked_alike(facts: &PartFacts, found: &Rankings) -> PartFinding {
    let (question, agreement) = (PartQuestion::RankedAlike, &found.agreement);
    let realizations = found.items.len();
    let (Some(w), Some(p)) = (agreement.w.number(), agreement.p.number()) else {
        return facts.undefined(question, &agreement.p, realizations);
    };
    let kind = match agreement.exact.is_set() {
        true => TestKind::RanksExact,
        false => TestKind::RanksMonteCarlo,
    };
    let mut finding = Finding {
        participants: agreement.n.number().unwrap_or(0.0) as usize,
        estimate: Estimate::of("W", w),
        ..Finding::decided(
            question,
            Test::single(kind, p, facts.alpha),
            facts.design(realizations),
        )
    };
    let least = agreement.smallest_p.number();
    if let Some(least) = least.filter(|p| !rejects(*p, facts.alpha)) {
        finding.caveat(
            "too-few",
            format!(
                "with so few participants and realizations no p below {} is possible",
                apa::bare_p(least)
            ),
        );
    }
    finding
}

/// The highest one is above each other one if all of their differences are: the largest p decides. It is that of a sign test
/// where the two never had another order.
fn ranked_first(facts: &PartFacts, found: &Rankings) -> PartFinding {
    let (question, best) = (PartQuestion::RankedFirst, &found.best);
    let realizations = found.items.len();
    let Some(p) = best.p.number() else {
        return facts.undefined(question, &best.p, realizations);
    };
    let names: Vec<String> = by_worth(found).into_iter().map(str::to_owned).collect();
    let highest = names.first().map_or("", String::as_str);
    let own = (found.pairs.iter()).filter(|(name, _)| name.names().contains(&highest));
    // Of equal p that of a pair with a difference.
    let key = |pair: &AbilityDifference| {
        let p = pair.p_holm.number().unwrap_or(0.0);
        (p, pair.difference.number().is_some())
    };
    let deciding = own.map(|(_, pair)| &pair.worths).max_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
    });
    let kind = match deciding.and_then(|pair| pair.difference.number()) {
        Some(_) => test_of_abilities(facts).0,
        None => TestKind::Sign,
    };
    let test = Test {
        comparisons: found.pairs.len(),
        ..Test::single(kind, p, facts.alpha)
    };
    let mut finding = Finding {
        estimate: (best.difference.number())
            .map(|difference| estimate("difference", difference, &best.ci95)),
        names,
        ..Finding::decided(question, test, facts.design(realizations))
    };
    if facts.participants < 2 {
        finding.caveat(
            "one-participant",
            "with one participant the rankings are taken for independent: it holds for this participant only",
        );
    }
    finding
}
