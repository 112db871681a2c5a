//! The findings of a part that is no rating.

use super::preferences::ENOUGH_CLUSTERS;
use crate::analyze::design::Design;
use crate::analyze::findings::{Direction, Estimate, Finding, Pair, Test, TestKind, Verdict};
use crate::analyze::identifiers::{group_id, pair_id};
use crate::analyze::values::Values;
use study_base::apa;
use study_stats::level::rejects;

/// A question about a part.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PartQuestion {
    /// Is a realization preferred to another?
    Preferred,
    /// Does VAF predict which realization is preferred?
    PreferenceVaf,
    /// Does the order of the intervals matter?
    IntervalOrder,
    /// Are standard and comparison of this condition told apart?
    ToldApart(String),
    /// Do thresholds differ between the conditions?
    Thresholds,
    /// Do estimates of magnitude differ between the realizations?
    Magnitudes,
    /// Does VAF predict the estimates?
    MagnitudeVaf,
    /// Do the groups differ?
    Groups,
    /// Do the differences between conditions depend on the group?
    GroupsConditions,
    /// Do the sessions differ?
    Sessions,
}

impl PartQuestion {
    /// The identifier in `--json` and of its statistics, `finding/ID/*`.
    pub fn id(&self) -> String {
        match self {
            Self::Preferred => "preferred".to_owned(),
            Self::PreferenceVaf => "preference-vaf".to_owned(),
            Self::IntervalOrder => "interval-order".to_owned(),
            Self::ToldApart(condition) => group_id("told-apart", &[condition]),
            Self::Thresholds => "thresholds".to_owned(),
            Self::Magnitudes => "magnitudes".to_owned(),
            Self::MagnitudeVaf => "magnitude-vaf".to_owned(),
            Self::Groups => "groups".to_owned(),
            Self::GroupsConditions => "groups-conditions".to_owned(),
            Self::Sessions => "sessions".to_owned(),
        }
    }
}

/// The answer to a question about a part.
pub type PartFinding = Finding<PartQuestion>;

/// What findings are made from.
pub(super) struct PartFacts<'a> {
    pub(super) values: &'a Values,
    pub(super) alpha: f64,
    pub(super) participants: usize,
}

impl PartFacts<'_> {
    fn number(&self, id: &str) -> Option<f64> {
        self.values.number(id)
    }

    fn design(&self, realizations: usize) -> Design {
        Design {
            participants: self.participants,
            realizations,
            ..Design::default()
        }
    }

    fn undefined(&self, question: PartQuestion, id: &str, realizations: usize) -> PartFinding {
        let why = self.values.reason(id).unwrap_or("there is no test");
        Finding::undefined(question, why, self.design(realizations))
    }
}

/// The findings of preferences over these items, and their differences.
pub(super) fn of_preferences(
    facts: &PartFacts<'_>,
    items: &[String],
) -> (Vec<PartFinding>, Vec<Pair>) {
    let kind = match facts.participants {
        n if n >= ENOUGH_CLUSTERS => TestKind::WaldClustered,
        _ => TestKind::Wald,
    };
    let of_pair = |a: &str, b: &str| {
        let id = pair_id("pairs", a, b);
        pair(facts, &id, (a, b), ("difference", kind, "z"))
    };
    let mut pairs = Vec::new();
    for (i, a) in items.iter().enumerate() {
        pairs.extend(items[i + 1..].iter().filter_map(|b| of_pair(a, b)));
    }
    let mut found = vec![preferred(facts, items, &pairs)];
    if facts.values.get("pairs/vaf/n_models").is_some() {
        found.push(with_vaf(facts, PartQuestion::PreferenceVaf, "pairs/vaf"));
    }
    if facts.values.get("pairs/order").is_some() {
        found.push(interval_order(facts));
    }
    (found, pairs)
}

