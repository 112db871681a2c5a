//! The posterior density of a population's parameters, with the functions of the participants
//! integrated out.

use super::table::{Axis, CellTable, REACH, Tables, lapse_of};
use super::{Data, Parameters, PopulationPriors};
use std::f64::consts::PI;

/// Nodes of the cubic polynomial between the nodes of λ.
const CUBIC: usize = 4;
/// Distance of the nodes of b in standard deviations of its narrowest density: the trapezoid rule
/// errs by 2·exp(−2π²/1.15²) < 10⁻⁶.
const NODE: f64 = 1.15;
/// Half the range of b in standard deviations.
const FAR: f64 = 4.5;

/// Density and coordinates of the parameters. A standard deviation s has the coordinate s^⅔, and
/// λ has λ^⅓, over which posteriors are nearly normal, both where the data say much and
/// where they leave the value 0 open (Wilson & Hilferty 1931 of χ²). The order is μ, τ, σ (with
/// several conditions), ν, κ, λ.
pub(super) struct Model<'a> {
    pub(super) tables: Tables,
    priors: &'a PopulationPriors,
    /// The ends of the ladder of each condition.
    ladders: Vec<(f64, f64)>,
    /// The cells of each participant.
    participants: Vec<Vec<usize>>,
}

/// The densities of b and what they are made from, of one population.
struct Nodes {
    /// Places of b with the weights of their normal distribution.
    nodes: Vec<(f64, f64)>,
    /// Standard deviation of θ given b.
    sd: f64,
}

impl<'a> Model<'a> {
    pub(super) fn new(data: &Data, priors: &'a PopulationPriors, tables: Tables) -> Self {
        let cells = |i| {
            let own = data.cells.iter().enumerate();
            own.filter(|c| c.1.participant == i).map(|c| c.0).collect()
        };
        Self {
            ladders: data.conditions.iter().map(|c| c.ends(data.unit)).collect(),
            participants: (0..data.participants).map(cells).collect(),
            tables,
            priors,
        }
    }

    /// Number of conditions.
    pub(super) fn conditions(&self) -> usize {
        self.ladders.len()
    }

    /// The parameters at these coordinates; `None` outside of their ranges.
    pub(super) fn parameters(&self, at: &[f64]) -> Option<Parameters> {
        let (means, rest) = at.split_at(self.conditions());
        let deviation = |x: f64| (x > 0.0).then(|| x * x.sqrt());
        let several = usize::from(self.conditions() > 1);
        let root = rest[rest.len() - 1];
        let lapse = (root > 0.0 && root < 0.9).then(|| lapse_of(root))?;
        Some(Parameters {
            means: means.to_vec(),
            between: deviation(rest[0])?,
            interaction: if several == 1 {
                deviation(rest[1])?
            } else {
                0.0
            },
            width: rest[1 + several],
            width_between: deviation(rest[2 + several])?,
            lapse,
        })
    }

