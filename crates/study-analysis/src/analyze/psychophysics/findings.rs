//! The findings of a part that is no rating.

mod groups;
mod rankings;
mod settings;

pub(super) use rankings::of_rankings;
pub(super) use settings::settings_of;

use super::abilities::AbilityDifference;
use super::again::Again;
use super::identification::Identified;
use super::over_participants::{ConditionModel, Contrast, FTest, GroupSensitivity};
use super::preferences::Preferences;
use super::similarity::{MapFit, Similarities};
use crate::analyze::design::Design;
use crate::analyze::findings::{Direction, Estimate, Finding, Pair, Test, TestKind, Verdict};
use crate::analyze::identifiers::group_id;
use crate::analyze::record::{Interval, Number, PairName, Stat};
use crate::analyze::results::{Correlation, Permuted};
use groups::{differ_by_group, of_unequal_groups};
use std::collections::BTreeMap;
use study_base::apa;
use study_base::sort::SmallSort as _;
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
    /// Are the labels of what is felt given more often than by guessing?
    Identified,
    /// Has a map of the realizations less stress than by chance?
    Structure,
    /// Do two dimensions predict a participant's ratings better than one?
    Dimensions,
    /// Does the map follow these properties of the realizations?
    MapFollows(String),
    /// Do participants rank realizations alike?
    RankedAlike,
    /// Is the realization with the highest worth above each other one?
    RankedFirst,
    /// Do settings differ from the standard?
    Adjusted,
    /// Do settings depend on the side from which they start?
    Starts,
    /// Do the groups differ?
    Groups,
    /// Do the differences between conditions depend on the group?
    GroupsConditions,
    /// Do the sessions differ?
    Sessions,
    /// Do the changes from session to session depend on the group?
    GroupsSessions,
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
            Self::Identified => "identified".to_owned(),
            Self::Structure => "structure".to_owned(),
            Self::Dimensions => "dimensions".to_owned(),
            Self::MapFollows(of) => group_id("map-follows", &[of]),
            Self::RankedAlike => "ranked-alike".to_owned(),
            Self::RankedFirst => "ranked-first".to_owned(),
            Self::Adjusted => "adjusted".to_owned(),
            Self::Starts => "starts".to_owned(),
            Self::Groups => "groups".to_owned(),
            Self::GroupsConditions => "groups-conditions".to_owned(),
            Self::Sessions => "sessions".to_owned(),
            Self::GroupsSessions => "groups-sessions".to_owned(),
        }
    }
}

/// The answer to a question about a part.
pub type PartFinding = Finding<PartQuestion>;

/// What findings are made from.
pub(super) struct PartFacts {
    pub(super) alpha: f64,
    pub(super) participants: usize,
}

impl PartFacts {
    fn design(&self, realizations: usize) -> Design {
        Design {
            participants: self.participants,
            realizations,
            ..Design::default()
        }
    }

    /// A question without an answer, because this statistic has none.
    fn undefined(
        &self,
        question: PartQuestion,
        statistic: impl Number,
        realizations: usize,
    ) -> PartFinding {
        let why = statistic.reason().unwrap_or(NO_TEST);
        Finding::undefined(question, why, self.design(realizations))
    }
}

const NO_TEST: &str = "there is no test";

/// The findings of preferences, and the differences of the realizations.
pub(super) fn of_preferences(
    facts: &PartFacts,
    preferences: &Preferences,
) -> (Vec<PartFinding>, Vec<Pair>) {
    let pairs = of_abilities(facts, preferences.pairs.iter());
    let mut found = vec![preferred(facts, preferences, &pairs)];
    if let Some(vaf) = &preferences.vaf {
        found.push(with_vaf(facts, PartQuestion::PreferenceVaf, vaf));
    }
    found.extend(interval_order(facts, preferences));
    (found, pairs)
}

/// How differences of abilities are tested.
fn test_of_abilities(facts: &PartFacts) -> (TestKind, &'static str) {
    match facts.participants {
        0 | 1 => (TestKind::Wald, "z"),
        _ => (TestKind::ClusteredT, "t"),
    }
}