/// The comparison with the smallest p; yes, if any differs.
fn preferred(facts: &PartFacts<'_>, items: &[String], pairs: &[Pair]) -> PartFinding {
    let question = PartQuestion::Preferred;
    let p = |pair: &&Pair| pair.test.as_ref().map_or(f64::INFINITY, |t| t.p);
    let clearest = pairs.iter().min_by(|a, b| p(a).total_cmp(&p(b)));
    let Some((pair, test)) = clearest.and_then(|pair| Some((pair, pair.test.clone()?))) else {
        let first = items.first().map_or("", String::as_str);
        return facts.undefined(question, &group_id("pairs/ability", &[first]), items.len());
    };
    let mut found = Finding {
        estimate: Some(pair.difference),
        ..Finding::decided(question, test, facts.design(items.len()))
    };
    let ability = |item: &String| facts.number(&group_id("pairs/ability", &[item]));
    found.names = items.to_vec();
    (found.names).sort_by(|a, b| {
        ability(b)
            .unwrap_or(0.0)
            .total_cmp(&ability(a).unwrap_or(0.0))
    });
    if facts.participants < ENOUGH_CLUSTERS {
        found.caveat(
            "few-clusters",
            format!(
                "with fewer than {ENOUGH_CLUSTERS} participants, standard errors take all answers for \
                 independent: intervals may be too short"
            ),
        );
    }
    found
}

/// The correlation with VAF in `group`.
fn with_vaf(facts: &PartFacts<'_>, question: PartQuestion, group: &str) -> PartFinding {
    let id = |what: &str| format!("{group}/{what}");
    let n = facts.number(&id("n_models")).unwrap_or(0.0) as usize;
    let Some(test) = permutation(facts, group) else {
        return facts.undefined(question, &id("pearson/r"), n);
    };
    let r = facts.number(&id("pearson/r"));
    let direction = r.map(Direction::of).filter(|_| test.is_significant());
    let mut found = Finding {
        direction,
        estimate: r.map(|value| Estimate {
            name: "r",
            value,
            ci95: facts.values.interval(&id("pearson/ci95")),
        }),
        ..Finding::decided(question, test, facts.design(n))
    };
    let least = facts.number(&id("pearson/smallest_p_two_sided"));
    if let Some(least) = least.filter(|p| !rejects(*p, facts.alpha)) {
        found.caveat(
            "too-few",
            format!(
                "with these {n} realizations no p below {} is possible",
                apa::bare_p(least)
            ),
        );
    }
    found
}

/// The permutation test of the correlation in a group of statistics.
fn permutation(facts: &PartFacts<'_>, group: &str) -> Option<Test> {
    let of = |what: &str| facts.number(&format!("{group}/pearson/{what}"));
    let r = of("r")?;
    let exact = of("p_exact_two_sided").map(|p| (TestKind::PermutationExact, p));
    let random = || of("p_monte_carlo_two_sided").map(|p| (TestKind::PermutationMonteCarlo, p));
    let (kind, p) = exact.or_else(random)?;
    Some(Test::single(kind, p, facts.alpha).with("r", Some(r), &[]))
}

fn interval_order(facts: &PartFacts<'_>) -> PartFinding {
    let question = PartQuestion::IntervalOrder;
    let (order, se) = (facts.number("pairs/order"), facts.number("pairs/order_se"));
    let Some(p) = facts.number("pairs/order_p") else {
        return facts.undefined(question, "pairs/order_p", 0);
    };
    let z = order.zip(se).map(|(order, se)| order / se);
    let test = Test::single(TestKind::Wald, p, facts.alpha).with("z", z, &[]);
    Finding {
        direction: order.map(Direction::of).filter(|_| test.is_significant()),
        estimate: order.and_then(|value| Estimate::of("order", value)),
        ..Finding::decided(question, test, facts.design(0))
    }
}

