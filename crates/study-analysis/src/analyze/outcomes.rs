//! Measured outcomes: `outcomes/*`. Each is described by realization and compared between the
//! realizations, or by the factors, as ratings are; [`Ratings::of_measured`] puts it in their place.
//!
//! They decide no question of the study: their tests are corrected for the number of all of them
//! together, and no finding rests on them.

use super::adjusted::{self, Adjusted};
use super::cells::{Cell, Cells};
use super::design::Design;
use super::findings::{self, Compared, Direction, Finding, Question};
use super::measured::{MeasuredOutcome, OutcomeMean, OutcomePair, OutcomeTest, OutcomeVaf};
use super::record::{Interval, Number as _, OutcomeName, RealizationName, Stat};
use super::results::{AdjustedCells, FactorialTests};
use super::warning::Warning;
use super::{Better, Rules, effects, factorial, outcome_model};
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_base::text::counted;
use study_plan::protocol::{BetterEnd, Measure, OutcomeRules, Transform};
use study_session::outcome::ratings::{Measured, Ratings};
use study_stats::correlation::{pearson, spearman, within_subjects};
use study_stats::describe::{mean, quantile, sd, sorted};
use study_stats::paired::holm;

/// The share of trials without an outcome from which the report says so.
const MANY_MISSING: f64 = 0.05;

/// Means of what is analyzed, by participant and test realization.
type CellMeans = BTreeMap<(usize, usize), f64>;

const NOT_MEASURED: &str = "it was not measured";

/// What is said of an outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct OutcomeAnswer {
    /// What the protocol says of it.
    pub rules: OutcomeRules,
    /// Whether it differs between the realizations or, in a factorial study, each effect on it. p is
    /// corrected for the number of the tests of all outcomes together. Estimates are of what is analyzed.
    pub findings: Vec<Finding>,
    /// The test realizations in which it was measured, the best first, without `better` the lowest;
    /// equal ones by name. Untrusted.
    pub order: Vec<String>,
    /// What limits it.
    pub caveats: Vec<Warning>,
}

/// Each outcome that was measured, and what is said of it.
pub(super) fn outcomes(
    used: &Ratings,
    rules: &Rules,
) -> (BTreeMap<OutcomeName, MeasuredOutcome>, Vec<OutcomeAnswer>) {
    let measured = |outcome: &OutcomeRules| {
        let own = used.measured.iter().find(|m| m.id == outcome.id.as_str())?;
        Some(one(used, rules, outcome, own))
    };
    let (mut all, means): (Vec<(MeasuredOutcome, OutcomeAnswer)>, Vec<CellMeans>) =
        rules.outcomes.iter().filter_map(measured).unzip();
    correct(&mut all, rules);
    pair(&mut all, &means);
    all.into_iter()
        .map(|(record, answer)| ((answer.rules.id.as_str().into(), record), answer))
        .unzip()
}

fn one(
    used: &Ratings,
    rules: &Rules,
    outcome: &OutcomeRules,
    own: &Measured,
) -> ((MeasuredOutcome, OutcomeAnswer), CellMeans) {
    let transform = outcome.transform;
    let table = used.of_measured(own, |x| transform.apply(x));
    let cells = Cells::of(&table);
    let adjusted = Adjusted::of(&cells);
    let design = Design::of(&cells);
    let means = adjusted::adjusted(&cells, &adjusted);
    let differences = effects::ranks_and_anova(&cells);
    // The margin of equivalence is in points of the primary scale.
    let tests = factorial::factorial(&cells, &adjusted, rules, None);
    let mut findings = findings::compared(&Compared {
        design,
        rules,
        differences: &differences,
        cells: &means,
        factorial: tests.as_ref(),
    });
    for finding in &mut findings {
        // They speak of ratings.
        finding.caveats.clear();
    }
    let counts = Counts::of(used, own, outcome);
    let has_factors = tests.is_some();
    // Of the numbers themselves, also where their logarithms are compared.
    let numbers: Vec<(usize, f64)> = trials(used, own)
        .filter_map(|(i, value)| Some((i, value?)))
        .collect();
    let record = MeasuredOutcome {
        n: Stat::count(counts.measured),
        n_missing: Stat::count(counts.missing),
        n_left_out: (transform == Transform::Log).then(|| Stat::count(counts.left_out)),
        means: described(used, own, transform, &means),
        differ: match has_factors {
            true => None,
            false => findings.first().map(tested),
        },
        rmanova: (!has_factors && design.uses_complete()).then_some(differences.rmanova),
        factorial: tests,
        vaf: with_vaf(&cells, &adjusted),
        pairs: BTreeMap::new(),
        model: outcome_model::model(used, &numbers, outcome, rules.crossing.as_ref()),
    };
    let answer = OutcomeAnswer {
        order: order(&means, outcome.better),
        caveats: caveats(&counts, design, outcome),
        rules: outcome.clone(),
        findings,
    };
    let tested = cells.tested();
    let of_cell = |cell: &Cell| {
        let tested = tested.binary_search(&cell.model).is_ok();
        tested.then_some(((cell.subject, cell.model), cell.mean))
    };
    let means = cells.cells.iter().filter_map(of_cell).collect();
    ((record, answer), means)
}