/// The differences of abilities as comparisons, with Holm's correction.
fn of_abilities<'a>(
    facts: &PartFacts,
    differences: impl ExactSizeIterator<Item = (&'a PairName, &'a AbilityDifference)>,
) -> Vec<Pair> {
    let (kind, symbol) = test_of_abilities(facts);
    let comparisons = differences.len();
    let of_pair = |(name, pair): (&PairName, &AbilityDifference)| {
        let difference = pair.difference.number()?;
        let df: Vec<Option<f64>> = pair.statistic_df.iter().map(Number::number).collect();
        let test = pair.p_holm.number().map(|p| Test {
            comparisons,
            ..Test::single(kind, p, facts.alpha).with(symbol, pair.statistic.number(), &df)
        });
        let estimate = estimate("difference", difference, &pair.ci95);
        Some(compared(facts, name, estimate, test, &pair.p))
    };
    differences.filter_map(of_pair).collect()
}

fn estimate(name: &'static str, value: f64, ci95: &Interval) -> Estimate {
    Estimate {
        name,
        value,
        ci95: ci95.ends(),
    }
}

/// The comparison of two; without a test, the reason is that of its `p`.
fn compared(
    facts: &PartFacts,
    name: &PairName,
    difference: Estimate,
    test: Option<Test>,
    p: impl Number,
) -> Pair {
    let [first, second] = name.names().map(str::to_owned);
    let undefined = || Verdict::Undefined(p.reason().unwrap_or(NO_TEST).to_owned());
    Pair {
        first,
        second,
        participants: facts.participants,
        difference,
        dz: None,
        verdict: test.as_ref().map_or_else(undefined, Test::verdict),
        test,
        equivalence: None,
    }
}

/// The comparison with the smallest p; yes, if any differs.
fn preferred(facts: &PartFacts, preferences: &Preferences, pairs: &[Pair]) -> PartFinding {
    let question = PartQuestion::Preferred;
    let p = |pair: &&Pair| pair.test.as_ref().map_or(f64::INFINITY, |t| t.p);
    let clearest = pairs.iter().min_by(|a, b| p(a).total_cmp(&p(b)));
    let items = &preferences.items.0;
    let Some((pair, test)) = clearest.and_then(|pair| Some((pair, pair.test.clone()?))) else {
        let first = items.values().next().map(|item| &item.ability);
        return facts.undefined(question, first, items.len());
    };
    let mut found = Finding {
        estimate: Some(pair.difference),
        ..Finding::decided(question, test, facts.design(items.len()))
    };
    let mut abilities: Vec<(&str, f64)> = (items.iter())
        .map(|(name, item)| (name.as_str(), item.ability.number().unwrap_or(0.0)))
        .collect();
    abilities.small_sort_by(|a, b| b.1.total_cmp(&a.1));
    found.names = abilities.iter().map(|a| a.0.to_owned()).collect();
    if facts.participants < 2 {
        found.caveat(
            "one-participant",
            "with one participant the answers are taken for independent: it holds for this participant only",
        );
    }
    found
}

