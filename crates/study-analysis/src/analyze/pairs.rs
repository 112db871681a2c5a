//! The comparison of pairs on which verdicts rest: `pair/a|b/*`.
//!
//! The paired t test of cell means over the participants who rated everything; where
//! they are too few, the differences within participants over all cells, clustered by participant. Holm's correction is
//! over all pairs. Up to [`MAX_PAIRED`] realizations every pair is given, above the
//! best-rated realization against each other one; the correction counts the pairs that are
//! not given, because the best is chosen by the ratings. With a
//! preregistered margin each pair is also tested for equivalence.

use super::adjusted::{Adjusted, MAX_COMPARED};
use super::cells::{Cell, Cells};
use super::effects::MAX_PAIRED;
use super::record::{Interval, PairName, Stat, Why, statistics};
use super::{Better, Rules};
use std::collections::BTreeMap;
use study_stats::describe::{mean, sd};
use study_stats::lmm::ContrastT;
use study_stats::paired::{Equivalence, equivalence_of, holm, one_sample};

statistics! {
    /// Whether a difference is smaller than the `equivalence_margin`.
    pub struct PairEquivalence {
        /// the larger p of the two one-sided t tests that the difference lies within ± the margin
        p_tost: Stat,
        /// the same corrected over all pairs
        p_tost_holm: Stat,
        /// lies within the margin where `p_tost` is below .05
        ci90: Interval,
    }

    /// The comparison of two realizations on which verdicts rest: the paired t test over the participants who rated every realization or, where these are too few, a difference in `within_cells` with a standard error clustered by participant (see `within_clustered`); pairs that no two participants link are left out.
    pub struct PairTest {
        /// participants
        n: Stat,
        /// a minus b
        difference: Stat,
        /// its standard error
        se: Stat,
        /// `difference`/`se`
        t: Stat,
        /// degrees of freedom
        df: Stat,
        /// two-sided
        p: Stat,
        /// corrected over all pairs
        p_holm: Stat,
        /// not corrected for the number of pairs
        ci95: Interval,
        /// difference over the standard deviation of the differences
        dz: Stat,
        /// with a margin
        equivalence: Option<PairEquivalence> as "",
    }

    /// Pairs of realizations. Up to eight realizations every pair is listed, above (up to 60) only those with the highest mean; the correction counts them all.
    pub struct PairTests {
        /// pairs that were compared
        n_compared: Stat,
        /// each pair
        compared: BTreeMap<PairName, PairTest> as "",
    }
}

/// A difference, first minus second.
struct Difference {
    first: usize,
    second: usize,
    n: usize,
    t: ContrastT,
    dz: Option<f64>,
}

