//! The likelihood of each cell over θ, ω and λ, as a sum of normal densities.

use super::{Condition, Coordinate, Data, Experiment, PopulationPriors};
use std::f64::consts::PI;

/// Standard deviation of the normal densities in distances of the nodes. A sum of them passes
/// through the values at all nodes; between the nodes it is within 4·10⁻⁴ of a normal likelihood
/// that is as narrow as the narrowest one of the data, whose standard deviation is 1.4 distances.
const SPREAD: f64 = 0.8;
/// A density counts up to so many nodes away: exp(−6²/(2·0.8²)) < 10⁻¹².
pub(super) const REACH: usize = 6;
/// Logarithm of what does not count, below the highest likelihood of a cell.
const NEGLIGIBLE: f64 = -18.0;
/// Largest number of nodes of θ, and of ω.
const MOST: (usize, usize) = (200, 40);
/// Largest λ that is looked at.
const MOST_LAPSE: f64 = 0.3;

/// Evenly spaced nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) step: f64,
    pub(super) n: usize,
}

impl Axis {
    /// `n` nodes, the ends included.
    fn between(low: f64, high: f64, n: usize) -> Self {
        let step = (high - low) / (n - 1) as f64;
        Self { low, step, n }
    }

    /// Nodes at most `step` apart, from `least` to `most` of them.
    fn spaced((low, high): (f64, f64), step: f64, (least, most): (usize, usize)) -> Self {
        let n = ((high - low) / step).ceil() as usize + 1;
        Self::between(low, high, n.clamp(least, most))
    }

    pub(super) fn at(&self, i: usize) -> f64 {
        self.low + self.step * i as f64
    }

    /// Variance of the normal densities at its nodes.
    pub(super) fn variance(&self) -> f64 {
        (SPREAD * self.step).powi(2)
    }
}

/// λ is tabulated over its cube root, over which a likelihood is nearly normal.
pub(super) fn lapse_of(root: f64) -> f64 {
    root * root * root
}

/// The likelihood of a cell.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CellTable {
    pub(super) participant: usize,
    pub(super) condition: usize,
    /// The first node of θ at which it is not negligible.
    pub(super) first: usize,
    /// Coefficients of the densities, by θ, then by λ, then by ω.
    pub(super) coefficients: Vec<f64>,
    /// Logarithm of the unit of the likelihood.
    pub(super) log_scale: f64,
}

/// The likelihoods of all cells.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tables {
    pub(super) theta: Axis,
    pub(super) omega: Axis,
    /// Cube roots of λ.
    pub(super) lapse: Axis,
    pub(super) cells: Vec<CellTable>,
    /// The least standard deviation of a likelihood over θ.
    pub(super) narrowest: f64,
}

impl Tables {
    pub(super) fn new(data: &Data, priors: &PopulationPriors, fineness: f64) -> Self {
        let (theta, omega, lapse, narrowest) = axes(data, priors, fineness);
        let logs = log_likelihoods(data, &theta, &omega, &lapse);
        let cells = data.cells.iter().zip(logs);
        let (by_theta, by_omega) = (Basis::new(theta.n), Basis::new(omega.n));
        let cells = cells.map(|(cell, logs)| {
            let log_scale = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let row = lapse.n * omega.n;
            // `logs` is by λ, θ and ω.
            let value = |k: usize, l: usize, m: usize| logs[(l * theta.n + k) * omega.n + m];
            let counts = |k: &usize| {
                let mut all = (0..lapse.n).flat_map(|l| (0..omega.n).map(move |m| (l, m)));
                all.any(|(l, m)| value(*k, l, m) > log_scale + NEGLIGIBLE)
            };
            let first = (0..theta.n).find(counts).unwrap_or(0).saturating_sub(2);
            let last = (0..theta.n).rev().find(counts).unwrap_or(theta.n - 1);
            let rows = (last + 3).min(theta.n) - first;
            let mut coefficients = vec![0.0; rows * row];
            for l in 0..lapse.n {
                for k in 0..rows {
                    let line = &mut coefficients[k * row + l * omega.n..][..omega.n];
                    for (m, x) in line.iter_mut().enumerate() {
                        *x = (value(first + k, l, m) - log_scale).exp();
                    }
                    by_omega.solve(line, 1, omega.n);
                }
            }
            for column in 0..row {
                by_theta.solve(&mut coefficients[column..], row, rows);
            }
            // Densities, not the powers of e that the basis has.
            let unit = 2.0 * PI * (theta.variance() * omega.variance()).sqrt();
            coefficients.iter_mut().for_each(|c| *c *= unit);
            CellTable {
                participant: cell.participant,
                condition: cell.condition,
                first,
                coefficients,
                log_scale,
            }
        });
        Self {
            cells: cells.collect(),
            theta,
            omega,
            lapse,
            narrowest,
        }
    }
}

