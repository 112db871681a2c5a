//! Pairs of realizations: which of them differ, and does the best-rated differ from the
//! second best?

use super::{Direction, Estimate, Facts, Finding, Question, Test, TestKind, Verdict};
use crate::analyze::Rules;
use crate::analyze::adjusted::MAX_COMPARED;
use crate::analyze::cells::Cells;
use crate::analyze::design::Design;
use crate::analyze::results::{Number as _, PairName, PairTests};
use study_stats::describe::rounded;

/// The comparison of two realizations, the first minus the second.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// The realization whose name sorts first. Untrusted.
    pub first: String,
    /// The other one. Untrusted.
    pub second: String,
    /// The participants on whom it rests.
    pub participants: usize,
    /// The difference of their means, with its interval, not corrected for the number
    /// of pairs.
    pub difference: Estimate,
    /// Cohen's dz, where the pair was compared by a paired t test.
    pub dz: Option<f64>,
    /// The test, with Holm's correction over all pairs.
    pub test: Option<Test>,
    /// Whether they differ.
    pub verdict: Verdict,
    /// Two one-sided tests that they differ by less than the preregistered margin, with
    /// Holm's correction over all pairs.
    pub equivalence: Option<Test>,
}

impl Pair {
    /// The comparison seen from one of its realizations: that one minus the other.
    pub fn seen_from(&self, name: &str) -> Self {
        if self.first == name {
            return self.clone();
        }
        let mut turned = self.clone();
        std::mem::swap(&mut turned.first, &mut turned.second);
        turned.difference.value *= -1.0;
        turned.difference.ci95 = self.difference.ci95.map(|(low, high)| (-high, -low));
        turned.dz = self.dz.map(|dz| -dz);
        if let Some(statistic) = turned.test.as_mut().and_then(|t| t.statistic.as_mut()) {
            statistic.value *= -1.0;
        }
        turned
    }
}

/// The compared pairs.
pub(super) fn all(
    cells: &Cells<'_>,
    design: Design,
    rules: &Rules,
    tests: &PairTests,
) -> Vec<Pair> {
    let kind = if design.uses_complete() {
        TestKind::PairedT
    } else {
        TestKind::WithinContrast
    };
    let comparisons = tests.n_compared.number().unwrap_or(0.0) as usize;
    let names: Vec<&str> = (cells.tested().iter())
        .map(|&m| cells.model_name(m))
        .collect();
    let mut found = Vec::new();
    for (i, a) in names.iter().enumerate() {
        for b in &names[i + 1..] {
            let Some(pair) = tests.compared.get(&PairName::of(a, b)) else {
                continue;
            };
            let Some(difference) = pair.difference.number() else {
                continue;
            };
            let test = pair.p_holm.number().map(|p| Test {
                comparisons,
                ..Test::single(kind, p, rules.alpha).with("t", pair.t.number(), &[pair.df.number()])
            });
            let why = || pair.p.reason().unwrap_or("there is no test").to_owned();
            let equivalence = pair.equivalence.as_ref();
            let equivalence = equivalence.and_then(|e| e.p_tost_holm.number());
            found.push(Pair {
                first: (*a).to_owned(),
                second: (*b).to_owned(),
                participants: pair.n.number().unwrap_or(0.0) as usize,
                difference: Estimate {
                    name: "difference",
                    value: difference,
                    ci95: pair.ci95.ends(),
                },
                dz: pair.dz.number(),
                verdict: (test.as_ref()).map_or_else(|| Verdict::Undefined(why()), Test::verdict),
                test,
                equivalence: equivalence.map(|p| Test {
                    comparisons,
                    ..Test::single(TestKind::Equivalence, p, rules.alpha)
                }),
            });
        }
    }
    found
}