/// Whether standard and comparison are told apart, by condition.
pub(super) fn of_sensitivities(facts: &PartFacts<'_>, conditions: &[&str]) -> Vec<PartFinding> {
    let one = |condition: &&str| {
        let question = PartQuestion::ToldApart((*condition).to_owned());
        let id = |what: &str| format!("{}/{what}", group_id("sdt_group", &[condition]));
        let n = facts.number(&id("n")).unwrap_or(0.0) as usize;
        let Some(p) = facts.number(&id("above_chance/p")) else {
            return facts.undefined(question, &id("above_chance/p"), 0);
        };
        let t = facts.number(&id("above_chance/t"));
        let df = facts.number(&id("above_chance/df"));
        let test = Test::single(TestKind::OneSampleT, p, facts.alpha).with("t", t, &[df]);
        let above = facts.number(&id("above_chance/mean")).unwrap_or(0.0) > 0.0;
        let mut found = Finding {
            participants: n,
            estimate: facts.number(&id("d/mean")).map(|value| Estimate {
                name: "d'",
                value,
                ci95: facts.values.interval(&id("d/ci95")),
            }),
            ..Finding::decided(question, test, facts.design(0))
        };
        // Answers below chance do not show that the two are told apart.
        if found.is_yes() && !above {
            found.verdict = Verdict::NotShown;
            found.caveat(
                "below-chance",
                "answers are below chance: are the answers of the track interchanged?",
            );
        }
        found
    };
    conditions.iter().map(one).collect()
}

/// Whether thresholds differ between conditions, and their contrasts.
pub(super) fn of_thresholds(
    facts: &PartFacts<'_>,
    conditions: &[&str],
) -> (Vec<PartFinding>, Vec<Pair>) {
    of_model(facts, conditions, (PartQuestion::Thresholds, "psy_mixed"))
}

/// Whether estimates differ between realizations, their contrasts, and whether VAF predicts them.
pub(super) fn of_realizations(
    facts: &PartFacts<'_>,
    realizations: &[&str],
) -> (Vec<PartFinding>, Vec<Pair>) {
    let model = (PartQuestion::Magnitudes, "magnitude_mixed");
    let (mut found, pairs) = of_model(facts, realizations, model);
    if facts.values.get("magnitude/vaf/n_models").is_some() {
        found.push(with_vaf(facts, PartQuestion::MagnitudeVaf, "magnitude/vaf"));
    }
    (found, pairs)
}

/// The test of the conditions of a mixed model, and their contrasts; nothing without one.
fn of_model(
    facts: &PartFacts<'_>,
    conditions: &[&str],
    (question, model): (PartQuestion, &str),
) -> (Vec<PartFinding>, Vec<Pair>) {
    if facts.values.get(&format!("{model}/F")).is_none() {
        return (Vec::new(), Vec::new());
    }
    let of_pair = |a: &str, b: &str| {
        let id = pair_id(model, a, b);
        let ratio = facts.values.get(&format!("{id}/ratio")).is_some();
        let name = if ratio { "ratio" } else { "difference" };
        pair(facts, &id, (a, b), (name, TestKind::MixedContrast, "t"))
    };
    let mut pairs = Vec::new();
    for (i, a) in conditions.iter().enumerate() {
        pairs.extend(conditions[i + 1..].iter().filter_map(|b| of_pair(a, b)));
    }
    let of = |what: &str| facts.number(&format!("{model}/{what}"));
    let found = match of("p") {
        None => facts.undefined(question, &format!("{model}/p"), conditions.len()),
        Some(p) => {
            let test = Test::single(TestKind::MixedModel, p, facts.alpha).with(
                "F",
                of("F"),
                &[of("df1"), of("df2")],
            );
            Finding {
                participants: of("n_participants").unwrap_or(0.0) as usize,
                ..Finding::decided(question, test, facts.design(conditions.len()))
            }
        }
    };
    (vec![found], pairs)
}

