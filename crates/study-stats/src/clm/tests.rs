#![allow(clippy::unwrap_used)]

use super::counts::{CategoryCount, CategoryCounts, Predictor};
use super::newton::Evaluation;
use super::*;
use proptest::prelude::*;

/// Counts with a dummy variable for each predictor but the first, from (subject,
/// predictor, ratings from 0).
pub(crate) fn dummies(categories: usize, cells: &[(u32, u32, &[u32])]) -> CategoryCounts {
    let groups = cells.iter().map(|c| c.1 as usize + 1).max().unwrap_or(0);
    let predictors = (0..groups)
        .map(|g| Predictor {
            column: g.saturating_sub(1),
            x: f64::from(u8::from(g > 0)),
        })
        .collect();
    let columns = groups.saturating_sub(1);
    CategoryCounts::new(predictors, columns, categories, &counts(cells))
}

pub(crate) fn counts(cells: &[(u32, u32, &[u32])]) -> Vec<CategoryCount> {
    let mut counts = Vec::new();
    for &(subject, predictor, ratings) in cells {
        counts.extend(ratings.iter().map(|&category| CategoryCount {
            subject,
            predictor,
            category,
            n: 1,
        }));
    }
    counts
}

/// Counts with one covariate.
pub(crate) fn covariate(
    x: &[f64],
    categories: usize,
    cells: &[(u32, u32, &[u32])],
) -> CategoryCounts {
    let predictors = x.iter().map(|&x| Predictor { column: 0, x }).collect();
    CategoryCounts::new(predictors, 1, categories, &counts(cells))
}

/// Checks gradient and Hessian against central differences of value and gradient.
pub(crate) fn derivatives_hold(
    at: &[f64],
    tolerance: f64,
    mut evaluate: impl FnMut(&[f64]) -> Option<Evaluation>,
) {
    let here = evaluate(at).unwrap();
    let step = 1e-4;
    for i in 0..at.len() {
        let mut moved = |by: f64| {
            let mut at = at.to_vec();
            at[i] += by;
            evaluate(&at).unwrap()
        };
        // Fourth order: the truncation error is far below the tolerance.
        let near = (moved(step), moved(-step));
        let far = (moved(2.0 * step), moved(-2.0 * step));
        let slope = |v: &dyn Fn(&Evaluation) -> f64| {
            (8.0 * (v(&near.0) - v(&near.1)) - (v(&far.0) - v(&far.1))) / (12.0 * step)
        };
        let close = |a: f64, b: f64, what: String| {
            let size = 1.0 + a.abs().max(b.abs());
            assert!((a - b).abs() < tolerance * size, "{what}: {a} and {b}");
        };
        close(
            here.gradient[i],
            slope(&|p| p.value),
            format!("gradient {i}"),
        );
        for j in 0..at.len() {
            close(
                here.hessian.get(i, j),
                slope(&|p| p.gradient[j]),
                format!("hessian {i} {j}"),
            );
        }
    }
}

const CELLS: [(u32, u32, &[u32]); 6] = [
    (0, 0, &[0, 1, 1]),
    (0, 1, &[1, 2, 3]),
    (0, 2, &[0, 2]),
    (1, 0, &[1, 2]),
    (1, 1, &[2, 3, 3]),
    (1, 2, &[1, 1, 3]),
];

#[test]
fn the_derivatives_are_those_of_the_likelihood() {
    let at = [-1.2, 0.3, 1.7, 0.8, -0.4];
    derivatives_hold(&at, 1e-8, |at| evaluate(&dummies(4, &CELLS), at));
    let table = covariate(&[-1.0, 0.2, 1.0], 4, &CELLS);
    derivatives_hold(&at[..4], 1e-8, |at| evaluate(&table, at));
}

#[test]
fn the_likelihood_is_the_product_of_the_probabilities() {
    let (theta, beta) = ([-1.2, 0.3, 1.7], [0.0, 0.8, -0.4]);
    let mut sum = 0.0;
    for (_, g, ratings) in CELLS {
        for &c in ratings {
            let below = |j: u32| match j {
                0 => 0.0,
                4 => 1.0,
                j => logistic(theta[j as usize - 1] - beta[g as usize]),
            };
            sum += (below(c + 1) - below(c)).ln();
        }
    }
    let value = evaluate(&dummies(4, &CELLS), &[-1.2, 0.3, 1.7, 0.8, -0.4]);
    assert!((value.unwrap().value - sum).abs() < 1e-12);
}

/// With two categories and two predictors β is the log odds ratio, and its variance the
/// sum of the reciprocal counts (Woolf 1955).
#[test]
fn a_two_by_two_table_has_the_log_odds_ratio() {
    let table = dummies(2, &[(0, 0, &[0, 0, 0, 1]), (0, 1, &[0, 0, 1, 1, 1, 1, 1])]);
    let fit = clm(&table).unwrap();
    let exact = (3.0f64 * 5.0 / (1.0 * 2.0)).ln();
    let se = (1.0 / 3.0 + 1.0 + 0.5 + 0.2f64).sqrt();
    assert!((fit.beta[0] - exact).abs() < 1e-10, "{fit:?}");
    assert!((fit.se[0] - se).abs() < 1e-10);
    assert!((fit.thresholds[0] - 3.0f64.ln()).abs() < 1e-10);
}

