//! Weights of components in choices, against scipy.
//!
//! `reference/choice_weights.py` simulates the choices and writes `reference/choice_weights.txt` with the values of scipy
//! 1.17.1.
#![allow(clippy::unwrap_used)]

use study_stats::choice_weights::{Chosen, LeftOut, Penalty, fit, spread, weigh};
use study_stats::random::SplitMix64;

const TEXT: &str = include_str!("reference/choice_weights.txt");

struct Case {
    name: &'static str,
    errors: Vec<Vec<f64>>,
    chosen: Vec<Chosen>,
    /// A key and its numbers.
    expected: Vec<(&'static str, Vec<f64>)>,
}

impl Case {
    fn rows(&self, key: &str) -> impl Iterator<Item = &Vec<f64>> {
        let own = self.expected.iter().filter(move |(k, _)| *k == key);
        own.map(|(_, numbers)| numbers)
    }

    fn row(&self, key: &str) -> &[f64] {
        self.rows(key).next().unwrap()
    }
}

fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in TEXT.lines() {
        let (key, rest) = line.split_once(' ').unwrap();
        if key == "case" {
            cases.push(Case {
                name: rest,
                errors: Vec::new(),
                chosen: Vec::new(),
                expected: Vec::new(),
            });
            continue;
        }
        let case = cases.last_mut().unwrap();
        if key == "choices" {
            let choice = |word: &str| {
                let (preferred, rest) = word.split_once('>').unwrap();
                let (other, participant) = rest.split_once('@').unwrap();
                Chosen {
                    preferred: preferred.parse().unwrap(),
                    other: other.parse().unwrap(),
                    participant: participant.parse().unwrap(),
                }
            };
            case.chosen = rest.split(' ').map(choice).collect();
            continue;
        }
        let numbers: Vec<f64> = rest.split(' ').map(|w| w.parse().unwrap()).collect();
        match key {
            "error" => case.errors.push(numbers),
            _ => case.expected.push((key, numbers)),
        }
    }
    assert_eq!(cases.len(), 3);
    cases
}

/// λ, infinite or not, or −α.
fn penalty(number: f64) -> Penalty {
    match number {
        f64::INFINITY => Penalty::Equal,
        ..0.0 => Penalty::Sparse(-number),
        _ => Penalty::Unequal(number),
    }
}

#[track_caller]
fn near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found} is not {expected} within {tolerance:e}"
    );
}

#[test]
fn weights_are_those_of_a_generic_optimizer() {
    for case in cases() {
        assert_eq!(case.rows("fit").count(), 10);
        for row in case.rows("fit") {
            let found = fit(&case.errors, &case.chosen, penalty(row[0])).unwrap();
            assert_eq!(found.len(), row.len() - 1);
            for (found, expected) in found.iter().zip(&row[1..]) {
                near(case.name, *found, *expected, 1e-7);
            }
        }
        let found = spread(&case.errors, &case.chosen).unwrap();
        for (found, expected) in found.own.iter().zip(case.row("own")) {
            near(case.name, *found, *expected, 1e-10);
        }
    }
}

#[test]
fn choices_that_were_left_out_are_predicted_as_by_scipy() {
    let same = |name: &str, found: Option<LeftOut>, expected: &[f64]| {
        let found = found.unwrap();
        let (low, high) = found.gain_ci95.unwrap();
        let found = [
            found.choices,
            found.score,
            found.equal_score,
            found.right,
            found.equal_right,
            found.gain,
            low,
            high,
        ];
        for (found, expected) in found.iter().zip(expected) {
            near(name, *found, *expected, 1e-6);
        }
    };
    for case in cases() {
        let found = weigh(&case.errors, &case.chosen, &mut SplitMix64::new(1)).unwrap();
        assert_eq!(found.penalty, penalty(case.row("penalty")[0]));
        assert_eq!(found.over_participants, case.name != "one");
        same(case.name, found.left_out, case.row("left_out"));
        same(case.name, found.other_stimuli, case.row("other_stimuli"));
    }
}