/// The relation of each time with what else was measured.
fn pair(all: &mut [(MeasuredOutcome, OutcomeAnswer)], means: &[CellMeans]) {
    let is_time = |rules: &OutcomeRules| match &rules.measure {
        Measure::Clock(_) => true,
        Measure::Device(number) => ["s", "ms", "min"].contains(&number.unit.as_str()),
        Measure::Telemetry(_) | Measure::Answers(_) | Measure::Questionnaire(_) => false,
    };
    let rules: Vec<OutcomeRules> = all.iter().map(|(_, answer)| answer.rules.clone()).collect();
    for (at, (record, _)) in all.iter_mut().enumerate() {
        let own = &rules[at];
        if !is_time(own) || own.better.is_none() {
            continue;
        }
        for (other, rules) in rules.iter().enumerate() {
            if is_time(rules) || rules.better.is_none() {
                continue;
            }
            let name = rules.id.as_str().into();
            record.pairs.insert(name, paired(&means[at], &means[other]));
        }
    }
}

/// The correlation of cell means within participants.
fn paired(time: &CellMeans, other: &CellMeans) -> OutcomePair {
    let both: Vec<(usize, f64, f64)> = (time.iter())
        .filter_map(|(cell, x)| Some((cell.0, *x, *other.get(cell)?)))
        .collect();
    let lengths: Vec<usize> = (both.chunk_by(|a, b| a.0 == b.0)).map(<[_]>::len).collect();
    let x: Vec<f64> = both.iter().map(|b| b.1).collect();
    let y: Vec<f64> = both.iter().map(|b| b.2).collect();
    match within_subjects(&x, &y, &lengths) {
        None => OutcomePair::undefined(
            "too few participants and realizations with both, or one does not vary",
        ),
        Some(found) => OutcomePair {
            r: Stat::of(found.r),
            df: Stat::of(found.df),
            ci95: Interval::or(
                found.ci95,
                "too few participants and realizations with both",
            ),
        },
    }
}

/// Trials with a rating. A questionnaire is not asked in every trial: where it is missing, it has no score
/// in any trial of a participant and realization.
struct Counts {
    measured: usize,
    missing: usize,
    /// Of how many it could be missing.
    asked: usize,
    left_out: usize,
}

impl Counts {
    fn of(used: &Ratings, own: &Measured, outcome: &OutcomeRules) -> Self {
        let values: Vec<(usize, Option<f64>)> = trials(used, own).collect();
        let measured: Vec<f64> = values.iter().filter_map(|trial| trial.1).collect();
        let (asked, with) = match &outcome.measure {
            Measure::Questionnaire(_) => {
                let cell =
                    |trial: &(usize, Option<f64>)| (used.subject[trial.0], used.model[trial.0]);
                let all: BTreeSet<_> = values.iter().map(cell).collect();
                let scored = values.iter().filter(|trial| trial.1.is_some());
                let with: BTreeSet<_> = scored.map(cell).collect();
                (all.len(), with.len())
            }
            Measure::Clock(_)
            | Measure::Telemetry(_)
            | Measure::Answers(_)
            | Measure::Device(_) => (values.len(), measured.len()),
        };
        let left_out = |x: &&f64| outcome.transform.apply(**x).is_none();
        Self {
            missing: asked - with,
            asked,
            left_out: measured.iter().filter(left_out).count(),
            measured: measured.len(),
        }
    }
}