/// Whether any pair differs; which ones is in the pairs themselves.
pub(super) fn which(facts: &Facts<'_>) -> Option<Finding> {
    if facts.design.realizations < 3 {
        return None;
    }
    let tests = facts
        .pairs
        .iter()
        .filter_map(|p| Some((p, p.test.as_ref()?)));
    let closest = tests.min_by(|x, y| x.1.p.total_cmp(&y.1.p));
    let Some((pair, test)) = closest else {
        let why = not_compared(facts, facts.pairs.first());
        return Some(Finding::undefined(Question::Pairs, why, facts.design));
    };
    let mut found = Finding::decided(Question::Pairs, test.clone(), facts.design);
    found.names = vec![pair.first.clone(), pair.second.clone()];
    found.participants = pair.participants;
    found.estimate = Some(pair.difference);
    found.effect = pair.dz.and_then(|dz| Estimate::of("dz", dz));
    Some(found)
}

/// Why a pair was not compared.
fn not_compared(facts: &Facts<'_>, pair: Option<&Pair>) -> String {
    let d = facts.design;
    if d.participants < 2 {
        "there is only one participant".to_owned()
    } else if d.realizations > MAX_COMPARED {
        format!("pairs are compared for at most {MAX_COMPARED} realizations")
    } else if let Some(Verdict::Undefined(why)) = pair.map(|p| &p.verdict) {
        why.clone()
    } else {
        let alone = match d.uses_complete() {
            true => "fewer than two participants rated every realization",
            false => "fewer than two participants link the realizations",
        };
        let why = facts.evidence.cells.within.f.reason();
        why.unwrap_or(alone).to_owned()
    }
}

/// Whether the best-rated realization differs from the second best: two-sided, and
/// not corrected for the number of realizations. Of the realizations that are really the
/// highest, equal ones included, none is then taken for the only one in more than a share
/// α of studies (Gutmann & Maymin 1987, Ann. Stat. 15, 456–461; Hung & Fithian 2019, Ann.
/// Stat. 47, 758–782).
pub(super) fn best(facts: &Facts<'_>) -> Option<Finding> {
    let [(mean, first), (next, second), ..] = facts.ranked[..] else {
        return None;
    };
    let names = |found: Finding, names: &[&str]| Finding {
        names: names.iter().map(|n| (*n).to_owned()).collect(),
        ..found
    };
    let difference = rounded(mean - next);
    if difference == 0.0 {
        let tied = facts.ranked.iter().filter(|r| rounded(mean - r.0) == 0.0);
        let tied: Vec<&str> = tied.map(|r| r.1).collect();
        let mut found = Finding::undefined(Question::Best, "", facts.design);
        found.verdict = Verdict::NotShown;
        found.estimate = Estimate::of("difference", 0.0);
        return Some(names(found, &tied));
    }
    let either = |p: &&Pair| {
        (p.first == first && p.second == second) || (p.first == second && p.second == first)
    };
    let pair = facts.pairs.iter().find(either).map(|p| p.seen_from(first));
    let tests = facts.evidence.pairs.as_ref();
    let p = tests.and_then(|t| t.compared.get(&PairName::of(first, second))?.p.number());
    let alone = |test: Test| Test {
        comparisons: 1,
        p: p.unwrap_or(test.p),
        ..test
    };
    let pair = pair.map(|pair| Pair {
        test: pair.test.map(alone),
        ..pair
    });
    let found = match pair {
        Some(Pair {
            test: Some(test),
            difference,
            dz,
            participants,
            ..
        }) => Finding {
            participants,
            estimate: Some(difference),
            effect: dz.and_then(|dz| Estimate::of("dz", dz)),
            direction: Some(Direction::of(difference.value)).filter(|_| test.is_significant()),
            ..Finding::decided(Question::Best, test, facts.design)
        },
        pair => {
            let why = not_compared(facts, pair.as_ref());
            let estimate = Estimate::of("difference", difference);
            Finding {
                estimate,
                ..Finding::undefined(Question::Best, why, facts.design)
            }
        }
    };
    Some(names(found, &[first, second]))
}
