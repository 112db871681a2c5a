//! Whether the odds are proportional: one coefficient for all thresholds, or one each.

use super::counts::CategoryCounts;
use super::newton::{Evaluation, maximize};
use super::{ClmFit, logistic, softplus};
use crate::distribution::chi2_upper;

/// The likelihood-ratio test of one coefficient against one for each threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct ProportionalOdds {
    /// Twice the difference of the log-likelihoods.
    pub chi2: f64,
    /// Number of thresholds − 1.
    pub df: f64,
    /// P(χ² ≥ chi2).
    pub p: Option<f64>,
    /// The coefficient at each threshold.
    pub coefficients: Vec<f64>,
}

/// Tests proportional odds in a model with one covariate, given its fit. All ratings are
/// treated as independent, as in [`super::clm`].
///
/// The alternative is logit P(Y ≤ j) = θⱼ − xβⱼ (Peterson & Harrell 1990). With
/// aⱼ = θⱼ − xβⱼ its log-likelihood is that of [`super::clm`], but the term κ(aⱼ − aⱼ₋₁)
/// now depends on x. `None` for fewer than three categories, with several columns, or if
/// the alternative has no maximum within which all probabilities are positive.
pub fn proportional_odds(table: &CategoryCounts, fit: &ClmFit) -> Option<ProportionalOdds> {
    let t = table.thresholds();
    if t < 2 || fit.beta.len() != 1 || fit.thresholds.len() != t {
        return None;
    }
    let mut start = fit.thresholds.clone();
    start.resize(2 * t, fit.beta[0]);
    let found = maximize(start, |at| evaluate(table, at))?;
    let chi2 = (2.0 * (found.value - fit.loglik)).max(0.0);
    let df = t as f64 - 1.0;
    Some(ProportionalOdds {
        chi2,
        df,
        p: chi2_upper(chi2, df),
        coefficients: found.at[t..].to_vec(),
    })
}

/// Value, gradient and Hessian at (θ, β₁ … ); `None` if a probability is not positive.
fn evaluate(table: &CategoryCounts, at: &[f64]) -> Option<Evaluation> {
    let t = table.thresholds();
    let mut point = Evaluation::zero(2 * t);
    for (predictor, counts) in table
        .predictors()
        .iter()
        .zip(table.pooled().chunks_exact(t))
    {
        let x = predictor.x;
        let a: Vec<f64> = (0..t).map(|j| at[j] - x * at[t + j]).collect();
        let mut first = vec![0.0; t];
        // Second derivatives in aⱼ, and in aⱼ and aⱼ₋₁.
        let (mut own, mut beside) = (vec![0.0; t], vec![0.0; t]);
        for (j, &(n, m)) in counts.iter().enumerate() {
            let f = logistic(a[j]);
            point.value += n * a[j] - m * softplus(a[j]);
            first[j] += n - m * f;
            own[j] -= m * f * (1.0 - f);
            if j > 0 {
                let gap = a[j] - a[j - 1];
                if !(gap > 0.0 && gap.is_finite()) {
                    return None;
                }
                let slope = 1.0 / gap.exp_m1();
                let curve = -slope * (1.0 + slope);
                point.value += n * (-(-gap).exp_m1()).ln();
                first[j] += n * slope;
                first[j - 1] -= n * slope;
                own[j] += n * curve;
                own[j - 1] += n * curve;
                beside[j] = -n * curve;
            }
        }
        for j in 0..t {
            point.gradient[j] += first[j];
            point.gradient[t + j] -= x * first[j];
            let mut add = |k: usize, w: f64| {
                point.hessian.add(j, k, w);
                point.hessian.add(t + j, t + k, x * x * w);
                point.hessian.add(t + j, k, -x * w);
                if k != j {
                    point.hessian.add(t + k, j, -x * w);
                }
            };
            add(j, own[j]);
            if j > 0 {
                add(j - 1, beside[j]);
            }
        }
    }
    point.value.is_finite().then_some(point)
}

#[cfg(test)]
mod tests {
    use super::super::clm;
    use super::super::tests::derivatives_hold;
    use super::*;
    use crate::clm::counts::{CategoryCount, Predictor};

    fn table(rows: &[[u32; 5]; 5]) -> CategoryCounts {
        let predictors = [-1.0, -0.4, 0.1, 0.5, 1.0].map(|x| Predictor { column: 0, x });
        let counts = rows.iter().zip(0..).flat_map(|(row, predictor)| {
            let count = move |(&n, category)| CategoryCount {
                subject: 0,
                predictor,
                category,
                n,
            };
            row.iter().zip(0..).map(count)
        });
        let counts: Vec<CategoryCount> = counts.collect();
        CategoryCounts::new(predictors.to_vec(), 1, 5, &counts)
    }

    /// R 4.2.2, ordinal 2022.11.16: `nominal_test(clm(factor(y) ~ x))` of 300 simulated
    /// ratings, five values of x.
    #[test]
    fn the_test_agrees_with_ordinal() {
        let cases = [
            (
                [
                    [13, 22, 16, 8, 1],
                    [13, 13, 8, 17, 9],
                    [5, 11, 17, 14, 13],
                    [4, 17, 17, 14, 8],
                    [3, 9, 18, 17, 13],
                ],
                [-460.863_012_7, 1.667_705_465, 0.644_137_313_4],
            ),
            (
                [
                    [5, 26, 15, 12, 2],
                    [6, 24, 16, 8, 6],
                    [6, 12, 21, 13, 8],
                    [9, 13, 15, 14, 9],
                    [5, 10, 14, 15, 16],
                ],
                [-455.647_272_3, 9.963_527_801, 0.018_878_720_31],
            ),
            (
                [
                    [1, 24, 25, 9, 1],
                    [2, 13, 30, 13, 2],
                    [7, 16, 11, 17, 9],
                    [9, 11, 7, 13, 20],
                    [15, 8, 4, 10, 23],
                ],
                [-467.779_628_8, 88.177_366_57, 5.394_992_238e-19],
            ),
        ];
        for (rows, [loglik, chi2, p]) in cases {
            let table = table(&rows);
            let fit = clm(&table).unwrap();
            let found = proportional_odds(&table, &fit).unwrap();
            assert!((fit.loglik - loglik).abs() < 1e-6, "{fit:?}");
            assert!((found.chi2 - chi2).abs() < 1e-5, "{found:?}");
            assert!((found.p.unwrap() / p - 1.0).abs() < 1e-4, "{found:?}");
            assert_eq!(found.df, 3.0);
        }
    }

    #[test]
    fn the_derivatives_are_those_of_the_likelihood() {
        let table = table(&[
            [1, 2, 3, 4, 5],
            [2, 1, 4, 3, 1],
            [1, 1, 1, 1, 1],
            [5, 4, 3, 2, 1],
            [1, 3, 1, 3, 1],
        ]);
        let at = [-1.2, -0.1, 0.6, 1.7, 0.3, -0.2, 0.1, 0.25];
        derivatives_hold(&at, 1e-7, |at| evaluate(&table, at));
    }

    #[test]
    fn two_categories_have_nothing_to_compare() {
        let rows = [
            [3, 2, 0, 0, 0],
            [2, 3, 0, 0, 0],
            [1, 1, 0, 0, 0],
            [2, 1, 0, 0, 0],
            [1, 4, 0, 0, 0],
        ];
        let counts = table(&rows);
        let fit = ClmFit {
            thresholds: vec![0.0],
            beta: vec![0.0],
            se: vec![1.0],
            loglik: -10.0,
        };
        assert_eq!(proportional_odds(&counts, &fit), None);
    }
}