#[test]
fn separation_is_recognized_and_overlap_is_not() {
    let error = |table: CategoryCounts| clm(&table).err();
    let separated = Some(ClmError::Separated);
    // A realization with all ratings in the highest category.
    assert_eq!(
        error(dummies(3, &[(0, 0, &[0, 1, 2]), (0, 1, &[2, 2])])),
        separated
    );
    // With all ratings in a middle category: finite.
    assert_eq!(
        error(dummies(3, &[(0, 0, &[0, 1, 2]), (0, 1, &[1, 1])])),
        None
    );
    // One never in the highest, the other never in the lowest.
    assert_eq!(
        error(dummies(3, &[(0, 0, &[0, 1]), (0, 1, &[1, 2])])),
        separated
    );
    // No realization links the lower categories with the upper ones; then one does.
    let unlinked: [(u32, u32, &[u32]); 3] = [(0, 0, &[0, 1]), (0, 1, &[2, 3]), (0, 2, &[0, 1])];
    assert_eq!(error(dummies(4, &unlinked)), separated);
    let linked: [(u32, u32, &[u32]); 3] = [(0, 0, &[0, 1]), (0, 1, &[2, 3]), (0, 2, &[0, 3])];
    assert_eq!(error(dummies(4, &linked)), None);
    // A covariate can order realizations that have no category in common.
    let x = [-1.0, 0.0, 1.0];
    assert_eq!(
        error(covariate(
            &x,
            3,
            &[(0, 0, &[0]), (0, 1, &[1, 1]), (0, 2, &[2])]
        )),
        separated
    );
    assert_eq!(
        error(covariate(
            &x,
            3,
            &[(0, 0, &[1]), (0, 1, &[0, 0]), (0, 2, &[2])]
        )),
        None
    );
    // Ratings that share only one category are still ordered.
    assert_eq!(
        error(covariate(
            &x,
            2,
            &[(0, 0, &[0]), (0, 1, &[0, 1]), (0, 2, &[1])]
        )),
        separated
    );
}

#[test]
fn constant_ratings_or_predictors_have_no_model() {
    assert_eq!(
        clm(&dummies(1, &[(0, 0, &[0]), (0, 1, &[0])])),
        Err(ClmError::OneCategory)
    );
    assert_eq!(
        clm(&dummies(2, &[(0, 0, &[0, 1])])),
        Err(ClmError::OnePredictor)
    );
    let same = covariate(&[0.5, 0.5], 2, &[(0, 0, &[0, 1]), (0, 1, &[0, 1])]);
    assert_eq!(clm(&same), Err(ClmError::OnePredictor));
    assert!(clm(&CategoryCounts::new(Vec::new(), 0, 0, &[])).is_err());
}

/// Small tables in which every category occurs, with consecutive predictors.
pub(crate) fn any_counts() -> impl Strategy<Value = (usize, Vec<CategoryCount>)> {
    let count = (0u32..4, 0u32..3, 0u32..5, 1u32..4);
    prop::collection::vec(count, 1..16).prop_map(|list| {
        let mut used: Vec<u32> = list.iter().map(|c| c.2).collect();
        used.sort_unstable();
        used.dedup();
        let rank = |c: u32| used.partition_point(|u| *u < c) as u32;
        let mut asked: Vec<u32> = list.iter().map(|c| c.1).collect();
        asked.sort_unstable();
        asked.dedup();
        let place = |p: u32| asked.partition_point(|u| *u < p) as u32;
        let counts = list
            .iter()
            .map(|&(subject, predictor, category, n)| CategoryCount {
                subject,
                predictor: place(predictor),
                category: rank(category),
                n,
            })
            .collect();
        (used.len(), counts)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    /// Either the estimates are infinite by the exact criterion, or Newton's method finds
    /// them.
    #[test]
    fn every_table_is_separated_or_fitted((categories, counts) in any_counts()) {
        let covariate = [-1.0, 0.1, 1.0].map(|x| Predictor { column: 0, x });
        let groups = counts.iter().map(|c| c.predictor as usize + 1).max().unwrap_or(0);
        let dummy = |g: usize| Predictor {
            column: g.saturating_sub(1),
            x: f64::from(u8::from(g > 0)),
        };
        let dummies: Vec<Predictor> = (0..groups).map(dummy).collect();
        for (predictors, columns) in [(covariate.to_vec(), 1), (dummies, groups - 1)] {
            let table = CategoryCounts::new(predictors, columns, categories, &counts);
            match clm(&table) {
                Ok(fit) => {
                    let at: Vec<f64> = fit.thresholds.iter().chain(&fit.beta).copied().collect();
                    let slope = evaluate(&table, &at).unwrap().gradient;
                    prop_assert!(slope.iter().all(|g| g.abs() < 1e-6), "{slope:?}");
                    prop_assert!(fit.thresholds.windows(2).all(|w| w[0] < w[1]));
                    prop_assert!(fit.se.iter().all(|s| s.is_finite() && *s > 0.0));
                }
                Err(cause) => prop_assert!(cause != ClmError::NoMaximum, "{counts:?}"),
            }
        }
    }

    #[test]
    fn reversing_the_scale_changes_the_sign((categories, counts) in any_counts()) {
        let x = [-1.0, 0.1, 1.0].map(|x| Predictor { column: 0, x }).to_vec();
        let reversed: Vec<CategoryCount> = counts
            .iter()
            .rev()
            .map(|c| CategoryCount { category: categories as u32 - 1 - c.category, ..*c })
            .collect();
        let a = clm(&CategoryCounts::new(x.clone(), 1, categories, &counts));
        let b = clm(&CategoryCounts::new(x, 1, categories, &reversed));
        match (a, b) {
            (Ok(a), Ok(b)) => {
                prop_assert!((a.loglik - b.loglik).abs() < 1e-9);
                prop_assert!((a.beta[0] + b.beta[0]).abs() < 1e-6);
                for (s, t) in a.thresholds.iter().zip(b.thresholds.iter().rev()) {
                    prop_assert!((s + t).abs() < 1e-6);
                }
            }
            (a, b) => prop_assert_eq!(a.err(), b.err()),
        }
    }
}