/// A correlation with VAF.
fn with_vaf(facts: &PartFacts, question: PartQuestion, vaf: &Correlation) -> PartFinding {
    let (n, pearson) = (vaf.n(), &vaf.pearson);
    let permuted = pearson.permuted.as_ref();
    let r = pearson.r.number();
    let tested = r
        .zip(permuted.and_then(Permuted::two_sided))
        .map(|(r, (p, exact))| {
            let kind = match exact {
                true => TestKind::PermutationExact,
                false => TestKind::PermutationMonteCarlo,
            };
            Test::single(kind, p, facts.alpha).with("r", Some(r), &[])
        });
    let Some(test) = tested else {
        return facts.undefined(question, &pearson.r, n);
    };
    let direction = r.map(Direction::of).filter(|_| test.is_significant());
    let mut found = Finding {
        direction,
        estimate: r.map(|value| Estimate {
            name: "r",
            value,
            ci95: pearson.ci95.as_ref().and_then(Interval::ends),
        }),
        ..Finding::decided(question, test, facts.design(n))
    };
    let least = permuted.and_then(|p| p.smallest_p_two_sided.number());
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

fn interval_order(facts: &PartFacts, preferences: &Preferences) -> Option<PartFinding> {
    let question = PartQuestion::IntervalOrder;
    let effect = preferences.order.as_ref()?;
    let order = effect.order.number();
    let Some(p) = effect.order_p.number() else {
        return Some(facts.undefined(question, &effect.order_p, 0));
    };
    let (kind, symbol) = match effect.order_t_df {
        Some(_) => (TestKind::ClusteredT, "t"),
        None => (TestKind::Wald, "z"),
    };
    let df: Vec<Option<f64>> = effect.order_t_df.iter().map(Number::number).collect();
    let test = Test::single(kind, p, facts.alpha).with(symbol, effect.order_t.number(), &df);
    Some(Finding {
        direction: order.map(Direction::of).filter(|_| test.is_significant()),
        estimate: order.and_then(|value| Estimate::of("order", value)),
        ..Finding::decided(question, test, facts.design(0))
    })
}

/// Whether standard and comparison of a condition are told apart.
pub(super) fn told_apart(
    facts: &PartFacts,
    condition: &str,
    found: &GroupSensitivity,
) -> PartFinding {
    let question = PartQuestion::ToldApart(condition.to_owned());
    let (d, above) = (&found.d, &found.above_chance);
    let Some(p) = above.p.number() else {
        return facts.undefined(question, &above.p, 0);
    };
    let test = Test::single(TestKind::OneSampleT, p, facts.alpha);
    let mut finding = Finding {
        participants: found.n.number().unwrap_or(0.0) as usize,
        estimate: d.mean.number().map(|mean| estimate("d'", mean, &d.ci95)),
        ..Finding::decided(
            question,
            test.with("t", above.t.number(), &[above.df.number()]),
            facts.design(0),
        )
    };
    // Answers below chance do not show that the two are told apart.
    if finding.is_yes() && above.sample.mean.number().unwrap_or(0.0) <= 0.0 {
        finding.verdict = Verdict::NotShown;
        finding.caveat(
            "below-chance",
            "answers are below chance: are the answers of the track interchanged?",
        );
    }
    finding
}

/// Whether labels are given more often than by guessing.
pub(super) fn identified(facts: &PartFacts, found: &Identified) -> PartFinding {
    let (question, labels) = (PartQuestion::Identified, found.labels.len());
    let above = &found.above_guessing;
    let Some(p) = above.p.number() else {
        return facts.undefined(question, &above.p, labels);
    };
    let test = Test::single(TestKind::OneSampleT, p, facts.alpha);
    let test = test.with("t", above.t.number(), &[above.df.number()]);
    let correct = found.all.correct.number();
    let mut finding = Finding {
        estimate: correct.map(|share| estimate("correct", share, &found.all.correct_ci95)),
        ..Finding::decided(question, test, facts.design(labels))
    };
    if finding.is_yes() && above.mean.number().unwrap_or(0.0) <= 0.0 {
        finding.verdict = Verdict::NotShown;
        finding.caveat(
            "below-chance",
            "answers are below those of guesses: are the labels of the part interchanged?",
        );
    }
    finding
}

/// Whether there is structure, how many dimensions it has, and what it follows.
pub(super) fn maps_of(facts: &PartFacts, found: &Similarities) -> Vec<PartFinding> {
    let realizations = found.map.len();
    let mut all = vec![
        has_structure(facts, found, realizations),
        dimensions(facts, found, realizations),
    ];
    let follows = found.follows.iter();
    all.extend(follows.map(|(name, fit)| map_follows(facts, name.as_str(), fit, realizations)));
    all
}

fn has_structure(facts: &PartFacts, found: &Similarities, realizations: usize) -> PartFinding {
    let (question, structure) = (PartQuestion::Structure, &found.structure);
    let Some(p) = structure.p.number() else {
        return facts.undefined(question, &structure.p, realizations);
    };
    let test = Test::single(TestKind::StressPermutation, p, facts.alpha);
    Finding {
        estimate: structure
            .stress
            .number()
            .and_then(|stress| Estimate::of("stress", stress)),
        ..Finding::decided(question, test, facts.design(realizations))
    }
}

fn dimensions(facts: &PartFacts, found: &Similarities, realizations: usize) -> PartFinding {
    let (question, second) = (PartQuestion::Dimensions, &found.second);
    let Some(p) = second.p.number() else {
        return facts.undefined(question, &second.p, realizations);
    };
    let test = Test::single(TestKind::OneSampleT, p, facts.alpha);
    let test = test.with("t", second.t.number(), &[second.df.number()]);
    let mut finding = Finding {
        estimate: (second.difference.number()).map(|d| estimate("difference", d, &second.ci95)),
        ..Finding::decided(question, test, facts.design(realizations))
    };
    // One dimension predicts better: a second one is not shown.
    if finding.is_yes() && second.difference.number().unwrap_or(0.0) <= 0.0 {
        finding.verdict = Verdict::NotShown;
    }
    finding
}

/// Whether the map follows these properties.
pub(super) fn map_follows(
    facts: &PartFacts,
    name: &str,
    fit: &MapFit,
    realizations: usize,
) -> PartFinding {
    let question = PartQuestion::MapFollows(name.to_owned());
    let (Some(r), Some(p)) = (fit.r.number(), fit.p.number()) else {
        return facts.undefined(question, &fit.p, realizations);
    };
    let kind = match fit.exact.is_set() {
        true => TestKind::PermutationExact,
        false => TestKind::PermutationMonteCarlo,
    };
    let test = Test::single(kind, p, facts.alpha).with("r", Some(r), &[]);
    let mut finding = Finding {
        estimate: Some(estimate("r", r, &fit.ci95)),
        ..Finding::decided(question, test, facts.design(realizations))
    };
    let least = fit.smallest_p.number();
    if let Some(least) = least.filter(|p| !rejects(*p, facts.alpha)) {
        finding.caveat(
            "too-few",
            format!(
                "with these {realizations} realizations no p below {} is possible",
                apa::bare_p(least)
            ),
        );
    }
    finding
}

/// Whether estimates differ between realizations, their contrasts, and whether VAF predicts them.
pub(super) fn of_realizations(
    facts: &PartFacts,
    model: Option<&ConditionModel>,
    vaf: Option<&Correlation>,
) -> (Vec<PartFinding>, Vec<Pair>) {
    let (found, pairs) = of_model(facts, PartQuestion::Magnitudes, model);
    let vaf = vaf.map(|vaf| with_vaf(facts, PartQuestion::MagnitudeVaf, vaf));
    (found.into_iter().chain(vaf).collect(), pairs)
}

/// The test of the conditions of a mixed model, and their contrasts; nothing without one.
pub(super) fn of_model(
    facts: &PartFacts,
    question: PartQuestion,
    model: Option<&ConditionModel>,
) -> (Option<PartFinding>, Vec<Pair>) {
    let Some(model) = model else {
        return (None, Vec::new());
    };
    let comparisons = model.pairs.len();
    let of_pair = |(name, contrast): (&PairName, &Contrast)| {
        let test = contrast.p_holm.number().map(|p| {
            let test = Test::single(TestKind::MixedContrast, p, facts.alpha);
            Test {
                comparisons,
                ..test.with("t", contrast.t.number(), &[contrast.df.number()])
            }
        });
        Some(compared(
            facts,
            name,
            of_contrast(contrast)?,
            test,
            &contrast.p,
        ))
    };
    let conditions = model.conditions.len();
    let found = match f_test(facts, TestKind::MixedModel, &model.test) {
        None => facts.undefined(question, &model.test.p, conditions),
        Some(test) => Finding {
            participants: model.n_participants.number().unwrap_or(0.0) as usize,
            ..Finding::decided(question, test, facts.design(conditions))
        },
    };
    (
        Some(found),
        model.pairs.iter().filter_map(of_pair).collect(),
    )
}

fn of_contrast(contrast: &Contrast) -> Option<Estimate> {
    let (name, value) = contrast.estimate();
    Some(estimate(name, value?, &contrast.ci95))
}

fn f_test(facts: &PartFacts, kind: TestKind, found: &FTest) -> Option<Test> {
    let df = [found.df1.number(), found.df2.number()];
    let test = Test::single(kind, found.p.number()?, facts.alpha);
    Some(test.with("F", found.f.number(), &df))
}

/// Whether groups and sessions differ, where a study has them.
pub(super) fn of_groups_and_sessions(facts: &PartFacts, again: &Again) -> Vec<PartFinding> {
    let decided = |question, test: Option<Test>, p: &Stat, estimate| match test {
        None => facts.undefined(question, p, 0),
        Some(test) => Finding {
            estimate,
            ..Finding::decided(question, test, facts.design(0))
        },
    };
    let groups = again.groups.as_ref().map(|g| {
        let test = f_test(facts, TestKind::Welch, &g.test);
        decided(PartQuestion::Groups, test, &g.test.p, only_pair(&g.pairs))
    });
    let profiles = again.groups_conditions.as_ref().map(|g| {
        let test = interaction(facts, &g.test, &g.eps_gg, &g.p_gg);
        decided(PartQuestion::GroupsConditions, test, &g.p_gg, None)
    });
    let sessions = again.sessions.as_ref().map(|s| {
        let test = f_test(facts, TestKind::MixedModel, &s.test);
        decided(PartQuestion::Sessions, test, &s.test.p, only_pair(&s.pairs))
    });
    let courses = again.groups_sessions.as_ref().map(|g| {
        let test = interaction(facts, &g.test, &g.eps_gg, &g.p_gg);
        // With more sessions F is about more than the change from the first to the last.
        let change = only_pair(&g.changes).filter(|_| g.n_sessions.number() == Some(2.0));
        let size = |n: &Stat| n.number().unwrap_or(0.0) as usize;
        Finding {
            participants: size(&g.n),
            ..decided(PartQuestion::GroupsSessions, test, &g.p_gg, change)
        }
    });
    let mut found: Vec<PartFinding> = [groups, profiles, sessions, courses]
        .into_iter()
        .flatten()
        .collect();
    differ_by_group(&mut found);
    of_unequal_groups(&mut found, again);
    found
}

/// The test of an interaction with the group: p and both degrees of freedom are corrected.
fn interaction(facts: &PartFacts, test: &FTest, eps_gg: &Stat, p_gg: &Stat) -> Option<Test> {
    let epsilon = eps_gg.number().unwrap_or(1.0);
    let df = [&test.df1, &test.df2].map(|df| Some(df.number()? * epsilon));
    let decides = Test::single(TestKind::BetweenWithin, p_gg.number()?, facts.alpha);
    Some(decides.with("F", test.f.number(), &df))
}

/// The contrast of two groups or sessions, where there are no more.
fn only_pair(pairs: &BTreeMap<PairName, Contrast>) -> Option<Estimate> {
    let first = pairs.values().next()?;
    of_contrast(first).filter(|_| pairs.len() == 1)
}

#[cfg(test)]
mod tests {
    use super::super::over_participants::{AboveChance, Sample};
    use super::*;

    #[test]
    fn answers_below_chance_do_not_tell_apart() {
        let finding = |mean: f64| {
            let sample = || Sample {
                mean: Stat::of(mean),
                ..Sample::undefined("")
            };
            let found = GroupSensitivity {
                d: sample(),
                above_chance: AboveChance {
                    sample: sample(),
                    t: Stat::of(8.0 * mean),
                    df: Stat::of(5.0),
                    p: Stat::of(0.001),
                },
                n: Stat::of(6.0),
            };
            let facts = PartFacts {
                alpha: 0.05,
                participants: 6,
            };
            told_apart(&facts, "c", &found)
        };
        let above = finding(0.5);
        assert_eq!((above.verdict, above.caveats.len()), (Verdict::Yes, 0));
        let below = finding(-0.5);
        assert_eq!(below.verdict, Verdict::NotShown);
        assert_eq!(below.caveats[0].code, "below-chance");
    }
}
