//! Findings: the answer to each question of the study.
//!
//! A finding has a verdict, the test that decided, what it rests on, an estimate and
//! its caveats. The terminal page, the report, JSON, CSV and the paragraphs print
//! findings and decide nothing. docs/report.md states which test decides: the choice
//! depends on the design and never on a rating.

mod differ;
mod factors;
mod missing;
mod others;
mod pairs;
mod sites;
mod told_apart;
mod vaf;

use super::Rules;
use super::cells::Cells;
use super::design::Design;
use super::question::FindingNumbers;
use super::record::{Interval, Stat, Why};
use super::results::{AdjustedCells, Differences, Evidence, FactorialTests};
use super::verdicts;
use super::warning::Warning;
use std::collections::BTreeMap;
use study_stats::level;

pub use super::question::Question;
pub use pairs::Pair;
pub(super) use vaf::{AboutVaf, vaf as of_vaf};

/// The answer to a question.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Verdict {
    /// The deciding test is significant.
    Yes,
    /// It is not: nothing is shown.
    NotShown,
    /// There is no such test, because of this.
    Undefined(String),
}

impl Verdict {
    /// The word in `--json`.
    pub fn as_str(&self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::NotShown => "not shown",
            Self::Undefined(_) => "undefined",
        }
    }
}

/// The direction of an effect that is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// The rating rises.
    Up,
    /// The rating falls.
    Down,
    /// The rating is a curved function.
    Curved,
}

impl Direction {
    /// The word in `--json`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
            Self::Curved => "curved",
        }
    }

    pub(super) fn of(estimate: f64) -> Self {
        if estimate > 0.0 { Self::Up } else { Self::Down }
    }
}

/// A test that can decide a question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestKind {
    /// Repeated-measures analysis of variance of two realizations: a paired t test.
    Anova,
    /// The same with the Greenhouse–Geisser correction.
    AnovaGreenhouseGeisser,
    /// The same with the Huynh–Feldt correction.
    AnovaHuynhFeldt,
    /// F of a mixed model, Satterthwaite's degrees of freedom.
    MixedModel,
    /// F of the realizations within participants, over all cell means.
    WithinParticipants,
    /// Friedman's test with its exact distribution.
    FriedmanExact,
    /// Friedman's test with Iman and Davenport's F.
    Friedman,
    /// Paired t test.
    PairedT,
    /// Contrast of a mixed model.
    MixedContrast,
    /// Difference within participants, over all cell means.
    WithinContrast,
    /// t test of the slope of means that are weighted by their precision.
    WeightedTrend,
    /// Permutation test over all orders of the realizations.
    PermutationExact,
    /// Permutation test over random orders of the realizations.
    PermutationMonteCarlo,
    /// Stress after each participant's ratings were dealt to the pairs at random.
    StressPermutation,
    /// Kendall's W over all orders of each participant's ranks.
    RanksExact,
    /// Kendall's W over random orders of each participant's ranks.
    RanksMonteCarlo,
    /// Sign test of which of two is above the other, over participants.
    Sign,
    /// F of the interaction of participants and realizations, against the variance within
    /// cells.
    Interaction,
    /// F of the differences between the participants' slopes on VAF, against the rest of
    /// the interaction.
    SlopesDiffer,
    /// t test of a regression slope.
    SlopeT,
    /// Two one-sided t tests.
    Equivalence,
    /// t test of a mean over participants.
    OneSampleT,
    /// An estimate over its standard error.
    Wald,
    /// The same, with a standard error over participants as clusters and t.
    ClusteredT,
    /// F of the interaction of site and realization, with the Greenhouse–Geisser correction.
    BetweenWithin,
    /// F of the differences between sites in one number of each participant.
    BetweenSites,
    /// Welch's analysis of variance between groups of participants.
    Welch,
    /// F of an effect of a factorial analysis of variance over participants.
    FactorialAnova,
    /// The same with the Greenhouse–Geisser correction.
    FactorialAnovaGreenhouseGeisser,
    /// t of the clearest contrast of an effect within participants over all cell means, with standard
    /// errors clustered by participant.
    FactorialWithin,
}

