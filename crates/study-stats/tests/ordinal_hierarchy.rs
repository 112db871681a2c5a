//! The ordinal hierarchical model, against NUTS.
//!
//! `reference/ordinal_hierarchy.py` simulates the data and writes `reference/ordinal_*.txt` with the values of numpyro and
//! their Monte Carlo errors.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use study_stats::ordinal_hierarchy::{
    OrdinalCell, OrdinalEffort, OrdinalHierarchy, OrdinalPriors, Posterior, ordinal_hierarchy,
};
use study_stats::random::SplitMix64;

const DATA: [(&str, &str); 6] = [
    ("usual", include_str!("reference/ordinal_usual.txt")),
    (
        "no_covariate",
        include_str!("reference/ordinal_no_covariate.txt"),
    ),
    ("missing", include_str!("reference/ordinal_missing.txt")),
    ("few", include_str!("reference/ordinal_few.txt")),
    ("ceiling", include_str!("reference/ordinal_ceiling.txt")),
    ("lapses", include_str!("reference/ordinal_lapses.txt")),
];

struct Data {
    covariate: Vec<f64>,
    cells: Vec<OrdinalCell>,
    /// Mean, SD and quantiles at .025, .5 and .975, each with its error.
    expected: BTreeMap<&'static str, Vec<(f64, f64)>>,
}

fn read(text: &'static str) -> Data {
    let (mut covariate, mut cells, mut expected) = (Vec::new(), Vec::new(), BTreeMap::new());
    let number = |word: &str| word.parse::<f64>().unwrap();
    for line in text.lines() {
        let words: Vec<&'static str> = line.split(' ').collect();
        match words[0] {
            "covariate" => covariate = words[1..].iter().map(|w| number(w)).collect(),
            "cell" => cells.push(OrdinalCell {
                participant: words[1].parse().unwrap(),
                realization: words[2].parse().unwrap(),
                counts: words[3..].iter().map(|w| w.parse().unwrap()).collect(),
            }),
            _ => {
                let (name, numbers) = line["posterior ".len()..].split_once(" | ").unwrap();
                let numbers: Vec<f64> = numbers.split(' ').map(number).collect();
                let pairs = numbers.chunks_exact(2).map(|two| (two[0], two[1]));
                expected.insert(name, pairs.collect());
            }
        }
    }
    Data {
        covariate,
        cells,
        expected,
    }
}

fn fit(data: &Data, effort: OrdinalEffort) -> OrdinalHierarchy {
    let mut random = SplitMix64::new(2026);
    let priors = OrdinalPriors::default();
    ordinal_hierarchy(
        &data.cells,
        &data.covariate,
        &priors,
        None,
        effort,
        &mut random,
    )
    .unwrap()
}

/// What the reference calls a number.
fn named(found: &OrdinalHierarchy) -> BTreeMap<String, Posterior> {
    let mut all = BTreeMap::new();
    let mut put = |name: String, of: Posterior| all.insert(name, of);
    put("tau".to_owned(), found.between_realizations);
    put("sigma".to_owned(), found.between_participants);
    put("omega".to_owned(), found.interaction);
    put("lapse".to_owned(), found.lapse);
    if let Some(slope) = found.slope {
        put("slope".to_owned(), slope);
    }
    for (j, of) in found.realizations.iter().enumerate() {
        put(format!("realization {j}"), *of);
    }
    for (j, of) in found.thresholds.iter().enumerate() {
        put(format!("threshold {j}"), *of);
    }
    let last = found.realizations.len() - 1;
    let ends = (found.differences.iter()).find(|d| (d.first, d.second) == (0, last));
    put("difference".to_owned(), ends.unwrap().difference);
    all
}

/// Means, standard deviations and quantiles agree within four Monte Carlo errors of both; `chain` is the error of a mean of ours in posterior standard deviations.
fn compare(name: &str, data: &Data, effort: OrdinalEffort) {
    let found = fit(data, effort);
    let chain = 1.0 / found.convergence.effective.sqrt();
    let (mut compared, ours) = (0, named(&found));
    for (what, expected) in &data.expected {
        if let Some(j) = what.strip_prefix("highest ") {
            let p = found.highest[j.parse::<usize>().unwrap()];
            let (mean, error) = expected[0];
            let own = (mean * (1.0 - mean)).sqrt().max(0.02) * chain;
            assert!(
                (p - mean).abs() <= 4.0 * error.hypot(own),
                "{name}, {what}: {p} {mean}"
            );
            continue;
        }
        let of = ours[*what];
        let sd = expected[1].0;
        // Of a quantile in a tail the error is larger by about √(p(1 − p))/φ: 2.7 at 2.5 %, 1.3 in the middle; of a standard deviation by 1/√2, more in long tails.
        for (at, (value, factor)) in [
            (of.mean, 1.0),
            (of.sd, 1.2),
            (of.ci95.0, 2.7),
            (of.median, 1.3),
            (of.ci95.1, 2.7),
        ]
        .into_iter()
        .enumerate()
        {
            let (reference, error) = expected[at];
            let allowed = 4.0 * error.hypot(factor * sd * chain);
            assert!(
                (value - reference).abs() <= allowed,
                "{name}, {what}, {at}: {value} instead of {reference} ± {error}, allowed {allowed}"
            );
            compared += 1;
        }
    }
    assert!(
        compared >= 5 * (data.expected.len() - found.highest.len()),
        "{compared}"
    );
}

/// Many draws of a small set, so that the ordinary tests see the model.
#[test]
fn a_small_posterior_is_that_of_nuts() {
    let many = OrdinalEffort {
        chains: 4,
        warmup: 500,
        draws: 20_000,
    };
    compare("few", &read(DATA[3].1), many);
}

#[test]
#[ignore = "takes minutes without optimization"]
fn posteriors_are_those_of_nuts() {
    let many = OrdinalEffort {
        chains: 4,
        warmup: 1000,
        draws: 20_000,
    };
    for (name, text) in DATA {
        let data = read(text);
        compare(name, &data, many);
        let found = fit(&data, OrdinalEffort::ANALYSIS);
        assert_eq!(
            found.convergence.problem(),
            None,
            "{name}: {:?}",
            found.convergence
        );
    }
}
