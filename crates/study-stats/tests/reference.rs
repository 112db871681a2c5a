//! Mixed models of designs with missing cells, against R.
//!
//! `reference/designs.R` simulates the ratings and writes `reference/*.txt` with the
//! values of R 4.2.2 (lme4 1.1.31, lmerTest 3.1.3, emmeans 1.8.4.1). Each file
//! starts with the covariate and the ratings, a row for each subject, a column for each
//! realization, a digit for each rating, `.` for a missing cell.
#![allow(clippy::unwrap_used)]

use study_stats::clm::{CategoryCount, CategoryCounts, Predictor};
use study_stats::clmm::clmm_crossed;
use study_stats::disagreement::disagreement;
use study_stats::lmm::{
    AdjustedMeans, CellSummary, ContrastF, ContrastT, Criterion, FixedEffects, LmmData,
    RandomEffects, adjusted_means, fit, slope_variance,
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
    /// The covariate of each realization.
    x: Vec<f64>,
    /// Subject, realization, rating.
    ratings: Vec<(u32, u32, u32)>,
    cells: Vec<CellSummary>,
    /// The lines of expected values: a key and its numbers.
    expected: Vec<(&'static str, Vec<f64>)>,
}

impl Design {
    fn read((name, text): (&'static str, &'static str)) -> Self {
        let mut design = Self {
            name,
            x: Vec::new(),
            ratings: Vec::new(),
            cells: Vec::new(),
            expected: Vec::new(),
        };
        let mut subject = 0;
        for line in text.lines() {
            let (key, rest) = line.split_once(' ').unwrap();
            let words = rest.split(' ');
            match key {
                "covariate" => design.x = words.map(|w| w.parse().unwrap()).collect(),
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
                        let place = (subject as u32, realization as u32);
                        let rated = ratings.iter().map(|y| (place.0, place.1, *y as u32));
                        design.ratings.extend(rated);
                        let n = ratings.len();
                        let mean = ratings.iter().sum::<f64>() / n as f64;
                        design.cells.push(CellSummary {
                            subject,
                            realization,
                            x: design.x[realization],
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

    /// Counts of the ratings for an ordinal model with the covariate.
    fn counts(&self) -> CategoryCounts {
        let mut used: Vec<u32> = self.ratings.iter().map(|r| r.2).collect();
        used.sort_unstable();
        used.dedup();
        let predictors = self.x.iter().map(|&x| Predictor {
            column: 0,
            x: x - 0.8,
        });
        let counts: Vec<CategoryCount> = (self.ratings.iter())
            .map(|&(subject, predictor, rating)| CategoryCount {
                subject,
                predictor,
                category: used.partition_point(|u| *u < rating) as u32,
                n: 1,
            })
            .collect();
        CategoryCounts::new(predictors.collect(), 1, used.len(), &counts)
    }

    /// The mixed model of the ratings with a mean for each realization.
    fn ratings_model(&self) -> LmmData {
        LmmData::new(&self.cells, FixedEffects::Realizations).unwrap()
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

/// Estimate, standard error, degrees of freedom, interval, t, p.
fn numbers(t: &ContrastT) -> [f64; 7] {
    let (low, high) = t.ci95.unwrap();
    let (df, t_value, p) = (t.df.unwrap(), t.t.unwrap(), t.p.unwrap());
    [t.estimate, t.se, df, low, high, t_value, p]
}

/// Tolerances of [`numbers`].
const CONTRAST: [f64; 7] = [VALUE, VARIANCE, DF, VARIANCE, VARIANCE, VARIANCE, VARIANCE];

/// Compares means, pairs, F and variances with the lines of this prefix.
fn compare(
    design: &Design,
    prefix: &str,
    (means, pairs, f): (&[ContrastT], &[ContrastT], ContrastF),
    variances: &[f64; 3],
) {
    let rows = |key: &str| design.rows(&format!("{prefix}{key}"));
    assert_eq!(
        (rows("mean").len(), rows("pair").len()),
        (means.len(), pairs.len())
    );
    for (t, expected) in means.iter().zip(rows("mean")) {
        design.near("mean", &numbers(t)[..5], expected, &CONTRAST);
    }
    for (t, expected) in pairs.iter().zip(rows("pair")) {
        design.near("pair", &numbers(t), expected, &CONTRAST);
    }
    let found = [f.f, f.df1, f.df2.unwrap(), f.p.unwrap()];
    let tolerances = [VARIANCE, 0.0, DF, VARIANCE];
    design.near("F", &found, rows("F")[0], &tolerances);
    design.near("variances", variances, rows("variances")[0], &[VARIANCE; 3]);
}

#[test]
fn adjusted_means_agree_with_emmeans() {
    for design in DESIGNS.map(Design::read) {
        let found = design.adjusted();
        let v = found.variances;
        let of = (&found.means[..], &found.pairs[..], found.effect.unwrap());
        compare(&design, "cell_", of, &[v.intercept, 0.0, v.error]);
        assert_eq!(found.singular, design.rows("cell_variances")[0][0] < 1e-9);
        assert!(found.connected);
    }
}

#[test]
fn models_of_all_ratings_agree_with_emmeans() {
    for design in DESIGNS.map(Design::read) {
        let table = design.ratings_model();
        let random = RandomEffects {
            cell: design.repeats(),
            ..RandomEffects::default()
        };
        let found = fit(&table, random, Criterion::Reml).unwrap();
        let k = table.realizations().len();
        let unit = |i: usize| (0..k).map(move |j| f64::from(u8::from(i == j)));
        let means: Vec<Vec<f64>> = (0..k).map(|i| unit(i).collect()).collect();
        let pairs = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
        let pairs: Vec<Vec<f64>> = pairs
            .map(|(a, b)| unit(a).zip(unit(b)).map(|(x, y)| x - y).collect())
            .collect();
        let of = (&found.t_tests(&means)[..], &found.t_tests(&pairs)[..]);
        let v = found.variances;
        let variances = [v.intercept, v.cell, v.error];
        compare(
            &design,
            "",
            (of.0, of.1, found.f_test().unwrap()),
            &variances,
        );
    }
}

#[test]
fn the_crossed_slope_agrees_with_lmer_test() {
    for design in DESIGNS.map(Design::read) {
        let table = LmmData::new(&design.cells, FixedEffects::Covariate { center: 0.8 }).unwrap();
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

/// The likelihood is flat in the variance of slopes, where R stops early.
#[test]
fn the_variance_of_slopes_agrees_with_lmer() {
    for design in DESIGNS.map(Design::read) {
        let table = LmmData::new(&design.cells, FixedEffects::Covariate { center: 0.8 }).unwrap();
        let without = fit(&table, RandomEffects::crossed(&table), Criterion::Reml).unwrap();
        let found = slope_variance(&without).unwrap();
        let row = [found.variance, found.chi2];
        design.near(
            "slope variance",
            &row,
            design.rows("slope_variance")[0],
            &[2e-3, 1e-5],
        );
        let p = found.p.unwrap();
        assert!(p > 0.0 && p <= 1.0 && (found.chi2 > 1e-9 || p > 0.999));
    }
}

#[test]
fn the_interaction_agrees_with_lm() {
    for design in DESIGNS.map(Design::read) {
        let found = disagreement(&design.cells);
        assert_eq!(found.is_some(), design.repeats(), "{}", design.name);
        if let Some(found) = found {
            let row = [found.f, found.df1, found.df2, found.p.unwrap()];
            design.near(
                "interaction",
                &row,
                design.rows("interaction")[0],
                &[1e-8; 4],
            );
        }
    }
}

/// ordinal stops when its gradient is small. Its standard errors are not compared: it takes
/// them from differences of the likelihood, which lose half of the digits.
#[test]
fn the_crossed_ordinal_model_agrees_with_ordinal() {
    for design in DESIGNS.map(Design::read) {
        let found = clmm_crossed(&design.counts()).unwrap();
        let fit = &found.fit;
        let row = [
            fit.loglik,
            fit.beta[0],
            found.sd_subject,
            found.sd_realization,
            found.null_loglik,
        ];
        let mut expected = design.rows("ordinal")[0].to_vec();
        expected.remove(2);
        let tolerances = [1e-6, 1e-3, 1e-3, 1e-3, 1e-6];
        design.near("ordinal", &row, &expected, &tolerances);
    }
}
