//! Adjusted means: what the mean rating of each realization would be if every subject
//! had rated it.
//!
//! Where cells are missing, the mean over the ratings of a realization depends on who
//! rated it. The marginal means of the mixed model cell mean ~ realization + (1 | subject),
//! by REML, do not (Searle, Speed & Milliken 1980). Each cell counts once, however often
//! it was rated: repeated ratings are not independent. In complete tables the adjusted
//! means are the means over subjects.

use super::data::{FixedEffects, LmmData};
use super::fit::{Criterion, VarianceComponents, fit};
use super::kenward_roger::kenward_roger_t;
use super::satterthwaite::{ContrastF, ContrastT};
use super::{LmmError, RandomEffects};

/// Adjusted means of all realizations, with their tests.
#[derive(Debug, Clone, PartialEq)]
pub struct AdjustedMeans {
    /// The numbers that identify the realizations, sorted.
    pub realizations: Vec<usize>,
    /// The mean of each realization. Its t tests the mean 0.
    pub means: Vec<ContrastT>,
    /// The differences of all pairs of `realizations`, the first minus the second:
    /// (0, 1), (0, 2), …, (1, 2), ….
    pub pairs: Vec<ContrastT>,
    /// The test that all means are equal, by Satterthwaite's degrees of freedom.
    pub effect: Option<ContrastF>,
    /// The variances: of the subjects, and of the cell means (`error`).
    pub variances: VarianceComponents,
    /// Whether the variance of the subjects is 0.
    pub singular: bool,
    /// Whether subjects link all realizations: if not, some differences compare different
    /// subjects only.
    pub connected: bool,
}

/// Adjusted means of the cells of `table`, whatever its fixed effects.
///
/// # Errors
/// If there are fewer than two realizations or the model has no fit.
pub fn adjusted_means(table: &LmmData) -> Result<AdjustedMeans, LmmError> {
    let table = table.with_fixed_effects(FixedEffects::Realizations)?;
    let table = table.of_cell_means();
    let k = table.realizations.len();
    if k < 2 {
        return Err(LmmError::OneRealization);
    }
    let found = fit(&table, RandomEffects::default(), Criterion::Reml)?;
    let unit = |i: usize| -> Vec<f64> { (0..k).map(|j| f64::from(u8::from(i == j))).collect() };
    let pairs = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
    let difference = |(a, b): (usize, usize)| {
        let mut l = unit(a);
        l[b] = -1.0;
        l
    };
    let contrasts: Vec<Vec<f64>> = (0..k).map(unit).chain(pairs.map(difference)).collect();
    let adjusted = kenward_roger_t(&found, &contrasts);
    let mut means = adjusted.unwrap_or_else(|| found.t_tests(&contrasts));
    let pairs = means.split_off(k);
    Ok(AdjustedMeans {
        means,
        pairs,
        effect: found.f_test(),
        variances: found.variances,
        singular: found.singular,
        connected: table.connected(),
        realizations: table.realizations.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::super::{CellSummary, FixedEffects, LmmData};
    use super::*;

    /// One cell for each rating mean: subject, realization, ratings.
    fn table(cells: &[(usize, usize, &[f64])]) -> LmmData {
        let cell = |&(subject, realization, ratings): &(usize, usize, &[f64])| {
            let n = ratings.len();
            let mean = ratings.iter().sum::<f64>() / n as f64;
            CellSummary {
                subject,
                realization,
                x: 0.0,
                n,
                mean,
                within: ratings.iter().map(|r| (r - mean).powi(2)).sum(),
            }
        };
        let cells: Vec<CellSummary> = cells.iter().map(cell).collect();
        LmmData::new(&cells, FixedEffects::Intercept).unwrap()
    }

    /// Lenient subjects rate 0 to 2, severe ones 2 to 4; each realization is better than
    /// the one before. The raw means are about 5, 5.5, 4, 2.5, 3.
    #[test]
    fn who_rated_a_realization_does_not_affect_its_mean() {
        let mut cells: Vec<(usize, usize, Vec<f64>)> = Vec::new();
        for s in 0..6usize {
            let noise = 0.1 * (s % 3) as f64;
            let (first, level) = if s < 3 { (0, 5.0) } else { (2, 1.0) };
            for j in first..first + 3 {
                let wave = if (s + j).is_multiple_of(2) {
                    noise
                } else {
                    -noise
                };
                cells.push((s, j, vec![level + 0.5 * j as f64 + wave]));
            }
        }
        let cells: Vec<_> = cells.iter().map(|c| (c.0, c.1, &c.2[..])).collect();
        let found = adjusted_means(&table(&cells)).unwrap();
        let rise: Vec<f64> = found
            .means
            .windows(2)
            .map(|w| w[1].estimate - w[0].estimate)
            .collect();
        assert!(rise.iter().all(|r| (r - 0.5).abs() < 0.2), "{rise:?}");
    }

    #[test]
    fn a_complete_table_has_the_means_over_subjects() {
        let cells: Vec<(usize, usize, Vec<f64>)> = (0..12)
            .map(|i| (i / 3, i % 3, vec![((i * i) % 7) as f64; 1 + i % 2]))
            .collect();
        let borrowed: Vec<_> = cells.iter().map(|c| (c.0, c.1, &c.2[..])).collect();
        let found = adjusted_means(&table(&borrowed)).unwrap();
        assert!(found.connected);
        for (j, t) in found.means.iter().enumerate() {
            let own = cells.iter().filter(|c| c.1 == j);
            let mean = own.map(|c| c.2[0]).sum::<f64>() / 4.0;
            assert!((t.estimate - mean).abs() < 1e-9, "{j}: {t:?}, {mean}");
        }
    }

    #[test]
    fn the_number_of_ratings_of_a_cell_does_not_matter() {
        let y = [3.0, 5.0, 4.0, 2.0, 3.0, 5.0, 6.0, 7.0, 6.0];
        let cells = |n: usize| -> Vec<(usize, usize, Vec<f64>)> {
            let copies = |i: usize| vec![y[i]; if i.is_multiple_of(2) { n } else { 1 }];
            (0..9).map(|i| (i / 3, i % 3, copies(i))).collect()
        };
        let found = [1, 4].map(|n| {
            let cells = cells(n);
            let cells: Vec<_> = cells.iter().map(|c| (c.0, c.1, &c.2[..])).collect();
            adjusted_means(&table(&cells)).unwrap()
        });
        for (a, b) in found[0].pairs.iter().zip(&found[1].pairs) {
            assert!((a.estimate - b.estimate).abs() < 1e-9 && (a.se - b.se).abs() < 1e-6);
        }
    }

    #[test]
    fn realizations_without_a_common_subject_are_not_connected() {
        let cells: Vec<(usize, usize, Vec<f64>)> = (0..8)
            .map(|i| {
                (
                    i / 2,
                    i % 2 + 2 * (i / 4),
                    vec![((i * 3) % 5) as f64, (i % 3) as f64],
                )
            })
            .collect();
        let cells: Vec<_> = cells.iter().map(|c| (c.0, c.1, &c.2[..])).collect();
        assert!(!adjusted_means(&table(&cells)).unwrap().connected);
    }
}
