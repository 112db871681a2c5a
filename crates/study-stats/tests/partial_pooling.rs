//! Partial pooling, against NUTS.
//!
//! `reference/partial_pooling.py` simulates the data and writes `reference/pool_*.txt` with the
//! values of numpyro 0.22.0 and their Monte Carlo errors.
#![allow(clippy::unwrap_used)]

use study_stats::psychometric::hierarchy::{
    Cell, Condition, Effort, Estimate, Population, PopulationPriors, partial_pooling,
};
use study_stats::psychometric::{Core, Experiment, Level, Support, WidthPrior};
use study_stats::random::SplitMix64;

const DATA: [(&str, &str); 7] = [
    ("staircases", include_str!("reference/pool_staircases.txt")),
    ("constant", include_str!("reference/pool_constant.txt")),
    ("comparison", include_str!("reference/pool_comparison.txt")),
    (
        "above_standard",
        include_str!("reference/pool_above_standard.txt"),
    ),
    ("two_people", include_str!("reference/pool_two_people.txt")),
    ("large", include_str!("reference/pool_large.txt")),
    ("asleep", include_str!("reference/pool_asleep.txt")),
];

struct Data {
    conditions: Vec<Condition>,
    cells: Vec<Cell>,
    /// Name of a parameter; mean, SD and quantiles at .025, .5 and .975, each with its error.
    expected: Vec<(&'static str, Vec<(f64, f64)>)>,
}

fn read(text: &'static str) -> Data {
    let (mut conditions, mut cells, mut expected) = (Vec::new(), Vec::new(), Vec::new());
    let number = |word: &str| word.parse::<f64>().unwrap();
    for line in text.lines() {
        let words: Vec<&'static str> = line.split(' ').collect();
        match words[0] {
            "condition" => {
                let experiment = match words[2] {
                    "lapse" => Experiment::Comparison,
                    guess => Experiment::ForcedChoice(number(guess)),
                };
                let width = match words[3] {
                    "ratios" => WidthPrior::OfRatios,
                    "origin" => WidthPrior::FromOrigin(number(words[4])),
                    _ => WidthPrior::Even,
                };
                let support = Support {
                    low: number(words[5]),
                    high: number(words[6]),
                    least: number(words[7]),
                };
                let core = Core::named(words[1]).unwrap();
                conditions.push(Condition {
                    core,
                    experiment,
                    support,
                    width,
                });
            }
            "cell" => {
                let level = |word: &&str| {
                    let (level, counts) = word.split_once(':').unwrap();
                    let (positive, trials) = counts.split_once('/').unwrap();
                    Level {
                        level: number(level),
                        positive: number(positive),
                        trials: number(trials),
                    }
                };
                cells.push(Cell {
                    participant: words[1].parse().unwrap(),
                    condition: words[2].parse().unwrap(),
                    levels: words[3..].iter().map(level).collect(),
                });
            }
            "posterior" => {
                let (name, numbers) = line["posterior ".len()..].split_once(" | ").unwrap();
                let numbers: Vec<f64> = numbers.split(' ').map(number).collect();
                let pairs = numbers.chunks_exact(2).map(|p| (p[0], p[1]));
                expected.push((name, pairs.collect()));
            }
            _ => {}
        }
    }
    Data {
        conditions,
        cells,
        expected,
    }
}

fn fit(data: &Data, effort: Effort) -> Population {
    let priors = PopulationPriors::of(data.conditions[0].width);
    let mut random = SplitMix64::new(1);
    partial_pooling(&data.conditions, &data.cells, &priors, effort, &mut random).unwrap()
}

fn parameter(found: &Population, name: &str) -> Estimate {
    let words: Vec<&str> = name.split(' ').collect();
    let index = |i: usize| words[i].parse::<usize>().unwrap();
    match words[0] {
        "mu" => found.conditions[index(1)],
        "contrast" => {
            let of_pair = |c: &&_| {
                let c: &study_stats::psychometric::hierarchy::Contrast = c;
                (c.first, c.second) == (index(1), index(2))
            };
            found.contrasts.iter().find(of_pair).unwrap().difference
        }
        "tau" => found.between,
        "sigma" => found.interaction.unwrap(),
        "nu" => found.width,
        "kappa" => found.width_between,
        "lambda" => found.lapse,
        _ => found.cells[index(1)],
    }
}

/// Means and standard deviations within four Monte Carlo errors, of which the draws have one of
/// their own; quantiles within four of theirs and a fiftieth of the standard deviation.
fn agree(which: impl Fn(&str) -> bool) {
    let mut far = Vec::new();
    for (name, text) in DATA.into_iter().filter(|d| which(d.0)) {
        let data = read(text);
        let found = fit(&data, Effort::ANALYSIS);
        let diagnostics = found.diagnostics;
        assert_eq!(diagnostics.problem(), None, "{name}: {diagnostics:?}");
        for (of, expected) in &data.expected {
            let own = parameter(&found, of);
            let [mean, sd, low, median, high] = expected[..] else {
                panic!("{of}");
            };
            let error = diagnostics.error * sd.0;
            let mut compare = |what: &str, found: f64, (value, reference): (f64, f64), own: f64| {
                let tolerance = 4.0 * reference.hypot(own);
                if (found - value).abs() > tolerance {
                    far.push(format!(
                        "{name} {of} {what}: {found:.5} {value:.5}, {:.3} SD, tolerance {:.3} SD",
                        (found - value) / sd.0,
                        tolerance / sd.0
                    ));
                }
            };
            compare("mean", own.mean, mean, error);
            compare("SD", own.sd, sd, error);
            // The errors of quantiles of a normal distribution, in those of its mean.
            compare("median", own.median, median, 1.3 * error + 0.005 * sd.0);
            compare("2.5 %", own.ci95.0, low, 2.7 * error + 0.005 * sd.0);
            compare("97.5 %", own.ci95.1, high, 2.7 * error + 0.005 * sd.0);
        }
    }
    assert!(far.is_empty(), "{}", far.join("\n"));
}

const LARGE: [&str; 2] = ["above_standard", "large"];

#[test]
fn the_posterior_is_that_of_nuts() {
    agree(|name| !LARGE.contains(&name));
}

#[test]
#[ignore = "half a minute without optimization"]
fn large_posteriors_are_those_of_nuts() {
    agree(|name| LARGE.contains(&name));
}

/// The same data and the same seed give the same numbers; another seed other draws.
#[test]
fn a_fit_can_be_reproduced() {
    let data = read(DATA[4].1);
    let one = fit(&data, Effort::SIMULATION);
    assert_eq!(fit(&data, Effort::SIMULATION), one);
    let priors = PopulationPriors::of(data.conditions[0].width);
    let mut random = SplitMix64::new(2);
    let other = partial_pooling(
        &data.conditions,
        &data.cells,
        &priors,
        Effort::SIMULATION,
        &mut random,
    );
    assert_ne!(other.unwrap(), one);
}