impl TestKind {
    /// The word in `--json`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Anova => "anova",
            Self::AnovaGreenhouseGeisser => "anova-greenhouse-geisser",
            Self::AnovaHuynhFeldt => "anova-huynh-feldt",
            Self::MixedModel => "mixed-model",
            Self::WithinParticipants => "within-participants",
            Self::FriedmanExact => "friedman-exact",
            Self::Friedman => "friedman",
            Self::PairedT => "paired-t",
            Self::MixedContrast => "mixed-contrast",
            Self::WithinContrast => "within-contrast",
            Self::WeightedTrend => "weighted-trend",
            Self::PermutationExact => "permutation-exact",
            Self::PermutationMonteCarlo => "permutation-monte-carlo",
            Self::StressPermutation => "stress-permutation",
            Self::RanksExact => "ranks-exact",
            Self::RanksMonteCarlo => "ranks-monte-carlo",
            Self::Sign => "sign",
            Self::Interaction => "interaction",
            Self::SlopesDiffer => "slopes-differ",
            Self::SlopeT => "slope-t",
            Self::Equivalence => "equivalence",
            Self::OneSampleT => "one-sample-t",
            Self::Wald => "wald",
            Self::ClusteredT => "clustered-t",
            Self::BetweenWithin => "between-within",
            Self::BetweenSites => "between-sites",
            Self::Welch => "welch",
            Self::FactorialAnova => "factorial-anova",
            Self::FactorialAnovaGreenhouseGeisser => "factorial-anova-greenhouse-geisser",
            Self::FactorialWithin => "factorial-within",
        }
    }
}

/// A test statistic.
#[derive(Debug, Clone, PartialEq)]
pub struct Statistic {
    /// `F`, `t`, `z`, `χ²` or `r`.
    pub symbol: &'static str,
    /// Its value.
    pub value: f64,
    /// Its degrees of freedom, corrected where the test corrects them; may be empty.
    pub df: Vec<f64>,
}

/// The test that decides a question.
#[derive(Debug, Clone, PartialEq)]
pub struct Test {
    /// Which test.
    pub kind: TestKind,
    /// Its statistic.
    pub statistic: Option<Statistic>,
    /// Its p, corrected for the number of comparisons.
    pub p: f64,
    /// The level against which p is held.
    pub level: f64,
    /// The number of tests for which p or the level is corrected; 1 if it is not.
    pub comparisons: usize,
}

impl Test {
    /// The test of a question that has only one.
    pub(super) fn single(kind: TestKind, p: f64, level: f64) -> Self {
        Self {
            kind,
            statistic: None,
            p,
            level,
            comparisons: 1,
        }
    }

    pub(super) fn with(
        mut self,
        symbol: &'static str,
        value: Option<f64>,
        df: &[Option<f64>],
    ) -> Self {
        let df: Option<Vec<f64>> = df.iter().copied().collect();
        self.statistic = value.map(|value| Statistic {
            symbol,
            value,
            df: df.unwrap_or_default(),
        });
        self
    }

    /// Whether it is significant.
    pub fn is_significant(&self) -> bool {
        level::rejects(self.p, self.level)
    }

    pub(super) fn verdict(&self) -> Verdict {
        if self.is_significant() {
            Verdict::Yes
        } else {
            Verdict::NotShown
        }
    }
}

/// An estimate or an effect size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// What is estimated: `r`, `difference`, `slope`, `dz`, `generalized eta squared` …
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its 95 % interval.
    pub ci95: Option<(f64, f64)>,
}

impl Estimate {
    pub(super) fn of(name: &'static str, value: f64) -> Option<Self> {
        Some(Self {
            name,
            value,
            ci95: None,
        })
    }
}

/// The answer to a question, with what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding<Q = Question> {
    /// The question.
    pub question: Q,
    /// The answer.
    pub verdict: Verdict,
    /// The direction of the effect, where it is shown and has one.
    pub direction: Option<Direction>,
    /// The realizations that it is about, such as the best and the second. Untrusted.
    pub names: Vec<String>,
    /// The test that decided.
    pub test: Option<Test>,
    /// The participants on whom it rests.
    pub participants: usize,
    /// The realizations on which it rests.
    pub realizations: usize,
    /// The main estimate.
    pub estimate: Option<Estimate>,
    /// A standardized effect size.
    pub effect: Option<Estimate>,
    /// What limits it.
    pub caveats: Vec<Warning>,
}

impl<Q> Finding<Q> {
    /// A finding without a test.
    pub(super) fn undefined(question: Q, why: impl Into<String>, design: Design) -> Self {
        Self {
            question,
            verdict: Verdict::Undefined(why.into()),
            direction: None,
            names: Vec::new(),
            test: None,
            participants: design.participants,
            realizations: design.realizations,
            estimate: None,
            effect: None,
            caveats: Vec::new(),
        }
    }

    /// The finding that a test decides.
    pub(super) fn decided(question: Q, test: Test, design: Design) -> Self {
        Self {
            verdict: test.verdict(),
            test: Some(test),
            ..Self::undefined(question, "", design)
        }
    }

    pub(super) fn caveat(&mut self, code: &'static str, text: impl Into<String>) {
        self.caveats.push(Warning {
            code,
            text: text.into(),
        });
    }

