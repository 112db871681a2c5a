//! What weighted draws of a population say.

use super::importance::{Draw, diagnostics};
use super::marginal::Model;
use super::table::Axis;
use super::{Contrast, Data, Estimate, Parameters, Population};

/// Draws from which the thresholds of participants are computed: each has a whole distribution.
const FOR_CELLS: usize = 512;

pub(super) fn population(model: &Model<'_>, draws: &[Draw], data: &Data) -> Population {
    // Draws without weight may lie outside of the range of the parameters.
    let kept: Vec<(&Draw, Parameters)> = (draws.iter())
        .filter(|d| d.weight > 0.0)
        .filter_map(|d| Some((d, model.parameters(&d.at)?)))
        .collect();
    let mut errors = Vec::new();
    let mut of = |quantity: &dyn Fn(&Parameters) -> f64| {
        let values = kept.iter().map(|(d, p)| (quantity(p), d.weight, d.set));
        let values: Vec<(f64, f64, usize)> = values.collect();
        let found = estimate(&values);
        errors.push((between_sets(&values), found.sd));
        found
    };
    let n = model.conditions();
    let conditions = (0..n).map(|c| of(&|p| p.means[c])).collect();
    let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
    let contrasts = pairs
        .map(|(first, second)| {
            let difference = |p: &Parameters| p.means[first] - p.means[second];
            let above = kept.iter().filter(|(_, p)| difference(p) > 0.0);
            Contrast {
                first,
                second,
                above: above.map(|(d, _)| d.weight).sum::<f64>().clamp(0.0, 1.0),
                difference: of(&difference),
            }
        })
        .collect();
    let between = of(&|p| p.between);
    let interaction = (n > 1).then(|| of(&|p| p.interaction));
    let width = of(&|p| p.width);
    let width_between = of(&|p| p.width_between);
    let lapse = of(&|p| p.lapse);
    let (cells, at_edge) = thresholds(model, &kept);
    Population {
        conditions,
        contrasts,
        between,
        interaction,
        width,
        width_between,
        lapse,
        cells,
        draws: kept.into_iter().map(|(d, p)| (p, d.weight)).collect(),
        diagnostics: diagnostics(draws, &errors, at_edge),
        unit: data.unit,
    }
}

/// Mean, standard deviation and quantiles of weighted values.
fn estimate(values: &[(f64, f64, usize)]) -> Estimate {
    let mean = values.iter().map(|(x, w, _)| w * x).sum::<f64>();
    let variance = values.iter().map(|(x, w, _)| w * (x - mean).powi(2));
    let mut sorted: Vec<(f64, f64)> = values.iter().map(|(x, w, _)| (*x, *w)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Half of the weight of a value lies below it.
    let quantile = |p: f64| {
        let (mut below, mut last) = (0.0, None);
        for (x, w) in &sorted {
            let here = below + 0.5 * w;
            if here >= p {
                return match last {
                    Some((x0, p0)) if here > p0 => x0 + (x - x0) * (p - p0) / (here - p0),
                    _ => *x,
                };
            }
            last = Some((*x, here));
            below += w;
        }
        last.map_or(mean, |l| l.0)
    };
    Estimate {
        mean,
        sd: variance.sum::<f64>().sqrt(),
        median: quantile(0.5),
        ci95: (quantile(0.025), quantile(0.975)),
    }
}

/// The standard deviation of the mean between sets of draws.
fn between_sets(values: &[(f64, f64, usize)]) -> f64 {
    let sets = values.iter().map(|v| v.2 + 1).max().unwrap_or(0);
    let mut sums = vec![(0.0, 0.0); sets];
    for (x, w, set) in values {
        sums[*set].0 += w * x;
        sums[*set].1 += w;
    }
    let means: Vec<f64> = sums.iter().map(|(x, w)| x / w).collect();
    crate::describe::sd(&means).unwrap_or(f64::INFINITY)
}

/// θ of each cell, and the largest probability that one of them has at the ends of its axis.
fn thresholds(model: &Model<'_>, kept: &[(&Draw, Parameters)]) -> (Vec<Estimate>, f64) {
    let axis = model.fine();
    let mut masses = vec![vec![0.0; axis.n]; model.tables.cells.len()];
    // Every draw as often as its weight says, on average; sorted by their means, so that all parts
    // of the posterior have their share.
    let mut sorted: Vec<&(&Draw, Parameters)> = kept.iter().collect();
    let mean = |p: &Parameters| p.means.iter().sum::<f64>();
    sorted.sort_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)));
    let (mut sum, mut next) = (0.0, 0.5 / FOR_CELLS as f64);
    for (draw, parameters) in sorted {
        sum += draw.weight;
        while next < sum {
            model.add_thresholds(parameters, &mut masses);
            next += 1.0 / FOR_CELLS as f64;
        }
    }
    let ends = 4;
    let at_ends = |mass: &Vec<f64>| {
        let total: f64 = mass.iter().sum();
        let outer = mass.iter().take(ends).chain(mass.iter().rev().take(ends));
        outer.sum::<f64>() / total.max(1e-300)
    };
    let at_edge = masses.iter().map(at_ends).fold(0.0, f64::max);
    (masses.iter().map(|m| over(&axis, m)).collect(), at_edge)
}

/// The distribution of masses over even nodes; between them it is even.
fn over(axis: &Axis, masses: &[f64]) -> Estimate {
    let total: f64 = masses.iter().sum();
    let sum = |f: &dyn Fn(f64) -> f64| {
        let terms = masses.iter().enumerate().map(|(i, m)| m * f(axis.at(i)));
        terms.sum::<f64>() / total
    };
    let mean = sum(&|x| x);
    let variance = sum(&|x| (x - mean).powi(2));
    let quantile = |p: f64| {
        let mut below = 0.0;
        for (i, mass) in masses.iter().enumerate() {
            if below + mass >= p * total && *mass > 0.0 {
                return axis.at(i) + axis.step * ((p * total - below) / mass - 0.5);
            }
            below += mass;
        }
        mean
    };
    Estimate {
        mean,
        sd: variance.max(0.0).sqrt(),
        median: quantile(0.5),
        ci95: (quantile(0.025), quantile(0.975)),
    }
}
