//! The preference Gaussian process, against scipy, brute-force quadrature, draws, and BoTorch.
//!
//! `reference/preference_gp.py` simulates the answers and writes `reference/preference_gp.txt` with the values of scipy
//! 1.17.1 and BoTorch 0.18.1.
#![allow(clippy::unwrap_used)]

use study_stats::preference_gp::{Choice, Kernel, Posterior};

const TEXT: &str = include_str!("reference/preference_gp.txt");

struct Case {
    name: &'static str,
    kernel: Kernel,
    points: Vec<Vec<f64>>,
    choices: Vec<Choice>,
    /// A key and its numbers.
    expected: Vec<(&'static str, Vec<f64>)>,
}

impl Case {
    fn posterior(&self) -> Posterior {
        Posterior::new(&self.points, &self.kernel, &self.choices).unwrap()
    }

    fn rows(&self, key: &str) -> impl Iterator<Item = &Vec<f64>> {
        let own = self.expected.iter().filter(move |(k, _)| *k == key);
        own.map(|(_, numbers)| numbers)
    }
}

fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for line in TEXT.lines() {
        let (key, rest) = line.split_once(' ').unwrap();
        if key == "case" {
            cases.push(Case {
                name: rest,
                kernel: Kernel {
                    sd: 0.0,
                    lengths: Vec::new(),
                },
                points: Vec::new(),
                choices: Vec::new(),
                expected: Vec::new(),
            });
            continue;
        }
        let case = cases.last_mut().unwrap();
        if key == "choices" {
            let choice = |word: &str| {
                let (preferred, other) = word.split_once('>').unwrap();
                Choice {
                    preferred: preferred.parse().unwrap(),
                    other: other.parse().unwrap(),
                }
            };
            case.choices = rest.split(' ').map(choice).collect();
            continue;
        }
        let numbers: Vec<f64> = rest.split(' ').map(|w| w.parse().unwrap()).collect();
        match key {
            "kernel" => {
                (case.kernel.sd, case.kernel.lengths) = (numbers[0], numbers[1..].to_vec());
            }
            "point" => case.points.push(numbers),
            _ => case.expected.push((key, numbers)),
        }
    }
    assert_eq!(cases.len(), 7);
    cases
}

#[track_caller]
fn near(what: &str, found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{what}: {found} is not {expected} within {tolerance:e}"
    );
}

/// Mode, covariance and evidence found over the utilities of all points, to 10⁻⁹: the errors that are left are those of
/// the inverse of a covariance with a condition number of up to 10⁵.
#[test]
fn the_posterior_is_that_of_a_generic_optimizer() {
    for case in cases() {
        let (name, found) = (case.name, case.posterior());
        assert_eq!(case.rows("posterior").count(), case.points.len());
        for row in case.rows("posterior") {
            let i = row[0] as usize;
            near(name, found.mean()[i], row[1], 1e-9);
            near(name, found.sd(i), row[2], 1e-9);
        }
        for row in case.rows("covariance") {
            near(
                name,
                found.covariance(row[0] as usize, row[1] as usize),
                row[2],
                1e-9,
            );
        }
        for row in case.rows("evidence") {
            near(name, found.evidence(), row[0], 1e-9);
        }
        for row in case.rows("best") {
            assert_eq!(
                found.best_pair(|_| true),
                Some((row[0] as usize, row[1] as usize)),
                "{name}"
            );
        }
    }
}

/// BoTorch 0.18.1's `PairwiseGP` with the same kernel, to 10⁻⁹ (10⁻¹³ when they were made). Its cut of differences at
/// ±3 is switched off in the script.
#[test]
fn the_posterior_is_that_of_botorch() {
    for case in cases() {
        let (name, found) = (case.name, case.posterior());
        assert_eq!(case.rows("botorch").count(), case.points.len());
        for row in case.rows("botorch") {
            let i = row[0] as usize;
            near(name, found.mean()[i], row[1], 1e-9);
            near(name, found.sd(i), row[2], 1e-9);
        }
    }
}

/// EUBO against its closed form in another arrangement (10⁻⁹), and against the mean of 10⁷ draws within four of its
/// standard errors.
#[test]
fn the_expected_best_is_its_closed_form_and_the_mean_of_draws() {
    for case in cases() {
        let found = case.posterior();
        assert_eq!(case.rows("eubo").count(), 3);
        for row in case.rows("eubo") {
            let value = found.expected_best(row[0] as usize, row[1] as usize);
            near(case.name, value, row[2], 1e-9);
            near(case.name, value, row[3], 4.0 * row[4]);
        }
    }
}

/// How far Laplace's approximation is from the exact posterior of three points (the trapezoidal rule over 161³ utilities):
/// means within 0.33, standard deviations within 0.06, the logarithm of the evidence within 0.07. The mode is nearer to
/// 0 than the mean, since the likelihood is skewed; the order of the points is the same.
#[test]
fn laplace_is_near_the_exact_posterior_of_three_points() {
    let mut seen = 0;
    for case in cases().into_iter().filter(|case| case.points.len() == 3) {
        let (name, found) = (case.name, case.posterior());
        let exact: Vec<&Vec<f64>> = case.rows("exact").collect();
        assert_eq!(exact.len(), 3);
        for (i, row) in exact.iter().enumerate() {
            near(name, found.mean()[i], row[1], 0.33);
            near(name, found.sd(i), row[2], 0.06);
            assert!(found.mean()[i].abs() < row[1].abs(), "{name}");
        }
        for a in 0..3 {
            for b in 0..3 {
                let order = found.mean()[a].total_cmp(&found.mean()[b]);
                assert_eq!(order, exact[a][1].total_cmp(&exact[b][1]), "{name}");
            }
        }
        for row in case.rows("exact_evidence") {
            near(name, found.evidence(), row[0], 0.07);
        }
        seen += 1;
    }
    assert_eq!(seen, 2);
}