    /// Whether it is a yes.
    pub fn is_yes(&self) -> bool {
        self.verdict == Verdict::Yes
    }

    /// Why there is no verdict.
    pub fn reason(&self) -> Option<&str> {
        match &self.verdict {
            Verdict::Undefined(why) => Some(why),
            Verdict::Yes | Verdict::NotShown => None,
        }
    }
}

/// What findings are made from.
struct Facts<'a> {
    cells: &'a Cells<'a>,
    design: Design,
    rules: &'a Rules,
    evidence: &'a Evidence,
    pairs: Vec<Pair>,
    /// Adjusted mean and name of the tested realizations, best first.
    ranked: Vec<(f64, &'a str)>,
}

/// What realizations and factors are compared by.
pub(super) struct Compared<'a> {
    pub(super) design: Design,
    pub(super) rules: &'a Rules,
    pub(super) differences: &'a Differences,
    pub(super) cells: &'a AdjustedCells,
    pub(super) factorial: Option<&'a FactorialTests>,
}

impl Facts<'_> {
    fn compared(&self) -> Compared<'_> {
        Compared {
            design: self.design,
            rules: self.rules,
            differences: &self.evidence.differences,
            cells: &self.evidence.cells,
            factorial: self.evidence.factorial.as_ref(),
        }
    }
}

/// Whether the factors matter or, in a study without, whether the realizations differ.
pub(super) fn compared(facts: &Compared<'_>) -> Vec<Finding> {
    match facts.factorial {
        Some(_) => factors::factors(facts),
        None => differ::differ(facts).into_iter().collect(),
    }
}

/// All findings, in the order of a report, and the comparisons of pairs.
pub(super) fn findings(
    cells: &Cells<'_>,
    design: Design,
    rules: &Rules,
    evidence: &Evidence,
) -> (Vec<Finding>, Vec<Pair>) {
    let facts = Facts {
        cells,
        design,
        rules,
        evidence,
        pairs: evidence
            .pairs
            .as_ref()
            .map_or_else(Vec::new, |tests| pairs::all(cells, design, rules, tests)),
        ranked: verdicts::ranked(
            cells.tested().into_iter().map(|m| cells.model_name(m)),
            &evidence.cells,
            rules.better,
        ),
    };
    let mut found = factors::factors(&facts.compared());
    found.extend(others::against_references(&facts));
    let about_vaf = AboutVaf {
        adjusted: &evidence.corr_adjusted,
        beside: Some((&evidence.corr, &evidence.equivalence)),
        influence: Some(&evidence.influence),
    };
    found.extend(vaf::vaf(cells, design, rules, &about_vaf));
    found.extend(vaf::delivered(&facts));
    found.extend(others::memory(&facts));
    found.extend(pairs::best(&facts));
    found.extend(differ::differ(&facts.compared()));
    found.extend(pairs::which(&facts));
    found.extend(others::disagreement(&facts));
    found.extend(others::order(&facts));
    found.extend(others::carry_over(&facts));
    others::disagreement_as_caveat(&mut found);
    found.extend(others::repeats(&facts));
    found.extend(sites::sites(&facts));
    missing::with_missing_moved(&facts, &mut found);
    let mut pairs = facts.pairs;
    told_apart::withdraw(cells, evidence, &mut found, &mut pairs);
    (found, pairs)
}

/// The numbers of all findings.
pub(super) fn numbers(findings: &[Finding]) -> BTreeMap<Question, FindingNumbers> {
    let of = |f: &Finding| (f.question.clone(), numbers_of(f));
    findings.iter().map(of).collect()
}

fn numbers_of(f: &Finding) -> FindingNumbers {
    let why = Why::from(
        f.reason()
            .unwrap_or("the question has no such number")
            .to_owned(),
    );
    let or = |x: Option<f64>| Stat::or(x, why.clone());
    let verdict = match f.verdict {
        Verdict::Yes => Some(1.0),
        Verdict::NotShown => Some(0.0),
        Verdict::Undefined(_) => None,
    };
    let test = f.test.as_ref();
    let statistic = test.and_then(|t| t.statistic.as_ref());
    let df = |i: usize| or(statistic.and_then(|s| s.df.get(i).copied()));
    FindingNumbers {
        verdict: or(verdict),
        p: or(test.map(|t| t.p)),
        level: or(test.map(|t| t.level)),
        statistic: or(statistic.map(|s| s.value)),
        df1: df(0),
        df2: df(1),
        estimate: or(f.estimate.map(|e| e.value)),
        ci95: Interval::or(f.estimate.and_then(|e| e.ci95), why.clone()),
        effect: or(f.effect.map(|e| e.value)),
        n_participants: Stat::count(f.participants),
        n_realizations: Stat::count(f.realizations),
    }
}