pub(super) fn pairs(cells: &Cells<'_>, adjusted: &Adjusted, rules: &Rules) -> Option<PairTests> {
    let k = adjusted.models.len();
    if !(2..=MAX_COMPARED).contains(&k) {
        return None;
    }
    let (found, why): (Vec<Difference>, Why) = if adjusted.design.uses_complete() {
        let why = match adjusted.design.complete {
            0 | 1 => "fewer than two participants rated every realization",
            _ => "all differences are equal",
        };
        (of_complete(cells, &adjusted.models), why.into())
    } else {
        match &adjusted.within {
            Ok(within) => {
                let set = |c: &Cell| {
                    let at = adjusted.models.binary_search(&c.model).ok();
                    at.map(|at| within.sets[at])
                };
                let by_participant = cells.cells.chunk_by(|a, b| a.subject == b.subject);
                let of: Vec<Option<usize>> =
                    by_participant.map(|own| own.iter().find_map(set)).collect();
                let people = |set: usize| of.iter().filter(|of| **of == Some(set)).count();
                let places = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
                let difference = |first: usize, second: usize| match &adjusted.clustered {
                    Some(clustered) => {
                        let mut weights = vec![0.0; k];
                        (weights[first], weights[second]) = (1.0, -1.0);
                        clustered.contrast(&weights)
                    }
                    None => within.difference(first, second),
                };
                let found = places.filter_map(|(first, second)| {
                    Some(Difference {
                        first,
                        second,
                        n: people(within.sets[first]),
                        t: difference(first, second)?,
                        dz: None,
                    })
                });
                let why = "the ratings leave no variance of error";
                (found.collect(), why.into())
            }
            Err(error) => (Vec::new(), error.to_string().into()),
        }
    };
    let p_holm = holm(&found.iter().map(|d| d.t.p).collect::<Vec<_>>());
    let margin = rules.equivalence_margin;
    let tost = |d: &Difference| equivalence_of(d.t.estimate, d.t.se, d.t.df?, margin?);
    let tost: Vec<Option<Equivalence>> = found.iter().map(tost).collect();
    let tost_holm = holm(&tost.iter().map(|e| e.map(|e| e.p)).collect::<Vec<_>>());
    let compared = p_holm.iter().flatten().count();
    let means = adjusted.means.as_deref().unwrap_or_default();
    let best = (k > MAX_PAIRED).then(|| first_best(means, rules.better));
    let or = |x: Option<f64>| Stat::or(x, why.clone());
    let listed =
        |d: &Difference| best.is_none_or(|best| best == Some(d.first) || best == Some(d.second));
    let all = found.iter().zip(p_holm).enumerate();
    let compared_pairs = all.filter(|(_, (d, _))| listed(d)).map(|(i, (d, p_holm))| {
        let name = |at: usize| cells.model_name(adjusted.models[at]);
        let equivalence = margin.map(|_| PairEquivalence {
            p_tost: or(tost[i].map(|e| e.p)),
            p_tost_holm: or(tost_holm[i]),
            ci90: Interval::or(tost[i].map(|e| e.ci90), why.clone()),
        });
        let test = PairTest {
            n: Stat::count(d.n),
            difference: Stat::of(d.t.estimate),
            se: Stat::of(d.t.se),
            t: or(d.t.t.filter(|_| d.t.p.is_some())),
            df: or(d.t.df),
            p: or(d.t.p),
            p_holm: or(p_holm),
            ci95: Interval::or(d.t.ci95, why.clone()),
            dz: or(d.dz),
            equivalence,
        };
        (PairName::of(name(d.first), name(d.second)), test)
    });
    Some(PairTests {
        n_compared: Stat::count(compared),
        compared: compared_pairs.collect(),
    })
}

/// The position of the first best mean.
fn first_best(means: &[f64], better: Better) -> Option<usize> {
    (0..means.len()).min_by(|&i, &j| better.best_first(means[i], means[j]))
}

/// Paired t tests over the participants who rated everything.
fn of_complete(cells: &Cells<'_>, models: &[usize]) -> Vec<Difference> {
    let table = cells.table(models);
    let columns: Vec<Vec<f64>> = (0..models.len()).map(|j| table.column(j)).collect();
    let mut found = Vec::new();
    for first in 0..models.len() {
        for second in first + 1..models.len() {
            let both = columns[first].iter().zip(&columns[second]);
            let d: Vec<f64> = both.map(|(a, b)| a - b).collect();
            let n = d.len();
            let size = (columns[first].iter().chain(&columns[second]))
                .fold(0.0f64, |size, x| size.max(x.abs()));
            let (Some(estimate), Some(spread), Some(test)) = (mean(&d), sd(&d), one_sample(&d))
            else {
                continue;
            };
            // Differences of equal thirds differ in their last bits only.
            let varies = spread > 1e-12 * size;
            let t = ContrastT {
                estimate,
                se: if varies {
                    spread / (n as f64).sqrt()
                } else {
                    0.0
                },
                t: test.t.filter(|_| varies),
                df: Some(n as f64 - 1.0),
                p: test.p.filter(|_| varies),
                ci95: Some(test.ci95).filter(|_| varies),
            };
            found.push(Difference {
                first,
                second,
                n,
                dz: varies.then(|| estimate / spread),
                t,
            });
        }
    }
    found
}
