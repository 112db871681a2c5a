//! Magnitude estimation: geometric means and the exponent of the power law.

use super::describe;
use super::distribution::t_quantile;
use super::regression;

/// One estimate of one participant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Participant, as an index.
    pub participant: usize,
    /// The level that was presented.
    pub level: f64,
    /// The number that was given.
    pub estimate: f64,
}

/// A mean with its t interval over participants.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// 95 % interval; `None` for one participant.
    pub ci95: Option<(f64, f64)>,
}

/// The mean and its t interval, after `back`.
fn mean_of(x: &[f64], back: fn(f64) -> f64) -> Option<Mean> {
    let mean = describe::mean(x)?;
    let n = x.len() as f64;
    let half = describe::sd(x)
        .zip(t_quantile(0.975, n - 1.0))
        .map(|(sd, t)| t * sd / n.sqrt());
    Some(Mean {
        mean: back(mean),
        ci95: half.map(|h| (back(mean - h), back(mean + h))),
    })
}

/// What the estimates show.
#[derive(Debug, Clone, PartialEq)]
pub struct Magnitude {
    /// Estimates that are 0 or less and have no logarithm.
    pub left_out: usize,
    /// Each level, rising, with the geometric mean over participants.
    pub levels: Vec<(f64, Option<Mean>)>,
    /// The power law a·xⁿ: least squares of the mean logarithms on log10 of the level.
    /// `None` with fewer than two levels above 0.
    pub law: Option<PowerLaw>,
    /// The exponent of each participant, in the order of their indices.
    pub exponents: Vec<Option<f64>>,
    /// Mean of those exponents.
    pub exponent: Option<Mean>,
}

/// a·xⁿ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// n.
    pub exponent: f64,
    /// log10 of a.
    pub log10_coefficient: f64,
    /// Share of the variance of the mean logarithms.
    pub r_squared: Option<f64>,
}

/// Geometric means after modulus equalization (Lane, Catania & Stevens 1961), in log10:
/// a participant's mean of each level; minus the participant's mean over the levels,
/// plus the grand mean. Estimates that are not above 0 are left out.
///
/// ```
/// # use study_stats::magnitude::{Estimate, magnitude};
/// // Numbers that grow with the root of the level.
/// let estimate = |level: f64| Estimate { participant: 0, level, estimate: 3.0 * level.sqrt() };
/// let found = magnitude(&[estimate(1.0), estimate(10.0), estimate(100.0)]);
/// assert!((found.law.unwrap().exponent - 0.5).abs() < 1e-12);
/// ```
pub fn magnitude(estimates: &[Estimate]) -> Magnitude {
    let good = |e: &&Estimate| e.estimate > 0.0 && e.estimate.is_finite() && e.level.is_finite();
    let kept: Vec<&Estimate> = estimates.iter().filter(good).collect();
    let participants = estimates
        .iter()
        .map(|e| e.participant + 1)
        .max()
        .unwrap_or(0);
    let mut levels: Vec<f64> = kept.iter().map(|e| e.level).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    // cells[participant][level]
    let cells: Vec<Vec<Option<f64>>> = (0..participants)
        .map(|p| {
            let cell = |level: &f64| {
                let logs = kept
                    .iter()
                    .filter(|e| e.participant == p && e.level == *level);
                let logs: Vec<f64> = logs.map(|e| e.estimate.log10()).collect();
                describe::mean(&logs)
            };
            levels.iter().map(cell).collect()
        })
        .collect();
    let own: Vec<Option<f64>> = cells.iter().map(|row| mean_of_known(row)).collect();
    let grand = mean_of_known(&own).unwrap_or(0.0);
    let equalized = |level: usize| -> Vec<f64> {
        (cells.iter().zip(&own))
            .filter_map(|(row, own)| Some(row[level]? - (*own)? + grand))
            .collect()
    };
    let columns: Vec<Vec<f64>> = (0..levels.len()).map(equalized).collect();
    let means: Vec<Option<f64>> = columns.iter().map(|c| describe::mean(c)).collect();
    let exponents: Vec<Option<f64>> = (cells.iter())
        .map(|row| law(&levels, row).map(|law| law.exponent))
        .collect();
    let known: Vec<f64> = exponents.iter().flatten().copied().collect();
    Magnitude {
        left_out: estimates.len() - kept.len(),
        law: law(&levels, &means),
        levels: (levels.into_iter().zip(&columns))
            .map(|(level, column)| (level, mean_of(column, |x| 10f64.powf(x))))
            .collect(),
        exponents,
        exponent: mean_of(&known, |x| x),
    }
}

fn mean_of_known(x: &[Option<f64>]) -> Option<f64> {
    describe::mean(&x.iter().flatten().copied().collect::<Vec<_>>())
}

fn law(levels: &[f64], logs: &[Option<f64>]) -> Option<PowerLaw> {
    let (x, y): (Vec<f64>, Vec<f64>) = (levels.iter().zip(logs))
        .filter_map(|(level, log)| (*level > 0.0).then_some((level.log10(), (*log)?)))
        .unzip();
    let exponent = regression::slope(&x, &y)?;
    let (sum, product) = (
        describe::sum_of_squares(&y)?,
        describe::sum_of_products(&x, &y)?,
    );
    Some(PowerLaw {
        exponent,
        log10_coefficient: describe::mean(&y)? - exponent * describe::mean(&x)?,
        r_squared: super::finite(exponent * product / sum),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two participants with moduli 2 and 20 who follow x^0.5 exactly.
    #[test]
    fn the_modulus_does_not_matter() {
        let mut estimates = Vec::new();
        for (participant, modulus) in [(0, 2.0), (1, 20.0)] {
            for level in [1.0, 4.0, 9.0f64] {
                estimates.push(Estimate {
                    participant,
                    level,
                    estimate: modulus * level.sqrt(),
                });
            }
        }
        estimates.push(Estimate {
            participant: 0,
            level: 1.0,
            estimate: 0.0,
        });
        let found = magnitude(&estimates);
        assert_eq!(found.left_out, 1);
        let law = found.law.unwrap();
        assert!((law.exponent - 0.5).abs() < 1e-12);
        assert!((law.r_squared.unwrap() - 1.0).abs() < 1e-12);
        for (level, mean) in &found.levels {
            let (mean, expected) = (mean.unwrap(), 40f64.sqrt() * level.sqrt());
            assert!((mean.mean - expected).abs() < 1e-9);
            let (low, high) = mean.ci95.unwrap();
            assert!((high - low).abs() < 1e-9, "equalized participants agree");
        }
        assert_eq!(magnitude(&[]).law, None);
    }
}