/// Where the likelihoods are, and how narrow, by a coarse look at them: the axes of θ, ω and the
/// cube root of λ, and the least standard deviation over θ.
fn axes(data: &Data, priors: &PopulationPriors, fineness: f64) -> (Axis, Axis, Axis, f64) {
    let ends = data.conditions.iter().map(|c| c.ends(data.unit));
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |all, (low, high)| {
        let beyond = (high - low) / 2.0 + 2.0 * priors.between;
        (all.0.min(low - beyond), all.1.max(high + beyond))
    });
    let (mean, sd) = priors.width;
    let spread = sd.hypot(priors.width_between);
    let widths = (mean - 4.0 * spread, mean + 3.5 * spread);
    let theta = Axis::between(low, high, 120);
    let omega = Axis::between(widths.0, widths.1, 12);
    let lapse = Axis::between(0.0, MOST_LAPSE.cbrt(), 14);
    let logs = log_likelihoods(data, &theta, &omega, &lapse);
    let prior_of_width = |m: usize| -0.5 * ((omega.at(m) - mean) / spread).powi(2);
    // The lapse rate, as if the functions of the cells had nothing in common.
    let of_lapse: Vec<f64> = (0..lapse.n)
        .map(|l| {
            let root = lapse.at(l);
            let prior =
                (priors.lapse - 1.0) * (1.0 - lapse_of(root)).ln() + 2.0 * (root + 1e-3).ln();
            let of_cell = |logs: &Vec<f64>| {
                let one = &logs[l * theta.n * omega.n..][..theta.n * omega.n];
                let terms = one.iter().enumerate();
                log_sum(terms.map(|(i, x)| x + prior_of_width(i % omega.n)))
            };
            prior + logs.iter().map(of_cell).sum::<f64>()
        })
        .collect();
    let most = (0..lapse.n).max_by(|a, b| of_lapse[*a].total_cmp(&of_lapse[*b]));
    let most = most.unwrap_or(0);
    let counts = |l: &usize| of_lapse[*l] > of_lapse[most] - 14.0;
    let first = (0..lapse.n).find(counts).unwrap_or(0).saturating_sub(1);
    let last = (0..lapse.n).rev().find(counts).unwrap_or(lapse.n - 1) + 1;
    let lapses = (lapse.at(first), lapse.at(last.min(lapse.n - 1)));
    let trials = |cell: &super::Cell| cell.levels.iter().map(|l| l.trials).sum::<f64>();
    let trials = data.cells.iter().map(trials).fold(1.0, f64::max);
    // Where the thresholds of the cells are, and how well θ and ω are known, each for the best
    // value of the other.
    let mut within = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut narrow_theta, mut narrow_omega) = (f64::INFINITY, f64::INFINITY);
    for logs in &logs {
        let one = &logs[most * theta.n * omega.n..][..theta.n * omega.n];
        let value = |k: usize, m: usize| one[k * omega.n + m] + prior_of_width(m);
        let best = (0..one.len()).max_by(|a, b| {
            let at = |i: usize| value(i / omega.n, i % omega.n);
            at(*a).total_cmp(&at(*b))
        });
        let best = best.unwrap_or(0);
        let (k, m) = (best / omega.n, best % omega.n);
        let of_theta = (0..theta.n).map(|k| (theta.at(k), value(k, m)));
        let of_omega = (0..omega.n).map(|m| (omega.at(m), value(k, m)));
        let (center, sd) = moments(of_theta);
        // Steeper functions have narrower likelihoods of θ.
        narrow_theta = narrow_theta.min(sd.max(0.3 * theta.step));
        narrow_omega = narrow_omega.min(moments(of_omega).1.max(0.3 * omega.step));
        within = (
            within.0.min(center - 5.0 * sd - theta.step),
            within.1.max(center + 5.0 * sd + theta.step),
        );
    }
    let margin = 1.5 * priors.between;
    let within = ((within.0 - margin).max(low), (within.1 + margin).min(high));
    let step = (0.7 * narrow_theta).min(0.2 * priors.between) / fineness;
    let (most_theta, most_omega) = MOST;
    let finer = |n: usize| (n as f64 * fineness) as usize;
    let theta = Axis::spaced(within, step, (24, finer(most_theta)));
    let step = (0.75 * narrow_omega).min(0.75 * priors.width_between) / fineness;
    let omega = Axis::spaced(widths, step, (12, finer(most_omega)));
    let step = (0.25 / trials.sqrt()).max(0.005) / fineness;
    let lapse = Axis::spaced(lapses, step, (6, finer(40)));
    (theta, omega, lapse, narrow_theta)
}

