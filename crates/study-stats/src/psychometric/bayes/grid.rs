//! Quadrature over threshold, ln width, λ, η and γ.
//!
//! The box of integration starts as the support of the priors, and shrinks around the mode to
//! where the density is above 10⁻⁷ of the highest one. A coarse grid may miss a narrow peak
//! altogether: the mode is searched for first, and a box has it and its neighbors always.

use super::rows::{ETAS, Table, cubic};
use super::{Experiment, Interval, MOST_ETA, MOST_RATE, Posterior, Problem, mode};
use crate::quadrature::gauss_legendre;

/// ln(10⁻⁷).
const NEGLIGIBLE: f64 = -16.118;
/// How often the box shrinks at most; it ends when no axis loses a tenth.
const SHRINKS: usize = 12;
/// A term so far below the highest one does not count in the sums.
const NOTHING: f64 = -40.0;

/// Numbers of nodes: of thresholds and of widths, and of λ and of γ.
#[derive(Debug, Clone, Copy)]
struct Size {
    curve: usize,
    rate: usize,
}

impl Size {
    /// While the box shrinks, and at the end. γ as a parameter multiplies the nodes.
    fn of(experiment: Experiment) -> [Self; 2] {
        let size = |curve, rate| Self { curve, rate };
        match experiment {
            Experiment::ForcedChoice(_) | Experiment::Comparison => [size(19, 4), size(44, 8)],
            Experiment::YesNo => [size(17, 4), size(36, 6)],
        }
    }
}

/// Bounds of the five axes.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    threshold: (f64, f64),
    log_width: (f64, f64),
    lambda: (f64, f64),
    eta: (f64, f64),
    gamma: (f64, f64),
}

impl Bounds {
    /// Whether an axis lost more than a tenth.
    fn is_smaller_than(&self, before: &Self) -> bool {
        let axes = |b: &Self| {
            [b.threshold, b.log_width, b.lambda, b.eta, b.gamma].map(|(low, high)| high - low)
        };
        let pairs = axes(self).into_iter().zip(axes(before));
        pairs.into_iter().any(|(now, before)| now < 0.9 * before)
    }
}

/// An axis: nodes with weights, the highest density and the mass at each.
struct Axis {
    nodes: Vec<(f64, f64)>,
    highest: Vec<f64>,
    mass: Vec<f64>,
}

impl Axis {
    fn new(nodes: Vec<(f64, f64)>) -> Self {
        Self {
            highest: vec![f64::NEG_INFINITY; nodes.len()],
            mass: vec![0.0; nodes.len()],
            nodes,
        }
    }

    /// Equal distances.
    fn even(n: usize, (low, high): (f64, f64)) -> Self {
        let step = (high - low) / (n - 1) as f64;
        Self::new((0..n).map(|i| (low + step * i as f64, step)).collect())
    }

    /// A rate: nodes of Gauss and Legendre in its square root, so that they are dense near 0,
    /// where the density of a rate is high and changes fast.
    fn rate(n: usize, (low, high): (f64, f64)) -> Self {
        let roots = gauss_legendre(n, low.sqrt(), high.sqrt());
        let nodes = roots
            .into_iter()
            .map(|(u, weight)| (u * u, 2.0 * u * weight));
        Self::new(nodes.collect())
    }

    /// The part whose density counts, with the mode `peak`, up to the next nodes.
    fn shrunk(&self, top: f64, peak: f64, (low, high): (f64, f64)) -> (f64, f64) {
        let counts = |h: &f64| *h > top + NEGLIGIBLE;
        let end = self.nodes.len() - 1;
        let below = self.nodes.iter().rposition(|n| n.0 <= peak).unwrap_or(0);
        let above = self.nodes.iter().position(|n| n.0 >= peak).unwrap_or(end);
        let first = self
            .highest
            .iter()
            .position(counts)
            .unwrap_or(end)
            .min(below);
        let last = self
            .highest
            .iter()
            .rposition(counts)
            .unwrap_or(0)
            .max(above);
        (
            if first == 0 {
                low
            } else {
                self.nodes[first - 1].0
            },
            self.nodes.get(last + 1).map_or(high, |n| n.0),
        )
    }