    /// Coordinates to begin a search at, and how far they may vary.
    pub(super) fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let mut at: Vec<f64> = (0..self.conditions()).map(|c| self.center(c)).collect();
        let mut scale = vec![0.5 * self.priors.between; at.len()];
        let mut add = |x: f64, by: f64| {
            at.push(x);
            scale.push(by);
        };
        add((0.6 * self.priors.between).cbrt().powi(2), 0.1);
        if self.ladders.len() > 1 {
            add((0.5 * self.priors.interaction).cbrt().powi(2), 0.1);
        }
        add(self.priors.width.0, 0.3);
        add((0.7 * self.priors.width_between).cbrt().powi(2), 0.1);
        let axis = &self.tables.lapse;
        add(axis.at(axis.n / 2).max(0.1), 0.05);
        (at, scale)
    }

    /// The median of the most likely thresholds of a condition.
    fn center(&self, condition: usize) -> f64 {
        let row = self.tables.lapse.n * self.tables.omega.n;
        let best = |cell: &CellTable| {
            let sums = cell.coefficients.chunks(row).map(|k| k.iter().sum::<f64>());
            let best = sums.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            self.tables.theta.at(cell.first + best.map_or(0, |b| b.0))
        };
        let own = self
            .tables
            .cells
            .iter()
            .filter(|c| c.condition == condition);
        let mut places: Vec<f64> = own.map(best).collect();
        places.sort_by(f64::total_cmp);
        let (low, high) = self.ladders[condition];
        places[places.len() / 2].clamp(low, high)
    }

    /// Logarithm of the prior density of the coordinates, up to a constant.
    fn prior(&self, at: &[f64], of: &Parameters) -> f64 {
        let half_normal = |sd: f64, scale: f64| -0.5 * (sd / scale).powi(2) + sd.ln() / 3.0;
        let means = of.means.iter().zip(&self.ladders);
        let even = |(mean, (low, high)): (&f64, &(f64, f64))| {
            let (range, far) = (high - low, (low - mean).max(mean - high).max(0.0));
            if far >= range / 2.0 {
                return f64::NEG_INFINITY;
            }
            ((1.0 + (2.0 * PI * far / range).cos()) / 2.0).ln()
        };
        let (center, sd) = self.priors.width;
        let interaction = match self.conditions() {
            1 => 0.0,
            _ => half_normal(of.interaction, self.priors.interaction),
        };
        means.map(even).sum::<f64>()
            + half_normal(of.between, self.priors.between)
            + interaction
            + half_normal(of.width_between, self.priors.width_between)
            - 0.5 * ((of.width - center) / sd).powi(2)
            + (self.priors.lapse - 1.0) * (1.0 - of.lapse).ln()
            + 2.0 * at[at.len() - 1].ln()
    }

    /// Logarithm of the posterior density of the coordinates, up to a constant.
    pub(super) fn log_density(&self, at: &[f64]) -> f64 {
        let Some(of) = self.parameters(at) else {
            return f64::NEG_INFINITY;
        };
        let prior = self.prior(at, &of);
        if !prior.is_finite() {
            return f64::NEG_INFINITY;
        }
        let nodes = self.nodes(&of);
        let profiles = self.profiles(&of);
        let values = self.values(&of, &nodes, &profiles);
        let mut sum = prior;
        for own in &self.participants {
            let one: f64 = (nodes.nodes.iter().enumerate())
                .map(|(j, (_, weight))| weight * own.iter().map(|c| values[*c][j]).product::<f64>())
                .sum();
            // Far from the data the sum of densities with coefficients of both signs is not above 0.
            sum += if one > 0.0 {
                one.ln()
            } else {
                f64::NEG_INFINITY
            };
        }
        sum
    }

    /// The places of b: one condition needs none, since b and e are then one.
    fn nodes(&self, of: &Parameters) -> Nodes {
        if self.conditions() == 1 {
            return Nodes {
                nodes: vec![(0.0, 1.0)],
                sd: of.between,
            };
        }
        let own = self.tables.narrowest.powi(2) + of.interaction.powi(2);
        let information = 1.0 / of.between.powi(2) + self.conditions() as f64 / own;
        let step = NODE / information.sqrt();
        let half = ((FAR * of.between / step).ceil() as usize).clamp(4, 60);
        let step = FAR * of.between / half as f64;
        let node = |j: usize| {
            let b = step * (j as f64 - half as f64);
            (b, step * normal(b, of.between.powi(2)))
        };
        Nodes {
            nodes: (0..=2 * half).map(node).collect(),
            sd: of.interaction,
        }
    }

    /// The likelihood of each cell over θ, with ω and λ of this population: the coefficients of
    /// its densities.
    fn profiles(&self, of: &Parameters) -> Vec<Vec<f64>> {
        let Tables { omega, lapse, .. } = &self.tables;
        let variance = omega.variance() + of.width_between.powi(2);
        let of_width: Vec<f64> = (0..omega.n)
            .map(|m| normal(of.width - omega.at(m), variance))
            .collect();
        // Between the nodes of λ: the cubic polynomial through the next four.
        let place = ((of.lapse.cbrt() - lapse.low) / lapse.step).clamp(0.0, (lapse.n - 1) as f64);
        let first = (place as usize).saturating_sub(1).min(lapse.n - CUBIC);
        let t = place - first as f64;
        let of_lapse: [f64; CUBIC] = std::array::from_fn(|i| {
            let others = (0..CUBIC).filter(|j| *j != i);
            others
                .map(|j| (t - j as f64) / (i as f64 - j as f64))
                .product()
        });
        let weights: Vec<f64> = (of_lapse.iter())
            .flat_map(|l| of_width.iter().map(move |w| l * w))
            .collect();
        let row = lapse.n * omega.n;
        let start = first * omega.n;
        let profile = |cell: &CellTable| {
            let rows = cell.coefficients.chunks_exact(row);
            rows.map(|k| sum_of_products(&k[start..start + weights.len()], &weights))
                .collect()
        };
        self.tables.cells.iter().map(profile).collect()
    }

    /// The likelihood of each cell at each node of b.
    fn values(&self, of: &Parameters, nodes: &Nodes, profiles: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let theta = &self.tables.theta;
        let variance = theta.variance() + nodes.sd.powi(2);
        let n = nodes.nodes.len();
        let kernels = kernels(of, theta, nodes, variance);
        let of_cell = |(cell, profile): (&CellTable, &Vec<f64>)| {
            let mut values = vec![0.0; n];
            let kernel = &kernels[cell.condition][cell.first * n..];
            for (c, row) in profile.iter().zip(kernel.chunks_exact(n)) {
                for (value, x) in values.iter_mut().zip(row) {
                    *value += c * x;
                }
            }
            values
        };
        self.tables
            .cells
            .iter()
            .zip(profiles)
            .map(of_cell)
            .collect()
    }

    /// Twice as many nodes of θ as the tables have, over which thresholds of participants are
    /// distributed.
    pub(super) fn fine(&self) -> Axis {
        let theta = &self.tables.theta;
        Axis {
            low: theta.low,
            step: theta.step / 2.0,
            n: 2 * theta.n - 1,
        }
    }

    /// Adds to the `masses` of each cell over [`Self::fine`] the posterior of its θ in this
    /// population, each with the sum 1.
    pub(super) fn add_thresholds(&self, of: &Parameters, masses: &mut [Vec<f64>]) {
        let (nodes, profiles) = (self.nodes(of), self.profiles(of));
        let values = self.values(of, &nodes, &profiles);
        let (fine, theta) = (self.fine(), &self.tables.theta);
        // A distribution between two nodes would be missed.
        let variance = nodes.sd.powi(2).max((0.4 * fine.step).powi(2));
        let n = nodes.nodes.len();
        let kernels = kernels(of, &fine, &nodes, variance);
        // The densities of the tables at even and odd nodes.
        let density = |halves: usize| {
            let x = halves as f64 / 2.0 * theta.step;
            normal(x, theta.variance())
        };
        let densities: Vec<f64> = (0..=2 * REACH).map(density).collect();
        for own in &self.participants {
            for c in own {
                let cell = &self.tables.cells[*c];
                let others: Vec<f64> = (nodes.nodes.iter().enumerate())
                    .map(|(j, (_, weight))| {
                        let others = own.iter().filter(|o| *o != c);
                        weight * others.map(|o| values[*o][j]).product::<f64>()
                    })
                    .collect();
                let first = 2 * cell.first;
                let count = 2 * profiles[*c].len() - 1;
                let mut own: Vec<f64> = (0..count)
                    .map(|f| {
                        let low = (f.saturating_sub(2 * REACH)).div_ceil(2);
                        let high = ((f + 2 * REACH) / 2).min(profiles[*c].len() - 1);
                        let likelihood: f64 = (low..=high)
                            .map(|k| profiles[*c][k] * densities[f.abs_diff(2 * k)])
                            .sum();
                        let row = &kernels[cell.condition][(first + f) * n..][..n];
                        likelihood.max(0.0) * sum_of_products(row, &others)
                    })
                    .collect();
                let sum: f64 = own.iter().sum();
                if sum > 0.0 {
                    own.iter_mut().for_each(|x| *x /= sum);
                    for (mass, x) in masses[*c][first..].iter_mut().zip(own) {
                        *mass += x;
                    }
                }
            }
        }
    }
}

