//! Generalized mixed models, against R.
//!
//! `reference/glmm.R` writes `reference/glmm/*.txt`: two published tables and five simulated ones, with
//! what R 4.2.2 says of them. Counts and shares are fitted by lme4 1.1.31 (`glmer`, with modes found to
//! 10⁻¹⁴), gamma by R from the definition of its likelihood. Tolerance: 2·10⁻⁴ of a standard error and
//! of a standard deviation; of an estimate 2·10⁻⁴ of its standard error; 10⁻⁶ of a log-likelihood and
//! 5·10⁻⁶ of a χ².
#![allow(clippy::unwrap_used)]

use study_stats::glmm::{
    Family, GlmmData, GlmmError, GlmmFit, Integral, Observation, glmm, ratio_test,
};

macro_rules! designs {
    ($($name:literal),*) => {
        [$(($name, include_str!(concat!("reference/glmm/", $name, ".txt")))),*]
    };
}

/// Name and text of each file.
const DESIGNS: [(&str, &str); 7] = designs![
    "cbpp",
    "grouseticks",
    "errors",
    "hits",
    "answers",
    "alike",
    "times"
];

struct Design {
    name: &'static str,
    data: GlmmData,
    /// The integral, the name of the values, and the values.
    expected: Vec<(&'static str, &'static str, &'static str)>,
}

impl Design {
    fn read((name, text): (&'static str, &'static str)) -> Self {
        let mut family = Family::Poisson;
        let (mut observations, mut expected) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let (key, rest) = line.split_once(' ').unwrap();
            match key {
                "source" => {}
                "family" => {
                    family = match rest {
                        "poisson" => Family::Poisson,
                        "binomial" => Family::Binomial,
                        _ => Family::Gamma,
                    }
                }
                "row" => observations.push(observation(rest)),
                _ => {
                    let (what, values) = rest.split_once(' ').unwrap();
                    expected.push((key, what, values));
                }
            }
        }
        Self {
            name,
            data: GlmmData::new(family, &observations).unwrap(),
            expected,
        }
    }

    fn values(&self, word: &str, what: &str) -> Vec<f64> {
        let own = (self.expected.iter()).find(|line| (line.0, line.1) == (word, what));
        own.map_or_else(Vec::new, |line| numbers(line.2))
    }

    /// Compares with the values of this name; each tolerance is absolute.
    fn near(&self, word: &str, what: &str, found: &[f64], tolerances: &[f64]) {
        let expected = self.values(word, what);
        assert_eq!(found.len(), expected.len(), "{} {word} {what}", self.name);
        for ((a, b), tolerance) in found.iter().zip(&expected).zip(tolerances) {
            let off = (a - b).abs();
            let name = self.name;
            assert!(off <= *tolerance, "{name} {word} {what}: {a} is not {b}");
        }
    }

    fn agrees(&self, word: &str, integral: Integral) {
        let fit: GlmmFit = glmm(&self.data, integral).unwrap();
        let shares: Vec<f64> = fit.se.iter().map(|se| 2e-4 * se).collect();
        self.near(word, "beta", &fit.beta, &shares);
        self.near(word, "se", &fit.se, &shares);
        // A standard deviation of 0 is one below 10⁻⁴.
        let sds: Vec<f64> = fit.sd.iter().map(|sd| (2e-4 * sd).max(1e-4)).collect();
        self.near(word, "sd", &fit.sd, &sds);
        self.near(word, "loglik", &[fit.loglik], &[1e-6]);
        if let Some(dispersion) = fit.dispersion {
            self.near(word, "dispersion", &[dispersion], &[2e-4 * dispersion]);
        }
        let tests = (self.expected.iter()).filter(|line| (line.0, line.1) == (word, "test"));
        for (_, _, values) in tests {
            let (columns, chi2) = values.split_once(' ').unwrap();
            let columns: Vec<usize> = columns.split(',').map(|c| c.parse().unwrap()).collect();
            let test = ratio_test(&self.data, &fit, &columns, integral).unwrap();
            let expected: f64 = chi2.parse().unwrap();
            assert!((test.chi2 - expected).abs() < 5e-6, "{} {word}", self.name);
            assert_eq!(test.df, columns.len());
        }
    }
}

fn observation(text: &str) -> Observation {
    let parts: Vec<&str> = text.split(" | ").collect();
    let y = numbers(parts[0]);
    Observation {
        y: y[0],
        trials: y[1],
        x: numbers(parts[1]),
        levels: parts[2].split(' ').map(|g| g.parse().unwrap()).collect(),
    }
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(' ').map(|w| w.parse().unwrap()).collect()
}

#[test]
fn laplaces_approximation_agrees_with_r() {
    for design in DESIGNS.into_iter().map(Design::read) {
        design.agrees("laplace", Integral::Laplace);
    }
}

#[test]
fn quadrature_agrees_with_r() {
    let mut compared = 0;
    for design in DESIGNS.into_iter().map(Design::read) {
        if design.values("adaptive", "beta").is_empty() {
            let found = glmm(&design.data, Integral::Adaptive);
            assert_eq!(found, Err(GlmmError::SeveralFactors), "{}", design.name);
        } else {
            design.agrees("adaptive", Integral::Adaptive);
            compared += 1;
        }
    }
    assert_eq!(compared, 3);
}