    fn mean(&self, f: impl Fn(f64) -> f64) -> f64 {
        let sum: f64 = self.mass.iter().sum();
        let weighted = self.nodes.iter().zip(&self.mass);
        weighted.map(|(n, m)| f(n.0) * m).sum::<f64>() / sum
    }

    /// A quantile over even nodes. Between them the density is a cubic polynomial through
    /// four nodes, in small linear pieces.
    fn quantile(&self, p: f64) -> f64 {
        const PIECES: usize = 8;
        let at = |i: usize, offset: usize| {
            let place = (i + offset).checked_sub(1);
            place.and_then(|k| self.mass.get(k)).copied().unwrap_or(0.0)
        };
        let last = self.nodes.len() - 1;
        let density: Vec<f64> = (0..=last * PIECES)
            .map(|piece| {
                let (i, t) = (piece / PIECES, (piece % PIECES) as f64 / PIECES as f64);
                let sum: f64 = (0..4).map(|k| cubic(t)[k] * at(i, k)).sum();
                sum.max(0.0)
            })
            .collect();
        let step = (self.nodes[1].0 - self.nodes[0].0) / PIECES as f64;
        let areas = || density.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        let mut left = p * areas().sum::<f64>();
        for (i, area) in areas().enumerate() {
            if left <= area && area > 0.0 {
                let (a, b) = (density[i], density[i + 1]);
                // a t + (b − a) t²/2 = left
                let root = (a * a + 2.0 * (b - a) * left).max(0.0).sqrt();
                let t = (2.0 * left / (a + root)).clamp(0.0, 1.0);
                return self.nodes[0].0 + step * (i as f64 + t);
            }
            left -= area;
        }
        self.nodes[last].0
    }
}

/// The posterior over one box.
struct Grid {
    threshold: Axis,
    log_width: Axis,
    lambda: Axis,
    eta: Axis,
    gamma: Axis,
}

pub(super) fn integrate(problem: &Problem) -> Option<Posterior> {
    let support = &problem.support;
    let range = support.high - support.low;
    let mut bounds = Bounds {
        threshold: (support.low - range / 2.0, support.high + range / 2.0),
        log_width: problem.log_widths(),
        lambda: (0.0, MOST_RATE),
        eta: (0.0, MOST_ETA),
        gamma: (0.0, MOST_RATE),
    };
    let [coarse, fine] = Size::of(problem.experiment);
    let peak = mode(problem)?;
    let log_width = peak.curve.width.ln();
    // Of the rates too little is known while the nodes of the curve are far from the mode.
    let mut with_rates = false;
    for _ in 0..SHRINKS {
        let grid = evaluate(problem, &bounds, coarse)?;
        let found = grid.threshold.highest.iter().copied();
        // The density of ln W is W times that of W.
        let top = found.fold(peak.log_kernel + log_width, f64::max);
        let before = bounds;
        let rate = |axis: &Axis, peak: f64, before: (f64, f64)| match with_rates {
            true => axis.shrunk(top, peak, before),
            false => before,
        };
        bounds = Bounds {
            threshold: (grid.threshold).shrunk(top, peak.curve.threshold, before.threshold),
            log_width: grid.log_width.shrunk(top, log_width, before.log_width),
            lambda: rate(&grid.lambda, peak.curve.lambda, before.lambda),
            eta: rate(&grid.eta, peak.eta, before.eta),
            gamma: rate(&grid.gamma, peak.curve.gamma, before.gamma),
        };
        if !bounds.is_smaller_than(&before) {
            if with_rates {
                break;
            }
            with_rates = true;
        }
    }
    let grid = evaluate(problem, &bounds, fine)?;
    let interval = |axis: &Axis, back: fn(f64) -> f64| Interval {
        mean: axis.mean(back),
        ci95: (back(axis.quantile(0.025)), back(axis.quantile(0.975))),
        median: back(axis.quantile(0.5)),
    };
    Some(Posterior {
        threshold: interval(&grid.threshold, |t| t),
        width: interval(&grid.log_width, f64::exp),
        lambda: grid.lambda.mean(|x| x),
        gamma: match problem.experiment {
            Experiment::ForcedChoice(_) => None,
            Experiment::Comparison => Some(grid.lambda.mean(|x| x)),
            Experiment::YesNo => Some(grid.gamma.mean(|x| x)),
        },
        eta: grid.eta.mean(|x| x),
        exponential: grid.threshold.mean(f64::exp),
    })
}

