//! Weber fractions at two standards: how often a study finds that .10 and .14 differ, and that equal ones do.

use crate::draws::Random;
use crate::tracks::{levels, simulate};
use study_base::rng::Stream;
use study_plan::procedure::{Function, Ladder, Parameter, QuestPlus, Rule, Scale, Staircase, Stop};
use study_stats::describe::{mean, sd};
use study_stats::distribution::normal_cdf;
use study_stats::paired::one_sample;
use study_stats::psychometric::hierarchy::{
    Cell, Condition, Effort, PopulationPriors, partial_pooling,
};
use study_stats::psychometric::{
    Core, Experiment, Priors, Spacing, Support, WidthPrior, posterior,
};

/// The fraction at the first standard.
const FRACTION: f64 = 0.1;
/// Of natural logarithms of fractions, between participants.
const BETWEEN: f64 = 0.3;
/// Of what a standard does to a participant.
const INTERACTION: f64 = 0.1;
/// The share of lapses.
const LAPSE: f64 = 0.02;
/// Trials of each track.
const TRIALS: u32 = 40;

/// What a line of a study has. The test is the paired t test of logarithms, which is that of the mixed model with
/// two conditions.
const COLUMNS: [&str; 8] = [
    "differ",
    "error",
    "holds",
    "square",
    "converged",
    "differ together",
    "error together",
    "holds together",
];