fn log_sum(terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let highest = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    highest + terms.map(|x| (x - highest).exp()).sum::<f64>().ln()
}

/// Mean and standard deviation of a density that is known by its logarithm at even nodes.
fn moments(density: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let highest = density
        .clone()
        .map(|d| d.1)
        .fold(f64::NEG_INFINITY, f64::max);
    let (mut sum, mut first, mut second) = (0.0, 0.0, 0.0);
    for (x, log) in density {
        let mass = (log - highest).exp();
        sum += mass;
        first += mass * x;
        second += mass * x * x;
    }
    let mean = first / sum;
    (mean, (second / sum - mean * mean).max(0.0).sqrt())
}

/// Logarithms of the likelihood of each cell, by λ, then by θ, then by ω.
fn log_likelihoods(data: &Data, theta: &Axis, omega: &Axis, lapse: &Axis) -> Vec<Vec<f64>> {
    let plane = theta.n * omega.n;
    let mut all = vec![vec![0.0; lapse.n * plane]; data.cells.len()];
    for (c, condition) in data.conditions.iter().enumerate() {
        let of_condition = || data.cells.iter().enumerate().filter(|x| x.1.condition == c);
        let mut levels: Vec<f64> = of_condition()
            .flat_map(|(_, cell)| cell.levels.iter().map(|l| l.level))
            .collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        for level in levels {
            let shares = shares(
                condition,
                condition.coordinate(data.unit),
                level,
                (theta, omega),
            );
            let counts: Vec<(usize, f64, f64)> = of_condition()
                .filter_map(|(i, cell)| {
                    let l = cell.levels.iter().find(|l| l.level == level)?;
                    Some((i, l.positive, l.trials - l.positive))
                })
                .collect();
            for l in 0..lapse.n {
                let lambda = lapse_of(lapse.at(l));
                let guess = match condition.experiment {
                    Experiment::ForcedChoice(guess) => guess,
                    Experiment::Comparison | Experiment::YesNo => lambda,
                };
                let inner = 1.0 - guess - lambda;
                for (place, share) in shares.iter().enumerate() {
                    let p = (guess + inner * share).clamp(1e-300, 1.0);
                    let q = (lambda + inner * (1.0 - share)).clamp(1e-300, 1.0);
                    let (log_p, log_q) = (p.ln(), q.ln());
                    for (cell, positive, negative) in &counts {
                        all[*cell][l * plane + place] += positive * log_p + negative * log_q;
                    }
                }
            }
        }
    }
    all
}

