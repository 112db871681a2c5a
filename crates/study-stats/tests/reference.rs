//! Mixed models of designs with missing cells, against R.
//!
//! `reference/designs.R` simulates the ratings and writes `reference/*.txt` with the
//! values of R 4.2.2 (lme4 1.1.31, lmerTest 3.1.3, emmeans 1.8.4.1). Each file
//! starts with the covariate and the ratings, a row for each subject, a column for each
//! realization, a digit for each rating, `.` for a missing cell.
#![allow(clippy::unwrap_used)]

use study_stats::lmm::{
    AdjustedMeans, CellSummary, ContrastT, Criterion, FixedEffects, LmmData, RandomEffects,
    adjusted_means, fit,
};

/// Name and text of each file.
const DESIGNS: [(&str, &str); 8] = [
    // Some cells missing at random, some with one rating instead of two.
    ("random_cells", include_str!("reference/random_cells.txt")),
    // Each of ten subjects rates three of five realizations.
    ("blocks", include_str!("reference/blocks.txt")),
    // Eight lenient subjects rate 1 to 5, eight severe ones 3 to 7, once.
    (
        "lenient_severe",
        include_str!("reference/lenient_severe.txt"),
    ),
    // Each subject lacks one realization; one rating per cell.
    (
        "nobody_complete",
        include_str!("reference/nobody_complete.txt"),
    ),
    // All cells, with one to four ratings.
    ("repetitions", include_str!("reference/repetitions.txt")),
    // Five subjects, nine realizations; no variance of cells.
    ("few_subjects", include_str!("reference/few_subjects.txt")),
    // Variances on the boundary.
    (
        "no_subject_variance",
        include_str!("reference/no_subject_variance.txt"),
    ),
    (
        "no_cell_variance",
        include_str!("reference/no_cell_variance.txt"),
    ),
];

struct Design {
    name: &'static str,
    cells: Vec<CellSummary>,
    /// The lines of expected values: a key and its numbers.
    expected: Vec<(&'static str, Vec<f64>)>,
}

impl Design {
    fn read((name, text): (&'static str, &'static str)) -> Self {
        let mut design = Self {
            name,
            cells: Vec::new(),
            expected: Vec::new(),
        };
        let (mut x, mut subject) = (Vec::new(), 0);
        for line in text.lines() {
            let (key, rest) = line.split_once(' ').unwrap();
            let words = rest.split(' ');
            match key {
                "covariate" => x = words.map(|w| w.parse().unwrap()).collect(),
                "ratings" => {
                    for (realization, digits) in words.enumerate() {
                        let ratings: Vec<f64> = digits
                            .chars()
                            .filter_map(|c| c.to_digit(10))
                            .map(f64::from)
                            .collect();
                        if ratings.is_empty() {
                            continue;
                        }
                        let n = ratings.len();
                        let mean = ratings.iter().sum::<f64>() / n as f64;
                        design.cells.push(CellSummary {
                            subject,
                            realization,
                            x: x[realization],
                            n,
                            mean,
                            within: ratings.iter().map(|r| (r - mean).powi(2)).sum(),
                        });
                    }
                    subject += 1;
                }
                _ => {
                    let numbers = words.map(|w| w.parse().unwrap()).collect();
                    design.expected.push((key, numbers));
                }
            }
        }
        design
    }

    fn rows(&self, key: &str) -> Vec<&[f64]> {
        let own = self.expected.iter().filter(|(k, _)| *k == key);
        own.map(|(_, numbers)| numbers.as_slice()).collect()
    }

    fn repeats(&self) -> bool {
        self.cells.iter().any(|c| c.n > 1)
    }

    fn adjusted(&self) -> AdjustedMeans {
        adjusted_means(&LmmData::new(&self.cells, FixedEffects::Intercept).unwrap()).unwrap()
    }

    /// Compares numbers, each with its relative and absolute tolerance.
    fn near(&self, what: &str, found: &[f64], expected: &[f64], tolerances: &[f64]) {
        assert_eq!(found.len(), expected.len(), "{} {what}", self.name);
        for ((a, b), tolerance) in found.iter().zip(expected).zip(tolerances) {
            assert!(
                (a - b).abs() <= tolerance * b.abs().max(1.0),
                "{} {what}: {found:?}, R has {expected:?}",
                self.name
            );
        }
    }
}

/// R minimizes the deviance to about 10⁻⁹, so its variances have five to six digits; the
/// degrees of freedom come from finite differences.
const VALUE: f64 = 2e-6;
const VARIANCE: f64 = 2e-5;
const DF: f64 = 2e-4;

fn numbers(t: &ContrastT) -> [f64; 5] {
    let (low, high) = t.ci95.unwrap();
    [t.estimate, t.se, t.df.unwrap(), low, high]
}

#[test]
fn adjusted_means_agree_with_emmeans() {
    for design in DESIGNS.map(Design::read) {
        let found = design.adjusted();
        let expected = design.rows("mean");
        assert_eq!(expected.len(), found.means.len());
        for (t, expected) in found.means.iter().zip(expected) {
            let tolerances = [VALUE, VARIANCE, DF, VARIANCE, VARIANCE];
            design.near("mean", &numbers(t), &expected[1..], &tolerances);
        }
        let v = found.variances;
        let variances = [v.intercept, v.cell, v.error];
        let expected = design.rows("variances")[0];
        design.near("variances", &variances, expected, &[VARIANCE; 3]);
        let boundary = expected[0] < 1e-9 || design.repeats() && expected[1] < 1e-9;
        assert_eq!(found.singular, boundary, "{}", design.name);
        assert!(found.connected);
    }
}

#[test]
fn differences_of_adjusted_means_agree_with_emmeans() {
    for design in DESIGNS.map(Design::read) {
        let found = design.adjusted();
        let expected = design.rows("pair");
        assert_eq!(expected.len(), found.pairs.len());
        for (t, expected) in found.pairs.iter().zip(expected) {
            let mut all = numbers(t).to_vec();
            all.extend([t.t.unwrap(), t.p.unwrap()]);
            let tolerances = [VALUE, VARIANCE, DF, VARIANCE, VARIANCE, VARIANCE, VARIANCE];
            design.near("pair", &all, &expected[2..], &tolerances);
        }
    }
}

#[test]
fn the_test_of_equal_means_agrees_with_lmer_test() {
    for design in DESIGNS.map(Design::read) {
        let f = design.adjusted().effect.unwrap();
        let found = [f.f, f.df1, f.df2.unwrap(), f.p.unwrap()];
        let tolerances = [VARIANCE, 0.0, DF, VARIANCE];
        design.near("F", &found, design.rows("F")[0], &tolerances);
    }
}

#[test]
fn the_crossed_slope_agrees_with_lmer_test() {
    for design in DESIGNS.map(Design::read) {
        let table = LmmData::new(&design.cells, FixedEffects::Covariate { centre: 0.8 }).unwrap();
        let random = RandomEffects {
            realization: true,
            cell: design.repeats(),
            ..RandomEffects::default()
        };
        let found = fit(&table, random, Criterion::Reml).unwrap();
        let t = found.t_test(&[0.0, 1.0]);
        let row = [t.estimate, t.se, t.df.unwrap(), t.t.unwrap(), t.p.unwrap()];
        let tolerances = [VARIANCE, VARIANCE, DF, VARIANCE, VARIANCE];
        design.near("slope", &row, design.rows("slope")[0], &tolerances);
        let v = found.variances;
        let variances = [v.intercept, v.realization, v.cell, v.error];
        let expected = design.rows("slope_variances")[0];
        design.near("slope variances", &variances, expected, &[VARIANCE; 4]);
    }
}
