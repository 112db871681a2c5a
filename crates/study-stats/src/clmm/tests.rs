#![allow(clippy::unwrap_used)]

use super::*;
use crate::clm::counts::{CategoryCount, Predictor};
use crate::clm::tests::{any_counts, counts, covariate, derivatives_hold, dummies};
use proptest::prelude::*;

const CELLS: [(u32, u32, &[u32]); 9] = [
    (0, 0, &[0, 1, 1]),
    (0, 1, &[0, 1, 2]),
    (0, 2, &[0, 2]),
    (1, 0, &[1, 2]),
    (1, 1, &[2, 3, 3]),
    (1, 2, &[2, 3, 3]),
    (2, 0, &[3, 3, 3]),
    (2, 1, &[3, 3]),
    (2, 2, &[2, 3]),
];

const AT: [f64; 6] = [-1.2, 0.3, 1.7, 0.8, -0.4, 0.2];

#[test]
fn laplaces_derivatives_agree_with_differences() {
    let table = dummies(4, &CELLS);
    for ln_sd in [-3.0, 0.2, 1.5] {
        let mut at = AT;
        at[5] = ln_sd;
        let mut modes = [0.0; 3];
        derivatives_hold(&at, 1e-7, |at| laplace::evaluate(&table, at, &mut modes));
    }
}

#[test]
fn the_derivatives_of_the_integral_agree_with_differences() {
    let table = covariate(&[-1.0, 0.3, 1.0], 4, &CELLS);
    let at = [-1.2, 0.3, 1.7, 0.8, 0.2];
    derivatives_hold(&at, 1e-7, |at| {
        quadrature::evaluate(&table, at, &RULE, &mut [0.0; 3])
    });
}

#[test]
fn laplace_is_quadrature_with_one_node() {
    let table = dummies(4, &CELLS);
    let one = quadrature::evaluate(&table, &AT, &hermite::rule(1), &mut [0.0; 3]).unwrap();
    let laplace = laplace::evaluate(&table, &AT, &mut [0.0; 3]).unwrap();
    assert!((one.value - laplace.value).abs() < 1e-12);
}

/// Compared with the definition, by a fine trapezoidal rule.
#[test]
fn the_quadrature_is_the_integral() {
    let table = dummies(4, &CELLS);
    let beta = [0.0, AT[3], AT[4]];
    let sd = AT[5].exp();
    let mut sum = 0.0;
    for subject in 0..3 {
        let mut integral = 0.0;
        let step = 1e-3;
        for i in -9000..=9000 {
            let u = f64::from(i) * step;
            let mut density = (-0.5 * u * u).exp() / (2.0 * std::f64::consts::PI).sqrt();
            for (s, g, ratings) in CELLS {
                for &c in ratings.iter().filter(|_| s == subject) {
                    let below = |j: u32| match j {
                        0 => 0.0,
                        4 => 1.0,
                        j => logistic(AT[j as usize - 1] - beta[g as usize] - sd * u),
                    };
                    density *= below(c + 1) - below(c);
                }
            }
            integral += density * step;
        }
        sum += integral.ln();
    }
    let found = quadrature::evaluate(&table, &AT, &RULE, &mut [0.0; 3]).unwrap();
    assert!((found.value - sum).abs() < 1e-10, "{} {sum}", found.value);
}

#[test]
fn equal_subjects_give_a_standard_deviation_of_zero() {
    let alike: &[u32] = &[0, 1, 1, 2];
    let other: &[u32] = &[0, 1, 2, 2];
    let cells: Vec<(u32, u32, &[u32])> = (0..6)
        .flat_map(|s| [(s, 0, alike), (s, 1, other)])
        .collect();
    let table = dummies(3, &cells);
    let both = clmm(&table);
    for mixed in [both.laplace.unwrap(), both.quadrature.unwrap()] {
        assert!(mixed.boundary && mixed.sd == 0.0);
        assert_eq!(mixed.fit, clm(&table).unwrap());
    }
}

#[test]
fn one_subject_has_no_mixed_model() {
    let both = clmm(&dummies(3, &[(0, 0, &[0, 1, 2]), (0, 1, &[0, 1, 2])]));
    assert_eq!(both.laplace, Err(ClmError::OneSubject));
    assert_eq!(both.quadrature, Err(ClmError::OneSubject));
}