/// S at a level, by θ, then by ω.
fn shares(
    condition: &Condition,
    coordinate: Coordinate,
    level: f64,
    (theta, omega): (&Axis, &Axis),
) -> Vec<f64> {
    let places = (0..theta.n).flat_map(|k| (0..omega.n).map(move |m| (k, m)));
    let share = |(k, m)| {
        let u = coordinate.argument(level, theta.at(k), omega.at(m));
        condition.core.value(u)
    };
    places.map(share).collect()
}

/// Normal densities at even nodes, as a basis: the Cholesky factor of their values at the nodes,
/// which is a band.
struct Basis {
    rows: Vec<[f64; REACH + 1]>,
}

impl Basis {
    fn new(n: usize) -> Self {
        let element = |distance: usize| {
            let d = distance as f64 / SPREAD;
            (-0.5 * d * d).exp()
        };
        let mut rows: Vec<[f64; REACH + 1]> = Vec::with_capacity(n);
        // Row i has the elements (i, i − REACH) … (i, i).
        for i in 0..n {
            let mut row = [0.0; REACH + 1];
            for j in i.saturating_sub(REACH)..=i {
                let mut rest = element(i - j);
                for k in i.saturating_sub(REACH)..j {
                    let other = if j == i {
                        row[k + REACH - i]
                    } else if k + REACH >= j {
                        rows[j][k + REACH - j]
                    } else {
                        0.0
                    };
                    rest -= row[k + REACH - i] * other;
                }
                row[j + REACH - i] = if j == i {
                    rest.max(1e-12).sqrt()
                } else {
                    rest / rows[j][REACH]
                };
            }
            rows.push(row);
        }
        Self { rows }
    }

    /// Replaces the `n` values that are `stride` apart by the coefficients of the densities.
    fn solve(&self, values: &mut [f64], stride: usize, n: usize) {
        for i in 0..n {
            let mut rest = values[i * stride];
            for j in i.saturating_sub(REACH)..i {
                rest -= self.rows[i][j + REACH - i] * values[j * stride];
            }
            values[i * stride] = rest / self.rows[i][REACH];
        }
        for i in (0..n).rev() {
            let mut rest = values[i * stride];
            for j in i + 1..(i + REACH + 1).min(n) {
                rest -= self.rows[j][i + REACH - j] * values[j * stride];
            }
            values[i * stride] = rest / self.rows[i][REACH];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sum of normal densities passes through the values, and between them through the function.
    #[test]
    fn a_smooth_function_is_a_sum_of_normal_densities() {
        let axis = Axis::between(-6.0, 6.0, 41);
        let sd = axis.step / 0.7;
        let f = |x: f64| (-0.5 * (x / sd).powi(2)).exp();
        let mut values: Vec<f64> = (0..axis.n).map(|i| f(axis.at(i))).collect();
        Basis::new(axis.n).solve(&mut values, 1, axis.n);
        let sum = |x: f64| -> f64 {
            let one = |i: usize| {
                let d = (x - axis.at(i)).powi(2) / axis.variance();
                values[i] * (-0.5 * d).exp()
            };
            (0..axis.n).map(one).sum()
        };
        for i in 0..400 {
            let x = -3.0 + f64::from(i) * 0.015;
            assert!((sum(x) - f(x)).abs() < 5e-4, "{x}: {} {}", sum(x), f(x));
        }
        // Its integral over a normal distribution is a closed formula; 2·exp(−2π²·0.8²) = 7·10⁻⁶
        // is what densities of this width leave of any function.
        let wide: f64 = 0.7;
        let total = axis.variance() + wide * wide;
        let smooth: f64 = (0..axis.n)
            .map(|i| {
                let d = (0.4 - axis.at(i)).powi(2) / total;
                values[i] * (axis.variance() / total).sqrt() * (-0.5 * d).exp()
            })
            .sum();
        let both = sd * sd + wide * wide;
        let exact = sd / both.sqrt() * (-0.5 * 0.16 / both).exp();
        assert!((smooth - exact).abs() < 1e-5, "{smooth} {exact}");
    }
}