/// A name, and the share of correct answers without guesses and lapses at a multiple of the threshold.
type Observer = (&'static str, fn(f64) -> f64);

/// Studies that are alike.
pub(crate) struct Weber {
    /// Name in the file.
    pub(crate) name: String,
    rule: Rule,
    people: usize,
    ratio: f64,
    /// As of an [`Observer`].
    felt: fn(f64) -> f64,
}

/// A cumulative normal from 5 % at half the threshold to 95 % at one and a half, as `study power` assumes.
fn normal(x: f64) -> f64 {
    normal_cdf((x - 1.0) * 3.289_707_253_902_944)
}

fn proportional(x: f64) -> f64 {
    2.0 * normal_cdf(0.674_489_750_196_082 * x) - 1.0
}

/// Parts of the standard: 70 levels from 0.02 to 1.4.
fn ladder() -> Ladder {
    let levels = (1..=70).map(|i| f64::from(i) / 50.0);
    Ladder::new(levels.collect()).expect("levels rise")
}

fn rules() -> [(&'static str, Rule); 2] {
    let staircase = Staircase {
        up: 1,
        down: 3,
        start: 0.3,
        steps: vec![0.08, 0.04],
        scale: Scale::Lin,
        step_up_factor: 1.0,
        min_level: None,
        max_level: None,
        initial_one_up_one_down: true,
        stop: Stop {
            reversals: TRIALS,
            min_trials: TRIALS,
            max_trials: TRIALS,
        },
        estimate_last: 6,
    };
    // As a protocol that gives no grids.
    let thresholds = (0..60)
        .map(|i| ladder().level((i * 69 + 29) / 59))
        .collect();
    let parameters = vec![
        Parameter::new("threshold", thresholds),
        Parameter::new("slope", vec![0.8, 1.3, 2.0, 3.0, 5.0, 8.0]),
        Parameter::new("gamma", vec![0.5]),
        Parameter::new("lambda", vec![0.01, 0.03, 0.06]),
    ];
    let quest = QuestPlus::new(Function::Weibull, parameters, TRIALS);
    [
        ("QUEST+", Rule::QuestPlus(quest)),
        ("1-up-3-down", Rule::Staircase(staircase)),
    ]
}

/// All studies whose names have this text.
pub(crate) fn all(only: &str) -> Vec<Weber> {
    let mut found = Vec::new();
    let observers: [Observer; 2] = [("normal", normal), ("d′ in proportion", proportional)];
    for (rule_name, rule) in rules() {
        for (observer, felt) in observers {
            for people in [10, 20] {
                for (second, ratio) in [("0.10", 1.0), ("0.14", 1.4)] {
                    found.push(Weber {
                        name: format!("Weber {second} {people} {rule_name} {observer}"),
                        rule: rule.clone(),
                        people,
                        ratio,
                        felt,
                    });
                }
            }
        }
    }
    found.retain(|one| one.name.contains(only));
    found
}

impl Weber {
    /// Simulates and fits a study; the results are those of [`COLUMNS`].
    pub(crate) fn study(&self, index: u64) -> Vec<f64> {
        let mut stream = Stream::new(index, &["weber", &self.name]);
        let ladder = ladder();
        let (mut cells, mut truths) = (Vec::new(), Vec::new());
        for participant in 0..self.people {
            let own = FRACTION.ln() + BETWEEN * stream.normal();
            for (condition, change) in [0.0, self.ratio.ln()].into_iter().enumerate() {
                let truth = own + change + INTERACTION * stream.normal();
                let correct = |level: f64| 0.5 + (0.5 - LAPSE) * (self.felt)(level / truth.exp());
                let (answers, _) = simulate(&self.rule, &ladder, correct, &mut stream);
                cells.push(Cell {
                    participant,
                    condition,
                    levels: Spacing::Log.places(&levels(&answers)),
                });
                truths.push(truth);
            }
        }
        let support = Support::of(ladder.levels().iter().map(|x| x.ln())).expect("several levels");
        let (width, experiment) = (WidthPrior::OfRatios, Experiment::ForcedChoice(0.5));
        let priors = Priors::track(Some(support), width);
        let alone: Vec<f64> = (cells.iter())
            .map(|cell| {
                let found = posterior(Core::Gumbel, &cell.levels, experiment, &priors);
                found.map_or(f64::NAN, |found| found.threshold.median)
            })
            .collect();
        let differences: Vec<f64> = alone.chunks(2).map(|two| two[1] - two[0]).collect();
        let (truth, flag) = (self.ratio.ln(), |yes: bool| f64::from(u8::from(yes)));
        let holds = |(low, high): (f64, f64)| flag(low <= truth && truth <= high);
        let Some(test) = one_sample(&differences) else {
            return vec![f64::NAN; COLUMNS.len()];
        };
        let squares = alone
            .iter()
            .zip(&truths)
            .map(|(found, truth)| (found - truth).powi(2));
        let mut results = vec![
            flag(test.p.is_some_and(|p| p <= 0.05)),
            test.mean - truth,
            holds(test.ci95),
            squares.sum::<f64>() / truths.len() as f64,
        ];
        let condition = Condition {
            core: Core::Gumbel,
            experiment,
            support,
            width,
        };
        let random = &mut Random(Stream::new(index, &["weber", &self.name, "draws"]));
        let priors = PopulationPriors::of(width);
        let found = partial_pooling(&[condition; 2], &cells, &priors, Effort::SIMULATION, random);
        let found = found
            .ok()
            .filter(|found| found.diagnostics.problem().is_none());
        results.extend(found.map_or([0.0; 4], |found| {
            // The first less the second.
            let contrast = found.contrasts[0].difference;
            let (low, high) = (-contrast.ci95.1, -contrast.ci95.0);
            let differ = flag(low > 0.0 || high < 0.0);
            [1.0, differ, -contrast.mean - truth, holds((low, high))]
        }));
        results
    }
}

/// Prints the table of some studies.
pub(crate) fn print(all: &[(String, Vec<Vec<f64>>)]) {
    println!(
        "| study | studies | \"differ\" at .05 | bias of ln ratio | holds | RMS of ln, a participant | together: studies | 95 % interval without 1 | bias | holds |\n|{}",
        "---|".repeat(10)
    );
    for (name, studies) in all {
        let known: Vec<&Vec<f64>> = studies.iter().filter(|s| s[0].is_finite()).collect();
        let pooled: Vec<&Vec<f64>> = known.iter().copied().filter(|s| s[4] == 1.0).collect();
        let shown = |studies: &[&Vec<f64>], at: usize| {
            let x: Vec<f64> = studies.iter().map(|s| s[at]).collect();
            let error = sd(&x).unwrap_or_default() / (x.len() as f64).sqrt();
            format!("{:.3} ± {error:.3}", mean(&x).unwrap_or_default())
        };
        let squares: Vec<f64> = known.iter().map(|s| s[3]).collect();
        let rms = mean(&squares).unwrap_or_default().sqrt();
        println!(
            "| {name} | {} | {} | {} | {} | {rms:.3} | {} | {} | {} | {} |",
            known.len(),
            shown(&known, 0),
            shown(&known, 1),
            shown(&known, 2),
            pooled.len(),
            shown(&pooled, 5),
            shown(&pooled, 6),
            shown(&pooled, 7),
        );
    }
}