/// Whether groups and sessions differ, where a study has them.
pub(super) fn of_groups_and_sessions(facts: &PartFacts<'_>) -> Vec<PartFinding> {
    let one = |(question, group, kind): (PartQuestion, &str, TestKind)| {
        let id = |what: &str| format!("{group}/{what}");
        facts.values.get(&id("F"))?;
        let p = match kind {
            TestKind::BetweenWithin => "p_gg",
            _ => "p",
        };
        let Some(p) = facts.number(&id(p)) else {
            return Some(facts.undefined(question, &id(p), 0));
        };
        // Of a test within participants both degrees of freedom are corrected.
        let epsilon = facts.number(&id("eps_gg")).unwrap_or(1.0);
        let df = ["df1", "df2"].map(|df| Some(facts.number(&id(df))? * epsilon));
        let test = Test::single(kind, p, facts.alpha).with("F", facts.number(&id("F")), &df);
        Some(Finding {
            estimate: only_pair(facts, group),
            ..Finding::decided(question, test, facts.design(0))
        })
    };
    let questions = [
        (PartQuestion::Groups, "groups", TestKind::Welch),
        (
            PartQuestion::GroupsConditions,
            "groups_conditions",
            TestKind::BetweenWithin,
        ),
        (PartQuestion::Sessions, "sessions", TestKind::MixedModel),
    ];
    questions.into_iter().filter_map(one).collect()
}

/// The contrast of two groups or sessions, where there are no more.
fn only_pair(facts: &PartFacts<'_>, group: &str) -> Option<Estimate> {
    let mut found = ["ratio", "difference"].into_iter().flat_map(|name| {
        let end = format!("/{name}");
        let start = format!("{group}/");
        let all = facts.values.iter();
        let of_pair = move |(id, _): (&'_ str, _)| {
            let pair = id.strip_prefix(&start)?.strip_suffix(&end)?;
            pair.contains('|').then(|| (name, format!("{start}{pair}")))
        };
        all.filter_map(of_pair).collect::<Vec<_>>()
    });
    let (name, id) = found.next()?;
    let alone = found.next().is_none();
    let value = facts.number(&format!("{id}/{name}")).filter(|_| alone)?;
    Some(Estimate {
        name,
        value,
        ci95: facts.values.interval(&format!("{id}/ci95")),
    })
}

/// The comparison of two, as statistics have it.
fn pair(
    facts: &PartFacts<'_>,
    id: &str,
    (a, b): (&str, &str),
    (name, kind, symbol): (&'static str, TestKind, &'static str),
) -> Option<Pair> {
    let get = |what: &str| facts.number(&format!("{id}/{what}"));
    let test = get("p_holm").map(|p| {
        let comparisons = facts.values.iter();
        let of_group = id.split('/').next().unwrap_or_default();
        let comparisons = comparisons.filter(|(other, _)| {
            other.starts_with(of_group) && other.contains('|') && other.ends_with("/p_holm")
        });
        let se = get("se_clustered").filter(|_| kind == TestKind::WaldClustered);
        let z = (get("difference").zip(se.or(get("se")))).map(|(d, se)| d / se);
        Test {
            comparisons: comparisons.count(),
            ..Test::single(kind, p, facts.alpha).with(symbol, get("t").or(z), &[get("df")])
        }
    });
    Some(Pair {
        first: a.to_owned(),
        second: b.to_owned(),
        participants: facts.participants,
        difference: Estimate {
            name,
            value: get(name)?,
            ci95: facts.values.interval(&format!("{id}/ci95")),
        },
        dz: None,
        verdict: match &test {
            Some(test) => test.verdict(),
            None => Verdict::Undefined(
                facts
                    .values
                    .reason(&format!("{id}/p"))
                    .unwrap_or("there is no test")
                    .to_owned(),
            ),
        },
        test,
        equivalence: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_below_chance_do_not_tell_apart() {
        let finding = |mean: f64| {
            let mut values = Values::default();
            let mut group = values.group("sdt_group/c", "");
            group.put("n", 6.0);
            group.put("d/mean", mean);
            for (id, x) in [("mean", mean), ("t", 8.0 * mean), ("df", 5.0), ("p", 0.001)] {
                group.put(&format!("above_chance/{id}"), x);
            }
            let facts = PartFacts {
                values: &values,
                alpha: 0.05,
                participants: 6,
            };
            of_sensitivities(&facts, &["c"]).remove(0)
        };
        let above = finding(0.5);
        assert_eq!((above.verdict, above.caveats.len()), (Verdict::Yes, 0));
        let below = finding(-0.5);
        assert_eq!(below.verdict, Verdict::NotShown);
        assert_eq!(below.caveats[0].code, "below-chance");
    }
}
