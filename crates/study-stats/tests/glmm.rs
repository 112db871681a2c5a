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
use study_stats::random::{RandomSource, SplitMix64};

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

/// Numbers in [0, 1).
struct Uniform(SplitMix64);

impl Uniform {
    fn next(&mut self) -> f64 {
        self.0.below(1 << 53) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.next()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.next()).cos()
    }

    /// A count with this mean, and the hits of ten with this logit.
    fn counts(&mut self, eta: f64) -> [f64; 2] {
        let (mean, share) = (eta.exp(), 1.0 / (1.0 + (-eta).exp()));
        let (mut count, mut time) = (0.0, 0.0);
        loop {
            time -= (1.0 - self.next()).ln();
            if time > mean {
                break;
            }
            count += 1.0;
        }
        let hits = (0..10).filter(|_| self.next() < share).count();
        [count, hits as f64]
    }
}

/// Studies of five subjects, in which standard deviations are often 0 or nearly so: every model
/// is found. Without an effect, likelihood ratios find one a little too often.
#[test]
fn every_model_of_few_subjects_is_found() {
    let mut random = Uniform(SplitMix64::new(390));
    let mut rejected = [0, 0];
    let studies = 250;
    for _ in 0..studies {
        let subjects: Vec<f64> = (0..5).map(|_| 0.5 * random.normal()).collect();
        let cells: Vec<f64> = (0..20).map(|_| 0.3 * random.normal()).collect();
        let mut all = [Vec::new(), Vec::new()];
        for trial in 0..60 {
            let (s, c) = (trial / 12, trial / 3 % 4);
            let eta = 0.7 + subjects[s] + cells[4 * s + c];
            let (f, g) = ([1.0, 1.0, -1.0, -1.0][c], [1.0, -1.0, 1.0, -1.0][c]);
            let counts = random.counts(eta);
            for ((own, y), trials) in all.iter_mut().zip(counts).zip([1.0, 10.0]) {
                own.push(Observation {
                    y,
                    trials,
                    x: vec![1.0, f, g, f * g],
                    levels: vec![s, 4 * s + c],
                });
            }
        }
        let families = [Family::Poisson, Family::Binomial];
        for ((own, family), rejected) in all.iter().zip(families).zip(&mut rejected) {
            let data = GlmmData::new(family, own).unwrap();
            let fit = glmm(&data, Integral::Laplace).unwrap();
            let test = ratio_test(&data, &fit, &[1], Integral::Laplace).unwrap();
            *rejected += u32::from(test.p.unwrap() <= 0.05);
        }
    }
    for rejected in rejected {
        let rate = f64::from(rejected) / f64::from(studies);
        assert!((0.03..0.13).contains(&rate), "{rate}");
    }
}