/// The row of each trial whose rating counts, with what was measured in it.
fn trials<'a>(
    used: &'a Ratings,
    own: &'a Measured,
) -> impl Iterator<Item = (usize, Option<f64>)> + 'a {
    let rated = move |i: &usize| used.rating[*i].is_some() && used.model[*i].is_some();
    (0..used.len())
        .filter(rated)
        .map(move |i| (i, own.values[i]))
}

fn described(
    used: &Ratings,
    own: &Measured,
    transform: Transform,
    means: &AdjustedCells,
) -> BTreeMap<RealizationName, OutcomeMean> {
    let mut of_model: Vec<(Vec<f64>, Vec<u32>)> = vec![Default::default(); used.models.len()];
    for (i, value) in trials(used, own) {
        let (Some(value), Some(model)) = (value, used.model[i]) else {
            continue;
        };
        let (values, subjects) = &mut of_model[model as usize];
        values.push(value);
        subjects.push(used.subject[i]);
    }
    let one = |(model, (values, mut subjects)): (_, (Vec<f64>, Vec<u32>))| {
        let name: &str = model;
        subjects.sort_unstable();
        subjects.dedup();
        let logs: Vec<f64> = values.iter().filter_map(|x| transform.apply(*x)).collect();
        let geometric = mean(&logs).map(|log| transform.back(log));
        let compared = means.means.get(name);
        let center = compared.map(|c| {
            let center = c.mean.number().map(|x| transform.back(x));
            Stat::or(center, c.mean.reason().unwrap_or_default().to_owned())
        });
        let interval = compared.map(|c| {
            let ends = c.ci95.ends();
            let why = c.ci95.lo.reason().unwrap_or_default().to_owned();
            Interval::or(
                ends.map(|(lo, hi)| (transform.back(lo), transform.back(hi))),
                why,
            )
        });
        let of = OutcomeMean {
            n: Stat::count(values.len()),
            mean: Stat::or(mean(&values), NOT_MEASURED),
            sd: Stat::or(sd(&values), "it was measured in fewer than two trials"),
            median: Stat::or(quantile(&sorted(&values), 0.5), NOT_MEASURED),
            geometric_mean: (transform == Transform::Log)
                .then(|| Stat::or(geometric, "it was never above 0")),
            n_participants: Stat::count(subjects.len()),
            center,
            center_ci95: interval,
        };
        (name.into(), of)
    };
    let names = used.models.iter().map(|m| m.id.as_str());
    names.zip(of_model).map(one).collect()
}

/// The numbers of a finding before it is corrected for the number of tests.
fn tested(finding: &Finding) -> OutcomeTest {
    let why = finding.reason().unwrap_or("the test has none").to_owned();
    let or = |x: Option<f64>| Stat::or(x, why.clone());
    let test = finding.test.as_ref();
    let statistic = test.and_then(|t| t.statistic.as_ref());
    let df = |i: usize| or(statistic.and_then(|s| s.df.get(i).copied()));
    OutcomeTest {
        statistic: or(statistic.map(|s| s.value)),
        df1: df(0),
        df2: df(1),
        p: or(test.map(|t| t.p)),
        p_holm: or(None),
        effect: or(finding.effect.map(|e| e.value)),
        n_participants: Stat::count(finding.participants),
    }
}

/// The p of an effect that decides it, without correction for the number of effects.
fn uncorrected(tests: &FactorialTests, effect: &str) -> Option<f64> {
    let own = tests.effects.get(effect)?;
    match &own.clustered {
        Some(clustered) => clustered.p.number(),
        None => own.p_gg.number(),
    }
}