/// Every subject always gives the same rating, so that σ is infinite.
#[test]
fn subjects_that_never_overlap_have_no_standard_deviation() {
    let cells: Vec<(u32, u32, Vec<u32>)> = (0..8)
        .flat_map(|s| [(s, 0, vec![s % 2; 9]), (s, 1, vec![s % 2; 9])])
        .collect();
    let cells: Vec<(u32, u32, &[u32])> = cells.iter().map(|c| (c.0, c.1, &c.2[..])).collect();
    let both = clmm(&dummies(2, &cells));
    for found in [both.laplace, both.quadrature] {
        assert!(
            matches!(
                found,
                Err(ClmError::SubjectsSeparated | ClmError::NoMaximum)
            ),
            "{found:?}"
        );
    }
}

fn fitted(categories: usize, counts: &[CategoryCount]) -> ClmmFits {
    let x = [-1.0, 0.1, 1.0].map(|x| Predictor { column: 0, x });
    clmm(&CategoryCounts::new(x.to_vec(), 1, categories, counts))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn all_estimates_are_finite((categories, counts) in any_counts()) {
        let both = fitted(categories, &counts);
        for mixed in [both.laplace, both.quadrature].into_iter().flatten() {
            let fit = &mixed.fit;
            let all = fit.thresholds.iter().chain(&fit.beta).chain(&fit.se);
            prop_assert!(all.chain([&fit.loglik, &mixed.sd]).all(|v| v.is_finite()));
            prop_assert!(fit.se.iter().all(|s| *s > 0.0));
        }
    }

    /// Numbers of subjects and the order of rows have no influence; reversing the scale
    /// reverses the effect.
    #[test]
    fn names_and_order_do_not_matter((categories, counts) in any_counts()) {
        let reversed: Vec<CategoryCount> = counts
            .iter()
            .rev()
            .map(|c| CategoryCount {
                subject: 9 - c.subject,
                category: categories as u32 - 1 - c.category,
                ..*c
            })
            .collect();
        let (a, b) = (fitted(categories, &counts), fitted(categories, &reversed));
        for (a, b) in [(a.laplace, b.laplace), (a.quadrature, b.quadrature)] {
            if let (Ok(a), Ok(b)) = (a, b) {
                prop_assert!((a.fit.loglik - b.fit.loglik).abs() < 1e-6);
                let size = 1.0 + a.fit.beta[0].abs();
                prop_assert!((a.fit.beta[0] + b.fit.beta[0]).abs() < 1e-3 * size);
            }
        }
    }
}

/// Two categories, one rating in each cell: Laplace's approximation is largest at an
/// extreme σ = 41, where the integral is flat. R 4.2.2, ordinal 2022.11-16,
/// `clmm(…, nAGQ = 10)` and a trapezoid of 2,001 points over the integral find
/// its maximum at σ = 1.943: log-likelihood −7.8312, slope 3.853.
#[test]
fn the_search_of_the_integral_restarts_if_laplace_is_misleading() {
    let x = [-0.292, -0.836, 0.876, 1.788];
    let answers = [
        [0, 0, 1, 1],
        [1, 0, 1, 1],
        [0, 0, 0, 1],
        [0, 0, 1, 1],
        [1, 0, 1, 1],
        [1, 0, 1, 1],
    ];
    let cells: Vec<(u32, u32, &[u32])> = (0u32..)
        .zip(&answers)
        .flat_map(|(s, own)| {
            (0u32..)
                .zip(own)
                .map(move |(g, c)| (s, g, std::slice::from_ref(c)))
        })
        .collect();
    let found = clmm(&covariate(&x, 2, &cells)).quadrature.unwrap();
    assert!((found.fit.loglik + 7.8312).abs() < 1e-4, "{found:?}");
    assert!((found.sd - 1.943).abs() < 2e-3, "{found:?}");
    assert!((found.fit.beta[0] - 3.853).abs() < 5e-3, "{found:?}");
}

/// Single ratings and their counts give the same fit.
#[test]
fn repeated_counts_add_up() {
    let cells = counts(&CELLS);
    let mut added: Vec<CategoryCount> = Vec::new();
    for c in &cells {
        let same = |a: &&mut CategoryCount| {
            (a.subject, a.predictor, a.category) == (c.subject, c.predictor, c.category)
        };
        match added.iter_mut().find(same) {
            Some(a) => a.n += 1,
            None => added.push(*c),
        }
    }
    assert!(added.len() < cells.len());
    assert_eq!(fitted(4, &cells), fitted(4, &added));
}