/// For each condition, by place of θ, then by node of b: the density of θ given b, with this
/// variance.
fn kernels(of: &Parameters, places: &Axis, nodes: &Nodes, variance: f64) -> Vec<Vec<f64>> {
    let of_mean = |mean: &f64| {
        let places = (0..places.n).map(|k| places.at(k) - mean);
        let at_nodes = |x: f64| {
            let nodes = nodes.nodes.iter();
            nodes.map(move |(b, _)| normal(x - b, variance))
        };
        places.flat_map(at_nodes).collect()
    };
    of.means.iter().map(of_mean).collect()
}

/// The density at x of a normal distribution about 0; 0 beyond ten standard deviations.
fn normal(x: f64, variance: f64) -> f64 {
    let square = x * x;
    if square > 100.0 * variance {
        return 0.0;
    }
    (-0.5 * square / variance).exp() / (2.0 * PI * variance).sqrt()
}

/// Σ aᵢbᵢ in four sums, in an order of its own.
fn sum_of_products(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = (a.remainder().iter().zip(b.remainder()))
        .map(|(x, y)| x * y)
        .sum();
    for (x, y) in a.zip(b) {
        for i in 0..4 {
            sums[i] += x[i] * y[i];
        }
    }
    sums[0] + sums[1] + (sums[2] + sums[3]) + rest
}