fn evaluate(problem: &Problem, bounds: &Bounds, size: Size) -> Option<Grid> {
    let n = size.curve;
    let mut threshold = Axis::even(n, bounds.threshold);
    let mut log_width = Axis::even(n, bounds.log_width);
    let mut lambda = Axis::rate(size.rate, bounds.lambda);
    let mut eta = Axis::rate(ETAS, bounds.eta);
    let mut gamma = match problem.experiment {
        Experiment::YesNo => Axis::rate(size.rate, bounds.gamma),
        // One value: given, or that of λ.
        Experiment::ForcedChoice(_) | Experiment::Comparison => Axis::new(vec![(0.0, 1.0)]),
    };
    let etas: [f64; ETAS] = std::array::from_fn(|i| eta.nodes[i].0);
    let table = Table::new(&problem.levels, &etas);
    // The sums are relative to the highest term so far.
    let mut scale = f64::NEG_INFINITY;
    let mut shares = vec![0.0; problem.levels.len()];
    for t in 0..n {
        let (at, _) = threshold.nodes[t];
        let prior_t = problem.support.threshold(at);
        for w in 0..n {
            let (log_w, _) = log_width.nodes[w];
            let width = log_w.exp();
            // The density of ln W is W times that of W.
            let prior = prior_t + problem.width(at, width) + log_w;
            if prior == f64::NEG_INFINITY {
                continue;
            }
            for (share, l) in shares.iter_mut().zip(&problem.levels) {
                *share = problem.core.value((l.level - at) / width);
            }
            for l in 0..lambda.nodes.len() {
                let (lapse, weight_l) = lambda.nodes[l];
                for g in 0..gamma.nodes.len() {
                    let (free, weight_g) = gamma.nodes[g];
                    let guess = problem.experiment.guess(lapse).unwrap_or(free);
                    let inner = 1.0 - guess - lapse;
                    if inner <= 0.0 {
                        continue;
                    }
                    let mut logs = [0.0; ETAS];
                    for (row, share) in shares.iter().enumerate() {
                        table.add(row, guess + inner * share, &mut logs);
                    }
                    for (e, log) in logs.iter().enumerate() {
                        let (eta_at, weight_e) = eta.nodes[e];
                        let log = log + prior + problem.rates(lapse, guess, eta_at);
                        if log < scale + NOTHING {
                            continue;
                        }
                        for axis in [
                            (&mut threshold, t),
                            (&mut log_width, w),
                            (&mut lambda, l),
                            (&mut eta, e),
                            (&mut gamma, g),
                        ] {
                            let highest = &mut axis.0.highest[axis.1];
                            *highest = highest.max(log);
                        }
                        if log > scale {
                            let shrink = (scale - log).exp();
                            for axis in [
                                &mut threshold,
                                &mut log_width,
                                &mut lambda,
                                &mut eta,
                                &mut gamma,
                            ] {
                                axis.mass.iter_mut().for_each(|m| *m *= shrink);
                            }
                            scale = log;
                        }
                        let mass = (log - scale).exp() * weight_l * weight_g * weight_e;
                        threshold.mass[t] += mass;
                        log_width.mass[w] += mass;
                        lambda.mass[l] += mass;
                        eta.mass[e] += mass;
                        gamma.mass[g] += mass;
                    }
                }
            }
        }
    }
    let grid = Grid {
        threshold,
        log_width,
        lambda,
        eta,
        gamma,
    };
    scale.is_finite().then_some(grid)
}
