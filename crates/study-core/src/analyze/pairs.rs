//! The comparison of pairs on which verdicts rest: `pair/a|b/*`.
//!
//! The paired t test of cell means over the participants who rated everything; where
//! they are too few, contrasts of the mixed model of all cells. Holm's correction is
//! over all pairs. Up to [`MAX_PAIRED`] realizations every pair is given, above the
//! best-rated realization against each other one; the correction counts the pairs that are
//! not given, because the best is chosen by the ratings. With a
//! preregistered margin each pair is also tested for equivalence.

use super::adjusted::{Adjusted, MAX_COMPARED};
use super::cells::Cells;
use super::effects::MAX_PAIRED;
use super::identifiers::pair_id;
use super::values::Values;
use super::{Better, Rules};
use study_stats::describe::{mean, sd};
use study_stats::lmm::ContrastT;
use study_stats::paired::{Equivalence, equivalence_of, holm, one_sample};

/// A difference, first minus second.
struct Difference {
    first: usize,
    second: usize,
    n: usize,
    t: ContrastT,
    dz: Option<f64>,
}

pub(super) fn pairs(cells: &Cells<'_>, adjusted: &Adjusted, rules: &Rules, values: &mut Values) {
    let k = adjusted.models.len();
    if !(2..=MAX_COMPARED).contains(&k) {
        return;
    }
    let (found, why) = if adjusted.design.uses_complete() {
        let why = match adjusted.design.complete {
            0 | 1 => "fewer than two participants rated every realization",
            _ => "all differences are equal",
        };
        (of_complete(cells, &adjusted.models), why.to_owned())
    } else {
        match &adjusted.fit {
            Ok(fit) => {
                let places = (0..k).flat_map(|a| (a + 1..k).map(move |b| (a, b)));
                let found = places
                    .zip(&fit.pairs)
                    .map(|((first, second), t)| Difference {
                        first,
                        second,
                        n: adjusted.design.participants,
                        t: *t,
                        dz: None,
                    });
                let why = "the likelihood is too flat for degrees of freedom";
                (found.collect(), why.to_owned())
            }
            Err(error) => (Vec::new(), error.to_string()),
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
    values.group("pair", "").put("n_compared", compared as f64);
    for (i, (d, p_holm)) in found.iter().zip(p_holm).enumerate() {
        if best.is_some_and(|best| best != Some(d.first) && best != Some(d.second)) {
            continue;
        }
        let name = |at: usize| cells.model_name(adjusted.models[at]);
        let id = pair_id("pair", name(d.first), name(d.second));
        let mut g = values.group(id, why.clone());
        g.put("n", d.n as f64);
        g.put("difference", d.t.estimate);
        g.put("se", d.t.se);
        g.maybe("t", d.t.t.filter(|_| d.t.p.is_some()));
        g.maybe("df", d.t.df);
        g.maybe("p", d.t.p);
        g.maybe("p_holm", p_holm);
        g.interval("ci95", d.t.ci95);
        g.maybe("dz", d.dz);
        if margin.is_some() {
            g.maybe("p_tost", tost[i].map(|e| e.p));
            g.maybe("p_tost_holm", tost_holm[i]);
            g.interval("ci90", tost[i].map(|e| e.ci90));
        }
    }
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