/// Corrects the tests of all outcomes together for their number.
fn correct(all: &mut [(MeasuredOutcome, OutcomeAnswer)], rules: &Rules) {
    let p = |record: &MeasuredOutcome, finding: &Finding| match (
        &finding.question,
        &record.factorial,
    ) {
        (Question::Effect(effect), Some(tests)) => uncorrected(tests, effect),
        _ => finding.test.as_ref().map(|t| t.p),
    };
    let family: Vec<Option<f64>> = (all.iter())
        .flat_map(|(record, answer)| answer.findings.iter().map(move |f| p(record, f)))
        .collect();
    let comparisons = family.iter().flatten().count();
    let mut corrected = holm(&family).into_iter();
    for (record, answer) in all {
        for finding in &mut answer.findings {
            let Some(Some(p)) = corrected.next() else {
                continue;
            };
            if let Some(test) = &mut finding.test {
                (test.p, test.comparisons, test.level) = (p, comparisons, rules.alpha);
                finding.verdict = test.verdict();
            }
            finding.direction = (finding.estimate)
                .filter(|_| finding.is_yes())
                .map(|e| Direction::of(e.value));
            let own = match (&finding.question, &mut record.factorial) {
                (Question::Effect(effect), Some(tests)) => (tests.effects)
                    .get_mut(effect.as_str())
                    .and_then(|effect| effect.p_holm.as_mut()),
                _ => record.differ.as_mut().map(|test| &mut test.p_holm),
            };
            if let Some(own) = own {
                *own = Stat::of(p);
            }
        }
    }
}

/// Of the tested realizations with a VAF; `None` where fewer than three have one.
fn with_vaf(cells: &Cells<'_>, adjusted: &Adjusted) -> Option<OutcomeVaf> {
    let means = adjusted.means.as_ref().ok()?;
    let (vaf, means): (Vec<f64>, Vec<f64>) = (adjusted.models.iter().zip(means))
        .filter_map(|(&model, mean)| Some((cells.vaf[model]?, *mean)))
        .unzip();
    let constant = "all means or all VAFs are equal";
    (vaf.len() >= 3).then(|| OutcomeVaf {
        n: Stat::count(vaf.len()),
        r: Stat::or(pearson(&vaf, &means), constant),
        rho: Stat::or(spearman(&vaf, &means), constant),
    })
}

fn order(means: &AdjustedCells, better: Option<BetterEnd>) -> Vec<String> {
    let better = match better {
        Some(BetterEnd::Higher) => Better::Higher,
        Some(BetterEnd::Lower) | None => Better::Lower,
    };
    let mut ranked: Vec<(f64, &str)> = (means.means.iter())
        .filter_map(|(name, of)| Some((of.mean.number()?, name.as_str())))
        .collect();
    ranked.small_sort_by(|x, y| better.best_first(x.0, y.0).then(x.1.cmp(y.1)));
    ranked
        .into_iter()
        .map(|(_, name)| name.to_owned())
        .collect()
}

fn caveats(counts: &Counts, design: Design, outcome: &OutcomeRules) -> Vec<Warning> {
    let mut found = Vec::new();
    let all = counts.asked;
    let many = |n: usize| n as f64 > MANY_MISSING * all as f64;
    let of = match &outcome.measure {
        Measure::Questionnaire(_) => counted(
            all,
            "realization of a participant",
            "realizations of the participants",
        ),
        Measure::Clock(_) | Measure::Telemetry(_) | Measure::Answers(_) | Measure::Device(_) => {
            counted(all, "trial", "trials")
        }
    };
    let mut tell = |code: &'static str, text: String| found.push(Warning { code, text });
    if many(counts.missing) {
        tell(
            "outcome-missing",
            format!("it was not measured in {} of {of}", counts.missing),
        );
    }
    if counts.left_out > 0 {
        tell(
            "outcome-left-out",
            format!(
                "it was 0 or less in {}, which {} no logarithm and {} left out",
                counted(counts.left_out, "trial", "trials"),
                if counts.left_out == 1 { "has" } else { "have" },
                if counts.left_out == 1 { "is" } else { "are" }
            ),
        );
    }
    if design.complete < design.participants {
        let people = counted(design.participants, "participant", "participants");
        let id = &outcome.id;
        tell(
            "outcome-incomplete",
            match design.uses_complete() {
                true => format!(
                    "{} of {people} have {id} in every realization; the others are left out of its tests",
                    design.complete
                ),
                false => format!(
                    "{} of {people} have {id} in every realization; it is compared within participants, over all of \
                     them, assuming that what is missing does not depend on what it would have been",
                    design.complete
                ),
            },
        );
    }
    found
}
